"""A course target by target, and the parts of a plan, each against what it says it does."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace
from typing import Any

import pytest

from patrol_policy import plan as plan_module
from patrol_policy.battery import WORTH_CHARGING, BatteryLimits, ChargeCurve, Charger, Draw, Energy
from patrol_policy.cycle_search import Cycle
from patrol_policy.graph import PatrolGraph
from patrol_policy.hours import Openings
from patrol_policy.plan import Plan, Planner, planner_of
from patrol_policy.rollout import Outcome
from patrol_policy.rule_graph import PatrolState, RuleGraph
from patrol_policy.rule_table import HALF_OPEN, Priorities
from patrol_policy.situation import PolicyMemory, Situation

from .test_cycle_search import one_way
from .test_plan import chain
from .worlds import default_ranks, rule_graph_of, said_in, seven_rooms

CHAIN = chain(4)
"""P0 to P3 in a row, 7 s each; the ends are entered from P1 and P2, when they are URGENT only."""


def ruled(threshold: float = 50.0, **more: Any) -> RuleGraph:
    return rule_graph_of(CHAIN, threshold, default_ranks(CHAIN), 0, **more)


def state(place: int, *idle: float, position: int = 0, **more: Any) -> PatrolState:
    """Return where a patrol stands at 1000 s; each place was visited so long ago."""
    seen = [1000.0 - each for each in idle]
    return PatrolState(place, 1000.0, seen, [True] * len(seen), position=position, **more)


def chosen(course: Plan, rules: RuleGraph, at: PatrolState) -> tuple[int, int]:
    """Return the stop that a course goes to, and the position of its target."""
    return course.choose(rules, at), at.position


def test_a_course_goes_in_and_then_round_and_round() -> None:
    course = Plan((4, 5, 0, 1, 2), back=2)
    assert [course.after(position) for position in range(5)] == [1, 2, 3, 4, 2]
    assert course.seen_from(0) == course
    assert course.seen_from(1) == Plan((5, 0, 1, 2), back=1)
    assert course.seen_from(2) == Plan((0, 1, 2))
    assert course.seen_from(4) == Plan((2, 0, 1))
    kept = replace(course, skip=3.0, patience=4.0).seen_from(3)
    assert kept == Plan((1, 2, 0), 0, 3.0, 4.0)


def test_a_target_that_may_not_be_entered_yet_is_waited_for_with_patience_only() -> None:
    rules = ruled()
    targets = (0, 3, 2)
    # P0 was visited 40 s ago and is URGENT in 10 s; the robot stands before it.
    for patience, expected in ((10.0, 0), (9.99, 1)):
        at = state(1, 40.0, 0.0, 5.0, 45.0)
        assert chosen(Plan(targets, patience=patience), rules, at)[1] == expected
    # From P2 it takes 7 s to come before it.
    for patience, expected in ((3.0, 0), (2.99, 1)):
        at = state(2, 40.0, 5.0, 0.0, 60.0)
        assert chosen(Plan(targets, patience=patience), rules, at)[1] == expected
    # What is URGENT is not waited for.
    assert chosen(Plan(targets), rules, state(1, 50.1, 0.0, 5.0, 0.0)) == (0, 0)
    # Until it may be entered the robot goes where it may, as near as that is.
    assert chosen(Plan(targets, patience=math.inf), rules, state(1, 40.0, 0.0, 5.0, 0.0)) == (
        2,
        0,
    )


def test_a_target_that_was_visited_lately_is_skipped() -> None:
    rules = rule_graph_of(CHAIN, 50.0, [1] * 4, 9)
    for skip, expected in ((6.0, (2, 0)), (6.01, (0, 1))):
        at = state(1, 30.0, 0.0, 6.0, 40.0)
        assert chosen(Plan((2, 0), skip=skip), rules, at) == expected
    # Where all are, it goes on to the next, whatever it is; never to where it stands.
    assert chosen(Plan((1, 2, 0), skip=99.0), rules, state(1, 3.0, 0.0, 6.0, 4.0)) == (2, 1)
    assert chosen(Plan((1,), skip=99.0), rules, state(1, 3.0, 0.0, 6.0, 4.0)) == (1, 0)
    # What could not be reached lately is left out as well.
    at = state(1, 30.0, 0.0, 6.0, 40.0, avoided=frozenset({2}))
    assert chosen(Plan((2, 0)), rules, at) == (0, 1)


def test_the_way_to_a_target_leads_over_what_may_be_entered() -> None:
    rules = rule_graph_of(CHAIN, 50.0, [1] * 4, 9)
    assert chosen(Plan((3, 0)), rules, state(0, 0.0, 9.0, 9.0, 9.0)) == (1, 0)
    star = PatrolGraph({'M': dict.fromkeys('ABC', 5.0), **{name: {'M': 5.0} for name in 'ABC'}})
    # B is URGENT, A is the target, C is nearer to nothing: the one that waited longest.
    held = rule_graph_of(star, 50.0, [2, 2, 2, 1], 0)
    assert held.allowed(state(3, 10.0, 60.0, 55.0, 0.0)) == [1, 2]
    course = Plan((0,), patience=math.inf)
    assert chosen(course, held, state(3, 10.0, 60.0, 55.0, 0.0))[0] == 1
    assert chosen(course, held, state(3, 10.0, 55.0, 60.0, 0.0))[0] == 2
    assert chosen(course, held, state(3, 10.0, 60.0, 60.0, 0.0))[0] == 1


@pytest.mark.parametrize('slower', [1.0, 2.0])
def test_a_target_with_hours_is_gone_to_while_it_is_open_and_can_be_left_again(
    slower: float,
) -> None:
    """P3 is open for 100 s; from P1 the way takes 14 s, and it takes 5 s to drive out again."""

    def goes(opens: float) -> bool:
        rules = rule_graph_of(
            CHAIN, 50.0, [1] * 4, 9, windows={3: ((1000.0 + opens, 1100.0 + opens),)}, slower=slower
        )
        at = state(1, 9.0, 0.0, 9.0, 60.0)
        return chosen(Plan((3, 2), patience=math.inf), rules, at)[1] == 0

    assert goes(0.0)
    assert not goes(0.1)
    left = 100.0 - slower * 19.0
    assert goes(-left + 0.1)
    assert not goes(-left)
    assert not goes(-200.0)


def charged(reach: float = 300.0) -> RuleGraph:
    energy = Energy(
        CHAIN, [Charger('P0', ChargeCurve.even(2.0))], Draw(90.0 / reach), 0.0,
        BatteryLimits(0.0, 90.0, 5.0),
    )  # fmt: skip
    return rule_graph_of(CHAIN, 50.0, [1] * 4, 9, energy=energy)


def test_a_charge_is_skipped_where_it_would_give_little() -> None:
    rules = charged()
    energy = rules.energy
    assert energy is not None
    course = Plan((4, 2))
    # It drives for 5 s to the station.
    little = energy.full - WORTH_CHARGING + 5.0 * energy.draw
    assert chosen(course, rules, state(1, 9.0, 0.0, 9.0, 9.0, level=little)) == (4, 0)
    assert chosen(course, rules, state(1, 9.0, 0.0, 9.0, 9.0, level=little + 0.01)) == (2, 1)
    at = state(1, 9.0, 0.0, 9.0, 9.0, level=little, avoided=frozenset({0}))
    assert chosen(course, rules, at) == (2, 1)


def test_a_robot_charges_before_it_sets_out_to_what_its_charge_does_not_suffice_for() -> None:
    rules = charged(60.0)
    energy = rules.energy
    assert energy is not None
    course = Plan((3, 0))
    need = energy.least[3] + 14.0 * energy.draw
    assert chosen(course, rules, state(1, 9.0, 0.0, 9.0, 9.0, level=need + 1e-6))[0] == 2
    assert chosen(course, rules, state(1, 9.0, 0.0, 9.0, 9.0, level=need - 1e-3))[0] == 4


def planned(world: Situation, **more: Any) -> Planner:
    """Return a plan for which hardly anything is looked at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan_module, 'FIRST_WORK', 1.0)
        patch.setattr(plan_module, 'SIMPLE', ())
        return Planner(world, **more)


