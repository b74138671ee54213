"""Follows a way of patrolling ahead in thought, within the rules, and tells how long places wait.

A `RuleMap` is the map as the rules see it: at each place the robot may only go to neighbours of
the first class in the list of rules that has a member there, and a place is URGENT once it went
unvisited for longer than the threshold. A guide says which neighbour is taken; `roll_out` moves a
`State` with it until the state comes back, which proves the longest wait for ever, or until a
horizon.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surveillance_behaviour.policy.graph import PatrolGraph
from surveillance_behaviour.policy.world import World

URGENT = 'URGENT'
"""The class whose members change by waiting; all others are taken to stay as they are."""
NEVER = 9
"""A rank behind that of every place."""
NEAR = 8
"""How many nearest places of each place are known."""
SLICE = 100
"""After so many moves that are followed ahead, whoever waits for them may do something else."""
HALF_OPEN = 1e-3
"""Seconds by which a wait must be longer than the threshold, so that rounding does not decide."""


class RuleMap:
    """A map with its rules, as lists that are fast to read. Places are indices of the graph's.

    Args:
        graph: The map.
        threshold: Seconds after which a place is URGENT.
        ranks: For each place, the position of its best class in the rules, URGENT left aside.
        urgent: The position of URGENT in the rules; `NEVER` when it is not among them.

    Attributes:
        legs: For each place, the seconds to each neighbour, dwell included.
        away: Seconds from each place to each other, shape (n, n).
    """

    def __init__(
        self, graph: PatrolGraph, threshold: float, ranks: Sequence[int], urgent: int
    ) -> None:
        self.graph, self.threshold = graph, threshold
        self.ranks, self.urgent = list(ranks), urgent
        self.count = len(graph.places)
        index = graph.index
        self.legs = [
            {index[other]: seconds + graph.dwell for other, seconds in sorted(ways.items())}
            for ways in (graph.legs[place] for place in graph.places)
        ]
        self.away: list[list[float]] = graph.distances.tolist()
        self._hops: dict[int, int] = {}
        self._paths: dict[int, list[int]] = {}

    @cached_property
    def gates(self) -> list[int]:
        """For each place that is entered only when URGENT, where from; -1 for all others."""
        gates = []
        for place, ways in enumerate(self.legs):
            held = bool(ways) and all(self._held(place, other) for other in ways)
            gates.append(min(ways, key=lambda o: self.legs[o][place]) if held else -1)
        return gates

    def _held(self, place: int, gate: int) -> bool:
        """Whether a neighbour of the gate comes before the place as long as that is not URGENT."""
        rank = self.ranks[place]
        return self.urgent < rank and any(self.ranks[other] < rank for other in self.legs[gate])

    @cached_property
    def least_period(self) -> float:
        """Seconds that some place waits from visit to visit whatever the robot does.

        A place that may be entered only when it is URGENT waits for the threshold and the leg to
        it. 0: there is none.
        """
        held = [(gate, place) for place, gate in enumerate(self.gates) if gate >= 0]
        legs = [self.legs[gate][place] for gate, place in held]
        return self.threshold + max(legs) + HALF_OPEN if legs else 0.0

    @cached_property
    def least_round(self) -> float:
        """Seconds that no lawful round is known to fall below."""
        tour = self.graph.tour
        return max(self.least_period, tour.length if tour.find_bound is None else 0.0)

    @cached_property
    def near(self) -> list[list[int]]:
        """The places that are near each place, there and back, at most `NEAR`."""
        both = self.graph.distances + self.graph.distances.T
        np.fill_diagonal(both, np.inf)
        count = min(NEAR, len(both) - 1)
        if count < 1:
            return [[] for _ in both]
        near: list[list[int]] = np.argpartition(both, count - 1, axis=1)[:, :count].tolist()
        return near

    @cached_property
    def mean_leg(self) -> float:
        """Seconds of the mean leg."""
        legs = [seconds for ways in self.legs for seconds in ways.values()]
        return sum(legs) / max(1, len(legs))

    def length(self, targets: Sequence[int]) -> float:
        """Return the seconds that a closed round over the targets takes."""
        away = self.away
        return sum(away[a][b] for a, b in zip(targets, (*targets[1:], targets[0]), strict=True))

    def hop(self, place: int, target: int) -> int:
        """Return the first place on the shortest way to a target."""
        key = place * self.count + target
        found = self._hops.get(key)
        if found is None:
            ways, away = self.legs[place], self.away
            found = min(ways, key=lambda other: ways[other] + away[other][target])
            self._hops[key] = found
        return found

    def path(self, place: int, target: int) -> list[int]:
        """Return the places on the shortest way to a target, without the first."""
        key = place * self.count + target
        found = self._paths.get(key)
        if found is None:
            found = self._paths[key] = []
            while place != target:
                place = self.hop(place, target)
                found.append(place)
        return found

    def allowed(self, state: State) -> list[int]:
        """Return the neighbours that the rules allow; empty: there are none at all."""
        seen, ranks, urgent = state.seen, self.ranks, self.urgent
        limit = state.now - self.threshold
        best, found = NEVER + 1, []
        ways: Iterable[int] = self.legs[state.place]
        if state.avoided:
            ways = [other for other in ways if other not in state.avoided] or ways
        for other in ways:
            rank = ranks[other]
            if rank > urgent and seen[other] < limit:
                rank = urgent
            if rank < best:
                best, found = rank, [other]
            elif rank == best:
                found.append(other)
        return found


def rule_map(world: World) -> RuleMap:
    """Return the map of a world with its rules."""
    rules = world.rules
    ranks = []
    for place in world.graph.places:
        classes = world.classes.get(place, frozenset()) - {URGENT}
        positions = [rank for rank, name in enumerate(rules) if name in classes]
        ranks.append(min(positions, default=len(rules)))
    urgent = rules.index(URGENT) if URGENT in rules else NEVER
    return RuleMap(world.graph, world.threshold, ranks, urgent)


@dataclass
class State:
    """Where a patrol stands.

    Attributes:
        place: Where the robot is.
        now: Seconds.
        seen: When each place was visited last, seconds.
        met: Whether the robot came to each place since the patrol began.
        avoided: Places that could not be reached lately: they count only when no other is open.
    """

    place: int
    now: float
    seen: list[float]
    met: list[bool]
    avoided: frozenset[int] = frozenset()

    def copy(self) -> State:
        """Return a copy to follow ahead, in which every place can be reached."""
        return State(self.place, self.now, self.seen.copy(), self.met.copy())

    def enter(self, place: int, seconds: float) -> float:
        """Move to a place in so many seconds, and return how long it went unvisited."""
        self.now += seconds
        wait = self.now - self.seen[place]
        self.place, self.seen[place] = place, self.now
        return wait


class Guide(Protocol):
    """Says where a robot goes next."""

    position: int
    """What a guide knows beside the state; with an equal state and position it goes on equally."""

    def next(self, state: State) -> int:
        """Return a neighbour that the rules allow; the place itself when there is none."""


@dataclass(frozen=True, order=True)
class Outcome:
    """What following a guide comes to; less is better.

    Attributes:
        settled: The longest wait from visit to visit, seconds.
        first: The longest wait, that before a place's first visit included, seconds.
        steps: Places entered in thought.
    """

    settled: float
    first: float
    steps: int = 0

    def grade(self, bound: float, accepted: float) -> tuple[int, int, float]:
        """Return what to compare by, less is better, in whole percents of the bound.

        Waits from visit to visit come again and again, so they count first, as far as they are
        longer than what is accepted. Then the first waits do, which come once.
        """
        lasting = max(0, round(100.0 * (self.settled - accepted) / bound))
        return lasting, round(100.0 * self.first / bound), self.settled


def roll_out(
    rules: RuleMap, guide: Guide, state: State, horizon: float, stop: float = math.inf
) -> Generator[int, None, Outcome]:
    """Follow a guide until the state comes back, the horizon, or a wait longer than ``stop``.

    Args:
        rules: The map.
        guide: Says where to go; its position changes.
        state: Where to begin; it is not changed.
        horizon: Seconds at most.
        stop: A wait from visit to visit that is too long, seconds.

    Yields:
        How many places were entered in thought since the last time, every `SLICE` of them.

    Returns:
        The `Outcome`.
    """
    at = state.copy()
    seen, met, legs = at.seen, at.met, rules.legs
    end = at.now + horizon
    settled = first = 0.0
    steps = 0
    anchor = min(range(rules.count), key=lambda place: len(legs[place]))
    states: set[tuple[float, ...]] = set()
    while at.now < end and settled <= stop:
        place = guide.next(at)
        if place == at.place:
            break
        wait = at.enter(place, legs[at.place][place])
        steps += 1
        if steps % SLICE == 0:
            yield SLICE
        if not met[place]:
            met[place] = True
            first = max(first, wait)
        elif wait > settled:
            settled = wait
        if place == anchor:
            key = (guide.position, *(round(at.now - last, 3) for last in seen))
            if key in states:
                break
            states.add(key)
    else:
        settled = max(settled, at.now - min(seen))
    yield steps % SLICE
    return Outcome(settled, max(first, settled), steps)


class Oldest:
    """Goes to the allowed neighbour that went unvisited longest."""

    position = 0

    def __init__(self, rules: RuleMap) -> None:
        self._rules = rules

    def next(self, state: State) -> int:
        """Return the neighbour; see `Guide`."""
        allowed = self._rules.allowed(state)
        return min(allowed, key=lambda place: (state.seen[place], place), default=state.place)


class Lookahead:
    """Goes towards wherever (time unvisited - time to get there) is highest."""

    position = 0

    def __init__(self, rules: RuleMap) -> None:
        self._rules = rules
        self._away: NDArray[np.float64] = rules.graph.distances

    def next(self, state: State) -> int:
        """Return the neighbour; see `Guide`."""
        allowed = self._rules.allowed(state)
        if len(allowed) < 2:
            return allowed[0] if allowed else state.place
        idle = state.now - np.array(state.seen)
        idle[state.place] = -np.inf
        legs = self._rules.legs[state.place]
        worth = {
            place: round(float((idle - self._away[place]).max()) - legs[place], 6)
            for place in allowed
        }
        return max(allowed, key=lambda place: (worth[place], -state.seen[place], -place))
