"""Where the base was, by stamps: from the localisation, and by the odometry between its poses."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lidar_navigation.geometry import Pose, composed, relative
from lidar_navigation.localisation.odometry import OdometryBuffer
from surveillance_runtime.stamped_readings import SAME_TIME, OdometryStamps, StampedReadings

NEAR_TIME = 0.5
"""By the odometry, a pose tells of another time that is so near, seconds."""
STILL = 0.02
"""What stands moves by no more, metres and radians."""


class BaseHistory:
    """Where the base was lately; owned by the executor's thread."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=5)
        self._odometry = OdometryStamps[Pose](50)
        self._readings = OdometryBuffer()
        self._odom_in_map: Pose | None = None
        # On the map, and by the odometry.
        self._stood, self._stood_by_odometry = (StampedReadings(STILL, [2]) for _ in range(2))

    @property
    def is_localised(self) -> bool:
        """Whether a pose came at all."""
        return bool(self._poses)

    def take_pose(self, stamp: float, pose: Pose, now: float) -> None:
        """Take where the base is on the map.

        Args:
            stamp: Of which time of the odometry that is, seconds; 0: it does not tell.
            pose: Map frame, metres and rad.
            now: Seconds.
        """
        self._poses.append((stamp, pose))
        self._stood.add(stamp or now, pose)
        if (odometry := self._odometry.at(stamp)) is not None:
            # map <- odom = (map <- base) (base <- odom)
            self._odom_in_map = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))

    def take_odometry(self, stamp: float, measured: float, pose: Pose) -> None:
        """Take where the base is by the odometry.

        Args:
            stamp: As the message says, seconds of its driver's clock.
            measured: When that was, seconds of this machine's.
            pose: Odometry's frame, metres and rad.
        """
        self._stood_by_odometry.add(measured, pose)
        self._readings.add(measured, pose)
        self._odometry.add(pose, stamp, measured)

    def at(self, measured: float) -> Pose | None:
        """Return where the base was at a time, seconds; None while that is not known.

        A pose is told of the time of the odometry, which seldom is that of a scan: between the two
        the robot went as its odometry says.
        """
        stamp, pose = min(
            self._poses, key=lambda told: abs(told[0] - measured), default=(-math.inf, (0, 0, 0))
        )
        if abs(stamp - measured) <= SAME_TIME:
            return pose
        first, last = min(stamp, measured), max(stamp, measured)
        latest = self._readings.latest
        # Not ahead of the odometry: who begins to turn went otherwise than until then.
        if latest is None or last > latest[0] or last - first > NEAR_TIME:
            return None
        if not self._readings.covers(first, last):
            return None
        now, then = self._by_odometry(measured), self._by_odometry(stamp)
        return composed(pose, relative(then, now))

    def passing(self, measured: float) -> Pose | None:
        """Return where the base was at a time by the odometry alone, map frame; None: unknown."""
        if self._odom_in_map is None or not self._readings.covers(measured, measured):
            return None
        return composed(self._odom_in_map, self._by_odometry(measured))

    def _by_odometry(self, measured: float) -> Pose:
        x, y, yaw = (float(each) for each in self._readings.at(np.array([measured]))[0])
        return x, y, yaw

    def stood(self, first: float, last: float) -> Pose | None:
        """Return where the base stood between two times; None: it moved, or nobody knows."""
        pose = self._stood.stood(first, last)
        if self._stood_by_odometry and self._odom_in_map is not None:
            # Who localises by few scans tells a pose now and then; the odometry is always there.
            odometry = self._stood_by_odometry.stood(first, last)
            if odometry is None:
                return None
            x, y, yaw = odometry
            return composed(self._odom_in_map, (x, y, yaw))
        if pose is None:
            return None
        x, y, yaw = pose
        return x, y, yaw

    def covers(self, first: float, last: float) -> bool:
        """Tell whether it is known how the base moved between two times, or that it stood."""
        return (self._stood_by_odometry or self._stood).covers(first, last)