def known(graph: PatrolGraph, threshold: float = 50.0, **more: Any) -> Situation:
    values: dict[str, Any] = {
        'place': graph.places[0],
        'now': 1000.0,
        'reachable': tuple(graph.leg_seconds[graph.places[0]]),
        'classes': {
            place: frozenset({'ROOM', *(['CORRIDOR'] if len(ways) > 1 else [])})
            for place, ways in graph.leg_seconds.items()
        },
        'visited_at': dict.fromkeys(graph.places, 1000.0),
        'graph': graph,
        'threshold': threshold,
        'priorities': Priorities(('URGENT', 'CORRIDOR', 'ROOM')),
        **more,
    }
    values.setdefault('said', said_in(values['classes']) if more.get('classes') else {})
    return Situation(**values)


def test_a_round_is_begun_with_any_target_and_with_patience_for_what_it_lacks() -> None:
    # The ends wait for 107 s at least, a round of 42 s is 65 s too short for them.
    plan = planned(known(CHAIN, 100.0))
    found = Cycle((0, 1, 2, 3, 2, 1), 42.0)
    least = plan.rule_graph.least_period
    assert least == pytest.approx(107.0, abs=0.01)
    assert plan._entered(found, 0) == Plan(found.targets, patience=least - 42.0 + 14.0)
    turned = plan._entered(found, 4)
    assert turned.targets == (2, 1, 0, 1, 2, 3)
    assert (turned.back, turned.skip) == (0, 0.0)
    # A round that is long enough is waited for no longer than two legs.
    assert planned(known(CHAIN, 20.0))._entered(found, 0).patience == 14.0


