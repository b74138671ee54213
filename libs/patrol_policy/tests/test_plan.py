"""The plan within the rules: near the bound, and never worse than simple policies."""

from __future__ import annotations

import itertools
import math
import random
from functools import cache

import pytest

from patrol_policy.battery import Battery
from patrol_policy.decision import DecisionSettings, decide
from patrol_policy.graph import PatrolGraph, graph_of_places
from patrol_policy.lower_bounds import RuleBound, default_table, rule_bound, simple_bound
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol
from patrol_policy.situation import PolicyMemory, Situation

from .worlds import seven_rooms, table_of


def grid(width: int, height: int) -> PatrolGraph:
    positions = {f'P{x}{y}': (5.0 * x, 5.0 * y) for x in range(width) for y in range(height)}
    ways = {
        f'P{x}{y}': [
            other
            for other in (f'P{x + 1}{y}', f'P{x - 1}{y}', f'P{x}{y + 1}', f'P{x}{y - 1}')
            if other in positions
        ]
        for x in range(width)
        for y in range(height)
    }
    return graph_of_places(ways, positions, 1.0, 2.0)


def chain(count: int) -> PatrolGraph:
    legs: dict[str, dict[str, float]] = {f'P{number}': {} for number in range(count)}
    for number in range(count - 1):
        legs[f'P{number}'][f'P{number + 1}'] = legs[f'P{number + 1}'][f'P{number}'] = 5.0
    return PatrolGraph(legs, 2.0)


def ring(count: int, draw: random.Random, noise: float) -> PatrolGraph:
    legs: dict[str, dict[str, float]] = {f'P{number}': {} for number in range(count)}
    for number in range(count):
        here, after = f'P{number}', f'P{(number + 1) % count}'
        legs[here][after] = 10.0 * draw.uniform(1.0 - noise, 1.0 + noise)
        legs[after][here] = 10.0 * draw.uniform(1.0 - noise, 1.0 + noise)
    return PatrolGraph(legs)


def of_pairs(pairs: dict[tuple[int, int], float]) -> PatrolGraph:
    legs: dict[str, dict[str, float]] = {}
    for (first, second), seconds in pairs.items():
        legs.setdefault(f'P{first}', {})[f'P{second}'] = seconds
        legs.setdefault(f'P{second}', {})[f'P{first}'] = seconds
    return PatrolGraph(legs, 2.0)


EQUAL_LEGS = of_pairs(
    dict.fromkeys([(0, 2), (0, 3), (0, 4), (1, 4), (2, 3), (2, 5), (3, 4)], 5.0 / 0.6)
)
"""Waits come out at the threshold itself, where rounding used to say what is URGENT."""

LONG_LEG = of_pairs(
    {(0, 1): 30.0, (0, 2): 8.0, (0, 4): 4.0, (1, 3): 4.0, (1, 4): 4.0, (3, 4): 30.0}
)
"""The best round takes legs that are longer than a way round, which the rules do not allow then."""


def settled(graph: PatrolGraph, policy: str, threshold: float) -> float:
    patrol = Patrol(graph, Priorities(), policy, threshold, graph.places[0])
    for _ in patrol.until(10.0 * max(graph.tour.length, threshold)):
        pass
    return patrol.run.settled


MAPS = {
    'seven rooms': seven_rooms(),
    'chain': chain(6),
    'grid': grid(3, 3),
    'large grid': grid(5, 5),
    'equal legs': EQUAL_LEGS,
    'long leg': LONG_LEG,
}


FACTORS = (0.1, 0.5, 0.75, 1.0, 2.0)


@cache
def settled_on(name: str, policy: str, factor: float) -> float:
    graph = MAPS[name]
    return settled(graph, policy, factor * graph.tour.length)


@pytest.mark.parametrize(
    ('name', 'factor'),
    [
        *itertools.product([name for name in MAPS if name != 'large grid'], FACTORS),
        ('large grid', 0.5),
        ('large grid', 1.0),
    ],
)
def test_the_plan_is_no_worse_than_simple_policies(name: str, factor: float) -> None:
    best = min(settled_on(name, policy, factor) for policy in ('oldest', 'lookahead'))
    assert settled_on(name, 'tour', factor) <= 1.01 * best


def test_a_move_takes_its_leg_even_where_a_way_round_is_shorter() -> None:
    graph = of_pairs({(0, 1): 5.0, (1, 2): 5.0, (0, 2): 50.0})
    assert graph.seconds('P0', 'P2') == 14.0
    assert (graph.move('P0', 'P2'), graph.move('P0', 'P1'), graph.move('P0', 'P0')) == (52, 7, 0)
    patrol = Patrol(graph, Priorities(), 'oldest', 7.0, 'P0')
    patrol.visited_at['P2'] = -1.0
    assert patrol.step().place == 'P2'
    assert patrol.now == 52.0


