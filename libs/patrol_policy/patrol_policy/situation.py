"""What a decision is made from, and the decision itself."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol_policy.battery import Energy
from patrol_policy.fleet.assignment import FleetOutlook, PartitionCell
from patrol_policy.fleet.docks import DockSlot
from patrol_policy.graph import PatrolGraph
from patrol_policy.hours import ALWAYS_OPEN, Openings
from patrol_policy.rule_table import ALERT, JOINED, URGENT, Priorities, RuleTable

ROUNDS_AHEAD = 3.0
"""A plan knows the hours for so many times what entering each place once takes."""


@dataclass(eq=False)
class PolicyMemory:
    """What policies keep from one choice to the next.

    Attributes:
        generator: Where the random policies draw from.
        planner: What a policy that plans ahead has planned; see `patrol_policy.plan`.
        energy: What the charge comes to on the maps of the last decision.
    """

    generator: random.Random = field(default_factory=random.Random)
    planner: Any = None
    energy: dict[Any, Energy] = field(default_factory=dict)
    _part: tuple[Any, PatrolGraph] | None = field(default=None, init=False, repr=False)
    _table: tuple[Any, Any, RuleTable] | None = field(default=None, init=False, repr=False)
    _asked: PolicyMemory | None = field(default=None, init=False, repr=False)

    def without(self, graph: PatrolGraph, gone: frozenset[str], place: str) -> PatrolGraph:
        """Return the part of a map that is left without some places; the same one again and again.

        The place of the robot is never taken away.
        """
        key = (graph, gone - {place})
        if self._part is None or self._part[0] != key or place not in self._part[1].index:
            rest = graph.restricted(set(graph.places) - key[1])
            self._part = (key, rest.connected(place))
        return self._part[1]

    def table_of(self, situation: Situation, order: tuple[str, ...]) -> RuleTable:
        """Return the rules of a situation as a table; the same one as long as nothing changes."""
        places, optional = situation.graph.places, situation.openings.optional
        key = (order, places, situation.threshold, situation.own_thresholds, optional)
        kept = self._table
        # Whether the classes are alike takes as long to find out as the table.
        if kept is None or kept[0] is not situation.classes or kept[1] != key:
            table = RuleTable.of(order, places, situation.classes, situation.threshold_of)
            kept = self._table = (situation.classes, key, table)
        return kept[2]

    def for_a_question(self) -> PolicyMemory:
        """Return a copy to answer a question with, which changes nothing of the next choice.

        Before the first choice, what one question has planned serves the next questions.
        """
        planner = self.planner or (self._asked and self._asked.planner)
        planner = planner and planner.for_a_question()
        self._asked = PolicyMemory(copy(self.generator), planner, self.energy.copy())
        return self._asked


@dataclass(frozen=True, eq=False)
class Situation:
    """What the robot knows of its surroundings when it decides.

    Attributes:
        place: Where it is.
        now: Seconds on the mission's clock.
        reachable: The places it can reach from here in one move, as the ontology says.
        classes: The ontology's classes of the places, e.g. ``{'C1': {'CORRIDOR', 'ROOM'}}``;
            whether a place is URGENT stands in ``said``.
        said: Whether the ontology holds a place URGENT; of a place that is missing it said nothing,
            and its wait decides.
        visited_at: When each place was visited last, seconds; a place that is missing was never
            visited and counts as visited at ``since``.
        graph: The map, with the time that each leg is expected to take.
        time_spread: Standard deviation of what legs take, as a part of what is expected.
        since: When the patrol began, seconds.
        threshold: Seconds after which the ontology counts a place as URGENT.
        target: What the last decision was heading for, if that was not reached yet.
        own_thresholds: The same for places that differ, seconds; inf: the place never is URGENT.
        level: Of the charge, percent; 100 while it is not known.
        avoided: Places that could not be reached lately.
        priorities: The classes of places by falling priority; `decide` puts its settings' here.
        requested: Where an operator has sent the robot; empty: nowhere.
        openings: What the hours of the places come to now.
        contradiction: Which facts of the ontology clash, as a sentence; empty: none do.
        memory: What the policies remember.
        fleet: What is known of the robots that share the patrol; None: this one is alone.
    """

    place: str
    now: float
    reachable: tuple[str, ...]
    classes: Mapping[str, frozenset[str]]
    visited_at: Mapping[str, float]
    graph: PatrolGraph
    time_spread: float = 0.0
    since: float = 0.0
    threshold: float = 0.0
    target: str | None = None
    own_thresholds: Mapping[str, float] = field(default_factory=dict)
    level: float = 100.0
    avoided: frozenset[str] = frozenset()
    said: Mapping[str, bool] = field(default_factory=dict)
    priorities: Priorities = field(default_factory=lambda: Priorities(()))
    requested: str = ''
    openings: Openings = ALWAYS_OPEN
    contradiction: str = ''
    memory: PolicyMemory = field(default_factory=PolicyMemory)
    fleet: FleetOutlook | None = None

    def idleness_of(self, place: str) -> float:
        """Return the seconds since ``place`` was visited."""
        return self.now - self.visited_at.get(place, self.since)

    def idleness_in_words(self, place: str) -> str:
        """Return how long ago ``place`` was visited."""
        if place not in self.visited_at:
            return 'not visited yet'
        return f'last visit {self.idleness_of(place):.1f} s ago'

    def threshold_of(self, place: str) -> float:
        """Return the seconds after which a place is URGENT; inf: never by waiting.

        Nobody waits for a place that only may be visited now.
        """
        if place in self.openings.optional:
            return math.inf
        return self.own_thresholds.get(place, self.threshold)

    def said_of(self, place: str) -> bool | None:
        """Return whether the ontology holds a place URGENT; None: it said nothing.

        Where a place only may be visited now, that counts of an ALERT alone.
        """
        word = self.said.get(place)
        if word and place in self.openings.optional and ALERT not in self.classes.get(place, ()):
            word = False
        return word

    @cached_property
    def table(self) -> RuleTable:
        """The rules, for the places of the graph in its order."""
        return self.memory.table_of(self, self.priorities.at(self.now, self.openings.zone))

    def is_urgent(self, place: str) -> bool:
        """Return whether a place of the map is URGENT."""
        index = self.graph.index[place]
        return self.table.time_left(index, self.idleness_of(place), self.said_of(place)) < 0.0

    def is_in(self, place: str, kind: str) -> bool:
        """Return whether a place of the map is of a class, or of all that an entry names."""
        classes = self.classes.get(place, ())
        return all(
            self.is_urgent(place) if name == URGENT else name in classes
            for name in kind.split(JOINED)
        )

    def first_of(self, places: Sequence[str]) -> tuple[str, tuple[str, ...]]:
        """Return the class of the rules whose turn it is, and its members among some places of the
        map, sorted."""
        table, index = self.table, self.graph.index
        due = {}
        for name in places:
            place = index[name]
            due[place] = table.turns_in(place, self.idleness_of(name), self.said_of(name))
        found = table.first(due, 0.0, due)
        rule = table.name_of(table.rank_from(found[0], due[found[0]]))
        return rule, tuple(sorted([self.graph.places[place] for place in found]))

    @property
    def look_ahead(self) -> float:
        """For how many seconds a plan knows when places open and close: about two tours."""
        return ROUNDS_AHEAD * self.graph.cheapest_entries

    def changes(self, until: float) -> frozenset[tuple[str, float]]:
        """Return which places of the map open or close from now on, and when, up to a moment."""
        index, now = self.graph.index, self.now
        return frozenset(
            (place, when)
            for place, stretches in self.openings.windows.items()
            if place in index
            for pair in stretches
            for when in pair
            if now < when <= until
        )

    @cached_property
    def idleness(self) -> NDArray[np.float64]:
        """Seconds since each place of the graph was visited, shape (n,), in the graph's order."""
        return np.array([self.idleness_of(place) for place in self.graph.places])


@dataclass(frozen=True)
class Score:
    """The score that a policy gives one candidate.

    Attributes:
        value: The higher the better.
        target: Where the candidate leads in the end; often itself.
        words: Why, with the numbers, as a clause.
    """

    value: float
    target: str
    words: str


@dataclass(frozen=True)
class Decision:
    """Where to go next, and why.

    Attributes:
        time: Seconds on the mission's clock.
        from_place: Where the robot was.
        place: Where it goes.
        target: Where that leads in the end.
        rule: ``recharge``, ``request``, ``quiet``, ``any``, or the class of places whose turn it
            was.
        policy: The policy that chose among the rule's candidates.
        reason: One sentence with the numbers that decided.
        scores: The policy's value of each candidate.
        stay: How long the robot stays before it decides anew, seconds; 0: it goes.
        cell: What it took upon itself of the places of a fleet; None: nothing.
        slot: Its time at a dock, where a fleet has one for it.
    """

    time: float
    from_place: str
    place: str
    target: str
    rule: str
    policy: str
    reason: str
    scores: Mapping[str, float] = field(default_factory=dict)
    stay: float = 0.0
    cell: PartitionCell | None = None
    slot: DockSlot | None = None
