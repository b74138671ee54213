"""What of a map is in view from a point: beams that end at what is not free."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from floor_plans.occupancy_grid import OCCUPIED_FROM, Grid
from floor_plans.shapes import Point


def in_view(
    grid: Grid,
    spot: Point,
    reach: float,
    *,
    beams: int = 0,
    ahead: float = 0.0,
    angle: float = math.tau,
) -> NDArray[np.bool_]:
    """Return the free cells that are in view from a point, shape of the map.

    Args:
        grid: The map; what is occupied or unknown ends a beam.
        spot: From where, map frame, metres.
        reach: So far, metres.
        beams: How many; 0: so many that no cell at the end of the reach lies between two.
        ahead: The middle of what is in view, map frame, rad.
        angle: How much of the horizon is, rad.
    """
    count = beams or max(8, math.ceil(angle * reach / grid.resolution))
    angles = ahead + np.linspace(-angle / 2, angle / 2, count, endpoint=angle < math.tau)
    along = np.arange(0.0, reach, grid.resolution / 2)
    x = spot[0] + np.cos(angles)[:, None] * along
    y = spot[1] + np.sin(angles)[:, None] * along
    cells = grid.cells_of(np.stack([x.ravel(), y.ravel()], axis=1))
    inside = grid.contains(cells)
    rows = np.clip(cells[:, 0], 0, grid.cells.shape[0] - 1)
    columns = np.clip(cells[:, 1], 0, grid.cells.shape[1] - 1)
    found = grid.cells[rows, columns]
    is_free = inside & (found >= 0) & (found < OCCUPIED_FROM)
    blocked = ~is_free.reshape(count, len(along))
    open_ = np.logical_and.accumulate(~blocked, axis=1).ravel()
    seen = np.zeros(grid.cells.shape, np.bool_)
    seen[rows[open_], columns[open_]] = True
    return seen
