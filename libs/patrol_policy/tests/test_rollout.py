"""Rounds within the rules, and following them ahead: what is planned is what comes."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.cycle_search import CycleSearch
from patrol_policy.graph import PatrolGraph
from patrol_policy.lower_bounds import default_table, rule_bound
from patrol_policy.plan import Planner
from patrol_policy.rollout import lookahead, oldest, roll_out
from patrol_policy.rule_graph import PatrolState, RuleGraph
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol

from .test_plan import chain, grid
from .worlds import default_ranks, graphs, rule_graph_of, seven_rooms


def rules_of(graph: PatrolGraph, threshold: float) -> RuleGraph:
    return rule_graph_of(graph, threshold, default_ranks(graph), 0)


def searched(rules: RuleGraph, work: float) -> CycleSearch:
    tour = rules.graph.tour
    search = CycleSearch(rules, [[tour.order]], tour.length)
    search.improve(work)
    return search


def at_start(graph: PatrolGraph) -> PatrolState:
    count = len(graph.places)
    return PatrolState(0, 0.0, [0.0] * count, [False] * count)


def test_the_shortest_lawful_round_of_a_grid_is_found() -> None:
    graph = grid(3, 3)
    search = searched(rules_of(graph, 0.1 * graph.tour.length), 200_000.0)
    assert not search.best.breaches
    assert search.best.length == pytest.approx(1.2 * graph.tour.length)


def test_a_round_is_filled_where_the_robot_would_wait_for_a_room() -> None:
    legs = {'A': {'B': 8.0, 'C': 17.0, 'D': 22.0, 'E': 17.0}, 'B': {'A': 8.0, 'D': 19.0}}
    legs |= {'C': {'A': 17.0}, 'D': {'A': 22.0, 'B': 19.0}, 'E': {'A': 17.0}}
    graph = PatrolGraph(legs)
    rules = rules_of(graph, graph.tour.length)
    search = searched(rules, 100_000.0)
    assert not search.best.breaches
    # Hardly longer than it must be.
    assert rules.least_period <= search.best.length <= 1.05 * rules.least_period
    patrol = Patrol(graph, Priorities(), 'tour', graph.tour.length, 'A')
    for _ in patrol.until(20.0 * graph.tour.length):
        pass
    assert patrol.run.settled <= search.best.length + 1e-6


@settings(max_examples=30)
@given(graphs(), st.floats(0.1, 2.0))
def test_a_round_visits_every_place_in_its_length(graph: PatrolGraph, factor: float) -> None:
    rules = rules_of(graph, factor * graph.tour.length)
    search = searched(rules, 5_000.0)
    assert set(search.best.targets) == set(range(len(graph.places)))
    assert search.best.length == pytest.approx(rules.length(search.best.targets))
    assert search.best.length >= graph.tour.length - 1e-9


@pytest.mark.parametrize('kind', ['oldest', 'lookahead'])
@pytest.mark.parametrize('factor', [0.1, 0.75, 1.25])
def test_a_policy_followed_ahead_does_what_it_does_in_a_patrol(kind: str, factor: float) -> None:
    graph = seven_rooms()
    threshold = factor * graph.tour.length
    patrol = Patrol(graph, Priorities(), kind, threshold, graph.places[0])
    for _ in patrol.until(60.0 * graph.tour.length):
        pass
    rules = rules_of(graph, threshold)
    choose = oldest if kind == 'oldest' else lookahead
    found = roll_out(rules, choose, at_start(graph), 60.0 * graph.tour.length)
    assert found.settled == pytest.approx(patrol.run.settled)
    assert found.first == pytest.approx(patrol.run.longest)


@pytest.mark.parametrize('factor', [0.1, 1.25])
def test_a_plan_keeps_its_bound(factor: float) -> None:
    graph = chain(6)
    threshold = factor * graph.tour.length
    patrol = Patrol(graph, Priorities(), 'tour', threshold, graph.places[0])
    planned = Planner(patrol.world()).longest
    for _ in patrol.until(12.0 * max(graph.tour.length, threshold)):
        pass
    assert patrol.run.settled <= planned + 1e-6


@settings(max_examples=15)
@given(graphs(), st.floats(0.05, 3.0), st.sampled_from(['tour', 'oldest', 'lookahead']))
def test_nobody_goes_below_the_bound_that_knows_the_rules(
    graph: PatrolGraph, factor: float, policy: str
) -> None:
    threshold = factor * graph.tour.length
    patrol = Patrol(graph, Priorities(), policy, threshold, graph.places[0])
    for _ in patrol.until(12.0 * max(graph.tour.length, threshold)):
        pass
    assert (
        patrol.run.settled
        >= rule_bound(graph, default_table(graph, threshold), states=3_000).low - 0.01
    )


def test_a_large_map_has_the_same_ways_as_a_small_one(monkeypatch: pytest.MonkeyPatch) -> None:
    # From A to B the leg is longer than the way round by C.
    legs = {'A': {'B': 30.0, 'C': 5.0}, 'B': {'A': 30.0, 'C': 5.0}, 'C': {'A': 5.0, 'B': 5.0}}
    legs |= {'D': {'C': 7.0}}
    legs['C']['D'] = 7.0
    small = rules_of(PatrolGraph(legs, 2.0), 100.0)
    expected = [[small.away[a][b] for b in range(4)] for a in range(4)]
    monkeypatch.setattr('patrol_policy.graph.ALL_PAIRS_UP_TO', 0)
    large = rules_of(PatrolGraph(legs, 2.0), 100.0)
    assert [[large.away[a][b] for b in range(4)] for a in range(4)] == expected
    assert expected[0][:2] == [0.0, 32.0]


def test_the_laps_of_a_walk_each_visit_every_place() -> None:
    rules = rules_of(chain(9), 100.0)
    there_and_back = [*range(9), *range(7, 0, -1)]
    found = list(rules.cycles_in(there_and_back * 3))
    assert found
    assert all(set(lap) == set(range(9)) for lap in found)
    three = rules_of(chain(3), 100.0)
    assert list(three.cycles_in([0, 1, 2, 1, 0])) == [(0, 1, 2), (2, 1, 0)]


def test_a_walk_ahead_ends_at_its_horizon_and_with_a_wait_that_is_too_long() -> None:
    graph = PatrolGraph(
        {f'P{n}': {f'P{(n + 1) % 6}': 10.0, f'P{n - 1 if n else 5}': 10.0} for n in range(6)}
    )
    rules, start = rules_of(graph, 100.0), at_start(graph)
    round_ = roll_out(rules, oldest, start, 1000.0)
    assert round_.back is not None
    assert [len(roll_out(rules, oldest, start, ahead).walk) for ahead in (30.0, 35.0)] == [3, 4]
    # A wait as long as allowed is not too long, a longer one ends the walk.
    assert roll_out(rules, oldest, start, 1000.0, stop=round_.settled).back == round_.back
    assert len(roll_out(rules, oldest, start, 1000.0, stop=0.0).walk) < len(round_.walk)


def test_the_wait_of_a_place_with_more_time_counts_less() -> None:
    graph = chain(3)
    for own in ({0: 20.0}, {2: 20.0}):
        # All others have 80 s more.
        rules = rule_graph_of(graph, 100.0, default_ranks(graph), 0, own)
        search = CycleSearch(rules, [[(0, 1, 2, 1)]], graph.tour.length)
        found = search.judged((0, 1, 2, 1))
        assert found.length == pytest.approx(4 * 7.0) == found.wait
