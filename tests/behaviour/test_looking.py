"""A room is looked at within its time, and again at what is in doubt; in both machines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import state_machines as fsm
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.looking import RoomInspection, one_way
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_behaviour.ports import Check, Doubt, Point
from surveillance_runtime.event_log import read

from .machine_runs import settings
from .scripted_world import World


class ScriptedLooking:
    """Viewpoints and doubts in a scripted world."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.points: dict[str, list[Point]] = {}
        self.waiting: list[Doubt] = []
        self.driven: list[tuple[float, Point]] = []
        self.fails = False
        self.arm = False
        self.around = False
        self.ready_at = 0.0
        self.front = 0.0
        self.camera = 0
        self.sides: list[tuple[str, int]] = []
        self.rests: list[float] = []
        self.asked: dict[str, list[Check]] = {}
        self.angle: float | None = None
        self.blind: set[int] = set()
        self.faced_at, self.picture_period = 0.0, 1.8

    def viewpoints(self, place: str) -> Sequence[Point]:
        return self.points.get(place, [])

    def doubts(self, place: str) -> Sequence[Doubt]:
        return [each for each in self.waiting if each.place == place]

    def checks(self, place: str) -> Sequence[Check]:
        return self.asked.get(place, [])

    def camera_angle(self) -> float | None:
        return self.angle

    def saw(self, bearing: float) -> int:
        if round(math.degrees(bearing)) % 360 in self.blind:
            return 0
        since = self.world.clock.time - self.faced_at
        return int(since / self.picture_period)

    def position(self) -> Point | None:
        return self.world.at

    def sees_around(self) -> bool:
        return self.around

    def has_arm(self) -> bool:
        return self.arm

    def heading(self) -> float:
        return self.front

    def await_watcher(self, interrupt: Interrupt) -> None:
        self.world.clock.sleep(max(0.0, self.ready_at - self.world.clock.time), interrupt)

    def face(self, bearing: float, interrupt: Interrupt) -> None:
        self.camera = round(math.degrees(bearing)) % 360
        if not self.world.clock.sleep(2.0, interrupt):
            raise CallInterruptedError
        self.faced_at = self.world.clock.time
        if not self.arm:
            self.front = bearing
        self.sides.append((self.world.place, self.camera))

    def rest_arm(self) -> None:
        self.rests.append(self.world.clock.time)
        self.camera = round(math.degrees(self.front)) % 360

    def drive(self, point: Point, interrupt: Interrupt) -> None:
        if self.fails:
            raise CallError('follow_path: the goal was aborted')
        self.world._drive([point], interrupt)
        self.driven.append((self.world.clock.time, point))
        self.waiting = [each for each in self.waiting if each.look_from != point]


class Watched:
    """A machine whose robot looks, run up to a time."""

    def __init__(
        self,
        machine: str,
        *,
        record: MissionRecord | None = None,
        world: World | None = None,
        **choice: object,
    ) -> None:
        self.world = world or World(speed=1.0)
        self.looking = ScriptedLooking(self.world)
        mission = self.world.mission(settings(**choice), record, machine=machine)
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
    assert run.looking.sides
    assert len({place for _, place in run.world.arrivals}) >= 3


def test_a_short_stay_leaves_no_time_to_look():
    run = Watched('surveillance', exploration_seconds=2.0)
    run.looking.points = {'C1': [(9.0, 8.0, 0.0)], 'C2': [(9.0, 12.0, 0.0)]}
    run.until(150.0)
    assert not run.looking.driven
    assert not run.looking.sides
    said = [each for each in run.world.said if 'too short to look' in each]
    assert said == [
        'a stay of 2 s is too short to look at anything: exploration_seconds of 12 or more would do'
    ]


@pytest.mark.parametrize(
    ('seconds', 'first'),
    [
        (8.0, []),
        (12.0, [90, 0]),
        (18.0, [90, 180, 0]),
        (40.0, [90, 180, 270, 0]),
    ],
)
def test_the_arm_looks_at_as_many_sides_as_the_time_allows_in_one_sweep(seconds, first):
    run = Watched('surveillance', exploration_seconds=seconds)
    run.looking.arm = True
    run.until(300.0)
    place = run.world.arrivals[0][1]
    assert [side for where, side in run.looking.sides if where == place][: len(first)] == first


