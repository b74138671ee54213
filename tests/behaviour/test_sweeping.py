"""A visit covers all of a place that is swept; what cannot be reached is left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.machines.surveillance_machine import drive
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.mission_log import MissionRecord, summarize
from surveillance_behaviour.mission.sweeping import MOST_FAILURES, PlaceSweep
from surveillance_behaviour.ports import Point
from surveillance_runtime.event_log import read

from .machine_runs import settings
from .scripted_world import World


class ScriptedSweep:
    """Three stops in each place, ten seconds apart."""

    def __init__(self, world: World, swept: tuple[str, ...] = ()) -> None:
        self.world, self.swept = world, swept
        self.since: list[float] = []
        self.stops: list[Point] = []
        self.left_out: list[Point] = []
        self.ended: list[float | None] = []
        self.blocked: set[float] = set()
        self.is_known = True
        self.stands_at: Point | None = None

    def is_swept(self, place: str) -> bool:
        return place in self.swept

    def threshold(self, place: str) -> float:
        return 60.0

    def begin(self, place: str, since: float) -> float | None:
        self.since.append(since)
        self.stops = [(x, 0.0, 0.0) for x in (1.0, 2.0, 3.0, 4.0, 5.0)]
        return 30.0 if self.is_known else None

    def next_stop(self) -> Point | None:
        return self.stops.pop(0) if self.stops else None

    def leave_out(self, stop: Point) -> None:
        self.left_out.append(stop)

    def drive(self, stop: Point, interrupt: Interrupt) -> None:
        if not self.world.clock.sleep(10.0, interrupt):
            raise CallInterruptedError
        if stop[0] in self.blocked:
            raise CallError('compute_path: the goal was aborted')

    def position(self) -> Point | None:
        return self.stands_at

    def end(self, seconds: float | None) -> tuple[float, float]:
        self.ended.append(seconds)
        return 0.97, 31.0

    def covered(self) -> Mapping[str, float]:
        return {'E': 0.978, 'R1': 0.0}


def swept_mission(
    world: World, port: ScriptedSweep, record: MissionRecord | None = None, **choice: object
) -> Mission:
    world.told = []  # type: ignore[attr-defined]
    world.record_coverage = (  # type: ignore[method-assign]
        lambda covered, interrupt: world.told.append(dict(covered))  # type: ignore[attr-defined]
    )
    mission = world.mission(settings(**choice), record)
    mission.ports = replace(mission.ports, sweeping=port)
    mission.begin(Interrupt())
    return mission


@pytest.fixture
def hall() -> World:
    """Return a world of one place."""
    return World(rooms={'E': ['D6']}, positions={'E': (0.0, 0.0, 0.0)})


def test_the_only_place_is_swept_whenever_the_robot_decides(hall: World, tmp_path: Path) -> None:
    port = ScriptedSweep(hall)
    with MissionRecord(tmp_path / 'record') as record:
        mission = swept_mission(hall, port, record)
        machine = MACHINES['surveillance'](mission)
        hall.clock.limit = 300.0
        hall.clock.on_limit = machine.request_preempt
        assert machine.execute() == 'preempted'
    assert len(port.ended) >= 4
    assert {decision.rule for decision in hall.decisions} == {'sweep'}
    assert 'R' not in hall.decisions[0].place
    assert not hall.cries
    assert hall.told[0] == {'E': 97, 'R1': 0}  # type: ignore[attr-defined]
    # All of it, however lately it was in view: there is nowhere else to go.
    assert port.since[0] == pytest.approx(0.0, abs=1.0)
    assert port.since[1] >= 50.0
    entries = [event for event in read(tmp_path / 'record') if event.name == 'sweep']
    assert entries[0].fields['covered'] == 0.97
    assert entries[0].fields['left_out'] == 0
    assert summarize(read(tmp_path / 'record')).distance >= 4 * 31.0
    assert any('swept E in 50 s: 97%' in said for said in hall.said)


def test_a_place_among_others_is_swept_where_that_is_asked_and_for_what_is_old() -> None:
    world = World()
    port = ScriptedSweep(world, ('R1',))
    mission = swept_mission(world, port)
    world.clock.time = 100.0
    PlaceSweep(mission).run(Interrupt())
    assert not port.since
    mission.place = 'R1'
    PlaceSweep(mission).run(Interrupt())
    assert port.since == [100.0 - 60.0 / 2]
    assert not mission.dock.is_docked


@pytest.mark.parametrize(
    ('rooms', 'swept', 'begins'),
    [
        ({'E': ['D6']}, (), (4.0, 0.0, 0.0)),
        ({'E': ['D6'], 'R1': ['D6']}, ('E',), (4.0, 0.0, 0.0)),
        # A stranger's pose begins no path where nothing moved the robot about.
        ({'E': ['D6'], 'R1': ['D6']}, (), (0.5, 0.0, 0.0)),
    ],
)
def test_after_a_sweep_a_path_begins_where_it_left_the_robot(
    rooms: dict[str, list[str]], swept: tuple[str, ...], begins: Point
) -> None:
    positions = {'E': (0.0, 0.0, 0.0), 'R1': (9.0, 0.0, 0.0)}
    world = World(rooms=rooms, positions={name: positions[name] for name in rooms})
    port = ScriptedSweep(world, swept)
    mission = swept_mission(world, port)
    world.at, port.stands_at = (0.5, 0.0, 0.0), (4.0, 0.0, 0.0)
    path, _ = drive(mission, next(reversed(rooms)), Interrupt())
    assert path[0] == begins


def test_a_stop_that_cannot_be_reached_is_left_out_and_told_once(hall: World) -> None:
    port = ScriptedSweep(hall)
    port.blocked = {2.0, 4.0}
    PlaceSweep(swept_mission(hall, port)).run(Interrupt())
    assert [stop[0] for stop in port.left_out] == [2.0, 4.0]
    assert port.ended == [50.0]
    assert any('sweeping E: (2.0, 0.0) is left out: compute_path' in said for said in hall.said)


def test_a_sweep_of_which_nothing_can_be_reached_ends(hall: World) -> None:
    port = ScriptedSweep(hall)
    port.blocked = {1.0, 2.0, 3.0, 4.0}
    PlaceSweep(swept_mission(hall, port)).run(Interrupt())
    assert len(port.left_out) == MOST_FAILURES
    assert port.ended == [None]


def test_a_threshold_that_no_sweep_can_keep_is_told_once(hall: World) -> None:
    port = ScriptedSweep(hall)
    port.threshold = lambda place: 20.0  # type: ignore[method-assign]
    sweep = PlaceSweep(swept_mission(hall, port))
    sweep.run(Interrupt())
    sweep.run(Interrupt())
    assert len([said for said in hall.said if 'takes 50 s, and its threshold is 20 s' in said]) == 1


def test_without_a_map_nothing_is_swept_and_an_interrupt_ends_a_sweep(hall: World) -> None:
    port = ScriptedSweep(hall)
    port.is_known = False
    mission = swept_mission(hall, port)
    PlaceSweep(mission).run(Interrupt())
    assert not port.ended
    port.is_known = True
    interrupt = Interrupt()
    hall.clock.after(15.0, interrupt.set)
    with pytest.raises(CallInterruptedError):
        PlaceSweep(mission).run(interrupt)
    assert port.ended == [None]
