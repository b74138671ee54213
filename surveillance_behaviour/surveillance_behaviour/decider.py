"""Decides for one robot: looks at the world, asks `decide`, and remembers what came of it.

One process of a robot decides: `robot_behavior` in the behaviour `surveillance`, `reasoner` in
`patrol`. Each has one `Decider`, which holds all that is remembered between two decisions.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.decision import (
    RECHARGE,
    DecisionSettings,
    RequestError,
    WhyNot,
    check_place,
    decide,
    stations_within_reach,
    tour_warning,
    why_charge,
    why_not,
)
from surveillance_behaviour.peers.ports import Ontology, Places
from surveillance_behaviour.policy.battery_reserve import Battery
from surveillance_behaviour.policy.graph import GraphError
from surveillance_behaviour.policy.plan import LEG_CHANGE
from surveillance_behaviour.policy.world import Decision, World
from surveillance_behaviour.world_model import Experience, WorldModel
from surveillance_fsm import Interrupt
from surveillance_runtime.parameters import parameter
from surveillance_runtime.suggestions import nearest


@dataclass(frozen=True)
class MemorySettings:
    """Parameters of a node that decides: its record and its random seed."""

    record: str = parameter(
        '',
        'File that the mission is recorded in, and beside which `FILE.experience.json` keeps what '
        'was learned (visits, leg times, battery); empty: none.',
    )
    random_seed: int = parameter(
        -1, 'Makes the policies that draw repeatable; -1 takes another course each time.', -1
    )


class Decider:
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
    ) -> None:
        self.settings = settings
        self._ontology = ontology
        self.model = WorldModel(settings, ontology, places, experience, generator)
        self._battery = battery
        self._looking = threading.Lock()
        # A request is taken in the executor's thread, which brings the answers that a look waits
        # for: it must not wait for the look.
        self._saving = threading.Lock()
        self._leg: Decision | None = None
        self._warn = warn
        self._warned = False
        self._checked_threshold: object = None
        self._checked_seconds = 0.0
        self._checked_rules: tuple[str, ...] = ()

    @classmethod
    def of_mission(
        cls,
        settings: DecisionSettings,
        ontology: Ontology,
        places: Places,
        battery: BatteryMonitor,
        now: Callable[[], float],
        warn: Callable[[str], None],
        memory: MemorySettings,
    ) -> Decider:
        """Return a decider that knows what was learned before and learns the battery's draw.

        Args:
            settings: Shared with whoever changes them.
            ontology: The ontology.
            places: Where the places are.
            battery: The battery.
            now: Seconds on the mission's clock.
            warn: See `Decider`; also told when what was learned cannot be read.
            memory: Where what was learned is, see `Experience.of_record`.
        """
        experience = Experience.of_record(memory.record)
        if experience.problem:
            warn(experience.problem)
        generator = random.Random(memory.random_seed if memory.random_seed >= 0 else None)
        decider = cls(settings, ontology, places, battery, experience, generator, warn)
        battery.watch(lambda: decider.learn_draw(now()))
        return decider

    @property
    def experience(self) -> Experience:
        """What the robot has learned."""
        return self.model.experience

    @property
    def places(self) -> frozenset[str]:
        """All places of the map when it was last looked at."""
        return self.model.places

    def battery(self) -> Battery:
        """Return what a decision knows of the battery now."""
        monitor, experience = self._battery, self.experience
        battery = Battery(
            monitor.level,
            monitor.low,
            experience.draw.draw,
            experience.sent_to_charge,
        )
        if battery.sent_to_charge and battery.charged_enough(self.settings.battery):
            experience.sent_to_charge = ''
            return replace(battery, sent_to_charge='')
        return battery

    def learn_draw(self, now: float) -> None:
        """Learn from the battery's level now how fast it falls."""
        if self._battery.level is not None:
            self.experience.draw.observe(now, self._battery.level)

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
            world = self.model.refresh(now, interrupt, avoided)
        self._check_threshold(world)
        self._check_rules(interrupt)
        return world

    def _check_threshold(self, world: World) -> None:
        """Warn of a threshold that no robot can keep to.

        The shortest tour takes long on a large map. It is looked for anew only when places or
        threshold have changed, or what all legs take together, by more than `LEG_CHANGE`.
        """
        of_what = world.threshold, world.graph.places
        seconds = sum(sum(ways.values()) for ways in world.graph.legs.values())
        alike = abs(seconds - self._checked_seconds) <= LEG_CHANGE * self._checked_seconds
        if of_what == self._checked_threshold and (self._warned or alike):
            return
        self._checked_threshold, self._checked_seconds = of_what, seconds
        warning = tour_warning(world.graph.tour.length, world.threshold)
        self._warned = bool(warning)
        if warning:
            self._warn(warning)

    def _check_rules(self, interrupt: Interrupt) -> None:
        """Say which class of the rules no place can ever be in."""
        classes = self.settings.rules.classes
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
        return self.look(now, interrupt).place

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
        self.model.stands(now, interrupt)
        world = self.look(now, interrupt, avoided)
        self.model.saw(world.place, now)
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
        self.model.target = decision.target
        if decision.rule == RECHARGE and not self.experience.sent_to_charge:
            self.experience.sent_to_charge = why_charge(world, battery, self.settings)
        if self.model.contradiction:
            reason = f'{decision.reason}; {self.model.contradiction}'
            decision = replace(decision, reason=reason)
        self._leg = decision
        self._save()
        return decision

    def _save(self) -> None:
        with self._saving:
            self.experience.save()

    def why_charge(self) -> str:
        """Return why the robot must charge now, as far as is known without looking; empty: no."""
        world = self.model.world
        if world is None:
            return ''
        place = self.model.place
        if place != world.place and place in world.graph.index:
            world = replace(world, place=place, reachable=tuple(world.graph.legs[place]))
        return why_charge(world, self.battery(), self.settings)

    def saw(self, place: str, now: float) -> None:
        """Note that the robot is in ``place``."""
        self.model.saw(place, now)

    def arrived(self, place: str, now: float, metres: float | None = None) -> None:
        """Note that the robot has come to ``place``, over a path of so many metres.

        What the drive took is learned if nothing came between the decision and the arrival.
        """
        leg, self._leg = self._leg, None
        if leg is not None and leg.place == place and leg.from_place in self.model.graph.legs:
            neighbours = self.model.graph.legs[leg.from_place]
            if place in neighbours:
                straight = self.model.straight(leg.from_place, place)
                seconds = now - leg.time
                self.experience.leg_times.observe(leg.from_place, place, seconds, straight, metres)
        self.model.saw(place, now)

    def disturbed(self) -> None:
        """Note that the present drive is no example of how long a leg takes."""
        self._leg = None

    def charged(self) -> None:
        """Note that the robot has been charged."""
        self.experience.sent_to_charge = ''
        self._leg = None

    def send_to_charge(self, why: str) -> None:
        """Have the robot charge before anything else."""
        self.experience.sent_to_charge = why

    def route_round(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places of another way between two neighbours; empty when there is none."""
        try:
            return self.model.graph.without_leg(start, goal).route(start, goal)
        except (GraphError, KeyError):
            return ()

    def request(self, place: str) -> str:
        """Send the robot to a place before the policy decides again; empty: home, to charge.

        Returns:
            What will be done.

        Raises:
            ValueError: There is no such place.
        """
        world = self.model.world
        if world is None:
            raise ValueError('the map is not known yet')
        if not place:
            here = replace(world, place=self.model.place or world.place)
            within = stations_within_reach(here, self.settings.recharge_rooms)
            if not within:
                raise ValueError('no charging place can be reached')
            place = min(within, key=lambda station: within[station])
        check_place(place, world)
        if place == self.model.place and self._leg is None:
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
