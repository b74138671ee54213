"""The shape of a robot seen from above: how near things are to it, wherever it stands.

A robot is a disc, or a polygon around its centre (Nav2's `footprint`), convex or not: an L, a
forklift, an arm that reaches out. The largest circle within it is what a path must at least keep
free; within the smallest around it the robot can turn anywhere (inscribed and circumscribed radius,
as in Nav2's costmaps).
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
        return float(-self.gap(np.zeros(1), np.zeros(1))[0])

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

    @cached_property
    def is_convex(self) -> bool:
        """Whether no corner points inwards."""
        _, along, _ = self._sides
        following = np.roll(along, -1, axis=0)
        bends = along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0]
        return bool((bends >= -1e-9).all())

    @cached_property
    def convex_parts(self) -> tuple[Points, ...]:
        """Convex polygons that make it up, corners anticlockwise, each of shape (n, 2).

        Triangles by ear clipping (Meisters 1975), joined again where what they make is convex
        (Hertel and Mehlhorn 1983): at most four times as many as there must be. What simulates or
        draws a robot takes these; `gap` needs none.
        """
        return tuple(np.array(part) for part in _joined(_triangles(self._vertices.tolist())))

    def _is_within(self, x: Points, y: Points) -> NDArray[np.bool_]:
        """Tell which points a polygon that is not convex holds: a ray from there crosses its edge
        an odd number of times.
        """
        within = np.zeros(x.shape, dtype=bool)
        ends = np.roll(self._vertices, -1, axis=0).tolist()
        for (ax, ay), (bx, by) in zip(self._vertices.tolist(), ends, strict=True):
            if ay != by:
                crossing = ax + (y - ay) * ((bx - ax) / (by - ay))
                within ^= ((ay > y) != (by > y)) & (x < crossing)
        return within

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
        nearest = np.full(px.shape, np.inf)
        begin, along, lengths = self._sides
        for (bx, by), (ax, ay), length in zip(
            begin.tolist(), along.tolist(), lengths.tolist(), strict=True
        ):
            dx, dy = px - bx, py - by
            share = np.clip(dx * ax + dy * ay, 0.0, length)
            np.minimum(nearest, np.hypot(dx - share * ax, dy - share * ay), out=nearest)
        if not self.is_convex:
            return np.where(self._is_within(px, py), -nearest, nearest)
        inside = self._planes(px, py)
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


Corner = list[float]


def _bend(a: Corner, b: Corner, c: Corner) -> float:
    """Return twice the area of a triangle, positive anticlockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _triangles(corners: list[Corner]) -> list[list[Corner]]:
    """Cut a simple polygon, anticlockwise, into triangles."""
    left, found = list(corners), []
    while len(left) > 3:
        for i in range(len(left)):
            a, b, c = left[i - 1], left[i], left[(i + 1) % len(left)]
            others = [each for each in left if each not in (a, b, c)]
            holds = any(min(_bend(a, b, p), _bend(b, c, p), _bend(c, a, p)) >= 0.0 for p in others)
            if _bend(a, b, c) > 0.0 and not holds:
                found.append([a, b, c])
                del left[i]
                break
        else:
            # Three corners on a line are no ear, and may go.
            flat = [i for i in range(len(left)) if not _bend(*_around(left, i))]
            if not flat:
                break
            del left[flat[0]]
    return [*found, left]


def _around(corners: list[Corner], i: int) -> tuple[Corner, Corner, Corner]:
    return corners[i - 1], corners[i], corners[(i + 1) % len(corners)]


def _joined(parts: list[list[Corner]]) -> list[list[Corner]]:
    """Join convex polygons along a side that two share, as long as what they make is convex."""
    parts = list(parts)
    for one in range(len(parts)):
        other = one + 1
        while other < len(parts):
            joined = _along_a_side(parts[one], parts[other])
            if joined is None:
                other += 1
                continue
            parts[one] = joined
            del parts[other]
            other = one + 1
        if one + 1 >= len(parts):
            break
    return parts


def _along_a_side(one: list[Corner], other: list[Corner]) -> list[Corner] | None:
    for i in range(len(one)):
        a, b = one[i], one[(i + 1) % len(one)]
        for k in range(len(other)):
            if other[k] == b and other[(k + 1) % len(other)] == a:
                whole = [*one[i + 1 :], *one[: i + 1]]
                whole += [other[(k + 2 + step) % len(other)] for step in range(len(other) - 2)]
                bends = [_bend(*_around(whole, each)) for each in range(len(whole))]
                return whole if min(bends) >= -1e-9 else None
    return None
