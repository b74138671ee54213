"""Each scan of a lidar with where the robot was when it was made; either may come first."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from indoor_watch.visit import LidarSweep
from lidar_navigation.geometry import Pose, Scan
from surveillance_perception.observing.base_history import BaseHistory

MOST_SCANS = 10
"""So many wait for a pose."""
SECTORS = 36
"""Of the horizon: lidars see all around when each sector has a beam."""


class ScanPairing:
    """Scans that wait for a pose; owned by the executor's thread.

    Args:
        base: Where the base was.
        lost: Called when a scan goes for which nobody told a pose.

    Attributes:
        sectors: In which sectors of the horizon a lidar measures, robot's frame, (SECTORS,).
    """

    def __init__(self, base: BaseHistory, lost: Callable[[], object]) -> None:
        self._base, self._lost = base, lost
        self._scans: deque[tuple[float, Scan]] = deque(maxlen=MOST_SCANS)
        self.sectors: NDArray[np.bool_] = np.zeros(SECTORS, np.bool_)

    def take(self, measured: float, scan: Scan) -> None:
        """Take a scan that was made at a time, seconds."""
        if len(self._scans) == self._scans.maxlen and self._base.is_localised:
            self._lost()
        self._scans.append((measured, scan))
        self.sectors |= sectors_of(scan)

    def paired(self) -> list[tuple[Pose, Scan]]:
        """Return the scans whose pose is known now; they wait no longer."""
        found = []
        for each in list(self._scans):
            measured, scan = each
            if (pose := self._base.at(measured)) is not None:
                self._scans.remove(each)
                found.append((pose, scan))
        return found


def sectors_of(scan: Scan) -> NDArray[np.bool_]:
    """Return in which sectors of the horizon a lidar measures, robot's frame, shape (SECTORS,)."""
    angles = (scan.angles + scan.mount[2])[~np.isnan(scan.ranges)]
    found = np.zeros(SECTORS, np.bool_)
    found[np.floor(angles / math.tau * SECTORS).astype(int) % SECTORS] = True
    return found


def sweep_of(pose: Pose, scan: Scan, stamp: float) -> LidarSweep:
    """Return a scan on the map, where its robot was at a pose."""
    x, y, yaw = pose
    mount_x, mount_y, mount_yaw = scan.mount
    cosine, sine = math.cos(yaw), math.sin(yaw)
    sensor = x + cosine * mount_x - sine * mount_y, y + sine * mount_x + cosine * mount_y
    told = ~np.isnan(scan.ranges)
    ranges = np.minimum(scan.ranges[told], scan.range_max)
    met = scan.ranges[told] < scan.range_max
    angles = scan.angles[told] + mount_yaw + yaw
    ends = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + sensor
    return LidarSweep(sensor, ends, met, stamp)
