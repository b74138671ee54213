"""Poses in the plane, and the steps between them."""

from __future__ import annotations

import math

Pose = tuple[float, float, float]
"""x, y in metres, yaw in radians, anticlockwise from the x axis."""


def angle_between(first: float, second: float) -> float:
    """The turn from one yaw to another, -pi to pi, radians."""
    return math.remainder(second - first, math.tau)


def composed(pose: Pose, step: Pose) -> Pose:
    """The pose reached from `pose` by a step given in its own frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return (
        pose[0] + cos * step[0] - sin * step[1],
        pose[1] + sin * step[0] + cos * step[1],
        math.remainder(pose[2] + step[2], math.tau),
    )


def relative(first: Pose, second: Pose) -> Pose:
    """The step, in the first pose's own frame, that leads to the second."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return cos * dx + sin * dy, cos * dy - sin * dx, angle_between(first[2], second[2])