@pytest.mark.parametrize(('seconds', 'count'), [(8.0, 0), (12.0, 1), (18.0, 2), (40.0, 4)])
def test_a_base_without_an_arm_turns_to_as_many_sides_as_the_time_allows(seconds, count):
    run = Watched('surveillance', exploration_seconds=seconds)
    run.until(150.0)
    stays = dict.fromkeys(place for place, _ in run.looking.sides)
    for place in list(stays)[:1]:
        sides = [side for where, side in run.looking.sides if where == place]
        assert len(set(sides[:count])) == count
        assert set(sides) <= {0, 90, 180, 270}
    assert bool(stays) == bool(count)


def test_a_base_that_has_time_for_one_side_looks_at_another_one_in_each_visit():
    run = Watched('surveillance', exploration_seconds=12.0)
    run.until(900.0)
    by_place: dict[str, list[int]] = {}
    for place, side in run.looking.sides:
        by_place.setdefault(place, []).append(side)
    often = max(by_place.values(), key=len)
    assert sorted(often[:4]) == [0, 90, 180, 270]


@pytest.mark.parametrize(
    ('ahead', 'sides', 'order'),
    [
        (0, [0, 90, 180, 270], [0, 90, 180, 270]),
        (10, [0, 90, 180, 270], [0, 270, 180, 90]),
        (80, [0, 90, 180, 270], [90, 180, 270, 0]),
        (200, [90, 180], [180, 90]),
        (300, [], []),
    ],
)
def test_the_base_passes_the_sides_in_the_shorter_turn(ahead, sides, order):
    passed = one_way([math.radians(each) for each in sides], math.radians(ahead))
    assert [round(math.degrees(each)) for each in passed] == order


@pytest.mark.parametrize('arm', [False, True])
def test_who_sees_all_around_stands_at_each_viewpoint_and_turns_nothing(arm: bool):
    run = Watched('surveillance', exploration_seconds=25.0)
    run.looking.arm, run.looking.around = arm, True
    run.looking.points = {'C1': [(9.0, 8.0, 0.0), (11.0, 8.5, 0.0)]}
    run.until(150.0)
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
    by_place: dict[str, list[int]] = {}
    for place, side in run.looking.sides:
        if side != 0:
            by_place.setdefault(place, []).append(side)
    often = max(by_place.values(), key=len)
    assert often[:3] == [90, 180, 270]


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
@pytest.mark.parametrize('seconds', [1.0, 4.0, 8.0, 14.0, 20.0])
def test_whatever_ends_a_look_the_arm_looks_ahead_again(machine: str, seconds: float):
    whole = Watched(machine, exploration_seconds=40.0)
    whole.looking.arm = True
    began = 0.0 if machine == 'surveillance' else whole.until(300.0).world.arrivals[0][0]
    run = Watched(machine, exploration_seconds=40.0)
    run.looking.arm = True
    run.until(began + seconds)
    assert run.looking.sides or run.looking.camera or seconds < 3.0
    # While it is turned aside, something else ends the look.
    assert run.looking.camera == 0


def test_a_low_battery_that_ends_a_look_leaves_the_arm_ahead():
    run = Watched('surveillance', exploration_seconds=40.0)
    run.looking.arm = True
    run.world.clock.after(4.0, lambda: run.world.set_level(5.0))
    run.until(6.0)
    assert run.looking.camera == 0
    assert len(run.looking.rests) == 2, 'at the start, and when the battery got low'


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_an_arm_that_an_earlier_process_left_aside_is_brought_ahead_before_the_robot_drives(
    machine: str,
):
    run = Watched(machine, exploration_seconds=2.0)
    run.looking.arm, run.looking.camera = True, 90
    run.until(60.0)
    assert run.looking.rests[0] < run.world.arrivals[0][0]


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_the_first_look_waits_until_somebody_watches(machine: str):
    run = Watched(machine, exploration_seconds=12.0)
    run.looking.arm, run.looking.ready_at = True, 60.0
    asked: list[float] = []
    run.looking.face = lambda *_: asked.append(run.world.clock.time)  # type: ignore[method-assign]
    run.until(100.0)
    assert asked
    assert min(asked) >= 60.0