@pytest.mark.parametrize('name', ['seven rooms', 'chain'])
def test_the_first_waits_are_no_worse_than_those_of_simple_policies(name: str) -> None:
    graph = MAPS[name]
    longest = {}
    for policy in ('tour', 'oldest', 'lookahead'):
        patrol = Patrol(graph, Priorities(), policy, 0.75 * graph.tour.length, graph.places[0])
        for _ in patrol.until(5.0 * graph.tour.length):
            pass
        longest[policy] = patrol.run.longest
    assert longest['tour'] <= 1.01 * min(longest.values())


@pytest.mark.parametrize(
    ('name', 'factor', 'least'),
    [
        ('seven rooms', 0.5, 1.0),
        ('seven rooms', 1.0, 1.129),
        ('chain', 1.0, 1.2),
        ('chain', 2.0, 2.2),
        ('grid', 0.1, 1.2),
        ('grid', 1.0, 1.0),
        ('equal legs', 1.0, 1.251),
        ('long leg', 0.5, 1.353),
    ],
)
def test_the_plan_comes_within_a_twentieth_of_the_bound_that_knows_the_rules(
    name: str, factor: float, least: float
) -> None:
    graph = MAPS[name]
    threshold = factor * graph.tour.length
    bound = rule_bound(graph, default_table(graph, threshold))
    assert bound.low <= (least + 1e-3) * graph.tour.length
    assert bound.high == pytest.approx(least * graph.tour.length, rel=0.01)
    assert settled_on(name, 'tour', factor) <= 1.05 * bound.low


def test_little_more_than_the_round_is_accepted_for_shorter_first_waits() -> None:
    graph = of_pairs({(0, 1): 17.9, (0, 2): 15.4, (0, 3): 19.5, (1, 4): 17.0, (2, 3): 32.4})
    threshold = 2.0 * graph.tour.length
    bound = rule_bound(graph, default_table(graph, threshold)).low
    assert settled(graph, 'tour', threshold) <= 1.03 * bound


