"""A place as a grid of cells: the map that planner and localisation work on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from surveillance_runtime.place import boxes
from surveillance_runtime.place.floor_plan import WALL_THICKNESS, FloorPlan

FREE = 0
OCCUPIED = 100
UNKNOWN = -1


@dataclass(frozen=True)
class Grid:
    """Cells of a plane, row 0 in the south, column 0 in the west.

    Attributes:
        cells: (rows, columns) int8: 0 free, 100 occupied, -1 unknown, as in nav_msgs/OccupancyGrid.
        resolution: Side of a cell, metres.
        origin: South-west corner of the cell in row 0 and column 0, metres.
    """

    cells: npt.NDArray[np.int8]
    resolution: float
    origin: tuple[float, float]

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Return row and column of the cell around a point (metres), which may lie outside."""
        return (
            math.floor((y - self.origin[1]) / self.resolution),
            math.floor((x - self.origin[0]) / self.resolution),
        )

    def centre_of(self, row: int, column: int) -> tuple[float, float]:
        """Return the centre of a cell, metres."""
        return (
            self.origin[0] + (column + 0.5) * self.resolution,
            self.origin[1] + (row + 0.5) * self.resolution,
        )

    def contains(self, row: int, column: int) -> bool:
        """Tell whether a cell lies on the grid."""
        rows, columns = self.cells.shape
        return 0 <= row < int(rows) and 0 <= column < int(columns)


def draw(plan: FloorPlan, resolution: float = 0.05, margin: float = 0.5) -> Grid:
    """Return the occupancy grid of a place.

    A cell is occupied when its centre lies within half a cell of a wall, unknown when no place
    reaches it, else free.

    Args:
        plan: The place.
        resolution: Side of a cell, metres.
        margin: Width of the unknown border around the walls, metres.
    """
    import cv2  # takes 0.2 s, and a node that only needs the rooms does without

    solid = _filled(
        plan, boxes.boxes_around(plan.wall_pieces(), WALL_THICKNESS), resolution, margin
    )
    free = (solid.cells == FREE).astype(np.uint8)
    reached = cv2.connectedComponents(free, connectivity=4)[1]
    inside = {reached[solid.cell_of(x, y)] for x, y, _ in plan.place.positions.values()} - {0}
    cells = solid.cells.copy()
    cells[(cells == FREE) & ~np.isin(reached, list(inside))] = UNKNOWN
    return Grid(cells, resolution, solid.origin)


def regions(plan: FloorPlan, resolution: float = 0.05) -> tuple[Grid, npt.NDArray[np.int32]]:
    """Return the grid with all doors closed, and each cell's region.

    Regions are connected pieces of free space, numbered from 1; cells of walls and doors belong to
    the region nearest to them, so that a doorway is divided along its middle.
    """
    import cv2  # see draw

    lines = plan.wall_pieces() + [door.ends for door in plan.doors.values()]
    grid = _filled(plan, boxes.boxes_around(lines, WALL_THICKNESS), resolution, margin=0.5)
    free = (grid.cells == FREE).astype(np.uint8)
    labels = cv2.connectedComponents(free, connectivity=4)[1]
    nearest = cv2.distanceTransformWithLabels(
        1 - free, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )[1]
    seeds = np.zeros(int(nearest.max()) + 1, np.int32)
    seeds[nearest[free == 1]] = labels[free == 1]
    return grid, seeds[nearest]


def _filled(plan: FloorPlan, solid: boxes.Array, resolution: float, margin: float) -> Grid:
    west, south, east, north = plan.bounds
    # The corner of the grid falls on a multiple of the resolution: maps of one place line up.
    origin_x = math.floor((west - margin) / resolution) * resolution
    origin_y = math.floor((south - margin) / resolution) * resolution
    columns = math.ceil((east + margin - origin_x) / resolution)
    rows = math.ceil((north + margin - origin_y) / resolution)
    cells = np.zeros((rows, columns), np.int8)
    reach = resolution / 2
    for box, corners in zip(solid, boxes.corners(solid), strict=True):
        low = np.floor((corners.min(axis=0) - reach - (origin_x, origin_y)) / resolution)
        high = np.ceil((corners.max(axis=0) + reach - (origin_x, origin_y)) / resolution)
        first_column, first_row = np.maximum(low.astype(int), 0)
        last_column, last_row = np.minimum(high.astype(int), (columns, rows))
        x = origin_x + (np.arange(first_column, last_column) + 0.5) * resolution
        y = origin_y + (np.arange(first_row, last_row) + 0.5) * resolution
        inside = boxes.distances(box[None], x[None, :], y[:, None])[..., 0] < reach - 1e-9
        cells[first_row:last_row, first_column:last_column][inside] = OCCUPIED
    return Grid(cells, resolution, (origin_x, origin_y))