@pytest.mark.parametrize('machine', ['surveillance', 'patrol'])
def test_a_look_that_was_cut_off_is_gone_on_with_where_it_was(machine: str, tmp_path: Path):
    file = tmp_path / 'events.jsonl'
    first = Watched(machine, record=MissionRecord(file), exploration_seconds=24.0)
    first.looking.arm = True
    after = 7.0
    if machine == 'patrol':
        after = first.until(300.0).world.arrivals[0][0] + 7.0
        file.unlink()
        first = Watched(machine, record=MissionRecord(file), exploration_seconds=24.0)
        first.looking.arm = True
    first.until(after)
    place, side = first.looking.sides[-1]
    assert side == 90
    # A process that is killed writes no end.
    kept = [each for each in file.read_text().splitlines() if '"end"' not in each]
    file.write_text('\n'.join(kept) + '\n')
    again = Watched(
        machine, record=MissionRecord(file), world=first.world, exploration_seconds=24.0
    )
    again.looking.arm = True
    again.until(after + 60.0)
    assert again.looking.sides[:2] == [(place, 180), (place, 0)]
    looks = [each for each in read(file) if each.name == 'look']
    assert looks[0].fields['place'] == place
    assert looks[0].fields['sides'] == [180]


def test_a_patrol_that_begins_anew_does_not_look_where_it_has_just_looked_around(tmp_path: Path):
    record = MissionRecord(tmp_path / 'events.jsonl')
    run = Watched('patrol', record=record, exploration_seconds=40.0)
    run.looking.arm = True
    run.until(100.0)
    assert run.looking.sides[0][0] != run.world.decisions[0].from_place


def test_where_time_is_short_the_viewpoint_that_shows_most_comes_first():
    run = Watched('surveillance', exploration_seconds=17.5)
    far, near = (13.0, 8.0, 0.0), (10.6, 8.0, 0.0)
    run.looking.points = {'C1': [far, near]}
    run.until(200.0)
    assert run.looking.driven[0][1] == far


@pytest.mark.parametrize(('speed', 'driven'), [(0.5, True), (0.1, False)])
def test_a_slow_robot_begins_no_way_that_its_time_does_not_allow(speed: float, driven: bool):
    run = Watched('surveillance', exploration_seconds=17.5, speed=speed)
    run.looking.points = {'C1': [(11.5, 8.0, 0.0)]}
    run.until(200.0)
    assert bool(run.looking.driven) is driven


def test_the_robot_stays_at_its_station():
    run = Watched('surveillance', exploration_seconds=40.0)
    run.looking.points = {'E': [(4.0, 9.0, 0.0)]}
    run.until(39.0)
    assert not run.looking.driven
    assert not run.looking.sides


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


def stays(record: MissionRecord, place: str) -> list[dict[str, object]]:
    """Return what the record says of each look at a place."""
    looks = [each for each in read(record.path) if each.name == 'look']
    return [dict(each.fields) for each in looks if each.fields['place'] == place]


def test_a_viewpoint_that_one_stay_leaves_out_comes_first_in_the_next_also_after_a_restart(
    tmp_path: Path,
):
    file = tmp_path / 'events.jsonl'
    points: list[Point] = [(12.0, 8.0, 0.0), (8.0, 8.0, 0.0), (10.0, 10.0, 0.0)]

    def watched(world: World | None = None) -> Watched:
        record = MissionRecord(file)
        run = Watched('surveillance', record=record, world=world, exploration_seconds=12.0)
        run.looking.points = {'C1': points}
        run.looking.around = True
        return run

    run = watched().until(400.0)
    driven = [point for _, point in run.looking.driven]
    assert driven[:3] == points, 'one fits into each stay'
    assert len(run.looking.driven) > 3
    kept = [each for each in file.read_text().splitlines() if '"end"' not in each]
    file.write_text('\n'.join(kept) + '\n')
    again = watched(run.world).until(run.world.clock.time + 300.0)
    following = [point for _, point in again.looking.driven]
    order = [*driven, *following]
    assert all(order[n] != order[n + 1] for n in range(len(order) - 1))
    assert following[:2] == [points[len(driven) % 3], points[(len(driven) + 1) % 3]]


