"""The rooms of a map: which part of the floor belongs to which place.

Walls and the lines of doors cut the free cells into parts; the part around a place's point is that
place. Where places share one part, each cell belongs to the nearest of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surveillance_operator.snapshot import Box, Grid

OCCUPIED = 65
"""From this on a cell is a wall, as nav2's map_server has it by default, percent."""
MOST_CELLS = 200_000
"""Of a larger map several cells are taken together."""

Line = tuple[float, float, float, float]


@dataclass(frozen=True)
class Region:
    """The floor of one place.

    Attributes:
        boxes: Rectangles that cover it, map frame, metres.
        label: A point for the place's name: far from walls, and not where the robot stops.
        room: The distance from there to the nearest wall, metres.
    """

    boxes: tuple[Box, ...]
    label: tuple[float, float]
    room: float


def regions(
    grid: Grid, positions: Mapping[str, tuple[float, float]], doors: Mapping[str, Line]
) -> dict[str, Region]:
    """Return the region of each place whose point lies on free floor.

    Args:
        grid: The map.
        positions: A point in each place, metres.
        doors: The doors' openings: x1, y1, x2, y2, metres.
    """
    # Only here: most processes never draw a map and need not wait for the import.
    from scipy import ndimage

    free, side = _free(grid)
    for line in doors.values():
        free[_cells_along(line, grid, side, free.shape)] = False
    parts, _ = ndimage.label(free)
    owners: dict[int, list[str]] = {}
    points = {}
    for name, point in sorted(positions.items()):
        column, row = (int((point[i] - grid.origin[i]) // side) for i in (0, 1))
        if 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and parts[row, column]:
            points[name] = (row + 0.5, column + 0.5)
            owners.setdefault(int(parts[row, column]), []).append(name)
    found = {}
    boxes = ndimage.find_objects(parts)
    for part, names in owners.items():
        # Only the part's own box is looked at: a map may have hundreds.
        rows, columns = boxes[part - 1]
        mask = parts[rows, columns] == part
        inside = [(points[n][0] - rows.start, points[n][1] - columns.start) for n in names]
        x, y = grid.origin
        corner = x + side * columns.start, y + side * rows.start
        nearest = _nearest(mask, inside)
        for number, name in enumerate(names):
            found[name] = _region(mask & (nearest == number), inside[number], corner, side)
    return found


def _free(grid: Grid) -> tuple[NDArray[np.bool_], float]:
    """Return which cells are free, and the side of a cell, metres."""
    factor = int(np.ceil(np.sqrt(max(1.0, grid.cells.size / MOST_CELLS))))
    free = (grid.cells >= 0) & (grid.cells < OCCUPIED)
    rows, columns = (size // factor * factor for size in free.shape)
    blocks = free[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor)
    coarse: NDArray[np.bool_] = np.all(blocks, axis=(1, 3))
    return coarse, grid.resolution * factor


def _cells_along(
    line: Line, grid: Grid, side: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return rows and columns of the cells on a line and beside it."""
    start, end = np.array(line[:2]), np.array(line[2:])
    steps = max(2, int(3 * np.hypot(*(end - start)) / side))
    points = start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)
    cells = np.floor((points - grid.origin) / side).astype(int)
    around = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    cells = (cells[:, None] + around).reshape(-1, 2)
    inside = ((cells >= 0) & (cells < (shape[1], shape[0]))).all(axis=1)
    return cells[inside, 1], cells[inside, 0]


def _nearest(mask: NDArray[np.bool_], points: list[tuple[float, float]]) -> NDArray[np.int_]:
    rows, columns = np.indices(mask.shape)
    distances = [np.hypot(rows + 0.5 - row, columns + 0.5 - column) for row, column in points]
    nearest: NDArray[np.int_] = np.argmin(distances, axis=0)
    return nearest


def _region(
    mask: NDArray[np.bool_], point: tuple[float, float], origin: tuple[float, float], side: float
) -> Region:
    from scipy import ndimage

    inside = ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    rows, columns = np.indices(mask.shape)
    # The robot stops at the point and would hide a name there; above it is better than below.
    away = np.hypot(rows + 0.5 - point[0], columns + 0.5 - point[1]) + 0.02 * rows
    row, column = np.unravel_index(np.argmax(np.minimum(inside, 0.8 * away)), mask.shape)
    x, y = origin
    label = (x + side * (float(column) + 0.5), y + side * (float(row) + 0.5))
    boxes = tuple(
        (x + side * left, y + side * bottom, x + side * right, y + side * top)
        for left, bottom, right, top in _rectangles(mask)
    )
    return Region(boxes, label, side * float(inside[row, column]))


def _rectangles(mask: NDArray[np.bool_]) -> list[tuple[int, int, int, int]]:
    """Return rectangles that cover a mask: left, bottom, right, top, in cells."""
    done: list[tuple[int, int, int, int]] = []
    growing: dict[tuple[int, int], int] = {}
    for row in range(mask.shape[0] + 1):
        runs: set[tuple[int, int]] = set()
        if row < mask.shape[0]:
            edges = np.flatnonzero(np.diff(np.pad(mask[row], 1).astype(np.int8)))
            runs = {(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)}
        for run in growing.keys() - runs:
            done.append((run[0], growing.pop(run), run[1], row))
        for run in runs - growing.keys():
            growing[run] = row
    return sorted(done)
