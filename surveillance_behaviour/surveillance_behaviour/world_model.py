"""What one robot knows when it decides: looks at the world, asks `decide`, remembers what came.

The ontology says where the robot is, what it can reach, which classes each place has and when it
was visited: one snapshot for each choice. The world model adds what the robot itself knows better:
where the places are, when it was where, and how long each leg takes.

One process of a robot decides: `robot_behavior` in the behaviour `surveillance`, `reasoner` in
`patrol`. Each has one `WorldModel`, which holds all that is remembered between two decisions.
"""

from __future__ import annotations

import contextlib
import math
import random
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

from floor_plans import PatrolRules, Station
from patrol_policy.battery import Battery, ChargeCurve, Energy
from patrol_policy.decision import (
    RECHARGE,
    WAIT,
    DecisionSettings,
    RequestError,
    WhyNot,
    check_place,
    decide,
    energy_of,
    stations_within_reach,
    tour_warning,
    why_charge,
    why_not,
)
from patrol_policy.fleet import Intention, RightOfWay
from patrol_policy.graph import GraphError, PatrolGraph
from patrol_policy.plan import LEG_CHANGE
from patrol_policy.promises import Promise, promises, summary, verdicts
from patrol_policy.rule_table import ALERT, URGENT
from patrol_policy.world import Decision, PolicyMemory, World
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from strict_files.suggestions import nearest
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.experience import Experience
from surveillance_behaviour.fleet import FleetKnowledge, share_of
from surveillance_behaviour.ports import Ontology, Places, Point, UnknownPlaceError
from surveillance_ontology.robot_ontology import Snapshot

LOOK_AGAIN = 1.0
"""How long a robot waits for another one until it looks again, seconds."""
UNKNOWN_CHARGE = 600.0
"""How long a charge is taken to last before anything is known of the battery, seconds."""


