"""The rules as a table: whoever asks what comes first is told the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.battery import Battery
from patrol_policy.cycle_search import CycleSearch
from patrol_policy.decision import (
    DecisionSettings,
    NowhereToGoError,
    candidates,
    decide,
    planning_view,
    why_not,
)
from patrol_policy.fleet import FleetRobot, FleetSettings
from patrol_policy.fleet.ruled import ruled
from patrol_policy.fleet.simulation import FleetView
from patrol_policy.hours import Openings
from patrol_policy.idleness_bounds import LATER, UNKNOWN, idleness_bounds
from patrol_policy.lower_bounds import possible_moves, rule_bound
from patrol_policy.plan import Planner, planner_of
from patrol_policy.rollout import lookahead, oldest
from patrol_policy.rule_graph import PatrolState, rule_graph
from patrol_policy.rule_table import ALERT, ANY, HALF_OPEN, URGENT, ClassRule, Priorities, RuleTable
from patrol_policy.simulation import Patrol
from patrol_policy.situation import Situation

from .worlds import graphs, rule_graph_of, seven_rooms, world

MONDAY = datetime(2024, 3, 4, 9, 0, tzinfo=UTC).timestamp()
SUNDAY = MONDAY - 86_400.0
ENTRIES = (URGENT, 'A', 'B', 'A&URGENT', 'B&A sat-sun', 'C&B mon')


@st.composite
def worlds_with_rules(draw: st.DrawFn) -> Situation:
    """Draw what a robot knows: classes, waits, thresholds, what the ontology says, the hours."""
    graph = draw(graphs())
    now = MONDAY + draw(st.sampled_from([0.0, 0.25]))
    kinds = st.sets(st.sampled_from(['A', 'B', 'C', ALERT]), max_size=3).map(frozenset)
    classes = {place: draw(kinds) for place in graph.places}
    seen = {place: now - draw(st.integers(0, 90)) for place in graph.places if draw(st.booleans())}
    own = draw(st.dictionaries(st.sampled_from(graph.places), st.sampled_from([7.5, math.inf])))
    said = draw(st.dictionaries(st.sampled_from(graph.places), st.booleans()))
    order = draw(st.lists(st.sampled_from(ENTRIES), unique=True, max_size=5))
    here = draw(st.sampled_from(graph.places))
    closed = draw(st.sets(st.sampled_from(graph.places), max_size=2)) - {here}
    return Situation(
        place=here,
        now=now,
        reachable=tuple(graph.leg_seconds[here]),
        classes=classes,
        said=said,
        visited_at=seen,
        graph=graph,
        since=now - draw(st.sampled_from([0.0, 40.0])),
        threshold=draw(st.sampled_from([10.5, 50.5])),
        own_thresholds=own,
        avoided=frozenset(draw(st.sets(st.sampled_from(graph.places), max_size=2))),
        priorities=Priorities(tuple(order)),
        openings=Openings(
            dict.fromkeys(closed, 'closed'),
            frozenset(draw(st.sets(st.sampled_from(graph.places), max_size=2)) - closed),
            {},
            opens_in=dict.fromkeys(closed, 0.5),
            windows=dict.fromkeys(closed, ((now + 0.5, now + 9_000.0),)),
            zone=UTC,
        ),
    )


def in_plain_words(known: Situation, here: str, urgent: Mapping[str, bool]) -> set[str]:
    """Return the places that may be entered, as the rules' description has it."""
    near = [p for p in known.graph.leg_seconds[here] if p not in known.openings.closed]
    near = [place for place in near if place not in known.avoided] or near
    for entry in known.priorities.entries:
        names, _, hours = entry.partition(' ')
        if hours == 'sat-sun':  # It is a Monday.
            continue
        members = {
            place
            for place in near
            if set(names.split('&'))
            <= (known.classes[place] | ({URGENT} if urgent[place] else set()))
        }
        if members:
            return members
    return set(near)


