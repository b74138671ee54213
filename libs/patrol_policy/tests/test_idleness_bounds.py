"""Idleness bounds in words, and decisions at their bounds."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from patrol_policy.battery import Battery, BatteryLimits, ChargeCurve, Draw
from patrol_policy.decision import (
    ANY,
    QUIET,
    RECHARGE,
    DecisionSettings,
    NowhereToGoError,
    OutOfRangeError,
    decide,
    energy_of,
    is_closed,
    planning_view,
    stations_within_reach,
    tour_warning,
    why_charge,
    why_closed,
    why_not,
)
from patrol_policy.graph import GraphError, PatrolGraph, graph_of_places
from patrol_policy.hours import Openings
from patrol_policy.idleness_bounds import (
    CLOSED,
    LATER,
    NEVER,
    UNKNOWN,
    WITHIN,
    IdlenessBound,
    idleness_bounds,
    lines,
    summary,
    verdicts,
)
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol, SimulatedBattery
from patrol_policy.situation import PolicyMemory

from .test_plan import chain
from .worlds import seven_rooms, world


def bound(place: str, verdict: str, wait: float = 10.0, words: str = '') -> IdlenessBound:
    return IdlenessBound(place, verdict, 100.0, wait, words or f'{place}: {verdict}')


def test_the_first_line_is_for_all_and_what_is_alike_shares_one() -> None:
    assert lines([]) == ['there are no places to visit']
    assert lines([bound('A', WITHIN), bound('B', WITHIN)]) == [
        'all 2 places can be visited within their thresholds'
    ]
    told = [
        bound('A', WITHIN),
        bound('B', LATER, 124.6),
        bound('C', LATER, 110.0),
        bound('D', LATER, 125.1, 'D: late'),
        bound('E', NEVER, math.inf, 'E: never visited'),
        bound('F', NEVER, math.inf, 'F: never visited'),
    ]
    assert lines(told) == [
        '3 of 6 places can be visited within their thresholds or little later (B, C up to 25 %)',
        'D: late',
        'E, F: never visited',
    ]
    assert summary(told) == '; '.join(lines(told))
    assert verdicts([*told, bound('G', UNKNOWN), bound('H', CLOSED)]) == {
        'A': WITHIN, 'B': WITHIN, 'C': WITHIN, 'D': LATER, 'E': NEVER, 'F': NEVER, 'H': CLOSED,
    }  # fmt: skip
    many = [bound(f'P{number}', NEVER, math.inf, f'P{number}: x') for number in range(10)]
    assert lines(many[:8])[1] == 'P0, P1, P2, P3, P4, P5, P6, P7: x'
    assert lines(many[:9])[1] == 'P0, P1, P2, P3, P4, P5, P6, P7 and 1 more: x'
    assert lines(many)[0] == '0 of 10 places can be visited within their thresholds'


def told_of(patrol: Patrol, place: str) -> IdlenessBound:
    found = idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
    return next(each for each in found if each.place == place)


def test_an_idleness_bound_says_by_how_much_a_place_is_late() -> None:
    graph = chain(3)
    # There and back takes 28 s; the ends are entered when they are URGENT only.
    for rules, threshold, verdict, words in (
        (
            Priorities(()),
            30.0,
            WITHIN,
            'P0: visited every 28 s at the latest, within its threshold of 30 s',
        ),
        (
            Priorities(()),
            28.0,
            WITHIN,
            'P0: visited every 28 s at the latest, within its threshold of 28 s',
        ),
        (
            Priorities(()),
            20.0,
            LATER,
            'P0: visited every 28 s at the latest, 8 s later than its threshold of 20 s',
        ),
        (Priorities(()), math.inf, WITHIN, 'P0: visited every 28 s at the latest'),
    ):
        told = told_of(Patrol(graph, rules, 'tour', threshold, 'P1'), 'P0')
        assert (told.verdict, told.words, told.threshold) == (verdict, words, threshold)
        assert told.wait == pytest.approx(28.0)
    # A place that never is URGENT is not entered where others always come before it.
    rules = Priorities(('URGENT', 'CORRIDOR', 'ROOM'))
    graph = chain(4)
    told = told_of(Patrol(graph, rules, 'tour', 10.0, 'P1', own_thresholds={'P0': math.inf}), 'P0')
    assert told.verdict == UNKNOWN
    assert 'none of the ways that were looked at leads there' in told.words
    unplanned = Patrol(graph, rules, 'oldest', 10.0, 'P1')
    told = told_of(unplanned, 'P0')
    assert told.verdict == UNKNOWN
    assert told.words == (
        'P0: it is not known when it is visited, the policy oldest plans nothing ahead'
    )


def test_an_idleness_bound_says_why_a_place_is_never_visited() -> None:
    settings = DecisionSettings(policy='tour', recharge_rooms=('E',))
    seen = world(openings=Openings({'R1': 'it is a keep-out place'}, frozenset(), {}))

    def words(**changes: object) -> dict[str, str]:
        battery = changes.pop('battery', Battery())
        assert isinstance(battery, Battery)
        found = idleness_bounds(replace(seen, **changes), battery, settings, ('R9',))  # type: ignore[arg-type]
        return {each.place: each.words for each in found}

    told = words()
    assert told['R1'] == 'R1: never visited, it is a keep-out place'
    assert told['R9'] == 'R9: never visited, no open door leads to it'
    shut = Openings({'C2': 'closed'}, frozenset(), {})
    told = words(openings=shut)
    assert told['R3'] == (
        'R3: not visited now, the way there leads through a place that may not be entered'
    )
    low = Battery(80.0, draw=Draw(0.1))
    far = replace(settings, recharge_rooms=('R9',))
    found = idleness_bounds(seen, low, far)
    assert 'never visited, no charging place can be reached' in found[-1].words
    # Nowhere would a second station help where the first one is all that the charge reaches.
    tight = Battery(80.0, draw=Draw(9.0), curves={'E': ChargeCurve.even(1.0)})
    told = words(battery=tight)
    assert told['R4'].endswith('; no second station within reach would do')


def test_a_threshold_is_warned_of_below_the_tour_and_not_at_it() -> None:
    assert tour_warning(60.0, 60.0) == ''
    assert tour_warning(60.0, 59.9).startswith('urgency_threshold is 59.9 s')


def test_a_place_is_entered_if_it_can_be_left_in_time() -> None:
    graph = seven_rooms()
    # From C1 to R1: 3 s of driving, 2 s of exploring, 3 s back.
    for closes, closed in ((8.1, False), (8.0, True), (5.0, True)):
        seen = world(openings=Openings({}, frozenset(), {'R1': closes}))
        assert is_closed(seen, 'R1') == closed
        slow = replace(seen, time_spread=0.1)
        assert is_closed(slow, 'R1') == (closes < 8.0 * 1.2326)
    seen = world(openings=Openings({}, frozenset(), {'R1': 8.0, 'R9': 1.0}))
    assert why_closed(seen, 'R1') == 'it closes in 8 s, and a visit takes up to 8 s'
    assert why_closed(seen, 'R9') == ''
    assert why_closed(replace(seen, place='R9'), 'R1') == ''
    assert graph.longest_exit('R1') == 3.0
    assert PatrolGraph({'A': {}}).longest_exit('A') == 0.0


def test_classes_follow_own_thresholds_and_hours() -> None:
    limits = {'E': 10.0, 'C2': 20.0, 'R4': 5.0}
    seen = world(own_thresholds=limits, said={'R1': True, 'R2': True}, since=98.0)
    # E was visited 10 s ago, C2 20 s; of R4 no visit is known.
    assert not seen.is_urgent('E')
    assert not seen.is_urgent('R4')
    later = replace(seen, now=100.1)
    assert later.is_urgent('E')
    assert later.is_urgent('C2')
    optional = replace(later, openings=Openings({}, frozenset({'E', 'R1'}), {}))
    assert not optional.is_urgent('E')
    assert not optional.is_urgent('R1')
    charged = planning_view(optional, Battery(40.0), DecisionSettings())
    assert charged.level == 40.0
    found = {place: charged.threshold_of(place) for place in ('E', 'C2', 'R4', 'R1')}
    assert found == {'E': math.inf, 'C2': 20.0, 'R4': 5.0, 'R1': math.inf}
    assert planning_view(seen, Battery(), DecisionSettings()).level == 100.0


def test_what_opens_within_the_time_that_a_plan_knows_stays_on_the_map() -> None:
    seen = world()
    ahead = seen.look_ahead
    for opens, kept in ((ahead, True), (ahead + 1.0, False)):
        shut = Openings({'R4': 'closed', 'R9': 'closed'}, frozenset(), {}, opens_in={'R4': opens})
        known = replace(seen, openings=shut)
        graph = planning_view(known, Battery(), DecisionSettings()).graph
        assert ('R4' in graph.index) == kept
    memory = PolicyMemory()
    one = memory.without(seen.graph, frozenset({'R4', 'C1'}), 'C1')
    assert set(one.places) == set(seen.graph.places) - {'R4'}
    assert memory.without(seen.graph, frozenset({'R4', 'C1'}), 'C1') is one
    assert memory.without(seen.graph, frozenset({'R4'}), 'E') is one
    parted = memory.without(seen.graph, frozenset({'C2'}), 'R4')
    assert parted.places == ('R4',)
    assert 'R1' in memory.without(seen.graph, frozenset({'C2'}), 'R1').index


def test_what_the_charge_comes_to_is_kept_while_nothing_changes() -> None:
    settings = DecisionSettings(recharge_rooms=('E', 'R4', 'R9'))
    battery = Battery(50.0, draw=Draw(0.1))
    seen = world()
    energy = energy_of(seen, battery, settings)
    assert energy is not None
    assert energy_of(replace(seen, time_spread=0.004), battery, settings) is energy
    assert energy_of(replace(seen, time_spread=0.006), battery, settings) is not energy
    assert [seen.graph.places[place] for place in energy.stations] == ['E', 'R4']
    assert energy_of(seen, Battery(draw=Draw(0.1)), settings) is None
    assert energy_of(seen, Battery(50.0), settings) is None
    assert energy_of(seen, battery, DecisionSettings(recharge_rooms=('R9',))) is None
    avoided = energy_of(replace(seen, avoided=frozenset({'E'})), battery, settings)
    assert avoided is not None
    assert [seen.graph.places[place] for place in avoided.stations] == ['R4']
    assert len(seen.memory.energy) == 2
    assert stations_within_reach(seen, ('R9', 'R4', 'E')) == {
        'E': pytest.approx(math.dist((10, 8), (5, 10))),
        'R4': pytest.approx(6.0 + math.dist((10, 14), (15, 15))),
    }


def test_a_robot_charges_below_what_the_way_home_takes_and_never_above_full() -> None:
    limits = BatteryLimits(20, 90, 5)
    settings = DecisionSettings(battery=limits)
    assert why_charge(world(), Battery(20.0), settings) == ''
    assert why_charge(world(), Battery(19.9), settings).startswith(
        'the battery is at 19.9 %, below'
    )
    assert why_charge(world(), Battery(low=True), settings) == (
        'the battery is low (level unknown)'
    )
    home = math.dist((10, 8), (5, 10))
    need = 4.0 * home + 5.0
    battery = Battery(need + 0.01, draw=Draw(4.0))
    assert why_charge(world(), battery, settings) == ''
    low = replace(battery, level=need - 0.01)
    assert f'below {need:.1f} % (home takes {home:.1f} s at 4 %/s' in why_charge(
        world(), low, settings
    )
    # What the way takes may be more than a charge gives: then a full charge is enough.
    assert why_charge(world(), Battery(90.0, draw=Draw(40.0)), settings) == ''
    assert 'below 90.0 %' in why_charge(world(), Battery(89.9, draw=Draw(40.0)), settings)


def test_where_a_full_charge_suffices_for_no_place_the_robot_stays() -> None:
    settings = DecisionSettings(priorities=Priorities(()), battery=BatteryLimits(0, 90, 5))
    graph = seven_rooms(60.0)
    seen = world(place='E', reachable=('C1', 'C2'), graph=graph, level=90.0)
    decision = decide(seen, Battery(90.0, draw=Draw(1.5)), settings)
    assert (decision.rule, decision.place) == (QUIET, 'E')
    assert decision.reason == (
        'a full charge of 90 % suffices for no place within reach: the robot stays at its station '
        'in E'
    )
    assert decide(seen, Battery(90.0, draw=Draw(0.5)), settings).rule == ANY
    assert issubclass(OutOfRangeError, NowhereToGoError)


def test_a_robot_goes_to_charge_before_a_place_that_it_could_not_come_home_from() -> None:
    settings = DecisionSettings(
        priorities=Priorities(()), policy='oldest', battery=BatteryLimits(0, 90, 5)
    )
    graph = seven_rooms(10.0)
    seen = world(place='C1', graph=graph, visited_at={'C1': 100.0, 'C2': 0.0, 'E': 90.0})
    way, home = graph.move('C1', 'C2'), math.dist((10, 14), (5, 10))
    need = way + home + 5.0
    enough = decide(seen, Battery(need + 0.01, draw=Draw(1.0)), settings)
    assert (enough.place, enough.rule) == ('C2', ANY)
    lacking = decide(seen, Battery(need - 0.01, draw=Draw(1.0)), settings)
    assert (lacking.place, lacking.rule) == ('E', RECHARGE)
    assert 'a visit of C2 would leave' in lacking.reason
    told = why_not('C2', seen, Battery(need - 0.01, draw=Draw(1.0)), settings)
    assert told.sentence.startswith('the robot goes to E [recharge]: ')


def test_a_place_beside_the_robot_that_is_not_entered_says_why() -> None:
    seen = world(openings=Openings({'R1': 'it is closed'}, frozenset(), {}))
    told = why_not('R1', seen, Battery(), DecisionSettings(policy='oldest'))
    assert told.sentence == 'R1 is not entered: it is closed; the robot goes to R2 [URGENT]'
    avoided = replace(world(), avoided=frozenset({'R1'}))
    told = why_not('R1', avoided, Battery(), DecisionSettings(policy='oldest'))
    assert told.sentence.startswith('R1 could not be reached lately and is avoided for now; ')
    one = world(
        classes={'R2': frozenset({'URGENT'})},
        said=dict.fromkeys(world().graph.places, False) | {'R2': True},
    )
    told = why_not('E', one, Battery(), DecisionSettings(policy='oldest'))
    assert 'E is not URGENT (last visit 10.0 s ago, threshold 60 s), but R2 is; ' in told.sentence
    decision = decide(one, Battery(), DecisionSettings(policy='oldest'))
    assert 'R2 (last visit 90.0 s ago, threshold 60 s) is the only reachable URGENT place' in (
        decision.reason
    )


def test_bad_maps_are_named_and_points_may_be_driven_at_any_speed() -> None:
    with pytest.raises(GraphError, match=r'A to B takes 0\.0 s, expected more than 0'):
        PatrolGraph({'A': {'B': 0.0}, 'B': {'A': 1.0}})
    with pytest.raises(GraphError, match='A to B takes inf s'):
        PatrolGraph({'A': {'B': math.inf}, 'B': {'A': 1.0}})
    assert PatrolGraph({'A': {'B': 0.0}, 'B': {'A': 1.0}}, 0.5).move('A', 'B') == 0.5
    own = PatrolGraph({'A': {'B': 1.0}, 'B': {'A': 1.0}}, 0.5, {'B': 9.0})
    assert (own.move('A', 'B'), own.move('B', 'A')) == (10.0, 1.5)
    graph = graph_of_places(
        {'A': ['B', 'X'], 'B': ['A']}, {'A': (0, 0, 5), 'B': (3, 4, 9)}, 2.0, 1.0
    )
    assert graph.leg_seconds == {'A': {'B': 2.5}, 'B': {'A': 2.5}}
    assert graph.cheapest_entries == 7.0
    away, leads = chain(4).drive_home(['P0', 'P3'])
    assert (away, leads) == ([0.0, 5.0, 5.0, 0.0], [0, 0, 3, 3])
    away, leads = PatrolGraph({'A': {}, 'B': {}}).drive_home(['A'])
    assert (away, leads) == ([0.0, math.inf], [0, -1])
    cut = chain(4).without_leg('P1', 'P2')
    assert cut.connected('P0').places == ('P0', 'P1')
    assert chain(4).restricted(['P0', 'P2', 'P3']).leg_seconds['P2'] == {'P3': 5.0}
    with pytest.raises(GraphError, match='no tour leads through all places'):
        _ = cut.tour


def test_a_simulated_patrol_counts_waits_charges_and_an_empty_battery() -> None:
    graph = chain(2)
    patrol = Patrol(graph, Priorities(()), 'oldest', 10.0, 'P0')
    for _ in patrol.until(70.0):
        pass
    run = patrol.run
    assert (run.moves, run.longest, run.settled) == (10, 14.0, 14.0)
    # Each place waits 0 to 14 s again and again.
    assert run.mean == pytest.approx(7.0, abs=0.5)
    assert run.rules == {'any': 10}
    empty = SimulatedBattery(10.0, 5.0, BatteryLimits(0, 90, 0), keeps_reserve=False)
    patrol = Patrol(graph, Priorities(()), 'oldest', 10.0, 'P0', empty)
    for _ in patrol.until(70.0):
        pass
    assert patrol.run.strandings > 0
    assert patrol.level >= 0.0
    careful = Patrol(
        graph,
        Priorities(()),
        'oldest',
        10.0,
        'P0',
        SimulatedBattery(2.0, 5.0, BatteryLimits(20, 90, 5)),
    )
    for _ in range(12):
        careful.step()
    assert careful.run.strandings == 0
    assert careful.run.recharges == careful.run.rules[RECHARGE] > 0
    with pytest.raises(ValueError, match='oldest has no plan'):
        _ = careful.planner
