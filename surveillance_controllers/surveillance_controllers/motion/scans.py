"""What a lidar sees in one turn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from surveillance_controllers.geometry.polyline import Points


@dataclass(frozen=True, eq=False)
class Scan:
    """One turn of a lidar that sits at the robot's centre.

    Attributes:
        angles: Direction of each ray in the robot's frame, shape (n,), rad.
        ranges: How far each ray went, shape (n,), metres; infinite where it met nothing.
        range_max: The lidar's reach, metres.
    """

    angles: Points
    ranges: Points
    range_max: float

    @cached_property
    def points(self) -> Points:
        """The points met, in the robot's frame, shape (m, 2), m at most n."""
        met = np.isfinite(self.ranges) & (self.ranges < self.range_max)
        ranges, angles = self.ranges[met], self.angles[met]
        return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)

    def thinned(self, count: int) -> Scan:
        """About `count` of the rays, evenly taken."""
        step = max(1, len(self.angles) // count)
        return Scan(self.angles[::step], self.ranges[::step], self.range_max)
