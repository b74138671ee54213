"""The map as the rules see it, and patrols on it that are simulated ahead.

At each place the robot may only go to neighbours of the first class in the list of rules that has a
member there, and a place is URGENT once it went unvisited for longer than the threshold
(`RuleMap`). `roll_out` moves a `State` by a choice function until the state comes back, which
proves the longest wait for ever, or until a horizon (a rollout, as in Bertsekas, "Rollout
algorithms for combinatorial optimization", 1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from patrol_policy.graph import PatrolGraph
from patrol_policy.world import World

URGENT = 'URGENT'
"""The class whose members change by waiting; all others are taken to stay as they are."""
NEVER = 9
"""A rank behind that of every place."""
NEAR = 8
"""How many nearest places of each place are known."""
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
        legs: For each place, the seconds to each neighbour, exploring included.
        away: Seconds from each place to each other, shape (n, n). A neighbour is entered by the leg
            to it: where a way round by another place is shorter, the rules may not allow that.
        overdue: A place that went unvisited for longer is URGENT, seconds.
    """

    def __init__(
        self, graph: PatrolGraph, threshold: float, ranks: Sequence[int], urgent: int
    ) -> None:
        self.graph, self.threshold = graph, threshold
        self.overdue = threshold + HALF_OPEN / 2.0
        self.ranks, self.urgent = list(ranks), urgent
        self.count = len(graph.places)
        index = graph.index
        self.leg_seconds = [
            {
                index[other]: seconds + graph.exploration_seconds
                for other, seconds in sorted(ways.items())
            }
            for ways in (graph.leg_seconds[place] for place in graph.places)
        ]
        self._shortest: list[list[float]] = graph.distances.tolist()
        self._hops: dict[int, int] = {}
        self._paths: dict[int, list[int]] = {}
        self.away = self._seconds_away()

    def _seconds_away(self) -> list[list[float]]:
        shortest = self._shortest
        longer = {
            other
            for place, ways in enumerate(self.leg_seconds)
            for other, seconds in ways.items()
            if seconds > shortest[place][other] + HALF_OPEN
        }
        if not longer:
            return shortest
        away = [row.copy() for row in shortest]
        for target in sorted(longer):
            to_target = self.graph.distances[:, target]
            for place in np.argsort(to_target, kind='stable').tolist():
                if place != target and math.isfinite(to_target[place]):
                    hop = self.hop(place, target)
                    away[place][target] = self.leg_seconds[place][hop] + away[hop][target]
        return away

    @cached_property
    def gates(self) -> list[int]:
        """For each place that is entered only when URGENT, where from; -1 for all others."""
        gates = []
        for place, ways in enumerate(self.leg_seconds):
            held = bool(ways) and all(self._held(place, other) for other in ways)
            gates.append(min(ways, key=lambda o: self.leg_seconds[o][place]) if held else -1)
        return gates

    def _held(self, place: int, gate: int) -> bool:
        """Whether a neighbour of the gate comes before the place as long as that is not URGENT."""
        rank = self.ranks[place]
        return self.urgent < rank and any(
            self.ranks[other] < rank for other in self.leg_seconds[gate]
        )

    @cached_property
    def least_period(self) -> float:
        """Seconds that some place waits from visit to visit whatever the robot does.

        A place that may be entered only when it is URGENT waits for the threshold and the leg to
        it. 0: there is none.
        """
        held = [(gate, place) for place, gate in enumerate(self.gates) if gate >= 0]
        legs = [self.leg_seconds[gate][place] for gate, place in held]
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
        legs = [seconds for ways in self.leg_seconds for seconds in ways.values()]
        return sum(legs) / max(1, len(legs))

    def length(self, targets: Sequence[int]) -> float:
        """Return the seconds that a closed round over the targets takes."""
        away = self.away
        return sum(away[a][b] for a, b in zip(targets, (*targets[1:], targets[0]), strict=True))

    def hop(self, place: int, target: int) -> int:
        """Return the first place on the way to a target."""
        key = place * self.count + target
        found = self._hops.get(key)
        if found is None:
            ways, away = self.leg_seconds[place], self._shortest
            found = target
            if target not in ways:
                found = min(ways, key=lambda other: ways[other] + away[other][target])
            self._hops[key] = found
        return found

    def path(self, place: int, target: int) -> list[int]:
        """Return the places on the way to a target, without the first."""
        key = place * self.count + target
        found = self._paths.get(key)
        if found is None:
            found = self._paths[key] = []
            while place != target:
                place = self.hop(place, target)
                found.append(place)
        return found

    def laps(self, walk: Sequence[int]) -> Iterator[tuple[int, ...]]:
        """Yield the stretches at the end of a walk that visit every place, as targets."""
        end, last, begun = walk[-4 * self.count :], dict[int, int](), -1
        for step, place in enumerate(end):
            last[place] = step
            start = min(last.values())
            if len(last) == self.count and start > begun:
                begun = start
                yield tuple(end[start : step + 1])

    def allowed(self, state: State) -> list[int]:
        """Return the neighbours that the rules allow; empty: there are none at all."""
        seen, ranks, urgent = state.seen, self.ranks, self.urgent
        limit = state.now - self.overdue
        best, found = NEVER + 1, []
        ways: Iterable[int] = self.leg_seconds[state.place]
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
        position: How far the robot is on the course that it follows.
    """

    place: int
    now: float
    seen: list[float]
    met: list[bool]
    avoided: frozenset[int] = frozenset()
    position: int = 0

    def fresh(self) -> State:
        """Return a copy at the beginning of a course, in which every place can be reached."""
        return State(self.place, self.now, self.seen.copy(), self.met.copy())


Choice = Callable[[RuleMap, State], int]
"""Returns a neighbour that the rules allow; the robot's own place when there is none. It may change
the position, and goes on equally from an equal state."""


@dataclass(frozen=True, order=True)
class Outcome:
    """What a way to choose comes to; less is better.

    Attributes:
        settled: The longest wait from visit to visit, seconds.
        first: The longest wait, that before a place's first visit included, seconds.
        walk: The places that were entered.
        back: From where on the walk repeats itself; None: that was not found.
    """

    settled: float
    first: float
    walk: Sequence[int] = field(default=(), compare=False)
    back: int | None = field(default=None, compare=False)

    def repeated_from(self, count: int) -> int | None:
        """Return from where on the walk may be repeated; None: it does not visit all places."""
        last = {place: step for step, place in enumerate(self.walk)}
        if self.back is not None or len(last) < count:
            return self.back
        return min(last.values())


def roll_out(
    rules: RuleMap,
    choose: Choice,
    state: State,
    horizon: float,
    stop: float = math.inf,
) -> Outcome:
    """Simulate a patrol until the state comes back, the horizon, or a wait that is too long.

    Args:
        rules: The map.
        choose: Says where to go.
        state: Where to begin; it is not changed.
        horizon: Seconds at most.
        stop: A wait from visit to visit that is too long, seconds.
    """
    at = state.fresh()
    seen, met, legs = at.seen, at.met, rules.leg_seconds
    end = at.now + horizon
    settled = first = 0.0
    walk: list[int] = []
    anchor = min(range(rules.count), key=lambda place: len(legs[place]))
    states: dict[tuple[float, ...], int] = {}
    back = None
    while at.now < end and settled <= stop:
        place = choose(rules, at)
        if place == at.place:
            break
        at.now += legs[at.place][place]
        wait = at.now - seen[place]
        at.place, seen[place] = place, at.now
        walk.append(place)
        if met[place]:
            settled = max(settled, wait)
        else:
            met[place] = True
            first = max(first, wait)
        if place == anchor:
            key = (at.position, *(round(at.now - last, 3) for last in seen))
            if key in states:
                back = states[key]
                break
            states[key] = len(walk)
    else:
        settled = max(settled, at.now - min(seen))
    return Outcome(settled, max(first, settled), walk, back)


def oldest(rules: RuleMap, state: State) -> int:
    """Choose the allowed neighbour that went unvisited longest."""
    seen = state.seen
    return min(rules.allowed(state), key=lambda place: (seen[place], place), default=state.place)


def lookahead(rules: RuleMap, state: State) -> int:
    """Choose the way towards wherever (time unvisited - time to get there) is highest."""
    allowed = rules.allowed(state)
    if len(allowed) < 2:
        return allowed[0] if allowed else state.place
    idle = state.now - np.array(state.seen)
    idle[state.place] = -np.inf
    legs, away = rules.leg_seconds[state.place], rules.graph.distances
    worth = {p: round(float((idle - away[p]).max()) - legs[p], 6) for p in allowed}
    return max(allowed, key=lambda place: (worth[place], -state.seen[place], -place))