@pytest.mark.parametrize('seed', range(4))
def test_a_round_is_begun_first_where_the_first_waits_are_shortest(seed: int) -> None:
    draw, graph = random.Random(seed), one_way(seed, 9)
    seen = {place: 1000.0 - draw.uniform(0.0, 100.0) for place in graph.places}
    plan = planned(known(graph, math.inf, visited_at=seen, priorities=Priorities(()), place='P4'))
    targets = tuple(draw.sample(range(9), 9))
    away, index = plan.rule_graph.away, graph.index

    def longest(phase: int) -> float:
        now, at, waits = 1000.0, 4, []
        for target in targets[phase:] + targets[:phase]:
            now += away[at][target]
            waits.append(now - seen[f'P{target}'])
            at = target
        return round(max(waits), 3)

    found = plan._phases(Cycle(targets, 100.0))
    assert index['P4'] == 4
    assert sorted(found) == list(range(9))
    assert found == sorted(range(9), key=lambda phase: (longest(phase), phase))


def test_waits_are_compared_in_whole_percents_of_what_cannot_be_helped() -> None:
    plan = planned(known(seven_rooms(), 60.0))
    bound, accepted = plan._bound, plan._accepted
    assert bound == plan._search.best.wait
    assert accepted == pytest.approx(1.03 * bound)

    def grade(settled: float, first: float, lasting: float, cut: bool = False) -> tuple[Any, ...]:
        return plan._grade(Outcome(settled, first, lasting, cut=cut))[:4]

    assert grade(accepted, bound, accepted) == (False, 0, 0, 100)
    assert grade(accepted + 0.001 * bound, 1.234 * bound, bound) == (False, 0, 1, 123)
    assert grade(accepted + 0.01 * bound, 1.236 * bound, bound, True) == (True, 0, 1, 124)
    assert grade(accepted + 0.011 * bound, bound, accepted + 0.021 * bound) == (False, 3, 2, 100)
    assert grade(0.0, 0.0, 0.0) == (False, 0, 0, 0)


