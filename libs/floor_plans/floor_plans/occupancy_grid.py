"""A map as a grid of cells: distances on it, lines on it, its connected regions.

Cells are those of nav_msgs/OccupancyGrid: row 0 lies in the south, column 0 in the west; 0 is free,
100 occupied, -1 unknown. A point is x, y in metres in the map's frame; arrays of points have shape
(n, 2). OpenCV is imported where it is used: it takes 0.2 s, and many nodes have no map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from floor_plans import shapes
from floor_plans.shapes import WALL_THICKNESS, Point

FREE = 0
OCCUPIED = 100
UNKNOWN = -1
OCCUPIED_FROM = 65
"""Cells of this value and above are taken as occupied, as map_server and AMCL do by default."""

Box = tuple[float, float, float, float]
"""Left, bottom, right, top, metres."""
Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Grid:
    """A map.

    Attributes:
        cells: Occupancy, shape (rows, columns), int8.
        resolution: Side of a cell, metres.
        origin: South-west corner of row 0, column 0: x, y in metres.

    Raises:
        ValueError: The cells are no such array, or the resolution is not above 0.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.cells.ndim != 2 or 0 in self.cells.shape:
            raise ValueError(f'a map of shape {self.cells.shape}: expected rows and columns')
        if not self.resolution > 0:
            raise ValueError(f'a map of resolution {self.resolution}: expected more than 0 m')

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Where something is, shape (rows, columns)."""
        return np.asarray(self.cells >= OCCUPIED_FROM)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Where nothing is, as far as known, shape (rows, columns)."""
        return np.asarray((self.cells >= 0) & (self.cells < OCCUPIED_FROM))

    @property
    def bounds(self) -> Box:
        """What the whole map covers."""
        return self.box(0, 0, *self.cells.shape)

    @cached_property
    def known(self) -> Box:
        """What encloses all that is known; the whole map if nothing is."""
        rows, columns = (np.flatnonzero((self.cells >= 0).any(axis=axis)) for axis in (1, 0))
        if not rows.size:
            return self.bounds
        return self.box(rows[0], columns[0], rows[-1] + 1, columns[-1] + 1)

    def box(self, bottom: int, left: int, top: int, right: int) -> Box:
        """Return what the rows from bottom to before top cover of the columns from left to before
        right.
        """
        (x, y), side = self.origin, self.resolution
        return (
            x + side * float(left),
            y + side * float(bottom),
            x + side * float(right),
            y + side * float(top),
        )

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Return row and column of the cell around a point, which may lie outside of the map."""
        # In plain numbers, as `at` and `centre_of`: numpy takes ten times as long for one point.
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

    def at(self, field: NDArray[Any], x: float, y: float) -> Any:
        """Return what a field of the map's shape holds in the cell around a point, as a plain
        value; None off the map, where what is no number lies, too.
        """
        if not (math.isfinite(x) and math.isfinite(y)):
            return None
        row, column = self.cell_of(x, y)
        rows, columns = field.shape
        return field.item(row, column) if 0 <= row < rows and 0 <= column < columns else None

    def cells_of(self, points: ArrayLike) -> NDArray[np.intp]:
        """Return the row and column of each point, shape (n, 2); they may lie outside of the
        map.
        """
        # Coordinate by coordinate: numpy is slow on many short rows.
        xy = np.asarray(points, dtype=float).reshape(-1, 2).T
        columns_rows = np.floor((xy - np.reshape(self.origin, (2, 1))) / self.resolution)
        # Far outside, and what is no number, is outside: no larger number survives the conversion.
        cells: NDArray[np.intp] = np.fmin(np.fmax(columns_rows, -1), 2**40).astype(np.intp)
        return cells[::-1].T

    def centres_of(self, cells: ArrayLike) -> Points:
        """Return the centre of each cell (row, column), shape (n, 2), metres."""
        rows_columns = np.asarray(cells, dtype=float).reshape(-1, 2)
        return np.asarray((rows_columns[:, ::-1] + 0.5) * self.resolution + self.origin)

    def contains(self, cells: ArrayLike) -> NDArray[np.bool_]:
        """Return which cells (row, column) lie on the map, shape (n,)."""
        row, column = np.asarray(cells).reshape(-1, 2).T
        rows, columns = self.cells.shape
        return np.asarray((row >= 0) & (row < rows) & (column >= 0) & (column < columns))

    def interpolated(self, field: NDArray[np.float32], points: ArrayLike) -> Points:
        """Return the values of a field of the map's shape at points, bilinear between cell centres.

        Outside of the map the value is that of the nearest cell.

        Returns:
            Shape (n,).
        """
        xy = np.asarray(points, dtype=float).reshape(-1, 2)
        column = np.clip((xy[:, 0] - self.origin[0]) / self.resolution - 0.5, 0, None)
        row = np.clip((xy[:, 1] - self.origin[1]) / self.resolution - 0.5, 0, None)
        rows, columns = self.cells.shape
        row, column = np.minimum(row, rows - 1), np.minimum(column, columns - 1)
        low_row = np.minimum(row.astype(np.intp), max(rows - 2, 0))
        low_column = np.minimum(column.astype(np.intp), max(columns - 2, 0))
        up, right = row - low_row, column - low_column
        high_row = np.minimum(low_row + 1, rows - 1)
        high_column = np.minimum(low_column + 1, columns - 1)
        south_west = field[low_row, low_column]
        with np.errstate(invalid='ignore'):
            south = south_west * (1 - right) + field[low_row, high_column] * right
            north = field[high_row, low_column] * (1 - right) + field[high_row, high_column] * right
            values = south * (1 - up) + north * up
        # Distances to what the map has nothing of are infinite, also where they have no weight.
        return np.where(np.isinf(south_west), np.inf, values)


def distance_to(mask: NDArray[np.bool_], resolution: float) -> NDArray[np.float32]:
    """Return how far each cell's centre is from the centre of the nearest cell of `mask`, metres.

    Where `mask` is empty, the distance is infinite.
    """
    if not mask.any():
        return np.full(mask.shape, np.inf, dtype=np.float32)
    import cv2

    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(np.multiply(away, np.float32(resolution), out=away), dtype=np.float32)


def totals(
    labels: NDArray[np.integer[Any]], count: int, weights: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Return how many cells have each number from 0, or the sum of their weights, shape (count,).

    As numpy's `bincount`, some rows at a time: that makes 16 bytes of each cell.
    """
    found = np.zeros(count, np.intp if weights is None else np.float64)
    for top in range(0, len(labels), 256):
        rows = np.s_[top : top + 256]
        some = None if weights is None else weights[rows].ravel()
        found += np.bincount(labels[rows].ravel(), some, minlength=count)
    return found


