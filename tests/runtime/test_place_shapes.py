"""Shapes of a place beside plain geometry: zones, boxes, openings, doors on walls, joined rooms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import Door, Grid, PlaceError, RoomMap, Zone, Zones, read_place, shapes
from floor_plans.editor.measures import (
    door_on_wall,
    fitted_door,
    free_point,
    sides_of,
)
from floor_plans.fleet import (
    points_to_pass,
    problem_in_robot_name,
    robots_in_a_row,
    wide_places,
    wide_ways,
    with_points,
)
from floor_plans.map_rooms.joining import elongation, half_width, joined
from floor_plans.occupancy_grid import distance_to
from floor_plans.parameters import members_of
from surveillance_runtime.fleet_parts import members

SEVEN_ROOMS = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
PLAN = read_place(SEVEN_ROOMS).plan
BENT = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (3.0, 3.0), (3.0, 1.0), (0.0, 1.0))


# --- zones ---


def test_a_bent_zone_holds_and_is_as_far_as_opencv_says() -> None:
    zone = Zone('K', BENT)
    polygon = np.array(BENT, np.float32).reshape(-1, 1, 2)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform((-1.0, -1.0), (5.0, 4.0), (300, 2)):
        peer = cv2.pointPolygonTest(polygon, (float(x), float(y)), True)
        assert zone.contains([(x, y)])[0] == (peer > 0)
        assert zone.distance((x, y)) == pytest.approx(max(0.0, -peer), abs=1e-5)
    assert zone.area == 6.0
    assert zone.box == (0.0, 0.0, 4.0, 3.0)
    turned = Zone('K', tuple((-y, x) for x, y in BENT[::-1]))
    assert turned.area == 6.0
    assert turned.box == (-3.0, 0.0, 0.0, 4.0)
    edge = zone.edge(0.3)
    assert len(edge) == 14 + 10 + 4 + 7 + 10 + 4
    assert np.hypot(*(np.roll(edge, -1, axis=0) - edge).T).max() <= 0.3 + 1e-9
    assert edge[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ('x', 'yaw', 'limit'),
    [
        (2.0, 0.0, 0.3),
        (-1.0, 0.0, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.0)),
        (-1.4, 0.0, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.4)),
        (-1.6, 0.0, math.inf),
        (-1.0, math.pi, math.inf),
        (5.0, math.pi, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.0)),
    ],
)
def test_before_a_slow_zone_the_speed_is_that_from_which_one_can_brake(
    x: float, yaw: float, limit: float
) -> None:
    slow = Zone('S', BENT, 0.3)
    zones = Zones(slow={'S': slow})
    assert zones.speed_limit((x, 0.5, yaw), 0.5) == pytest.approx(limit, abs=0.04)
    slower = Zones(slow={'T': replace(slow, speed=0.2), 'S': slow})
    if x == 2.0:
        assert slower.speed_limit((x, 0.5, yaw), 0.5) == 0.2


def test_the_edges_of_zones_to_keep_out_of_are_told_in_the_robots_frame() -> None:
    zones = Zones(keep_out={'K': Zone('K', BENT), 'far': Zone('far', ((50, 0), (51, 0), (51, 1)))})
    barred = zones.barred((3.5, 2.0))
    assert barred is not None
    assert barred.name == 'K'
    assert zones.barred((1.0, 2.0)) is None
    pose = (1.0, 3.0, -math.pi / 2)  # it looks at the side from (3, 1) to (0, 1), 2 m ahead
    near = zones.edges_near(pose, 2.5, 0.1)
    assert near[np.abs(near[:, 1]) <= 1.0][:, 0] == pytest.approx(2.0)
    assert near[near[:, 0] < 1.9][:, 1].min() == pytest.approx(2.0), 'the sides to its left'
    assert np.hypot(*near.T).max() <= 2.5
    assert (near[:, 1] > 0).any()
    corner = near[np.argmin(np.hypot(near[:, 0] - 2.0, near[:, 1] - 1.4))]
    assert corner == pytest.approx([2.0, 1.4])
    assert zones.edges_near((1.0, 0.5, 0.0), 2.5).shape == (0, 2), 'it is in it, and is to leave'
    assert zones.edges_near((1.0, 4.0, 0.0), 2.2).shape == (0, 2)


# --- boxes ---


def test_how_far_points_are_from_boxes_is_what_opencv_says() -> None:
    some = shapes.boxes_around([((0.0, 0.0), (3.0, 4.0)), ((5.0, 1.0), (5.0, 3.0))], 0.2)
    corners = shapes.corners(some)
    assert corners[1] == pytest.approx(np.array([[5.1, 1], [5.1, 3], [4.9, 3], [4.9, 1]]))
    rng = np.random.default_rng(5)
    points = rng.uniform((-2.0, -2.0), (7.0, 6.0), (200, 2))
    away = shapes.distances(some, *points.T)
    assert away.shape == (200, 2)
    for number, polygon in enumerate(corners.astype(np.float32)):
        for (x, y), gap in zip(points, away[:, number], strict=True):
            peer = cv2.pointPolygonTest(polygon.reshape(-1, 1, 2), (float(x), float(y)), True)
            assert gap == pytest.approx(max(0.0, -peer), abs=1e-5)


# --- openings and doors ---


def opening(turn: float = 0.0) -> Grid:
    """Return two rooms with a wall between them at x = 3 that has an opening of 1 m at y = 2."""
    side = 0.02
    y, x = np.mgrid[0:200, 0:300] * side + side / 2
    dx, dy = x - 3.0, y - 2.0
    along, across = (
        -math.sin(turn) * dx + math.cos(turn) * dy,
        math.cos(turn) * dx + math.sin(turn) * dy,
    )
    solid = (np.abs(across) < 0.1) & (np.abs(along) > 0.5)
    solid |= (x < 0.1) | (x > 5.9) | (y < 0.1) | (y > 3.9)
    return Grid(np.where(solid, 100, 0).astype(np.int8), side)


@pytest.mark.parametrize('turn', [0.0, 0.35, -0.5])
def test_an_opening_is_found_from_beside_its_middle(turn: float) -> None:
    x, y = 3.0 - math.sin(turn) * 0.2, 2.0 + math.cos(turn) * 0.2
    door = fitted_door(opening(turn), x, y)
    assert (door.x, door.y) == pytest.approx((3.0, 2.0), abs=0.06)
    assert door.width == pytest.approx(1.0, abs=0.06)
    assert abs(math.remainder(door.yaw - turn - math.pi / 2, math.pi)) < 0.15


def test_where_there_is_no_opening_it_is_said() -> None:
    grid = opening()
    with pytest.raises(ValueError, match=r'\(3\.00, 1\.00\) is not free: expected a point in'):
        fitted_door(grid, 3.0, 1.0)
    open_field = Grid(np.zeros((700, 700), np.int8), 0.02)
    with pytest.raises(ValueError, match=r'no walls within 6 m of \(7\.00, 7\.00\)'):
        fitted_door(open_field, 7.0, 7.0)


def test_a_door_on_a_wall_stays_on_it_with_its_whole_width() -> None:
    wall = next(iter(PLAN.walls.values()))
    (x1, y1), (x2, y2) = wall.start, wall.end
    dx, dy = (x2 - x1) / wall.length, (y2 - y1) / wall.length
    beside = (x1 + 2.0 * dx - 0.3 * dy, y1 + 2.0 * dy + 0.3 * dx)
    alone = replace(PLAN, walls={'w': wall})
    door = door_on_wall(alone, *beside, 0.9)
    assert (door.x, door.y, door.width) == pytest.approx((x1 + 2.0 * dx, y1 + 2.0 * dy, 0.9))
    assert door.yaw == pytest.approx(math.atan2(dy, dx))
    at_its_end = door_on_wall(alone, x1 + 0.1 * dx, y1 + 0.1 * dy, 0.9)
    assert (at_its_end.x, at_its_end.y) == pytest.approx((x1 + 0.45 * dx, y1 + 0.45 * dy))
    at_its_other = door_on_wall(alone, x2, y2, 0.9)
    assert (at_its_other.x, at_its_other.y) == pytest.approx((x2 - 0.45 * dx, y2 - 0.45 * dy))
    middle = (x1 + x2) / 2, (y1 + y2) / 2
    assert door_on_wall(alone, *middle, wall.length).width == wall.length
    for far, width in ((1.01, 0.9), (0.3, wall.length + 0.1)):
        with pytest.raises(ValueError, match='m or more within 1 m of'):
            door_on_wall(alone, x1 + 2.0 * dx - far * dy, y1 + 2.0 * dy + far * dx, width)
    assert door_on_wall(alone, x1 + 2.0 * dx - 0.99 * dy, y1 + 2.0 * dy + 0.99 * dx, 0.9)


def test_a_door_leads_into_the_part_beside_it_or_else_the_nearest() -> None:
    grid = Grid(np.zeros((100, 100), np.int8), 0.05)
    west, east = np.zeros((100, 100), np.bool_), np.zeros((100, 100), np.bool_)
    west[:, :48], east[:, 80:] = True, True
    door = Door('D', 2.5, 2.5, math.pi / 2, 0.9)  # at x = 2.5, so it leads along x
    assert sides_of(door, {'e': east, 'w': west}, grid) == 'w'
    far = Door('D', 3.3, 2.5, math.pi / 2, 0.9)
    assert sides_of(far, {'e': east, 'w': west}, grid) == 'e', '0.7 m to the east, 0.9 to the west'
    assert sides_of(Door('D', 3.1, 2.5, 0.0, 0.9), {'e': east, 'w': west}, grid) == 'w'


def test_a_free_point_is_in_the_largest_part_that_the_robot_fits_into() -> None:
    cells = np.full((60, 100), 100, np.int8)
    cells[5:55, 5:30] = cells[5:55, 34:95] = 0
    cells[28:31, 30:34] = 0  # too narrow for the robot
    grid = Grid(cells, 0.05)
    room = grid.free
    x, y = free_point(grid, room, 0.3)
    assert 34 * 0.05 + 0.3 < x < 95 * 0.05 - 0.3
    row, column = grid.cell_of(x, y)
    assert distance_to(~grid.free, 0.05)[row, column] > 0.3
    with pytest.raises(ValueError, match=r'a robot of 3 m has no room in one of the parts'):
        free_point(grid, room, 1.5)


# --- joined rooms ---


def strips(*widths: int, opening: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rooms of 60 rows beside each other, with openings between, as `joined` takes them.

    Cells of 0.1 m; the cut lies in each opening.
    """
    free = np.zeros((62, sum(widths) + len(widths) + 1), np.uint8)
    parts, cuts = np.zeros(free.shape, np.int32), np.zeros(free.shape, np.float32)
    left = 1
    for number, width in enumerate(widths, 1):
        free[1:61, left : left + width] = 1
        parts[1:61, left : left + width] = number
        left += width + 1
        if number < len(widths):
            rows = slice(31 - opening // 2, 31 - opening // 2 + opening)
            free[rows, left - 1] = 1
            cuts[rows, left - 1] = 1.0
    clearance = cv2.distanceTransform(free, cv2.DIST_L2, 5) * np.float32(0.1)
    return parts, cuts, clearance


@pytest.mark.parametrize(
    ('widths', 'opening', 'rooms'),
    [
        ((40, 40), 9, [1, 2]),  # two rooms of 24 m2 and a door of 0.9 m
        ((40, 1), 9, [1, 1]),  # a cupboard of 0.6 m2
        ((40, 3), 40, [1, 1]),  # a niche of 0.3 m depth
        ((1, 40), 9, [2, 2]),  # the larger one keeps its number
        ((40, 1, 40), 9, [1, 1, 3]),
    ],
)
def test_parts_are_rooms_or_belong_to_their_neighbours(
    widths: tuple[int, ...], opening: int, rooms: list[int]
) -> None:
    assert joined(*strips(*widths, opening=opening), 0.1).tolist() == [0, *rooms]


def test_the_width_of_a_strip_follows_from_its_clearance() -> None:
    # A strip of 10 m x 2 m: the mean clearance is a quarter of the width.
    assert half_width(20.0, 20.0 * 0.5) == pytest.approx(1.0)
    assert elongation(20.0, 10.0) == pytest.approx(5.0)
    # Of a square of side 1 it is a sixth: 2.25 squares of two thirds.
    assert elongation(1.0, 1.0 / 6.0) == pytest.approx(2.25)


# --- robots of a place ---


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


def test_a_run_has_the_robots_of_its_place_or_so_many_in_a_row(tmp_path: Path) -> None:
    assert members(SEVEN_ROOMS, None, 0.22) == ()
    assert members(SEVEN_ROOMS, 2, 0.22) == robots_in_a_row(PLAN, 2, 0.22)
    path = tmp_path / 'two.yaml'
    robots = (
        '    robots:\n      anna: {start: [10.0, 8.0, 0.0]}\n      bert: {start: [4.0, 9.0, 0.0]}\n'
    )
    path.write_text(SEVEN_ROOMS.read_text() + robots)
    for asked in (None, 2):
        assert [each.name for each in members(path, asked, 0.22)] == ['anna', 'bert']
    for asked in (1, 3):
        with pytest.raises(ValueError, match=f'--robots {asked}: two.yaml has 2: anna, bert'):
            members(path, asked, 0.22)


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
    wide = wide_ways(PLAN, radius)
    assert len(wide) == sum(width >= narrow for width in widths.values())
    broad = replace(PLAN, doors={**PLAN.doors, 'D1': replace(PLAN.doors['D1'], width=narrow)})
    assert ' '.join(sorted(PLAN.place.doors['D1'])) in wide_ways(broad, radius)
