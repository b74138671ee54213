"""Policies and rules: who may be chosen, who is, and how near that comes to the bound."""

from __future__ import annotations

import itertools
import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_behaviour.policy.battery import BatteryLimits, DrawEstimate, reserve
from surveillance_behaviour.policy.graph import GraphError, PatrolGraph, graph_of_places
from surveillance_behaviour.policy.policies import POLICIES, make_policy
from surveillance_behaviour.policy.rules import (
    NowhereToGoError,
    Rules,
    decide,
    decide_to_charge,
    tour_warning,
)
from surveillance_behaviour.policy.simulation import Battery, Patrol
from surveillance_behaviour.policy.situation import Situation
from surveillance_behaviour.policy.tour import shortest_tour, tour_length

from .scripted_world import POSITIONS, SEVEN_ROOMS


def seven_rooms(dwell: float = 2.0) -> PatrolGraph:
    neighbours = {
        room: [
            other
            for other, theirs in SEVEN_ROOMS.items()
            if other != room and set(theirs) & set(doors)
        ]
        for room, doors in SEVEN_ROOMS.items()
    }
    return graph_of_places(neighbours, POSITIONS, 1.0, dwell)


def situation(**changes: object) -> Situation:
    values: dict[str, object] = {
        'place': 'C1',
        'now': 100.0,
        'reachable': ('C2', 'E', 'R1', 'R2'),
        'classes': {
            'C2': frozenset({'CORRIDOR', 'ROOM'}),
            'E': frozenset({'CORRIDOR', 'ROOM'}),
            'R1': frozenset({'ROOM', 'URGENT'}),
            'R2': frozenset({'ROOM', 'URGENT'}),
        },
        'visited_at': {'C1': 100.0, 'C2': 80.0, 'E': 90.0, 'R1': 20.0, 'R2': 10.0, 'R3': 50.0},
        'graph': seven_rooms(),
        'threshold': 60.0,
    }
    return Situation(**{**values, **changes})  # type: ignore[arg-type]


def chosen(rules: Rules, policy: str, **changes: object) -> tuple[str, str]:
    decision = decide(situation(**changes), rules, make_policy(policy), policy)
    return decision.place, decision.rule


def test_urgent_places_come_before_corridors() -> None:
    assert chosen(Rules(), 'oldest') == ('R2', 'URGENT')


def test_corridors_come_before_rooms() -> None:
    calm = {place: frozenset({'ROOM'}) for place in ('R1', 'R2')}
    calm |= {place: frozenset({'CORRIDOR', 'ROOM'}) for place in ('C2', 'E')}
    assert chosen(Rules(), 'oldest', classes=calm) == ('C2', 'CORRIDOR')


def test_the_rules_are_data() -> None:
    assert chosen(Rules(('CORRIDOR', 'URGENT')), 'oldest') == ('C2', 'CORRIDOR')
    assert chosen(Rules(()), 'oldest') == ('R2', 'any')
    assert chosen(Rules(('KITCHEN',)), 'oldest') == ('R2', 'any')


