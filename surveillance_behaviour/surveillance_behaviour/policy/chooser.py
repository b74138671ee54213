"""Chooses the next place: from what the ontology says, by rules and policy, to a decision."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from surveillance_behaviour.peers.ports import (
    Beliefs,
    Knowledge,
    PeerError,
    Places,
    Point,
    UnknownPlaceError,
)
from surveillance_behaviour.policy.battery import BatteryLimits, DrawEstimate, reserve
from surveillance_behaviour.policy.graph import GraphError, PatrolGraph, graph_of_places
from surveillance_behaviour.policy.policies import DEFAULT_POLICY, make_policy
from surveillance_behaviour.policy.rules import Rules, decide, decide_to_charge, tour_warning
from surveillance_behaviour.policy.situation import Decision, Situation
from surveillance_fsm import Interrupt


@dataclass
class ChoiceSettings:
    """What a choice depends on beside the ontology; may be changed between two choices.

    Attributes:
        rules: Classes of places by priority.
        policy: Name of the policy.
        urgency_threshold: Seconds after which a place is URGENT.
        recharge_rooms: Places with a charging station.
        battery: When to charge.
        exploration_seconds: Seconds spent in each place.
        speed: Metres per second, to tell how long a move takes.
    """

    rules: Rules = field(default_factory=Rules)
    policy: str = DEFAULT_POLICY
    urgency_threshold: float = 7.0
    recharge_rooms: tuple[str, ...] = ('E',)
    battery: BatteryLimits = field(default_factory=BatteryLimits)
    exploration_seconds: float = 2.0
    speed: float = 1.0


class Chooser:
    """Keeps the map in step with the ontology and decides on it.

    Args:
        settings: Shared with whoever changes them.
        knowledge: The ontology.
        places: Where the places are.
        generator: Chance, for the policies that need it.
    """

    def __init__(
        self,
        settings: ChoiceSettings,
        knowledge: Knowledge,
        places: Places,
        generator: random.Random | None = None,
    ) -> None:
        self.settings = settings
        self.draw = DrawEstimate()
        self._knowledge = knowledge
        self._places = places
        self._generator = generator or random.Random()
        self._positions: dict[str, Point] = {}
        self._graph = PatrolGraph({})
        self._all: frozenset[str] = frozenset()
        self._graph_key: object = None
        self._since: float | None = None
        self._target: str | None = None
        self._seen: dict[str, float] = {}

    @property
    def graph(self) -> PatrolGraph:
        """The part of the map that could be reached when it was last looked at."""
        return self._graph

    @property
    def places(self) -> frozenset[str]:
        """All places of the map when it was last looked at, within reach or not."""
        return self._all

    def look(
        self,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str] = frozenset(),
        visits: Mapping[str, float] | None = None,
    ) -> Situation:
        """Asks the ontology and brings the map up to date.

        Args:
            now: Seconds on the mission's clock.
            interrupt: Ends the wait for the ontology.
            avoided: Places that could not be reached lately.
            visits: When the robot visited places; an ontology that does not know is told.

        Raises:
            PeerError: The ontology or the positions cannot be had, or do not fit together.
        """
        if self._since is None or now < self._since:
            self._since = now
            self._seen.clear()
        beliefs = self._knowledge.beliefs(self.settings.rules.classes, now, interrupt, visits)
        graph = self._map_of(beliefs, interrupt)
        for place, seconds in beliefs.visited_at.items():
            # The ontology counts whole seconds.
            if not seconds <= self._seen.get(place, -1.0) < seconds + 1.0:
                self._seen[place] = seconds
        return Situation(
            place=beliefs.place,
            now=now,
            reachable=tuple(place for place in beliefs.reachable if place in graph.index),
            classes=beliefs.classes,
            visited_at={place: self._seen[place] for place in beliefs.visited_at},
            graph=graph,
            since=self._since,
            threshold=self.settings.urgency_threshold,
            target=self._target,
            avoided=avoided,
            rules=self.settings.rules.classes,
        )

    def _map_of(self, beliefs: Beliefs, interrupt: Interrupt) -> PatrolGraph:
        positions = {}
        # A place that went may come back elsewhere.
        self._positions = {p: at for p, at in self._positions.items() if p in beliefs.connections}
        for place in beliefs.connections:
            try:
                positions[place] = self._position(place, interrupt)
            except UnknownPlaceError:
                continue  # It was removed from the map a moment ago; the ontology will follow.
        self._all = frozenset(positions)
        if beliefs.place not in positions:
            raise PeerError('ontology', f'the robot is in {beliefs.place}, which is not on the map')
        dwell, speed = self.settings.exploration_seconds, self.settings.speed
        key = (beliefs.place in self._graph.index, beliefs.connections, positions, dwell, speed)
        if key != self._graph_key:
            known = {
                place: [other for other in others if other in positions]
                for place, others in beliefs.connections.items()
                if place in positions
            }
            try:
                whole = graph_of_places(known, positions, speed, dwell)
                self._graph = whole.connected(beliefs.place)
            except GraphError as error:
                raise PeerError('ontology', str(error)) from None
            self._graph_key = (True, *key[1:])
        return self._graph

    def _position(self, place: str, interrupt: Interrupt) -> Point:
        if place not in self._positions:
            self._positions[place] = self._places.position(place, interrupt)
        return self._positions[place]

    def saw(self, place: str, now: float) -> None:
        """The robot was in ``place``; finer than the ontology's whole seconds."""
        self._seen[place] = now
        if place == self._target:
            self._target = None

    def choose(self, situation: Situation) -> Decision:
        """The next place by rules and policy.

        Raises:
            NowhereToGoError: Nothing can be reached.
        """
        name = self.settings.policy
        decision = decide(situation, self.settings.rules, make_policy(name, self._generator), name)
        self._target = decision.target
        return decision

    def choose_station(self, situation: Situation, why: str) -> Decision:
        """The charging place to go to.

        Raises:
            NowhereToGoError: None can be reached.
        """
        return decide_to_charge(situation, self.settings.recharge_rooms, why)

    def required_level(
        self, place: str, reachable: Sequence[str] | None = None
    ) -> tuple[float, str]:
        """Below which charge the robot must go charging, and why; percent.

        Args:
            place: Where it is.
            reachable: Where it could go instead; default: all neighbours.
        """
        limits = self.settings.battery
        if place not in self._graph.index:
            return limits.require_recharge, 'the place is not on the map'
        others = self._graph.legs[place] if reachable is None else reachable
        return reserve(
            self._graph,
            place,
            others,
            self.settings.recharge_rooms,
            self.draw.percent_per_second,
            limits,
        )

    def warning(self) -> str:
        """What is wrong with the threshold for this map; empty when nothing is."""
        return tour_warning(self._graph.tour.length, self.settings.urgency_threshold)
