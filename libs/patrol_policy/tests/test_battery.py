"""The charge: what must be left for the way home, how long charging takes, plans that know it."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from patrol_policy.battery import (
    Battery,
    BatteryLimits,
    ChargeCurve,
    Charger,
    Draw,
    Energy,
    seconds_to_station,
)
from patrol_policy.decision import RECHARGE
from patrol_policy.graph import PatrolGraph
from patrol_policy.idleness_bounds import LATER, NEVER, WITHIN, idleness_bounds, summary
from patrol_policy.lower_bounds import charge_bound
from patrol_policy.rule_graph import RuleGraph
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol, SimulatedBattery

from .worlds import default_ranks, rule_graph_of, seven_rooms


def test_what_must_be_left_is_what_driving_home_takes() -> None:
    graph = seven_rooms(300.0)
    energy = Energy(graph, [Charger('E')], Draw(1.0), 0.0, BatteryLimits(0, 90, 5))
    home = graph.leg_seconds['R4']['C2'] + graph.leg_seconds['C2']['E']
    # Nothing is explored on the way home.
    assert energy.least[graph.index['R4']] == pytest.approx(home + 5.0)
    assert energy.out_seconds[graph.index['R4']] == pytest.approx(home + 600.0)
    assert not energy.within_range[graph.index['R4']]


def test_a_station_far_from_its_places_point_costs_the_way_there_and_back() -> None:
    graph, limits, draw = seven_rooms(), BatteryLimits(0, 90, 5), Draw(1.0)
    near = Energy(graph, [Charger('E')], draw, 0.0, limits)
    far = Energy(
        graph, [Charger('E', approach=20.0), Charger('C2', approach=500.0)], draw, 0, limits
    )
    at = graph.index['R4']
    assert far.home_seconds[at] == pytest.approx(near.home_seconds[at] + 20.0)
    assert far.least[at] == pytest.approx(near.least[at] + 20.0)
    assert far.out_seconds[at] == pytest.approx(near.out_seconds[at] + 20.0)
    assert [far.stations[number] for number in far.home] == [graph.index['E']] * 7


def test_the_level_of_the_seeds_stays_the_floor() -> None:
    graph = seven_rooms()
    energy = Energy(graph, [Charger('E')], Draw(0.1), 0.0, BatteryLimits(20, 90, 5))
    assert set(energy.least) == {20.0}


def test_a_charge_takes_what_was_learned_of_each_part_of_it() -> None:
    curve = ChargeCurve((1.0,) * 16 + (0.25,) * 4)
    assert curve.seconds(20.0, 80.0) == pytest.approx(60.0)
    assert curve.seconds(70.0, 90.0) == pytest.approx(10.0 + 40.0)
    assert curve.seconds(90.0, 70.0) == 0.0


def test_the_fastest_part_of_a_charge_ends_where_the_charge_does() -> None:
    graph = seven_rooms()
    # In parts of 5 %: what is faster above the full level is not used.
    curve = ChargeCurve((1.0,) * 17 + (4.0,) + (9.0,) * 2)
    energy = Energy(graph, [Charger('E', curve)], Draw(0.1), 0.0, BatteryLimits(0, 90, 5))
    assert energy.fastest == pytest.approx(4.0)
    slow = ChargeCurve((1.0,) * 18 + (9.0,) * 2)
    energy = Energy(graph, [Charger('E', slow)], Draw(0.1), 0.0, BatteryLimits(0, 90, 5))
    assert energy.fastest == pytest.approx(1.0)


def test_a_charge_from_any_level_takes_what_the_curve_says() -> None:
    curve = ChargeCurve((1.0,) * 16 + (0.25,) * 4)
    graph, limits = seven_rooms(), BatteryLimits(10, 87, 5)
    energy = Energy(graph, [Charger('R1'), Charger('E', curve)], Draw(0.1), 0.0, limits)
    for level in (0.0, 0.5, 30.25, 79.5, 80.0, 86.5, 87.0, 95.0):
        assert energy.charge_seconds(1, level) == pytest.approx(curve.seconds(level, 87.0))
    assert energy.charge_seconds(1, -4.0) > energy.charge_seconds(1, 0.0)
    # Of a station that was never used, a charge is taken to be three times as fast as the draw.
    assert energy.charge_seconds(0, 57.0) == pytest.approx(30.0 / 0.3)
    # From the least level up by the slower one, and down again.
    assert energy.cycle_seconds == pytest.approx(77.0 / 0.1 + 77.0 / 0.3)
    assert ChargeCurve.even(0.0) == ChargeCurve()


def test_the_time_at_a_dock_for_each_second_away_counts_the_way_to_it() -> None:
    graph, limits = seven_rooms(), BatteryLimits(20, 90, 5)
    station = Charger('E', ChargeCurve((2.0,) * 16 + (0.5,) * 4), 6.0)
    energy = Energy(graph, [station], Draw(0.5), 0.0, limits)
    # 10 % are made good with 0.5 %/s.
    assert energy.charge_ratio(20.0) == pytest.approx((20.0 + 12.0) / 20.0)
    assert energy.charge_ratio(40.0) == pytest.approx((20.0 + 5.0 + 12.0) / 40.0)
    # No more than the charge between full and least: 70 % in 140 s.
    assert energy.charge_ratio(500.0) == pytest.approx((20.0 + 30.0 + 12.0) / 140.0)
    assert energy.charge_ratio(0.5) == pytest.approx((0.5 + 12.0) / 0.5)
    assert energy.charge_ratio(0.0) == 0.0
    unknown = Energy(graph, [Charger('E', station.curve, math.inf)], Draw(0.5), 0.0, limits)
    assert unknown.charge_ratio(20.0) == 0.0


def test_of_uncertain_times_and_rates_99_of_100_ways_keep_to_what_is_reckoned_with() -> None:
    draw = random.Random(1)
    for rate, spread, time_spread, seconds in (
        (0.1, 0.2, 0.0, 20.0),
        (0.1, 0.2, 0.0, 400.0),
        (0.1, 0.0, 0.3, 100.0),
        (0.1, 0.2, 0.2, 100.0),
    ):
        falls = []
        for _ in range(4000):
            mean = rate * seconds * (1.0 + time_spread * draw.gauss(0.0, 1.0))
            # The rate deviates anew over each 2 % of the charge, and over the least as over those.
            parts = max(1.0, rate * seconds / 2.0)
            falls.append(mean + 2.0 * spread * math.sqrt(parts) * draw.gauss(0.0, 1.0))
        most = Draw(rate, spread).most(seconds, time_spread)
        assert most == pytest.approx(sorted(falls)[3960], rel=0.06)
    assert Draw(0.1).most(50.0, 0.0) == pytest.approx(5.0)


def test_a_plan_serves_until_the_battery_differs_by_a_tenth() -> None:
    graph = seven_rooms()

    def energy(rate: float = 0.1, charge: float = 1.0, *places: str, stop: float = 90.0) -> Energy:
        stations = [Charger(place, ChargeCurve.even(charge)) for place in places or ('E',)]
        return Energy(graph, stations, Draw(rate), 0.0, BatteryLimits(20, stop, 5))

    known = energy()
    assert known.alike(energy())
    assert not known.alike(None)
    for factor, alike in ((0.92, True), (1.08, True), (0.88, False), (1.12, False)):
        assert energy(0.1 * factor).alike(energy(0.1)) == (abs(1.0 / factor - 1.0) < 0.1)
        assert known.alike(energy(0.1 * factor)) == alike
        assert known.alike(energy(0.1, 1.0 / factor)) == alike
    assert not known.alike(energy(0.1, 1.0, 'E', 'R1'))
    assert not known.alike(energy(0.1, 1.0, 'R1'))
    assert not known.alike(energy(stop=80.0))
    both = energy(0.1, 1.0, 'E', 'R1')
    stations = [Charger('E', ChargeCurve.even(1.0)), Charger('R1', ChargeCurve.even(0.5))]
    assert not both.alike(Energy(graph, stations, Draw(0.1), 0.0, BatteryLimits(20, 90, 5)))


def test_a_robot_may_leave_the_station_when_it_is_charged_and_no_warning_is_up() -> None:
    limits = BatteryLimits(20, 90, 5)
    assert Battery(90.0).charged_enough(limits)
    assert not Battery(89.9).charged_enough(limits)
    assert Battery().charged_enough(limits)
    assert not Battery(95.0, low=True).charged_enough(limits)
    assert (Battery().level_text(), Battery(12.5).level_text()) == ('level unknown', '12.5 %')


def test_a_place_is_within_range_while_a_full_charge_leaves_what_it_must() -> None:
    graph = seven_rooms()
    for rate in (0.5, 1.0, 2.0, 3.0):
        energy = Energy(graph, [Charger('E')], Draw(rate), 0.1, BatteryLimits(10, 90, 5))
        for place, at in graph.index.items():
            out, home = energy.out_seconds[at], energy.home_seconds[at]
            assert energy.within_range[at] == energy.suffices(out, home)
            assert energy.least[at] == max(10.0, Draw(rate).most(home, 0.1) + 5.0)
            assert home == seconds_to_station(graph, place, ['E', 'NOWHERE'])
    only = Energy(PatrolGraph({'A': {}, 'B': {}}), [Charger('A')], Draw(0.1), 0.0, BatteryLimits())
    assert (only.home, only.within_range) == ([0, -1], [True, False])
    assert math.isinf(only.least[1])
    assert math.isinf(seconds_to_station(PatrolGraph({'A': {}, 'B': {}}), 'A', ['B']))


def test_battery_limits_out_of_order_are_named() -> None:
    with pytest.raises(ValueError, match=r'expected 0 <= battery_require_recharge < .* got 95 and'):
        BatteryLimits(95.0, 90.0)
    with pytest.raises(ValueError, match='expected 0 <= battery_require_recharge'):
        BatteryLimits(90.0, 90.0)
    with pytest.raises(ValueError, match='got -1 and 90'):
        BatteryLimits(-1.0, 90.0)
    with pytest.raises(ValueError, match=r'got 20 and 100\.5'):
        BatteryLimits(20.0, 100.5)
    assert BatteryLimits(0.0, 100.0).stop_recharge == 100.0


def patrolled(
    graph: PatrolGraph, factor: float, reach: float, charge: float, laps: float = 25.0
) -> Patrol:
    """Return a patrol that lasted for some laps; reach and charge are in tours."""
    tour = graph.tour.length
    battery = SimulatedBattery(100.0 / (reach * tour), 100.0 / (charge * tour))
    patrol = Patrol(graph, Priorities(), 'tour', factor * tour, graph.places[0], battery)
    patrol.level = battery.limits.stop_recharge
    for _ in patrol.until(laps * tour):
        pass
    return patrol


@pytest.mark.parametrize(('reach', 'stop'), [(1260.0, 300.0), (1980.0, 300.0), (660.0, 120.0)])
def test_a_short_range_leaves_no_room_unvisited(reach: float, stop: float) -> None:
    graph = seven_rooms(stop)
    patrol = Patrol(graph, Priorities(), 'tour', 240.0, 'E', SimulatedBattery(100.0 / reach, 0.2))
    for _ in patrol.until(4 * 3600.0):
        pass
    assert set(patrol.run.waits) == set(graph.places)
    assert patrol.run.settled < 3600.0
    assert patrol.run.strandings == 0


@pytest.mark.parametrize('seed', range(3))
def test_the_plan_comes_near_the_bound_that_knows_the_charge(seed: int) -> None:
    draw = random.Random(seed)
    graph = seven_rooms(draw.uniform(2.0, 300.0))
    reach, charge = draw.uniform(3.0, 12.0), draw.uniform(0.1, 2.0)
    patrol = patrolled(graph, draw.choice((0.5, 1.0)), reach, charge)
    rules = patrol.world().memory.planner.rule_graph
    bound = charge_bound(rules, states=20_000)
    patrol.run.settled = 0.0  # What came before is the way into the round.
    for _ in patrol.until(2.0 * patrol.now):
        pass
    assert bound.low <= patrol.run.settled * 1.001
    assert patrol.run.settled <= 1.1 * bound.low


def shortest_lawful_wait(rules: RuleGraph, most: int) -> float:
    """Return the least longest wait of all periodic walks of up to so many stops, by trying all."""
    energy, best = rules.energy, math.inf
    assert energy is not None
    stops = range(rules.count + len(energy.stations))
    for size in range(2, most + 1):
        for walk in itertools.product(stops, repeat=size):
            places = [rules.places[stop] for stop in walk]
            if walk[0] < rules.count or set(places) != set(range(rules.count)):
                continue  # Each begins with a charge.
            seen, level, now, longest = dict.fromkeys(places, -math.inf), energy.full, 0.0, 0.0
            place, lawful = places[-1], True
            for lap, (step, stop) in itertools.product(range(3), enumerate(walk)):
                if stop < rules.count and stop not in rules.leg_seconds[place]:
                    lawful = False
                    break
                if stop < rules.count:
                    ways = rules.leg_seconds[place]
                    ranked = {
                        o: 0 if now - seen[o] > rules.table.limits[o] else rules.table.base[o]
                        for o in ways
                    }
                    lawful = lap == 0 or ranked[stop] == min(ranked.values())
                    now += ways[stop]
                    level -= energy.draw * ways[stop]
                    lawful = lawful and level >= energy.least[stop]
                else:
                    drive = energy.drive[0][place]
                    now += drive
                    level -= energy.draw * drive
                arrived = now
                if stop >= rules.count:
                    now += energy.charge_seconds(0, level)
                    level = energy.full
                place = places[step]
                if lap == 2:
                    longest = max(longest, arrived - seen[place])
                seen[place] = now
                if not lawful:
                    break
            best = min(best, longest) if lawful else best
    return best


TRIANGLE = {'A': {'B': 8.0, 'C': 9.0}, 'B': {'A': 8.0, 'C': 7.0}, 'C': {'A': 9.0, 'B': 7.0}}
DEAD_ENDS = {'A': {'B': 8.0, 'C': 9.0}, 'B': {'A': 8.0}, 'C': {'A': 9.0}}


@pytest.mark.parametrize(
    ('legs', 'ranks', 'reach', 'factor'),
    [
        (TRIANGLE, [1, 1, 1], 200.0, 0.5),
        (TRIANGLE, [1, 1, 1], 90.0, 0.5),
        (TRIANGLE, [1, 1, 1], 140.0, 1.0),
        # The way home needs more than the fixed 20 %, and so one charge for each place.
        (TRIANGLE, [1, 1, 1], 40.0, 0.5),
        # C is entered only when it is URGENT.
        (DEAD_ENDS, [1, 1, 2], 300.0, 1.05),
    ],
)
def test_the_bound_is_that_of_trying_all_walks(
    legs: dict[str, dict[str, float]], ranks: list[int], reach: float, factor: float
) -> None:
    graph = PatrolGraph(legs, 6.0)
    station = Charger('A', ChargeCurve.even(2.0))
    energy = Energy(graph, [station], Draw(100.0 / reach), 0.0, BatteryLimits())
    rules = rule_graph_of(graph, factor * graph.tour.length, ranks, 0, energy=energy)
    bound = charge_bound(rules)
    shortest = shortest_lawful_wait(rules, 6)
    assert bound.low <= shortest + 0.01
    assert bound.high == pytest.approx(shortest, rel=0.02)


def test_a_station_in_a_dead_end_is_entered_by_a_charge_before_it_is_urgent() -> None:
    legs = {'A': {'B': 8.0}, 'B': {'A': 8.0, 'C': 7.0}, 'C': {'B': 7.0, 'D': 9.0}, 'D': {'C': 9.0}}
    graph = PatrolGraph(legs, 6.0)
    station = Charger('A', ChargeCurve.even(4.0))
    energy = Energy(graph, [station], Draw(0.2), 0.0, BatteryLimits())
    rules = rule_graph_of(graph, 5.0 * graph.tour.length, default_ranks(graph), 0, energy=energy)
    # D waits for its threshold, A does not: the robot charges there.
    assert list(rules.held_periods) == [graph.index['D']]


def test_the_idleness_bound_is_what_comes() -> None:
    for seed in range(3):
        draw = random.Random(seed)
        graph = seven_rooms(draw.uniform(2.0, 300.0))
        patrol = patrolled(graph, 0.9, draw.uniform(2.0, 15.0), draw.uniform(0.1, 2.0), 3.0)
        told = idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
        assert all(each.verdict in (WITHIN, LATER) for each in told)
        patrol.run.waits.clear()
        for _ in range(200):
            patrol.step()
        for each in told:
            assert patrol.run.waits[each.place] <= each.wait + 1e-3
            # The place of the station, too: it is visited when the charge begins.
            assert each.verdict == WITHIN or patrol.run.waits[each.place] > each.threshold


def test_it_says_beforehand_which_place_is_never_visited_and_what_would_help() -> None:
    graph = seven_rooms(300.0)
    patrol = Patrol(graph, Priorities(), 'tour', 240.0, 'E', SimulatedBattery(100.0 / 860.0, 1.0))
    told = {
        each.place: each
        for each in idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
    }
    assert told['R4'].verdict == NEVER
    assert 'R4: never visited, out takes 612 s and home 12 s, which needs 91 % of charge' in (
        told['R4'].words
    )
    assert 'a second station in C2 would do' in told['R4'].words
    assert told['C1'].verdict == LATER
    assert 'R4: never visited' in summary(tuple(told.values()))
    for _ in patrol.until(3600.0):
        pass
    assert patrol.run.strandings == 0
    assert set(patrol.run.waits) >= {'C1', 'C2', 'E', 'R1', 'R3'}


def test_a_planned_charge_says_so_in_its_reason() -> None:
    patrol = patrolled(seven_rooms(60.0), 0.5, 6.0, 0.5, 2.0)
    reasons = [d.reason for d in (patrol.step() for _ in range(40)) if d.rule == RECHARGE]
    assert reasons
    assert all('a charge in C1 costs least now, at ' in reason for reason in reasons)