def test_a_stay_too_short_for_a_viewpoint_is_told_once():
    run = Watched('surveillance', exploration_seconds=12.0)
    run.looking.points = {'C1': [(60.0, 8.0, 0.0)]}
    run.until(900.0)
    (line,) = [each for each in run.world.said if 'viewpoints' in each]
    assert 'C1: nobody looks from 1 of 1 viewpoints: a stay of 12 s is too short' in line
    assert not run.looking.driven


def test_a_camera_that_shows_little_is_turned_to_more_sides():
    run = Watched('surveillance', exploration_seconds=60.0)
    run.looking.angle = math.radians(60.0)
    run.until(200.0)
    place = run.looking.sides[0][0]
    sides = [side for where, side in run.looking.sides if where == place]
    assert sorted(set(sides)) == [0, 51, 103, 154, 206, 257, 309], 'they overlap a little'


def test_a_side_of_which_no_picture_was_looked_at_is_not_called_looked_at(tmp_path: Path):
    record = MissionRecord(tmp_path / 'events.jsonl')
    run = Watched('surveillance', record=record, exploration_seconds=60.0)
    run.looking.arm, run.looking.blind = True, {90, 180}
    run.until(70.0)
    place = run.looking.sides[0][0]
    (look,) = stays(record, place)
    assert look['sides'] == [270, 0]
    assert look['unseen'] == [90, 180]
    bearings = [each.fields.get('bearing') for each in read(record.path)]
    assert not {90, 180} & set(bearings)
    turned = [side for where, side in run.looking.sides if where == place]
    assert turned == [90, 180, 270, 0, 0], 'it goes on all the same'


@pytest.mark.parametrize('arm', [False, True])
def test_what_the_rules_ask_for_is_looked_at_before_all_else(arm: bool, tmp_path: Path):
    record = MissionRecord(tmp_path / 'events.jsonl')
    run = Watched('surveillance', record=record, exploration_seconds=40.0)
    run.looking.arm = arm
    here = (12.0, 8.0, 0.0)
    run.looking.asked = {
        'C1': [
            Check('marker 21', (12.0, 6.0, 0.0), here),
            Check('marker 22', (10.0, 9.0, 0.0)),
        ]
    }
    run.until(120.0)
    in_c1 = [side for where, side in run.looking.sides if where == 'C1']
    assert in_c1[0] == 270, 'from where it is read best, downwards'
    assert run.looking.driven[0][1] == here
    first = stays(record, 'C1')[0]
    assert first['checks'] == ['marker 21', 'marker 22']
    assert first['sides'], 'half of the time is for the rest'


def test_where_there_is_time_for_one_thing_it_is_a_check_in_every_other_stay():
    run = Watched('surveillance', exploration_seconds=12.0)
    run.looking.arm = True
    run.looking.asked = {
        'C1': [Check('marker 21', (20.0, 8.0, 0.0)), Check('marker 22', (10.0, 1.0, 0.0))]
    }
    run.until(900.0)
    aside = [side for where, side in run.looking.sides if where == 'C1']
    assert len(aside) > 6
    looked = run.mission.looked.to_json()['C1']
    assert {'marker 21', 'marker 22', '90', '180'} <= set(looked)


def test_a_check_that_is_not_settled_comes_first_three_times_and_then_takes_its_turn():
    run = Watched('surveillance', exploration_seconds=12.0)
    run.looking.arm = True
    below, above = (0.0, -2.0, 0.0), (20.0, 18.0, 0.0)
    run.looking.asked = {'C1': [Check('marker 21', below), Check('marker 22', above, is_open=True)]}
    run.until(900.0)
    order = [side for where, side in run.looking.sides if where == 'C1' and side in (45, 225)]
    assert order[:7] == [45, 45, 45, 225, 45, 225, 45]


