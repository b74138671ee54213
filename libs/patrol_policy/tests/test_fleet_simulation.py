"""A fleet in simulated time by policies of a few lines, and what charging costs it at least."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import pytest

from patrol_policy.battery import BatteryLimits, ChargeCurve, Charger, Draw, Energy
from patrol_policy.decision import DecisionSettings
from patrol_policy.fleet import (
    FleetChoice,
    FleetOutlook,
    FleetRobot,
    FleetSettings,
    PartitionCell,
    exact_wait,
    fleet_plan,
)
from patrol_policy.fleet.charging_bound import charging_wait
from patrol_policy.fleet.docks import DockSlot
from patrol_policy.fleet.simulation import FleetBattery, FleetPatrol, FleetView, Outage
from patrol_policy.graph import PatrolGraph
from patrol_policy.idleness_bounds import fleet_waits
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import Situation
from patrol_policy.tour import tour_length

from .test_assignment import random_map, ring
from .test_plan import chain

ROW = chain(4)
"""P0 to P3, 7 s each."""


def test_a_charge_takes_as_long_as_what_is_missing_and_lasts_no_longer_than_a_full_one() -> None:
    battery = FleetBattery(600.0, 120.0)
    assert battery.needed(700.0, 100.0) == 0.0
    assert battery.needed(400.0, 100.0) == 60.0
    assert battery.needed(100.0, 100.0) == battery.needed(50.0, 100.0) == 120.0
    assert battery.needed(900.0, 100.0) == 0.0
    # A charge of 60 s that ends at 500 s: it had lasted until 440 s, or 100 s longer.
    assert battery.runs_until(440.0, 60.0, 500.0) == 500.0 + 300.0
    assert battery.runs_until(540.0, 60.0, 500.0) == 500.0 + 400.0
    assert battery.runs_until(300.0, 60.0, 500.0) == 500.0 + 300.0
    assert battery.runs_until(900.0, 60.0, 500.0) == 500.0 + 600.0


def staying(until: float | None) -> Any:
    def policy(view: FleetView, name: str) -> FleetChoice:
        return FleetChoice(view.robots[name].place, until, None, 'it stays')

    return policy


def test_who_stays_decides_anew_when_it_said_or_a_second_later() -> None:
    for until, times in ((None, [0.0, 1.0, 2.0]), (1.5, [0.0, 1.5, 2.5]), (0.0, [0.0, 1.0, 2.0])):
        run = FleetPatrol(ROW, {'a': 'P1'}, staying(until))
        run.until(2.75)
        assert [at for at, _, _ in run.decisions] == times
        assert run.visits == [(at, 'a', 'P1') for at in times]
        assert run.now == 2.75
        # It ends before what is due then.
        run.until(times[-1] + 1.0)
        assert len(run.decisions) == 3


def test_nothing_waits_where_a_robot_stands_unless_that_has_failed() -> None:
    starts = {'a': 'P0', 'b': 'P3'}
    run = FleetPatrol(ROW, starts, staying(1000.0), outages=[Outage('b', 40.0)])
    run.until(100.0)
    assert run.longest_waits(10.0) == {'P0': 0.0, 'P1': 90.0, 'P2': 90.0, 'P3': 90.0}
    assert run.longest_waits(10.0, 60.0) == {'P0': 0.0, 'P1': 50.0, 'P2': 50.0, 'P3': 50.0}
    assert run.longest(10.0) == 90.0
    back = FleetPatrol(ROW, starts, staying(1000.0), outages=[Outage('b', 40.0, 70.0)])
    back.until(100.0)
    assert back.longest_waits(10.0)['P3'] == 0.0


def driving(*ways: str) -> Any:
    """Return a policy by which each robot goes from place to place, then stays."""
    left = {
        name: way.split() for name, *way_of in (way.split(' ', 1) for way in ways) for way in way_of
    }

    def policy(view: FleetView, name: str) -> FleetChoice:
        here = view.robots[name].place
        place = left[name].pop(0) if left.get(name) else here
        return FleetChoice(place, view.now + 500.0, None, 'it was told')

    return policy


def test_a_way_is_driven_place_by_place_and_each_counts_as_visited() -> None:
    run = FleetPatrol(ROW, {'a': 'P0', 'b': 'P3'}, driving('a P2 P1', 'b P2'))
    run.until(100.0)
    # Where it decides a place counts as visited once more.
    assert list(dict.fromkeys(run.visits)) == [
        (0.0, 'a', 'P0'),
        (0.0, 'b', 'P3'),
        (7.0, 'a', 'P1'),
        (7.0, 'b', 'P2'),
        (14.0, 'a', 'P2'),
        (21.0, 'a', 'P1'),
    ]
    assert run.visited_at == {'P0': 0.0, 'P1': 21.0, 'P2': 14.0, 'P3': 0.0}
    # From 10 s on: P1 waits from there to 21 s, P0 to the end; in P1 and P2 somebody stands.
    assert run.longest_waits(10.0) == {'P0': 90.0, 'P1': 11.0, 'P2': 4.0, 'P3': 90.0}


def test_who_fails_on_its_way_begins_anew_where_it_was_and_is_heard_of_no_more() -> None:
    heard: list[tuple[float, float, float, Any]] = []

    def policy(view: FleetView, name: str) -> FleetChoice:
        if name == 'b':
            robot = view.robots['a']
            heard.append((view.now, robot.heard_at, robot.heard_since, robot.cell))
        if name == 'a' and view.now < 1.0:
            return FleetChoice('P3', None, PartitionCell(('P0', 'P3'), 'P3'), 'far')
        return FleetChoice(view.robots[name].place, view.now + 5.0, None, 'it stays')

    run = FleetPatrol(ROW, {'a': 'P0', 'b': 'P3'}, policy, outages=[Outage('a', 10.0, 30.0)])
    run.until(41.0)
    assert list(dict.fromkeys(visit for visit in run.visits if visit[1] == 'a')) == [
        (0.0, 'a', 'P0'), (7.0, 'a', 'P1'), (30.0, 'a', 'P1'), (35.0, 'a', 'P1'), (40.0, 'a', 'P1'),
    ]  # fmt: skip
    by_time = {at: rest for at, *rest in heard}
    cell = PartitionCell(('P0', 'P3'), 'P3')
    assert by_time[5.0] == [5.0, -math.inf, cell]
    assert by_time[10.0] == by_time[25.0] == [10.0, -math.inf, cell], 'since it fell silent'
    assert by_time[35.0] == [35.0, 30.0, None]


def charging(begin: float, end: float) -> Any:
    """Return a policy by which each robot charges in P0 once, from its place."""

    sent: set[str] = set()

    def policy(view: FleetView, name: str) -> FleetChoice:
        if name in sent:
            return FleetChoice(view.robots[name].place, view.now + 500.0, None, 'it stays')
        sent.add(name)
        return FleetChoice('P0', None, None, 'it charges', DockSlot(name, 'P0', begin, end))

    return policy


def test_robots_charge_one_after_another_and_no_longer_than_they_need() -> None:
    battery = FleetBattery(100.0, 50.0)
    run = FleetPatrol(ROW, {'a': 'P1', 'b': 'P2'}, charging(3.0, 90.0), battery=battery)
    assert run.settings.charge_ratio == 0.5
    run.until(60.0)
    # a comes at 7 s and lacks 7 s of 100; b at 14 s, when a is gone.
    assert [each[:2] for each in run.charges] == [('a', 'P0'), ('b', 'P0')]
    assert [each[2:] for each in run.charges] == [pytest.approx((7.0, 10.5)), (14.0, 21.0)]
    assert run.strandings == 0
    later = FleetPatrol(ROW, {'a': 'P1', 'b': 'P2'}, charging(30.0, 32.0), battery=battery)
    later.until(60.0)
    # Both wait for their slots; b comes after a.
    assert later.charges[0] == ('a', 'P0', 30.0, 45.0)
    assert later.charges[1][:3] == ('b', 'P0', 45.0)
    # A slot at the dock where a robot stands already is no longer than it says.
    here = FleetPatrol(ROW, {'a': 'P0'}, charging(40.0, 42.0), battery=battery)
    here.until(60.0)
    assert here.charges == [('a', 'P0', 40.0, 42.0)]


def test_a_battery_that_was_empty_on_the_way_is_counted() -> None:
    for run_seconds, strandings in ((13.9, 1), (14.0, 0), (6.9, 2)):
        battery = FleetBattery(run_seconds, 1.0)
        run = FleetPatrol(ROW, {'a': 'P2'}, charging(0.0, 90.0), battery=battery)
        run.until(14.5)
        assert run.strandings == strandings


def partitions(places: list[int]) -> Iterator[list[list[int]]]:
    """Yield all ways to part places into groups."""
    if not places:
        yield []
        return
    first, *rest = places
    for others in partitions(rest):
        yield [[first], *others]
        for number, group in enumerate(others):
            yield [*others[:number], [first, *group], *others[number + 1 :]]


def shortest(graph: PatrolGraph, places: set[int]) -> float:
    first, *rest = sorted(places)
    orders = itertools.permutations(rest)
    return min(tour_length(graph.distances, (first, *order)) for order in orders)


def least_wait(
    graph: PatrolGraph, robots: int, docks: list[str], run: float, charge: float
) -> float:
    """Return the bound as the docstring has it, over all partitions, by trying waits."""
    count, ratio = len(graph.places), charge / run
    rows = [graph.index[dock] for dock in docks]

    def needed(group: list[int], wait: float) -> float:
        tour = shortest(graph, set(group))
        through = min(shortest(graph, {*group, row}) for row in rows)
        kept = 1.0 if through * (1.0 + ratio) <= wait * (1.0 + 1e-9) else math.inf
        several = max(2.0, math.ceil(tour * (1.0 + ratio) / wait - 1e-9))
        moving, away = max(1.0, tour / wait), through - tour
        relieved = moving * (run + charge) / (run - away) if run > away else math.inf
        return min(kept, several, relieved)

    cut = list(partitions(list(range(count))))

    def suffices(wait: float) -> bool:
        return min(sum(needed(g, wait) for g in groups) for groups in cut) <= robots + 1e-9

    low, high = 1e-3, graph.tour.length * (1.0 + ratio)
    while high - low > 1e-5 * high:
        middle = (low + high) / 2.0
        low, high = (low, middle) if suffices(middle) else (middle, high)
    return high


@pytest.mark.parametrize(('seed', 'robots'), [(1, 1), (1, 2), (2, 3), (3, 2), (3, 4)])
def test_the_bound_with_charging_is_the_least_over_all_partitions(seed: int, robots: int) -> None:
    graph = random_map(seed, 4)
    tour = graph.tour.length
    docks = ['P0', 'P3'][: 1 + seed % 2]
    for run, charge in ((3.0 * tour, tour), (1.5 * tour, 0.2 * tour)):
        plain = max(least_wait(graph, robots, docks, run, charge), exact_wait(graph, robots))
        assert charging_wait(graph, robots, docks, run, charge) == pytest.approx(plain, rel=4e-4)


def test_a_bound_needs_a_dock_and_times_above_zero() -> None:
    graph = ring(6)
    for docks, run, charge in (([], 9.0, 9.0), (['P00'], 0.0, 9.0), (['P00'], 9.0, 0.0)):
        with pytest.raises(ValueError, match='expected each above 0'):
            charging_wait(graph, 1, docks, run, charge)
    # Little of everything is something.
    assert charging_wait(graph, 1, ['P00'], 900.0, 0.5) == pytest.approx(60.0, rel=1e-2)
    assert charging_wait(graph, 1, ['P00'], 1.0, 0.5) == pytest.approx(90.0, rel=1e-3)
    # On a larger map the cuts of its tour are looked at, which are the same on a ring.
    for robots in (1, 2):
        small = charging_wait(ring(10), robots, ['P00'], 400.0, 100.0) / 100.0
        large = charging_wait(ring(12), robots, ['P00'], 480.0, 120.0) / 120.0
        assert large == pytest.approx(small, rel=2e-2)


def fleet_world(threshold: float, *places: str, priorities: Priorities | None = None) -> Any:
    """Return the outlook of a fleet on a ring with two rooms behind it, and its settings."""
    legs = {name: dict(ways) for name, ways in ring(6).leg_seconds.items()}
    for room, door in (('R1', 'P00'), ('R2', 'P03')):
        legs[room] = {door: 10.0}
        legs[door][room] = 10.0
    graph = PatrolGraph(legs)
    robots = tuple(
        FleetRobot(f'robot{number}', place, heard_at=0.0) for number, place in enumerate(places)
    )
    world = Situation(
        place=places[0],
        now=0.0,
        reachable=tuple(graph.leg_seconds[places[0]]),
        classes={p: frozenset({'ROOM' if p[0] == 'R' else 'CORRIDOR'}) for p in graph.places},
        visited_at={},
        graph=graph,
        threshold=threshold,
        fleet=FleetOutlook('robot0', robots, graph),
    )
    return world, DecisionSettings(priorities=priorities or Priorities())


def test_a_fleet_waits_for_what_the_rules_hold_back_until_that_is_urgent() -> None:
    # All that the rules let everybody enter: robots pass at equal distances.
    world, settings = fleet_world(100.0, 'P00', 'P03', priorities=Priorities(()))
    tour = world.graph.tour.length
    assert tour == 100.0
    plan = fleet_plan(world.graph, 2)
    waits = {stop: group.wait for group in plan.groups for stop in group.stops}
    assert fleet_waits(world, settings) == pytest.approx(waits)
    # Too many decisions to rehearse: the threshold, and a round of whoever has it then.
    world, settings = fleet_world(9000.0, 'P00', 'P03')
    found = fleet_waits(world, settings)
    for place, wait in waits.items():
        assert found[place] == pytest.approx(9000.0 + 2 * wait), place
    # Where nothing is URGENT, corridors come first for ever, and rooms after them never.
    world, settings = fleet_world(
        9000.0, *['P00'] * 17, priorities=Priorities(('CORRIDOR', 'ROOM'))
    )
    found = fleet_waits(world, settings)
    assert all(math.isfinite(found[place]) for place in found if place[0] == 'P')
    assert math.isinf(found['R1'])
    assert math.isinf(found['R2'])


def test_what_is_rehearsed_is_what_comes() -> None:
    world, settings = fleet_world(60.0, 'P00', 'P03')
    found = fleet_waits(world, settings)
    assert set(found) == set(world.graph.places)
    # Rooms are entered when they are URGENT: no sooner, and hardly later.
    for room in ('R1', 'R2'):
        assert 60.0 < found[room] <= 60.0 + 2.0 * 70.0
    assert max(found[place] for place in found if place[0] == 'P') <= 100.0
    # With a battery that lasts long the same, with a weak one longer.
    energy = Energy(
        world.graph, [Charger('P00', ChargeCurve.even(1.0))], Draw(0.05), 0.0, BatteryLimits()
    )
    assert fleet_waits(world, settings, energy) == found, 'there is no dock'
    docked = FleetSettings(docks=('P00', 'X'), charge_ratio=0.5)
    charged = Situation(
        **{
            **{name: getattr(world, name) for name in world.__dataclass_fields__},
            'fleet': FleetOutlook('robot0', world.fleet.robots, world.graph, docked),
        }
    )
    weak = Energy(
        world.graph, [Charger('P00', ChargeCurve.even(1.0))], Draw(0.25), 0.0, BatteryLimits()
    )
    assert max(fleet_waits(charged, settings, weak).values()) > max(found.values())
