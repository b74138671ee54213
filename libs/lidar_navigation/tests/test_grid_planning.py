"""Planning on a grid: paths that are free and short, and reasons where there is none."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from skimage.graph import MCP_Geometric

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to, drawn_lines, with_walls
from floor_plans.parameters import zones_from
from lidar_navigation import GridPlanner, NoPathError, PlanningParameters, geometry
from lidar_navigation.planning.grid_planning import _corners, _poses_along

RESOLUTION = 0.05
ROBOT = PlanningParameters(radius=0.2)


def two_rooms(door: tuple[float, float] = (1.5, 2.5)) -> Grid:
    """Two rooms of 4 m x 4 m, side by side, joined by an opening between two heights (metres)."""
    cells = np.zeros((80, 161), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    cells[:, 80] = 100
    cells[int(door[0] / RESOLUTION) : int(door[1] / RESOLUTION), 80] = 0
    return Grid(cells, RESOLUTION, (0.0, 0.0))


def true_clearance(grid: Grid, path: np.ndarray) -> float:
    """Return the least distance from points along a path to the occupied squares, by brute
    force.
    """
    samples = geometry.equally_spaced(path, 0.02)
    low = grid.centres_of(np.argwhere(~grid.free)) - RESOLUTION / 2
    gap = np.maximum(low - samples[:, None], samples[:, None] - low - RESOLUTION)
    return float(np.hypot(*np.moveaxis(np.maximum(gap, 0), -1, 0)).min())


def test_a_path_goes_through_the_door_and_keeps_its_distance() -> None:
    grid = two_rooms()
    planner = GridPlanner(grid, ROBOT)
    path = planner.plan((1, 3.5), (7, 3.5))
    assert path[0] == pytest.approx([1, 3.5])
    assert path[-1] == pytest.approx([7, 3.5])
    assert planner.is_free(path)
    assert true_clearance(grid, path) >= ROBOT.radius
    at_door = path[np.argmin(np.abs(path[:, 0] - 4.02))]
    assert at_door[1] == pytest.approx(2.0, abs=0.25)


@pytest.mark.parametrize(
    ('start', 'goal', 'text'),
    [
        ((1, 1), (4.02, 0.5), 'the goal (4.02, 0.50) lies inside a wall'),
        ((1, 1), (9, 1), 'the goal (9.00, 1.00) lies outside of the map'),
        ((1, 1), (3.9, 0.5), 'm from a wall: expected at least 0.25 m'),
        ((0.02, 1), (7, 1), 'the start (0.02, 1.00) lies inside a wall'),
        ((float('nan'), 1), (7, 1), 'the start (nan, 1.00) lies outside of the map'),
    ],
)
def test_points_that_are_not_free_are_named(
    start: tuple[float, float], goal: tuple[float, float], text: str
) -> None:
    with pytest.raises(NoPathError) as caught:
        GridPlanner(two_rooms(), ROBOT).plan(start, goal)
    assert text in str(caught.value)


def test_what_blocks_is_named_and_gone_when_it_is_taken_away() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    planner.set_closed({'D1': (4.02, 1.5, 4.02, 2.5)})
    with pytest.raises(NoPathError, match='the closed door D1 is in the way'):
        planner.plan((1, 1), (7, 1))
    planner.set_closed({})
    planner.set_obstacles([(4.1, y) for y in np.arange(1.5, 2.6, 0.05)])
    with pytest.raises(NoPathError, match=r'an obstacle at \(4\.10, .*\) is in the way'):
        planner.plan((1, 1), (7, 1))
    planner.set_obstacles([])
    assert planner.is_free(planner.plan((1, 1), (7, 1)))


def test_an_opening_that_is_too_narrow_is_a_wall() -> None:
    with pytest.raises(NoPathError, match=r'wide enough: expected one of 0\.64 m,'):
        GridPlanner(two_rooms((2.0, 2.4)), ROBOT).plan((1, 1), (7, 1))


@pytest.mark.parametrize('radius', [0.22, 0.25])
@pytest.mark.parametrize('degrees', [0, 5, 15, 22.5, 30, 40, 45, 61, 75])
def test_an_opening_as_wide_as_is_asked_for_is_passed_at_any_angle(
    radius: float, degrees: float
) -> None:
    robot = PlanningParameters(radius=radius)
    width = 2.0 * (radius + robot.margin + math.sqrt(2.0) * RESOLUTION) + 1e-6
    along = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    across = np.array([-along[1], along[0]])
    empty = Grid(np.zeros((120, 120), np.int8), RESOLUTION, (-3.0, -3.0))
    for shift in (0.0, 0.01, 0.024, 0.04):
        middle = shift * (along + across)
        ends = [(middle + side * along * width / 2, side * along * 5.0) for side in (-1, 1)]
        grid = with_walls(empty, [(*inner, *outer) for inner, outer in ends])
        path = GridPlanner(grid, robot).plan(middle - across, middle + across)
        assert true_clearance(grid, path) >= radius - RESOLUTION / 2


def test_an_obstacle_on_the_way_is_driven_around() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    straight = planner.plan((0.5, 2), (3, 2))
    planner.set_obstacles([(1.75, 2.0)])
    around = planner.plan((0.5, 2), (3, 2))
    assert geometry.length(straight) == pytest.approx(2.5)
    assert geometry.length(around) > 2.5
    assert np.hypot(*(geometry.equally_spaced(around, 0.02) - (1.75, 2)).T).min() >= ROBOT.radius


def test_a_goal_that_an_obstacle_covers_is_approached() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    planner.set_obstacles([(3.0, 2.0)])
    path = planner.plan((0.5, 2), (3, 2))
    assert ROBOT.radius <= np.hypot(*(path[-1] - (3, 2))) <= 0.35
    planner.set_closed({'D1': (3.0, 0.0, 3.0, 4.0)})
    with pytest.raises(NoPathError, match='the closed door D1 is in the way'):
        planner.plan((0.5, 2), (7, 2))


def test_who_may_leave_a_door_is_planned_through_unless_there_is_a_way_round() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    planner.set_obstacles([(4.02, 2.0), (2.0, 2.0)], np.array([False, True]))
    path = geometry.equally_spaced(planner.plan((1, 2), (7, 2)), 0.02)
    assert np.hypot(*(path - (4.02, 2)).T).min() < ROBOT.radius
    assert np.hypot(*(path - (2, 2)).T).min() >= ROBOT.radius
    # Whoever stands where there is room is planned around all the same.
    planner.set_obstacles([(4.02, 2.0), (2.0, 2.0)], np.array([False, False]))
    path = geometry.equally_spaced(planner.plan((1, 2), (7, 2)), 0.02)
    assert np.hypot(*(path - (2, 2)).T).min() >= ROBOT.radius + ROBOT.margin - 0.025
    assert path[-1] == pytest.approx((7, 2))
    planner.set_obstacles([(4.02, 2.0)])
    with pytest.raises(NoPathError, match=r'an obstacle at \(4\.02, 2\.00\) is in the way'):
        planner.plan((1, 2), (7, 2))
    planner.set_obstacles([(2.0, 2.0)], np.array([False]))
    planner.set_closed({'D1': (4.02, 1.5, 4.02, 2.5)})
    with pytest.raises(NoPathError, match='the closed door D1 is in the way'):
        planner.plan((1, 2), (7, 2))


def test_a_goal_on_which_somebody_stands_is_moved_only_where_there_is_room_beside_it() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    someone = np.zeros(1, np.bool_)
    planner.set_obstacles([(6.0, 2.0)], someone)
    end = planner.plan((5, 2), (6, 2))[-1]
    assert ROBOT.radius <= math.dist(end, (6, 2)) < 0.5
    crowd = np.array(
        [(6 + x, 2 + y) for x in np.arange(-1, 1.1, 0.2) for y in np.arange(-1, 1.1, 0.2)]
    )
    planner.set_obstacles(crowd, np.zeros(len(crowd), np.bool_))
    assert planner.plan((4.5, 2), (6, 2))[-1] == pytest.approx((6, 2))


def test_a_goal_beside_a_door_is_not_moved_through_it() -> None:
    planner = GridPlanner(two_rooms(), ROBOT, {'D1': (4.02, 1.5, 4.02, 2.5)})
    planner.set_obstacles([(4.02, 2.0)])
    assert 0.2 < math.dist(planner.plan((1, 2), (4.02, 2.0))[-1], (4.02, 2.0)) < 1.0
    planner.set_obstacles([(4.2, y) for y in np.arange(1.5, 2.6, 0.05)])
    # On this side of the door the place nearest to the goal is reached, through the door none is.
    assert planner.plan((6, 2), (4.2, 2.0))[-1][0] > 4.4
    with pytest.raises(NoPathError, match=r'the goal \(4\.20, 2\.00\) is .* from an obstacle'):
        planner.plan((1, 2), (4.2, 2.0))


def test_a_robot_pushed_against_a_wall_finds_its_way_out() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    path = planner.plan((0.2, 1), (3, 1))
    assert path[0] == pytest.approx([0.2, 1])
    assert planner.is_free(path[1:])


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_in_any_clutter_a_path_is_free_and_not_longer_than_the_grid_s(seed: int) -> None:
    draw = np.random.default_rng(seed)
    cells = np.zeros((60, 60), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    for _ in range(int(draw.integers(0, 14))):
        row, column = draw.integers(0, 56, 2)
        height, width = draw.integers(1, 12, 2)
        cells[row : row + height, column : column + width] = 100
    grid = Grid(cells, RESOLUTION, (-1.0, 2.0))
    robot = PlanningParameters(radius=0.1, margin=0.04, comfort=0.2)
    planner = GridPlanner(grid, robot)
    start, goal = (grid.centres_of(c)[0] for c in draw.integers(3, 57, (2, 2)))
    assume((planner.clearance([start, goal]) > robot.radius + robot.margin).all())
    try:
        path = planner.plan(start, goal)
    except NoPathError as problem:
        assert 'with no opening wide enough' in str(problem)  # noqa: PT017
        return
    assert path[0] == pytest.approx(start)
    assert path[-1] == pytest.approx(goal)
    assert true_clearance(grid, path) >= robot.radius
    search = MCP_Geometric(planner.cost)
    cells_of = [tuple(c) for c in grid.cells_of([start, goal])]
    search.find_costs(cells_of[:1], cells_of[1:])
    on_grid = grid.centres_of(search.traceback(cells_of[1]))
    assert geometry.length(path) <= geometry.length(on_grid) + 1e-6


@given(st.tuples(*[st.floats(-3, 12)] * 2), st.tuples(*[st.floats(-3, 12)] * 2))
@settings(max_examples=60)
def test_any_two_points_give_a_free_path_or_a_reason(
    start: tuple[float, float], goal: tuple[float, float]
) -> None:
    planner = TWO_ROOMS
    try:
        path = planner.plan(start, goal)
    except NoPathError as problem:
        assert '\n' not in str(problem)  # noqa: PT017
        return
    assert path[-1] == pytest.approx(np.array(goal))
    assert planner.is_free(path[1:])


TWO_ROOMS = GridPlanner(two_rooms(), ROBOT)


def test_distances_and_lines_on_a_grid() -> None:
    grid = two_rooms()
    distance = distance_to(grid.occupied, RESOLUTION)
    assert distance[40, 1] == pytest.approx(RESOLUTION)
    assert np.isinf(distance_to(np.zeros((3, 3), bool), 1.0)).all()
    line = drawn_lines(grid, [(1, 1, 2, 1.6)])
    assert line.any(axis=0)[20:40].all()  # type: ignore[index]
    assert grid.interpolated(distance, grid.centres_of([(40, 1)])) == pytest.approx(RESOLUTION)


@pytest.mark.parametrize(
    ('cells', 'resolution', 'text'),
    [
        (np.zeros((0, 3), np.int8), 0.1, 'expected rows and columns'),
        (np.zeros((3, 3), np.int8), 0.0, 'expected more than 0 m'),
    ],
)
def test_maps_that_are_none_are_refused(cells: np.ndarray, resolution: float, text: str) -> None:
    with pytest.raises(ValueError, match=text):
        Grid(cells, resolution, (0, 0))


def test_what_comes_and_goes_leaves_the_costs_as_a_fresh_planner_has_them(flat: Any) -> None:
    door = {'D1': flat.DOOR}
    planner = GridPlanner(flat.grid)
    untouched = planner.cost.copy()
    rng = np.random.default_rng(4)
    for closed in (door, {}, door):
        points = rng.uniform((0.3, 0.3), (6.8, 3.0), (12, 2))
        planner.set_closed(closed)
        planner.set_obstacles(points)
        fresh = GridPlanner(flat.grid)
        fresh.set_obstacles(points)
        fresh.set_closed(closed)
        np.testing.assert_allclose(planner.cost, fresh.cost, atol=1e-5)
    planner.set_closed({})
    planner.set_obstacles([])
    np.testing.assert_allclose(planner.cost, untouched, atol=1e-5)


def test_a_way_goes_round_a_keep_out_zone_and_out_of_it() -> None:
    grid = Grid(np.zeros((80, 160), np.int8), RESOLUTION)
    zones = zones_from({'keep_out_zones': {'Z': [3.5, 1, 4.5, 1, 4.5, 4, 3.5, 4]}})
    zone = zones.keep_out['Z']
    planner = GridPlanner(grid, ROBOT, zones=zones)
    path = planner.plan((1, 3), (7, 3))
    samples = geometry.equally_spaced(path, 0.05)
    assert min(zone.distance(point) for point in samples.tolist()) >= ROBOT.radius
    with pytest.raises(NoPathError, match='lies in the keep-out zone Z'):
        planner.plan((1, 3), (4, 2))
    with pytest.raises(NoPathError, match=r'is 0\.1. m from the keep-out zone Z'):
        planner.plan((1, 3), (3.36, 2))
    # Who is in it is let out by a short way, which is not barred by the zone itself.
    out = planner.plan((3.7, 2.5), (7, 3))
    inside = zone.contains(geometry.equally_spaced(out, 0.02)).sum() * 0.02
    assert inside < 1.2
    # Whole across: no way leads past it.
    wide = zones_from({'keep_out_zones': {'Z': [3.5, -1, 4.5, -1, 4.5, 5, 3.5, 5]}})
    with pytest.raises(NoPathError, match='the keep-out zone Z is in the way'):
        GridPlanner(grid, ROBOT, zones=wide).plan((1, 3), (7, 3))


def test_a_way_round_a_slow_zone_is_taken_where_it_is_faster() -> None:
    grid = Grid(np.zeros((100, 160), np.int8), RESOLUTION)

    def through(speed: float) -> float:
        zones = zones_from({'slow_zones': {'Z': [speed, 3, 1, 5, 1, 5, 4, 3, 4]}})
        path = GridPlanner(grid, ROBOT, zones=zones).plan((1, 2.5), (7, 2.5))
        return 0.05 * zones.slow['Z'].contains(geometry.equally_spaced(path, 0.05)).sum()

    assert through(0.5) == pytest.approx(2.0, abs=0.1)
    assert through(0.1) < 0.2, 'a corner at most'


def scattered(seed: int) -> Grid:
    """Return a map of 2.4 m x 3 m of some blocks, a part unknown, its corner at (-1, 2)."""
    draw = np.random.default_rng(seed)
    cells = np.zeros((24, 30), np.int8)
    for _ in range(3):
        row, column = (int(draw.integers(0, size)) for size in (20, 26))
        cells[row : row + 2, column : column + 3] = 100
    cells[:3, :2] = -1
    return Grid(cells, 0.1, (-1.0, 2.0))


SLOW = {'slow_zones': {'S': [0.2, 0.05, 2.05, 0.85, 2.05, 0.85, 3.15, 0.05, 3.15]}}
BARRED = {'keep_out_zones': {'K': [1.45, 3.55, 1.75, 3.55, 1.75, 3.85, 1.45, 3.85]}}


@pytest.mark.parametrize('seed', range(4))
def test_what_each_cell_costs_is_what_its_distances_say(seed: int) -> None:
    grid, draw = scattered(seed), np.random.default_rng(seed)
    robot = PlanningParameters(radius=0.11, margin=0.08, comfort=0.35, aversion=2.0, waiting=50.0)
    planner = GridPlanner(grid, robot, zones=zones_from(SLOW | BARRED))
    points = draw.uniform((-0.9, 2.1), (1.9, 4.3), (6, 2))
    stay = np.arange(6) % 2 == 0
    door = (-0.5, 4.0, 0.3, 4.0)
    planner.set_obstacles(np.array([[1.0, 3.0]]))
    planner.set_closed({'D': door})
    planner.set_obstacles(points, stay)

    def cells_at(places: np.ndarray) -> set[tuple[int, int]]:
        return {(math.floor((y - 2) / 0.1), math.floor((x + 1) / 0.1)) for x, y in places}

    along = np.linspace(door[:2], door[2:], 60)
    walls = {(int(row), int(column)) for row, column in np.argwhere(grid.cells != 0)}
    barred = {
        (row, column)
        for row, column in np.ndindex(grid.cells.shape)
        if 24 <= column <= 27 and 15 <= row <= 18
    }
    firm = walls | barred | cells_at(points[stay]) | cells_at(along)
    loose = firm | cells_at(points[~stay])

    def spare(row: int, column: int, cells: set[tuple[int, int]]) -> float:
        gap = 0.1 * min(math.hypot(row - r, column - c) for r, c in cells) - 0.05
        return gap - 0.11 - 0.08

    def price(room: float) -> float:
        return 1 + 2.0 * min(max(1 - room / 0.35, 0), 1) ** 2

    counted = 0
    for row, column in np.ndindex(grid.cells.shape):
        slower = 3.0 if 10 <= column <= 18 and row <= 11 else 1.0
        room, firm_room = spare(row, column, loose), spare(row, column, firm)
        if min(abs(room), abs(firm_room)) < 1e-6:
            continue
        if room > 0:
            expected = price(room) * slower
        else:
            expected = 50.0 * price(firm_room) * slower if firm_room > 0 else -1.0
        assert planner.cost[row, column] == pytest.approx(expected, rel=1e-4)
        counted += 1
    assert counted > 500


@pytest.mark.parametrize('seed', range(3))
def test_a_straight_line_costs_what_its_samples_cost(seed: int) -> None:
    grid, draw = scattered(seed), np.random.default_rng(seed)
    planner = GridPlanner(grid, PlanningParameters(radius=0.1, margin=0.08))
    infinite = 0
    for _ in range(30):
        begin, end = draw.uniform((-0.9, 2.1), (1.9, 4.3), (2, 2))
        length = math.dist(begin, end)
        count = math.ceil(length / 0.05) + 1
        samples = [begin + (end - begin) * n / (count - 1) for n in range(count)]
        costs = [float(planner.cost[int((y - 2) / 0.1), int((x + 1) / 0.1)]) for x, y in samples]
        found = planner._price(begin, end)
        if any(cost < 0 for cost in costs[1:-1]):
            assert math.isinf(found)
            infinite += 1
        else:
            assert found == pytest.approx(sum(map(abs, costs)) / count * length)
    assert 0 < infinite < 30
    here = grid.centre_of(12, 15)
    assert planner._price(np.array(here), np.array(here)) == 0.0


@pytest.mark.parametrize('seed', range(6))
def test_a_path_costs_hardly_more_than_the_cheapest_of_the_grid(seed: int) -> None:
    grid = scattered(seed)
    planner = GridPlanner(grid, PlanningParameters(radius=0.06, margin=0.08, comfort=0.3))
    start, goal = np.array([1.65, 2.35]), np.array([-0.65, 4.05])
    path = planner.plan(start, goal)
    search = MCP_Geometric(np.where(planner.cost > 0, planner.cost, -1))
    ends = [(int((y - 2) / 0.1), int((x + 1) / 0.1)) for x, y in (start, goal)]
    costs, _ = search.find_costs([ends[0]], [ends[1]])
    cheapest = 0.1 * float(costs[ends[1]])
    paid = sum(planner._price(a, b) for a, b in pairwise(path))
    assert paid <= 1.06 * cheapest
    # Rounded: it nowhere turns by much at once.
    ways = np.diff(path, axis=0)
    ways = ways[np.hypot(*ways.T) > 1e-6]
    turns = np.diff(np.unwrap(np.arctan2(ways[:, 1], ways[:, 0])))
    assert np.abs(turns).max(initial=0.0) < 0.8


def test_a_corner_is_rounded_by_a_curve_from_arm_to_arm() -> None:
    grid = Grid(np.zeros((60, 60), np.int8), 0.05)
    planner = GridPlanner(grid, PlanningParameters(radius=0.1, corner=0.41))
    path = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 0.9]])
    found = planner._rounded(path)
    # Half of the shorter arm, and what rounding may take of the longer one.
    entry, corner, leave = np.array([1.09, 0.5]), path[1], np.array([1.5, 0.7])
    assert found[0] == pytest.approx(path[0])
    assert found[1] == pytest.approx(entry)
    assert found[-2] == pytest.approx(leave)
    assert found[-1] == pytest.approx(path[2])
    count = 2 * math.ceil(0.61 / 0.05) + 1
    share = np.array([*range(0, count - 1, count // 6), count - 1])[:, None] / (count - 1)
    curve = (1 - share) ** 2 * entry + 2 * share * (1 - share) * corner + share**2 * leave
    assert found[1:-1] == pytest.approx(curve)
    assert planner._rounded(path[:2]) == pytest.approx(path[:2])
    # What is in the way of the curve makes it smaller, or leaves the corner as it is.
    planner.set_obstacles([(1.32, 0.72)])
    smaller = planner._rounded(path)
    assert smaller[1] == pytest.approx([1.295, 0.5])
    assert smaller[-2] == pytest.approx([1.5, 0.6])
    planner.set_obstacles([(1.45, 0.55)])
    assert planner._rounded(path) == pytest.approx(path)


def test_where_a_path_of_cells_turns() -> None:
    steps = np.array([[0, 0], [1, 0], [2, 0], [3, 1], [4, 2], [4, 3]]) * 0.05
    assert _corners(steps).tolist() == [0, 2, 4, 5]
    assert _corners(steps[:3]).tolist() == [0, 2]
    assert _corners(steps[:2]).tolist() == [0, 1]
    assert _corners(steps[:1]).tolist() == [0]


def test_along_a_path_a_robot_looks_ahead_and_turns_at_its_corners() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.5]])
    poses = _poses_along(path, 0.4)
    first = [(0.0, 0.0, 0.0), (1 / 3, 0.0, 0.0), (2 / 3, 0.0, 0.0), (1.0, 0.0, 0.0)]
    turns = [(1.0, 0.0, math.pi / 2 * n / 16) for n in range(17)]
    last = [(1.0, y, math.pi / 2) for y in (0.0, 0.25, 0.5)]
    assert poses == pytest.approx(np.array([*first, *turns, *last]))
    assert _poses_along(path[1:3], 0.4).shape == (0, 3)
    back = _poses_along(np.array([[0.0, 0.0], [-1.0, 0.1], [-2.0, 0.0]]), 9.0)
    assert np.abs(np.diff(np.unwrap(back[:, 2]))).max() < 0.11, 'over the half circle the short way'


def test_where_a_long_robot_touches_something_cells_become_dear_until_the_search_ends() -> None:
    grid = Grid(np.zeros((40, 60), np.int8), 0.05)
    long = (0.5, 0.1, -0.5, 0.1, -0.5, -0.1, 0.5, -0.1)
    planner = GridPlanner(grid, PlanningParameters(footprint=long, margin=0.04))
    path = np.array([[0.6, 1.025], [1.5, 1.025], [1.5, 1.4]])
    assert planner._touches(path) is None
    planner.set_obstacles([(1.83, 1.3)])
    # Turning at the corner its rear or its front swings over the obstacle.
    touched = planner._touches(path)
    assert touched is not None
    assert touched == pytest.approx([1.5, 1.025])
    assert planner._touches(path[:1]) is None
    planner.set_obstacles([(1.262, 1.062)])
    touched = planner._touches(path)
    assert touched is not None
    # Its front is 0.5 m ahead of it, and what it meets is as large as its cell.
    assert touched == pytest.approx([0.75, 1.025], abs=0.051)
    planner.set_obstacles([])
    before = planner.cost.copy()
    window, old = planner._made_dear(np.array([1.01, 0.02]))
    assert (old == before[window]).all()
    for row, column in np.ndindex(grid.cells.shape):
        near = (row - 0) ** 2 + (column - 20) ** 2 <= 4
        dear = 30.0 if near and before[row, column] > 0 else 0.0
        assert planner.cost[row, column] == pytest.approx(before[row, column] + dear)


def test_cells_around_one_come_nearest_first() -> None:
    planner = GridPlanner(Grid(np.zeros((10, 12), np.int8), 0.1), PlanningParameters(radius=0.1))
    wanted = np.zeros((10, 12), np.bool_)
    for cell in [(2, 2), (2, 4), (5, 5), (1, 1), (4, 3), (9, 11), (2, 5), (0, 0)]:
        wanted[cell] = True
    found = list(planner._cells_around((2, 2), 0.3, wanted))
    assert found == [(2, 2), (1, 1), (2, 4), (4, 3), (0, 0), (2, 5)]
    assert list(planner._cells_around((0, 11), 0.29, wanted)) == []


UNKNOWN = np.zeros((80, 161), np.int8)
UNKNOWN[40:, :80] = -1


@pytest.mark.parametrize(
    ('obstacles', 'closed', 'goal', 'text'),
    [
        (
            [(3.0, 2.0)],
            {},
            (3.1, 2.0),
            None,
        ),
        (
            [],
            {'D2': (6.0, 0.0, 6.0, 4.0)},
            (7.0, 2.0),
            'no path from (1.00, 1.00) to (7.00, 2.00): the closed door D2 is in the way',
        ),
        (
            [],
            {},
            (9.0, 1.0),
            'the goal (9.00, 1.00) lies outside of the map, which goes from (0.00, 0.00) to '
            '(8.05, 4.00)',
        ),
        (
            [],
            {},
            (0.16, 1.0),
            'the goal (0.16, 1.00) is 0.12 m from a wall: expected at least 0.25 m',
        ),
    ],
)
def test_why_there_is_no_path_is_said_in_one_line(
    obstacles: list[tuple[float, float]],
    closed: dict[str, tuple[float, float, float, float]],
    goal: tuple[float, float],
    text: str | None,
) -> None:
    planner = GridPlanner(two_rooms(), ROBOT, {'D1': (4.02, 1.5, 4.02, 2.5)})
    planner.set_obstacles(obstacles)
    planner.set_closed(closed)
    if text is None:
        assert len(planner.plan((1, 1), goal)) >= 2
        return
    with pytest.raises(NoPathError) as caught:
        planner.plan((1, 1), goal)
    assert str(caught.value) == text


def test_where_the_map_is_unknown_is_said() -> None:
    planner = GridPlanner(Grid(UNKNOWN, RESOLUTION), ROBOT)
    with pytest.raises(NoPathError) as caught:
        planner.plan((1, 1), (1, 3))
    assert str(caught.value) == 'the goal (1.00, 3.00) lies where the map is unknown'


@pytest.mark.parametrize('start', [(0.2, 1.0), (1.0, 0.1), (0.07, 0.07)])
def test_who_stands_too_near_to_a_wall_leaves_it_straight(start: tuple[float, float]) -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    path = planner.plan(start, (3, 2))
    assert path[0] == pytest.approx(start)
    gaps = [float(planner.clearance(point)[0]) for point in geometry.equally_spaced(path[:2], 0.02)]
    assert all(later > gap - 0.013 for gap, later in pairwise(gaps))
    assert gaps[-1] >= ROBOT.radius + ROBOT.margin - 0.03


def test_who_stands_between_obstacles_without_a_way_out_is_told_so() -> None:
    planner = GridPlanner(two_rooms(), ROBOT)
    ring = [(1 + 0.2 * math.cos(a), 1 + 0.2 * math.sin(a)) for a in np.linspace(0, 6.2, 40)]
    planner.set_obstacles(ring)
    with pytest.raises(NoPathError) as caught:
        planner.plan((1, 1), (3, 2))
    assert 'the start (1.00, 1.00) is 0.' in str(caught.value)
    assert str(caught.value).endswith('expected at least 0.25 m')
    planner.set_obstacles(ring, np.zeros(len(ring), np.bool_))
    assert planner.plan((1, 1), (3, 2))[0] == pytest.approx((1, 1)), 'they may leave'


def test_who_stands_in_a_keep_out_zone_is_let_out_past_what_else_is_known() -> None:
    grid = Grid(np.zeros((80, 160), np.int8), RESOLUTION)
    zones = zones_from(
        {'keep_out_zones': {'Z': [3, 1, 5, 1, 5, 3, 3, 3], 'Y': [5.3, 0, 5.6, 0, 5.6, 3, 5.3, 3]}}
    )
    planner = GridPlanner(grid, ROBOT, zones=zones)
    planner.set_obstacles([(5.0, 3.4), (2.0, 2.0)], np.array([True, False]))
    planner.set_closed({'D': (5.5, 3.0, 5.5, 3.3)})
    path = geometry.equally_spaced(planner.plan((4.8, 2.0), (7, 2)), 0.02)
    assert zones.keep_out['Y'].contains(path).sum() == 0
    assert np.hypot(*(path - (5.0, 3.4)).T).min() >= ROBOT.radius
    assert (path[:, 1] > 3.3 + ROBOT.radius).any(), 'past the closed door'
    inside = zones.keep_out['Z'].contains(path).sum() * 0.02
    assert inside < 1.3


def test_on_a_map_without_any_wall_all_is_free() -> None:
    planner = GridPlanner(Grid(np.zeros((40, 40), np.int8), RESOLUTION), ROBOT)
    path = planner.plan((0.51, 0.52), (1.5, 1.4))
    assert path == pytest.approx(np.array([(0.51, 0.52), (1.5, 1.4)]))
    assert planner.is_free(path)
    assert not planner.is_free([(0.5, 0.5), (2.1, 0.5)]), 'off the map'
    assert np.isinf(planner.clearance(path)).all()
