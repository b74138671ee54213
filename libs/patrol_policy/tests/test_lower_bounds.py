"""Bounds that know the rules, against all walks of a small map."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.graph import PatrolGraph
from patrol_policy.lower_bounds import Covers, RuleBound, default_table, rule_bound, simple_bound

from .test_cycle_search import one_way
from .test_plan import chain
from .worlds import default_ranks, graphs, table_of


def walks(graph: PatrolGraph, most: int) -> Iterator[list[int]]:
    """Yield closed walks through all places that begin at the first one, up to so many steps."""

    def onward(walk: list[int]) -> Iterator[list[int]]:
        if len(walk) > 1 and walk[-1] == 0 and len(set(walk)) == len(graph.places):
            yield walk[1:]
        if len(walk) <= most:
            for other in graph.edges[walk[-1]]:
                yield from onward([*walk, other])

    yield from onward([0])


def lawful_wait(graph: PatrolGraph, walk: list[int], threshold: float, ranks: list[int]) -> float:
    """Return the longest wait of a walk that is gone again and again; inf: the rules forbid it."""
    now, place, longest = 0.0, 0, 0.0
    seen = dict.fromkeys(range(len(graph.places)), -math.inf)
    for lap in range(3):
        longest = 0.0
        for stop in walk:
            ways = graph.edges[place]
            ranked = {o: 0 if now - seen[o] > threshold else ranks[o] for o in ways}
            if lap and ranked[stop] != min(ranked.values()):
                return math.inf
            now += ways[stop]
            longest = max(longest, now - seen[stop])
            seen[stop] = now
            place = stop
    return longest


TRIANGLE_WITH_END = PatrolGraph(
    {
        'A': {'B': 8.0, 'C': 9.0},
        'B': {'A': 8.0, 'C': 7.0, 'D': 5.0},
        'C': {'A': 9.0, 'B': 7.0},
        'D': {'B': 6.0},
    },
    1.0,
)


@pytest.mark.parametrize('factor', [0.3, 0.8, 1.0, 1.3])
@pytest.mark.parametrize('ranks', [None, [1, 1, 2, 3]])
@pytest.mark.parametrize('graph', [TRIANGLE_WITH_END, chain(3)], ids=['triangle', 'chain'])
def test_the_bound_is_the_least_wait_of_all_lawful_walks(
    graph: PatrolGraph, ranks: list[int] | None, factor: float
) -> None:
    threshold = factor * graph.tour.length + 0.37
    if ranks is not None:
        ranks = ranks[: len(graph.places)]
    known = ranks or default_ranks(graph)
    least = min(lawful_wait(graph, walk, threshold, known) for walk in walks(graph, 9))
    table = table_of(known, threshold)
    bound = rule_bound(graph, table)
    assert bound.low <= least + 0.01
    assert bound.low >= simple_bound(graph, table) - 1e-6
    if math.isfinite(least):
        assert bound.high <= least * 1.011 + 0.01
    assert bound.within(0.011)
    assert rule_bound(graph, table, states=0).low <= bound.low


def test_bounds_are_near_each_other_as_far_as_is_asked() -> None:
    assert RuleBound(100.0).high == math.inf
    assert not RuleBound(100.0).within(10.0)
    assert RuleBound(100.0, 101.0).within(0.01)
    assert not RuleBound(100.0, 101.1).within(0.01)
    assert default_table(chain(3), 9.0).base == [2, 1, 2]


@settings(max_examples=60)
@given(graphs(most=6), st.integers(0, 10**6))
def test_what_a_cover_says_cannot_be_visited_in_time_never_can(
    graph: PatrolGraph, seed: int
) -> None:
    draw = random.Random(seed)
    count = len(graph.places)
    covers, distances = Covers(graph), graph.distances
    place = draw.randrange(count)
    ages = tuple(draw.randrange(60_000) if other != place else 0 for other in range(count))
    longest = max(ages) + draw.randrange(40_000)
    # Each place is due so long after its last visit; in the best order all are visited in time.
    others = [other for other in range(count) if other != place]
    feasible = False
    for order in itertools.permutations(others):
        at, now, fits = place, 0.0, True
        for other in order:
            now += distances[at, other]
            fits = fits and 1000.0 * now + ages[other] <= longest
            at = other
        feasible = feasible or fits
    if feasible:
        assert covers.in_time((place, (1 << count) - 1, ages), longest)


def test_a_cover_of_a_ring_or_a_star_is_exact() -> None:
    ring = one_way(3, 5)
    star = PatrolGraph({'M': dict.fromkeys('ABCD', 5.0), **{name: {'M': 5.0} for name in 'ABCD'}})
    for graph in (ring, star):
        count, covers, distances = len(graph.places), Covers(graph), graph.distances
        for place in range(count):
            others = [other for other in range(count) if other != place]
            shortest = min(
                sum(distances[a, b] for a, b in itertools.pairwise([place, *order]))
                for order in itertools.permutations(others)
            )
            # All are due at the same time.
            ages = tuple(0 if other == place else 10_000 for other in range(count))
            state = (place, (1 << count) - 1, ages)
            needed = 10_000 + math.floor(1000.0 * shortest)
            assert covers.in_time(state, needed + 1)
            assert not covers.in_time(state, needed - 3 * count)
    assert covers.core == [graph.index['M']] or len(covers.core) == 1
    assert sorted(Covers(ring).core) == list(range(5))
