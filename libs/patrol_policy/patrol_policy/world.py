"""What a decision is made from, and the decision itself."""

from __future__ import annotations

import random
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol_policy.graph import PatrolGraph


@dataclass(eq=False)
class PolicyMemory:
    """What policies keep from one choice to the next.

    Attributes:
        generator: Where the random policies draw from.
        plan: What a policy that plans ahead has planned; see `patrol_policy.plan`.
        passes: Where on a tour the robot is, by the tour's steps.
    """

    generator: random.Random = field(default_factory=random.Random)
    plan: Any = None
    passes: dict[tuple[str, ...], int] = field(default_factory=dict)
    _asked: PolicyMemory | None = field(default=None, init=False, repr=False)

    def for_a_question(self) -> PolicyMemory:
        """Return a copy to answer a question with, which changes nothing of the next choice.

        Before the first choice, what one question has planned serves the next questions.
        """
        plan = self.plan or (self._asked and self._asked.plan)
        plan = plan and plan.for_a_question()
        self._asked = PolicyMemory(copy(self.generator), plan, self.passes.copy())
        return self._asked


@dataclass(frozen=True, eq=False)
class World:
    """What the robot knows of its surroundings when it decides.

    Attributes:
        place: Where it is.
        now: Seconds on the mission's clock.
        reachable: The places it can reach from here in one move, as the ontology says.
        classes: The ontology's classes of the places, e.g. ``{'C1': {'CORRIDOR', 'ROOM'}}``.
        visited_at: When each place was visited last, seconds; a place that is missing was never
            visited and counts as visited at ``since``.
        graph: The map, with the time that each leg is expected to take.
        time_spread: Standard deviation of what legs take, as a part of what is expected.
        since: When the patrol began, seconds.
        threshold: Seconds after which the ontology counts a place as URGENT.
        target: What the last decision was heading for, if that was not reached yet.
        avoided: Places that could not be reached lately.
        rules: The classes of places by priority that the ontology was asked for.
        requested: Where an operator has sent the robot; empty: nowhere.
        contradiction: Which facts of the ontology clash, as a sentence; empty: none do.
        memory: What the policies remember.
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
    avoided: frozenset[str] = frozenset()
    rules: tuple[str, ...] = ()
    requested: str = ''
    contradiction: str = ''
    memory: PolicyMemory = field(default_factory=PolicyMemory)

    def unvisited(self, place: str) -> float:
        """Return the seconds since ``place`` was visited."""
        return self.now - self.visited_at.get(place, self.since)

    def wait_in_words(self, place: str) -> str:
        """Return how long ago ``place`` was visited."""
        if place not in self.visited_at:
            return 'not visited yet'
        return f'last visit {self.unvisited(place):.1f} s ago'

    @cached_property
    def idleness(self) -> NDArray[np.float64]:
        """Seconds since each place of the graph was visited, shape (n,), in the graph's order."""
        return np.array([self.unvisited(place) for place in self.graph.places])


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
        rule: ``recharge``, ``request``, the class of places whose turn it was, or ``any``.
        policy: The policy that chose among the rule's candidates.
        reason: One sentence with the numbers that decided.
        scores: The policy's value of each candidate.
    """

    time: float
    from_place: str
    place: str
    target: str
    rule: str
    policy: str
    reason: str
    scores: Mapping[str, float] = field(default_factory=dict)
