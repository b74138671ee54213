"""Poses in the plane, paths as lines through points, and the scans of a lidar."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Pose = tuple[float, float, float]
"""x, y in metres, yaw in radians, anticlockwise from the x axis."""


def angle_between(first: float, second: float) -> float:
    """Return the turn from one yaw to another, -pi to pi, radians."""
    return math.remainder(second - first, math.tau)


def composed(pose: Pose, step: Pose) -> Pose:
    """Return the pose reached from `pose` by a step given in its own frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return (
        pose[0] + cos * step[0] - sin * step[1],
        pose[1] + sin * step[0] + cos * step[1],
        math.remainder(pose[2] + step[2], math.tau),
    )


def relative(first: Pose, second: Pose) -> Pose:
    """Return the step, in the first pose's own frame, that leads to the second."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return cos * dx + sin * dy, cos * dy - sin * dx, angle_between(first[2], second[2])


Points = NDArray[np.float64]


def point_of(pose: Pose) -> Points:
    """Return the point of a pose, shape (3,), metres; z is 0."""
    return np.array([pose[0], pose[1], 0.0])


def in_map(pose: Pose, points: Points) -> Points:
    """Return points of the robot's frame, shape (n, 2), in the frame of its pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = points.T
    return np.array([pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y]).T


def distances_along(path: ArrayLike) -> Points:
    """Return the way from the first point to each point, shape (n,), metres; the first is 0."""
    steps = np.linalg.norm(np.diff(np.asarray(path, dtype=float), axis=0), axis=1)
    return np.concatenate(([0.0], np.cumsum(steps)))


def length(path: ArrayLike) -> float:
    """Return the length of a path in metres; 0 for a path of one point or none."""
    points = np.asarray(path, dtype=float)
    return float(distances_along(points)[-1]) if len(points) > 1 else 0.0


def point_at(path: ArrayLike, distance: ArrayLike) -> Points:
    """Return the point `distance` metres along a path, held at its two ends.

    Args:
        path: At least one point, shape (n, d).
        distance: A number, or numbers of shape (k,).

    Returns:
        Shape (d,) for one distance, (k, d) for several.

    Raises:
        ValueError: The path has no points.
    """
    points = np.asarray(path, dtype=float)
    if len(points) == 0:
        raise ValueError('a path with no points')
    along = distances_along(points)
    where = np.asarray(distance, dtype=float)
    return np.stack([np.interp(where, along, axis) for axis in points.T], axis=-1)


def equally_spaced(path: ArrayLike, spacing: float) -> Points:
    """Return points at equal distances along a path, both ends included.

    Args:
        path: At least one point, shape (n, d).
        spacing: The wanted distance, metres, above 0. The distance taken is the largest one not
            above it that divides the path's length.

    Returns:
        At least two points (the two ends), unless the path has no length: then one.
    """
    total = length(path)
    if total == 0.0:
        return np.asarray(path, dtype=float)[:1]
    count = max(1, int(np.ceil(total / spacing - 1e-9)))
    return point_at(path, np.linspace(0.0, total, count + 1))


def distance_nearest(path: ArrayLike, position: ArrayLike) -> float:
    """Return how far along a path its point nearest to a position lies, metres.

    Args:
        path: At least one point, shape (n, d).
        position: Shape (d,).
    """
    points, at = np.asarray(path, dtype=float), np.asarray(position, dtype=float)
    if len(points) == 1:
        return 0.0
    steps = np.diff(points, axis=0)
    squares = np.maximum((steps**2).sum(axis=1), 1e-12)
    shares = np.clip(((at - points[:-1]) * steps).sum(axis=1) / squares, 0.0, 1.0)
    gaps = np.linalg.norm(points[:-1] + shares[:, None] * steps - at, axis=1)
    nearest = int(np.argmin(gaps))
    return float(distances_along(points)[nearest] + shares[nearest] * np.sqrt(squares[nearest]))


def points_passed(path: ArrayLike, distance: float) -> int:
    """Return how many of a path's points lie at most `distance` metres along it."""
    return int(np.searchsorted(distances_along(path), distance + 1e-6, side='right'))


class Mount(NamedTuple):
    """Where a lidar sits on the robot, robot's frame, and whether it hangs upside down."""

    pose: Pose = (0.0, 0.0, 0.0)
    upside_down: bool = False


@dataclass(frozen=True, eq=False)
class Scan:
    """One turn of a lidar.

    Attributes:
        angles: Direction of each ray in the lidar's frame, shape (n,), rad.
        ranges: How far each ray went, shape (n,), metres; infinite where it met nothing, NaN where
            that is not known.
        range_max: The lidar's reach, metres.
        mount: Where the lidar sits on the robot, robot's frame.
        times: When each ray was measured after the first, shape (n,), seconds; None: all at once.
    """

    angles: Points
    ranges: Points
    range_max: float
    mount: Pose = (0.0, 0.0, 0.0)
    times: Points | None = None

    @cached_property
    def points(self) -> Points:
        """The points met, in the robot's frame, shape (m, 2), m at most n."""
        met = self.ranges < self.range_max
        x, y, yaw = self.mount
        ranges, turned = self.ranges[met], self.angles[met] + yaw
        return np.array([x + ranges * np.cos(turned), y + ranges * np.sin(turned)]).T

    def thinned(self, count: int) -> Scan:
        """About `count` of the rays, evenly taken."""
        step = max(1, len(self.angles) // count)
        times = None if self.times is None else self.times[::step]
        return Scan(self.angles[::step], self.ranges[::step], self.range_max, self.mount, times)
