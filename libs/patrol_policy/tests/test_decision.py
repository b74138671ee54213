"""The one decision: charging, requests, rules, policy; and why not somewhere else."""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

from patrol_policy.battery import Battery, Draw
from patrol_policy.decision import (
    DecisionSettings,
    NowhereToGoError,
    candidates,
    decide,
    tour_warning,
    why_charge,
    why_not,
)
from patrol_policy.fleet import FleetOutlook, FleetRobot
from patrol_policy.graph import graph_of_places
from patrol_policy.hours import ALWAYS_OPEN, Openings
from patrol_policy.plan import planner_of
from patrol_policy.policies import POLICIES
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import PolicyMemory

from .worlds import seven_rooms, world


def chosen(rules: Priorities, policy: str, **changes: object) -> tuple[str, str]:
    settings = DecisionSettings(rules, policy)
    decision = decide(world(**changes), Battery(), settings)
    return decision.place, decision.rule


def test_urgent_places_come_before_corridors() -> None:
    assert chosen(Priorities(), 'oldest') == ('R2', 'URGENT')


@pytest.mark.parametrize('hours', [ALWAYS_OPEN, Openings({}, frozenset({'E'}), {})])
def test_an_alert_is_urgent_at_once_whatever_its_threshold_and_hours(hours: Openings) -> None:
    calm = {place: frozenset({'ROOM'}) for place in ('R1', 'R2', 'C2')}
    noticed = calm | {'E': frozenset({'ROOM', 'ALERT', 'URGENT'})}
    longer = {'own_thresholds': {'E': 86_400.0}, 'openings': hours}
    for policy in POLICIES:
        assert chosen(Priorities(), policy, classes=noticed, **longer) == ('E', 'URGENT')
    asked = world(classes=noticed, **longer)
    assert 'R1 is URGENT: missing' in why_not('R1', asked, Battery(), DecisionSettings()).premises


def test_a_place_that_only_may_be_visited_is_not_urgent() -> None:
    hours = Openings({}, frozenset({'R2'}), {})
    assert chosen(Priorities(), 'oldest', openings=hours) == ('R1', 'URGENT')


def test_corridors_come_before_rooms() -> None:
    calm = {place: frozenset({'ROOM'}) for place in ('R1', 'R2')}
    calm |= {place: frozenset({'CORRIDOR', 'ROOM'}) for place in ('C2', 'E')}
    assert chosen(Priorities(), 'oldest', classes=calm) == ('C2', 'CORRIDOR')


def test_the_rules_are_data() -> None:
    assert chosen(Priorities(('CORRIDOR', 'URGENT')), 'oldest') == ('C2', 'CORRIDOR')
    assert chosen(Priorities(()), 'oldest') == ('R2', 'any')
    assert chosen(Priorities(('KITCHEN',)), 'oldest') == ('R2', 'any')


