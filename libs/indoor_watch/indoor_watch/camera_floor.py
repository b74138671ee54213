"""Which floor pictures showed, so that a person who stood there would have been in one of them.

A lidar tells of those who walk. One who stands still looks to it like a thing: that nobody is there
only pictures tell, and of the floor that they showed. A person is in a picture where half of a
body that stands there is within its edges, and nothing that the map or the lidar knows of stands
before it. Farther off than a viewpoint shows a room, a person is too small to be found.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from indoor_watch.hung_markers import CameraView
from indoor_watch.viewpoints import RANGE

Mask = NDArray[np.bool_]

BODY = np.linspace(0.1, 1.7, 9)
"""Heights of the parts of a body that stands, metres above the floor."""
PART = 0.5
"""So much of it is in the picture: persons of whom less is seen are mostly missed
(docs/explanation/noticing.md)."""
NEAREST = 0.3
"""The floor under the camera's own mount is in no picture, metres."""
STEEPEST = 0.2
"""A line of sight whose horizontal part is less than this looks up or down, and at no floor."""


class CameraFloor:
    """Gathers what the pictures of one stay showed.

    Args:
        grid: The map.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self.seen: Mask = np.zeros(grid.cells.shape, np.bool_)

    def add(self, camera: CameraView, size: tuple[int, int], things: Mask | None = None) -> None:
        """Take a picture in which persons were looked for.

        Args:
            camera: From where it was taken.
            size: Its rows and columns.
            things: Where things stand that are no walls of the map, shape as the map's; None: that
                is not known.
        """
        bearings = _bearings(camera, size, self._grid.resolution / RANGE)
        if not len(bearings):
            return
        away = np.arange(NEAREST, RANGE, self._grid.resolution / 2)
        x = camera.at[0] + np.cos(bearings)[:, None] * away
        y = camera.at[1] + np.sin(bearings)[:, None] * away
        cells = self._grid.cells_of(np.stack([x.ravel(), y.ravel()], axis=1))
        inside = self._grid.contains(cells)
        rows, columns = np.where(inside[:, None], cells, 0).T
        open_ = inside & self._grid.free[rows, columns]
        if things is not None:
            open_ &= ~things[rows, columns]
        in_view = np.logical_and.accumulate(open_.reshape(x.shape), axis=1).ravel()
        shown = np.flatnonzero(in_view)
        shown = shown[_is_shown(camera, size, x.ravel()[shown], y.ravel()[shown])]
        self.seen[rows[shown], columns[shown]] = True


def _bearings(camera: CameraView, size: tuple[int, int], step: float) -> NDArray[np.float64]:
    """Return the directions on the floor from one side of a picture to the other, map frame, rad.

    None where the camera looks up or down.
    """
    rows, columns = size
    middle = columns / 2, rows / 2
    edge = [(column, row) for column in (0.0, columns) for row in (0.0, rows / 2, rows)]
    pixels = np.array([(*each, 1.0) for each in (middle, *edge)])
    lines = pixels @ np.linalg.inv(camera.matrix).T @ camera.pose[:3, :3].T
    flat = np.hypot(lines[:, 0], lines[:, 1])
    if (flat < STEEPEST * np.linalg.norm(lines, axis=1)).any():
        return np.zeros(0)
    turned = np.arctan2(lines[:, 1], lines[:, 0])
    aside = (turned[1:] - turned[0] + math.pi) % math.tau - math.pi
    return np.asarray(turned[0] + np.arange(aside.min(), aside.max(), step), np.float64)


def _is_shown(
    camera: CameraView, size: tuple[int, int], x: NDArray[np.float64], y: NDArray[np.float64]
) -> Mask:
    """Tell of each point of the floor whether enough of a body there is within the picture."""
    count = np.zeros(len(x))
    for height in BODY:
        column, row = camera.pixels(np.stack([x, y, np.full(len(x), height)], axis=1)).T
        # Behind the camera there are no numbers, and no such comparison is true.
        count += (column >= 0) & (column < size[1]) & (row >= 0) & (row < size[0])
    return np.asarray(count >= PART * len(BODY), np.bool_)