def test_a_place_that_closes_soon_is_put_at_each_position_of_the_first_lap() -> None:
    windows = {'R3': ((900.0, 1100.0),), 'R1': ((900.0, 1050.0),)}
    openings = Openings({}, frozenset(), {'R3': 100.0, 'R1': 50.0}, windows=windows)
    plan = planned(known(seven_rooms(), 60.0, openings=openings))
    index = plan.rule_graph.graph.index
    for course in (Plan((0, 1, 2, 3), patience=5.0), Plan((6, 5, 0, 1, 2, 3), 2, 0.0, 5.0)):
        plan._plan = course
        way, lap = course.targets[: course.back], course.targets[course.back :]
        way = way or lap
        expected = [
            Plan((*way[:at], index[name], *way[at:], *lap), len(way) + 1, 0.0, patience)
            for name in ('R1', 'R3')
            for at in range(len(way) + 1)
            for patience in (5.0, math.inf)
        ]
        assert list(plan._in_time()) == expected
    # Of a long way sixty positions or so are tried.
    plan._plan = Plan(tuple(random.Random(1).choices(range(7), k=150)))
    tried = [course.targets for course in plan._in_time() if course.patience == 0.0]
    assert len(tried) == 2 * 76


def test_a_plan_is_for_one_map_and_keeps_while_times_differ_little() -> None:
    graph = seven_rooms()
    world = known(graph, 60.0, own_thresholds={'R1': 90.0})
    plan = planned(world)
    assert plan.fits(world, None)
    assert not plan.fits(replace(world, threshold=61.0), None)
    assert not plan.fits(replace(world, own_thresholds={}), None)
    assert not plan.fits(replace(world, priorities=Priorities(('ROOM',))), None)
    assert plan.fits(replace(world, now=1000.0 - HALF_OPEN), None)
    assert not plan.fits(replace(world, now=1000.0 - 2.0 * HALF_OPEN), None)

    def scaled(factor: float, only: str = '') -> PatrolGraph:
        return PatrolGraph(
            {
                place: {
                    other: seconds * (factor if not only or place == only else 1.0)
                    for other, seconds in ways.items()
                }
                for place, ways in graph.leg_seconds.items()
            }
        )

    still = planned(replace(world, graph=scaled(1.0)))
    assert still.fits(replace(world, graph=scaled(1.0999)), None)
    assert still.fits(replace(world, graph=scaled(0.9001)), None)
    assert not still.fits(replace(world, graph=scaled(1.1001, 'R4')), None)
    assert not still.fits(replace(world, graph=scaled(0.8999, 'R4')), None)
    assert not plan.fits(replace(world, graph=graph.without_leg('C1', 'E')), None)
    assert not plan.fits(replace(world, graph=graph.restricted(graph.places[:-1])), None)
    # What opens or closes within the time that it knows.
    energy = charged().energy
    assert not plan.fits(world, energy)
    ahead = world.look_ahead
    for when, fits in ((1000.0 + ahead + 1.0, True), (1000.0 + ahead, False)):
        openings = Openings({}, frozenset(), {}, windows={'R3': ((900.0, when),)})
        assert plan.fits(replace(world, openings=openings), None) == fits


def test_a_plan_keeps_while_the_battery_differs_little() -> None:
    world = known(CHAIN, level=80.0)

    def energy(rate: float) -> Energy:
        station = Charger('P0', ChargeCurve.even(2.0))
        return Energy(CHAIN, [station], Draw(rate), 0.0, BatteryLimits(0.0, 90.0, 5.0))

    plan = planned(world, energy=energy(0.3))
    for rate, fits in ((0.3, True), (0.315, True), (0.285, True), (0.4, False), (0.2, False)):
        assert plan.fits(world, energy(rate)) == fits, rate
    assert not plan.fits(world, None)