def looked_up(
    table: NDArray[Any], labels: NDArray[Any], out: NDArray[Any] | None = None
) -> NDArray[Any]:
    """Return what a table has for the number of each cell, `table[labels]`; `out` may be `labels`.

    Some rows at a time: numpy makes 8 bytes of each index.
    """
    found = np.empty(labels.shape, table.dtype) if out is None else out
    for top in range(0, len(labels), 256):
        found[top : top + 256] = table[labels[top : top + 256]]
    return found


def boxes(labels: NDArray[np.integer[Any]]) -> dict[int, tuple[slice, slice]]:
    """Return the rows and columns that each number's cells lie in, without 0."""
    from scipy import ndimage  # takes 0.2 s: most only show a place

    found = ndimage.find_objects(labels)
    return {number: (box[0], box[1]) for number, box in enumerate(found, start=1) if box}


def points_on(line: ArrayLike, spacing: float) -> Points:
    """Points at most `spacing` metres apart on a segment x1, y1, x2, y2; shape (n, 2), n from 2."""
    x1, y1, x2, y2 = np.asarray(line, dtype=float)
    steps = max(2, int(np.ceil(np.hypot(x2 - x1, y2 - y1) / spacing)) + 1)
    share = np.linspace(0.0, 1.0, steps)[:, None]
    return np.asarray((1 - share) * (x1, y1) + share * (x2, y2))


