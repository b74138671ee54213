"""The surveillance machine: explore or charge where the robot is, choose the next room, move there.

States and outcomes follow the diagram of the assignment "surveillance"; ``failed`` and the recovery
states are this project's. One round of the machine is one room.
"""

from __future__ import annotations

from typing import Any

import state_machines as fsm
from state_machines.exceptions import CallInterruptedError
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
from surveillance_behaviour.mission.sweeping import is_swept
from surveillance_behaviour.ports import Point


class Initialization(MachineState):
    """Waits until the ontology holds the map, and sets the robot's parameters."""

    task = 'initialization'
    ends = ('initialized', FAILED)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        self.mission.ports.ontology.wait_until_built(interrupt)
        self.mission.begin(interrupt)
        return 'initialized'


class ChooseRoomTask(MachineState):
    """Charge if the battery asks for it and the robot is at a station, else explore."""

    ends = ('recharge', 'explore')

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        reasoner = self.mission.ports.reasoner
        must_charge = self.mission.at_station() and reasoner.why_charge()
        if must_charge and reasoner.dock_is_taken():
            return 'explore'
        return 'recharge' if must_charge else 'explore'


class ExploreTask(MachineState):
    """Looks around for a while; a battery that gets low ends it.

    Where somebody watches the robot looks at the place, and again at alerts that are not sure.
    """

    ends = ('explored',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        why = mission.ports.reasoner.why_charge
        with mission.battery.interrupting(interrupt, lambda: bool(why())) as wake:
            whole = self._explore(wake)
        if self.preempt_requested():
            return self.preempted()
        if not whole:
            mission.say(f'exploring {mission.place} ends early: {why()}')
        return 'explored'

    def __init__(self, mission: Mission, room_look: RoomInspection) -> None:
        super().__init__(mission)
        self._room_look = room_look

    def _explore(self, interrupt: fsm.Interrupt) -> bool:
        """Explore the place for what is left of its time since the last visit; whether it did."""
        mission = self.mission
        usual = mission.settings.choice.exploration_seconds
        seconds = mission.ports.reasoner.exploring(mission.place, usual)
        try:
            self._room_look.explore(seconds, interrupt)
        except CallInterruptedError:
            return False
        return True


class VerifyTask(MachineState):
    """Looks again, from elsewhere, at what made an alert that is not sure."""

    ends = ('verified',)

    def __init__(self, mission: Mission, room_look: RoomInspection) -> None:
        super().__init__(mission)
        self._room_look = room_look

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        with self.mission.battery.interrupting(
            interrupt, lambda: bool(self.mission.ports.reasoner.why_charge())
        ) as wake:
            self._room_look.verify(wake)
        return 'verified'

    def interrupted(self, ud: Any) -> str:
        return 'verified'


class RechargeTask(MachineState):
    """Waits at the station until the battery is charged enough."""

    task = 'recharging'
    charging = True
    ends = ('recharged', FAILED)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        why = mission.ports.reasoner.why_charge()
        mission.say(f'charging in {mission.place} ({mission.battery.level_text()}, {why})')
        mission.charge(interrupt)
        return 'recharged'

    def goal(self, ud: Any) -> str | None:
        return self.mission.place


class ChooseNextRoom(MachineState):
    """Charging place if the battery asks for it, else rules and policy."""

    task = 'choosing the next room'
    ends = ('chosen', FAILED)
    writes = ('next_room',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        ud.next_room = self.mission.decide(interrupt).place
        return 'chosen'


class MoveToNextRoom(MachineState):
    """Moves to the next room."""

    task = 'moving'
    ends = ('moved', FAILED)
    reads = ('next_room',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        path, metres = drive(self.mission, ud.next_room, interrupt)
        self.mission.arrived(ud.next_room, metres, path)
        return 'moved'

    def goal(self, ud: Any) -> str | None:
        return str(ud.next_room)


class ReturnToLastPlace(MachineState):
    """Goes back to the last place the robot is known to have been in."""

    task = 'going back'
    ends = ('returned', FAILED)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        _, metres = drive(self.mission, self.mission.place, interrupt)
        self.mission.came_back(metres)
        return 'returned'


def drive(mission: Mission, place: str, interrupt: fsm.Interrupt) -> tuple[list[Point], float]:
    """Plan a path to a place and follow it; return the path and its length, metres.

    Raises:
        CallError: The robot did not get there.
    """
    motion, before = mission.ports.motion, mission.place
    assert motion is not None
    _, goal = mission.goal(place, interrupt)
    sweeping, here = mission.ports.sweeping, None
    # Where a sweep or a look moved it about, the last path's end is not where it stands.
    if sweeping is not None and (mission.ports.looking or is_swept(mission, before)):
        here = sweeping.position()
    start = here or motion.last_position() or mission.ports.places.position(before, interrupt)
    path: list[Point] = []
    for stop in _stops(mission, place, goal, interrupt):
        leg = motion.plan(path[-1] if path else start, stop, interrupt)
        check_path(leg, stop, mission.settings.goal_tolerance, 'compute_path')
        path.extend(leg if not path else leg[1:])
    return path, follow(mission, place, path, motion.follow, 'follow_path', interrupt)


def _stops(mission: Mission, place: str, goal: Point, interrupt: fsm.Interrupt) -> list[Point]:
    """Return the goal, at the last try after the places of a way round if the map has one."""
    before = mission.place
    if mission.recovery.tries(place) < max(1, mission.settings.recovery.path_tries - 1):
        return [goal]
    way = mission.ports.reasoner.detour(before, place)
    if not way:
        return [goal]
    mission.say(f'trying the way round: {" - ".join((before, *way))}')
    return [*(mission.ports.places.position(room, interrupt) for room in way[:-1]), goal]


def surveillance_machine(mission: Mission) -> fsm.StateMachine:
    """Return the machine `surveillance` with its recovery; it ends only when it is preempted."""
    tasks = fsm.StateMachine(['explored', 'recharged', FAILED, PREEMPTED])
    with tasks:
        add(
            'CHOOSE_ROOM_TASK',
            ChooseRoomTask(mission),
            recharge='RECHARGE_TASK',
            explore='EXPLORE_TASK',
        )
        verifies, room_look = mission.ports.looking is not None, RoomInspection(mission)
        add(
            'EXPLORE_TASK',
            ExploreTask(mission, room_look),
            explored='VERIFY_TASK' if verifies else 'explored',
        )
        if verifies:
            add('VERIFY_TASK', VerifyTask(mission, room_look), verified='explored')
        add('RECHARGE_TASK', RechargeTask(mission), recharged='recharged', failed=FAILED)

    machine = fsm.StateMachine([PREEMPTED])
    machine.set_name('surveillance')
    machine.set_clock(mission.clock)
    with machine:
        add(
            'INITIALIZATION',
            Initialization(mission),
            initialized='PERFORM_ROOM_TASKS',
            failed='WAIT_FOR_ONTOLOGY',
        )
        add('WAIT_FOR_ONTOLOGY', WaitForHelp(mission), try_again='INITIALIZATION')
        add(
            'PERFORM_ROOM_TASKS',
            tasks,
            explored='CHOOSE_NEXT_ROOM',
            recharged='CHOOSE_NEXT_ROOM',
            failed='RE_DOCK',
        )
        add('RE_DOCK', ReDock(mission), again='MOVE_TO_NEXT_ROOM', give_up='WAIT_FOR_HELP')
        add_asking(
            'CHOOSE_NEXT_ROOM',
            ChooseNextRoom(mission),
            'chosen',
            mission,
            chosen='MOVE_TO_NEXT_ROOM',
            failed='RECOVER',
        )
        add(
            'MOVE_TO_NEXT_ROOM',
            MoveToNextRoom(mission),
            moved='PERFORM_ROOM_TASKS',
            failed='RECOVER',
        )
        add(
            'RECOVER',
            Recover(mission),
            choose_anew='CHOOSE_NEXT_ROOM',
            another_path='MOVE_TO_NEXT_ROOM',
            another_place='CHOOSE_NEXT_ROOM',
            go_back='RETURN_TO_LAST_PLACE',
            wait_for_help='WAIT_FOR_HELP',
        )
        add(
            'RETURN_TO_LAST_PLACE',
            ReturnToLastPlace(mission),
            returned='CHOOSE_NEXT_ROOM',
            failed='WAIT_FOR_HELP',
        )
        add('WAIT_FOR_HELP', WaitForHelp(mission), try_again='PERFORM_ROOM_TASKS')
    return machine


class ReDock(MachineState):
    """Drives to the station again when the battery does not rise there."""

    ends = ('again', 'give_up')
    writes = ('next_room',)

    def work(self, ud: Any, interrupt: fsm.Interrupt) -> str:
        mission = self.mission
        assert mission.failure is not None
        if mission.recovery.next_step(mission.failure, mission.now()) != Step.ANOTHER_PATH:
            return 'give_up'
        ud.next_room = mission.place
        mission.dock.to_station = True
        mission.say(f'driving to the station in {mission.place} again')
        return 'again'