def test_a_plan_that_is_remembered_serves_until_it_does_not_fit() -> None:
    world = known(seven_rooms(), 60.0, memory=PolicyMemory())
    first = planner_of(world)
    assert planner_of(world) is first is world.memory.planner
    second = planner_of(replace(world, threshold=70.0))
    assert second is not first
    assert world.memory.planner is second
    # It takes over the course as far as it was followed.
    assert set(second.plan.targets) >= set(range(7))


def test_a_question_changes_nothing_of_what_comes() -> None:
    world = known(seven_rooms(), 60.0)
    plan = planned(world)
    asked = plan.for_a_question()
    before = replace(plan.state, met=plan.state.met.copy())
    for place in ('C1', 'R1'):
        asked.advance(replace(world, place=place, now=1010.0))
    assert plan.state == before
    assert asked.state != before


def test_what_the_search_was_cut_off_by_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    world = known(seven_rooms(), 60.0)
    assert Planner(world).cut == ''
    with monkeypatch.context() as patch:
        patch.setattr('patrol_policy.rollout.MOST_MOVES', 1)
        patch.setattr('patrol_policy.rollout.MOVES_A_PLACE', 1)
        assert Planner(world).cut == 'it was looked ahead for 8 moves only'
    monkeypatch.setattr(plan_module, 'MOST_SECONDS', -1.0)
    assert Planner(world).cut == 'the search was ended after -1 s of the processor'


def test_what_was_noticed_counts_as_overdue() -> None:
    classes = {
        place: frozenset({'ROOM', *(['URGENT'] if place in ('R1', 'R2') else [])})
        for place in seven_rooms().places
    }
    seen = dict.fromkeys(seven_rooms().places, 990.0) | {'R2': 900.0}
    world = known(seven_rooms(), 60.0, classes=classes, visited_at=seen, since=950.0)
    plan = planned(world)
    index = plan.rule_graph.graph.index
    state = plan.state
    # R1 was visited lately, R2 long ago: as the ontology says, both are URGENT now.
    late = {place for place in plan.rule_graph.graph.places if state.due[index[place]] < 1000.0}
    assert late == {'R1', 'R2'}
    assert state.seen[index['R1']] == state.seen[index['R3']] == 990.0
    endless = planned(replace(world, own_thresholds={'R1': math.inf}))
    assert endless.state.due[index['R1']] < 1000.0
    never = planned(replace(world, visited_at={}))
    assert never.state.seen[index['R3']] == 950.0
    assert list(itertools.compress(plan.rule_graph.graph.places, state.met)) == []
    plan.advance(replace(world, place='R3', now=1005.0, avoided=frozenset({'R4', 'R9'})))
    assert list(itertools.compress(plan.rule_graph.graph.places, plan.state.met)) == ['R3']
    assert plan.state.avoided == {index['R4']}


def test_ways_into_a_round_are_tried_with_other_patience_and_with_places_left_out() -> None:
    plan = planned(known(CHAIN, 100.0))
    found = list(plan._candidates())
    cycles = dict.fromkeys((plan._search.begun, plan._search.best))
    ways = [[plan._entered(each, phase) for phase in plan._phases(each)] for each in cycles]
    begun = [course for each in ways for course in each[:2]]
    assert found[: len(begun)] == begun
    turned = found[len(begun) : 2 * len(begun)]
    assert [course.targets for course in turned] == [course.targets[::-1] for course in begun]
    assert [course.patience for course in turned] == [course.patience for course in begun]
    first, bound = ways[-1][0], plan._bound
    assert found[2 * len(begun) : 2 * len(begun) + 9] == [
        replace(first, skip=skip * bound, patience=patience)
        for skip in (0.0, 0.3, 0.6)
        for patience in (0.0, first.patience, math.inf)
    ]
    rest = found[2 * len(begun) + 9 :]
    assert sorted(map(str, rest)) == sorted(str(course) for each in ways for course in each[2:])
