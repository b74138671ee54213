"""Policies and rules: who may be chosen, who is, and how near that comes to the bound."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.battery import BatteryLimits
from patrol_policy.graph import GraphError, PatrolGraph, graph_of_places
from patrol_policy.policies import POLICIES, make_policy
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol, SimulatedBattery
from patrol_policy.tour import shortest_tour, tour_length

from .worlds import graphs, seven_rooms, world


@pytest.mark.parametrize('name', list(POLICIES))
@pytest.mark.parametrize('now', [100.0, 10_000.0])
def test_every_policy_scores_every_candidate(name: str, now: float) -> None:
    policy = make_policy(name)
    scores = policy(world(now=now), ('E', 'R1', 'R2'))
    assert isinstance(scores, Mapping)
    assert set(scores) == {'E', 'R1', 'R2'}
    assert all(math.isfinite(score.value) and score.words for score in scores.values())
    assert all(score.target in seven_rooms().index for score in scores.values())


def test_an_unknown_policy_is_named() -> None:
    with pytest.raises(ValueError, match="unknown policy 'clever', expected one of tour"):
        make_policy('clever')


@pytest.mark.parametrize('policy', ['tour', 'lookahead'])
def test_seven_rooms_wait_no_longer_than_the_shortest_tour(policy: str) -> None:
    graph = seven_rooms()
    patrol = Patrol(graph, Priorities(), policy, 7.0, 'E')
    for _ in patrol.until(3600.0):
        pass
    assert graph.tour.length == pytest.approx(69.65, abs=0.01)
    assert patrol.run.longest <= 1.05 * graph.tour.length


def test_chance_leaves_places_alone_for_long() -> None:
    graph = seven_rooms()
    patrol = Patrol(graph, Priorities(), 'seed', 7.0, 'E', generator=random.Random(3))
    for _ in patrol.until(7200.0):
        pass
    assert patrol.run.longest > 2.0 * graph.tour.length


def test_graphs_that_do_not_fit_together_are_named() -> None:
    with pytest.raises(GraphError, match='A leads to B, which is not a place'):
        PatrolGraph({'A': {'B': 1.0}})
    with pytest.raises(GraphError, match='A leads to B, but B not back'):
        PatrolGraph({'A': {'B': 1.0}, 'B': {}})
    with pytest.raises(GraphError, match='A has no position'):
        graph_of_places({'A': []}, {})
    with pytest.raises(GraphError, match='no way from A to B'):
        PatrolGraph({'A': {}, 'B': {}}).route('A', 'B')


@settings(max_examples=60)
@given(graphs(most=7))
def test_the_tour_of_a_small_map_is_the_shortest(graph: PatrolGraph) -> None:
    first, *others = range(len(graph.places))
    shortest = min(
        tour_length(graph.distances, (first, *order)) for order in itertools.permutations(others)
    )
    assert graph.tour.length == pytest.approx(shortest)
    assert graph.tour.bound == pytest.approx(shortest)
    walked = sum(
        graph.leg_seconds[start][goal] + graph.exploration_seconds
        for start, goal in itertools.pairwise([*graph.walk, graph.walk[0]])
    )
    assert walked == pytest.approx(shortest)
    assert set(graph.walk) == set(graph.places)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_a_tour_through_parts_that_share_one_place_has_each_place_once(seed: int) -> None:
    draw = random.Random(seed)
    legs: dict[str, dict[str, float]] = {'P0': {}}
    for _ in range(5):
        # A ring more, from a place that is there already.
        places = list(legs)
        new = [f'P{len(legs) + number}' for number in range(draw.randint(1, 5))]
        around = [draw.choice(places), *new]
        for one, other in zip(around, [*new, around[0]], strict=True):
            seconds = float(draw.randint(1, 30))
            legs.setdefault(one, {})[other] = legs.setdefault(other, {})[one] = seconds
    graph = PatrolGraph(legs)
    assert sorted(graph.tour.order) == list(range(len(legs)))
    assert graph.tour.length == pytest.approx(tour_length(graph.distances, graph.tour.order))


@settings(max_examples=30)
@given(graphs())
def test_the_shortest_ways_are_the_same_with_and_without_scipy(graph: PatrolGraph) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('patrol_policy.graph.DENSE_UP_TO', 0)
        other = PatrolGraph(graph.leg_seconds, graph.exploration_seconds)
        assert np.allclose(graph.distances, other.distances)
    for start, goal in itertools.product(graph.places, repeat=2):
        way = (start, *graph.route(start, goal))
        seconds = sum(
            graph.leg_seconds[a][b] + graph.exploration_seconds for a, b in itertools.pairwise(way)
        )
        assert seconds == pytest.approx(graph.seconds(start, goal))


@settings(max_examples=10)
@given(st.integers(13, 40), st.integers(0, 10**6))
def test_a_good_tour_lies_between_the_bound_and_a_random_one(count: int, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    distances = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    tour = shortest_tour(distances)
    assert sorted(tour.order) == list(range(count))
    assert tour.length == pytest.approx(tour_length(distances, tour.order))
    assert tour.bound <= tour.length + 1e-9 <= tour_length(distances, tuple(range(count))) + 1e-6
    assert tour.length <= 1.1 * tour.bound


@settings(max_examples=40)
@given(graphs(), st.sampled_from(sorted(POLICIES)), st.integers(0, 200), st.integers(0, 10**6))
def test_no_decision_breaks_the_rules(
    graph: PatrolGraph, policy: str, threshold: int, seed: int
) -> None:
    patrol = Patrol(
        graph,
        Priorities(),
        policy,
        float(threshold),
        graph.places[0],
        generator=random.Random(seed),
    )
    for _ in range(40):
        before = patrol.world()
        urgent = {place for place in before.reachable if before.is_urgent(place)}
        decision = patrol.step()
        assert decision.place in before.reachable
        corridors = {place for place in before.reachable if 'CORRIDOR' in before.classes[place]}
        assert decision.place in (urgent or corridors or set(before.reachable))


@settings(max_examples=30)
@given(graphs(), st.floats(0.01, 0.6), st.sampled_from(['tour', 'seed', 'oldest']))
def test_the_reserve_never_strands(graph: PatrolGraph, draw: float, policy: str) -> None:
    station = graph.places[0]
    far = max(graph.seconds(station, place) for place in graph.places)
    longest_leg = max(
        seconds + graph.exploration_seconds
        for ways in graph.leg_seconds.values()
        for seconds in ways.values()
    )
    limits = BatteryLimits()
    # Nobody can patrol a place that a full battery does not reach.
    if draw * (2.0 * far + 2.0 * longest_leg) > limits.stop_recharge - 2.0 * limits.margin:
        return
    patrol = Patrol(
        graph,
        Priorities(),
        policy,
        30.0,
        station,
        SimulatedBattery(draw=draw),
    )
    for _ in range(100):
        patrol.step()
    assert patrol.run.strandings == 0
