"""What a decision is made from, and the decision itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from surveillance_behaviour.policy.graph import PatrolGraph


@dataclass(frozen=True, eq=False)
class Situation:
    """What the robot knows when it decides.

    Attributes:
        place: Where it is.
        now: Seconds on the mission's clock.
        reachable: The places it can reach from here in one move, as the ontology says.
        classes: The ontology's classes of the places, e.g. ``{'C1': {'CORRIDOR', 'ROOM'}}``.
        visited_at: When each place was visited last, seconds; a place that is missing was never
            visited and counts as visited at ``since``.
        graph: The map.
        since: When the patrol began, seconds.
        threshold: Seconds after which a place is URGENT.
        target: What the last decision was heading for, if that was not reached yet.
        avoided: Places that could not be reached lately.
        rules: The classes of places by priority, for policies that think ahead.
    """

    place: str
    now: float
    reachable: tuple[str, ...]
    classes: Mapping[str, frozenset[str]]
    visited_at: Mapping[str, float]
    graph: PatrolGraph
    since: float = 0.0
    threshold: float = 0.0
    target: str | None = None
    avoided: frozenset[str] = frozenset()
    rules: tuple[str, ...] = ()

    def unvisited(self, place: str) -> float:
        """Seconds since ``place`` was visited."""
        return self.now - self.visited_at.get(place, self.since)

    @cached_property
    def idleness(self) -> NDArray[np.float64]:
        """Seconds since each place of the graph was visited, shape (n,), in the graph's order."""
        return np.array([self.unvisited(place) for place in self.graph.places])


@dataclass(frozen=True)
class Score:
    """What a policy thinks of one candidate.

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
        rule: ``recharge``, or the class of places whose turn it was, or ``any``.
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
