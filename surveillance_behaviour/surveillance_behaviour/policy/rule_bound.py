"""The least longest wait that any robot can have that obeys the rules.

The rules hold the robot to URGENT places while there are any within reach, and to corridors else.
`simple_bound` holds on every map: nobody is faster than the shortest closed tour, and a place that
may be entered only when it is URGENT waits for the threshold and the leg to it. It need not be
reachable.

`rule_bound` is exhaustive, for small maps. It asks whether a robot that obeys can go on for ever
with no wait from visit to visit above a limit. A depth-first search answers that: a state (place,
and how long ago each place was visited) from which a wait must exceed the limit is dead, and one
that comes back to itself goes on for ever. Bisection over the limit gives the bound. The search
grows exponentially with the map; it ends after a number of states, with nothing proven.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from surveillance_behaviour.policy.graph import PatrolGraph
from surveillance_behaviour.policy.rollout import RuleMap

STATES = 300_000
"""How many states the search may visit in all; about 0.1 ms each."""
FIRST_WAITS = 2.0
"""How long a place may wait for its first visit, in limits or thresholds."""


def simple_bound(graph: PatrolGraph, threshold: float, ranks: Sequence[int] | None = None) -> float:
    """Return a wait from visit to visit that no robot can go below, seconds; see `rule_bound`."""
    rules = RuleMap(graph, threshold, ranks or default_ranks(graph), 0)
    return max(graph.tour.bound, rules.least_period)


def default_ranks(graph: PatrolGraph) -> list[int]:
    """Return the ranks of the default rules: places with several ways before those with one."""
    return [1 if len(graph.legs[place]) > 1 else 2 for place in graph.places]


def rule_bound(
    graph: PatrolGraph,
    threshold: float,
    ranks: Sequence[int] | None = None,
    precision: float = 0.01,
    states: int = STATES,
) -> float | None:
    """Return the least longest wait from visit to visit, seconds; None: nothing was proven.

    Args:
        graph: The map.
        threshold: Seconds after which a place is URGENT, which comes before everything.
        ranks: Priority of each place while it is not URGENT, less comes first; default: see
            `default_ranks`.
        precision: Of the result, as a part of it.
        states: How many states may be visited in all.
    """
    kinds = list(ranks or default_ranks(graph))
    low, high = simple_bound(graph, threshold, kinds), 4.0 * max(graph.tour.length, threshold)
    left = [states]
    limit = low * (1.0 + precision / 2.0)
    while high - low > precision * low / 2.0:
        feasible = _goes_on(graph, threshold, kinds, limit, left)
        if feasible is None:
            return None
        low, high = (low, limit) if feasible else (limit, high)
        limit = (low + high) / 2.0
    return high


def _goes_on(
    graph: PatrolGraph, threshold: float, ranks: Sequence[int], limit: float, left: list[int]
) -> bool | None:
    """Whether the robot can go on for ever with no wait above the limit; None: not found out.

    ``left`` holds the number of states that may still be visited.
    It begins in any place, with all places visited just now; the wait before the first visit of a
    place after that may be several times as long, so that the start does not count.
    """
    index = graph.index
    neighbours = [
        [(index[other], seconds + graph.dwell) for other, seconds in graph.legs[place].items()]
        for place in graph.places
    ]
    distances = graph.distances.tolist()
    count = len(neighbours)
    dead: set[tuple[int, ...]] = set()

    patience = FIRST_WAITS * max(limit, threshold)
    everywhere = (1 << count) - 1

    def key(place: int, ages: Sequence[float], met: int) -> tuple[int, ...]:
        return (place, met, *(round(age * 1000.0) for age in ages))

    def moves(place: int, ages: Sequence[float]) -> list[tuple[int, float]]:
        best = math.inf
        allowed: list[tuple[int, float]] = []
        for other, seconds in neighbours[place]:
            rank = 0 if ages[other] > threshold else ranks[other]
            if rank < best:
                best, allowed = rank, []
            if rank == best:
                allowed.append((other, seconds))
        return sorted(allowed, key=lambda move: -ages[move[0]])

    def after(ages: Sequence[float], met: int, move: tuple[int, float]) -> list[float] | None:
        other, seconds = move
        now = [age + seconds for age in ages]
        limits = [limit if met >> each & 1 else patience for each in range(count)]
        if now[other] > limits[other] + 1e-6:
            return None
        now[other] = 0.0
        away = distances[other]
        late = any(now[each] + away[each] > limits[each] + 1e-6 for each in range(count))
        return None if late else now

    for start in range(count):
        begin = [0.0] * count
        path = [(key(start, begin, 0), begin, 0, moves(start, begin))]
        on_path = {path[0][0]}
        while path:
            state, ages, met, todo = path[-1]
            if not todo:
                dead.add(state)
                on_path.discard(state)
                path.pop()
                continue
            move = todo.pop(0)
            now = after(ages, met, move)
            if now is None:
                continue
            place, seen = move[0], met | 1 << move[0]
            following = key(place, now, seen)
            if following in on_path:
                if seen == everywhere:
                    return True
                continue
            if following in dead:
                continue
            left[0] -= 1
            if left[0] < 0:
                return None
            on_path.add(following)
            path.append((following, now, seen, moves(place, now)))
    return False
