"""The patrol machine: ask the reasoner for a place, point the way, drive there, charge in between.

States and outcomes follow the behaviour diagram of the assignment "patrol"; ``failed`` and the
recovery states are this project's. A low battery ends Reasoning, Pointing and Controlling at once:
what runs is cancelled.
On the way to the dock it is known already and ends nothing.
"""

from __future__ import annotations

from typing import Any

import surveillance_fsm as fsm
from surveillance_behaviour.charging import charge
from surveillance_behaviour.decision import RECHARGE
from surveillance_behaviour.machines.shared_states import (
    FAILED,
    PREEMPTED,
    MissionState,
    Recover,
    WaitForHelp,
    add,
    check_arrival,
    check_path,
    path_length,
)
from surveillance_behaviour.mission.mission import Mission
from surveillance_behaviour.mission.recovery import Step
from surveillance_behaviour.peers.ports import Point, Routine

BATTERY_LOW = 'battery_low'


class RoutineState(MissionState):
    """A state that talks to the peers of the behaviour `patrol`."""

    @property
    def routine(self) -> Routine:
        """The peers."""
        routine = self.mission.ports.routine
        assert routine is not None
        return routine


class Initial(RoutineState):
    """Has the robot look around and build its ontology."""

    task = 'starting'

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, ['start'])

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        self.routine.start(interrupt)
        self.mission.ports.ontology.wait_until_built(interrupt)
        self.mission.begin(interrupt)
        return 'start'


class Reasoning(RoutineState):
    """Asks for the next place, unless the battery has to be charged first."""

    task = 'reasoning'

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, ['reasoned', BATTERY_LOW], output_keys=['target'])

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        with mission.battery.interrupting(interrupt, lambda: mission.battery.low) as either:
            decision = mission.decide(either)
        ud.target = decision.place
        return BATTERY_LOW if decision.rule == RECHARGE else 'reasoned'

    def interrupted(self, ud: Any) -> str:
        self.mission.say(f'the battery is low ({self.mission.battery.level_text()})')
        return BATTERY_LOW


class MovingState(RoutineState):
    """A half of a move; whether a low battery ends it depends on where it goes.

    Args:
        mission: The mission's memory and ports.
        outcome: The outcome of a half that is done.
        heeds_battery: Whether a low battery ends it.
    """

    def __init__(
        self,
        mission: Mission,
        outcome: str,
        heeds_battery: bool,
        input_keys: tuple[str, ...],
        output_keys: tuple[str, ...] = (),
    ) -> None:
        outcomes = [outcome, BATTERY_LOW] if heeds_battery else [outcome]
        super().__init__(mission, outcomes, input_keys, output_keys)
        self._outcome = outcome
        self._heeds_battery = heeds_battery

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        battery = self.mission.battery
        with battery.interrupting(interrupt, lambda: self._heeds_battery and battery.low) as either:
            self.move(ud, either)
        return self._outcome

    def move(self, ud: Any, interrupt: fsm.Interrupt) -> None:
        """The half itself."""
        raise NotImplementedError

    def interrupted(self, ud: Any) -> str:
        level = self.mission.battery.level_text()
        self.mission.say(f'battery low ({level}): {self.task} is cancelled')
        return BATTERY_LOW

    def goal(self, ud: Any) -> str | None:
        return str(ud.target)


class Pointing(MovingState):
    """Asks for the via points to the target."""

    task = 'pointing'

    def __init__(self, mission: Mission, heeds_battery: bool) -> None:
        super().__init__(mission, 'pointed', heeds_battery, ('target',), ('via_points',))

    def move(self, ud: Any, interrupt: fsm.Interrupt) -> None:
        mission = self.mission
        via_points = self.routine.plan(ud.target, interrupt)
        goal = mission.ports.places.position(ud.target, interrupt)
        check_path(via_points, goal, mission.settings.goal_tolerance, 'motion/planner')
        ud.via_points = via_points


class Controlling(MovingState):
    """Drives through the via points; the motion controller notes the visit."""

    task = 'controlling'

    def __init__(self, mission: Mission, heeds_battery: bool) -> None:
        super().__init__(mission, 'reached', heeds_battery, ('target', 'via_points'))

    def move(self, ud: Any, interrupt: fsm.Interrupt) -> None:
        distance = drive(self, ud.target, ud.via_points, interrupt)
        self.mission.arrived(ud.target, distance, ud.via_points)


class GoBack(RoutineState):
    """Goes back to the last place the robot is known to have been in."""

    task = 'going back'

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, ['returned'])

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        place = self.mission.place
        via_points = self.routine.plan(place, interrupt)
        self.mission.came_back(drive(self, place, via_points, interrupt))
        return 'returned'