class Stay:
    """Looks at one room, and what happened in it by its seconds, in few words."""

    def __init__(self, **setup: object) -> None:
        self.run = Watched('surveillance', speed=float(str(setup.pop('speed', 1.0))))
        self.world, self.looking = self.run.world, self.run.looking
        self.lines: list[str] = []
        for name, value in setup.items():
            setattr(self.looking, name, value)
        for name in ('face', 'drive', 'rest_arm'):
            setattr(self.looking, name, self._noting(name, getattr(self.looking, name)))
        self.run.mission.note = self._note  # type: ignore[method-assign]
        self.look = RoomInspection(self.run.mission)
        self.put('C1')

    def put(self, place: str) -> None:
        """Put the robot into a room, at its own point."""
        self.world.push(place)
        self.run.mission.place = place

    def _at(self) -> str:
        return f'{self.world.clock.time - self.began:g}'

    def _noting(self, name: str, call: Any) -> Any:
        def noted(*words: Any) -> None:
            what = {
                'face': lambda: f'face {round(math.degrees(words[0])) % 360}',
                'drive': lambda: f'drive to {words[0][0]:g}, {words[0][1]:g}',
                'rest_arm': lambda: 'arm ahead',
            }[name]()
            self.lines.append(f'{self._at()} {what}')
            call(*words)

        return noted

    def _note(self, event: str, **fields: object) -> None:
        more = {k: v for k, v in fields.items() if k not in ('place', 'seconds')}
        if event != 'exploring' or more:
            self.lines.append(f'{self._at()} {event} {more}'.replace("'", ''))

    def explore(self, seconds: float, explored: float = 0.0) -> list[str]:
        """Return what happened in a stay of so many seconds."""
        self.began, self.lines = self.world.clock.time, []
        self.world.said.clear()
        self.run.mission.explored = explored
        self.look.explore(seconds, Interrupt())
        assert self.world.clock.time - self.began >= seconds - explored - 1e-9
        assert self.run.mission.explored == math.inf
        return self.lines + [f'said {each}' for each in self.world.said]


@pytest.mark.parametrize(('period', 'stands'), [(1.8, 5.5), (3.0, 9.0), (100.0, 13.5)])
def test_at_a_check_the_robot_stands_until_enough_pictures_were_looked_at(period, stands):
    asked = {'C1': [Check('marker 21', (20.0, 8.0, 0.0))]}
    first, following = Stay(arm=True, picture_period=period, asked=asked).explore(60.0)[:2]
    assert first == '0 face 0'
    assert float(following.split()[0]) - 2.0 == pytest.approx(stands, abs=0.51)


def test_at_a_check_the_robot_stands_until_it_is_settled():
    stay = Stay(arm=True)

    def checks(place: str) -> Sequence[Check]:
        is_open = 0.0 < stay.world.clock.time - stay.looking.faced_at < 9.0
        return [Check('marker 21', (20.0, 8.0, 0.0), is_open=is_open)]

    stay.looking.checks = checks  # type: ignore[method-assign]
    first, following = stay.explore(60.0)[:2]
    assert first == '0 face 0'
    assert float(following.split()[0]) - 2.0 == pytest.approx(9.0, abs=0.51)


TWO_POINTS = {'C1': [(12.0, 8.0, 0.0), (10.0, 11.0, 0.0)]}


