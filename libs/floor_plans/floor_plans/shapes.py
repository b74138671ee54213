"""Points, lines, poses, and upright boxes: what walls, doors and panels are made of.

A set of boxes is an array (n, 6) with one row per box: centre x and y in metres, cosine and sine of
the direction of its long side, half its length and half its thickness in metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Point = tuple[float, float]
"""x and y, metres."""
Position = tuple[float, float, float]
"""x, y and z, metres."""
Pose = tuple[float, float, float]
"""x, y in metres, yaw in rad, world frame."""
Segment = tuple[float, float, float, float]
"""A line from x1, y1 to x2, y2, metres."""

WALL_THICKNESS = 0.1
WALL_HEIGHT = 2.5
"""Of the walls that a place's file draws, metres."""


def boxes_around(lines: Iterable[tuple[Point, Point]], thickness: float) -> Array:
    """Return the boxes (n, 6) of the given thickness around centre lines."""
    rows = []
    for (x1, y1), (x2, y2) in lines:
        length = math.hypot(x2 - x1, y2 - y1)
        rows.append(
            (
                (x1 + x2) / 2,
                (y1 + y2) / 2,
                (x2 - x1) / length,
                (y2 - y1) / length,
                length / 2,
                thickness / 2,
            )
        )
    return np.array(rows, dtype=float).reshape(-1, 6)


def distances(boxes: Array, x: npt.ArrayLike, y: npt.ArrayLike) -> Array:
    """Return the distance of points to each box, 0 inside: shape of the points + (n,), metres."""
    dx = np.asarray(x, dtype=float)[..., None] - boxes[:, 0]
    dy = np.asarray(y, dtype=float)[..., None] - boxes[:, 1]
    along = np.abs(dx * boxes[:, 2] + dy * boxes[:, 3]) - boxes[:, 4]
    across = np.abs(dy * boxes[:, 2] - dx * boxes[:, 3]) - boxes[:, 5]
    return np.hypot(np.maximum(along, 0.0), np.maximum(across, 0.0))


def corners(boxes: Array) -> Array:
    """Return the corners (n, 4, 2) of boxes, counter-clockwise, metres."""
    along = boxes[:, 2:4] * boxes[:, 4:5]
    across = np.stack([-boxes[:, 3], boxes[:, 2]], axis=1) * boxes[:, 5:6]
    centre = boxes[:, :2]
    return np.stack(
        [
            centre - along - across,
            centre + along - across,
            centre + along + across,
            centre - along + across,
        ],
        axis=1,
    )