def drawn_lines(grid: Grid, lines: ArrayLike) -> NDArray[np.bool_]:
    """Return the cells that line segments run through.

    Args:
        grid: The map.
        lines: Segments x1, y1, x2, y2, shape (n, 4), metres.

    Returns:
        Shape of the map; a line is at least one cell wide and has no gaps. What lies outside of
        the map is left out.
    """
    mask = np.zeros(grid.cells.shape, dtype=np.bool_)
    for line in np.asarray(lines, dtype=float).reshape(-1, 4):
        cells = grid.cells_of(points_on(line, grid.resolution / 2))
        cells = cells[grid.contains(cells)]
        mask[cells[:, 0], cells[:, 1]] = True
    return mask


def with_walls(grid: Grid, lines: ArrayLike) -> Grid:
    """Return the map with further walls: segments x1, y1, x2, y2, shape (n, 4), metres."""
    cells = grid.cells.copy()
    cells[drawn_lines(grid, lines)] = OCCUPIED
    return Grid(cells, grid.resolution, grid.origin)


def empty_around(box: Box, resolution: float, margin: float) -> Grid:
    """Return a map on which all is free, so many metres wider than a box on each side."""
    west, south, east, north = box
    # Its corner falls on a multiple of the resolution: maps of one place line up.
    x = math.floor((west - margin) / resolution) * resolution
    y = math.floor((south - margin) / resolution) * resolution
    columns = math.ceil((east + margin - x) / resolution)
    rows = math.ceil((north + margin - y) / resolution)
    return Grid(np.zeros((rows, columns), np.int8), resolution, (x, y))


def walled_off(grid: Grid, lines: Sequence[tuple[Point, Point]]) -> Grid:
    """Return the map with walls as thick as those of a place along lines, metres."""
    cells = grid.cells.copy()
    solid = shapes.boxes_around(lines, WALL_THICKNESS)
    _paint(cells, grid.resolution, grid.origin, solid)
    return Grid(cells, grid.resolution, grid.origin)


def _paint(
    cells: NDArray[np.int8], resolution: float, origin: tuple[float, float], solid: shapes.Array
) -> None:
    """Make the cells occupied that lie within half a cell of boxes."""
    rows, columns = cells.shape
    origin_x, origin_y = origin
    reach = resolution / 2
    for box, corners in zip(solid, shapes.corners(solid), strict=True):
        low = np.floor((corners.min(axis=0) - reach - (origin_x, origin_y)) / resolution)
        high = np.ceil((corners.max(axis=0) + reach - (origin_x, origin_y)) / resolution)
        first_column, first_row = np.maximum(low.astype(int), 0)
        last_column, last_row = np.minimum(high.astype(int), (columns, rows))
        if first_column >= last_column or first_row >= last_row:
            continue
        x = origin_x + (np.arange(first_column, last_column) + 0.5) * resolution
        y = origin_y + (np.arange(first_row, last_row) + 0.5) * resolution
        inside = shapes.distances(box[None], x[None, :], y[:, None])[..., 0] < reach - 1e-9
        cells[first_row:last_row, first_column:last_column][inside] = OCCUPIED