@pytest.mark.parametrize(
    ('seconds', 'setup', 'expected'),
    [
        (
            30.0,
            {'arm': True},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 face 180',
                '13 exploring {bearing: 180}',
                '13 face 270',
                '19.5 exploring {bearing: 270}',
                '19.5 face 0',
                '21.5 look {sides: [90, 180, 270], left_out: 0}',
            ],
        ),
        (
            30.0,
            {},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 face 180',
                '13 exploring {bearing: 180}',
                '13 face 270',
                '19.5 exploring {bearing: 270}',
                '19.5 look {sides: [90, 180, 270], left_out: 0}',
            ],
        ),
        (
            30.0,
            {'around': True, 'points': TWO_POINTS},
            [
                '4 drive to 12, 8',
                '6 viewpoint {point: [12.0, 8.0]}',
                '10 drive to 10, 11',
                '13.6056 viewpoint {point: [10.0, 11.0]}',
                '17.6056 look {sides: [], left_out: 0}',
            ],
        ),
        (
            20.0,
            {'around': True, 'points': TWO_POINTS},
            [
                '4 drive to 12, 8',
                '6 viewpoint {point: [12.0, 8.0]}',
                '10 look {sides: [], left_out: 1}',
            ],
        ),
        (
            45.0,
            {'arm': True, 'points': TWO_POINTS},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 face 180',
                '13 exploring {bearing: 180}',
                '13 face 270',
                '19.5 exploring {bearing: 270}',
                '19.5 face 0',
                '21.5 drive to 12, 8',
                '23.5 viewpoint {point: [12.0, 8.0]}',
                '23.5 face 90',
                '30 exploring {bearing: 90, point: [12.0, 8.0]}',
                '30 face 0',
                '32 drive to 10, 11',
                '35.6056 viewpoint {point: [10.0, 11.0]}',
                '35.6056 face 90',
                '42.1056 exploring {bearing: 90, point: [10.0, 11.0]}',
                '42.1056 face 0',
                '44.1056 look {sides: [90, 180, 270, 90, 90], left_out: 0}',
            ],
        ),
        (
            25.0,
            {'arm': True, 'points': TWO_POINTS},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 face 0',
                '8.5 drive to 12, 8',
                '10.5 viewpoint {point: [12.0, 8.0]}',
                '10.5 face 90',
                '17 exploring {bearing: 90, point: [12.0, 8.0]}',
                '17 face 0',
                '19 look {sides: [90, 90], left_out: 1}',
            ],
        ),
        (
            60.0,
            {'points': TWO_POINTS},
            [
                '0 face 0',
                '6.5 exploring {bearing: 0}',
                '6.5 face 90',
                '13 exploring {bearing: 90}',
                '13 face 180',
                '19.5 exploring {bearing: 180}',
                '19.5 face 270',
                '26 exploring {bearing: 270}',
                '26 drive to 12, 8',
                '28 viewpoint {point: [12.0, 8.0]}',
                '28 face 0',
                '34.5 exploring {bearing: 0, point: [12.0, 8.0]}',
                '34.5 face 90',
                '41 exploring {bearing: 90, point: [12.0, 8.0]}',
                '41 face 180',
                '47.5 exploring {bearing: 180, point: [12.0, 8.0]}',
                '47.5 drive to 10, 11',
                '51.1056 viewpoint {point: [10.0, 11.0]}',
                '51.1056 face 270',
                '57.6056 exploring {bearing: 270, point: [10.0, 11.0]}',
                '57.6056 look {sides: [0, 90, 180, 270, 0, 90, 180, 270], left_out: 0}',
            ],
        ),
        (
            40.0,
            {
                'arm': True,
                'asked': {
                    'C1': [
                        Check('m1', (20.0, 8.0, 0.0)),
                        Check('m2', (10.0, 1.0, 0.0), (12.0, 8.0, 0.0)),
                    ]
                },
            },
            [
                '0 face 0',
                '7.5 exploring {check: m1}',
                '7.5 face 0',
                '9.5 drive to 12, 8',
                '11.5 face 254',
                '19 exploring {check: m2}',
                '19 face 0',
                '21 drive to 10, 8',
                '23 face 90',
                '29.5 exploring {bearing: 90}',
                '29.5 face 180',
                '36 exploring {bearing: 180}',
                '36 face 0',
                '38 look {sides: [90, 180], left_out: 0, checks: [m1, m2]}',
            ],
        ),
        (
            14.0,
            {'arm': True, 'asked': {'C1': [Check('m1', (20.0, 8.0, 0.0))]}},
            [
                '0 face 0',
                '7.5 exploring {check: m1}',
                '7.5 face 0',
                '9.5 look {sides: [], left_out: 0, checks: [m1]}',
            ],
        ),
        (
            30.0,
            {'asked': {'C1': [Check('m1', (20.0, 8.0, 0.0))]}, 'blind': {0}},
            [
                '0 face 0',
                '15.5 face 90',
                '22 exploring {bearing: 90}',
                '22 look {sides: [90], left_out: 0}',
            ],
        ),
        (
            20.0,
            {
                'waiting': [
                    Doubt(3, 'C1', (12.0, 8.0, 0.0), (14.0, 8.0, 0.0)),
                    Doubt(4, 'C1'),
                    Doubt(5, 'C1'),
                ],
                'arm': True,
            },
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 drive to 12, 8',
                '8.5 face 0',
                '10.5 arm ahead',
                '10.5 verify {number: 3, found: is settled}',
                '14.5 verify {number: 4, found: is still in doubt}',
                '14.5 face 0',
                '16.5 look {sides: [90], left_out: 0}',
                '20.5 verify {number: 5, found: is still in doubt}',
                'said looking again at event 3 in C1',
                'said looked again: event 3 is settled',
                'said looked again: event 4 is still in doubt',
                'said looked again: event 5 is still in doubt',
            ],
        ),
        (
            16.0,
            {'waiting': [Doubt(3, 'C1', (30.0, 8.0, 0.0))], 'around': True},
            [
                '4 look {sides: [], left_out: 0}',
                '8 verify {number: 3, found: is still in doubt}',
                'said looked again: event 3 is still in doubt',
            ],
        ),
        (
            30.0,
            {'fails': True, 'points': TWO_POINTS},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 drive to 12, 8',
                'said looking at C1: follow_path: the goal was aborted',
            ],
        ),
        (
            3.9,
            {'around': True},
            [
                'said a stay of 3.9 s is too short to look at anything: '
                'exploration_seconds of 4 or more would do'
            ],
        ),
        (4.0, {'around': True}, ['4 look {sides: [], left_out: 0}']),
        (
            8.5,
            {},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 look {sides: [90], left_out: 0}',
                'said a stay of 8.5 s may be too short to turn the camera to a side: '
                'exploration_seconds of 12 or more would do',
            ],
        ),
        (
            40.0,
            {'arm': True, 'angle': 2.0, 'front': 1.0, 'points': TWO_POINTS},
            [
                '0 face 90',
                '6.5 exploring {bearing: 90}',
                '6.5 face 180',
                '13 exploring {bearing: 180}',
                '13 face 57',
                '15 drive to 12, 8',
                '17 viewpoint {point: [12.0, 8.0]}',
                '17 face 90',
                '23.5 exploring {bearing: 90, point: [12.0, 8.0]}',
                '23.5 face 57',
                '25.5 drive to 10, 11',
                '29.1056 viewpoint {point: [10.0, 11.0]}',
                '29.1056 face 90',
                '35.6056 exploring {bearing: 90, point: [10.0, 11.0]}',
                '35.6056 face 57',
                '37.6056 look {sides: [90, 180, 90, 90], left_out: 0}',
            ],
        ),
        (
            33.0,
            {'speed': 0.2, 'points': TWO_POINTS, 'around': True},
            [
                '4 drive to 12, 8',
                '6 viewpoint {point: [12.0, 8.0]}',
                '10 look {sides: [], left_out: 1}',
            ],
        ),
    ],
)
def test_a_stay_goes_as_its_time_allows(
    seconds: float, setup: dict[str, object], expected: list[str]
) -> None:
    assert Stay(**setup).explore(seconds) == expected


def test_what_was_left_out_comes_first_and_what_was_looked_at_last() -> None:
    stay = Stay(arm=True)
    looks = [stay.explore(16.0)[-1] for _ in range(5)]
    assert looks == [
        '8.5 look {sides: [90], left_out: 0}',
        '8.5 look {sides: [180], left_out: 0}',
        '15 look {sides: [270, 0], left_out: 0}',
        '15 look {sides: [90, 180], left_out: 0}',
        '15 look {sides: [270, 0], left_out: 0}',
    ]
    # A stay that was cut off goes on with what is left of its time.
    assert stay.explore(16.0, explored=7.0) == [
        '0 face 90',
        '6.5 exploring {bearing: 90}',
        '6.5 face 0',
        '8.5 look {sides: [90], left_out: 0}',
    ]
    assert stay.explore(16.0, explored=99.0) == []
