"""What a map shows as solid: how far it is and what rays meet, beside each cell on its own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from surveillance_simulation.world.map_surface import MapSurface

SIDE, ORIGIN = 0.1, (-1.0, 2.0)


@pytest.fixture(scope='module')
def grid() -> Grid:
    cells = np.zeros((60, 70), np.int8)
    cells[10, 12] = cells[30:33, 40] = cells[50, 20:30] = 100
    cells[5, 60] = -1
    return Grid(cells, SIDE, ORIGIN)


def squares(grid: Grid) -> np.ndarray:
    """Return west, south, east, north of each solid cell, shape (n, 4)."""
    rows, columns = np.nonzero(grid.occupied)
    west, south = ORIGIN[0] + columns * SIDE, ORIGIN[1] + rows * SIDE
    return np.column_stack([west, south, west + SIDE, south + SIDE])


def test_the_clearance_is_that_to_the_nearest_square(grid: Grid) -> None:
    surface, solid = MapSurface(grid), squares(grid)
    rng = np.random.default_rng(1)
    for x, y in rng.uniform((-1.0, 2.0), (6.0, 8.0), (200, 2)):
        dx = np.maximum(np.maximum(solid[:, 0] - x, x - solid[:, 2]), 0.0)
        dy = np.maximum(np.maximum(solid[:, 1] - y, y - solid[:, 3]), 0.0)
        true = float(np.hypot(dx, dy).min())
        found = surface.clearance(x, y)
        if true < 18 * SIDE:
            assert found == pytest.approx(true, abs=1e-9)
        else:  # Far away a little less will do.
            assert true - 2 * math.sqrt(2) * SIDE - 1e-9 <= found <= true + 1e-9
    assert surface.clearance(0.25, 3.05) == 0.0
    assert surface.clearance(-1.01, 5.0) == math.inf
    empty = MapSurface(Grid(np.zeros((5, 5), np.int8), SIDE))
    assert empty.clearance(0.2, 0.2) == math.inf


@pytest.mark.parametrize('start', [(1.0, 5.0), (5.5, 7.5), (-2.0, 5.1), (3.05, 5.15)])
def test_rays_end_at_the_face_of_the_first_square(grid: Grid, start: tuple[float, float]) -> None:
    x, y = start
    angles = np.concatenate([np.linspace(-math.pi, math.pi, 181), [0.0, math.pi / 2, -math.pi / 2]])
    direction = np.stack([np.cos(angles), np.sin(angles)])
    found = MapSurface(grid).ranges(x, y, direction, 8.0)
    with np.errstate(divide='ignore', invalid='ignore'):
        for ray, (dx, dy) in enumerate(direction.T):
            best = math.inf
            for west, south, east, north in squares(grid):
                across = sorted(((west - x) / dx, (east - x) / dx))
                along = sorted(((south - y) / dy, (north - y) / dy))
                enter, leave = max(across[0], along[0]), min(across[1], along[1])
                # A ray that grazes a corner may be said to meet it or not.
                if leave - max(enter, 0.0) > 0.03:
                    best = min(best, max(enter, 0.0))
            if math.isfinite(best) or not math.isfinite(found[ray]):
                assert found[ray] <= best + 1e-6
            if found[ray] < best - 1e-6:  # A corner that it grazes.
                at = np.array([x + found[ray] * dx, y + found[ray] * dy])
                edges = squares(grid)
                near = np.maximum(np.abs(at - (edges[:, :2] + edges[:, 2:]) / 2) - SIDE / 2, 0.0)
                assert np.hypot(*near.T).min() < 1e-6


def test_a_ray_that_meets_nothing_within_its_reach_is_infinite(grid: Grid) -> None:
    surface, east = MapSurface(grid), np.array([[1.0], [0.0]])
    assert surface.ranges(1.0, 5.05, east, 8.0)[0] == pytest.approx(2.0)
    assert surface.ranges(1.0, 5.05, east, 2.1)[0] == pytest.approx(2.0)
    assert surface.ranges(1.0, 5.05, east, 1.5)[0] == math.inf
    assert surface.ranges(1.0, 5.05, -east, 8.0)[0] == math.inf
