"""The shape of a robot seen from above: how near things are to it, wherever it stands.

A robot is a disc, or a convex polygon around its centre (Nav2's `footprint`). The largest circle
within it is what a path must at least keep free; within the smallest around it the robot can turn
anywhere (inscribed and circumscribed radius, as in Nav2's costmaps).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidar_navigation.geometry import Points


@dataclass(frozen=True)
class Footprint:
    """A robot's shape in its own frame.

    Attributes:
        radius: Of a round robot, metres; with corners it counts for nothing.
        corners: x and y of each corner in turn, metres; empty: round.
    """

    radius: float
    corners: tuple[float, ...] = ()

    @property
    def is_round(self) -> bool:
        """Whether it is a disc around the robot's centre."""
        return not self.corners

    @cached_property
    def inscribed(self) -> float:
        """The radius of the largest circle around the centre within it, metres."""
        if self.is_round:
            return self.radius
        return float(-self._planes(np.zeros(1), np.zeros(1))[0])

    @cached_property
    def circumscribed(self) -> float:
        """The radius of the smallest circle around the centre that holds it, metres."""
        return self.radius if self.is_round else float(np.hypot(*self._vertices.T).max())

    @cached_property
    def turned_round(self) -> Footprint:
        """The same shape for a robot that drives backwards: front and rear change places."""
        return self if self.is_round else Footprint(self.radius, tuple(-c for c in self.corners))

    @cached_property
    def _vertices(self) -> Points:
        """Corners anticlockwise, shape (n, 2)."""
        given = np.array(self.corners, dtype=float).reshape(-1, 2)
        following = np.roll(given, -1, axis=0)
        area = float((given[:, 0] * following[:, 1] - given[:, 1] * following[:, 0]).sum())
        return given if area > 0.0 else np.ascontiguousarray(given[::-1])

    @cached_property
    def _sides(self) -> tuple[Points, Points, Points]:
        """Begin (n, 2), unit direction (n, 2) and length (n,) of each side."""
        along = np.roll(self._vertices, -1, axis=0) - self._vertices
        lengths = np.hypot(*along.T)
        return self._vertices, along / lengths[:, None], lengths

    def _planes(self, x: Points, y: Points) -> Points:
        """Return how far points lie beyond the outermost side, metres; negative inside."""
        begin, along, _ = self._sides
        beyond = [
            (x - bx) * ay - (y - by) * ax
            for (bx, by), (ax, ay) in zip(begin.tolist(), along.tolist(), strict=True)
        ]
        return np.asarray(np.maximum.reduce(beyond))

    def gap(self, x: ArrayLike, y: ArrayLike) -> Points:
        """Return how far points are from the robot, metres; negative within it.

        Args:
            x: In the robot's frame, metres, any shape.
            y: The same shape.
        """
        px, py = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if self.is_round:
            return np.asarray(np.hypot(px, py) - self.radius)
        inside = self._planes(px, py)
        nearest = np.full(px.shape, np.inf)
        begin, along, lengths = self._sides
        for (bx, by), (ax, ay), length in zip(
            begin.tolist(), along.tolist(), lengths.tolist(), strict=True
        ):
            dx, dy = px - bx, py - by
            share = np.clip(dx * ax + dy * ay, 0.0, length)
            np.minimum(nearest, np.hypot(dx - share * ax, dy - share * ay), out=nearest)
        return np.where(inside <= 0.0, inside, nearest)

    def gap_at(self, poses: Points, points: Points) -> Points:
        """Return how far points are from the robot at each of some poses, metres.

        Args:
            poses: x, y, yaw, shape (k, 3).
            points: Shape (n, 2), in the same frame.

        Returns:
            Shape (k, n).
        """
        dx = points[:, 0] - poses[:, :1]
        dy = points[:, 1] - poses[:, 1:2]
        if self.is_round:
            return self.gap(dx, dy)
        cos, sin = np.cos(poses[:, 2:3]), np.sin(poses[:, 2:3])
        return self.gap(cos * dx + sin * dy, cos * dy - sin * dx)

    def outline(self, spacing: float) -> Points:
        """Return points on its edge, at most so far apart, metres; shape (n, 2)."""
        if self.is_round:
            count = max(8, math.ceil(math.tau * self.radius / spacing))
            angles = np.arange(count) * (math.tau / count)
            return self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        pieces = []
        for begin, along, length in zip(*self._sides, strict=True):
            count = max(1, math.ceil(length / spacing))
            pieces.append(begin + np.arange(count)[:, None] * (length / count) * along)
        return np.concatenate(pieces)


def poses_on_arc(curvature: float, way: NDArray[np.float64]) -> Points:
    """Return where a robot is after ways on an arc from the origin along x, shape (n, 3).

    Args:
        curvature: Positive to the left, 1/m.
        way: Metres, shape (n,).
    """
    angle = way * curvature
    if abs(curvature) < 1e-6:
        return np.stack([way, np.zeros_like(way), angle], axis=1)
    return np.stack([np.sin(angle) / curvature, (1 - np.cos(angle)) / curvature, angle], axis=1)
