"""Planning on a grid: paths that are free and short, and reasons where there is none."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from skimage.graph import MCP_Geometric

from surveillance_controllers import geometry
from surveillance_controllers.planning.grid_planning import (
    GridPlanner,
    NoPathError,
    PlanningParameters,
)
from surveillance_runtime.place.occupancy_grid import Grid, distance_to, drawn_lines, with_walls
from surveillance_runtime.place.zones import zones_from

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
