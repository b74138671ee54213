"""Tours and their bounds: exact on small maps, local optima on larger ones, by all ways alike."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest
from numpy.typing import NDArray

from patrol_policy.graph import PatrolGraph, graph_of_places
from patrol_policy.tour import Tour, shortest_tour, tour_length

Matrix = NDArray[np.float64]


def scattered(count: int, seed: int) -> Matrix:
    """Return the distances of points at random, shape (n, n)."""
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    return np.asarray(np.linalg.norm(points[:, None] - points[None, :], axis=2))


def blown_by_wind(count: int, seed: int) -> Matrix:
    """Return distances that are longer against a wind; the triangle inequality holds."""
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    ways = points[None, :] - points[:, None]
    along = np.linalg.norm(ways, axis=2) + 0.4 * (ways[:, :, 0] * points[None, :, 1] > 0.0)
    closest: Matrix = np.array(along)
    for middle in range(count):
        closest = np.minimum(closest, closest[:, middle, None] + closest[middle])
    np.fill_diagonal(closest, 0.0)
    return closest


def kicked(monkeypatch: pytest.MonkeyPatch, distances: Matrix, times: int) -> Tour:
    monkeypatch.setattr('patrol_policy.tour.MOST_KICKS', times)
    return shortest_tour(distances)


@pytest.mark.parametrize(('count', 'seed'), [(13, 1), (20, 2), (33, 3), (34, 4), (60, 5)])
def test_no_exchange_of_two_legs_shortens_a_good_tour(
    count: int, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    distances = scattered(count, seed)
    tour = kicked(monkeypatch, distances, 0)
    order = tour.order
    assert sorted(order) == list(range(count))
    for first, last in itertools.combinations(range(count), 2):
        a, b = order[first], order[(first + 1) % count]
        c, d = order[last], order[(last + 1) % count]
        near = np.argsort(distances[a])[1:13], np.argsort(distances[b])[1:13]
        if c in near[0] or d in near[1]:
            gain = distances[a, b] + distances[c, d] - distances[a, c] - distances[b, d]
            assert gain <= 1e-8


def test_a_tour_gets_no_longer_with_more_tries_and_soon_is_the_shortest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for seed in range(4):
        distances = scattered(13, seed)
        lengths = [kicked(monkeypatch, distances, times).length for times in range(0, 60, 3)]
        assert all(after <= before + 1e-9 for before, after in itertools.pairwise(lengths))
        with monkeypatch.context() as patch:
            patch.setattr('patrol_policy.tour.EXACT_UP_TO', 13)
            shortest = shortest_tour(distances)
        assert shortest.exact
        assert lengths[-1] == pytest.approx(shortest.length)
        bound = kicked(monkeypatch, distances, 0).bound
        assert 0.98 * shortest.length <= bound <= shortest.length + 1e-9
    distances = scattered(60, 9)
    lengths = [kicked(monkeypatch, distances, times).length for times in range(0, 400, 20)]
    assert all(after <= before + 1e-9 for before, after in itertools.pairwise(lengths))
    assert lengths[-1] < 0.97 * lengths[0]


def test_the_bound_of_a_large_map_is_near_its_tour() -> None:
    for seed in range(3):
        tour = shortest_tour(scattered(40, seed))
        assert tour.find_bound is not None
        assert 0.97 * tour.length <= tour.bound <= tour.length


def test_a_tour_is_taken_in_its_shorter_direction() -> None:
    turned = 0
    for seed in range(6):
        distances = blown_by_wind(14, seed)
        tour = shortest_tour(distances)
        there = tour_length(distances, tour.order)
        back = tour_length(distances, tour.order[::-1])
        assert tour.length == pytest.approx(there)
        assert there <= back
        turned += there < back - 1e-9
        assert tour.bound <= tour.length
    assert turned


def test_a_tour_is_exact_where_its_bound_is_as_long() -> None:
    assert Tour((0, 1), 10.0).exact
    assert Tour((0, 1), 10.0, lambda: 10.0).exact
    assert Tour((0, 1), 10.0, lambda: 12.0).bound == 10.0
    assert not Tour((0, 1), 10.0, lambda: 9.9).exact
    assert Tour((), 0.0, lambda: 0.0).exact


def hall(width: int, height: int, seed: int) -> PatrolGraph:
    """Return a grid without some of its ways, one block as a rule, with points at random."""
    draw = random.Random(seed)
    points = {
        f'P{x:02}{y:02}': (10.0 * x + draw.uniform(-3, 3), 10.0 * y + draw.uniform(-3, 3))
        for x in range(width)
        for y in range(height)
    }
    ways: dict[str, list[str]] = {name: [] for name in points}
    for x, y in itertools.product(range(width), range(height)):
        for other in (f'P{x + 1:02}{y:02}', f'P{x:02}{y + 1:02}'):
            edge = x in (0, width - 1) or y in (0, height - 1)
            if other in points and (edge or draw.random() < 0.8):
                ways[f'P{x:02}{y:02}'].append(other)
                ways[other].append(f'P{x:02}{y:02}')
    return graph_of_places(ways, points, 1.0, 2.0)


@pytest.mark.parametrize('reach', [6, 120])
def test_a_block_for_which_not_all_distances_are_kept_has_a_tour_as_good(
    reach: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = hall(7, 6, reach)
    usual = graph.tour
    monkeypatch.setattr('patrol_policy.tour.DENSE_BLOCK_UP_TO', 20)
    monkeypatch.setattr('patrol_policy.tour.LOCAL_REACH', reach)
    tour = PatrolGraph(graph.leg_seconds, graph.exploration_seconds).tour
    assert sorted(tour.order) == list(range(42))
    assert tour.length == pytest.approx(tour_length(graph.distances, tour.order))
    assert usual.length <= tour.length + 1e-6
    assert tour.length <= (1.12 if reach > 6 else 1.4) * usual.length
    # The bound is the shortest tree through all places.
    assert tour.bound <= usual.length
    assert tour.bound >= 0.5 * tour.length


def test_a_block_of_twelve_places_is_exact_and_one_of_thirteen_has_a_bound() -> None:
    for count in (2, 3, 12, 13):
        legs: dict[str, dict[str, float]] = {f'P{number:02}': {} for number in range(count)}
        for number in range(count):
            other = f'P{(number + 1) % count:02}'
            legs[f'P{number:02}'][other] = legs[other][f'P{number:02}'] = 5.0
        ring = PatrolGraph(legs)
        assert ring.tour.length == pytest.approx(5.0 * count)
        assert (ring.tour.find_bound is None) == (count <= 12)
        assert ring.tour.bound == pytest.approx(5.0 * count)
        if count == 12:
            # A way hangs on it: the map is larger than that, its blocks are not.
            legs['P00']['X'] = legs.setdefault('X', {}).setdefault('P00', 7.0)
            hung = PatrolGraph(legs)
            assert hung.tour.find_bound is None
            assert hung.tour.length == pytest.approx(74.0)


@pytest.mark.parametrize('seed', range(3))
def test_a_map_is_the_same_whether_all_distances_are_kept_or_not(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = hall(4, 3, seed)
    assert small.has_all_pairs
    monkeypatch.setattr('patrol_policy.graph.ALL_PAIRS_UP_TO', 5)
    monkeypatch.setattr('patrol_policy.graph.TREES_KEPT', 2)
    large = PatrolGraph(small.leg_seconds, small.exploration_seconds)
    assert not large.has_all_pairs
    for row in range(12):
        assert large.row(row) == pytest.approx(small.row(row))
    for start, goal in itertools.permutations(small.places, 2):
        assert large.route(start, goal) == small.route(start, goal)
        assert large.seconds(start, goal) == pytest.approx(small.seconds(start, goal))
    assert large.route('P0000', 'P0000') == ()
    assert math.isinf(PatrolGraph({'A': {}, 'B': {}}).seconds('A', 'B'))
