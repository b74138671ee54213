"""What the states of both machines share: ports, settings, and the memory of the mission."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from surveillance_behaviour.mission.battery_gauge import BatteryGauge
from surveillance_behaviour.mission.record import MissionRecord, RecordError
from surveillance_behaviour.mission.recovery import Failure, Recovery, RecoveryLimits, Step
from surveillance_behaviour.mission.resumption import CutOff
from surveillance_behaviour.peers.ports import (
    InterruptedWaitError,
    PeerError,
    Point,
    Ports,
)
from surveillance_behaviour.policy.chooser import ChoiceSettings, Chooser
from surveillance_behaviour.policy.situation import Decision, Situation
from surveillance_fsm import Clock, Interrupt

NOTE_SECONDS = 1.0
"""The shortest time between two notes of how far a place is explored, seconds."""


@dataclass
class MissionSettings:
    """The behaviour's parameters that are not about choosing.

    Attributes:
        choice: Those that are.
        recovery: How patient it is.
        arrival_tolerance: How far from its path's end a robot may stop and still have arrived, m.
        goal_tolerance: How far from the goal a planner's path may end, m.
        charge_stall_seconds: How long a level may stay the same while charging before the robot
            drives to the station again; 0: for ever.
        settle_seconds: How long the battery's topics may lag behind the robot and behind the
            `recharge` service, seconds of real time.
    """

    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    recovery: RecoveryLimits = field(default_factory=RecoveryLimits)
    arrival_tolerance: float = 1.0
    goal_tolerance: float = 1.0
    charge_stall_seconds: float = 300.0
    settle_seconds: float = 2.0


class Mission:
    """The memory of a mission and the steps that several states take.

    Args:
        machine: Name of the machine, for the record.
        settings: Parameters; may change while the mission runs.
        ports: The peers.
        gauge: The battery.
        clock: The mission's clock, in seconds; also the machine's.
        record: Where it is written down; None: nowhere.
        generator: Chance, for the policies that need it.
        cut_off: Where a process that was killed left the mission; None: nothing is known of one.
    """

    def __init__(
        self,
        machine: str,
        settings: MissionSettings,
        ports: Ports,
        gauge: BatteryGauge,
        clock: Clock,
        record: MissionRecord | None = None,
        generator: random.Random | None = None,
        cut_off: CutOff | None = None,
    ) -> None:
        self.machine = machine
        self.settings = settings
        self.ports = ports
        self.gauge = gauge
        self.clock = clock
        self.chooser = Chooser(settings.choice, ports.knowledge, ports.places, generator)
        self.recovery = Recovery(settings.recovery)
        self.place = ''
        self.heading_to = ''
        self.failure: Failure | None = None
        self._record = record
        self._cut_off = cut_off
        self._explored = 0.0
        self.astray = False
        self._started: float | None = None
        self._noted_places: frozenset[str] = frozenset()
        self._record_complaint = ''
        self._told_threshold: float | None = None
        self._warned = ''
        self._sent_to_charge = ''
        self._visits: dict[str, float] = {}
        gauge.watch(self._learn_draw)

    # The way of the mission.

    def begin(self, interrupt: Interrupt) -> None:
        """Looks at the map for the first time, and says what is wrong with it.

        Raises:
            PeerError: The ontology cannot be asked.
        """
        situation = self.look(interrupt)
        self.say(f'{len(situation.graph.places)} places to patrol, starting in {self.place}')
        if self._started is None:
            self._started = self.now()
            self._noted_places = self.chooser.places
            places = sorted(self._noted_places)
            self._write('start', machine=self.machine, place=self.place, places=places)
            self._resume()

    def _resume(self) -> None:
        """Takes up what a process that was killed had begun."""
        before, self._cut_off = self._cut_off, None
        if before is None or before.time > self.now():
            return
        self._visits = {**before.visits, **self._visits}
        self.astray = before.left
        if before.charging and not self.charged_enough():
            self._sent_to_charge = before.charging
        if before.place == self.place:
            self._explored = before.explored
        self.say(f'going on: {before}')

    def look(self, interrupt: Interrupt) -> Situation:
        """What the ontology says now; it is told what it does not know of the robot's visits.

        Raises:
            PeerError: The ontology cannot be asked.
        """
        knowledge, threshold = self.ports.knowledge, self.settings.choice.urgency_threshold
        now = self.now()
        if self._sent_to_charge and self.charged_enough():
            self._sent_to_charge = ''
        try:
            if threshold != self._told_threshold:
                knowledge.set_urgency_threshold(threshold, interrupt)
                self._told_threshold = threshold
            avoided = self.recovery.avoided(now)
            situation = self.chooser.look(now, interrupt, avoided, self._visits)
        except PeerError:
            # The ontology that comes back may be another one.
            self._told_threshold = None
            raise
        self.place = situation.place
        if self._started is not None and self.chooser.places != self._noted_places:
            self._noted_places = self.chooser.places
            self._write('map', places=sorted(self._noted_places))
        self._warn_about_threshold()
        return situation

    def _warn_about_threshold(self) -> None:
        """Says once when no robot can keep to this threshold on this map."""
        warning = self.chooser.warning()
        if warning and warning != self._warned:
            self.say(warning, warning=True)
        self._warned = warning

    def choose(self, interrupt: Interrupt) -> Decision:
        """Charging first, then rules and policy; announces and records the decision.

        Raises:
            PeerError: The ontology cannot be asked.
            NowhereToGoError: Nothing can be reached.
        """
        situation = self.look(interrupt)
        why = self.why_charge(situation.reachable)
        if why:
            decision = self.chooser.choose_station(situation, why)
            self._sent_to_charge = why
        else:
            decision = self.chooser.choose(situation)
        return self._decided(decision)

    def choose_station(self, interrupt: Interrupt, why: str) -> Decision:
        """The charging place to go to; announces and records the decision.

        Raises:
            PeerError: The ontology cannot be asked.
            NowhereToGoError: None can be reached.
        """
        decision = self.chooser.choose_station(self.look(interrupt), why)
        self._sent_to_charge = why
        return self._decided(decision)

    def _decided(self, decision: Decision) -> Decision:
        self.heading_to = decision.place
        self.ports.announcer.decision(decision)
        self.note_decision(decision)
        return decision

    def note_decision(self, decision: Decision) -> None:
        """Records a decision, made here or by the reasoner."""
        if self._started is not None and decision.time >= self._started:
            self._write(
                'decision', place=decision.place, rule=decision.rule, reason=decision.reason
            )

    def explore(self, interrupt: Interrupt) -> bool:
        """Looks around in the place for its time, or what is left of that after a restart.

        Returns:
            False when the interrupt ended it early.
        """
        seconds = self.settings.choice.exploration_seconds
        begin = self.now() - min(self._explored, seconds)
        self._explored = 0.0
        while (left := begin + seconds - self.now()) > 0.0:
            if not self.clock.sleep(min(left, max(NOTE_SECONDS, seconds / 20.0)), interrupt):
                return False
            self._write('exploring', place=self.place, seconds=round(self.now() - begin, 3))
        return True

    def departs(self) -> None:
        """The robot leaves the place it is in; until it arrives it may be anywhere."""
        self.astray = True

    def arrived(self, place: str, distance: float, path: Sequence[Point] = ()) -> None:
        """The robot is in ``place``, after ``distance`` metres along ``path``."""
        self.place = place
        self.astray = False
        self._explored = 0.0
        self._visit(place)
        way = {'path': [[round(x, 2), round(y, 2)] for x, y, *_ in path]} if path else {}
        self._write('visit', place=place, distance=distance, **way)
        self.say(f'arrived in {place}')
        self.recovery.arrived(place)
        self.failure = None

    def leaves(self) -> None:
        """The robot was in its place until now."""
        self._visit(self.place)

    def _visit(self, place: str) -> None:
        """Notes a visit, which the ontology is told of with the next question."""
        self._visits[place] = self.now()
        self.chooser.saw(place, self.now())

    def make_sure_of(self, place: str, interrupt: Interrupt) -> None:
        """Makes sure that a move ended in ``place``.

        Raises:
            PeerError: The robot is elsewhere.
        """
        found = self.ports.knowledge.await_place(place, self.settings.settle_seconds, interrupt)
        if found not in (place, ''):
            raise PeerError('robot_place', f'the robot is in {found} instead of {place}')

    def came_back(self, distance: float) -> None:
        """The robot is again where it was last known to be, after ``distance`` metres."""
        self.astray = False
        self._visit(self.place)
        self._write('visit', place=self.place, distance=distance)
        self.say(f'back in {self.place}')

    def charged(self, place: str, seconds: float) -> None:
        """The battery was charged in ``place``."""
        self._sent_to_charge = ''
        self.recovery.charged(place)
        self.failure = None
        self._write('recharge', place=place, seconds=seconds)
        self.say(f'charged in {place} to {self.level_text()}')

    def ended(self) -> None:
        """The mission was told to end."""
        if self._started is not None:
            self._write('end')

    # The battery.

    def why_charge(self, reachable: tuple[str, ...] | None = None) -> str:
        """Why the robot must charge now, as a sentence; empty: it need not.

        Once it was sent to charge it must until it has: what is too little for the far end of the
        map may be enough beside the station.
        """
        level = self.gauge.level
        if self._sent_to_charge and not self.charged_enough():
            return self._sent_to_charge
        if self.gauge.low:
            return f'the battery is low ({self.level_text()})'
        if level is None:
            return ''
        required, words = self.chooser.required_level(self.place, reachable)
        if level >= required:
            return ''
        return f'the battery is at {level:g} %, below {required:.1f} %: {words}'

    def at_station(self) -> bool:
        """Whether the robot is where it can charge, and has not left half-way since.

        A station that did not charge lately is none as long as there is another.
        """
        stations = self.settings.choice.recharge_rooms
        good = [place for place in stations if place not in self.recovery.avoided(self.now())]
        return self.place in (good or stations) and not self.astray

    def charged_enough(self) -> bool:
        """Whether the robot may leave the station."""
        level = self.gauge.level
        enough = level is None or level >= self.settings.choice.battery.stop_recharge
        return enough and not self.gauge.low

    def await_contact(self, interrupt: Interrupt) -> None:
        """Gives a battery that says it is not being charged a moment to think better of it.

        Raises:
            PeerError: It says so for good: the robot is not where it can charge.
            InterruptedWaitError: The interrupt was raised.
        """

        def contact() -> bool:
            return self.gauge.charging is not False or self.charged_enough()

        with self.gauge.interrupting(interrupt, contact) as told:
            told.wait(self.settings.settle_seconds)
        if interrupt.is_set():
            raise InterruptedWaitError
        if not contact():
            raise PeerError(
                'battery',
                f'it is not charged ({self.level_text()}): the robot is not at a station',
            )

    def level_text(self) -> str:
        """The charge in words."""
        return 'level unknown' if self.gauge.level is None else f'{self.gauge.level:g} %'

    def _learn_draw(self) -> None:
        if self.gauge.level is not None:
            self.chooser.draw.observe(self.now(), self.gauge.level)

    # Failures.

    def failed(
        self, what: str, reason: str, goal: str | None = None, *, charging: bool = False
    ) -> None:
        """Remembers, records and says what did not work; see :class:`Failure`."""
        self.failure = Failure(what, reason, goal, charging)
        self._write('failure', what=what, reason=reason)
        self.say(f'{what} failed: {reason}', warning=True)

    def next_step(self, *, may_go_back: bool = True) -> Step:
        """What to do about the last failure."""
        assert self.failure is not None
        return self.recovery.next_step(self.failure, self.now(), may_go_back=may_go_back)

    # Small things.

    def now(self) -> float:
        """Seconds on the mission's clock."""
        return self.clock.now()

    def say(self, text: str, *, warning: bool = False) -> None:
        """Announces something."""
        self.ports.announcer.say(text, warning=warning)

    def _write(self, name: str, **fields: object) -> None:
        if self._record is None:
            return
        try:
            self._record.write(name, self.now(), **fields)
        except RecordError as error:
            # A full disk is no reason to stop patrolling; once is enough to say so.
            if str(error) != self._record_complaint:
                self._record_complaint = str(error)
                self.say(str(error), warning=True)
