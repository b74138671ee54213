"""The map of another program that maps, as slam_toolbox or Cartographer, in place of an own one."""

from __future__ import annotations

import threading

from floor_plans import Grid
from lidar_navigation.geometry import Pose, Scan, composed


class ForeignMap:
    """Follows the map of another program, and where that has the robot.

    Attributes:
        start: Where the robot was when both were known first, map frame.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._grid: Grid | None = None
        self._correction: Pose | None = None
        self._is_new = False
        self.start: Pose = (0.0, 0.0, 0.0)
        self._started = False

    def take_map(self, grid: Grid) -> None:
        """Take the map, or a later one; one without free floor, as some begin with, counts not."""
        if not grid.free.any():
            return
        with self._lock:
            self._grid, self._is_new = grid, True

    def take_correction(self, correction: Pose) -> None:
        """Take where the odometry's frame lies on the map."""
        with self._lock:
            self._correction = correction

    @property
    def missing(self) -> str:
        """What has not come yet: map, or its transform; empty when both have."""
        if self._grid is None:
            return 'map'
        return '' if self._correction is not None else 'the transform from map to odom'

    def pose(self, odometry: Pose) -> Pose:
        """Return where the robot is on the map while its odometry says this."""
        return self.start if self._correction is None else composed(self._correction, odometry)

    def is_due(self, odometry: Pose) -> bool:
        """Tell whether there is another map."""
        return self._is_new and not self.missing

    def grid(self) -> Grid:
        """Return the map as it is now."""
        assert self._grid is not None
        return self._grid

    def see(self, scan: Scan, odometry: Pose, *, keep: bool = False) -> bool:
        """Tell whether there is another map than at the last call; the scan counts for nothing."""
        with self._lock:
            if not self._is_new or self.missing:
                return False
            self._is_new = False
        if not self._started:
            self.start, self._started = self.pose(odometry), True
        return True
