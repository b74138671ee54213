"""The robots that a place names, and where they can pass each other."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from floor_plans import PlaceError, RoomMap, read_place
from floor_plans.fleet import (
    points_to_pass,
    problem_in_robot_name,
    robots_in_a_row,
    wide_passages,
    wide_places,
    with_points,
)
from floor_plans.occupancy_grid import distance_to
from floor_plans.parameters import members_of

SEVEN_ROOMS = Path(__file__).with_name('places') / 'seven_rooms.yaml'


PLAN = read_place(SEVEN_ROOMS).plan


@pytest.mark.parametrize(
    ('name', 'problem'),
    [
        ('robot1', ''),
        ('A' * 60, ''),
        ('A' * 61, 'has 61 letters: expected at most 60'),
        ('1robot', 'expected a name of letters, digits and _, like robot1'),
        ('a-b', 'expected a name of letters, digits and _, like robot1'),
        ('a\n', 'expected a name of letters, digits and _, like robot1'),
        ('all', 'stands for other things: expected another name than all'),
        ('simulator', 'stands for other things: expected another name than simulator'),
    ],
)
def test_names_of_robots(name: str, problem: str) -> None:
    assert problem_in_robot_name(name, ('simulator',)) == problem


def test_the_robots_that_a_place_names() -> None:
    start = list(PLAN.start)
    robots = {'anna.start': start, 'anna.dock': 'E', 'anna.profile': 'x'}
    beside = [start[0] + 0.61, start[1], 1]
    (anna, bert) = members_of({'robots': {**robots, 'bert.start': beside}}, PLAN)
    assert (anna.name, anna.start, anna.dock, anna.profile) == ('anna', PLAN.start, 'E', 'x')
    assert (bert.start, bert.dock, bert.profile) == ((start[0] + 0.61, start[1], 1.0), '', '')
    assert members_of({}, PLAN) == ()
    for entries, words in (
        ({'R1.start': start}, 'robots.R1: is the name of a room or a door'),
        ({'D1.start': start}, 'robots.D1: is the name of a room or a door'),
        ({'a.dock': 'E'}, 'robots.a: has no start, expected start: [x, y, yaw]'),
        ({'a': 3}, 'robots.a: expected start: [x, y, yaw] below it, got 3'),
        ({'a.start': start, 'a.stat': 1}, "robots.a.stat: unknown, expected 'start'"),
        ({'a.start': start[:2]}, 'robots.a.start: expected [x, y, yaw] in metres and rad, got'),
        ({'a.start': [True, 1, 1]}, 'robots.a.start: expected [x, y, yaw] in metres and rad, got'),
        ({'a.start': [1, math.nan, 1]}, 'robots.a.start: expected [x, y, yaw] in metres'),
        ({'a.start': [90, 90, 0]}, '(90, 90) lies in no room: expected a point in one'),
        ({'a.start': start, 'a.dock': 'R1'}, "no room with a station, expected 'E'"),
        ({'a.start': start, 'a.profile': 3}, 'robots.a.profile: expected a name or a file, got 3'),
        (
            {'a.start': start, 'b.start': [start[0] + 0.59, start[1], 0]},
            'robots.b.start: a starts there: expected it apart',
        ),
    ):
        with pytest.raises(PlaceError) as found:
            members_of({'robots': entries}, PLAN)
        assert words in str(found.value)


def test_robots_in_a_row_stand_apart_from_each_other_and_from_walls_and_doors() -> None:
    robots = robots_in_a_row(PLAN, 6, 0.22)
    assert [each.name for each in robots] == [f'robot{n}' for n in range(1, 7)]
    assert robots[0].start == PLAN.start
    assert {each.start[2] for each in robots} == {PLAN.start[2]}
    clearance = distance_to(PLAN.grid().occupied, PLAN.grid().resolution)
    for number, each in enumerate(robots):
        for other in robots[:number]:
            assert math.dist(each.start[:2], other.start[:2]) >= 2 * 0.22 + 0.6 - 1e-9
        if number:
            assert clearance[PLAN.grid().cell_of(*each.start[:2])] >= 0.22 + 0.3
            for door in PLAN.doors.values():
                gap = math.dist(each.start[:2], (door.x, door.y))
                assert gap >= door.width / 2 + 2 * 0.22
    away = [math.dist(each.start[:2], PLAN.start[:2]) for each in robots]
    assert np.diff(away).min() >= -1e-9, 'the nearest first'
    with pytest.raises(
        PlaceError, match=r'E has room for \d+ robots beside one another, not for 99'
    ):
        robots_in_a_row(PLAN, 99, 0.22)


def test_where_robots_can_pass_each_other_is_measured() -> None:
    radius = 0.22
    grid = PLAN.grid()
    clearance = distance_to(grid.occupied, grid.resolution)
    needed = 3 * radius + 0.4
    at = {name: clearance[grid.cell_of(x, y)] for name, (x, y, _) in PLAN.place.positions.items()}
    assert wide_places(PLAN, radius) == tuple(
        name for name, gap in at.items() if gap >= needed - grid.resolution
    )
    x = PLAN.place.positions['R1'][0]
    moved = with_points(PLAN, {'R1': (x, 1.0)})
    assert moved.place.positions['R1'] == (x, 1.0, PLAN.place.positions['R1'][2])
    assert moved.place.positions['R2'] == PLAN.place.positions['R2']
    narrow_ones = set(at) - set(wide_places(PLAN, radius))
    found = points_to_pass(PLAN, radius)
    assert 0 < len(found) < len(at)
    assert set(found) == narrow_ones
    rooms = RoomMap(PLAN)
    for name, (new_x, new_y) in found.items():
        assert rooms.room_at(new_x, new_y) == name
        assert clearance[grid.cell_of(new_x, new_y)] >= needed - grid.resolution
        for door in PLAN.place.rooms[name]:
            own = PLAN.doors[door]
            gap = math.dist((new_x, new_y), (own.x, own.y))
            assert gap >= own.width / 2 + 2 * radius - 0.01
    assert points_to_pass(with_points(PLAN, found), radius) == {}
    widths = {name: door.width for name, door in PLAN.doors.items()}
    narrow = 4 * radius + 0.6
    wide = wide_passages(PLAN, radius)
    assert len(wide) == sum(width >= narrow for width in widths.values())
    broad = replace(PLAN, doors={**PLAN.doors, 'D1': replace(PLAN.doors['D1'], width=narrow)})
    assert ' '.join(sorted(PLAN.place.doors['D1'])) in wide_passages(broad, radius)
