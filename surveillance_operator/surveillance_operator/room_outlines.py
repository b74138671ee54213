"""The rooms of a map: which part of the floor belongs to which place.

Walls and the lines of doors cut the free cells into parts; the part around a place's point is that
place. Where places share one part, each cell belongs to the nearest of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import (
    FREE,
    OCCUPIED,
    Box,
    distance_to,
    divided,
    drawn_lines,
)
from floor_plans.shapes import Segment

MOST_CELLS = 200_000
"""Of a larger map several cells are taken together."""


@dataclass(frozen=True)
class RoomOutline:
    """The floor of one place.

    Attributes:
        boxes: Rectangles that cover it, map frame, metres.
        label: A point for the place's name: far from walls, and not where the robot stops.
        room: The distance from there to the nearest wall, metres.
    """

    boxes: tuple[Box, ...]
    label: tuple[float, float]
    room: float


def room_outlines(
    grid: Grid, positions: Mapping[str, tuple[float, float]], doors: Mapping[str, Segment]
) -> dict[str, RoomOutline]:
    """Return the region of each place whose point lies on free floor.

    Args:
        grid: The map.
        positions: A point in each place, metres.
        doors: The doors' openings: x1, y1, x2, y2, metres.
    """
    import cv2  # Most processes never draw a map.

    coarse = _coarse(grid)
    across = drawn_lines(coarse, list(doors.values())).astype(np.uint8)
    free = coarse.free & (cv2.dilate(across, np.ones((3, 3), np.uint8)) == 0)
    parted = Grid(np.where(free, FREE, OCCUPIED).astype(np.int8), coarse.resolution, coarse.origin)
    placed = {name: at for name, at in sorted(positions.items()) if coarse.at(free, *at)}
    labels = divided(parted, list(placed.values()))
    found = {}
    for number, (name, at) in enumerate(placed.items(), start=1):
        mask = (labels == number) & free
        # Only the room's own box is looked at: a map may have hundreds.
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        bottom, left = int(rows[0]), int(columns[0])
        own = mask[bottom : rows[-1] + 1, left : columns[-1] + 1]
        row, column = coarse.cell_of(*at)
        corner = coarse.box(bottom, left, 0, 0)[:2]
        within = Grid(own.astype(np.int8), coarse.resolution, corner)
        found[name] = _outline(own, (row - bottom, column - left), within)
    return found


def _coarse(grid: Grid) -> Grid:
    """Return a grid of at most about `MOST_CELLS`, free where all of it is."""
    factor = min(math.ceil(math.sqrt(grid.cells.size / MOST_CELLS)), *grid.cells.shape)
    rows, columns = (size // factor * factor for size in grid.cells.shape)
    blocks = grid.free[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor)
    cells = np.where(blocks.all(axis=(1, 3)), FREE, OCCUPIED).astype(np.int8)
    return Grid(cells, grid.resolution * factor, grid.origin)


def _outline(mask: NDArray[np.bool_], cell: tuple[int, int], grid: Grid) -> RoomOutline:
    inside = distance_to(~np.pad(mask, 1), 1.0)[1:-1, 1:-1]
    rows, columns = np.indices(mask.shape)
    # The robot stops at the point and would hide a name there; above it is better than below, and
    # than beside it: a name is wider than high.
    beside = abs(columns - cell[1])
    away = np.hypot(rows - cell[0], beside / 3) + 0.02 * rows
    score = np.where(mask, np.minimum(inside, 0.8 * away) - 0.1 * beside, -np.inf)
    row, column = np.unravel_index(np.argmax(score), mask.shape)
    boxes = tuple(
        grid.box(bottom, left, top, right) for left, bottom, right, top in _rectangles(mask)
    )
    label = grid.centre_of(int(row), int(column))
    return RoomOutline(boxes, label, grid.resolution * float(inside[row, column]))


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
