"""The patrol machine: ask the reasoner for a place, point the way, drive there, charge in between.

States and outcomes follow the behaviour diagram of the assignment "patrol"; ``failed`` and the
recovery states are this project's. A low battery ends Reasoning, Pointing and Controlling at once:
what runs is cancelled.
On the way to the dock it is known already and ends nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import state_machines as fsm
from patrol_policy.decision import RECHARGE
from surveillance_behaviour.machines.shared_states import (
    FAILED,
    PREEMPTED,
    MachineState,
    Recover,
    WaitForHelp,
    add,
    add_asking,
    check_path,
    follow,
)
from surveillance_behaviour.mission.looking import RoomInspection
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.recovery import Step
from surveillance_behaviour.ports import Point, Routine

BATTERY_LOW = 'battery_low'


class Initial(MachineState):
    """Has the robot look around and build its ontology.

    Args:
        mission: The mission's memory and ports.
        looks: Whether a look that the end of an earlier run cut off is gone on with.
    """

    task = 'starting'

    def __init__(self, mission: Mission, *, looks: bool) -> None:
        self.ends = ['start', *(['look_on'] if looks else []), FAILED]
        super().__init__(mission)
        self._looks = looks

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        routine_of(mission).start(interrupt)
        mission.ports.ontology.wait_until_built(interrupt)
        mission.begin(interrupt)
        goes_on = mission.notes.goes_on and not mission.astray and not math.isinf(mission.explored)
        return 'look_on' if self._looks and goes_on and not mission.battery.low else 'start'


class Reasoning(MachineState):
    """Asks for the next place, unless the battery has to be charged first."""

    task = 'reasoning'
    ends = ('reasoned', BATTERY_LOW, FAILED)
    writes = ('target',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        with mission.battery.interrupting(interrupt, lambda: mission.battery.low) as either:
            decision = mission.decide(either)
        ud.target = decision.place
        return BATTERY_LOW if decision.rule == RECHARGE else 'reasoned'

    def interrupted(self, ud: Any) -> str:
        self.mission.say(f'the battery is low ({self.mission.battery.level_text()})')
        return BATTERY_LOW


class MoveStep(MachineState):
    """One of the two steps of a move; whether a low battery ends it depends on where it goes.

    Args:
        mission: The mission's memory and ports.
        task: What the step does, for messages.
        step: The step itself; gets the mission, the userdata and what interrupts it.
        outcome: The outcome of a step that is done.
        heeds_battery: Whether a low battery ends it.
    """

    def __init__(
        self,
        mission: Mission,
        task: str,
        step: Callable[[Mission, Any, fsm.Interrupt], None],
        outcome: str,
        heeds_battery: bool,
        input_keys: tuple[str, ...],
        output_keys: tuple[str, ...] = (),
    ) -> None:
        self.ends = [outcome, *([BATTERY_LOW] if heeds_battery else []), FAILED]
        self.reads, self.writes = input_keys, output_keys
        super().__init__(mission)
        self.task = task
        self._step = step
        self._outcome = outcome
        self._heeds_battery = heeds_battery

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        battery = self.mission.battery
        with battery.interrupting(interrupt, lambda: self._heeds_battery and battery.low) as either:
            self._step(self.mission, ud, either)
        return self._outcome

    def interrupted(self, ud: Any) -> str:
        level = self.mission.battery.level_text()
        self.mission.say(f'battery low ({level}): {self.task} is cancelled')
        return BATTERY_LOW

    def goal(self, ud: Any) -> str | None:
        return str(ud.target)


def plan_path(mission: Mission, ud: Any, interrupt: fsm.Interrupt) -> None:
    """Ask for the via points to the target."""
    name, goal = mission.goal(ud.target, interrupt)
    via_points = routine_of(mission).plan(name, interrupt)
    check_path(via_points, goal, mission.settings.goal_tolerance, 'motion/planner')
    ud.via_points = via_points


def follow_path(mission: Mission, ud: Any, interrupt: fsm.Interrupt) -> None:
    """Drive through the via points; the motion controller notes the visit."""
    distance = drive(mission, ud.target, ud.via_points, interrupt)
    mission.arrived(ud.target, distance, ud.via_points)


class Looking(MachineState):
    """Looks at the place, then again at what made an alert that is not sure; sweeps it."""

    task = 'looking'
    ends = ('looked', BATTERY_LOW)

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission)
        self._room_look = RoomInspection(mission)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        stays = mission.ports.looking is not None
        seconds = mission.settings.choice.exploration_seconds if stays else 0.0
        with mission.battery.interrupting(interrupt, lambda: mission.battery.low) as either:
            self._room_look.explore(seconds, either)
            self._room_look.verify(either)
        return 'looked'

    def interrupted(self, ud: Any) -> str:
        self.mission.say(f'battery low ({self.mission.battery.level_text()}): looking ends early')
        return BATTERY_LOW


class GoBack(MachineState):
    """Goes back to the last place the robot is known to have been in."""

    task = 'going back'
    ends = ('returned', FAILED)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        place = self.mission.place
        name, _ = self.mission.goal(place, interrupt)
        via_points = routine_of(self.mission).plan(name, interrupt)
        self.mission.came_back(drive(self.mission, place, via_points, interrupt))
        return 'returned'


def routine_of(mission: Mission) -> Routine:
    """Return the peers of the behaviour `patrol`."""
    routine = mission.ports.routine
    assert routine is not None
    return routine


def drive(
    mission: Mission, target: str, via_points: list[Point], interrupt: fsm.Interrupt
) -> float:
    """Drive through the points and make sure that it ends in ``target``; metres driven.

    Raises:
        CallError: It does not.
    """
    check_path(via_points, None, 0.0, 'motion/planner')
    control = routine_of(mission).control
    return follow(mission, target, via_points, control, 'motion/controller', interrupt)


class Recharge(MachineState):
    """Charges the battery if the robot is at the dock, else chooses the dock to go to."""

    task = 'recharging'
    ends = ('battery_full', 'not_at_dock', FAILED)
    writes = ('target',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        self.charging = False
        if not mission.at_station():
            decision = mission.pending
            if decision is None or decision.rule != RECHARGE:
                decision = mission.decide(interrupt, to_charge=True)
            ud.target = decision.place
            return 'not_at_dock' if decision.rule == RECHARGE else 'battery_full'
        self.charging = mission.dock.to_station = True
        ud.target = mission.place
        mission.say(f'charging in {mission.place} ({mission.battery.level_text()})')
        mission.charge(interrupt, routine_of(mission).recharge)
        return 'battery_full'

    def goal(self, ud: Any) -> str | None:
        return self.mission.place if self.charging else None


def moving(mission: Mission, *, heeds_battery: bool) -> fsm.StateMachine:
    """Pointing, then Controlling."""
    low = [BATTERY_LOW] if heeds_battery else []
    machine = fsm.StateMachine(['reached', FAILED, PREEMPTED, *low], input_keys=['target'])
    leave = {outcome: outcome for outcome in (FAILED, *low)}
    step = partial(MoveStep, mission, heeds_battery=heeds_battery)
    pointing = step(
        'pointing', plan_path, 'pointed', input_keys=('target',), output_keys=('via_points',)
    )
    controlling = step('controlling', follow_path, 'reached', input_keys=('target', 'via_points'))
    with machine:
        add('Pointing', pointing, pointed='Controlling', **leave)
        add('Controlling', controlling, reached='reached', **leave)
    return machine


def recharge_routine(mission: Mission) -> fsm.StateMachine:
    """Recharge, with a move to the dock before it when the robot is not there."""
    machine = fsm.StateMachine(['battery_full', PREEMPTED])
    steps = tuple(step for step in Step if step != Step.GO_BACK)
    with machine:
        add(
            'Recharge',
            Recharge(mission),
            battery_full='battery_full',
            not_at_dock='Moving',
            failed='Recover',
        )
        add('Moving', moving(mission, heeds_battery=False), reached='Recharge', failed='Recover')
        add(
            'Recover',
            Recover(mission, steps=steps),
            choose_anew='Recharge',
            another_path='Moving',
            another_place='Recharge',
            wait_for_help='WaitForHelp',
        )
        add('WaitForHelp', WaitForHelp(mission), try_again='Recharge')
    return machine


def patrol_machine(mission: Mission) -> fsm.StateMachine:
    """Return the machine `patrol` with its recovery; it ends only when it is preempted."""
    machine = fsm.StateMachine([PREEMPTED])
    machine.set_name('patrol')
    looks = mission.ports.looking is not None or mission.ports.sweeping is not None
    machine.set_clock(mission.clock)
    with machine:
        add(
            'Initial',
            Initial(mission, looks=looks),
            start='Reasoning',
            failed='WaitForStart',
            **({'look_on': 'Looking'} if looks else {}),
        )
        add('WaitForStart', WaitForHelp(mission), try_again='Initial')
        add_asking(
            'Reasoning',
            Reasoning(mission),
            'reasoned',
            mission,
            reasoned='Moving',
            battery_low='RechargeRoutine',
            failed='Recover',
        )
        add(
            'Moving',
            moving(mission, heeds_battery=True),
            reached='Looking' if looks else 'Reasoning',
            battery_low='RechargeRoutine',
            failed='Recover',
        )
        if looks:
            add('Looking', Looking(mission), looked='Reasoning', battery_low='RechargeRoutine')
        add('RechargeRoutine', recharge_routine(mission), battery_full='Reasoning')
        add(
            'Recover',
            Recover(mission),
            choose_anew='Reasoning',
            another_path='Moving',
            another_place='Reasoning',
            go_back='GoBack',
            wait_for_help='WaitForHelp',
        )
        add('GoBack', GoBack(mission), returned='Reasoning', failed='WaitForHelp')
        add('WaitForHelp', WaitForHelp(mission), try_again='Reasoning')
    return machine