def urgent_now(known: Situation) -> dict[str, bool]:
    found = {}
    for place in known.graph.places:
        said, limit = known.said.get(place), known.threshold_of(place)
        if place in known.openings.optional:
            found[place] = bool(said) and ALERT in known.classes[place]
        else:
            found[place] = known.idleness_of(place) > limit if said is None else said
    return found


@settings(max_examples=250)
@given(worlds_with_rules())
def test_all_who_ask_what_comes_first_are_told_the_same(known: Situation) -> None:
    """Decision, plan, searched rounds, bounds, simulation, fleet and idleness bounds."""
    graph, index, here = known.graph, known.graph.index, known.place
    urgent = urgent_now(known)
    expected = in_plain_words(known, here, urgent)
    assert {place: known.is_urgent(place) for place in graph.places} == urgent
    try:
        rule, allowed = candidates(known)
    except NowhereToGoError:
        rule, allowed = ANY, ()
    assert set(allowed) == expected
    # The plan, and walks ahead: their state has what was said.
    rules = rule_graph(known)
    state = Planner(known).state
    assert {graph.places[place] for place in rules.allowed(state)} == expected
    for choose in (oldest, lookahead):
        assert graph.places[choose(rules, state)] in (expected or {here})
    settings = DecisionSettings(priorities=known.priorities)
    if allowed:
        decision = decide(known, Battery(), settings)
        assert (decision.rule, decision.place in expected) == (rule, True)
    # Bounds know no hours and nothing that is avoided; places may have been visited at any time.
    always = Openings({}, frozenset(), {}, zone=UTC)
    free = replace(known, said={}, avoided=frozenset(), openings=always)
    waits = {place: free.idleness_of(place) for place in graph.places}
    overdue = {place: waits[place] > free.threshold_of(place) for place in graph.places}
    lawful = {index[place] for place in in_plain_words(free, here, overdue)}
    ages = tuple(round(1000.0 * waits[place]) for place in graph.places)
    legs = dict.fromkeys(graph.edges[index[here]], 1)
    everywhere = (1 << len(graph.places)) - 1
    for met, compare in ((everywhere, set.__eq__), (0, set.__ge__)):
        moves = possible_moves(free.table, legs, (index[here], met, ages))
        assert compare({other for other, _ in moves}, lawful)
    # A fleet of one robot decides as it would alone, or keeps its place on the tour.
    outlook = {'robot': FleetRobot('robot', here, heard_at=free.now)}
    classes, limits = free.classes, {place: free.threshold_of(place) for place in graph.places}
    seen = {place: free.now - waits[place] for place in graph.places}
    choose_place = ruled(classes, limits, settings)
    choice = choose_place(FleetView(graph, outlook, seen, free.now, FleetSettings()), 'robot')
    if 'is overdue' not in choice.reason:
        assert choice.place == here or index[choice.place] in lawful


@settings(max_examples=120)
@given(worlds_with_rules(), st.data())
def test_a_round_breaks_the_rules_where_a_robot_that_walks_it_would(
    known: Situation, data: st.DataObject
) -> None:
    always = Openings({}, frozenset(), {}, zone=UTC)
    free = replace(known, said={}, avoided=frozenset(), openings=always)
    graph, rules = free.graph, rule_graph(free)
    walk = [0]
    for _ in range(data.draw(st.integers(1, 12))):
        walk.append(data.draw(st.sampled_from(sorted(graph.edges[walk[-1]]))))
    walk += [graph.index[name] for name in graph.route(graph.places[walk[-1]], graph.places[0])]
    targets = tuple(walk[1:])
    missing = set(range(rules.count)) - set(targets)
    search = CycleSearch(rules, [[targets]], graph.tour.length)
    resting = set(rules.held_periods)
    seen = dict.fromkeys(graph.places, -math.inf)
    now, place, broken = free.now, graph.places[0], set[int]()
    for lap in range(3):
        for step, stop in enumerate(targets):
            name = graph.places[stop]
            urgent = {
                other: now - seen[other] > free.threshold_of(other) + HALF_OPEN / 2.0
                and graph.index[other] not in missing
                for other in graph.places
            }
            if lap == 2 and name not in in_plain_words(free, place, urgent):
                broken.add(step)
            now += rules.leg_seconds[graph.index[place]][stop]
            seen[name], place = now, name
    found = {breach.position for breach in search.judged(targets).breaches}
    assert found <= broken
    assert {step for step in broken - found if targets[step] not in resting} == set()


