"""What the controllers do in RANDOM mode: the stimuli that stand in for hardware, drawn from a
seeded generator.

Each generator is a plain function of a `random.Random`, so that a run with the same `random_seed`
takes the same course.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np

from surveillance_controllers.manual.console_commands import Point3

VIA_POINTS = (0, 4)
"""Fewest and most random points between a path's start and its goal."""
VIA_POINT_REACH = 10.0
"""Random points lie within this many metres of the world's origin on each axis."""
MOVE_SECONDS = (5, 9)
"""Shortest and longest time of a move, whole seconds."""
GOAL_ERROR = 0.2
"""A move ends at most this many metres off its goal on each axis."""


def generator(seed: int) -> random.Random:
    """A generator for a node's `random_seed`: repeatable, or seeded by the system when `seed` is
    negative."""
    return random.Random(seed if seed >= 0 else None)


def via_points(draw: random.Random) -> list[Point3]:
    """Random points for the middle of a path."""
    reach = VIA_POINT_REACH
    return [
        (draw.uniform(-reach, reach), draw.uniform(-reach, reach), draw.uniform(-reach, reach))
        for _ in range(draw.randint(*VIA_POINTS))
    ]


def move(draw: random.Random) -> tuple[float, float]:
    """The time of a random move in seconds, and the largest error of its end in metres."""
    return float(draw.randint(*MOVE_SECONDS)), draw.uniform(-GOAL_ERROR, GOAL_ERROR)


def reached(draw: random.Random, goal: Sequence[float], delta: float) -> np.ndarray:
    """Where a move towards `goal` ends: off by at most `delta` metres on each axis."""
    size = abs(delta)
    return np.array([axis + draw.uniform(-size, size) for axis in goal])
