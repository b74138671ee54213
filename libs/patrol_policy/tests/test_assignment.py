"""Several robots share a map: what each does follows from what all publish."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.battery import Battery
from patrol_policy.decision import DecisionSettings, decide
from patrol_policy.fleet import (
    ChargeNeed,
    FleetError,
    FleetOutlook,
    FleetRobot,
    FleetSettings,
    PartitionCell,
    assign,
    choose,
    dock_slots,
    exact_wait,
    fleet_plan,
)
from patrol_policy.fleet.charging_bound import charging_wait
from patrol_policy.fleet.ruled import ruled
from patrol_policy.fleet.simulation import FleetBattery, FleetPatrol, Outage
from patrol_policy.graph import PatrolGraph, graph_of_places
from patrol_policy.hours import Openings
from patrol_policy.idleness_bounds import idleness_bounds
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import Situation

from .worlds import seven_rooms, world


def far_wings(places: int = 4) -> PatrolGraph:
    """Return two wings of places 2 s apart with a way of 100 s between them."""
    lefts = {'A': 0.0, 'B': 106.0}
    points = {f'{w}{n}': (x + 2.0 * n, 0.0) for w, x in lefts.items() for n in range(places)}
    ways: dict[str, list[str]] = {name: [] for name in points}
    for one, other in itertools.pairwise(points):
        ways[one].append(other)
        ways[other].append(one)
    return graph_of_places(ways, points)


def ring(places: int) -> PatrolGraph:
    names = [f'P{number:02}' for number in range(places)]
    return PatrolGraph(
        {
            name: {names[(number + 1) % places]: 10.0, names[number - 1]: 10.0}
            for number, name in enumerate(names)
        }
    )


def fleet(*places: str, now: float = 0.0) -> list[FleetRobot]:
    return [FleetRobot(f'robot{n + 1}', place, heard_at=now) for n, place in enumerate(places)]


def random_map(seed: int, places: int) -> PatrolGraph:
    draw = random.Random(seed)
    points = {f'P{n}': (draw.uniform(0, 50), draw.uniform(0, 50)) for n in range(places)}
    pairs = [(n, draw.randrange(n)) for n in range(1, places)]
    pairs += [tuple(draw.sample(range(places), 2)) for _ in range(places // 3)]  # type: ignore[misc]
    ways: dict[str, set[str]] = {name: set() for name in points}
    for one, other in pairs:
        ways[f'P{one}'].add(f'P{other}')
        ways[f'P{other}'].add(f'P{one}')
    return graph_of_places(ways, points, exploration_seconds=1.0)


@given(st.integers(0, 10_000), st.integers(2, 7), st.integers(1, 5))
def test_a_plan_has_each_place_once_and_keeps_between_the_optimum_and_one_tour(
    seed: int, places: int, robots: int
) -> None:
    graph = random_map(seed, places)
    plan = fleet_plan(graph, robots)
    assert sorted(stop for group in plan.groups for stop in group.stops) == sorted(graph.places)
    assert sum(group.robots for group in plan.groups) == robots
    assert plan.wait <= graph.tour.length / robots + 1e-6
    assert plan.wait >= exact_wait(graph, robots) - 1e-6


def test_far_wings_get_robots_of_their_own() -> None:
    plan = fleet_plan(far_wings(), 2)
    assert {frozenset(group.stops) for group in plan.groups} == {
        frozenset({'A0', 'A1', 'A2', 'A3'}),
        frozenset({'B0', 'B1', 'B2', 'B3'}),
    }
    assert plan.wait == pytest.approx(12.0) == exact_wait(far_wings(), 2)


def test_the_order_of_the_facts_does_not_matter_and_shares_do_not_overlap() -> None:
    graph, robots = ring(12), fleet('P00', 'P00', 'P03', 'P07')
    cells = assign(graph, robots, 0.0).cells
    assert assign(graph, robots[::-1], 0.0).cells == cells
    assert len({cell.stop for cell in cells.values()}) == len(robots)


def test_robots_that_start_together_spread_and_reach_the_plan() -> None:
    graph = ring(12)
    run = FleetPatrol(graph, dict.fromkeys(('robot1', 'robot2', 'robot3'), 'P00'))
    run.until(1000.0)
    assert run.longest(400.0) == pytest.approx(40.0)


def test_a_lost_robots_places_are_visited_and_it_gets_a_share_again() -> None:
    graph = far_wings()
    starts = {'robot1': 'A0', 'robot2': 'B0'}
    run = FleetPatrol(graph, starts, outages=[Outage('robot2', 200.0, 900.0)])
    run.until(900.0)
    after = [(at, place) for at, robot, place in run.visits if robot == 'robot1' and at > 200.0]
    assert {'B0', 'B1', 'B2', 'B3'} <= {place for _, place in after}
    reasons = [choice.reason for at, _, choice in run.decisions if at > 210.0]
    assert any('is mine: robot2 was last heard at 00:03' in reason for reason in reasons)
    run.until(2000.0)
    assert run.longest(1500.0) == pytest.approx(fleet_plan(graph, 2).wait)


def test_a_silent_robot_loses_its_share_with_the_next_decision() -> None:
    settings = FleetSettings(silent_after=10.0)
    robots = fleet('A0', 'B0', now=100.0)
    silent = replace(robots[1], heard_at=89.0)
    assert set(assign(far_wings(), robots, 100.0, settings).cells) == {'robot1', 'robot2'}
    assignment = assign(far_wings(), [robots[0], silent], 100.0, settings)
    assert set(assignment.cells) == {'robot1'}
    assert len(assignment.cells['robot1'].tour) == 8


def test_a_reason_names_the_robot_that_is_charging() -> None:
    graph = far_wings()
    cells = assign(graph, fleet('A0', 'B0', now=60.0), 60.0).cells
    robots = [replace(robot, cell=cells[robot.name]) for robot in fleet('A0', 'B0', now=60.0)]
    robots[1] = replace(robots[1], charging_until=50_700.0)
    robots[0] = replace(robots[0], place='A3')
    found = []
    for _ in range(8):
        choice = choose(graph, robots, 'robot1', 60.0)
        found.append(choice.reason)
        robots[0] = replace(robots[0], place=choice.place, cell=choice.cell)
    assert 'B0 is mine: robot2 is charging until 14:05' in found


def test_who_has_a_share_keeps_it_when_another_one_joins() -> None:
    graph = ring(12)
    robots = fleet('P02', 'P08')
    tour = fleet_plan(graph, 2).groups[0].stops
    robots = [replace(robot, cell=PartitionCell(tour, robot.place)) for robot in robots]
    cells = assign(graph, [*robots, FleetRobot('robot3', 'P05')], 0.0).cells
    assert [cells[robot.name] for robot in robots] == [robot.cell for robot in robots]
    assert cells['robot3'].tour == tour


def test_two_that_took_the_same_share_part_again() -> None:
    graph = far_wings()
    tour = next(g.stops for g in fleet_plan(graph, 2).groups if 'A0' in g.stops)
    robots = [replace(robot, cell=PartitionCell(tour, 'A0')) for robot in fleet('A0', 'A1')]
    cells = assign(graph, robots, 0.0).cells
    assert cells['robot1'].tour == tour
    assert 'B0' in cells['robot2'].tour


needs_of_robots = st.lists(st.tuples(st.floats(0, 1000), st.floats(1, 100)), max_size=8)


@given(needs_of_robots, st.integers(1, 3))
def test_slots_at_a_dock_do_not_overlap(wanted: list[tuple[float, float]], docks: int) -> None:
    needs = [ChargeNeed(f'robot{n}', *want) for n, want in enumerate(wanted)]
    slots = sorted(
        dock_slots(needs, [f'dock{n}' for n in range(docks)], 0.0).values(),
        key=lambda slot: (slot.dock, slot.begin),
    )
    assert len(slots) == len(needs)
    for before, after in itertools.pairwise(slots):
        assert before.dock != after.dock or before.end <= after.begin + 1e-6
    for need in needs:
        slot = next(slot for slot in slots if slot.robot == need.robot)
        assert slot.begin <= need.latest + slot.late + 1e-6


def test_robots_that_would_charge_together_charge_one_after_another() -> None:
    run = FleetPatrol(
        seven_rooms(),
        {'robot1': 'E', 'robot2': 'R1', 'robot3': 'R4'},
        settings=FleetSettings(docks=('E',)),
        battery=FleetBattery(run_seconds=600.0, charge_seconds=120.0),
    )
    run.until(5000.0)
    assert run.strandings == 0
    assert {robot for robot, *_ in run.charges} == {'robot1', 'robot2', 'robot3'}
    times = sorted((begin, end) for _, _, begin, end in run.charges)
    assert all(end <= begin + 1e-6 for (_, end), (begin, _) in itertools.pairwise(times))


@pytest.mark.parametrize('count', [2, 3, 4])
def test_robots_that_charge_keep_their_distances(count: int) -> None:
    graph = ring(12)
    run = FleetPatrol(
        graph,
        {f'robot{n}': 'P00' for n in range(count)},
        settings=FleetSettings(docks=('P05',)),
        battery=FleetBattery(run_seconds=500.0, charge_seconds=100.0),
    )
    run.until(4000.0)
    # Each round costs a fifth of its 120 s at the dock.
    assert run.longest(800.0) <= 1.03 * 120.0 * 1.2 / count
    assert run.strandings == 0
    assert {robot for robot, *_ in run.charges} == set(run.starts)


@pytest.mark.parametrize('count', [1, 2, 4, 7])
def test_no_patrol_is_below_the_bound_with_charging(count: int) -> None:
    graph = random_map(3, 7)
    tour = graph.tour.length
    bound = charging_wait(graph, count, ['P0'], 4.0 * tour, 0.5 * tour)
    plan = fleet_plan(graph, count, docks=['P0']).wait
    assert exact_wait(graph, count) <= bound <= 1.126 * plan
    run = FleetPatrol(
        graph,
        {f'robot{n}': 'P0' for n in range(count)},
        settings=FleetSettings(docks=('P0',)),
        battery=FleetBattery(4.0 * tour, 0.5 * tour),
    )
    run.until(12.0 * tour)
    assert run.longest(3.0 * tour) >= 0.999 * bound
    assert run.strandings == 0


def test_one_robots_bound_is_its_round_with_the_charge() -> None:
    for places in (8, 12):
        bound = charging_wait(ring(places), 1, ['P03'], 500.0, 100.0)
        assert bound == pytest.approx(10.0 * places * 1.2, rel=1e-3)


def test_each_tour_leads_through_a_dock_where_robots_charge() -> None:
    graph = far_wings()
    both = fleet_plan(graph, 4, docks=['A0', 'B3'])
    assert [{'A0', 'B3'} & set(group.stops) for group in both.groups] == [{'A0'}, {'B3'}]
    one = fleet_plan(graph, 2, docks=['A0'])
    assert all('A0' in group.stops for group in one.groups)
    assert {stop for group in one.groups for stop in group.stops} == set(graph.places)


def test_robots_with_docks_of_their_own_agree_on_the_groups() -> None:
    graph, every = far_wings(), ('A0', 'B3')
    robots = [replace(robot, runs_until=500.0) for robot in fleet('A0', 'A1', 'B2', 'B3')]
    plans = {
        assign(graph, robots, 0.0, FleetSettings(docks=every, own_docks=own)).plan
        for own in (None, ('A0',), ('B3',))
    }
    assert len(plans) == 1


def test_a_robot_charges_at_its_own_dock_alone() -> None:
    graph = ring(12)
    tour = fleet_plan(graph, 1).groups[0].stops
    settings = FleetSettings(docks=('P05', 'P09'), own_docks=('P05',), charge_ratio=0.5)
    for place, charges in (('P05', True), ('P09', False)):
        (here,) = fleet(place)
        low = replace(here, cell=PartitionCell(tour, place), runs_until=900.0, charge_seconds=60.0)
        choice = choose(graph, [low], low.name, 0.0, settings)
        assert (choice.slot is not None and choice.place == place) == charges
    # What does not wait for its tour leads to its own dock, too.
    (here,) = fleet('P09')
    empty = replace(here, cell=PartitionCell(tour, 'P09'), runs_until=1.0, charge_seconds=60.0)
    choice = choose(graph, [empty], empty.name, 0.0, settings)
    assert choice.place == 'P05'


def test_who_charges_as_planned_keeps_its_share_and_who_takes_long_does_not() -> None:
    graph, tour = ring(12), fleet_plan(ring(12), 1).groups[0].stops
    settings = FleetSettings(docks=('P05',), charge_ratio=0.2)
    robots = [
        replace(robot, cell=PartitionCell(tour, robot.place), runs_until=500.0)
        for robot in fleet('P05', 'P11')
    ]
    as_planned = replace(robots[0], dock='P05', charging_until=24.0)
    cells = assign(graph, [as_planned, robots[1]], 0.0, settings).cells
    assert cells == {'robot1': robots[0].cell, 'robot2': robots[1].cell}
    long = replace(robots[0], dock='P05', charging_until=97.0)
    assert set(assign(graph, [long, robots[1]], 0.0, settings).cells) == {'robot2'}
    # One whose charge makes no headway loses it, too.
    stuck = replace(as_planned, charging_until=104.0, heard_at=80.0)
    heard = replace(robots[1], heard_at=80.0)
    assert set(assign(graph, [stuck, heard], 80.0, settings).cells) == {'robot2'}


def test_who_is_at_its_stop_goes_to_the_next_and_who_is_not_goes_there_first() -> None:
    graph = ring(12)
    tour = fleet_plan(graph, 1).groups[0].stops
    there = [FleetRobot('robot1', tour[3], cell=PartitionCell(tour, tour[3]))]
    assert choose(graph, there, 'robot1', 0.0).cell == PartitionCell(tour, tour[4])
    away = [FleetRobot('robot1', tour[3], cell=PartitionCell(tour, tour[5]))]
    choice = choose(graph, away, 'robot1', 0.0)
    assert (choice.place, choice.cell) == (tour[5], PartitionCell(tour, tour[5]))


def test_only_who_is_at_its_stop_lets_the_robot_ahead_go_on() -> None:
    graph = ring(12)
    tour = fleet_plan(graph, 2, whole=True).groups[0].stops
    ahead = FleetRobot('robot2', tour[5], cell=PartitionCell(tour, tour[5]))
    there = FleetRobot('robot1', tour[4], cell=PartitionCell(tour, tour[4]))
    choice = choose(graph, [there, ahead], 'robot1', 0.0)
    assert (choice.place, choice.until) == (tour[4], pytest.approx(50.0))
    # Far enough behind it goes on.
    behind = replace(there, place=tour[11], cell=PartitionCell(tour, tour[11]))
    choice = choose(graph, [behind, ahead], 'robot1', 0.0)
    assert (choice.place, choice.until) == (tour[0], None)
    # On the way to its stop it has no place on the tour yet.
    away = replace(there, place=tour[4], cell=PartitionCell(tour, tour[3]))
    choice = choose(graph, [away, ahead], 'robot1', 0.0)
    assert (choice.place, choice.until) == (tour[3], None)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_one_robot_has_no_long_way_where_two_short_ones_would_do(seed: int) -> None:
    graph, draw = random_map(seed, 9), random.Random(seed)
    robots = fleet(*draw.choices(graph.places, k=3))
    stops = [cell.stop for cell in assign(graph, robots, 0.0).cells.values()]
    ways = [
        sum(
            graph.seconds(robot.place, stop) ** 2 for robot, stop in zip(robots, order, strict=True)
        )
        for order in itertools.permutations(stops)
    ]
    assert ways[0] == pytest.approx(min(ways))


@pytest.mark.parametrize(
    ('robots', 'shared'),
    [
        (1, ' s, each'),
        (2, ' s, shared with robot2, each'),
        (4, ' s, shared with robot2 and robot3 and robot4, each'),
        (5, ' s, shared with 4 others, each'),
    ],
)
def test_a_reason_says_with_whom_a_tour_is_shared(robots: int, shared: str) -> None:
    graph = ring(20)
    tour = fleet_plan(graph, robots, whole=True).groups[0].stops
    spaced = [tour[20 * number // robots] for number in range(robots)]
    fleet_of = [replace(robot, cell=PartitionCell(tour, robot.place)) for robot in fleet(*spaced)]
    assert shared in choose(graph, fleet_of, 'robot1', 0.0).reason


def test_a_plan_of_one_tour_or_of_one_robot_is_one_group() -> None:
    assert [group.robots for group in fleet_plan(far_wings(), 2, whole=True).groups] == [2]
    assert len(fleet_plan(far_wings(), 2, alone=True).groups) == 2
    assert len(fleet_plan(far_wings(), 1).groups) == 1
    only = PatrolGraph({'A': {}})
    for alone in (False, True):
        (group,) = fleet_plan(only, 3, alone=alone).groups
        assert (group.stops, group.robots) == (('A',), 3)


def test_what_does_not_fit_is_named() -> None:
    graph = ring(4)
    with pytest.raises(FleetError, match='robot9 is not in the fleet, expected one of robot1'):
        choose(graph, fleet('P00'), 'robot9', 0.0)
    with pytest.raises(FleetError, match='robot1 is at X, which is not a place of the map'):
        assign(graph, fleet('X'), 0.0)
    with pytest.raises(FleetError, match='robot1 stands twice'):
        assign(graph, fleet('P00') * 2, 0.0)
    with pytest.raises(ValueError, match='a plan for 0 robots: expected at least 1'):
        fleet_plan(graph, 0)


def fleet_world(robots: list[FleetRobot], **changes: object) -> Situation:
    """Return the seven rooms as the first of some robots knows them."""
    corridors = {'C1', 'C2', 'E'}
    graph = seven_rooms()
    return world(
        now=0.0,
        place=robots[0].place,
        reachable=tuple(graph.leg_seconds[robots[0].place]),
        graph=graph,
        threshold=40.0,
        classes={
            place: frozenset({'ROOM', 'CORRIDOR'} if place in corridors else {'ROOM'})
            for place in graph.places
        },
        fleet=FleetOutlook(robots[0].name, robots, graph, FleetSettings(docks=('E',))),
        **changes,
    )


def test_idleness_bounds_count_all_robots_and_their_charging() -> None:
    settings = DecisionSettings(priorities=Priorities(()))
    places = ('E', 'R1', 'R4')

    def waits(robots: list[FleetRobot], ratio: float = 0.0) -> set[float]:
        seen = fleet_world(robots)
        assert seen.fleet is not None
        changed = replace(seen.fleet.settings, charge_ratio=ratio)
        seen = replace(seen, fleet=replace(seen.fleet, settings=changed))
        return {each.wait for each in idleness_bounds(seen, Battery(), settings)}

    for count in (1, 3):
        robots = fleet(*places[:count])
        assert max(waits(robots)) == pytest.approx(fleet_plan(seven_rooms(), count).wait)
    robots = [replace(robot, runs_until=900.0) for robot in fleet(*places)]
    found = fleet_plan(seven_rooms(), 3, docks=['E']).wait
    assert max(waits(robots, 0.25)) == pytest.approx(1.25 * found)
    robots[1] = replace(robots[1], taken_out=True)
    seen = fleet_world(robots[:2])
    words = [each.words for each in idleness_bounds(seen, Battery(), settings)]
    assert all('by one of 1 robots' in each for each in words)


def test_a_fleets_idleness_bound_knows_the_rules() -> None:
    robots = fleet('E', 'R4')
    settings = DecisionSettings(priorities=Priorities(('URGENT', 'CORRIDOR', 'ROOM')))
    seen = fleet_world(robots)
    found = {each.place: each for each in idleness_bounds(seen, Battery(), settings)}
    # A room is entered when it is URGENT, not before.
    assert 40.0 < found['R1'].wait < 40.0 + seven_rooms().tour.length
    classes = {place: kinds - {'URGENT'} for place, kinds in seen.classes.items()}
    policy = ruled(classes, dict.fromkeys(classes, 40.0), settings)
    run = FleetPatrol(seven_rooms(), {'robot1': 'E', 'robot2': 'R4'}, policy)
    run.until(900.0)
    for place, wait in run.longest_waits(300.0).items():
        assert wait <= 1.1 * found[place].wait
    never = DecisionSettings(priorities=Priorities(('CORRIDOR', 'ROOM')))
    found = {each.place: each for each in idleness_bounds(seen, Battery(), never)}
    assert (found['R1'].verdict, found['C2'].verdict) == ('never', 'within')


@pytest.mark.parametrize('count', [1, 2, 4])
def test_with_rules_no_place_waits_for_ever(count: int) -> None:
    """A corridor of three, and rooms that only rooms lead to."""
    points = {'C1': (0, 0), 'C2': (5, 0), 'C3': (10, 0), 'R1': (0, 5), 'R2': (0, 10), 'R3': (10, 5)}
    doors = [('C1', 'C2'), ('C2', 'C3'), ('C1', 'R1'), ('R1', 'R2'), ('C3', 'R3')]
    ways: dict[str, list[str]] = {name: [] for name in points}
    for one, other in doors:
        ways[one].append(other)
        ways[other].append(one)
    graph = graph_of_places(ways, points, exploration_seconds=2.0)
    classes = {
        place: frozenset({'ROOM', 'CORRIDOR'} if place[0] == 'C' else {'ROOM'}) for place in points
    }
    settings = DecisionSettings(priorities=Priorities(('URGENT', 'CORRIDOR', 'ROOM')))
    policy = ruled(classes, dict.fromkeys(points, 120.0), settings)
    run = FleetPatrol(graph, {f'robot{n}': 'C1' for n in range(count)}, policy)
    run.until(2000.0)
    assert run.longest(400.0) < 120.0 + 2.0 * graph.tour.length


def test_what_two_leave_to_each_other_is_visited_when_it_is_overdue() -> None:
    graph = random_map(1, 10)
    classes = {
        place: frozenset({'ROOM', 'CORRIDOR'} if len(ways) > 2 else {'ROOM'})
        for place, ways in graph.leg_seconds.items()
    }
    tour = graph.tour.length
    settings = DecisionSettings(priorities=Priorities(('URGENT', 'CORRIDOR', 'ROOM')))
    for count in (3, 6):
        policy = ruled(classes, dict.fromkeys(classes, tour), settings)
        run = FleetPatrol(graph, {f'robot{n}': 'P0' for n in range(count)}, policy)
        run.until(8.0 * tour)
        assert run.longest(2.0 * tour) < 3.0 * tour


def test_what_is_overdue_is_driven_to_by_one_robot_alone() -> None:
    rules = DecisionSettings(priorities=Priorities(('URGENT', 'CORRIDOR')))
    tour = fleet_plan(seven_rooms(), 1).groups[0].stops
    ways = {'robot1': 'C1', 'robot2': 'C2'}

    def rule_of(name: str, stops: dict[str, str]) -> tuple[str, str]:
        """Return what a robot drives to where R4 is overdue and all else was just visited."""
        robots = [
            replace(robot, place=ways[robot.name], cell=PartitionCell(tour, stops[robot.name]))
            for robot in fleet('C1', 'C2')
        ]
        robots.sort(key=lambda robot: robot.name != name)
        seen = fleet_world(robots)
        seen = replace(seen, visited_at=dict.fromkeys(tour, 1000.0) | {'R4': 0.0}, now=1000.0)
        robots = [replace(robot, heard_at=1000.0) for robot in robots]
        assert seen.fleet is not None
        seen = replace(seen, fleet=replace(seen.fleet, robots=robots))
        made = decide(seen, Battery(), rules)
        return made.rule, made.target

    assert rule_of('robot1', {'robot1': 'R1', 'robot2': 'E'}) == ('share', 'R4')
    assert rule_of('robot1', {'robot1': 'R1', 'robot2': 'R4'})[1] != 'R4', 'robot2 drives there'
    assert rule_of('robot2', {'robot1': 'R1', 'robot2': 'R4'}) == ('share', 'R4')
    # Of two that drive there the nearer one goes on.
    assert rule_of('robot2', {'robot1': 'R4', 'robot2': 'R4'}) == ('share', 'R4')


def test_a_fleet_enters_nothing_that_is_closed_and_passes_over_what_is_for_long() -> None:
    graph = seven_rooms()
    tour = fleet_plan(graph, 1).groups[0].stops
    for rules, shut, opens_in, here, stop in itertools.product(
        ((), ('URGENT', 'CORRIDOR')),
        ('C1', 'C2', 'R4'),
        ({}, {'C1': 5.0, 'C2': 5.0, 'R4': 5.0}),
        ('E', 'C1', 'C2'),
        tour,
    ):
        if here == shut:
            continue
        robots = [
            replace(robot, heard_at=1000.0, cell=PartitionCell(tour, cell))
            for robot, cell in zip(fleet(here, 'E'), (stop, 'C2'), strict=True)
        ]
        seen = replace(
            fleet_world(robots),
            now=1000.0,
            visited_at=dict.fromkeys(tour, 1000.0) | dict.fromkeys(('R1', 'R3', 'R4'), 0.0),
            openings=Openings({shut: 'closed'}, frozenset(), {}, opens_in=opens_in),
        )
        made = decide(seen, Battery(), DecisionSettings(priorities=Priorities(rules)))
        assert made.place != shut, (rules, opens_in, here, stop, made.reason)


def test_the_way_to_what_is_overdue_leads_through_nothing_that_could_not_be_reached() -> None:
    graph = seven_rooms()
    tour = fleet_plan(graph, 1).groups[0].stops
    robots = [replace(robot, heard_at=1000.0) for robot in fleet('E')]
    seen = replace(
        fleet_world(robots),
        now=1000.0,
        visited_at=dict.fromkeys(tour, 1000.0) | {'R4': 0.0},
    )
    rules = DecisionSettings(priorities=Priorities(('URGENT', 'CORRIDOR')))
    first = decide(seen, Battery(), rules)
    assert 'R4 is overdue' in first.reason
    for avoided in ({first.place}, {'R4'}):
        made = decide(replace(seen, avoided=frozenset(avoided)), Battery(), rules)
        assert 'overdue' not in made.reason
        assert made.place not in avoided
