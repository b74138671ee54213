"""Both machines as plain Python: the ways of the assignments, every transition, every preempt."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import pytest

import state_machines as fsm
from state_machines.exceptions import CallError
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.machines.patrol_machine import Recharge

from .machine_runs import CALLS, Run, settings
from .scripted_world import World, fails, started_again

pytestmark = pytest.mark.early

WAYS = {
    'surveillance': [
        ('INITIALIZATION', 'initialized'),
        ('CHOOSE_ROOM_TASK', 'explore'),
        ('EXPLORE_TASK', 'explored'),
        ('PERFORM_ROOM_TASKS', 'explored'),
        ('CHOOSE_NEXT_ROOM', 'chosen'),
        ('MOVE_TO_NEXT_ROOM', 'moved'),
        ('CHOOSE_ROOM_TASK', 'explore'),
    ],
    'patrol': [
        ('Initial', 'start'),
        ('Reasoning', 'reasoned'),
        ('Pointing', 'pointed'),
        ('Controlling', 'reached'),
        ('Moving', 'reached'),
        ('Reasoning', 'reasoned'),
    ],
}


WAYS_TO_CHARGE = {
    'surveillance': [
        ('CHOOSE_NEXT_ROOM', 'chosen'),
        ('MOVE_TO_NEXT_ROOM', 'moved'),
        ('CHOOSE_ROOM_TASK', 'recharge'),
        ('RECHARGE_TASK', 'recharged'),
        ('PERFORM_ROOM_TASKS', 'recharged'),
        ('CHOOSE_NEXT_ROOM', 'chosen'),
    ],
    'patrol': [
        ('Controlling', 'battery_low'),
        ('Moving', 'battery_low'),
        ('Recharge', 'not_at_dock'),
        ('Pointing', 'pointed'),
        ('Controlling', 'reached'),
        ('Moving', 'reached'),
        ('Recharge', 'battery_full'),
        ('RechargeRoutine', 'battery_full'),
        ('Reasoning', 'reasoned'),
    ],
}


def test_the_machine_takes_the_assigned_way(machine: str) -> None:
    run = Run(machine, World()).until(40.0)
    way = WAYS[machine]
    assert [(left, outcome) for _, left, outcome, _ in run.transitions][: len(way)] == way


def test_a_low_battery_takes_the_assigned_way_to_the_dock(machine: str) -> None:
    world = World()
    began: list[int] = []

    def fall(call: str) -> None:
        if world.clock.time > 30.0 and call in ('follow', 'control') and not began:
            began.append(1)
            world.clock.after(0.5, lambda: world.set_level(10.0))

    world.faults = fall
    run = Run(machine, world).until(300.0)
    taken = [(left, outcome) for _, left, outcome, _ in run.transitions]
    way = WAYS_TO_CHARGE[machine]
    assert any(taken[start : start + len(way)] == way for start in range(len(taken)))


@pytest.mark.parametrize(('name', 'call'), [(m, c) for m, calls in CALLS.items() for c in calls])
def test_a_preempt_during_any_call_ends_the_machine(name: str, call: str) -> None:
    world = World()
    run = Run(name, world)
    world.faults = lambda called: run.machine.request_preempt() if called == call else None
    run.world.set_level(10.0)
    assert run.machine.execute() == 'preempted'
    assert world.clock.time < 200.0


@pytest.mark.parametrize('name', list(MACHINES))
def test_the_same_world_gives_the_same_mission(name: str) -> None:
    runs = [Run(name, World(draw=0.4)).until(900.0) for _ in range(2)]
    assert runs[0].transitions == runs[1].transitions
    assert runs[0].world.arrivals == runs[1].world.arrivals


def troubled(
    call: str,
    times: float,
    level: float,
    charge: float = 2.0,
    kind: Callable[[str], CallError] = CallError,
) -> World:
    """Return a world in which calls fail at the start and again later, with a battery that
    falls.
    """
    world = World(charge=charge)
    world.faults = fails(call, 2.0, kind=kind)

    def trouble() -> None:
        world.set_level(level)
        world.faults = fails(call, times, kind=kind)

    world.clock.after(45.0, trouble)
    return world


def low_during(call: str) -> World:
    """Return a world in which the battery falls during a call."""
    world = World()

    def fall(called: str) -> None:
        if called == call and world.clock.time > 30.0 and world.level > 90.0:
            world.set_level(10.0)

    world.faults = fall
    return world


def troubled_worlds(name: str) -> Iterator[World]:
    """Worlds that together meet everything the recovery is for."""
    yield World(draw=0.5)
    yield World(draw=0.5, charge=0.0)
    for call in CALLS[name]:
        yield troubled(call, 12.0, 100.0)
        yield troubled(call, 9.0, 100.0)
        yield troubled(call, 3.0, 10.0)
        yield troubled(call, 1.0, 10.0, kind=started_again)
        yield low_during(call)


def every_state(container: fsm.Container, path: str) -> Iterator[tuple[str, str, fsm.Container]]:
    for label, child in container.get_children().items():
        yield path, label, container
        if isinstance(child, fsm.Container):
            yield from every_state(child, f'{path}/{label}')


def test_every_transition_is_taken(machine: str) -> None:
    untaken: set[tuple[str, str, str]] | None = None
    for world in troubled_worlds(machine):
        run = Run(machine, world).until(500.0)
        untaken = run.untaken if untaken is None else untaken & run.untaken
        assert world.stranded == 0
    assert untaken is not None
    assert not {edge for edge in untaken if edge[2] != 'preempted'}


def test_a_preempt_is_heeded_in_every_state(machine: str) -> None:
    states = [
        (path, label)
        for path, label, _ in every_state(
            MACHINES[machine](World().mission(machine=machine)), machine
        )
    ]
    left = set(states)
    for number in range(len(list(troubled_worlds(machine)))):
        for wanted in sorted(left):
            world = next(itertools.islice(troubled_worlds(machine), number, None))
            run = Run(machine, world)
            for path, label, container in every_state(run.machine, machine):
                if (path, label) == wanted:
                    on_entry(container, label, run.machine.request_preempt)
            run.until(300.0)
            if (*wanted, 'preempted') not in run.untaken:
                left.discard(wanted)
    assert not left


def on_entry(container: fsm.Container, label: str, action: Callable[[], None]) -> None:
    def entered(_data: object, active: list[str]) -> None:
        if active == [label]:
            action()

    container.register_start_cb(entered)
    container.register_transition_cb(entered)


@pytest.mark.parametrize(('level', 'outcome'), [(60.0, 'not_at_dock'), (100.0, 'battery_full')])
def test_a_charge_that_was_left_half_way_is_gone_on_with(level: float, outcome: str):
    """Whoever pushes the robot from its dock at 60 % has not charged it."""
    world = World(start_place='R1')
    mission = world.mission(settings(), machine='patrol')
    mission.place = world.is_in = 'R1'
    world.set_level(level)
    ud = SimpleNamespace(target='')
    assert Recharge(mission).work(ud, fsm.Interrupt()) == outcome
    assert (ud.target == 'E') is (outcome == 'not_at_dock')
