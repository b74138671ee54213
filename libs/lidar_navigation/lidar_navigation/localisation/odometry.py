"""Odometry over time: where the robot was when a scan, or a ray of it, was measured.

A lidar that turns measures for a tenth of a second, and its scan comes some time after that. Each
ray counts from where the robot was at that moment; all of them are then told as seen from one pose,
and carried on to where the robot is by its last odometry.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from lidar_navigation.geometry import Points, Pose, Scan, composed, relative

KEPT = 2.0
"""Odometry is kept for this long, seconds: a scan that is older counts as made now."""
AHEAD = 0.2
"""A scan may be this much younger than the odometry, seconds; the robot goes on as it did."""
_VELOCITY_OVER = 0.1
"""The velocity is that of this time, seconds."""
LATE = 0.1
"""A reading that is older than the one before by this much, seconds, or less came late; by more,
the clock was set back."""
_SMALL_STEP, _SMALL_TURN = 0.3, 0.6
"""A step of at most this between two readings, metres or rad, was driven, whatever their times."""
_TOP_SPEED, _TOP_TURN = 3.0, 4.0
"""No robot of this kind drives or turns faster, m/s and rad/s."""
_ZERO = 0.15
"""A driver that begins anew gives poses this near to zero, metres and rad."""
_AT_ZERO = 0.02
"""One that gives poses as near as this has not gone anywhere yet."""
_MOST_READINGS = 4000


def began_anew(first: Pose, second: Pose, seconds: float | None) -> bool:
    """Tell whether no robot drove from one reading to the next: its odometry began anew.

    Args:
        first: A reading.
        second: The next one.
        seconds: The time between them by their stamps; None: not known. Readings may have been
            lost in between, as on a busy network.
    """
    dx, dy, turn = relative(first, second)
    way, turned = math.hypot(dx, dy), abs(turn)
    is_at_zero = seconds is not None and seconds >= 0.0 and max(map(abs, second)) < _AT_ZERO
    # Of a driver that begins anew also a short way is none that was driven.
    if is_at_zero and _is_too_fast(way, turned, seconds or 0.0, _AT_ZERO, _AT_ZERO):
        return True
    if way <= _SMALL_STEP and turned <= _SMALL_TURN:
        return False
    if seconds is None or seconds < 0.0 or max(map(abs, second)) < _ZERO:
        return True
    return _is_too_fast(way, turned, seconds, _SMALL_STEP, _SMALL_TURN)


def _is_too_fast(way: float, turned: float, seconds: float, more: float, more_turn: float) -> bool:
    return way > more + _TOP_SPEED * seconds or turned > more_turn + _TOP_TURN * seconds


class ContinuousOdometry:
    """Odometry that goes on where it was when its driver begins anew at 0."""

    def __init__(self) -> None:
        self._last: tuple[Pose, float | None] | None = None
        self._pose: Pose = (0.0, 0.0, 0.0)
        self._speed = (0.0, 0.0)

    def take(self, reading: Pose, stamp: float | None = None) -> Pose:
        """Return where a reading has the robot, in the frame in which the first reading was."""
        if self._last is None:
            self._pose = reading
        step, _ = self.step(reading, stamp)
        self._pose = composed(self._pose, step)
        return self._pose

    def step(self, reading: Pose, stamp: float | None = None) -> tuple[Pose, tuple[float, float]]:
        """Return how far the robot went since the reading before.

        Args:
            reading: In the odometry's own frame.
            stamp: Its time, seconds; None: not known.

        Returns:
            The step, in the robot's frame; and how far it may have gone beside, metres and rad,
            while the odometry that began anew said nothing.
        """
        last, self._last = self._last, (reading, stamp)
        if last is None:
            return (0.0, 0.0, 0.0), (0.0, 0.0)
        before, then = last
        seconds = None if stamp is None or then is None else stamp - then
        if began_anew(before, reading, seconds):
            silent = min(max(seconds or 0.0, 0.0), KEPT)
            return (0.0, 0.0, 0.0), (silent * self._speed[0], silent * self._speed[1])
        step = relative(before, reading)
        if seconds is not None and seconds > 0.0:
            self._speed = math.hypot(*step[:2]) / seconds, abs(step[2]) / seconds
        return step, (0.0, 0.0)


class OdometryBuffer:
    """The last readings of the odometry, by their stamps."""

    def __init__(self) -> None:
        self._readings: deque[tuple[float, Pose]] = deque(maxlen=_MOST_READINGS)

    @property
    def latest(self) -> tuple[float, Pose] | None:
        """Stamp, s, and pose of the last reading; None: there is none."""
        return self._readings[-1] if self._readings else None

    def add(self, stamp: float, pose: Pose) -> None:
        """Take a reading; one that is a little older than the last counts for nothing.

        Where the clock was set, or the odometry began anew, all before is forgotten.
        """
        if self._readings:
            last, before = self._readings[-1]
            step = stamp - last
            if not -LATE < step < KEPT or began_anew(before, pose, step):
                self._readings.clear()
            elif step <= 0.0:
                return
        self._readings.append((stamp, pose))
        while stamp - self._readings[0][0] > KEPT:
            self._readings.popleft()

    def covers(self, first: float, last: float) -> bool:
        """Tell whether it is known where the robot was from one time to another, seconds."""
        if not self._readings:
            return False
        return self._readings[0][0] - 1e-6 <= first and last <= self._readings[-1][0] + AHEAD

    def at(self, stamps: Points) -> Points:
        """Return poses, in the frame of the odometry, x, y in metres and yaw in rad.

        Between readings they are interpolated; after the last the robot goes on as it did.

        Args:
            stamps: Times, shape (n,), seconds.

        Returns:
            Shape (n, 3).
        """
        times = np.array([stamp for stamp, _ in self._readings])
        poses = np.array([pose for _, pose in self._readings])
        poses[:, 2] = np.unwrap(poses[:, 2])
        found = np.stack([np.interp(stamps, times, column) for column in poses.T], axis=1)
        after = np.maximum(stamps - times[-1], 0.0)
        first = int(np.searchsorted(times, times[-1] - _VELOCITY_OVER))
        if after.any() and first < len(times) - 1:
            rate = (poses[-1] - poses[first]) / (times[-1] - times[first])
            found += after[:, None] * rate
        return np.asarray(found)


def joined(scan: Scan, odometry: OdometryBuffer, stamp: float) -> Scan:
    """Return a scan as seen from where the robot is by its last odometry.

    Args:
        scan: The scan, as seen from where the robot was at each ray.
        odometry: Where that was.
        stamp: The time of the first ray, seconds.

    Returns:
        The same scan where the odometry of that time is not known. Its rays are in the order of
        their angles.
    """
    known = joined_if_known(scan, odometry, stamp)
    return scan if known is None else known


def joined_if_known(scan: Scan, odometry: OdometryBuffer, stamp: float) -> Scan | None:
    """Return a scan as `joined` does; None where the odometry of its time is not known.

    A map that is built must not take such a scan for one of now: it would stay at a wrong pose.
    """
    sweep = 0.0 if scan.times is None else float(scan.times.max(initial=0.0))
    latest = odometry.latest
    if latest is None or not odometry.covers(stamp, stamp + sweep):
        return None
    now = latest[1]
    if scan.times is None or sweep == 0.0:
        x, y, yaw = odometry.at(np.array([stamp]))[0].tolist()
        step = relative(now, (x, y, yaw))
        return replace(scan, mount=composed(step, scan.mount)) if any(step) else scan
    poses = odometry.at(stamp + scan.times)
    if not np.ptp(poses, axis=0).any():
        x, y, yaw = poses[0].tolist()
        return replace(scan, mount=composed(relative(now, (x, y, yaw)), scan.mount), times=None)
    mount_x, mount_y, mount_yaw = scan.mount
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    origin_x = poses[:, 0] + cos * mount_x - sin * mount_y
    origin_y = poses[:, 1] + sin * mount_x + cos * mount_y
    bearing = poses[:, 2] + mount_yaw + scan.angles
    middle = int(np.argmin(np.abs(scan.times - sweep / 2)))
    centre_x, centre_y = origin_x[middle], origin_y[middle]
    heading = poses[middle, 2] + mount_yaw
    met = np.isfinite(scan.ranges)
    reach = np.where(met, scan.ranges, 1.0)
    x = origin_x + reach * np.cos(bearing) - centre_x
    y = origin_y + reach * np.sin(bearing) - centre_y
    # A ray that met nothing has a direction alone.
    angles = np.where(met, np.arctan2(y, x), bearing) - heading
    start = scan.angles[0]
    angles = start + np.mod(angles - start + math.pi / len(angles), math.tau)
    angles -= math.pi / len(angles)
    ranges = np.where(met, np.hypot(x, y), scan.ranges)
    order = np.argsort(angles, kind='stable')
    seen_from = (float(poses[middle, 0]), float(poses[middle, 1]), float(poses[middle, 2]))
    return Scan(
        angles[order],
        ranges[order],
        scan.range_max,
        composed(relative(now, seen_from), scan.mount),
    )