def laboratory(entries: tuple[str, ...], now: float = MONDAY, **more: object) -> Situation:
    """Return the seven rooms, R4 of which is a laboratory; all but C2 wait for 300 s."""
    graph = seven_rooms()
    corridors = {'C1', 'C2', 'E'}
    classes = {p: frozenset({'ROOM', *(['CORRIDOR'] * (p in corridors))}) for p in graph.places}
    classes['R4'] |= {'LAB'}
    return Situation(
        **{  # type: ignore[arg-type]
            'place': 'C2',
            'now': now,
            'reachable': tuple(graph.leg_seconds['C2']),
            'classes': classes,
            'visited_at': dict.fromkeys(graph.places, now - 300.0) | {'C2': now},
            'graph': graph,
            'threshold': 240.0,
            'priorities': Priorities(entries),
            'openings': Openings({}, frozenset(), {}, zone=UTC),
            **more,
        }
    )


ON_WEEKDAYS = ('LAB&URGENT mon-fri', 'URGENT', 'CORRIDOR', 'ROOM')


def test_a_new_class_is_one_entry_that_all_follow() -> None:
    """Laboratories before all else that is URGENT, on weekdays: what CONTRIBUTING points to."""
    settings = DecisionSettings(priorities=Priorities(ON_WEEKDAYS))
    monday = laboratory(ON_WEEKDAYS)
    assert candidates(monday) == ('LAB&URGENT', ('R4',))
    assert candidates(laboratory(ON_WEEKDAYS, SUNDAY)) == ('URGENT', ('C1', 'E', 'R3', 'R4'))
    # The decision says so, and why another place is not chosen.
    decision = decide(monday, Battery(), settings)
    assert (decision.rule, decision.place) == ('LAB&URGENT', 'R4')
    assert 'is the only reachable LAB&URGENT place' in decision.reason
    assert 'threshold 240 s' in decision.reason
    told = why_not('R3', monday, Battery(), settings)
    assert told.sentence.startswith('R3 is not LAB&URGENT (last visit 300.0 s ago')
    assert 'R3 is LAB&URGENT: missing' in told.premises
    # The plan goes there first on a Monday, and is made anew when the class counts no more.
    plan = planner_of(planning_view(monday, Battery(), settings))
    assert plan.places[plan.advance(monday)[0]] == 'R4'
    sunday = laboratory(ON_WEEKDAYS, SUNDAY, memory=monday.memory)
    assert not plan.fits(sunday, None)


def test_bounds_and_idleness_bounds_follow_a_new_class() -> None:
    # A laboratory before all else for ever: whoever stands before it never comes past it.
    always = laboratory(('LAB', 'URGENT', 'CORRIDOR', 'ROOM'))
    usual = laboratory(('URGENT', 'CORRIDOR', 'ROOM'))
    graph = usual.graph
    assert math.isfinite(rule_bound(graph, usual.table).high)
    # Nobody that obeys can ever have a short wait: there is no walk to be found.
    assert math.isinf(rule_bound(graph, always.table, states=2_000).high)
    settings = DecisionSettings(priorities=always.priorities)
    told = {each.place: each.verdict for each in idleness_bounds(always, Battery(), settings)}
    assert (told['C2'], told['R1']) == ('within', UNKNOWN)
    settings = DecisionSettings(priorities=Priorities(ON_WEEKDAYS), urgency_threshold=240)
    told = {each.place: each.verdict for each in idleness_bounds(usual, Battery(), settings)}
    assert set(told.values()) <= {'within', LATER}


