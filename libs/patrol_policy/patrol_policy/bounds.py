"""The least longest wait from visit to visit that any robot can have that obeys the rules.

The rules hold the robot to URGENT places while there are any within reach, and to corridors else.
`simple_bound` holds on every map: nobody is faster than the shortest closed tour, and a place that
may be entered only when it is URGENT waits for the threshold and the leg to it. It need not be
reachable.

`rule_bound` searches through all ways on, on maps whose core has at most `CORE_UP_TO` places (the
core is what is left when dead ends are cut off until there are none): can a robot that obeys go on
for ever with no wait above a limit? A depth-first search answers that. A state is a place, and how
long ago each place was visited. A state is dead when the places that are due cannot all be reached
in time (see `Covers`), or when all that follow from it are dead; one that comes back to itself goes
on for ever. The search begins anywhere, with any past: until a place was visited it may be URGENT
or not. The limit is raised as long as that is proven impossible.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol_policy.graph import PatrolGraph
from patrol_policy.rollout import RuleMap

CORE_UP_TO = 20
"""The largest core of a map that is searched, in places: its table takes 84 MB and 4 s."""
STATES = 100_000
"""How many states the search may visit in all; about 50 microseconds each."""
TICKS = 1000
"""Ticks in a second; ages are whole ticks."""

State = tuple[int, int, tuple[int, ...]]
"""Place, the set of places visited since the search began, and the ticks since each was visited."""


@dataclass(frozen=True)
class RuleBound:
    """What is known of the least longest wait from visit to visit.

    Attributes:
        low: No robot that obeys the rules can have less, seconds.
        high: A robot can go on for ever with this, seconds; inf: no such walk was found.
    """

    low: float
    high: float = math.inf

    def within(self, precision: float) -> bool:
        """Return whether the two differ by less than this part."""
        return self.high <= self.low * (1.0 + precision)


def default_ranks(graph: PatrolGraph) -> list[int]:
    """Return the ranks of the default rules: places with several ways before those with one."""
    return [1 if len(graph.leg_seconds[place]) > 1 else 2 for place in graph.places]


def simple_bound(graph: PatrolGraph, threshold: float, ranks: Sequence[int] | None = None) -> float:
    """Return a wait from visit to visit that no robot can go below, seconds; see `rule_bound`."""
    rules = RuleMap(graph, threshold, ranks or default_ranks(graph), 0)
    return max(graph.tour.bound, rules.least_period)


def rule_bound(
    graph: PatrolGraph,
    threshold: float,
    ranks: Sequence[int] | None = None,
    precision: float = 0.01,
    states: int = STATES,
) -> RuleBound:
    """Return bounds of the least longest wait from visit to visit.

    Args:
        graph: The map.
        threshold: Seconds after which a place is URGENT, which comes before everything.
        ranks: Priority of each place while it is not URGENT, less comes first; default: see
            `default_ranks`.
        precision: The bounds that are looked for differ by this part at most.
        states: How many states may be visited in all.
    """
    low, high = simple_bound(graph, threshold, ranks), math.inf
    covers = covers_of(graph)
    if len(covers.core) > CORE_UP_TO:
        return RuleBound(low)
    search = _Search(RuleMap(graph, threshold, ranks or default_ranks(graph), 0), covers, states)
    step = 0.9 * precision
    while high > low * (1.0 + precision):
        limit = min(low * (1.0 + step), (low + high) / 2.0)
        endless = search.goes_on(limit)
        if endless is None:
            break
        if endless:
            high = limit
        else:
            low, step = limit, 2.0 * step
    return RuleBound(low, high)


class _Search:
    """Asks whether a robot can go on for ever with no wait above a limit.

    Args:
        rules: The map.
        covers: What is due in time there.
        states: How many states may be visited, over all questions.
    """

    def __init__(self, rules: RuleMap, covers: Covers, states: int) -> None:
        self._rules, self._left = rules, states
        self._legs = [
            [(other, round(TICKS * seconds)) for other, seconds in ways.items()]
            for ways in rules.leg_seconds
        ]
        self._threshold = round(TICKS * rules.threshold)
        self._covers = covers

    def goes_on(self, limit: float) -> bool | None:
        """Return whether it can; None: the states did not suffice to find out."""
        longest = round(TICKS * limit) + self._rules.count
        everywhere = (1 << self._rules.count) - 1
        # Whoever goes on for ever comes to the first place.
        begin: State = (0, 1, (0,) * self._rules.count)
        path = [(begin, self._moves(begin))]
        on_path, dead = {begin}, set[State]()
        while path:
            state, todo = path[-1]
            if not todo:
                dead.add(state)
                on_path.discard(state)
                path.pop()
                continue
            place, ticks = todo.pop()
            if state[2][place] + ticks > longest:
                continue
            following = _after(state, place, ticks)
            if following in on_path and following[1] == everywhere:
                return True
            if following in dead or not self._covers.in_time(following, longest):
                continue
            self._left -= 1
            if self._left < 0:
                return None
            on_path.add(following)
            path.append((following, self._moves(following)))
        return False

    def _moves(self, state: State) -> list[tuple[int, int]]:
        """Return the legs that the rules may allow, the place that waited longest last."""
        place, met, ages = state
        ranks = self._rules.ranks
        allowed, least = [], math.inf
        for other, ticks in self._legs[place]:
            urgent = ages[other] > self._threshold
            known = urgent or met >> other & 1
            worst = 0 if urgent else ranks[other]
            allowed.append((worst if known else 0, other, ticks))
            least = min(least, worst)
        moves = [(other, ticks) for best, other, ticks in allowed if best <= least]
        return sorted(moves, key=lambda move: ages[move[0]])


def _after(state: State, place: int, ticks: int) -> State:
    """Return the state after a leg to a place."""
    _, met, ages = state
    now = [age + ticks for age in ages]
    now[place] = 0
    return place, met | 1 << place, tuple(now)


class Covers:
    """How long a robot needs at least to visit a set of places.

    The ways in the core are known exactly, from a table of the shortest way from each place of it
    through each set. What hangs on the core are trees: each leg of theirs that leads to a place of
    the set is driven in both directions, but for those on the way from where the robot is, and on
    the way back from where it ends; of the latter the longest is taken off, so that it stays a
    lower bound.

    Args:
        graph: The map.

    Attributes:
        core: The places of the core, as indices of the graph's.
    """

    def __init__(self, graph: PatrolGraph) -> None:
        ticks = np.maximum(np.floor(TICKS * graph.distances).astype(np.int32) - 1, 0)
        ways = {name: set(graph.leg_seconds[name]) for name in graph.places}
        removed = []
        while ends := [name for name, others in ways.items() if len(others) == 1]:
            end = ends[0]
            (trunk,) = ways.pop(end)
            ways[trunk].discard(end)
            removed.append((graph.index[end], graph.index[trunk]))
        self.core = [graph.index[name] for name in ways]
        count = len(graph.places)
        self._bits = [0] * count
        self._rows = [0] * count
        for row, place in enumerate(self.core):
            self._bits[place], self._rows[place] = 1 << row, row
        # For each place, the way up to the core: the places whose legs towards it are driven.
        self._up: list[tuple[int, ...]] = [()] * count
        self._there, self._back, self._ends = [0] * count, [0] * count, [0] * count
        for place, parent in reversed(removed):
            self._bits[place], self._rows[place] = self._bits[parent], self._rows[parent]
            self._up[place] = (place, *self._up[parent])
            self._there[place] = int(ticks[parent, place])
            self._back[place] = int(ticks[place, parent])
            self._ends[place] = self._ends[parent] + self._back[place]
        if len(self.core) <= CORE_UP_TO:
            self._table = _shortest_covers(ticks[np.ix_(self.core, self.core)])

    def in_time(self, state: State, longest: int) -> bool:
        """Return whether the places that are due before any moment can be visited by then."""
        place, _, ages = state
        table, here = self._table[self._rows[place]], set(self._up[place])
        due, hanging, saved = 0, sum(self._back[leg] for leg in here), 0
        driven: set[int] = set()
        for age, other in sorted(zip(ages, range(len(ages)), strict=True), reverse=True):
            due |= self._bits[other]
            saved = max(saved, self._ends[other])
            for leg in self._up[other]:
                if leg in driven:
                    break
                driven.add(leg)
                hanging += 0 if leg in here else self._there[leg] + self._back[leg]
            if int(table[due]) + hanging - saved > longest - age:
                return False
        return True


@lru_cache(maxsize=1)
def covers_of(graph: PatrolGraph) -> Covers:
    """Return the covers of a map, which serve for all thresholds."""
    return Covers(graph)


def _shortest_covers(ticks: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the ticks of the shortest way from each place through each set, shape (n, 2 ** n).

    Sets are bit masks. Held and Karp's dynamic programme over the size of the set.

    Args:
        ticks: From each place to each other, shape (n, n).
    """
    count = len(ticks)
    sets = np.arange(1 << count)
    sizes = np.array([(sets >> place) & 1 for place in range(count)]).sum(axis=0)
    cover = np.full((count, 1 << count), np.iinfo(np.int32).max, np.int32)
    cover[:, 0] = 0
    for size in range(1, count + 1):
        of_size = np.flatnonzero(sizes == size)
        for first in range(count):
            chosen = of_size[(of_size >> first) & 1 == 1]
            rest = cover[first, chosen ^ (1 << first)]
            for start in range(count):
                way = rest + ticks[start, first]
                cover[start, chosen] = np.minimum(cover[start, chosen], way)
    return cover