def test_the_way_into_the_round_that_is_tried_first_leaves_short_first_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a map that takes all the time there is for its round."""
    monkeypatch.setattr('patrol_policy.plan.FIRST_WORK', 1.0)
    monkeypatch.setattr('patrol_policy.plan.SIMPLE', ())
    longer = []
    for seed, factor in itertools.product(range(12), (0.5, 1.0, 2.0)):
        draw = random.Random(seed)
        graph = PatrolGraph(ring(12, draw, 0.6).leg_seconds)
        tour = graph.tour.length
        patrol = Patrol(graph, Priorities(()), 'tour', factor * tour, 'P0')
        patrol.visited_at = {place: -draw.uniform(0.0, tour) for place in graph.places}
        patrol.visited_at['P0'] = 0.0
        shortest = math.inf
        order = [f'P{number}' for number in range(12)]
        for way, first in itertools.product((order, order[::-1]), range(12)):
            now, at, seen = 0.0, 'P0', patrol.visited_at.copy()
            longest = 0.0
            for stop in [*way[first:], *way[:first]]:
                for step in graph.route(at, stop):
                    now += graph.leg_seconds[at][step]
                    longest, at = max(longest, now - seen[step]), step
                    seen[step] = now
            shortest = min(shortest, longest)
        for _ in patrol.until(2.0 * tour):
            pass
        longer.append(patrol.run.longest / shortest)
    assert sum(longer) / len(longer) < 1.075


@pytest.mark.parametrize('seed', [2, 3])
def test_leg_times_that_are_learned_do_not_turn_the_round(seed: int) -> None:
    draw = random.Random(seed)
    patrol = Patrol(ring(8, draw, 0.0), Priorities(), 'tour', 7.0, 'P0')
    for _ in range(32):
        patrol.graph = ring(8, draw, 0.2)
        patrol.step()
    assert patrol.run.longest <= 1.2 * 80.0


DRIVEN = {
    ('E', 'C1'): 12.1, ('E', 'C2'): 13.6, ('C1', 'E'): 12.2, ('C1', 'R1'): 7.3,
    ('C1', 'R2'): 14.5, ('C1', 'C2'): 16.7, ('R1', 'C1'): 8.3, ('R2', 'C1'): 15.1,
    ('C2', 'C1'): 16.1, ('C2', 'E'): 13.5, ('C2', 'R3'): 3.6, ('C2', 'R4'): 13.9,
    ('R3', 'C2'): 5.1, ('R4', 'C2'): 13.5,
}  # fmt: skip
"""Legs that a simulated robot drove in the seven rooms, seconds; they differ by direction."""


@pytest.mark.parametrize('share', [0.5, 0.6, 1.3])
def test_a_long_wait_of_the_first_lap_is_no_bound_for_ever(share: float) -> None:
    """The robot learns on its first lap that legs take other times than it was told."""
    known = {leg: share * seconds for leg, seconds in DRIVEN.items()}
    patrol = Patrol(of_legs(known), Priorities(), 'tour', 240.0, station='E')
    knowing = Patrol(of_legs(DRIVEN), Priorities(), 'tour', 240.0, station='E')
    knowing.step()
    bounds = []
    for _ in range(30):
        here = patrol.place
        there = patrol.step().place
        known[here, there] = DRIVEN[here, there]
        patrol.graph = of_legs(known)
        bounds.append(max(patrol.planner.settled_waits()))
    assert max(bounds) <= 1.05 * max(knowing.planner.settled_waits())


def of_legs(legs: dict[tuple[str, str], float]) -> PatrolGraph:
    ways: dict[str, dict[str, float]] = {}
    for (place, other), seconds in legs.items():
        ways.setdefault(place, {})[other] = seconds
    return PatrolGraph(ways, 2.0)


def test_places_that_the_ontology_calls_urgent_at_the_start_are_visited_first() -> None:
    graph = seven_rooms()
    memory, visited_at = PolicyMemory(), {'E': 0.0}
    place, now = 'E', 0.0
    while now < graph.tour.length + 5.0:
        reachable = tuple(sorted(graph.leg_seconds[place]))
        kinds = {
            name: {'ROOM', *(['CORRIDOR'] if len(graph.leg_seconds[name]) > 1 else [])}
            for name in graph.places
        }
        decision = decide(
            Situation(
                place=place,
                now=now,
                reachable=reachable,
                classes={name: frozenset(kind) for name, kind in kinds.items()},
                visited_at=dict(visited_at),
                graph=graph,
                threshold=240.0,
                said={name: name not in visited_at for name in graph.places},
                memory=memory,
            ),
            Battery(),
            DecisionSettings(),
        )
        now += graph.seconds(place, decision.place)
        place = decision.place
        visited_at[place] = now
    assert set(visited_at) == set(graph.places)


def test_a_map_that_is_too_large_has_no_exhaustive_bound() -> None:
    graph = grid(5, 5)
    table = default_table(graph, 100.0)
    assert rule_bound(graph, table) == RuleBound(simple_bound(graph, table))


def test_the_simple_bound_knows_the_rules_that_it_is_given() -> None:
    graph = chain(4)
    # Corridors all: the shortest tour.
    assert simple_bound(graph, table_of([1, 1, 1, 1], 100.0)) == graph.tour.length == 42.0
    # The ends are rooms, which are entered when they are urgent only.
    assert simple_bound(graph, default_table(graph, 100.0)) == pytest.approx(107.0, abs=0.1)
    assert simple_bound(graph, table_of([2, 1, 1, 2], 100.0)) == simple_bound(
        graph, default_table(graph, 100.0)
    )


def test_costs_may_differ_by_direction() -> None:
    legs = {
        'A': {'B': 1.0, 'C': 9.0},
        'B': {'A': 9.0, 'C': 1.0},
        'C': {'B': 9.0, 'A': 1.0},
    }
    graph = PatrolGraph(legs)
    assert graph.tour.length == 3.0
    assert graph.tour.order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    assert settled(graph, 'tour', 0.5) == pytest.approx(3.0)


def town(count: int, seed: int) -> PatrolGraph:
    """Return places at random, each with a way to the nearest one before it and some more."""
    draw = random.Random(seed)
    at = [(draw.uniform(0.0, 60.0), draw.uniform(0.0, 60.0)) for _ in range(count)]
    legs: dict[str, dict[str, float]] = {f'P{number:02}': {} for number in range(count)}
    for number in range(1, count):
        nearest = sorted(range(number), key=lambda other: math.dist(at[number], at[other]))
        for other in nearest[: draw.choice((1, 1, 2))]:
            seconds = math.dist(at[number], at[other])
            legs[f'P{number:02}'][f'P{other:02}'] = legs[f'P{other:02}'][f'P{number:02}'] = seconds
    return PatrolGraph(legs, 2.0)


@pytest.mark.parametrize('seed', [5, 22])
def test_the_plan_of_a_large_map_is_near_the_bound(seed: int) -> None:
    graph = town(50, seed)
    threshold = 2.0 * graph.tour.length
    patrol = Patrol(graph, Priorities(), 'tour', threshold, 'P00')
    for _ in patrol.until(10.0 * threshold):
        pass
    assert patrol.run.settled <= 1.02 * simple_bound(graph, default_table(graph, threshold))