@pytest.mark.parametrize(
    ('names', 'problem'),
    [(('URGENT', 'URGENT'), 'URGENT stands twice'), (('9 to 5',), "'9 to 5' is not the name")],
)
def test_bad_rules_are_named(names: tuple[str, ...], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Rules(names)


def test_among_equals_the_longest_unvisited_then_the_first_name() -> None:
    always = dict.fromkeys(('E', 'R1', 'R2', 'C2'), 1.0)
    assert chosen(Rules(()), 'oldest', visited_at=always) == ('C2', 'any')


def test_avoided_places_wait_until_nothing_else_is_left() -> None:
    assert chosen(Rules(), 'oldest', avoided=frozenset({'R2'})) == ('R1', 'URGENT')
    assert chosen(Rules(), 'oldest', avoided=frozenset({'R1', 'R2'}))[1] == 'CORRIDOR'
    everything = frozenset({'R1', 'R2', 'C2', 'E'})
    assert chosen(Rules(), 'oldest', avoided=everything) == ('R2', 'URGENT')


def test_nothing_within_reach_is_an_error_that_says_so() -> None:
    with pytest.raises(NowhereToGoError, match='nothing can be reached from C1'):
        chosen(Rules(), 'oldest', reachable=())


def test_a_decision_carries_its_reason_in_words_and_numbers() -> None:
    decision = decide(situation(), Rules(), make_policy('oldest'), 'oldest')
    assert decision.reason == (
        'R2 of 2 URGENT places within reach, by oldest (unvisited 90.0 s, threshold 60 s): '
        'it went unvisited for 90.0 s'
    )
    assert decision.scores == {'R1': 80.0, 'R2': 90.0}


def test_charging_goes_to_the_nearest_station() -> None:
    decision = decide_to_charge(situation(), ['R4', 'E'], 'the battery is at 12 %')
    assert (decision.place, decision.rule) == ('E', 'recharge')
    assert decision.reason.startswith('the battery is at 12 %: E is the nearest charging place')
    with pytest.raises(NowhereToGoError, match='no charging place'):
        decide_to_charge(situation(), ['GARAGE'], 'low')


@pytest.mark.parametrize('name', list(POLICIES))
@pytest.mark.parametrize('now', [100.0, 10_000.0])
def test_every_policy_scores_every_candidate(name: str, now: float) -> None:
    policy = make_policy(name, random.Random(1))
    scores = policy(situation(now=now), ('E', 'R1', 'R2'))
    assert set(scores) == {'E', 'R1', 'R2'}
    assert all(math.isfinite(score.value) and score.words for score in scores.values())
    assert all(score.target in seven_rooms().index for score in scores.values())


def test_an_unknown_policy_is_named() -> None:
    with pytest.raises(ValueError, match="unknown policy 'clever', expected one of tour"):
        make_policy('clever')


@pytest.mark.parametrize('policy', ['tour', 'lookahead', 'cycle'])
def test_seven_rooms_wait_no_longer_than_the_shortest_tour(policy: str) -> None:
    graph = seven_rooms()
    patrol = Patrol(graph, Rules(), make_policy(policy), policy, 7.0, 'E')
    for _ in patrol.until(7200.0):
        pass
    assert graph.tour.length == pytest.approx(69.65, abs=0.01)
    assert patrol.run.longest <= 1.05 * graph.tour.length


def test_chance_leaves_places_alone_for_long() -> None:
    graph = seven_rooms()
    patrol = Patrol(graph, Rules(), make_policy('seed', random.Random(3)), 'seed', 7.0, 'E')
    for _ in patrol.until(7200.0):
        pass
    assert patrol.run.longest > 2.0 * graph.tour.length


def test_a_threshold_below_the_tour_is_warned_of() -> None:
    assert 'urgency_threshold is 60 s, but the shortest tour of all places takes 69.6 s' in (
        tour_warning(69.648, 60.0)
    )
    assert tour_warning(69.648, 70.0) == ''


def test_graphs_that_do_not_fit_together_are_named() -> None:
    with pytest.raises(GraphError, match='A leads to B, which is not a place'):
        PatrolGraph({'A': {'B': 1.0}})
    with pytest.raises(GraphError, match='A leads to B, but B not back'):
        PatrolGraph({'A': {'B': 1.0}, 'B': {}})
    with pytest.raises(GraphError, match='A has no position'):
        graph_of_places({'A': []}, {})
    with pytest.raises(GraphError, match='no way from A to B'):
        PatrolGraph({'A': {}, 'B': {}}).route('A', 'B')


@st.composite
def graphs(draw: st.DrawFn, most: int = 8) -> PatrolGraph:
    """Connected graphs: a random tree with some edges more."""
    count = draw(st.integers(2, most))
    legs: dict[str, dict[str, float]] = {f'P{number}': {} for number in range(count)}
    extra = draw(st.lists(st.tuples(st.integers(0, count - 1), st.integers(0, count - 1))))
    parents = [(child, draw(st.integers(0, child - 1))) for child in range(1, count)]
    for first, second in [*parents, *extra]:
        if first != second:
            seconds = float(draw(st.integers(1, 30)))
            legs[f'P{first}'][f'P{second}'] = legs[f'P{second}'][f'P{first}'] = seconds
    return PatrolGraph(legs, float(draw(st.integers(0, 5))))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(graphs(most=7))
def test_the_tour_of_a_small_map_is_the_shortest(graph: PatrolGraph) -> None:
    first, *others = range(len(graph.places))
    shortest = min(
        tour_length(graph.distances, (first, *order)) for order in itertools.permutations(others)
    )
    assert graph.tour.length == pytest.approx(shortest)
    assert graph.tour.bound == pytest.approx(shortest)
    walked = sum(
        graph.legs[start][goal] + graph.dwell
        for start, goal in itertools.pairwise([*graph.walk, graph.walk[0]])
    )
    assert walked == pytest.approx(shortest)
    assert set(graph.walk) == set(graph.places)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(graphs())
def test_the_shortest_ways_are_the_same_with_and_without_scipy(graph: PatrolGraph) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('surveillance_behaviour.policy.graph.DENSE_UP_TO', 0)
        other = PatrolGraph(graph.legs, graph.dwell)
        assert np.allclose(graph.distances, other.distances)
    for start, goal in itertools.product(graph.places, repeat=2):
        way = (start, *graph.route(start, goal))
        seconds = sum(graph.legs[a][b] + graph.dwell for a, b in itertools.pairwise(way))
        assert seconds == pytest.approx(graph.seconds(start, goal))


@settings(max_examples=10, deadline=None, derandomize=True)
@given(st.integers(13, 40), st.integers(0, 10**6))
def test_a_good_tour_lies_between_the_bound_and_a_random_one(count: int, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    distances = np.linalg.norm(points[:, None] - points[None, :], axis=2)
    tour = shortest_tour(distances)
    assert sorted(tour.order) == list(range(count))
    assert tour.length == pytest.approx(tour_length(distances, tour.order))
    assert tour.bound <= tour.length + 1e-9 <= tour_length(distances, tuple(range(count))) + 1e-6
    assert tour.length <= 1.1 * tour.bound


@settings(max_examples=40, deadline=None, derandomize=True)
@given(graphs(), st.sampled_from(sorted(POLICIES)), st.integers(0, 200), st.integers(0, 10**6))
def test_no_decision_breaks_the_rules(
    graph: PatrolGraph, policy: str, threshold: int, seed: int
) -> None:
    patrol = Patrol(
        graph,
        Rules(),
        make_policy(policy, random.Random(seed)),
        policy,
        float(threshold),
        graph.places[0],
    )
    for _ in range(40):
        before = patrol.situation()
        decision = patrol.step()
        assert decision.place in before.reachable
        urgent = {place for place in before.reachable if 'URGENT' in before.classes[place]}
        corridors = {place for place in before.reachable if 'CORRIDOR' in before.classes[place]}
        assert decision.place in (urgent or corridors or set(before.reachable))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(graphs(), st.floats(0.01, 0.6), st.sampled_from(['tour', 'seed', 'oldest']))
def test_the_reserve_never_strands(graph: PatrolGraph, draw: float, policy: str) -> None:
    station = graph.places[0]
    far = max(graph.seconds(station, place) for place in graph.places)
    longest_leg = max(
        seconds + graph.dwell for ways in graph.legs.values() for seconds in ways.values()
    )
    limits = BatteryLimits()
    # Nobody can patrol a place that a full battery does not reach.
    if draw * (2.0 * far + 2.0 * longest_leg) > limits.stop_recharge - 2.0 * limits.margin:
        return
    patrol = Patrol(
        graph,
        Rules(),
        make_policy(policy, random.Random(1)),
        policy,
        30.0,
        station,
        Battery(draw=draw),
    )
    for _ in range(150):
        patrol.step()
    assert patrol.run.strandings == 0


def test_the_reserve_covers_the_worst_leg_and_the_way_home() -> None:
    graph = seven_rooms()
    level, words = reserve(graph, 'C2', ['R3', 'R4', 'E'], ['E'], 1.0, BatteryLimits(10, 90, 5))
    away = graph.seconds('C2', 'R4') + graph.seconds('R4', 'E')
    assert level == pytest.approx(away + 5.0)
    assert words == f'R4 and home from there takes {away:.1f} s at 1 % a second, with 5 % to spare'


def test_the_reserve_leaves_a_charged_robot_room_to_go() -> None:
    graph = seven_rooms()
    level, _ = reserve(graph, 'C2', ['R4'], ['E'], 50.0, BatteryLimits(10, 90, 5))
    assert level == 85.0
    assert reserve(graph, 'C2', [], ['E'], 50.0, BatteryLimits(10, 90, 5))[0] == 10


def test_the_draw_is_learnt_from_the_worst_leg() -> None:
    draw = DrawEstimate()
    for time, level in [(0.0, 100.0), (10.0, 97.0), (20.0, 92.0), (30.0, 90.0)]:
        draw.observe(time, level)
    assert draw.percent_per_second == pytest.approx(0.6)
    draw.observe(40.0, 100.0)
    draw.observe(50.0, 99.0)
    assert draw.percent_per_second == pytest.approx(0.6)
    assert DrawEstimate(fixed=0.1).percent_per_second == 0.1


def test_battery_limits_out_of_order_are_named() -> None:
    with pytest.raises(ValueError, match=r'expected 0 <= battery_require_recharge < .* got 95 and'):
        BatteryLimits(95.0, 90.0)