@pytest.mark.parametrize(
    ('names', 'problem'),
    [(('URGENT', 'URGENT'), 'URGENT stands twice'), (('9 to 5',), "'9 to 5' is not the name")],
)
def test_bad_rules_are_named(names: tuple[str, ...], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        Priorities(names)


def test_among_equals_the_longest_unvisited_then_the_first_name() -> None:
    always = dict.fromkeys(('E', 'R1', 'R2', 'C2'), 1.0)
    assert chosen(Priorities(()), 'oldest', visited_at=always) == ('C2', 'any')


def test_avoided_places_wait_until_nothing_else_is_left() -> None:
    assert chosen(Priorities(), 'oldest', avoided=frozenset({'R2'})) == ('R1', 'URGENT')
    assert chosen(Priorities(), 'oldest', avoided=frozenset({'R1', 'R2'}))[1] == 'CORRIDOR'
    everything = frozenset({'R1', 'R2', 'C2', 'E'})
    assert chosen(Priorities(), 'oldest', avoided=everything) == ('R2', 'URGENT')


def test_a_plan_takes_a_place_that_could_not_be_reached_where_the_others_are_closed() -> None:
    asked = world(
        avoided=frozenset({'R1'}),
        openings=Openings(
            closed=dict.fromkeys(('C2', 'E', 'R2'), 'closed'),
            optional=frozenset(),
            closes_in={},
            opens_in=dict.fromkeys(('C2', 'E', 'R2'), 30.0),
            windows=dict.fromkeys(('C2', 'E', 'R2'), ((130.0, 9000.0),)),
        ),
    )
    assert candidates(replace(asked, priorities=Priorities())) == ('URGENT', ('R1',))
    plan = planner_of(asked)
    assert asked.graph.places[plan.advance(asked)[0]] == 'R1'


def test_nothing_within_reach_is_an_error_that_says_so() -> None:
    with pytest.raises(NowhereToGoError, match='nothing can be reached from C1'):
        chosen(Priorities(), 'oldest', reachable=())


def test_a_decision_carries_its_reason_in_words_and_numbers() -> None:
    decision = decide(world(), Battery(), DecisionSettings(policy='oldest'))
    assert decision.reason == (
        'oldest chose R2 (last visit 90.0 s ago, threshold 60 s) from 2 reachable URGENT places; '
        'the longest wait decides'
    )
    assert decision.scores == {'R1': 80.0, 'R2': 90.0}


def test_a_place_that_nobody_visited_yet_has_no_invented_wait() -> None:
    decision = decide(world(visited_at={}), Battery(), DecisionSettings(policy='oldest'))
    assert '(not visited yet, threshold 60 s)' in decision.reason
    assert 'ago' not in decision.reason


def test_charging_comes_first_and_goes_to_the_nearest_station() -> None:
    settings = DecisionSettings(recharge_rooms=('R4', 'E'))
    decision = decide(world(requested='R3'), Battery(12.0), settings)
    assert (decision.place, decision.rule) == ('E', 'recharge')
    assert decision.reason.startswith(
        'the battery is at 12 %, below 20.0 % (battery_require_recharge); '
        'E is the nearest charging place'
    )
    with pytest.raises(NowhereToGoError, match='no charging place'):
        decide(world(), Battery(low=True), DecisionSettings(recharge_rooms=('GARAGE',)))


def test_a_robot_that_was_sent_to_charge_charges_until_it_has() -> None:
    sent = Battery(50.0, sent_to_charge='the battery is at 12 %')
    assert decide(world(), sent, DecisionSettings()).rule == 'recharge'
    full = Battery(90.0, sent_to_charge='the battery is at 12 %')
    assert decide(world(), full, DecisionSettings()).rule == 'URGENT'


def test_the_reserve_goes_by_the_times_that_nearly_all_drives_keep_to() -> None:
    battery = Battery(40.0, draw=Draw(1.0))
    near, far = world(), world(time_spread=4.0)
    assert why_charge(near, battery, DecisionSettings()) == ''
    assert '(home takes' in why_charge(far, battery, DecisionSettings())


def test_a_request_comes_before_the_rules() -> None:
    decision = decide(world(requested='R4'), Battery(), DecisionSettings())
    assert (decision.place, decision.rule) == ('R4', 'request')
    assert 'an operator has sent the robot to R4' in decision.reason
    assert decide(world(requested='C1'), Battery(), DecisionSettings()).rule == 'URGENT'
    with pytest.raises(NowhereToGoError, match='R9, as requested, cannot be reached'):
        decide(world(requested='R9'), Battery(), DecisionSettings())


@pytest.mark.parametrize(
    ('place', 'sentence', 'premise'),
    [
        ('C1', 'the robot is in C1 already', None),
        ('R2', 'the robot would go to R2 now [URGENT]', None),
        ('R1', 'oldest scores R1 80.0 and R2 90.0', 'R1 is URGENT: holds'),
        ('E', 'threshold 60 s), but R1 and R2 are; the robot goes to', 'E is URGENT: missing'),
        ('R4', 'in one move (the way is C1 - C2 - R4)', 'C1 connectedTo R4: missing'),
    ],
)
def test_why_not_says_rule_figures_and_premises(
    place: str, sentence: str, premise: str | None
) -> None:
    told = why_not(place, world(), Battery(), DecisionSettings(policy='oldest'))
    assert sentence in told.sentence
    assert premise is None or premise in told.premises
    assert 'missing' not in ' '.join(told.premises[1:]) or 'missing' in told.premises[0]


def test_why_not_says_what_comes_before_the_rules() -> None:
    told = why_not('R2', world(), Battery(low=True), DecisionSettings())
    assert told.sentence.startswith('the robot goes to E [recharge]: the battery is low')
    with pytest.raises(ValueError, match="no place 'R22' on the map, expected"):
        why_not('R22', world(), Battery(), DecisionSettings())
    shut = replace(world(), classes={**world().classes, 'R9': frozenset({'URGENT'})})
    with pytest.raises(ValueError, match='R9 cannot be reached: no open door leads to it'):
        why_not('R9', shut, Battery(), DecisionSettings())


@pytest.mark.parametrize('taken_out', [False, True])
def test_why_not_is_answered_for_a_robot_of_a_fleet(taken_out: bool) -> None:
    one, graph = world(), seven_rooms()
    robots = [
        FleetRobot('a', 'C1', heard_at=one.now, taken_out=taken_out),
        FleetRobot('b', 'R1', heard_at=one.now),
    ]
    asked = replace(one, fleet=FleetOutlook('a', robots, graph))
    decision = decide(asked, Battery(), DecisionSettings())
    for place in sorted(set(graph.places) - {'C1', decision.place}):
        told = why_not(place, asked, Battery(), DecisionSettings())
        if taken_out:
            assert told.sentence == 'the robot stays in C1 [wait]: no place is mine: a is taken out'
        elif place in one.reachable:
            assert f'[CORRIDOR]: {decision.reason}' in told.sentence
        assert not any('is wait' in premise for premise in told.premises)


def test_a_threshold_below_the_tour_is_warned_of() -> None:
    assert 'urgency_threshold is 60 s, but the shortest tour of all places takes 69.6 s' in (
        tour_warning(69.648, 60.0)
    )
    assert tour_warning(69.648, 70.0) == ''


@pytest.mark.parametrize('policy', POLICIES)
def test_a_question_changes_no_decision(policy: str) -> None:
    def decisions(*, asked: bool) -> list[str]:
        graph, memory, settings = seven_rooms(), PolicyMemory(random.Random(3)), DecisionSettings()
        settings.policy, settings.priorities = policy, Priorities(())
        place, now, visited_at, taken = 'C1', 100.0, {'C1': 100.0}, []
        for _ in range(8):
            here = world(
                place=place,
                now=now,
                reachable=tuple(graph.leg_seconds[place]),
                visited_at=visited_at,
                graph=graph,
                memory=memory,
            )
            for other in ('R1', 'R4') if asked else ():
                why_not(other, here, Battery(), settings)
            decision = decide(here, Battery(), settings)
            now += graph.leg_seconds[place][decision.place]
            place = decision.place
            visited_at = {**visited_at, place: now}
            taken.append(place)
        return taken

    assert decisions(asked=True) == decisions(asked=False)


def test_questions_before_the_first_choice_share_one_plan() -> None:
    graph, memory = seven_rooms(), PolicyMemory()
    here = world(
        place='C1', now=1.0, reachable=tuple(graph.leg_seconds['C1']), graph=graph, memory=memory
    )
    why_not('R1', here, Battery(), DecisionSettings())
    planned = memory.for_a_question().planner
    assert planned is not None
    assert memory.planner is None
    assert planned.fits(replace(here, priorities=Priorities()), None)


def test_the_only_place_is_swept_and_a_robot_that_is_shut_in_asks_for_help() -> None:
    graph = graph_of_places({'hall': []}, {'hall': (0.0, 0.0, 0.0)}, 1.0, 2.0)
    hall = {'place': 'hall', 'reachable': (), 'graph': graph, 'visited_at': {'hall': 90.0}}
    alone = {'hall': frozenset({'ROOM'})}
    assert chosen(Priorities(), 'oldest', classes=alone, **hall) == ('hall', 'sweep')
    quiet = Openings({}, frozenset(), {}, quiet_for=60.0)
    settings = DecisionSettings(recharge_rooms=('hall',))
    asked = world(classes=alone, openings=quiet, **hall)
    assert decide(asked, Battery(), settings).rule == 'quiet'
    asked = world(classes=alone, **hall)
    assert decide(asked, Battery(10.0, True), settings).rule == 'recharge'
    others = alone | {'office': frozenset({'ROOM'})}
    with pytest.raises(NowhereToGoError):
        decide(world(classes=others, **hall), Battery(), DecisionSettings())
