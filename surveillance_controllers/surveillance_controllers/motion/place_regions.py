"""Which place a point of the map belongs to.

The map is divided along its doors: what is connected without going through a door is one region,
and a region belongs to the place whose point lies in it. Where a map shows several places in one
region (no door drawn between them), the place with the nearest point is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import cv2
import numpy as np
from numpy.typing import ArrayLike

from surveillance_controllers.planning.grid_map import GridMap, drawn_lines

Segment = tuple[float, float, float, float]


def door_segment(x: float, y: float, yaw: float, width: float) -> Segment:
    """The opening of a door as a segment x1, y1, x2, y2.

    Args:
        x: Of the centre, metres.
        y: Of the centre, metres.
        yaw: Direction of the line along the opening, rad.
        width: Of the opening, metres.
    """
    along_x, along_y = math.cos(yaw) * width / 2, math.sin(yaw) * width / 2
    return x - along_x, y - along_y, x + along_x, y + along_y


class PlaceRegions:
    """The places of a map.

    Args:
        grid: The map, with its doors open.
        doors: Segments of all doors, metres.
        positions: A point in each place: x, y in metres.
    """

    def __init__(
        self,
        grid: GridMap,
        doors: Iterable[Segment],
        positions: Mapping[str, ArrayLike],
    ) -> None:
        self._grid = grid
        self._points = {
            name: np.asarray(point, dtype=float)[:2] for name, point in positions.items()
        }
        # A little longer than the opening, so that no gap remains beside the frame.
        lines = [_stretched(door, 2 * grid.resolution) for door in doors]
        passable = grid.free & ~drawn_lines(grid, lines)
        _, labels = cv2.connectedComponents(passable.astype(np.uint8), connectivity=4)
        _, nearest = cv2.distanceTransformWithLabels(
            (~passable).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        region_of = np.zeros(int(nearest.max()) + 1, dtype=np.int32)
        region_of[nearest[passable]] = labels[passable]
        self._regions = region_of[nearest]
        self._places: dict[int, list[str]] = {}
        for name, point in self._points.items():
            region = self._region(point)
            if region is not None:
                self._places.setdefault(region, []).append(name)

    def place_at(self, point: ArrayLike) -> str | None:
        """The place that a point (x, y in metres) belongs to; None off the map or in no place."""
        xy = np.asarray(point, dtype=float)[:2]
        region = self._region(xy)
        names = self._places.get(region, []) if region is not None else []
        if not names:
            return None
        return min(names, key=lambda name: math.dist(self._points[name], xy))

    def _region(self, point: np.ndarray) -> int | None:
        cell = self._grid.cells_of(point)
        if not np.isfinite(point).all() or not self._grid.contains(cell)[0]:
            return None
        return int(self._regions[cell[0, 0], cell[0, 1]])


def _stretched(line: Segment, by: float) -> Segment:
    x1, y1, x2, y2 = line
    length = math.hypot(x2 - x1, y2 - y1)
    if length == 0:
        return line
    dx, dy = (x2 - x1) / length * by, (y2 - y1) / length * by
    return x1 - dx, y1 - dy, x2 + dx, y2 + dy
