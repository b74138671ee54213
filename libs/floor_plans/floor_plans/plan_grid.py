"""A floor plan drawn on a grid: its walls, its zones, and what is free between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from floor_plans import boxes
from floor_plans.floor_plan import WALL_THICKNESS, FloorPlan, Point
from floor_plans.occupancy_grid import OCCUPIED, UNKNOWN, Grid, drawn_lines, outlines
from floor_plans.zones import Zone


def draw(plan: FloorPlan, resolution: float = 0.05, margin: float = 0.5) -> Grid:
    """Return the occupancy grid of a place.

    A cell is occupied when its centre lies within half a cell of a wall, unknown when no place
    reaches it, else free. A place with a map has the map's cells, with its own walls added; one
    with neither is free all over.

    Args:
        plan: The place.
        resolution: Side of a cell, metres; that of a map is the map's own.
        margin: Width of the unknown border around the walls, metres.
    """
    import cv2

    solid = walled(plan, plan.wall_pieces(), resolution, margin)
    if plan.map is not None or not plan.walls:
        return solid
    reached = cv2.connectedComponents(solid.free.astype(np.uint8), connectivity=4)[1]
    inside = {reached[solid.cell_of(x, y)] for x, y, _ in plan.place.positions.values()} - {0}
    solid.cells[solid.free & ~np.isin(reached, list(inside))] = UNKNOWN
    return solid


def walled(
    plan: FloorPlan,
    lines: list[tuple[Point, Point]],
    resolution: float = 0.05,
    margin: float = 0.5,
) -> Grid:
    """Return a grid around a place on which walls stand along lines.

    All else is free, or as the place's map has it.
    """
    if plan.map is not None:
        return walled_off(plan.map.grid, lines)
    west, south, east, north = plan.bounds
    # The corner of the grid falls on a multiple of the resolution: maps of one place line up.
    origin_x = math.floor((west - margin) / resolution) * resolution
    origin_y = math.floor((south - margin) / resolution) * resolution
    columns = math.ceil((east + margin - origin_x) / resolution)
    rows = math.ceil((north + margin - origin_y) / resolution)
    cells = np.zeros((rows, columns), np.int8)
    return walled_off(Grid(cells, resolution, (origin_x, origin_y)), lines)


def walled_off(grid: Grid, lines: Sequence[tuple[Point, Point]]) -> Grid:
    """Return a grid with walls along lines, metres."""
    cells = grid.cells.copy()
    solid = boxes.boxes_around(lines, WALL_THICKNESS)
    _paint(cells, grid.resolution, grid.origin, solid)
    return Grid(cells, grid.resolution, grid.origin)


def _paint(
    cells: NDArray[np.int8], resolution: float, origin: tuple[float, float], solid: boxes.Array
) -> None:
    """Make the cells occupied that lie within half a cell of boxes."""
    rows, columns = cells.shape
    origin_x, origin_y = origin
    reach = resolution / 2
    for box, corners in zip(solid, boxes.corners(solid), strict=True):
        low = np.floor((corners.min(axis=0) - reach - (origin_x, origin_y)) / resolution)
        high = np.ceil((corners.max(axis=0) + reach - (origin_x, origin_y)) / resolution)
        first_column, first_row = np.maximum(low.astype(int), 0)
        last_column, last_row = np.minimum(high.astype(int), (columns, rows))
        if first_column >= last_column or first_row >= last_row:
            continue
        x = origin_x + (np.arange(first_column, last_column) + 0.5) * resolution
        y = origin_y + (np.arange(first_row, last_row) + 0.5) * resolution
        inside = boxes.distances(box[None], x[None, :], y[:, None])[..., 0] < reach - 1e-9
        cells[first_row:last_row, first_column:last_column][inside] = OCCUPIED


def solid_lines(plan: FloorPlan) -> list[tuple[Point, Point]]:
    """Return the centre lines of all that stands in a place with its doors open, metres.

    The walls' pieces, and the outlines of what its map shows.
    """
    lines = list(plan.wall_pieces())
    if plan.map is not None:
        for outline in outlines(plan.map.grid, plan.map.resolution):
            for (x1, y1), (x2, y2) in pairwise(outline.tolist()):
                if (x1, y1) != (x2, y2):
                    lines.append(((x1, y1), (x2, y2)))
    return lines


def zone_cells(grid: Grid, zone: Zone) -> NDArray[np.bool_]:
    """Return the cells of a zone: those whose centre lies inside, and those on its edge."""
    corners = [*zone.corners, zone.corners[0]]
    cells = drawn_lines(grid, [(*start, *end) for start, end in pairwise(corners)])
    west, south, east, north = zone.box
    bottom, left = np.maximum(grid.cell_of(west, south), 0)
    top, right = np.maximum(np.add(grid.cell_of(east, north), 1), 0)
    window = cells[bottom:top, left:right]
    if window.size:
        inside = np.argwhere(np.ones_like(window)) + np.array([bottom, left])
        window |= zone.contains(grid.centres_of(inside)).reshape(window.shape)
    return cells