def drive(
    state: RoutineState, target: str, via_points: list[Point], interrupt: fsm.Interrupt
) -> float:
    """Drives through the points and makes sure that it ends in ``target``; metres driven.

    Raises:
        PeerError: It does not.
    """
    mission, peer = state.mission, 'motion/controller'
    check_path(via_points, None, 0.0, 'motion/planner')
    mission.departs()
    end = state.routine.control(via_points, interrupt)
    check_arrival(end, via_points[-1], mission.settings.arrival_tolerance, peer)
    mission.make_sure_of(target, interrupt)
    return path_length(via_points)


class Recharge(RoutineState):
    """Charges the battery if the robot is at the dock, else chooses the dock to go to."""

    task = 'recharging'

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission, ['battery_full', 'not_at_dock'], output_keys=['target'])

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission, settings = self.mission, self.mission.settings
        self.charging = False
        if not mission.at_station():
            decision = mission.pending
            if decision is None or decision.rule != RECHARGE:
                decision = mission.decide(interrupt, to_charge=True)
            ud.target = decision.place
            return 'not_at_dock' if decision.rule == RECHARGE else 'battery_full'
        self.charging = True
        ud.target = mission.place
        began = mission.now()
        mission.say(f'charging in {mission.place} ({mission.battery.level_text()})')
        charge(
            mission.battery,
            mission.charged_enough,
            mission.clock,
            interrupt,
            stall_seconds=settings.charge_stall_seconds,
            settle_seconds=settings.settle_seconds,
            recharge=self.routine.recharge,
        )
        mission.charged(mission.now() - began)
        return 'battery_full'

    def goal(self, ud: Any) -> str | None:
        return self.mission.place if self.charging else None


def moving(mission: Mission, *, heeds_battery: bool) -> fsm.StateMachine:
    """Pointing, then Controlling."""
    low = [BATTERY_LOW] if heeds_battery else []
    machine = fsm.StateMachine(['reached', FAILED, PREEMPTED, *low], input_keys=['target'])
    leave = {outcome: outcome for outcome in (FAILED, *low)}
    with machine:
        add('Pointing', Pointing(mission, heeds_battery), {'pointed': 'Controlling', **leave})
        add('Controlling', Controlling(mission, heeds_battery), {'reached': 'reached', **leave})
    return machine


def recharge_routine(mission: Mission) -> fsm.StateMachine:
    """Recharge, with a move to the dock before it when the robot is not there."""
    machine = fsm.StateMachine(['battery_full', PREEMPTED])
    steps = (Step.ANOTHER_PATH, Step.ANOTHER_PLACE, Step.WAIT_FOR_HELP)
    with machine:
        add(
            'Recharge',
            Recharge(mission),
            {'battery_full': 'battery_full', 'not_at_dock': 'Moving', FAILED: 'Recover'},
        )
        add(
            'Moving',
            moving(mission, heeds_battery=False),
            {'reached': 'Recharge', FAILED: 'Recover'},
        )
        add(
            'Recover',
            Recover(mission, steps=steps),
            {
                'another_path': 'Moving',
                'another_place': 'Recharge',
                'wait_for_help': 'WaitForHelp',
            },
        )
        add('WaitForHelp', WaitForHelp(mission), {'try_again': 'Recharge'})
    return machine


def patrol_machine(mission: Mission) -> fsm.StateMachine:
    """Return the machine `patrol` with its recovery; it ends only when it is preempted."""
    machine = fsm.StateMachine([PREEMPTED])
    machine.set_name('patrol')
    machine.set_clock(mission.clock)
    with machine:
        add('Initial', Initial(mission), {'start': 'Reasoning', FAILED: 'WaitForStart'})
        add('WaitForStart', WaitForHelp(mission), {'try_again': 'Initial'})
        add(
            'Reasoning',
            Reasoning(mission),
            {'reasoned': 'Moving', BATTERY_LOW: 'RechargeRoutine', FAILED: 'Recover'},
        )
        add(
            'Moving',
            moving(mission, heeds_battery=True),
            {'reached': 'Reasoning', BATTERY_LOW: 'RechargeRoutine', FAILED: 'Recover'},
        )
        add('RechargeRoutine', recharge_routine(mission), {'battery_full': 'Reasoning'})
        add(
            'Recover',
            Recover(mission),
            {
                'another_path': 'Moving',
                'another_place': 'Reasoning',
                'go_back': 'GoBack',
                'wait_for_help': 'WaitForHelp',
            },
        )
        add('GoBack', GoBack(mission), {'returned': 'Reasoning', FAILED: 'WaitForHelp'})
        add('WaitForHelp', WaitForHelp(mission), {'try_again': 'Reasoning'})
    return machine
