"""Motion and paths without a robot: drawn by chance, and a glide along a path in a given time.

RANDOM draws what an operator would say in MANUAL; in both modes the robot glides.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

import numpy as np

from lidar_navigation import geometry
from lidar_navigation.geometry import Points
from state_machines.ros import GoalRun
from surveillance_controllers.manual.commands import Point3

VIA_POINTS = (0, 4)
"""Fewest and most random points between a path's start and its goal."""
VIA_POINT_REACH = 10.0
"""Random points lie within this many metres of the world's origin on each axis."""
MOVE_SECONDS = (5, 9)
"""Shortest and longest time of a move, whole seconds."""
GOAL_ERROR = 0.2
"""A move ends at most this many metres off its goal on each axis."""


def generator(seed: int) -> random.Random:
    """Return a generator for a node's `random_seed`: repeatable, or seeded by the system when
    `seed` is negative.
    """
    return random.Random(seed if seed >= 0 else None)


def via_points(draw: random.Random) -> list[Point3]:
    """Random points for the middle of a path."""
    reach = VIA_POINT_REACH
    return [
        (draw.uniform(-reach, reach), draw.uniform(-reach, reach), draw.uniform(-reach, reach))
        for _ in range(draw.randint(*VIA_POINTS))
    ]


def move(draw: random.Random) -> tuple[float, float]:
    """Return the time of a random move in seconds, and the largest error of its end in metres."""
    return float(draw.randint(*MOVE_SECONDS)), draw.uniform(-GOAL_ERROR, GOAL_ERROR)


def reached(draw: random.Random, goal: Sequence[float], delta: float) -> np.ndarray:
    """Return where a move towards `goal` ends: off by at most `delta` metres on each axis."""
    size = abs(delta)
    return np.array([axis + draw.uniform(-size, size) for axis in goal])


def glide(
    path: Points,
    seconds: float,
    end: Points,
    pace: GoalRun,
    on_position: Callable[[Points], None],
    period: float,
    stands: Callable[[], bool] = lambda: False,
) -> Points:
    """Go along a path in a given time.

    Args:
        path: At least one point, shape (n, 3), metres.
        seconds: How long it takes.
        end: Where the motion ends, shape (3,): the path's last point, or near it.
        pace: Passes the time.
        on_position: Told the position at the start, every `period` seconds, and at the end.
        period: Seconds between two reports.
        stands: Whether the motion rests at present; it goes on afterwards.

    Returns:
        `end`, or where the motion was when it was ended early.
    """
    total = geometry.length(path)
    began = pace.now()
    while True:
        elapsed = pace.now() - began
        if elapsed >= seconds:
            break
        position = geometry.point_at(path, total * elapsed / seconds)
        on_position(position)
        slept = pace.now()
        if not pace.sleep(min(period, seconds - elapsed)):
            return position
        if stands():
            began += pace.now() - slept
    on_position(end)
    return np.asarray(end, dtype=float)