def regions(free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return each cell's region: the connected pieces of what is free, numbered from 1.

    What is not free belongs to the region nearest to it, so that a doorway is divided along its
    middle.
    """
    import cv2

    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    return spread(np.asarray(labels, np.int32))


_BAND, _BESIDE_BAND = 1024, 64
_COARSE = 8


def spread(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Give each cell the label of the nearest cell that has one, not 0; in place, and returned.

    It is looked for in bands of rows, as a distance field of all of a large map takes more memory
    than all else. What is farther from every label than a band reaches beyond itself gets that of
    about the nearest, on every eighth cell.
    """
    rows, left = len(labels), 0
    if rows <= _BAND + _BESIDE_BAND:
        labels[:] = _spread(labels)[0]
        return labels
    above = labels[:0].copy()
    for top in range(0, rows, _BAND):
        own = labels[top : top + _BAND]
        part = np.concatenate([above, labels[top : top + _BAND + _BESIDE_BAND]])
        begins = len(above)
        above = own[-_BESIDE_BAND:].copy()  # as it was, for the next band
        if part.any():
            filled, away = _spread(part)
            inside = np.s_[begins : begins + len(own)]
            np.copyto(own, filled[inside], where=away[inside] <= _BESIDE_BAND)
        left += own.size - int(np.count_nonzero(own))
    if left:
        coarse = _spread(np.ascontiguousarray(labels[::_COARSE, ::_COARSE]))[0]
        for row in range(rows):
            whole = coarse[row // _COARSE].repeat(_COARSE)[: labels.shape[1]]
            np.copyto(labels[row], whole, where=labels[row] == 0)
    return labels


def _spread(labels: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return the same in one piece, and how far each cell is from the nearest with a label."""
    import cv2

    seeds = labels != 0
    away, nearest = cv2.distanceTransformWithLabels(
        (~seeds).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    of_seed = np.zeros(int(nearest.max()) + 1, np.int32)
    of_seed[nearest[seeds]] = labels[seeds]
    return of_seed[nearest], np.asarray(away, np.float32)


LARGE_PART = 1.0
"""A part of the floor from this size on that no point lies in is no part of a room, m^2."""


def divided(grid: Grid, points: Sequence[Point]) -> NDArray[np.int32]:
    """Return each cell's room on a map whose doors are drawn as walls, by a point in each room.

    What is free falls into connected parts. A part is the room whose point lies in it, and where
    several do (no door is drawn between them) each of its cells is that of the nearest. What is not
    free, and a small part with no point, as the floor below a table, belongs to the nearest room.

    Args:
        grid: The map.
        points: Of the rooms, x and y in metres; one that is not on free floor counts for the part
            nearest to it, one off the map for none.

    Returns:
        Shape of the map: the number of the room, from 1; below 0 in a large part without a point,
        a number for each.
    """
    import cv2

    free = grid.free
    in_walls = any(grid.at(free, x, y) is False for x, y in points)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(
        free.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S
    )
    if count < 2:
        return np.zeros(free.shape, np.int32)
    everywhere = regions(free) if in_walls else parts
    del free
    inside: dict[int, list[int]] = {}
    for number, (x, y) in enumerate(points, start=1):
        if (part := grid.at(everywhere, x, y)) is not None:
            inside.setdefault(part, []).append(number)
    del everywhere
    number_of_part = np.zeros(count, np.int32)
    large = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] * grid.resolution**2 >= LARGE_PART)
    number_of_part[large] = -large
    number_of_part[0] = 0
    for part, numbers in inside.items():
        number_of_part[part] = numbers[0]
    several: list[tuple[tuple[NDArray[np.intp], ...], NDArray[np.intp]]] = []
    for part, numbers in inside.items():
        if len(numbers) > 1:
            where = np.nonzero(parts == part)
            centres = grid.centres_of(np.stack(where, axis=1))
            away = [np.hypot(*(centres - points[n - 1]).T) for n in numbers]
            several.append((where, np.array(numbers)[np.argmin(away, axis=0)]))
    labels = looked_up(number_of_part, parts, out=parts)
    for where, nearest in several:
        labels[where] = nearest
    return spread(labels)


def outlines(grid: Grid, tolerance: float) -> list[Points]:
    """Return the outlines of what is occupied, each a closed line (n, 2), metres.

    Args:
        grid: The map.
        tolerance: How far a line may run beside the edges of the cells, metres.
    """
    import cv2

    rows, columns = grid.cells.shape
    fine = np.zeros((rows + 2, columns + 2), np.uint8)
    fine[1:-1, 1:-1] = grid.occupied
    found = cv2.findContours(fine, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    lines = []
    for contour in found:
        short = cv2.approxPolyDP(contour, tolerance / grid.resolution, True).reshape(-1, 2)
        points = (short.astype(float) - 0.5) * grid.resolution + grid.origin
        lines.append(np.vstack([points, points[:1]]))
    return lines
