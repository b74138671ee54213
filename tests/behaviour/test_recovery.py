"""What goes wrong with peers, paths, doors and places is got over."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

import state_machines as fsm
from state_machines.exceptions import CallError, UnavailableError
from surveillance_behaviour.mission.recovery import Failure, Recovery, RecoveryLimits
from surveillance_behaviour.ports import Point

from .machine_runs import CALLS, Run, visited
from .scripted_world import POSITIONS, SEVEN_ROOMS, World, fails, started_again

pytestmark = pytest.mark.early


@pytest.mark.parametrize(('times', 'over'), [(2, 100.0), (20, 1100.0)])
@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_peer_that_fails_is_got_over(name: str, call: str, times: int, over: float) -> None:
    world = World(draw=0.4)
    world.faults = fails(call, times)
    run = Run(name, world).until(700.0 + over)
    assert any('scripted fault' in text for text in world.said)
    assert visited(world, since=over) == set(SEVEN_ROOMS)
    assert world.stranded == 0
    assert run.mission.failure is None


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_peer_that_stays_away_is_cried_about_and_waited_for(name: str, call: str) -> None:
    world = World()

    def begin() -> None:
        world.faults = fails(call)
        world.set_level(10.0)

    world.clock.after(100.0, begin)
    Run(name, world).until(1000.0)
    if call in ('start', 'wait_until_built'):
        assert not world.cries, 'asked at the start only'
        return
    assert any('scripted fault' in cry for cry in world.cries)
    assert world.cries.count('') >= 3, 'it goes on trying'


def test_a_place_that_is_given_up_again_is_left_alone_for_twice_as_long() -> None:
    recovery = Recovery(RecoveryLimits(path_tries=1, avoid_seconds=60.0, longest_avoid=300.0))
    now = 0.0
    for seconds in (60.0, 120.0, 240.0, 300.0, 300.0):
        recovery.next_step(Failure('move', 'no way', 'R1'), now)
        assert recovery.avoided(now + seconds - 0.5) == {'R1'}
        now += seconds
        assert recovery.avoided(now) == set()


def test_a_peer_that_is_away_is_waited_for_at_once(machine: str) -> None:
    world = World()
    world.faults = fails('plan', 3, 'no server', UnavailableError)
    Run(machine, world).until(60.0)
    assert len([cry for cry in world.cries if 'no server' in cry]) == 3
    assert not any('another' in text for text in world.said)
    assert world.arrivals


def test_the_return_of_a_peer_ends_the_pause(machine: str) -> None:
    world = World()
    right, tries = world.plan_path, []

    def plan(*args: object) -> object:
        tries.append(world.clock.time)
        if is_back():
            return right(*args)  # type: ignore[arg-type]
        raise UnavailableError('plan: no server', is_back)

    def is_back() -> bool:
        return not 60.0 < world.clock.time < 180.0

    world.plan_path = plan  # type: ignore[method-assign, assignment]
    Run(machine, world).until(400.0)
    assert len([at for at in tries if 60.0 < at < 180.0]) < 10
    # At once: the place was explored before.
    assert 180.0 <= min(at for at in tries if at >= 180.0) < 180.5


def test_a_peer_that_was_started_again_is_asked_at_once_without_a_cry(machine: str) -> None:
    undisturbed, world = World(), World()
    Run(machine, undisturbed).until(60.0)
    world.faults = fails('plan', 2, 'another server', started_again)
    Run(machine, world).until(60.0)
    assert not any(world.cries)
    assert world.arrivals[0] == undisturbed.arrivals[0]


def test_a_peer_that_is_there_and_fails_has_the_whole_pause(machine: str) -> None:
    world = World()
    world.faults = fails('plan', 9, 'no answer', started_again)
    Run(machine, world).until(200.0)
    assert len([cry for cry in world.cries if 'no answer' in cry]) == 3  # each third time
    assert min(time for time, _ in world.arrivals) > 2.0 + 4.0 + 8.0


WRONG_PATHS: list[tuple[list[Point], str]] = [
    ([], 'the path has no points'),
    ([(math.nan, 0.0, 0.0)], 'a point that is not finite'),
    ([(90.0, 90.0, 0.0)], 'from the goal, expected at most 1 m'),
]


@pytest.mark.parametrize(('path', 'words'), WRONG_PATHS)
def test_a_wrong_path_is_asked_for_again(machine: str, path: list[Point], words: str) -> None:
    world = World()
    right = world.plan_path
    wrong = iter([path] * 2)
    world.plan_path = lambda start, goal, interrupt: (
        next(  # type: ignore[method-assign]
            wrong, None
        )
        or ([] if path == [] and next(wrong, None) == [] else right(start, goal, interrupt))
    )
    Run(machine, world).until(600.0)
    assert any(words in text for text in world.said)
    assert visited(world) == set(SEVEN_ROOMS)
    assert all(math.isfinite(value) for value in world.at)


def test_a_robot_that_stops_short_tries_again(machine: str) -> None:
    world = World()
    right = world._drive
    times = [0]

    def stops_short(path: list[Point], interrupt: fsm.Interrupt) -> Point:
        times[0] += 1
        return right(path[:-1] if times[0] % 5 == 0 and len(path) > 2 else path, interrupt)

    world._drive = stops_short  # type: ignore[method-assign, assignment]
    run = Run(machine, world).until(1800.0)
    assert any('stopped' in text and 'short' in text for text in world.said)
    assert visited(world, since=1000.0) == set(SEVEN_ROOMS)
    assert run.mission.place == world.is_in


def test_a_blocked_door_is_gone_around(machine: str) -> None:
    if machine == 'patrol':
        pytest.skip('the planner goes round there')
    world = World()
    right = world.plan_path
    blocked = {POSITIONS['E'], POSITIONS['C1']}

    def plan(start: Point, goal: Point, interrupt: fsm.Interrupt) -> list[Point]:
        if {start, goal} == blocked:
            raise CallError('compute_path: a closed door is in the way')
        return right(start, goal, interrupt)

    world.plan_path = plan  # type: ignore[method-assign]
    Run(machine, world).until(900.0)
    assert any('trying the way round: E - C2 - C1' in text for text in world.said)
    assert visited(world) == set(SEVEN_ROOMS)
    assert not world.cries


def test_a_place_that_disappears_is_left_out(machine: str) -> None:
    world = World()

    def vanish() -> None:
        del world.rooms['R3']
        del world.positions['R3']

    world.clock.after(100.0, vanish)
    Run(machine, world).until(900.0)
    assert visited(world, since=500.0) == set(SEVEN_ROOMS) - {'R3'}


def test_a_closed_door_leaves_the_rest_and_an_opened_one_brings_it_back(machine: str) -> None:
    world = World()
    world.clock.after(100.0, lambda: world.closed.add('D4'))
    world.clock.after(700.0, world.closed.clear)
    Run(machine, world).until(1500.0)
    between = {place for time, place in world.arrivals if 150.0 < time < 690.0}
    assert between == set(SEVEN_ROOMS) - {'R4'}
    assert 'R4' in visited(world, since=700.0)


def test_a_robot_that_is_shut_in_cries_for_help_and_goes_on_when_freed(machine: str) -> None:
    world = World()
    world.clock.after(100.0, lambda: world.closed.update(f'D{n}' for n in range(1, 8)))
    world.clock.after(400.0, world.closed.clear)
    Run(machine, world).until(1500.0)
    assert any('nothing can be reached' in cry for cry in world.cries)
    assert visited(world, since=500.0) == set(SEVEN_ROOMS)


def test_a_door_that_opens_ends_the_pause(machine: str) -> None:
    world = World()
    went_on: list[float] = []
    world.waiting_for_help = lambda reason: went_on.append(world.clock.time)  # type: ignore[method-assign]
    world.clock.after(100.0, lambda: world.closed.update(f'D{n}' for n in range(1, 8)))
    world.clock.after(250.0, world.closed.clear)
    Run(machine, world).until(400.0)
    assert max(at for at in went_on if at < 245.0) < 240.0, 'it is in a long pause'
    assert 250.0 <= min(at for at in went_on if at >= 245.0) < 252.0


def test_an_ontology_that_hangs_makes_no_pause_longer(machine: str) -> None:
    world = World()
    cries: list[tuple[float, str]] = []

    def hangs(interrupt: fsm.Interrupt) -> frozenset[str]:
        world.clock.sleep(5.0, interrupt)
        raise CallError('armor: no answer')

    world.waiting_for_help = lambda reason: cries.append((world.clock.time, reason))  # type: ignore[method-assign]
    world.reachable = hangs  # type: ignore[method-assign]
    world.clock.after(100.0, lambda: world.closed.update(f'D{n}' for n in range(1, 8)))
    Run(machine, world).until(1000.0)
    pauses = [end - begin for (begin, reason), (end, _) in pairwise(cries) if reason]
    assert 60.0 <= max(pauses) <= 66.0
    assert 'open a door or remove the obstacle; next try' in max(text for _, text in cries)


def test_an_ontology_that_lost_the_robot_is_waited_for(machine: str) -> None:
    world = World()
    right = world.snapshot

    def snapshot(*args: object) -> object:
        if 100.0 < world.clock.time < 130.0:
            raise CallError('armor: ontology map has Robot1 in no place')
        return right(*args)  # type: ignore[arg-type]

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    Run(machine, world).until(600.0)
    assert any('in no place' in text for text in world.said)
    assert visited(world, since=200.0) == set(SEVEN_ROOMS)


def test_whoever_helps_a_robot_that_does_not_know_where_it_is_is_told_how(machine: str) -> None:
    world = World()
    cries: list[str] = []

    def snapshot(*_args: object) -> object:
        raise CallError('armor: ontology map has Robot1 in no place')

    world.snapshot = snapshot  # type: ignore[method-assign, assignment]
    world.waiting_for_help = cries.append  # type: ignore[method-assign, assignment]
    Run(machine, world).until(60.0)
    assert any('in an unknown place' in cry for cry in cries)
    assert any('or tell its pose on initialpose; next try' in cry for cry in cries)
    assert not any('open a door' in cry for cry in cries)
