"""Both machines charge in time, enough, and where they can."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from surveillance_behaviour.mission.mission_log import summarize
from surveillance_runtime.event_log import read

from .machine_runs import CALLS, Killed, Run, settings, visited
from .scripted_world import POSITIONS, SEVEN_ROOMS, World

pytestmark = pytest.mark.early


def test_an_hour_of_patrol_reaches_all_places_and_charges_in_time(machine: str) -> None:
    world = World(draw=0.8)
    run = Run(machine, world, settings(policy='tour')).until(3600.0)
    assert visited(world) == set(SEVEN_ROOMS)
    assert world.stranded == 0
    assert sum(decision.rule == 'recharge' for decision in world.decisions) >= 5
    assert not world.cries
    assert run.mission.failure is None


AT_THE_START = ('start', 'wait_until_built')
"""Calls that are made once, before the robot moves."""


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_battery_that_falls_during_any_call_is_charged_next(name: str, call: str) -> None:
    world = World()
    seen: list[float] = []
    if call == 'recharge':
        # It is called by who comes to charge alone.
        world.clock.after(70.0, lambda: world.set_level(15.0))

    def fall(called: str) -> None:
        begun = call in AT_THE_START or world.clock.time > 60.0
        if called == call and begun and not seen:
            seen.append(world.clock.time)
            world.set_level(12.0)

    world.faults = fall
    run = Run(name, world).until(300.0)
    assert seen
    if call in AT_THE_START:
        # It stands at its station, and leaves that when it has charged.
        charged, moved = (
            next(number for number, text in enumerate(world.said) if text.startswith(words))
            for words in ('charged in E to ', 'arrived in ')
        )
        assert charged < moved
    elif call == 'recharge':
        charges = [each.time for each in world.decisions if each.rule == 'recharge']
        assert len(charges) == 1, 'what fell while it charged is charged with the rest'
        assert charges[0] <= seen[0]
        assert world.level > 99.0
    else:
        after = [decision for decision in world.decisions if decision.time >= seen[0]]
        assert any(decision.rule == 'recharge' for decision in after[:2])
    assert world.level > 12.0
    assert run.mission.failure is None


def test_a_robot_that_came_to_charge_charges_enough(machine: str) -> None:
    world = World(draw=0.9, low_below=5.0)
    Run(machine, world, settings(urgency_threshold=90.0)).until(1200.0)
    times = [decision.time for decision in world.decisions if decision.rule == 'recharge']
    assert len(times) > 3
    assert min(later - sooner for sooner, later in itertools.pairwise(times)) > 40.0
    assert world.stranded == 0


def test_a_station_that_does_not_charge_is_driven_to_again_and_cried_about(machine: str) -> None:
    world = World(charge=0.0)
    world.clock.after(50.0, lambda: world.set_level(10.0))
    world.clock.after(900.0, lambda: setattr(world, 'charge', 2.0))
    run = Run(machine, world).until(2000.0)
    assert any('10 %' in cry for cry in world.cries)
    assert run.mission.battery.level != 10.0
    assert visited(world, since=1200.0) == set(SEVEN_ROOMS)


def test_a_robot_pushed_off_its_station_goes_back_to_it_at_once(machine: str) -> None:
    world = World(draw=0.5, charge=0.5)
    pushed: list[float] = []
    run = Run(machine, world, settings(policy='tour'))
    charging = {'surveillance': 'PERFORM_ROOM_TASKS', 'patrol': 'RechargeRoutine'}[machine]

    def push() -> None:
        states = run.machine[charging].get_active_states()  # type: ignore[attr-defined]
        if not pushed and states in (['RECHARGE_TASK'], ['Recharge']) and world.level > 50.0:
            pushed.append(world.clock.time)
            world.push('C1')
        world.clock.after(1.0, push)

    push()
    run.until(900.0)
    assert pushed
    back = [place for time, place in world.arrivals if 0.0 < time - pushed[0] < 10.0]
    assert back == ['E']
    assert not world.cries


def test_a_robot_killed_on_its_way_to_charge_still_goes_to_charge(
    machine: str, tmp_path: Path
) -> None:
    world = World()
    mission = Killed(machine, world, tmp_path / 'record')
    mission.run(100.0)
    world.set_level(15.0)
    mission.run(103.0)
    assert world.decisions[-1].rule == 'recharge'
    world.set_level(50.0)  # more than it must have, less than what it was sent to charge for
    mission.run(160.0)
    assert summarize(read(tmp_path / 'record')).recharges == 1


def test_the_robot_charges_at_a_station_far_from_its_rooms_point(machine: str) -> None:
    x, y, _ = POSITIONS['E']
    world = World(stations=(), station_points={'E': (x + 1.5, y, 0.0)}, draw=0.4, start_place='R1')
    run = Run(machine, world).until(900.0)
    charged = [text.split()[2] for text in world.said if text.startswith('charged in')]
    assert len(charged) >= 2
    assert world.stranded == 0
    # Nothing was tried at the room's point, where nothing charges.
    assert not [text for text in world.said if 'failed' in text]
    assert len({room for _, room in world.arrivals}) == 7
    assert run.mission.recovery.avoided(run.mission.now()) == frozenset()
