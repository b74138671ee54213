"""A room is looked at within its time, and again at what is in doubt; in both machines."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import state_machines as fsm
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.ports import Doubt, Point, Side

from .machine_runs import settings
from .scripted_world import World


class ScriptedLooking:
    """Viewpoints and doubts in a scripted world."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.points: dict[str, list[Point]] = {}
        self.waiting: list[Doubt] = []
        self.driven: list[tuple[float, Point]] = []
        self.turns: list[float] = []
        self.fails = False
        self.arm = False
        self.around = False
        self.sides: list[tuple[str, Side]] = []

    def viewpoints(self, place: str) -> Sequence[Point]:
        return self.points.get(place, [])

    def doubts(self, place: str) -> Sequence[Doubt]:
        return [each for each in self.waiting if each.place == place]

    def position(self) -> Point | None:
        return self.world.at

    def sees_around(self) -> bool:
        return self.around

    def has_arm(self) -> bool:
        return self.arm

    def point_arm(self, side: Side, interrupt: Interrupt) -> None:
        if not self.world.clock.sleep(2.0, interrupt):
            raise CallInterruptedError
        self.sides.append((self.world.place, side))

    def drive(self, point: Point, interrupt: Interrupt) -> None:
        if self.fails:
            raise CallError('follow_path: the goal was aborted')
        self.world._drive([point], interrupt)
        self.driven.append((self.world.clock.time, point))
        self.waiting = [each for each in self.waiting if each.look_from != point]

    def turn(self, interrupt: Interrupt) -> None:
        if not self.world.clock.sleep(8.0, interrupt):
            raise CallInterruptedError
        self.turns.append(self.world.clock.time)


class Watched:
    """A machine whose robot looks, run up to a time."""

    def __init__(self, machine: str, **choice: object) -> None:
        self.world = World(speed=1.0)
        self.looking = ScriptedLooking(self.world)
        mission = self.world.mission(settings(**choice), machine=machine)
        mission.ports.looking = self.looking
        self.mission = mission
        self.machine = MACHINES[machine](mission)

    def until(self, seconds: float) -> Watched:
        self.world.clock.limit = seconds
        self.world.clock.on_limit = self.machine.request_preempt
        self.machine.execute()
        return self


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_a_room_is_looked_at_from_its_viewpoints_within_its_time(machine: str):
    run = Watched(machine, exploration_seconds=40.0)
    run.looking.points = {'C1': [(9.0, 8.0, 0.0), (11.0, 8.5, 0.0), (900.0, 8.0, 0.0)]}
    run.until(200.0)
    in_c1 = [point for _, point in run.looking.driven]
    assert set(in_c1) == {(9.0, 8.0, 0.0), (11.0, 8.5, 0.0)}
    assert run.looking.turns
    assert len({place for _, place in run.world.arrivals}) >= 3


def test_a_short_stay_leaves_no_time_to_look():
    run = Watched('surveillance', exploration_seconds=2.0)
    run.looking.points = {'C1': [(9.0, 8.0, 0.0)], 'C2': [(9.0, 12.0, 0.0)]}
    run.until(150.0)
    assert not run.looking.driven
    assert not run.looking.turns


@pytest.mark.parametrize(
    ('seconds', 'first'),
    [
        (8.0, []),
        (12.0, [Side.LEFT, Side.FRONT]),
        (18.0, [Side.LEFT, Side.BACK, Side.FRONT]),
        (40.0, [Side.LEFT, Side.BACK, Side.RIGHT, Side.FRONT]),
    ],
)
def test_the_arm_looks_at_as_many_sides_as_the_time_allows_in_one_sweep(seconds, first):
    run = Watched('surveillance', exploration_seconds=seconds)
    run.looking.arm = True
    run.until(300.0)
    place = run.world.arrivals[0][1]
    assert [side for where, side in run.looking.sides if where == place][: len(first)] == first


@pytest.mark.parametrize('arm', [False, True])
def test_who_sees_all_around_stands_at_each_viewpoint_and_turns_nothing(arm: bool):
    run = Watched('surveillance', exploration_seconds=25.0)
    run.looking.arm, run.looking.around = arm, True
    run.looking.points = {'C1': [(9.0, 8.0, 0.0), (11.0, 8.5, 0.0)]}
    run.until(150.0)
    assert not run.looking.turns
    assert not run.looking.sides
    (arrived, first), (_, second) = run.looking.driven[0], run.looking.driven[1]
    assert {first, second} == {(9.0, 8.0, 0.0), (11.0, 8.5, 0.0)}
    came = next(time for time, place in run.world.arrivals if place == 'C1')
    assert arrived - came > 4.0, 'it stood first, so that sweeps are compared'


def test_a_look_that_is_interrupted_is_not_called_a_problem():
    run = Watched('surveillance', exploration_seconds=40.0)
    run.looking.arm = True
    run.until(3.0)  # while the arm moves
    assert len(run.looking.sides) < 2
    assert not [line for line in run.world.said if line.startswith('looking at')]


def test_sides_that_one_visit_left_out_are_looked_at_in_the_next():
    run = Watched('surveillance', exploration_seconds=12.0)
    run.looking.arm = True
    run.until(900.0)
    by_place: dict[str, list[Side]] = {}
    for place, side in run.looking.sides:
        if side != Side.FRONT:
            by_place.setdefault(place, []).append(side)
    often = max(by_place.values(), key=len)
    assert often[:3] == [Side.LEFT, Side.BACK, Side.RIGHT]


def test_where_time_is_short_the_viewpoint_that_shows_most_comes_first():
    run = Watched('surveillance', exploration_seconds=11.5)
    far, near = (13.0, 8.0, 0.0), (10.6, 8.0, 0.0)
    run.looking.points = {'C1': [far, near]}
    run.until(200.0)
    assert run.looking.driven[0][1] == far


def test_the_robot_stays_at_its_station():
    run = Watched('surveillance', exploration_seconds=40.0)
    run.looking.points = {'E': [(4.0, 9.0, 0.0)]}
    run.until(39.0)
    assert not run.looking.driven
    assert not run.looking.turns


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_the_robot_looks_again_at_what_is_in_doubt_from_elsewhere_once(machine: str):
    run = Watched(machine, exploration_seconds=2.0)
    run.looking.waiting = [
        Doubt(3, 'C1', (8.5, 9.0, 0.0)),
        Doubt(4, 'C1'),
        Doubt(5, 'R4', (15.0, 16.0, 0.0)),
    ]
    run.until(60.0)
    assert [point for _, point in run.looking.driven][:1] == [(8.5, 9.0, 0.0)]
    said = ' '.join(run.world.said)
    assert 'looked again: event 3 is settled' in said
    assert said.count('looked again: event 4 is still in doubt') == 1


def test_what_cannot_be_driven_to_is_no_reason_to_stop():
    run = Watched('surveillance', exploration_seconds=40.0)
    run.looking.points = {'C1': [(9.0, 8.0, 0.0)]}
    run.looking.fails = True
    run.until(200.0)
    assert 'looking at C1: follow_path: the goal was aborted' in run.world.said
    assert not run.world.cries
    assert len({place for _, place in run.world.arrivals}) >= 3


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_a_machine_that_looks_has_no_dead_end(machine: str):
    built = Watched(machine).machine
    built.check_consistency()
    labels = {'surveillance': 'PERFORM_ROOM_TASKS', 'patrol': 'Looking'}
    assert isinstance(built[labels[machine]], fsm.State)
