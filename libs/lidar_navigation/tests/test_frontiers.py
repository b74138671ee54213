"""Where the known ends, and which part of that comes first."""

from __future__ import annotations

import math

import numpy as np
import pytest
from skimage.graph import MCP_Geometric

from floor_plans import Grid
from lidar_navigation import FrontierParameters
from lidar_navigation.exploration.frontiers import find_frontiers, frontier_cells, travel_costs

SIDE = 0.1


def room(*unknown: tuple[int, int, int, int]) -> Grid:
    """Return a hall of 8 m x 4 m with walls, of which windows (rows, columns) are not known."""
    cells = np.zeros((40, 80), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    for top, bottom, left, right in unknown:
        cells[top:bottom, left:right] = -1
    return Grid(cells, SIDE)


def costs(grid: Grid) -> np.ndarray:
    cost = np.where(grid.free, 1.0, -1.0).astype(np.float32)
    cost[[1, -2]] = -1.0
    cost[:, [1, -2]] = -1.0
    return cost


def test_a_frontier_is_free_and_beside_what_is_unknown() -> None:
    grid = room((10, 20, 30, 40))
    found = frontier_cells(grid)
    for row, column in np.ndindex(grid.cells.shape):
        window = grid.cells[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2]
        rim = row in (0, 39) or column in (0, 79)
        expected = grid.cells[row, column] == 0 and ((window < 0).any() or rim)
        assert found[row, column] == expected


def test_the_way_to_each_cell_is_that_of_the_grid_in_metres() -> None:
    grid = room()
    cost = costs(grid)
    cost[15:25, 38:42] = -1.0
    search = MCP_Geometric(cost)
    expected, _ = search.find_costs([grid.cell_of(1.05, 2.05)])
    found = travel_costs(grid, cost, (1.05, 2.05, 0.0))
    free = cost > 0
    assert found[free] == pytest.approx(expected[free] * SIDE)
    assert np.isinf(found[~free]).all()
    # From where it does not fit it begins at the nearest cell within 0.6 m.
    inside = travel_costs(grid, cost, (3.85, 2.05, 0.0))
    assert np.unravel_index(np.argmin(inside), inside.shape) == (20, 37)
    cost[10:31, 30:50] = -1.0
    assert np.isinf(travel_costs(grid, cost, (4.0, 2.0, 0.0))).all()


def two_frontiers(**more: float) -> list[tuple[float, float]]:
    """Return length and worth of the frontiers, west 1 m and east 4 m long, seen from between."""
    grid = room((16, 26, 1, 11), (1, 39, 68, 79))
    # East of 6.7 m nothing is known; in the west a square of 1 m beside the wall.
    found = find_frontiers(grid, costs(grid), (4.0, 2.0, 0.0), FrontierParameters(**more))
    return [(each.length, each.worth) for each in found]


def test_what_is_near_long_and_ahead_comes_first() -> None:
    (east, west) = two_frontiers()
    assert east[0] == pytest.approx(3.8, abs=0.11)
    assert west[0] == pytest.approx(1.3, abs=0.2)
    # Ahead by about 2.7 m, less 0.3 m for each metre of its length.
    assert east[1] == pytest.approx(2.5 - 0.3 * east[0], abs=0.25)
    # Behind by about 2.8 m: a half turn counts as pi * 0.4 m.
    assert west[1] == pytest.approx(2.7 + math.pi * 0.4 - 0.3 * west[0], abs=0.35)
    assert [each[0] for each in two_frontiers(least=1.5)] == [east[0]]
    plain = two_frontiers(turning=0.0, gain=0.0)
    assert sorted(each[1] for each in plain) == pytest.approx([2.5, 2.7], abs=0.35)
    short = two_frontiers(most_gain=1.0)
    assert short[0][1] == pytest.approx(east[1] + 0.3 * (east[0] - 1.0), abs=1e-6)


def test_a_frontier_that_nobody_can_look_over_comes_last() -> None:
    grid = room((1, 39, 68, 79), (16, 26, 1, 11))
    cost = costs(grid)
    cost[:, 50:] = -1.0
    found = find_frontiers(grid, cost, (4.0, 2.0, 0.0), FrontierParameters())
    assert [each.viewpoint is None for each in found] == [False, True]
    assert math.isinf(found[1].worth)
    assert math.isinf(found[1].path_length)
    assert found[1].middle == pytest.approx([6.75, 2.0], abs=0.11)
    viewpoint = found[0].viewpoint
    assert viewpoint is not None
    away = np.hypot(*(found[0].points - viewpoint).T).min()
    assert away <= 0.6 + SIDE


def test_what_a_wall_hides_is_not_looked_at_through_it() -> None:
    grid = room((1, 39, 45, 79))
    cells = grid.cells.copy()
    cells[1:39, 42] = 100  # a wall between the robot and the frontier
    walled = Grid(cells, SIDE)
    (only,) = find_frontiers(walled, costs(walled), (2.0, 2.0, 0.0), FrontierParameters())
    assert only.viewpoint is None
