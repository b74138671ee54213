"""The map as plans see it: ways, rules, hours and charge, against plain references."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.battery import BatteryLimits, ChargeCurve, Charger, Draw, Energy
from patrol_policy.decision import NowhereToGoError, candidates
from patrol_policy.graph import PatrolGraph
from patrol_policy.hours import Openings
from patrol_policy.rollout import Choice, lookahead, oldest, roll_out
from patrol_policy.rule_graph import PatrolState, RuleGraph, rule_graph
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import Situation

from .test_plan import chain
from .test_tour import hall
from .worlds import default_ranks, graphs, rule_graph_of, seven_rooms, world


def open_at(*stretches: tuple[float, float], slower: float = 1.0) -> RuleGraph:
    """Return a chain of three places, 5 s of driving and 2 s of exploring each, one with hours."""
    graph = chain(3)
    return rule_graph_of(
        graph, 100.0, default_ranks(graph), 0, windows={2: stretches}, slower=slower
    )


def test_a_way_is_begun_to_what_is_open_and_can_be_left_in_time() -> None:
    rules = open_at((10.0, 50.0), (60.0, 90.0))
    # 7 s to enter and explore it, 5 s to drive out.
    starts = [now for now in range(100) if rules.is_open(2, float(now), 7.0)]
    assert starts == [*range(10, 38), *range(60, 78)]
    slower = open_at((10.0, 50.0), slower=2.0)
    assert [now for now in range(60) if slower.is_open(2, float(now), 7.0)] == [*range(10, 26)]
    assert [rules.opens_in(2, now) for now in (0.0, 10.0, 49.0, 50.0, 90.0)] == [
        10.0, 0.0, 0.0, 10.0, math.inf,
    ]  # fmt: skip
    assert rules.last_change == 90.0
    assert open_at((10.0, math.inf)).last_change == 10.0
    assert open_at().last_change == -math.inf


@pytest.mark.parametrize(
    ('since', 'now', 'wait'),
    [
        (20.0, 45.0, 25.0),  # While it is open.
        (20.0, 55.0, 30.0),  # It is closed for 5 s.
        (20.0, 75.0, 45.0),  # It was closed for 10 s.
        (50.0, 75.0, 15.0),
        (55.0, 75.0, 15.0),
        # It was missed for all the time that it was open: it waits through the time after that.
        (20.0, 120.0, 90.0),
        (65.0, 120.0, 25.0),
        (0.0, 40.0, 30.0),  # The time before the first is known to be closed.
        (0.0, 5.0, 0.0),
        (95.0, 120.0, 0.0),
    ],
)
def test_the_next_time_in_which_a_place_is_closed_does_not_count(
    since: float, now: float, wait: float
) -> None:
    rules = open_at((10.0, 50.0), (60.0, 90.0))
    assert rules.waited(2, since, now) == wait
    assert rules.waited(1, since, now) == now - since


def test_the_walk_ahead_waits_for_no_place_while_it_is_closed() -> None:
    rules = open_at((10.0, 50.0), (300.0, 500.0))
    state = PatrolState(0, 0.0, [0.0] * 3, [True] * 3)
    found = roll_out(rules, oldest, state, 250.0)
    times, at = [], 0
    now = 0.0
    for stop in found.walk:
        now += rules.leg_seconds[at][stop]
        at = stop
        if stop == 2:
            times.append(now)
    assert times
    assert max(times) < 50.0
    waits = [times[0] - 10.0, *(after - before for before, after in itertools.pairwise(times))]
    assert found.waits[2] == max(*waits, 50.0 - times[-1])
    assert found.back is None


@settings(max_examples=60)
@given(graphs(), st.integers(0, 10**6))
def test_the_laps_of_a_walk_are_its_shortest_stretches_with_all_places(
    graph: PatrolGraph, seed: int
) -> None:
    draw = random.Random(seed)
    rules = rule_graph_of(graph, 100.0, default_ranks(graph), 0)
    count = rules.count
    walk = draw.choices(range(count), k=draw.randint(1, 4 * count))
    expected = []
    for end in range(len(walk)):
        starts = [s for s in range(end + 1) if len(set(walk[s : end + 1])) == count]
        # None that is shorter ends sooner.
        if starts and (not expected or max(starts) > expected[-1][0]):
            expected.append((max(starts), end))
    assert list(rules.cycles_in(walk)) == [tuple(walk[s : e + 1]) for s, e in expected]
    # Only the end of a long walk counts.
    assert list(rules.cycles_in([0] * (4 * count) + [*range(count)] * 4)) == list(
        rules.cycles_in([*range(count)] * 4)
    )


@pytest.mark.parametrize('seed', range(3))
def test_ways_on_a_large_map_are_those_of_a_small_one(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph = hall(5, 4, seed)
    small = rule_graph_of(graph, 100.0, default_ranks(graph), 0)
    energy = Energy(graph, [Charger('P0000')], Draw(0.1), 0.0, BatteryLimits())
    charged = rule_graph_of(graph, 100.0, default_ranks(graph), 0, energy=energy)
    for reach in (200, 3):
        monkeypatch.setattr('patrol_policy.graph.ALL_PAIRS_UP_TO', 5)
        monkeypatch.setattr('patrol_policy.rule_graph.LOCAL_REACH', reach)
        other = PatrolGraph(graph.leg_seconds, graph.exploration_seconds)
        energy = Energy(other, [Charger('P0000')], Draw(0.1), 0.0, BatteryLimits())
        large = rule_graph_of(other, 100.0, default_ranks(other), 0, energy=energy)
        for stop, target in itertools.product(range(21), repeat=2):
            assert large.away[stop][target] == pytest.approx(charged.away[stop][target])
        assert small.path(7, 7) == large.path(7, 7) == []
        for stop, target in itertools.permutations(range(20), 2):
            assert small.path(stop, target) == large.path(stop, target)
            assert large.hop(stop, target) == small.hop(stop, target)
            walked = sum(
                small.leg_seconds[a][b]
                for a, b in itertools.pairwise([stop, *large.path(stop, target)])
            )
            assert walked == pytest.approx(small.away[stop][target])
        for stop in range(20):
            near = sorted(set(range(20)) - {stop}, key=lambda o: small.away[stop][o])[:8]
            assert small.near(stop) == large.near(stop) == near
        assert large.path(3, 20) == [20] == charged.path(3, 20)
        assert large.near(20) == large.near(0)


@st.composite
def worlds_of_rules(draw: st.DrawFn) -> Situation:
    """Draw what a robot knows: classes, waits, thresholds of some places, what it avoids."""
    graph = draw(graphs())
    kinds = [frozenset({'A'}), frozenset({'B'}), frozenset({'A', 'B'}), frozenset({'C'})]
    classes = {place: draw(st.sampled_from(kinds)) for place in graph.places}
    seen = {place: 100.0 - draw(st.integers(0, 90)) for place in graph.places}
    own = draw(st.dictionaries(st.sampled_from(graph.places), st.sampled_from([7.5, math.inf])))
    threshold = draw(st.sampled_from([10.5, 50.5]))
    rules = tuple(draw(st.permutations(['URGENT', 'A', 'B'])))[: draw(st.integers(0, 3))]
    urgent = {
        place: frozenset({'URGENT'})
        if 100.0 - seen[place] > own.get(place, threshold)
        else frozenset()
        for place in graph.places
    }
    here = draw(st.sampled_from(graph.places))
    closed = draw(st.sets(st.sampled_from(graph.places), max_size=2)) - {here}
    return Situation(
        place=here,
        now=100.0,
        reachable=tuple(graph.leg_seconds[here]),
        classes={place: classes[place] | urgent[place] for place in graph.places},
        visited_at=seen,
        graph=graph,
        threshold=threshold,
        own_thresholds=own,
        avoided=frozenset(draw(st.sets(st.sampled_from(graph.places), max_size=2))),
        priorities=Priorities(rules),
        openings=Openings(
            dict.fromkeys(closed, 'closed'),
            frozenset(),
            {},
            opens_in=dict.fromkeys(closed, 0.5),
            windows=dict.fromkeys(closed, ((100.5, 9_000.0),)),
        ),
    )


def state_of(rules: RuleGraph, known: Situation) -> PatrolState:
    index = known.graph.index
    seen = [known.visited_at[place] for place in known.graph.places]
    avoided = frozenset(index[place] for place in known.avoided)
    return PatrolState(index[known.place], known.now, seen, [True] * rules.count, avoided)


@settings(max_examples=150)
@given(worlds_of_rules())
def test_a_plan_may_enter_what_the_rules_allow(known: Situation) -> None:
    rules = rule_graph(known)
    places = [rules.graph.places[place] for place in rules.allowed(state_of(rules, known))]
    try:
        _, allowed = candidates(known)
    except NowhereToGoError:
        allowed = ()
    assert sorted(places) == list(allowed)
    if allowed:
        index, graph = known.graph.index, known.graph
        choice = graph.places[oldest(rules, state_of(rules, known))]
        longest = max(known.idleness_of(place) for place in allowed)
        assert choice in allowed
        assert known.idleness_of(choice) == longest
        ahead = graph.places[lookahead(rules, state_of(rules, known))]
        assert ahead in allowed

        def worth(place: str) -> float:
            way = rules.leg_seconds[index[known.place]][index[place]]
            return max(
                known.idleness_of(other) - way - graph.seconds(place, other)
                for other in graph.places
                if other != known.place
            )

        assert worth(ahead) == pytest.approx(max(map(worth, allowed)))
    else:
        assert oldest(rules, state_of(rules, known)) == index_of_place(known)
        assert lookahead(rules, state_of(rules, known)) == index_of_place(known)


def index_of_place(known: Situation) -> int:
    return known.graph.index[known.place]


def test_the_rules_of_a_world_become_ranks() -> None:
    classes = {
        'C1': frozenset({'CORRIDOR', 'ROOM'}),
        'R1': frozenset({'ROOM', 'URGENT'}),
        'R2': frozenset({'CELLAR'}),
    }
    asked = world(
        classes=classes,
        priorities=Priorities(('URGENT', 'CORRIDOR', 'ROOM')),
        own_thresholds={'R1': 9.0},
    )
    rules = rule_graph(asked)
    index = asked.graph.index
    assert [rules.table.base[index[place]] for place in ('C1', 'R1', 'R2', 'E')] == [1, 2, 3, 3]
    assert set(rules.table.urgent) == {0}
    assert [rules.table.limits[index[place]] for place in ('C1', 'R1')] == [60.0, 9.0]
    assert not rule_graph(replace(asked, priorities=Priorities(('ROOM',)))).table.has_urgent
    # Nothing is URGENT then, whatever waits.
    assert rule_graph(replace(asked, priorities=Priorities(('ROOM',)))).held_periods == {}


def test_what_opens_after_the_time_that_a_plan_knows_is_not_known() -> None:
    asked = world(now=1000.0)
    ahead = 1000.0 + asked.look_ahead
    assert asked.look_ahead == pytest.approx(3.0 * asked.graph.cheapest_entries)

    def windows(*stretches: tuple[float, float]) -> object:
        openings = Openings({}, frozenset(), {}, windows={'R1': stretches, 'R99': stretches})
        return rule_graph(replace(asked, openings=openings)).windows

    at = asked.graph.index['R1']
    assert windows((900.0, ahead)) == {at: ((900.0, ahead),)}
    assert windows((900.0, ahead + 1.0)) == {}
    assert windows((900.0, 1100.0), (ahead, ahead + 9.0)) == {
        at: ((900.0, 1100.0), (ahead, math.inf))
    }
    assert windows((900.0, 1100.0), (ahead + 1.0, ahead + 9.0)) == {at: ((900.0, 1100.0),)}
    # What has changed by now changes no more.
    assert windows((900.0, 1000.0)) == {}
    assert windows((1000.0, ahead + 9.0)) == {}


def charged(reach: float = 200.0, stations: tuple[str, ...] = ('E',)) -> RuleGraph:
    graph = seven_rooms()
    energy = Energy(
        graph,
        [Charger(place, ChargeCurve.even(2.0), 3.0) for place in stations],
        Draw(90.0 / reach),
        0.0,
        BatteryLimits(0.0, 90.0, 5.0),
    )
    return rule_graph_of(graph, 60.0, default_ranks(graph), 0, energy=energy)


def test_a_move_takes_time_and_charge_and_a_charge_gives_it_back() -> None:
    rules = charged()
    energy, index = rules.energy, rules.graph.index
    assert energy is not None
    state = PatrolState(index['C1'], 10.0, [0.0] * 7, [True] * 7, level=60.0)
    leg = rules.graph.leg_seconds['C1']['R1'] + 2.0
    assert rules.go(state, index['R1']) == state.now == 10.0 + leg
    assert state.place == index['R1']
    assert state.level == pytest.approx(60.0 - energy.draw * leg)
    begun = state.now
    drive = rules.graph.leg_seconds['C1']['R1'] + rules.graph.leg_seconds['C1']['E'] + 3.0
    arrived = rules.go(state, 7)
    assert arrived == pytest.approx(begun + drive)
    level = 60.0 - energy.draw * (leg + drive)
    # It charges with 2 %/s, and drives the last 3 s back.
    assert state.now == pytest.approx(arrived + (90.0 - level) / 2.0 + 3.0)
    assert state.place == index['E']
    assert state.level == 90.0
    full = PatrolState(index['E'], 0.0, [0.0] * 7, [True] * 7, level=100.0)
    rules.go(full, 7)
    assert full.level == pytest.approx(100.0 - 3.0 * energy.draw)
    assert math.isinf(rules.go(replace(full, place=index['R1']), index['R2']))


def test_a_robot_goes_where_it_comes_home_from_else_it_charges() -> None:
    rules = charged(stations=('E', 'R4'))
    energy, index = rules.energy, rules.graph.index
    assert energy is not None
    goal = index['R2']
    way = rules.away[index['C1']][goal]
    least = energy.least[goal] + energy.draw * way
    enough = PatrolState(index['C1'], 0.0, [0.0] * 7, [True] * 7, level=least + 1e-9)
    low = replace(enough, level=least - 1e-6)
    assert rules.affords(enough, goal)
    assert not rules.affords(low, goal)
    assert rules.guarded(enough, goal) == goal
    # The nearest station is in E, the first of two.
    assert rules.guarded(low, goal) == 7 == rules.charge_from(index['C1'])
    assert rules.charge_from(index['C2']) == 8
    assert rules.affords(low, 7)
    assert rules.guarded(low, index['C1']) == index['C1']
    # At the station with a full charge nothing helps.
    stuck = replace(low, place=index['E'], level=90.0)
    far = charged(reach=20.0)
    assert far.guarded(stuck, index['R2']) == index['E']
    assert far.guarded(replace(stuck, level=89.0), index['R2']) == 7
    without = rule_graph_of(rules.graph, 60.0, default_ranks(rules.graph), 0)
    assert without.charge_from(0) == -1
    assert without.affords(low, goal)


def test_slack_is_how_much_later_than_others_a_place_may_be_visited() -> None:
    graph = chain(4)
    plain = rule_graph_of(graph, 50.0, default_ranks(graph), 0)
    assert (plain.is_even, plain.slack) == (True, [0.0] * 4)
    own = rule_graph_of(graph, 50.0, default_ranks(graph), 0, {1: 80.0, 2: math.inf, 3: 20.0})
    assert not own.is_even
    # What never is URGENT waits as long as the longest of the others.
    assert own.slack == [30.0, 60.0, 60.0, 0.0]
    never = rule_graph_of(graph, math.inf, default_ranks(graph), 0)
    assert (never.is_even, never.slack) == (False, [0.0] * 4)
    # Out of reach of the charge.
    far = Energy(graph, [Charger('P0')], Draw(2.5), 0.0, BatteryLimits(0.0, 90.0, 5.0))
    reached = rule_graph_of(graph, 50.0, default_ranks(graph), 0, energy=far)
    assert reached.wanted == [0, 1, 2]
    assert reached.slack == [0.0, 0.0, 0.0, math.inf, 0.0]
    assert reached.is_even


def test_ends_of_corridors_are_held_until_they_are_urgent() -> None:
    graph = chain(4)
    rules = rule_graph_of(graph, 50.0, default_ranks(graph), 0, {3: math.inf})
    assert rules.gates == [1, -1, -1, 2]
    assert rules.held_periods == {0: pytest.approx(57.0, abs=0.01)}
    assert rules.least_period == pytest.approx(57.0, abs=0.01)
    assert rules.mean_leg == 7.0
    # Where URGENT does not come before the others, nothing is held for it.
    assert rule_graph_of(graph, 50.0, default_ranks(graph), None).gates == [-1] * 4
    assert rule_graph_of(graph, 50.0, [2, 1, 1, 1], 0).gates == [1, -1, -1, -1]
    assert rule_graph_of(graph, 50.0, [1, 1, 1, 1], 0).gates == [-1] * 4
    even = rule_graph_of(graph, 50.0, [1, 1, 1, 1], 0)
    assert (even.least_period, even.least_wait, even.least_cycle) == (0.0, 0.0, graph.tour.length)
    held = rule_graph_of(graph, 50.0, default_ranks(graph), 0)
    assert held.least_cycle == held.least_period == held.least_wait
    # The place with the longest period has more time.
    later = rule_graph_of(graph, 50.0, default_ranks(graph), 0, {0: 70.0})
    assert later.least_period == pytest.approx(77.0, abs=0.01)
    assert later.least_wait == pytest.approx(57.0, abs=0.01)


def test_any_station_is_afforded() -> None:
    rules = charged(stations=('E', 'R4'))
    low = PatrolState(rules.graph.index['C1'], 0.0, [0.0] * 7, [True] * 7, level=1.0)
    assert rules.affords(low, 7)
    assert rules.affords(low, 8)
    assert rules.guarded(low, 8) == 8


@st.composite
def patrolled_maps(draw: st.DrawFn) -> tuple[RuleGraph, PatrolState]:
    """Draw a map with rules and thresholds that differ, and where a patrol stands on it."""
    graph = draw(graphs(most=6))
    count = len(graph.places)
    ranks = draw(st.lists(st.integers(1, 3), min_size=count, max_size=count))
    own = draw(st.dictionaries(st.integers(0, count - 1), st.sampled_from([20.0, 90.0])))
    rules = rule_graph_of(graph, draw(st.sampled_from([15.0, 60.0, 200.0])), ranks, 0, own)
    seen = [-float(draw(st.integers(0, 80))) for _ in range(count)]
    met = draw(st.lists(st.booleans(), min_size=count, max_size=count))
    return rules, PatrolState(draw(st.integers(0, count - 1)), 0.0, seen, met)


@settings(max_examples=30)
@given(patrolled_maps(), st.sampled_from([oldest, lookahead]))
def test_a_walk_ahead_comes_to_what_walking_it_comes_to(
    drawn: tuple[RuleGraph, PatrolState], choose: Choice
) -> None:
    rules, begin = drawn
    before = replace(begin, seen=begin.seen.copy(), met=begin.met.copy())
    found = roll_out(rules, choose, begin, 600.0)
    assert begin == before, 'the state is not changed'
    now, place, seen, met = 0.0, begin.place, begin.seen.copy(), begin.met.copy()
    settled, first, waits, gaps = 0.0, 0.0, [0.0] * rules.count, []
    for stop in found.walk:
        now += rules.leg_seconds[place][stop]
        wait = now - seen[stop]
        waits[stop] = max(waits[stop], wait)
        gaps.append(wait - rules.slack[stop])
        if met[stop]:
            settled = max(settled, gaps[-1])
        else:
            first = max(first, gaps[-1])
        seen[stop], met[stop], place = now, True, stop
    if found.back is None:
        assert now >= 600.0
        for each in range(rules.count):
            waits[each] = max(waits[each], now - seen[each])
            settled = max(settled, now - seen[each] - rules.slack[each])
        lasting = settled
    else:
        # From there on it does the same again, in steps as long as before.
        lap = found.walk[found.back :]
        assert lap
        state = PatrolState(place, now, seen.copy(), met)
        for stop in lap:
            assert rules.guarded(state, choose(rules, state)) == stop
            rules.go(state, stop)
            state.seen[stop] = state.now
        assert state.place == place
        lasting = max(gaps[found.back :])
    assert found.settled == pytest.approx(settled)
    assert found.first == pytest.approx(max(first, settled))
    assert found.lasting == pytest.approx(lasting)
    assert found.waits == pytest.approx(waits)
    assert not found.cut


def test_a_walk_ahead_is_cut_where_there_is_no_time_or_it_takes_too_many_moves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = chain(3)
    rules = rule_graph_of(graph, 100.0, [1, 1, 1], 9)
    begin = PatrolState(0, 0.0, [0.0] * 3, [False] * 3)
    draw = random.Random(2)

    def wander(_: RuleGraph, state: PatrolState) -> int:
        # Never the same state again.
        state.position = draw.randrange(10**9)
        return 1 if state.place != 1 else draw.choice((0, 2))

    looks: list[int] = []

    def late() -> bool:
        looks.append(1)
        return len(looks) > 2

    found = roll_out(rules, wander, begin, 1e9, late=late)
    assert (found.cut, len(found.walk)) == (True, 2 * 64)
    monkeypatch.setattr('patrol_policy.rollout.MOST_MOVES', 10)
    monkeypatch.setattr('patrol_policy.rollout.MOVES_A_PLACE', 2)
    found = roll_out(rules, wander, begin, 1e9)
    assert (found.cut, len(found.walk)) == (True, 16)
    # It may be repeated from where all places come behind it.
    assert found.back is None
    start = found.repeated_from(rules)
    assert start is not None
    assert set(found.walk[start:]) == {0, 1, 2}
    assert set(found.walk[start + 1 :]) < {0, 1, 2}
    assert replace(found, walk=[1, 0, 1]).repeated_from(rules) is None
    assert replace(found, walk=[1, 0, 1], back=1).repeated_from(rules) == 1
    # Who stays stays for good.
    still = roll_out(rules, lambda _, state: state.place, begin, 500.0)
    assert (still.walk, still.settled, still.waits) == ([], 500.0, [500.0] * 3)
