"""Partitions, charges in passing and slots at docks against looking at all of them."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.fleet import (
    ChargeNeed,
    DockSlot,
    FleetChoice,
    FleetError,
    FleetRobot,
    FleetSettings,
    PartitionCell,
    assign,
    choose,
    dock_slots,
    exact_wait,
    fleet_plan,
)
from patrol_policy.fleet.partition import (
    Group,
    balanced,
    closed_lengths,
    detours,
    group_of,
    lengths_of_sets,
)
from patrol_policy.graph import PatrolGraph
from patrol_policy.tour import shortest_tour, tour_length

from .test_assignment import fleet, random_map, ring


def cuts(order: list[int]) -> Iterator[list[list[int]]]:
    """Yield all ways to cut a closed tour into stretches."""
    count = len(order)
    for opening in range(count):
        turned = order[opening:] + order[:opening]
        for bits in range(1 << (count - 1)):
            ends = [number + 1 for number in range(count - 1) if bits >> number & 1]
            yield [turned[a:b] for a, b in itertools.pairwise([0, *ends, count])]


def wait_of(lengths: list[float], robots: int) -> float:
    """Return the least longest wait where each stretch has one robot at least."""
    if len(lengths) > robots:
        return math.inf
    return min(
        max(length / here for length, here in zip(lengths, counts, strict=True))
        for counts in itertools.product(range(1, robots + 1), repeat=len(lengths))
        if sum(counts) <= robots
    )


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(3, 6), st.integers(1, 4), st.booleans(), st.booleans())
def test_a_plan_is_as_good_as_the_best_cut_of_the_tour(
    seed: int, places: int, robots: int, alone: bool, charging: bool
) -> None:
    graph = random_map(seed, places)
    docks = ['P0', f'P{places - 1}'] if charging else []
    rows = [graph.index[dock] for dock in docks]
    distances, best = graph.distances, math.inf
    for stretches in cuts(list(graph.tour.order)):
        lengths = []
        for stretch in stretches:
            length = tour_length(distances, tuple(stretch))
            if rows and not set(rows) & set(stretch):
                length += min(
                    distances[a, dock] + distances[dock, b] - distances[a, b]
                    for dock in rows
                    for a, b in zip(stretch, [*stretch[1:], stretch[0]], strict=True)
                )
            lengths.append(length)
        wait = max(lengths) if len(lengths) <= robots else math.inf
        best = min(best, wait if alone else wait_of(lengths, robots))
    plan = fleet_plan(graph, robots, alone=alone, docks=docks)
    assert plan.wait <= best * (1.0 + 3e-4)
    stops = [stop for group in plan.groups for stop in group.stops]
    assert set(stops) == set(graph.places)
    assert all(len(set(group.stops)) == len(group.stops) for group in plan.groups)
    assert all(charging or stops.count(stop) == 1 for stop in stops)
    assert not charging or all(set(docks) & set(group.stops) for group in plan.groups)
    assert alone or sum(group.robots for group in plan.groups) == robots
    assert not alone or robots == 1 or all(group.robots == 1 for group in plan.groups)


def test_lengths_of_stretches_and_of_sets_are_those_of_their_tours() -> None:
    graph = random_map(5, 6)
    distances = graph.distances
    order = np.array([3, 0, 5, 1, 4, 2])
    docks = np.array([1, 2])
    closed, further = closed_lengths(distances, order), detours(distances, order, docks)
    for start, end in itertools.product(range(6), repeat=2):
        if start > end:
            assert math.isinf(closed[start, end])
            continue
        stretch = order[start : end + 1].tolist()
        assert closed[start, end] == pytest.approx(tour_length(distances, tuple(stretch)))
        legs = zip(stretch, [*stretch[1:], stretch[0]], strict=True)
        longer = min(
            distances[a, dock] + distances[dock, b] - distances[a, b]
            for a, b in legs
            for dock in docks
        )
        expected = 0.0 if {1, 2} & set(stretch) else longer
        assert further[start, end] == pytest.approx(expected)
    lengths = lengths_of_sets(distances)
    for chosen in range(1 << 6):
        rows = [place for place in range(6) if chosen >> place & 1]
        shortest = shortest_tour(distances[np.ix_(rows, rows)]).length if len(rows) > 1 else 0.0
        assert lengths[chosen] == pytest.approx(shortest)


def test_no_partition_of_a_small_map_is_better_than_the_exact_one() -> None:
    for seed in range(3):
        graph = random_map(seed, 5)
        lengths = lengths_of_sets(graph.distances)
        for robots in (1, 2, 3):
            best = math.inf
            for owner in itertools.product(range(robots), repeat=5):
                sets = [
                    sum(1 << place for place in range(5) if owner[place] == group)
                    for group in set(owner)
                ]
                best = min(best, wait_of([float(lengths[each]) for each in sets], robots))
            assert exact_wait(graph, robots) == pytest.approx(best)
    with pytest.raises(ValueError, match='a map of 13 places: expected at most 12'):
        exact_wait(ring(13), 2)
    assert exact_wait(ring(12), 3) == pytest.approx(40.0)


def test_robots_are_shared_out_for_the_least_longest_wait() -> None:
    groups = [
        Group((name,), (length,), 1) for name, length in (('A', 100.0), ('B', 60.0), ('C', 9.0))
    ]
    assert balanced(groups, 2) is None
    for robots in range(3, 9):
        plan = balanced(groups, robots)
        assert plan is not None
        assert plan.wait == pytest.approx(wait_of([100.0, 60.0, 9.0], robots))
        assert sum(group.robots for group in plan.groups) == robots


def test_a_group_charges_at_as_few_docks_as_suffice_those_farthest_apart() -> None:
    stops = tuple('ABCDEF')
    group = Group(stops, (10.0, 20.0, 30.0, 10.0, 5.0, 25.0), 1)
    assert group.length == group.wait == 100.0
    assert group.offsets.tolist() == [0.0, 10.0, 30.0, 60.0, 70.0, 75.0]
    assert group.charging((), 0.5) == group.charging(('A',), 0.0) == group
    # 50 s of charging on a round of 150 s: one dock is taken for a third of the time.
    one = group.charging(('A', 'D', 'E'), 0.5)
    assert sum(one.charges) == 50.0
    assert sum(charge > 0.0 for charge in one.charges) == 1
    assert (one.length, one.wait) == (150.0, 150.0)
    # Of three robots each comes after 50 s: it would be taken for all of the time.
    three = Group(stops, group.leg_seconds, 3).charging(('A', 'D', 'E'), 0.5)
    # From D to E are 10 s, so that E is left out.
    assert three.charges == (25.0, 0.0, 0.0, 25.0, 0.0, 0.0)
    assert three.wait == 50.0
    assert three.charge_at('D') == 25.0
    assert three.charge_at('B') == 0.0
    assert group.charge_at('D') == 0.0
    assert three.offsets.tolist() == [0.0, 35.0, 55.0, 85.0, 120.0, 125.0]
    # Up to seven tenths of the time are not too much.
    at_most = Group(stops, group.leg_seconds, 2).charging(('A', 'D'), 7.0 / 13.0 - 1e-9)
    assert sum(charge > 0.0 for charge in at_most.charges) == 1
    more = Group(stops, group.leg_seconds, 2).charging(('A', 'D'), 7.0 / 13.0 + 1e-6)
    assert sum(charge > 0.0 for charge in more.charges) == 2
    # The next one comes when the dock is free.
    busy = Group(stops, group.leg_seconds, 4).charging(('A',), 1.0)
    assert (busy.length, busy.wait) == (200.0, 100.0)


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.integers(0, 60), st.integers(1, 30)), min_size=1, max_size=4),
    st.integers(1, 2),
)
def test_slots_are_as_late_as_they_can_be_and_late_only_where_docks_are_too_few(
    wanted: list[tuple[int, int]], docks: int
) -> None:
    needs = [ChargeNeed(f'robot{n}', float(at), float(s)) for n, (at, s) in enumerate(wanted)]
    names = [f'dock{number}' for number in range(docks)]
    slots = dock_slots(needs, names, 0.0)
    for need in needs:
        slot = slots[need.robot]
        assert slot.end - slot.begin == need.seconds
        assert slot.begin >= 0.0
        assert slot.late == max(0.0, slot.begin - need.latest)
    if docks == 1:
        # In the order of their latest times nobody could be less late.
        now, least = 0.0, 0.0
        for need in sorted(needs, key=lambda each: each.latest):
            least = max(least, now - need.latest)
            now += need.seconds
        assert max(slot.late for slot in slots.values()) == pytest.approx(max(0.0, least))
        if not least:
            # Each ends where the next begins, or begins at its latest time.
            ends = {slot.begin for slot in slots.values()}
            for need in needs:
                slot = slots[need.robot]
                assert slot.begin == need.latest or slot.end in ends


def test_slots_count_who_charges_already() -> None:
    needs = [
        ChargeNeed('robot1', 0.0, 30.0, 'dock1'),
        ChargeNeed('robot2', 110.0, 20.0),
        ChargeNeed('robot3', 115.0, 20.0),
    ]
    slots = dock_slots(needs, ['dock1', 'dock2'], 100.0)
    assert slots['robot1'] == DockSlot('robot1', 'dock1', 100.0, 130.0)
    assert slots['robot2'] == DockSlot('robot2', 'dock2', 110.0, 130.0)
    # The other dock is free at 130 s as well: the first by order of the docks is taken.
    assert slots['robot3'] == DockSlot('robot3', 'dock1', 130.0, 150.0, 15.0)
    one = dock_slots([needs[1], needs[2]], ['dock1'], 0.0)
    assert one['robot3'] == DockSlot('robot3', 'dock1', 115.0, 135.0)
    assert one['robot2'] == DockSlot('robot2', 'dock1', 95.0, 115.0)
    with pytest.raises(ValueError, match='robots need to charge, and there is no dock'):
        dock_slots(needs, [], 0.0)
    with pytest.raises(ValueError, match='robot1 charges at dock1, expected dock2, dock3'):
        dock_slots(needs, ['dock2', 'dock3'], 0.0)
    assert dock_slots([], [], 0.0) == {}


@settings(max_examples=40)
@given(st.integers(0, 10_000), st.sampled_from([1, 2, 4, 5]), st.integers(0, 4))
def test_new_robots_of_a_tour_begin_at_equal_distances(seed: int, robots: int, kept: int) -> None:
    draw = random.Random(seed)
    graph = ring(20)
    tour = fleet_plan(graph, robots, whole=True).groups[0].stops
    team = [FleetRobot(f'robot{number}', draw.choice(graph.places)) for number in range(robots)]
    # Those that have a share already have the right distances.
    shift = draw.randrange(20)
    for number in range(min(kept, robots)):
        stop = tour[(shift + 20 * number // robots) % 20]
        robot = team[number]
        team[number] = FleetRobot(robot.name, stop, cell=PartitionCell(tour, stop))
    cells = assign(graph, team, 0.0).cells
    assert len(cells) == robots
    by_tour: dict[tuple[str, ...], list[int]] = {}
    for cell in cells.values():
        by_tour.setdefault(cell.tour, []).append(cell.tour.index(cell.stop))
    for stops, numbers in by_tour.items():
        if len(stops) == 20:
            gaps = [
                (after - before) % 20 or 20
                for before, after in itertools.pairwise([*sorted(numbers), min(numbers) + 20])
            ]
            assert len(set(gaps)) == 1


def test_a_tour_begins_where_that_ends_the_longest_wait_soonest() -> None:
    graph = ring(10)
    tour = graph.walk
    begun = set()
    for number in range(10):
        visited = dict.fromkeys(graph.places, 1000.0) | {tour[number]: 500.0}
        robot = FleetRobot('robot1', tour[0], heard_at=1000.0)
        (cell,) = assign(graph, [robot], 1000.0, visited_at=visited).cells.values()
        begin = cell.tour.index(cell.stop)

        def ends(first: int) -> float:
            # The way to where it begins, and along the tour up to each place.
            away = graph.seconds(tour[0], cell.tour[first])  # noqa: B023
            return max(
                away + 10.0 * ((at - first) % 10) + 1000.0 - visited[stop]  # noqa: B023
                for at, stop in enumerate(cell.tour)  # noqa: B023
            )

        assert ends(begin) == min(map(ends, range(10)))
        begun.add(cell.stop)
    assert len(begun) > 3


def test_facts_that_leave_a_robot_without_a_share_are_told() -> None:
    graph, settings = ring(8), FleetSettings(silent_after=10.0, back_after=5.0)
    one, two = fleet('P00', 'P04', now=100.0)

    def absent(robot: FleetRobot, now: float = 100.0) -> str:
        return assign(graph, [one, robot], now, settings).absent.get(robot.name, '')

    def changed(**facts: Any) -> FleetRobot:
        known: dict[str, Any] = {'name': 'robot2', 'place': 'P04', 'heard_at': 100.0, **facts}
        return FleetRobot(**known)

    assert absent(two) == ''
    assert absent(changed(taken_out=True)) == 'robot2 is taken out'
    assert absent(changed(heard_at=90.0)) == ''
    assert absent(changed(heard_at=89.9)) == 'robot2 was last heard at 00:01'
    assert absent(changed(heard_since=95.0)) == ''
    assert absent(changed(heard_since=95.1)) == 'robot2 is heard again only since 00:01'
    assert absent(changed(charging_until=7260.0)) == 'robot2 is charging until 02:01'
    told = choose(graph, [one, changed(taken_out=True)], 'robot2', 100.0, settings)
    assert (told.place, told.until, told.cell) == ('P04', 105.0, None)
    assert told.reason == 'no place is mine: robot2 is taken out'
    with pytest.raises(FleetError, match='robot2 drives to P01, expected a stop of its own tour'):
        assign(graph, [one, changed(cell=PartitionCell(('P00', 'P02'), 'P01'))], 100.0, settings)


def test_groups_in_force_are_given_up_for_what_is_clearly_better_alone() -> None:
    graph = random_map(7, 8)
    best = fleet_plan(graph, 2)
    tours = [group.stops for group in best.groups]
    if len(tours) == 1:
        tours = [tours[0][:4], tours[0][4:]]
    # Groups of the same places in a worse order.
    worse = [tuple(sorted(tour)) for tour in tours]
    kept = balanced([group_of(graph, tour) for tour in worse], 2)
    assert kept is not None
    gain = 1.0 - best.wait / kept.wait
    robots = [
        FleetRobot(f'robot{number}', tour[0], cell=PartitionCell(tour, tour[0]))
        for number, tour in enumerate(worse)
    ]
    for part, keeps in ((gain + 0.01, True), (gain - 0.01, False)):
        found = assign(graph, robots, 0.0, FleetSettings(worth_changing=part)).plan
        assert found is not None
        assert ({group.stops for group in found.groups} == set(worse)) == keeps


RING = ring(12)
TOUR = fleet_plan(RING, 1).groups[0].stops


def robot_at(
    number: int, stop: int | None = None, name: str = 'robot1', **facts: Any
) -> FleetRobot:
    cell = PartitionCell(TOUR, TOUR[number if stop is None else stop])
    return FleetRobot(name, TOUR[number], cell=cell, **facts)


def chosen(me: FleetRobot, *others: FleetRobot, now: float = 0.0, **settings: Any) -> FleetChoice:
    return choose(RING, [me, *others], me.name, now, FleetSettings(**settings))


def test_a_robot_stays_until_the_one_ahead_is_an_equal_distance_away() -> None:
    # Two on a tour of 120 s: 60 s are between them.
    for ahead in range(1, 12):
        choice = chosen(robot_at(0), robot_at(ahead, name='robot2'))
        gap = 10.0 * ahead
        assert choice.until == (60.0 - gap if gap < 60.0 else None), ahead
        assert choice.place == TOUR[0 if gap < 60.0 else 1]
        if gap < 60.0:
            assert choice.reason == (
                f'staying in {TOUR[0]} for {60.0 - gap:.0f} s: robot2 is less than 60 s ahead on '
                'the tour of 120 s'
            )
            assert not choice.overstays
    # Of two at one stop the one that came first is ahead, then the first by name.
    later = robot_at(0, since=5.0)
    assert chosen(later, robot_at(0, name='robot2', since=4.0)).until == 60.0
    assert chosen(later, robot_at(0, name='robot2', since=6.0)).until is None
    assert chosen(later, robot_at(0, name='robot2', since=5.0)).until is None
    assert chosen(later, robot_at(0, name='robot0', since=5.0)).until == 60.0
    # One that drives is as far as its way says: 4 s of 10 are left.
    driving = robot_at(3, 4, name='robot2', since=-6.0)
    assert chosen(robot_at(0), driving, now=0.0).until == pytest.approx(60.0 - 36.0)
    overtime = robot_at(3, 4, name='robot2', since=-9.0)
    assert chosen(robot_at(0), overtime, now=9.0).until == pytest.approx(9.0 + 60.0 - 40.0)
    # Who has been here for longer than the distance overstays.
    assert chosen(robot_at(0, since=-60.0), robot_at(1, name='robot2')).overstays is False
    assert chosen(robot_at(0, since=-60.1), robot_at(1, name='robot2')).overstays is True
    # A hundredth of the distance is not worth a stop.
    near = robot_at(5, 6, name='robot2', since=-9.45)
    assert chosen(robot_at(0), near).until is None
    near = robot_at(5, 6, name='robot2', since=-9.3)
    assert chosen(robot_at(0), near).until == pytest.approx(0.7)


def test_stops_are_a_robots_own_up_to_that_of_the_next_one() -> None:
    choice = chosen(robot_at(11), robot_at(4, name='robot2'), robot_at(8, name='robot3'))
    assert choice.place == TOUR[0]
    assert choice.mine == set(TOUR[:4])
    # Of two at one stop it is that of the one that waits longer.
    first = chosen(robot_at(2, 5, since=1.0), robot_at(5, name='robot2', since=2.0))
    assert first.mine == set(TOUR)
    second = chosen(robot_at(2, 5, since=3.0), robot_at(5, name='robot2', since=2.0))
    assert second.mine == set()


def charging(number: int, seconds: float, **facts: Any) -> FleetRobot:
    return robot_at(number, runs_until=900.0, charge_seconds=seconds, **facts)


def test_a_robot_charges_in_passing_as_long_as_planned() -> None:
    dock = TOUR[3]
    usual: dict[str, Any] = {'docks': (dock,), 'charge_ratio': 0.25, 'silent_after': 1000.0}
    # A round of 120 s costs 30 s at the dock; 2 % more make up for what is missing.
    for needs, stays in ((10.0, 10.0), (30.0, 30.0), (30.5, 30.5), (40.0, 30.6)):
        choice = chosen(charging(3, needs), now=100.0, **usual)
        assert choice.slot is not None
        assert (choice.slot.begin, choice.slot.end) == (100.0, pytest.approx(100.0 + stays))
        assert choice.cell == PartitionCell(TOUR, TOUR[4])
        assert choice.reason == (
            f'charging in passing at {dock} until 00:0{(100 + stays) // 60:.0f}: a stop of the '
            'tour of 150 s'
        )
    # What is hardly worth a stop is left out, and what is not needed or not free.
    assert chosen(charging(3, 5.0), **usual).slot is not None
    assert chosen(charging(3, 4.9), **usual).slot is None
    assert chosen(charging(3, 4.9), **usual, least_charge=4.0).slot is not None
    assert chosen(robot_at(3, charge_seconds=30.0), **usual).slot is None
    assert chosen(charging(2, 30.0), **usual).slot is None
    other = FleetRobot('robot2', dock, dock=dock, charging_until=20.0, runs_until=500.0)
    assert 'in passing' not in chosen(charging(3, 30.0), other, **usual).reason
    # On its way to another stop it only makes up for charges that it missed.
    for needs, charges in ((45.0, True), (44.9, False)):
        passing = chosen(charging(3, needs, stop=6), **usual)
        assert (passing.slot is not None) == charges
        assert not charges or passing.cell == PartitionCell(TOUR, TOUR[6])
    # It has been there just now.
    assert chosen(charging(3, 60.0, stop=4), **usual).slot is None


def test_a_robot_leaves_for_its_slot_in_time() -> None:
    dock = TOUR[0]
    me = robot_at(5, 6, runs_until=100.0, charge_seconds=30.0)
    # From stop 6 it is 60 s to the dock, and 10 s to stop 6.
    for now, goes in ((29.9, False), (30.0, True)):
        choice = chosen(me, now=now, docks=(dock,), silent_after=1000.0)
        assert (choice.slot is not None) == goes
        assert (choice.place == dock) == goes
    assert choice.reason == f'charging at {dock} from 00:01 to 00:02: that is my slot'
    # Where another one charges until later it waits at the dock from when it has to be there.
    busy = FleetRobot(
        'robot2', dock, dock=dock, charging_until=150.0, runs_until=300.0, heard_at=0.0
    )
    late = chosen(me, busy, now=35.0, docks=(dock,), silent_after=1000.0)
    assert late.slot is not None
    assert (late.slot.begin, late.slot.late) == (150.0, 50.0)
    assert late.reason.endswith('that is my slot, 50 s late: the docks are too few')


def test_a_lone_robot_of_one_place_looks_anew_soon() -> None:
    only = PatrolGraph({'A': {}})
    robot = FleetRobot('robot1', 'A')
    choice = choose(only, [robot], 'robot1', 100.0, FleetSettings(silent_after=1000.0))
    assert (choice.place, choice.until) == ('A', 105.0)
    assert choice.reason == (
        'A is mine: it is the next of 1 places on a tour of 0 s, each every 0 s'
    )