def test_a_simulated_week_keeps_the_hours_of_a_class() -> None:
    # The threshold is far below the tour: several places are URGENT wherever the robot stands.
    graph = seven_rooms()

    def lab_first(began: float) -> list[bool]:
        classes, order = laboratory(ON_WEEKDAYS).classes, Priorities(ON_WEEKDAYS)
        patrol = Patrol(graph, order, 'oldest', 20.0, 'E', began=began, classes=classes)
        found = []
        for _ in range(200):
            at_door = patrol.place == 'C2' and patrol.world().is_urgent('R4')
            decision = patrol.step()
            if at_door:
                found.append(decision.place == 'R4')
        return found

    assert all(lab_first(MONDAY + 12 * 3600.0))
    assert not all(lab_first(SUNDAY - 12 * 3600.0))


def test_what_the_ontology_says_counts_more_than_the_wait() -> None:
    table = RuleTable(('URGENT', 'ROOM'), [1, 1, 2], [0, 0, 2], [60.0, math.inf, 60.0])
    assert [table.rank(0, age) for age in (59.0, 60.0, 60.1)] == [1, 1, 0]
    assert table.rank(0, 0.0, said=True) == 0
    assert table.rank(0, 1e9, said=False) == 1
    assert (table.rank(1, 1e9), table.rank(1, 0.0, said=True)) == (1, 0)
    # Of a place that ranks alike it is no matter; as many ranks as entries: of none.
    assert table.rank(2, 1e9, said=True) == 2
    assert [table.name_of(rank) for rank in (0, 1, 2)] == ['URGENT', 'ROOM', ANY]
    # Looking ahead: what is said to be URGENT is until it is visited; else it is, in a moment.
    due = table.due_times(100.0, [30.0, 30.0, 30.0], {0: False, 1: True})
    assert due == [100.0, -math.inf, math.inf]
    assert table.first([0, 2], 100.0, due) == [0]
    assert table.first([0, 1], 100.0, due) == [1]
    assert table.first([0, 1], 100.1, due) == [0, 1]
    assert table.first([], 100.0, due) == []


@pytest.mark.parametrize(
    ('entry', 'names', 'on_monday', 'on_sunday'),
    [
        ('LAB', ('LAB',), True, True),
        ('LAB mon-fri', ('LAB',), True, False),
        ('LAB&URGENT not mon', ('LAB', 'URGENT'), False, True),
        ('LAB may mon-fri 08:00-10:00', ('LAB',), True, True),
        ('LAB mon-fri 10:00-12:00', ('LAB',), False, False),
    ],
)
def test_an_entry_counts_in_its_hours(
    entry: str, names: tuple[str, ...], on_monday: bool, on_sunday: bool
) -> None:
    rule = ClassRule.parse(entry)
    assert rule.classes == names
    assert rule.counts(MONDAY, UTC) is on_monday
    assert rule.counts(SUNDAY, UTC) is on_sunday
    found = Priorities((entry, 'URGENT')).at(SUNDAY, UTC)
    assert found == (('&'.join(names), 'URGENT') if on_sunday else ('URGENT',))


@pytest.mark.parametrize(
    ('entries', 'message'),
    [
        (('LAB mon-fry',), "'LAB mon-fry' is not the name of a class of places and its hours: "),
        (('LAB&',), "'LAB&' is not the name of a class of places"),
        (('LAB mon', 'LAB tue'), 'LAB stands twice'),
    ],
)
def test_what_is_no_entry_is_refused_in_one_line(entries: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        Priorities(entries)
    assert '\n' not in str(caught.value)


def test_a_table_is_made_once_as_long_as_nothing_changes() -> None:
    known = world(priorities=Priorities())
    assert replace(known, now=200.0, place='C2').table is known.table
    assert replace(known, threshold=61.0).table is not known.table
    begin = PatrolState(0, 5.0, [0.0] * 7, [True] * 7)
    assert rule_graph_of(seven_rooms(), 60.0).due(begin)[0] > 60.0
