"""What stands in a place by its map: the cells that the map shows as occupied.

A cell is a square that is solid as a whole. Distances come from a field that is computed once; a
ray advances by the distance that is free around it (sphere tracing), all rays at a time, and ends
at the face of the cell that it meets. What the map does not know is open.
"""

from __future__ import annotations

import math

import numpy as np

from floor_plans import Grid, shapes
from floor_plans.occupancy_grid import distance_to

_HALF_DIAGONAL = math.sqrt(0.5)


class MapSurface:
    """The surface of what a map shows.

    Args:
        grid: The map.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._occupied = grid.occupied
        self._away = distance_to(self._occupied, grid.resolution)

    def clearance(self, x: float, y: float) -> float:
        """Return the distance from a point to the nearest occupied cell, 0 inside one, metres."""
        grid = self._grid
        away = grid.at(self._away, x, y)
        if away is None:
            return math.inf
        # The nearest cell's middle is within this distance of the point; its faces are nearer.
        reach = away + grid.resolution * 2 * _HALF_DIAGONAL
        if away > 20 * grid.resolution:
            return float(away - grid.resolution * 2 * _HALF_DIAGONAL)
        row, column = grid.cell_of(x, y)
        steps = math.ceil(reach / grid.resolution)
        top, left = max(0, row - steps), max(0, column - steps)
        window = self._occupied[top : row + steps + 1, left : column + steps + 1]
        rows, columns = np.nonzero(window)
        if not len(rows):
            return float(away)
        side = grid.resolution
        dx = np.abs(grid.origin[0] + (columns + left + 0.5) * side - x) - side / 2
        dy = np.abs(grid.origin[1] + (rows + top + 0.5) * side - y) - side / 2
        return float(np.hypot(np.maximum(dx, 0.0), np.maximum(dy, 0.0)).min())

    def ranges(self, x: float, y: float, direction: shapes.Array, furthest: float) -> shapes.Array:
        """Return how far rays go before they meet an occupied cell, infinite beyond `furthest`.

        Args:
            x: Where they begin, metres.
            y: The same.
            direction: Unit vectors, shape (2, rays).
            furthest: Metres.

        Returns:
            Shape (rays,), metres.
        """
        grid, side = self._grid, self._grid.resolution
        rows, columns = grid.cells.shape
        (west, south), gone = grid.origin, np.zeros(direction.shape[1])
        found = np.full(direction.shape[1], np.inf)
        under_way = np.arange(direction.shape[1])
        flat_away, flat_occupied = self._away.ravel(), self._occupied.ravel()
        while under_way.size:
            dx, dy = direction[:, under_way]
            at = gone[under_way]
            column = np.floor((x + at * dx - west) / side).astype(np.intp)
            row = np.floor((y + at * dy - south) / side).astype(np.intp)
            inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            index = np.where(inside, row * columns + column, 0)
            hit = inside & flat_occupied[index]
            if hit.any():
                found[under_way[hit]] = _entered(
                    (x, y),
                    direction[:, under_way[hit]],
                    np.stack([column[hit], row[hit]]) * side + np.array([[west], [south]]),
                    side,
                )
            # Off the map nothing is known; a ray that comes onto it again goes in short steps.
            free = np.where(inside, flat_away[index] - 2 * _HALF_DIAGONAL * side, side)
            at = at + np.maximum(free, side / 4)
            gone[under_way] = at
            under_way = under_way[~hit & (at <= furthest)]
        return found


def _entered(
    start: tuple[float, float], direction: shapes.Array, corner: shapes.Array, side: float
) -> shapes.Array:
    """Return where rays enter the squares that they meet: south-west corners (2, n), metres."""
    slope = np.where(np.abs(direction) < 1e-12, 1e-12, direction)
    begin = np.array(start)[:, None]
    first, second = (corner - begin) / slope, (corner + side - begin) / slope
    enter: shapes.Array = np.minimum(first, second).max(axis=0)
    return np.maximum(enter, 0.0)
