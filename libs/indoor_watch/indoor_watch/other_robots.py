"""The other robots of a fleet, as far as they say where they are: they are no news.

What the lidar meets at another robot's body is left out of a sweep, and a picture is not compared
with an earlier one while another robot may be in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

FRESH = 3.0
"""A pose counts for so long, seconds."""
BESIDE = 0.25
"""What is met so near to the body of a robot is that robot, metres: both robots' poses are
estimates, and it goes on while the message travels."""
IN_VIEW = 8.0
"""A robot that is so near may be in a picture, metres."""


class OtherRobots:
    """Where the other robots were heard to be.

    Args:
        radius: Of a robot's body, metres.
    """

    def __init__(self, radius: float) -> None:
        self._radius = radius
        self._heard: dict[str, tuple[float, float, float]] = {}

    def hear(self, name: str, x: float, y: float, stamp: float) -> None:
        """Take where a robot is, map frame, metres; seconds since 1970."""
        self._heard[name] = (x, y, stamp)

    def at(self, stamp: float) -> Iterator[tuple[float, float]]:
        """Yield where the robots are that were heard lately."""
        for x, y, heard in self._heard.values():
            if abs(stamp - heard) <= FRESH:
                yield x, y

    def apart(self, ends: NDArray[np.float64], stamp: float) -> NDArray[np.bool_]:
        """Return which ends of beams (n, 2) lie at no robot."""
        apart = np.ones(len(ends), bool)
        for x, y in self.at(stamp):
            away = np.hypot(ends[:, 0] - x, ends[:, 1] - y)
            apart &= away > self._radius + BESIDE
        return apart

    def may_be_seen(self, point: tuple[float, float], stamp: float) -> bool:
        """Return whether a robot may be in a picture that is taken from a point."""
        return any(math.dist(point, other) <= IN_VIEW for other in self.at(stamp))
