"""The memory of a mission that the states of both machines share, and its record."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from floor_plans.parameters import AT_STATION
from patrol_policy.battery import Battery
from patrol_policy.decision import QUIET, RECHARGE, REQUEST, DecisionSettings
from patrol_policy.situation import Decision
from state_machines import Clock, Interrupt
from state_machines.clock import elapsed_of
from state_machines.exceptions import CallError, CallInterruptedError
from strict_files.settings import parameter, parameters
from surveillance_behaviour.charging import BatteryMonitor, charge
from surveillance_behaviour.mission.dock_state import DockState
from surveillance_behaviour.mission.mission_log import (
    InspectionLog,
    MissionRecord,
    is_other_simulation,
)
from surveillance_behaviour.mission.mission_notes import MissionNotes
from surveillance_behaviour.mission.recovery import Failure, Recovery, RecoveryLimits
from surveillance_behaviour.ports import Point, Ports, UnknownPlaceError

QUIET_SECONDS = 60.0
"""How long the robot stays at its station before it is decided anew, seconds."""


@dataclass
class MissionSettings:
    """The behaviour's parameters that are not about deciding.

    Attributes:
        choice: Those that are.
        recovery: How patient it is.
        settle_seconds: How long the battery's topics may lag behind the robot and behind the
            `recharge` service, seconds of real time.
    """

    choice: DecisionSettings = field(default_factory=DecisionSettings)
    recovery: RecoveryLimits = parameters(RecoveryLimits, 'recovery.')
    arrival_tolerance: float = parameter(
        1.0,
        "How far from its path's end the robot may stop and still have arrived, m.",
        0.0,
        1000.0,
    )
    goal_tolerance: float = parameter(
        1.0, "How far from the goal a planner's path may end, m.", 0.0, 1000.0
    )
    charge_stall_seconds: float = parameter(
        300.0,
        'How long the level may stay the same at the station before the robot docks again, s; '
        '0: for ever.',
        0.0,
        86_400.0,
    )
    approval_seconds: float = parameter(
        120.0,
        'How long a person is asked before the robot leaves for a place, when its autonomy is low '
        'or off, s; then it goes.',
        1.0,
        86_400.0,
        read_only=True,
    )
    settle_seconds: float = 2.0


class Mission:
    """Where the robot is, where it goes, what failed; and the record of it.

    Args:
        machine: Name of the machine, for the record.
        settings: Parameters; may change while the mission runs.
        ports: The peers, and who decides.
        battery: The battery.
        clock: The mission's clock, in seconds; also the machine's.
        record: Where it is written down, and where a process that was killed left it; None:
            nowhere.

    Attributes:
        place: Where the robot was last known to be.
        heading_to: Where it goes, or went last.
        pending: What was decided and not yet begun.
        failure: What did not work last, until something did.
        astray: Whether it has left its place and not arrived anywhere since.
        staying: Why it was decided to stay where it is for a while; empty: it was not.
        explored: Seconds for which it explored its place since it came there; inf: it is done.
        dock: Whether it is docked, and whether its drive ends at a station.
        notes: What it writes down.
    """

    def __init__(
        self,
        machine: str,
        settings: MissionSettings,
        ports: Ports,
        battery: BatteryMonitor,
        clock: Clock,
        record: MissionRecord | None = None,
    ) -> None:
        self.machine = machine
        self.settings = settings
        self.ports = ports
        self.battery = battery
        self.clock = clock
        self.recovery = Recovery(settings.recovery)
        self.place = ''
        self.heading_to = ''
        self.pending: Decision | None = None
        self.failure: Failure | None = None
        self.astray = False
        self.staying = ''
        self.explored = 0.0
        self.dock = DockState()
        self.notes = MissionNotes(record, self.now, lambda line: self.say(line, warning=True))

    @property
    def looked(self) -> InspectionLog:
        """What was looked at in each place."""
        return self.notes.looked

    # The way of the mission.

    def begin(self, interrupt: Interrupt) -> None:
        """Look at the map for the first time, record the start, take up what was begun before.

        Raises:
            CallError: The ontology cannot be asked.
        """
        reasoner = self.ports.reasoner
        self.place = reasoner.begin(self.now(), interrupt)
        self.say(f'{len(reasoner.places)} places to patrol, starting in {self.place}')
        if self.notes.is_begun:
            return
        if self.ports.looking is not None:
            # Whoever ended before may have left it turned aside.
            self.ports.looking.rest_arm()
        for station in self.settings.choice.recharge_rooms:
            # Where they are is known then, also while the map does not answer.
            with contextlib.suppress(CallError):
                self.ports.places.position(station + AT_STATION, interrupt)
        before = self.notes.start(
            self.machine, self.place, reasoner.places, self.settings.choice.urgency_threshold
        )
        if before is None or is_other_simulation(before.time, self.now()):
            return
        self.astray = before.left
        if before.charging and not self.charged_enough():
            reasoner.send_to_charge(before.charging)
        if before.place == self.place:
            self.explored = before.explored
        self.say(f'going on: {before}')

    def decide(self, interrupt: Interrupt, *, to_charge: bool = False) -> Decision:
        """Have it decided where to go next, and record it; who decides announces it.

        Args:
            interrupt: Ends it.
            to_charge: The robot is to charge: only a charging place will do.

        Raises:
            CallError: Who decides cannot be asked.
            NowhereToGoError: Nothing can be reached.
        """
        self._notice_place(interrupt)
        reasoner, now = self.ports.reasoner, self.now()
        avoided = self.recovery.avoided(now)
        decision = reasoner.decide(now, interrupt, avoided, to_charge=to_charge)
        said = ''
        while decision.stay or (decision.rule == QUIET and decision.place == self.place):
            # Nothing is to be done: it is decided anew now and then, and when it is interrupted.
            if decision.reason != said:
                said = decision.reason
                self.say(said)
            self.staying = decision.reason if decision.stay else ''
            slept = self.clock.sleep(decision.stay or QUIET_SECONDS, interrupt)
            self.staying = ''
            if not slept:
                raise CallInterruptedError
            now = self.now()
            decision = reasoner.decide(now, interrupt, avoided, to_charge=to_charge)
        if decision.from_place:
            self.place = decision.from_place
        self.heading_to = decision.place
        self.pending = decision
        self.dock.to_station = decision.rule in (RECHARGE, QUIET, REQUEST)
        self.notes.decided(
            decision.place,
            decision.rule,
            decision.reason,
            reasoner.places,
            self.settings.choice.urgency_threshold,
        )
        self.notes.idleness_bounds(reasoner.idleness_bounds)
        return decision

    def _notice_place(self, interrupt: Interrupt) -> None:
        """Record where the robot stands, if a drive ended elsewhere than it was to.

        The decision tells it to the ontology, whose visits are in the record first.
        """
        here = self.ports.ontology.await_place(self.place, 0.0, interrupt)
        if here not in (self.place, ''):
            self.place = here
            self.dock.strayed()
            self.note('visit', place=here, distance=0.0)

    def watch_passages(self, interrupt: Interrupt) -> Callable[[], bool]:
        """Return a look whether a place can be reached that could not be at the first look.

        An ontology that does not answer tells nothing.
        """
        known: frozenset[str] | None = None

        def passage_opened() -> bool:
            nonlocal known
            try:
                reachable = self.ports.ontology.reachable(interrupt)
            except CallError:
                return False
            known = reachable if known is None else known
            return not reachable <= known

        return passage_opened

    def goal(self, place: str, interrupt: Interrupt) -> tuple[str, Point]:
        """Return where a drive to a place ends, as a name and as a point.

        Raises:
            CallError: The map does not have it.
        """
        places = self.ports.places
        point, station = places.position(place, interrupt), None
        can_charge = place in self.settings.choice.recharge_rooms
        if can_charge:
            # The map may be another program's, which knows of no stations.
            with contextlib.suppress(UnknownPlaceError):
                station = places.position(place + AT_STATION, interrupt)
        if self.dock.leaves_for(point, station, is_recharge_room=can_charge) and station:
            return place + AT_STATION, station
        return place, point

    def departs(self) -> None:
        """Note that the robot leaves its place; until it arrives it may be anywhere."""
        self.astray = True
        self.pending = None

    def arrived(self, place: str, distance: float, path: Sequence[Point] = ()) -> None:
        """Note that the robot is in ``place``, after ``distance`` metres along ``path``."""
        self._visit(place, distance, path)
        self.ports.reasoner.arrived(place, self.now(), distance)
        self.recovery.arrived(place)
        self.failure = None
        self.say(f'arrived in {place}')

    def make_sure_of(self, place: str, interrupt: Interrupt) -> None:
        """Make sure that a drive ended in ``place``.

        Raises:
            CallError: The robot is elsewhere.
        """
        seconds = self.settings.settle_seconds
        found = self.ports.ontology.await_place(place, seconds, interrupt)
        if found not in (place, ''):
            raise CallError(f'robot_place: the robot is in {found} instead of {place}')

    def came_back(self, distance: float) -> None:
        """Note that the robot is again where it was last known to be."""
        self._visit(self.place, distance)
        self.ports.reasoner.saw(self.place, self.now())
        self.say(f'back in {self.place}')

    def _visit(self, place: str, distance: float, path: Sequence[Point] = ()) -> None:
        self.place = place
        self.astray = False
        self.dock.arrived()
        self.explored = 0.0
        self.notes.visited(place, distance, path, self._driven())

    def _driven(self) -> Sequence[Point]:
        """Return the way driven since the last visit or failure; empty where nobody tells."""
        motion = self.ports.motion
        return [] if motion is None else motion.driven()

    def charge(
        self, interrupt: Interrupt, recharge: Callable[[Interrupt], None] | None = None
    ) -> None:
        """Charge at the station where the robot is, and note it; see `charging.charge`."""
        elapsed = elapsed_of(self.clock)
        began = elapsed()
        charge(
            self.battery,
            self.charged_enough,
            self.clock,
            interrupt,
            stall_seconds=self.settings.charge_stall_seconds,
            settle_seconds=self.settings.settle_seconds,
            recharge=recharge,
        )
        seconds = elapsed() - began
        self.ports.reasoner.charged()
        self.recovery.charged(self.place)
        self.failure = None
        self.note('recharge', place=self.place, seconds=seconds)
        self.say(f'charged in {self.place} to {self.battery.level_text()}')

    def failed(
        self,
        what: str,
        reason: str,
        goal: str | None = None,
        *,
        charging: bool = False,
        is_over: Callable[[], bool] | None = None,
    ) -> None:
        """Remember, record and say what did not work; see :class:`Failure`."""
        self.failure = Failure(what, reason, goal, charging, is_over)
        self.pending = None
        self.ports.reasoner.disturbed()
        self.notes.failed(what, reason, self._driven())
        self.say(f'{what} failed: {reason}', warning=True)

    # What is known.

    def at_station(self) -> bool:
        """Return whether the robot is where it can charge, and has not left half-way since.

        A station that did not charge lately is none as long as there is another.
        """
        stations = self.settings.choice.recharge_rooms
        good = [place for place in stations if place not in self.recovery.avoided(self.now())]
        docked = self.dock.is_docked or bool(self.battery.charging)
        return docked and self.place in (good or stations) and not self.astray

    def charged_enough(self) -> bool:
        """Return whether the robot may leave the station."""
        battery = Battery(self.battery.level, self.battery.low)
        if battery.charged_enough(self.settings.choice.battery):
            return True
        return self.ports.reasoner.charge_is_over(self.now())

    def now(self) -> float:
        """Return the seconds on the mission's clock."""
        return self.clock.now()

    def say(self, text: str, *, warning: bool = False) -> None:
        """Announce something."""
        self.ports.announcer.say(text, warning=warning)

    def note(self, event: str, **fields: object) -> None:
        """Write an entry of the log once the mission has begun."""
        self.notes.write(event, **fields)