class WorldModel:
    """Decides where one robot goes.

    Args:
        settings: Shared with whoever changes them.
        ontology: The ontology.
        places: Where the places are.
        battery: The battery.
        experience: What the robot has learned; default: nothing yet.
        generator: Chance, for the policies that need it.
        warn: Told once when no robot can keep to the threshold on this map, and when the rules
            name a class that the ontology does not have.
        announce: Told each decision.
        elapsed: Seconds as they pass, whatever the date is set to: drives are measured by them;
            None: by the times that are told.
        rules: What holds for single places.
        tell: Told what can be kept of the places, at the start and when that changes.
        promise: Given the same for each place, whenever what it rests on changes.
        stations: The stations by their places; how fast one charges is taken for true until it was
            seen.
        fleet: The robots that share the patrol; None: this one is alone.
        settle: Waits until what was published is heard, so that two robots that want the same at
            the same moment know it of each other.

    Attributes:
        settings: Those.
        experience: That.
        place: Where the robot is, as far as was heard.
        places: All places of the map when it was last looked at, within reach or not.
        graph: The part of the map that can be reached.
        world: What was known at the last look; None: there was none.
        promised: What can be kept of each place, as was found last.
    """

    def __init__(
        self,
        settings: DecisionSettings,
        ontology: Ontology,
        places: Places,
        battery: BatteryMonitor,
        experience: Experience | None = None,
        generator: random.Random | None = None,
        warn: Callable[[str], None] = lambda sentence: None,
        announce: Callable[[Decision], None] = lambda decision: None,
        elapsed: Callable[[], float] | None = None,
        rules: PatrolRules | None = None,
        tell: Callable[[str], None] = lambda sentence: None,
        stations: Mapping[str, Station] | None = None,
        fleet: FleetKnowledge | None = None,
        settle: Callable[[Interrupt], None] = lambda interrupt: None,
        promise: Callable[[tuple[Promise, ...]], None] = lambda found: None,
    ) -> None:
        self.settings = settings
        self.fleet = fleet
        self._settle = settle
        self._fleet_graph = PatrolGraph({})
        self._last: Snapshot | None = None
        self._cut_off = False
        self._wanted: tuple[str, float] = ('', 0.0)
        self._waits = False
        self._charge_until: float | None = None
        self.experience = experience or Experience()
        self.place = ''
        self.places: frozenset[str] = frozenset()
        self.graph = PatrolGraph({})
        self.world: World | None = None
        self._ontology = ontology
        self._places = places
        self._positions: dict[str, Point] = {}
        self._battery = battery
        self._memory = PolicyMemory(generator or random.Random())
        self._target: str | None = None
        self._leg: Decision | None = None
        self._elapsed = self.experience.elapsed = elapsed
        self._leg_began = 0.0
        self._graph_key: object = None
        self._since: float | None = None
        self._looking = threading.Lock()
        # A request is taken in the executor's thread, which brings the answers that a look waits
        # for: it must not wait for the look.
        self._saving = threading.Lock()
        self._warn = warn
        self._rules = rules or PatrolRules()
        self._tell = tell
        self._promise = promise
        self.take_stations(stations or {})
        self.promised: tuple[Promise, ...] = ()
        self._told: dict[str, str] = {}
        self._told_about: object = None
        self._announce = announce
        self._warned = False
        self._checked_threshold: object = None
        self._checked_seconds = 0.0
        self._checked_rules: tuple[str, ...] = ()

    def take_stations(self, stations: Mapping[str, Station]) -> None:
        """Take where the stations are, and how fast they charge."""
        self._stations = dict(stations)
        self._curves = {
            place: ChargeCurve.even(station.rate / 60.0)
            for place, station in stations.items()
            if station.rate
        }

    def take_rules(self, rules: PatrolRules) -> None:
        """Take what holds for single places, and ask for the places' points anew."""
        self._rules = rules
        self._positions = {}

    def battery(self) -> Battery:
        """Return what a decision knows of the battery now."""
        monitor, experience = self._battery, self.experience
        battery = Battery(
            monitor.level,
            monitor.low,
            experience.draw.draw,
            experience.sent_to_charge,
            {**self._curves, **experience.charge.curves()},
            self._approaches(),
        )
        if battery.sent_to_charge and battery.charged_enough(self.settings.battery):
            experience.sent_to_charge = ''
            return replace(battery, sent_to_charge='')
        return battery

    def _approaches(self) -> dict[str, float]:
        """Return the seconds from the points of recharge rooms to their stations."""
        return {
            place: math.dist(self._positions[place][:2], station.pose[:2]) / self.settings.speed
            for place, station in self._stations.items()
            if place in self._positions
        }

    def _passed(self, now: float) -> float:
        """Return the time that durations are measured by: the date may be set."""
        return now if self._elapsed is None else self._elapsed()

    def learn_draw(self, now: Callable[[], float]) -> None:
        """Learn from now on, whenever the battery is heard, how fast it falls and is charged.

        Args:
            now: Seconds as they pass; no setting of a clock counts.
        """

        def learn() -> None:
            if (level := self._battery.level) is not None:
                self.experience.draw.observe(now(), level)
                if self.place in self.settings.recharge_rooms:
                    self.experience.charge.observe(self.place, now(), level)
                self._tell_charge()

        self._battery.watch(learn)

    def look(
        self, now: float, interrupt: Interrupt, avoided: frozenset[str] = frozenset()
    ) -> World:
        """Return what is known now: one snapshot of the ontology.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends it.
            avoided: Places that could not be reached lately.

        Raises:
            CallError: The ontology cannot be asked.
        """
        with self._looking:
            world = self.world = self._refreshed(now, interrupt, avoided)
        self._check_threshold(world)
        self._check_rules(interrupt)
        return world

    def _refreshed(self, now: float, interrupt: Interrupt, avoided: frozenset[str]) -> World:
        """Take one snapshot of the ontology and bring the map up to date.

        The ontology is told in the same batch which visits it does not know: one that was built
        anew has them from here.
        """
        experience, settings = self.experience, self.settings
        jump = experience.tell_time(now)
        self._since = now if self._since is None else min(self._since + jump, now)
        threshold, classes = settings.urgency_threshold, settings.priorities.classes
        visits, own = experience.visits, self._rules.thresholds
        found, said = self._snapshot(now, classes, interrupt, threshold)
        self.graph = graph = self._map_of(found, interrupt)
        self.place = found.place
        told = self.fleet.visits() if self.fleet is not None else {}
        return World(
            place=found.place,
            now=now,
            reachable=tuple(place for place in found.reachable if place in graph.index),
            classes=self._rules.with_classes(found.classes),
            said=said,
            # The ontology counts whole seconds; another robot's visit may be later.
            visited_at={
                place: max(
                    found.visited_at.get(place, -1.0),
                    visits.get(place, -1.0),
                    told.get(place, -1.0),
                )
                for place in found.connections
                if place in found.visited_at or place in told
            },
            graph=graph,
            time_spread=experience.leg_times.spread,
            since=self._since,
            threshold=threshold,
            own_thresholds={**own, **found.thresholds},
            openings=self._rules.calendar.at(now),
            target=self._target,
            avoided=avoided,
            priorities=settings.priorities,
            requested=experience.requested,
            contradiction=found.contradiction,
            memory=self._memory,
            fleet=None if self.fleet is None else self.fleet.outlook(self._fleet_graph, now),
        )

    def _snapshot(
        self, now: float, classes: tuple[str, ...], interrupt: Interrupt, threshold: float
    ) -> tuple[Snapshot, Mapping[str, bool]]:
        """Return what the ontology says, and of which places whether they are URGENT.

        In a fleet, while it does not answer, what it said last.

        Raises:
            CallError: It does not answer, and nothing is known yet.
        """
        visits, last = self.experience.visits, self._last
        if self._cut_off and last is not None and not self._ontology.answers():
            here = self._ontology.await_place(self.place, 0.0, interrupt) or self.place
            if here in last.connections:
                return self._as_known(last, here)
        try:
            self._last = self._ontology.snapshot(
                now,
                classes if ALERT in classes else (*classes, ALERT),
                visits,
                interrupt,
                threshold,
                self._rules.thresholds,
            )
        except CallInterruptedError:
            raise
        except CallError as error:
            here = self._ontology.await_place(self.place, 0.0, interrupt) or self.place
            if self.fleet is None or last is None or here not in last.connections:
                raise
            if not self._cut_off:
                self._warn(f'{error}: patrolling on by what was known')
            self._cut_off = True
            return self._as_known(last, here)
        if self._cut_off:
            self._tell('the ontology answers again: it is told of the visits since')
        self._cut_off = False
        return self._last, self._said(self._last)

    def _said(self, found: Snapshot) -> dict[str, bool]:
        """Return of which places the ontology's word counts, and whether it holds them URGENT.

        An ontology that knows one threshold for all says nothing of a place with its own, unless
        nobody was there yet, or something was noticed there.
        """
        return {
            place: URGENT in kinds
            for place, kinds in found.classes.items()
            if place not in self._rules.thresholds
            or place in found.thresholds
            or place not in found.visited_at
            or ALERT in kinds
        }

    def _as_known(self, last: Snapshot, here: str) -> tuple[Snapshot, Mapping[str, bool]]:
        """Return what was known and what was seen since: the map is as it was.

        How long places wait says which are URGENT, and beside that what nobody has seen to.
        """
        assert self.fleet is not None
        seen = dict(last.visited_at)
        for visits in (self.experience.visits, self.fleet.visits()):
            for place, at in visits.items():
                if place in last.connections:
                    seen[place] = max(at, seen.get(place, -1.0))
        said = {
            place: True
            for place, kinds in last.classes.items()
            if place not in seen
            # Something was noticed there, and nobody came since.
            or ({ALERT, URGENT} <= kinds and seen[place] == last.visited_at.get(place))
        }
        known = replace(last, place=here, reachable=last.connections[here], visited_at=seen)
        return known, said

    def _map_of(self, found: Snapshot, interrupt: Interrupt) -> PatrolGraph:
        # A place that went may come back elsewhere.
        positions = {p: at for p, at in self._positions.items() if p in found.connections}
        self._positions = positions
        for place in found.connections:
            # One that was removed from the map a moment ago is unknown; the ontology will follow.
            with contextlib.suppress(UnknownPlaceError):
                if place not in positions:
                    positions[place] = self._places.position(place, interrupt)
        self.places = frozenset(positions)
        if found.place not in positions:
            raise CallError(f'ontology: the robot is in {found.place}, which is not on the map')
        times, exploring = self.experience.leg_times, self.settings.exploration_seconds
        own_exploring = self._rules.exploration
        times.forget_fit(self.settings.speed)

        def metres(start: str, goal: str) -> float:
            # Of the points that were asked for here: another place may be taken meanwhile.
            return math.dist(positions[start][:2], positions[goal][:2])

        legs = {
            place: {
                other: times.used(place, other, metres(place, other))
                for other in others
                if other in positions
            }
            for place, others in found.connections.items()
            if place in positions
        }
        key = (True, legs, exploring, own_exploring)
        if (found.place in self.graph.index, *key[1:]) == self._graph_key:
            return self.graph
        try:
            whole = PatrolGraph(legs, exploring, own_exploring)
            graph = whole.connected(found.place)
        except GraphError as error:
            raise CallError(f'ontology: {error}') from None
        self._graph_key = key
        if self.fleet is not None:
            # All compute with the same times, whatever each has learned.
            alike = {
                place: {
                    other: max(0.1, round(metres(place, other) / self.settings.speed, 1))
                    for other in ways
                }
                for place, ways in legs.items()
            }
            whole = PatrolGraph(alike, exploring, own_exploring)
            self._fleet_graph = whole.connected(found.place)
        return graph

    def _metres(self, start: str, goal: str) -> float:
        """Return the metres between two places in a straight line; 0: one is not known."""
        positions = self._positions
        if start not in positions or goal not in positions:
            return 0.0
        return math.dist(positions[start][:2], positions[goal][:2])

    def _check_threshold(self, world: World) -> None:
        """Warn of a threshold that no robot can keep to.

        The shortest tour takes long on a large map. It is looked for anew only when places or
        threshold have changed, or what all legs take together, by more than `LEG_CHANGE`.
        """
        of_what = world.threshold, world.graph.places
        seconds = sum(sum(ways.values()) for ways in world.graph.leg_seconds.values())
        alike = abs(seconds - self._checked_seconds) <= LEG_CHANGE * self._checked_seconds
        if of_what == self._checked_threshold and (self._warned or alike):
            return
        self._checked_threshold, self._checked_seconds = of_what, seconds
        warning = tour_warning(world.graph.tour.length, world.threshold)
        self._warned = bool(warning)
        if warning:
            self._warn(warning)

    def promises(self, world: World) -> tuple[Promise, ...]:
        """Return what can be kept of each place, as things are."""
        return promises(world, self.battery(), self.settings, sorted(self.places))

    def _tell_promises(self, world: World) -> None:
        """Say what can be kept of the places, at the start and when what it rests on changes."""
        battery, settings = self.battery(), self.settings
        about = (
            self._memory.plan,
            world.graph.places,
            world.threshold,
            settings.policy,
            settings.recharge_rooms,
            f'{battery.draw.rate:.1g}',
            frozenset(world.openings.closed),
            self.places,
            self._rules,
            self._fleet_waits(world),
        )
        if about == self._told_about:
            return
        found = self.promised = self.promises(world)
        # The first time there was no plan yet.
        self._told_about = (self._memory.plan, *about[1:])
        self._promise(found)
        told = verdicts(found)
        if any(self._told.get(place, '') != verdict for place, verdict in told.items()):
            self._told = {**self._told, **told}
            self._tell(summary(found))

    def _fleet_waits(self, world: World) -> tuple[str, ...]:
        """Return what the fleet keeps, so roughly that only a changed plan changes it."""
        if world.fleet is None:
            return ()
        found = world.fleet.waits(world.now)
        return tuple(f'{place} {wait:.1g}' for place, wait in sorted(found.items()))

    def _check_rules(self, interrupt: Interrupt) -> None:
        """Say which class of the rules no place can ever be in."""
        classes = self.settings.priorities.classes
        if classes == self._checked_rules:
            return
        known = self._ontology.place_classes(interrupt)
        self._checked_rules = classes
        for name in classes:
            if name not in known:
                self._warn(
                    f'rooms_priority: the ontology has no class {name!r} of places, expected '
                    f'{nearest(name, known)}; this rule never applies'
                )

    def begin(self, now: float, interrupt: Interrupt) -> str:
        """Look for the first time; where the robot is.

        Raises:
            CallError: The ontology cannot be asked.
        """
        world = self.look(now, interrupt)
        self._tell_promises(world)
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
        if self.experience.requested in avoided:
            self.experience.requested = ''  # It was tried.
        # Where the robot was heard of last it is now. That visit is told with the snapshot's own
        # time, so that the ontology, too, knows until when the robot was there.
        if here := self._ontology.await_place(self.place, 0.0, interrupt):
            self.saw(here, now)
        world = self.look(now, interrupt, avoided)
        # Else it is in no place, as where a drive ended early: the ontology has the last one.
        self.saw(world.place, now, came=None if here else self._came)
        if to_charge and not self.experience.sent_to_charge:
            why = why_charge(world, self.battery(), self.settings)
            self.send_to_charge(why or 'charging was begun')
        battery = self.battery()
        try:
            decision = decide(world, battery, self.settings)
        except RequestError as error:
            # What a person asked for in vain is no failure of the patrol.
            if self.experience.requested == world.requested:
                self.experience.requested = ''
            self._warn(f'{error}: continuing without it')
            decision = decide(replace(world, requested=''), battery, self.settings)
        # Of the same plan: nothing is planned for it.
        self._tell_promises(world)
        why = ''
        if is_new := decision.rule == RECHARGE and not self.experience.sent_to_charge:
            why = why_charge(world, battery, self.settings)
            # A charge that was planned is a charge: it goes on until it is enough; one in passing
            # until its time is over, which the others are told.
            self._charge_until = None
            if not why and decision.slot is not None and decision.place == world.place:
                approach = battery.approaches.get(decision.place, 0.0)
                self._charge_until = decision.slot.end + approach
        decision = self._in_traffic(decision, world, interrupt)
        self._target = decision.target
        goes_on = not why and battery.charged_enough(self.settings.battery)
        if is_new and decision.rule == RECHARGE and not goes_on:
            self.experience.sent_to_charge = why or decision.reason.partition(';')[0]
        if world.contradiction:
            decision = replace(decision, reason=f'{decision.reason}; {world.contradiction}')
        self._leg, self._leg_began = decision, self._passed(decision.time)
        self._save()
        self._announce(decision)
        return decision

    def _in_traffic(self, decision: Decision, world: World, interrupt: Interrupt) -> Decision:
        """Publish what was decided, and wait or give way where another robot goes first."""
        fleet = self.fleet
        if fleet is None:
            return decision
        here, now = world.place, world.now
        goes = decision.place != here or not decision.stay
        if decision.target != self._wanted[0]:
            # Who waits keeps its turn, whatever it wants meanwhile.
            self._wanted = (decision.target, self._wanted[1] if self._waits else now)
        self._waits = False
        dock = decision.target if decision.rule == RECHARGE else None
        wish = Intention(
            fleet.name,
            here,
            decision.place if goes and decision.place != here else '',
            self._wanted[1],
        )
        is_new = wish != fleet.own.intention
        share = share_of(decision, fleet.own.robot.share)
        begins = {'since': now} if dock is not None and fleet.own.robot.dock is None else {}
        fleet.tell(
            place=here,
            now=now,
            visits=self.experience.visits.copy(),
            intention=wish,
            share=share,
            dock=dock,
            **self._charge_facts(world, dock),
            **begins,
        )
        if dock is not None and dock in (here, decision.place) and (other := self._at_dock(dock)):
            reason = f"{decision.reason}; the station in {dock} is {other}'s"
            return self._waiting(decision, world, reason)
        if not fleet.others():
            right = RightOfWay(True, wish.heading_to or here)
        else:
            # What was said before is known to all by now.
            if is_new and fleet.may_be_contested(world.graph.leg_seconds, now):
                self._settle(interrupt)
                if interrupt.is_set():
                    raise CallInterruptedError
            right = fleet.right_of_way(world.graph.leg_seconds, now)
        if not right.go:
            return self._waiting(decision, world, f'waiting in {here}: {right.because}')
        if not wish.heading_to and right.place not in ('', here):
            decision = replace(
                decision,
                place=right.place,
                target=right.place,
                rule=WAIT,
                reason=f'giving way: {right.because}',
                stay=0.0,
            )
            wish = replace(wish, heading_to=right.place)
        if wish.heading_to:
            fleet.tell(intention=replace(wish, is_moving=True))
        return decision

    def _waiting(self, decision: Decision, world: World, reason: str) -> Decision:
        self._waits = True
        return replace(
            decision,
            place=world.place,
            rule=WAIT,
            reason=reason,
            stay=LOOK_AGAIN,
            share=None,
            slot=None,
        )

    def _at_dock(self, dock: str) -> str:
        """Return the robot that has a dock, or is about to drive up to it; empty: none."""
        assert self.fleet is not None
        world = self.world
        assert world is not None
        assert world.fleet is not None
        for robot in sorted(world.fleet.robots, key=lambda each: each.name):
            if robot.name != self.fleet.name and robot.dock == dock and robot.place == dock:
                return robot.name
        return ''

    def take_out(self, out: bool) -> str:
        """Take this robot out of the fleet's patrol, or put it back; return what was done."""
        assert self.fleet is not None
        self.fleet.tell(taken_out=out, share=None)
        if out:
            return f'{self.fleet.name} is taken out: the others have its places'
        return f'{self.fleet.name} patrols again'

    def dock_is_taken(self) -> bool:
        """Return whether another robot of the fleet charges where this one is."""
        if self.fleet is None or self.world is None or self.place != self.world.place:
            return False
        return bool(self._at_dock(self.place))

    def charge_is_over(self, now: float) -> bool:
        """Return whether a charge in passing has had its time, and the battery asks for none."""
        world = self.world
        if world is None or self._charge_until is None or now < self._charge_until:
            return False
        battery = replace(self.battery(), sent_to_charge='')
        return not why_charge(world, battery, self.settings)

    def _charge_facts(self, world: World, dock: str | None) -> dict[str, float | None]:
        """Return what the others must know of this robot's battery."""
        battery, limits = self.battery(), self.settings.battery
        energy = energy_of(world, battery, self.settings)
        facts: dict[str, float | None] = {
            'charging_until': None,
            'runs_until': None,
            'charge_seconds': 0.0,
        }
        if energy is None or battery.level is None:
            if dock is not None:
                facts['charging_until'] = world.now + UNKNOWN_CHARGE
            return facts
        least = max(
            limits.require_recharge,
            max(level for level in energy.least if math.isfinite(level)),
        )
        # What it would take now: a full battery needs no time at a dock yet.
        facts['charge_seconds'] = energy.charge_seconds(0, battery.level)
        assert self.fleet is not None
        self.fleet.charges_at(energy.charge_ratio(self._fleet_graph.tour.length))
        facts['runs_until'] = world.now + max(0.0, battery.level - least) / energy.draw
        if dock is not None:
            facts['charging_until'] = self._charges_until(world.now, energy, battery.level)
        return facts

    def _charges_until(self, now: float, energy: Energy, level: float) -> float:
        """Return when this robot leaves its dock: when it is full, or its time in passing is over.

        Where that is over, and the battery does not let it go on, it charges until it is full.
        """
        full, ends = now + energy.charge_seconds(0, level), self._charge_until
        return full if ends is None or ends <= now else min(full, ends)

    def _tell_charge(self) -> None:
        """Tell the others until when this robot charges, as the level rises."""
        fleet, world = self.fleet, self.world
        if fleet is None or world is None or fleet.own.robot.dock is None:
            return
        battery = self.battery()
        energy = energy_of(world, battery, self.settings)
        if energy is not None and battery.level is not None:
            now = max(self.experience.now or world.now, world.now)
            fleet.tell(charging_until=self._charges_until(now, energy, battery.level))

    def _stands(self) -> None:
        """Tell the others that this robot is not on its way any more."""
        if self.fleet is not None and self.fleet.own.intention.heading_to:
            place = self.place or self.fleet.own.robot.place
            since = self._wanted[1]
            self.fleet.tell(intention=Intention(self.fleet.name, place, '', since))

    def _save(self) -> None:
        with self._saving:
            self.experience.save()

    def exploring(self, place: str, usual: float) -> float:
        """Return the seconds for which a place is explored; ``usual`` unless it differs."""
        return self._rules.exploration.get(place, usual)

    def why_charge(self) -> str:
        """Return why the robot must charge now, as far as is known without looking; empty: no."""
        world, place = self.world, self.place
        if world is None:
            return ''
        if place != world.place and place in world.graph.index:
            world = replace(world, place=place, reachable=tuple(world.graph.leg_seconds[place]))
        return why_charge(world, self.battery(), self.settings)

    @property
    def _came(self) -> float | None:
        """When the robot came to the place that the ontology has; None where nobody told."""
        stamp = 0 if self._last is None else self._last.seen_at
        return stamp / 1e9 if stamp else None

    def saw(self, place: str, now: float, *, came: float | None = None) -> None:
        """Note that the robot is in ``place``; finer than the ontology's whole seconds.

        Args:
            place: The place.
            now: Seconds on the mission's clock.
            came: When it came there, where it has left since; None: it is there now.
        """
        self.place = place
        self.experience.saw(place, now, came=came)
        if came is None and place == self._target:
            self._target = None
        if came is None and place == self.experience.requested:
            self.experience.requested = ''
        if self.fleet is not None:
            self.fleet.tell(place=place, now=now, visits=self.experience.visits.copy())

    def arrived(self, place: str, now: float, metres: float | None = None) -> None:
        """Note that the robot has come to ``place``, over a path of so many metres.

        What the drive took is learned if nothing came between the decision and the arrival.
        """
        leg, self._leg = self._leg, None
        if leg is not None and leg.place == place:
            start = leg.from_place
            if place in self.graph.leg_seconds.get(start, ()):
                straight = self._metres(start, place)
                seconds = self._passed(now) - self._leg_began
                self.experience.leg_times.observe(start, place, seconds, straight, metres)
        self.saw(place, now)
        self._stands()

    def disturbed(self) -> None:
        """Note that the present drive is no example of how long a leg takes."""
        self._leg = None
        self._stands()

    def charged(self) -> None:
        """Note that the robot has been charged."""
        self.experience.sent_to_charge = ''
        self._charge_until = None
        self._leg = None
        if self.fleet is not None:
            now = self.experience.now or (self.world.now if self.world is not None else 0.0)
            self.fleet.tell(dock=None, charging_until=None, since=now)

    def send_to_charge(self, why: str) -> None:
        """Have the robot charge before anything else."""
        self._charge_until = None
        self.experience.sent_to_charge = why

    def route_round(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places of another way between two neighbours; empty when there is none."""
        try:
            return self.graph.without_leg(start, goal).route(start, goal)
        except (GraphError, KeyError):
            return ()

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
        if place == self.place and self._leg is None:
            return f'the robot is in {place} already'
        self.experience.requested = place
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
