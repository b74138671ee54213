"""What decides where one robot goes: looks, asks `decide`, and remembers what came of it.

The ontology says where the robot is, what it can reach, which classes each place has and when it
was visited: one snapshot for each choice (`ontology_view`). The robot itself knows better where the
places are and how long each leg takes (`patrol_map`), when it was where (`learned`), and who is
on its way, too (`traffic`). `announcements` says beside the decisions what cannot work or be kept.

One process of a robot decides: `robot_behavior` in the behaviour `surveillance`, `reasoner` in
`patrol`. Each has one `DecisionMaker`, which holds all that is remembered between two decisions.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

from floor_plans import PatrolRules, Station
from patrol_policy.battery import Battery, ChargeCurve
from patrol_policy.decision import (
    RECHARGE,
    DecisionSettings,
    RequestError,
    WhyNot,
    check_place,
    decide,
    stations_within_reach,
    why_charge,
    why_not,
)
from patrol_policy.graph import PatrolGraph
from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.situation import Decision, PolicyMemory, Situation
from state_machines import Interrupt
from surveillance_behaviour.announcements import IdlenessReporter, SettingsCheck
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.learned_times import LearnedTimes, LegTimer
from surveillance_behaviour.ontology_view import OntologyView
from surveillance_behaviour.patrol_map import PatrolMap
from surveillance_behaviour.ports import Ontology, Places
from surveillance_behaviour.traffic import Traffic


class DecisionMaker:
    """Decides where one robot goes.

    One thread at a time looks; the executor's thread takes requests, news of the battery and
    changes of the place in between.

    Args:
        settings: Shared with whoever changes them.
        ontology: The ontology.
        places: Where the places are.
        battery: The battery.
        learned: What the robot has learned; default: nothing yet.
        generator: Chance, for the policies that need it.
        warn: Told once which threshold no robot can keep, and of a class that is not there.
        announce: Told each decision.
        elapsed: Seconds as they pass, whatever the date is set to: drives are measured by them;
            None: by the times that are told.
        rules: What holds for single places.
        tell: Told what can be kept of the places, at the start and when that changes.
        publish_bounds: Given the same for each place, whenever what it rests on changes.
        stations: The stations by their places, with rates that count until they are seen.
        traffic: The robot's way among those of its fleet; default: it is alone.
        sweeps: Returns how long each place that is swept takes, seconds, as far as is known.

    Attributes:
        settings: Those.
        learned: That.
        traffic: That.
        place: Where the robot is, as far as was heard.
        idleness: Tells how long each place will wait.
        stations: The stations by their places.
        world: What was known at the last look; None: there was none.
    """

    def __init__(
        self,
        settings: DecisionSettings,
        ontology: Ontology,
        places: Places,
        battery: BatteryMonitor,
        learned: LearnedTimes | None = None,
        generator: random.Random | None = None,
        warn: Callable[[str], None] = lambda sentence: None,
        announce: Callable[[Decision], None] = lambda decision: None,
        elapsed: Callable[[], float] | None = None,
        rules: PatrolRules | None = None,
        tell: Callable[[str], None] = lambda sentence: None,
        stations: Mapping[str, Station] | None = None,
        traffic: Traffic | None = None,
        publish_bounds: Callable[[tuple[IdlenessBound, ...]], None] = lambda found: None,
        sweeps: Callable[[], Mapping[str, float]] = dict,
    ) -> None:
        self.settings = settings
        self.learned = learned or LearnedTimes()
        self.learned.elapsed = elapsed
        self.traffic = traffic or Traffic()
        self.place = ''
        self.world: Situation | None = None
        self._view = OntologyView(ontology, settings, self.traffic.others_visits, warn, tell)
        self._map = PatrolMap(places, settings, self.learned.leg_times, sweeps)
        self._check = SettingsCheck(settings, warn)
        self.idleness = IdlenessReporter(settings, tell, publish_bounds)
        self._leg = LegTimer(elapsed)
        self._battery = battery
        self._memory = PolicyMemory(generator or random.Random())
        self._warn, self._announce = warn, announce
        self._target: str | None = None
        self._since: float | None = None
        self._looking = threading.Lock()
        # A request is taken in the executor's thread, which brings the answers that a look waits
        # for: it must not wait for the look.
        self._saving = threading.Lock()
        self._rules = rules or PatrolRules()
        self.take_stations(stations or {})

    # What may change while it runs.

    def take_stations(self, stations: Mapping[str, Station]) -> None:
        """Take where the stations are, and how fast they charge."""
        self.stations = dict(stations)

    def take_rules(self, rules: PatrolRules) -> None:
        """Take what holds for single places, and ask for the places' points anew."""
        self._rules = rules
        self._map.ask_anew()

    @property
    def rules(self) -> PatrolRules:
        """What holds for single places."""
        return self._rules

    # What is known.

    @property
    def places(self) -> frozenset[str]:
        """All places of the map when it was last looked at, within reach or not."""
        return self._map.places

    @property
    def graph(self) -> PatrolGraph:
        """The part of the map that can be reached."""
        return self._map.graph

    @property
    def idleness_bounds(self) -> tuple[IdlenessBound, ...]:
        """What can be kept of each place, as was found last."""
        return self.idleness.bounds

    def battery(self) -> Battery:
        """Return what a decision knows of the battery now."""
        monitor, learned = self._battery, self.learned
        told = {p: ChargeCurve.even(s.rate / 60.0) for p, s in self.stations.items() if s.rate}
        battery = Battery(
            monitor.level,
            monitor.low,
            learned.draw.draw,
            learned.sent_to_charge,
            {**told, **learned.charge.curves()},
            self._map.approaches(self.stations),
        )
        if battery.sent_to_charge and battery.charged_enough(self.settings.battery):
            learned.sent_to_charge = ''
            return replace(battery, sent_to_charge='')
        return battery

    def learn_draw(self, now: Callable[[], float]) -> None:
        """Learn from now on, whenever the battery is heard, how fast it falls and is charged.

        Args:
            now: Seconds as they pass; no setting of a clock counts.
        """

        def learn() -> None:
            if (level := self._battery.level) is None:
                return
            self.learned.draw.observe(now(), level)
            if self.place in self.settings.recharge_rooms:
                self.learned.charge.observe(self.place, now(), level)
            if (world := self.world) is not None:
                latest = max(self.learned.now or world.now, world.now)
                self.traffic.tell_charge(world, self.battery(), latest)

        self._battery.watch(learn)

    def look(
        self, now: float, interrupt: Interrupt, avoided: frozenset[str] = frozenset()
    ) -> Situation:
        """Return what is known now: one snapshot of the ontology, and the map brought up to date.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends it.
            avoided: Places that could not be reached lately.

        Raises:
            CallError: The ontology cannot be asked.
        """
        with self._looking:
            world = self.world = self._known(now, interrupt, avoided)
        self._check.threshold(world)
        self._check.classes(self._view.place_classes, interrupt)
        return world

    def _known(self, now: float, interrupt: Interrupt, avoided: frozenset[str]) -> Situation:
        learned, rules = self.learned, self._rules
        jump = learned.tell_time(now)
        self._since = now if self._since is None else min(self._since + jump, now)
        found, said = self._view.look(now, self.place, rules, learned.visited_at, interrupt)
        graph = self._map.update(found, rules.exploration, interrupt)
        self.place = found.place
        others = self.traffic.others_visits() if self.traffic.others_visits else {}
        # The ontology counts whole seconds; another robot's visit may be later.
        sources = (found.visited_at, learned.visited_at, others)
        return Situation(
            place=found.place,
            now=now,
            reachable=tuple(place for place in found.reachable if place in graph.index),
            classes=rules.with_classes(found.classes),
            said=said,
            visited_at={
                place: max(source.get(place, -1.0) for source in sources)
                for place in found.connections
                if place in found.visited_at or place in others
            },
            graph=graph,
            time_spread=learned.leg_times.spread,
            since=self._since,
            threshold=self.settings.urgency_threshold,
            own_thresholds={**rules.thresholds, **found.thresholds},
            openings=rules.calendar.at(now),
            target=self._target,
            avoided=avoided,
            priorities=self.settings.priorities,
            requested=learned.requested,
            contradiction=found.contradiction,
            memory=self._memory,
            fleet=self.traffic.outlook(self._map.with_straight_times, now),
        )

    # Decisions.

    def begin(self, now: float, interrupt: Interrupt) -> str:
        """Look for the first time; where the robot is.

        Raises:
            CallError: The ontology cannot be asked.
        """
        world = self.look(now, interrupt)
        self.idleness.tell(world, self.battery(), self.places, self._rules)
        return world.place

    def decide(
        self,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str] = frozenset(),
        *,
        to_charge: bool = False,
    ) -> Decision:
        """Look, and choose where to go next; see `look`.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends it.
            avoided: Places that could not be reached lately.
            to_charge: Only a charging place will do.

        Raises:
            CallError: The ontology cannot be asked.
            NowhereToGoError: Nothing can be reached.
        """
        learned = self.learned
        if learned.requested in avoided:
            learned.requested = ''  # It was tried.
        # Where the robot was heard of last it is now. That visit is told with the snapshot's own
        # time, so that the ontology, too, knows until when the robot was there.
        if here := self._view.heard_place(self.place, interrupt):
            self.saw(here, now)
        world = self.look(now, interrupt, avoided)
        # Else it is in no place, as where a drive ended early: the ontology has the last one.
        self.saw(world.place, now, came=None if here else self._view.came)
        if to_charge and not learned.sent_to_charge:
            why = why_charge(world, self.battery(), self.settings)
            self.send_to_charge(why or 'charging was begun')
        battery = self.battery()
        decision = self._decided(world, battery)
        # Of the same plan: nothing is planned for it.
        self.idleness.tell(world, self.battery(), self.places, self._rules)
        why, is_new = '', decision.rule == RECHARGE and not learned.sent_to_charge
        if is_new:
            why = why_charge(world, battery, self.settings)
            approach = battery.approaches.get(decision.place, 0.0)
            self.traffic.begin_charge(decision, why, approach)
        decision = self.traffic.enter(
            decision, world, self.battery(), learned.visited_at.copy(), interrupt
        )
        self._target = decision.target
        # A charge that was planned is a charge: it goes on until it is enough; one in passing until
        # its time is over, which the others are told.
        goes_on = not why and battery.charged_enough(self.settings.battery)
        if is_new and decision.rule == RECHARGE and not goes_on:
            learned.sent_to_charge = why or decision.reason.partition(';')[0]
        if world.contradiction:
            decision = replace(decision, reason=f'{decision.reason}; {world.contradiction}')
        self._leg.begin(decision)
        self._save()
        self._announce(decision)
        return decision

    def _decided(self, world: Situation, battery: Battery) -> Decision:
        try:
            return decide(world, battery, self.settings)
        except RequestError as error:
            # What a person asked for in vain is no failure of the patrol.
            if self.learned.requested == world.requested:
                self.learned.requested = ''
            self._warn(f'{error}: continuing without it')
            return decide(replace(world, requested=''), battery, self.settings)

    def request(self, place: str) -> str:
        """Send the robot to a place before the policy decides again; empty: home, to charge.

        Returns:
            What will be done.

        Raises:
            ValueError: There is no such place.
        """
        world = self.world
        if world is None:
            raise ValueError('the map is not known yet')
        if not place:
            here = replace(world, place=self.place or world.place)
            within = stations_within_reach(here, self.settings.recharge_rooms)
            if not within:
                raise ValueError('no charging place can be reached')
            place = min(within, key=lambda station: within[station])
        check_place(place, world)
        if place == self.place and not self._leg.is_running:
            return f'the robot is in {place} already'
        self.learned.requested = place
        self._save()
        return f'the robot goes to {place} when it has ended what it is at'

    def why_not(
        self,
        place: str,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str] = frozenset(),
    ) -> WhyNot:
        """Tell why the robot would not go to ``place`` now.

        Raises:
            ValueError: There is no such place.
            CallError: The ontology cannot be asked.
        """
        world = self.look(now, interrupt, avoided)
        return why_not(place, world, self.battery(), self.settings)

    def why_charge(self) -> str:
        """Return why the robot must charge now, as far as is known without looking; empty: no."""
        world, place = self.world, self.place
        if world is None:
            return ''
        if place != world.place and place in world.graph.index:
            world = replace(world, place=place, reachable=tuple(world.graph.leg_seconds[place]))
        return why_charge(world, self.battery(), self.settings)

    def exploring(self, place: str, usual: float) -> float:
        """Return the seconds for which a place is explored; ``usual`` unless it differs."""
        return self._rules.exploration.get(place, usual)

    def detour(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places of another way between two neighbours; empty when there is none."""
        return self._map.detour(start, goal)

    # What came of it.

    def saw(self, place: str, now: float, *, came: float | None = None) -> None:
        """Note that the robot is in ``place``; finer than the ontology's whole seconds.

        Args:
            place: The place.
            now: Seconds on the mission's clock.
            came: When it came there, where it has left since; None: it is there now.
        """
        self.place = place
        self.learned.saw(place, now, came=came)
        if came is None and place == self._target:
            self._target = None
        if came is None and place == self.learned.requested:
            self.learned.requested = ''
        self.traffic.saw(place, now, self.learned.visited_at.copy())

    def arrived(self, place: str, now: float, metres: float | None = None) -> None:
        """Note that the robot has come to ``place``, over a path of so many metres.

        What the drive took is learned if nothing came between the decision and the arrival.
        """
        leg = self._leg.end(place, now)
        if leg is not None and place in self.graph.leg_seconds.get(leg.start, ()):
            straight = self._map.metres(leg.start, place)
            self.learned.leg_times.observe(leg.start, place, leg.seconds, straight, metres)
        self.saw(place, now)
        self.traffic.stands(self.place)

    def disturbed(self) -> None:
        """Note that the present drive is no example of how long a leg takes."""
        self._leg.forget()
        self.traffic.stands(self.place)

    def send_to_charge(self, why: str) -> None:
        """Have the robot charge before anything else."""
        self.traffic.begin_whole_charge()
        self.learned.sent_to_charge = why

    def charged(self) -> None:
        """Note that the robot has been charged."""
        self.learned.sent_to_charge = ''
        self._leg.forget()
        self.traffic.charged(self.learned.now or (self.world.now if self.world else 0.0))

    def charge_is_over(self, now: float) -> bool:
        """Return whether a charge in passing has had its time, and the battery asks for none."""
        world = self.world
        if world is None or not self.traffic.passing_charge_is_over(now):
            return False
        return not why_charge(world, replace(self.battery(), sent_to_charge=''), self.settings)

    def dock_is_taken(self) -> bool:
        """Return whether another robot of the fleet charges where this one is."""
        world = self.world
        if world is None or self.place != world.place:
            return False
        return bool(self.traffic.who_is_at(self.place, world))

    def _save(self) -> None:
        with self._saving:
            self.learned.save()
