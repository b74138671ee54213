"""Odometry in true metres and radians, with the turns of a gyroscope where there is one.

Wheels that slip count turns that nobody made, and a driver that begins anew forgets some. A
gyroscope tells turns whatever the wheels do. It is believed once it has agreed with the odometry
over some turns: then it is known to be the right way up, or upside down, and to tell rad/s. Its
offset is measured while the wheels stand.
"""

from __future__ import annotations

import math
from collections import deque

from lidar_navigation.geometry import Pose, composed, relative
from lidar_navigation.localisation.odometry import KEPT, began_anew

PROVEN_AFTER = 1.0
"""A gyroscope is believed after it has been seen through so many radians of turns,"""
AGREES = 0.8, 1.25
"""if it tells so many radians for each of the odometry's, or for each the other way round."""
_HOLE = 0.15
"""Between two of its readings no more than this may pass, seconds."""
_STANDS = 1e-3
"""Wheels that do less than this between two readings stand, metres or rad."""
_OFFSET_GAIN = 0.02
_MOST_READINGS = 2000


class _Gyroscope:
    """The last turns that a gyroscope told, and what it is worth."""

    def __init__(self) -> None:
        self._turned: deque[tuple[float, float, float]] = deque(maxlen=_MOST_READINGS)
        self._offset = 0.0
        self._odometry = self._both = 0.0
        self._sense = 0.0

    def add(self, stamp: float, rate: float) -> None:
        """Take a reading, rad/s, anticlockwise, at a time in seconds."""
        whole = 0.0
        if self._turned:
            last, before, whole = self._turned[-1]
            if not 0.0 < stamp - last <= _HOLE:
                if -_HOLE < stamp - last <= 0.0:
                    return
                self._turned.clear()
            else:
                whole += (stamp - last) * (rate + before) / 2
        self._turned.append((stamp, rate, whole))
        while stamp - self._turned[0][0] > KEPT:
            self._turned.popleft()

    def turned(self, first: float, last: float) -> float | None:
        """Return the turn between two times; None where it is not known, or not to be believed."""
        whole = self._whole(first, last)
        return None if whole is None or not self._sense else self._sense * whole

    def compare(self, turn: float, stands: bool, first: float, last: float) -> None:
        """Hold it against what the odometry told between two times."""
        whole = self._whole(first, last)
        if whole is None:
            return
        if stands:
            self._offset += _OFFSET_GAIN * whole / max(last - first, 1e-3)
            return
        if self._odometry >= PROVEN_AFTER:
            return
        self._odometry += abs(turn)
        self._both += math.copysign(1.0, turn) * whole
        ratio = self._both / max(self._odometry, 1e-9)
        if self._odometry >= PROVEN_AFTER and AGREES[0] <= abs(ratio) <= AGREES[1]:
            self._sense = math.copysign(1.0, ratio)

    def _whole(self, first: float, last: float) -> float | None:
        """Return the turn without the offset; None where it is not known."""
        if last <= first or not self._turned:
            return None
        begin, end = self._at(first), self._at(last)
        if begin is None or end is None:
            return None
        return end - begin - self._offset * (last - first)

    def _at(self, stamp: float) -> float | None:
        """Return the turn up to a time, from the first reading that is kept."""
        last, rate, whole = self._turned[-1]
        if stamp >= last:
            return whole + rate * (stamp - last) if stamp - last <= _HOLE else None
        before = None
        for reading in reversed(self._turned):
            if reading[0] <= stamp:
                before = reading
                break
        if before is None:
            return None
        return before[2] + before[1] * (stamp - before[0])


class TrueOdometry:
    """Makes true poses of what an odometry counts.

    Args:
        scale: True metres for each metre that it counts.
        turn_scale: Likewise of its turns.
    """

    def __init__(self, scale: float = 1.0, turn_scale: float = 1.0) -> None:
        self._scale, self._turn_scale = scale, turn_scale
        self._gyroscope = _Gyroscope()
        self._last: tuple[Pose, float] | None = None
        self._pose: Pose = (0.0, 0.0, 0.0)
        self._is_told = (scale, turn_scale) == (1.0, 1.0)
        self._is_new = False

    def restart(self) -> None:
        """Take that another odometry begins with the next reading."""
        self._is_new = True

    def turn(self, stamp: float, rate: float) -> None:
        """Take a reading of a gyroscope: about the vertical axis, rad/s, at a time in seconds."""
        if math.isfinite(rate):
            self._gyroscope.add(stamp, rate)

    def take(self, reading: Pose, stamp: float) -> Pose:
        """Return where the robot is by a reading, in the frame in which the first one was.

        One that began anew is told as it is, unless a gyroscope says how far the robot turned.

        Args:
            reading: In the odometry's own frame.
            stamp: Its time, seconds.
        """
        last, self._last = self._last, (reading, stamp)
        is_new, self._is_new = self._is_new, False
        if last is None:
            self._pose = reading
            return reading
        before, then = last
        if is_new or began_anew(before, reading, stamp - then):
            turned = self._gyroscope.turned(then, stamp)
            if is_new or turned is not None:
                self._is_told = False
                self._pose = composed(self._pose, (0.0, 0.0, turned or 0.0))
            else:
                self._pose = reading
            return self._pose
        x, y, turn = relative(before, reading)
        x, y, turn = self._scale * x, self._scale * y, self._turn_scale * turn
        stands = math.hypot(x, y) < _STANDS and abs(turn) < _STANDS
        turned = self._gyroscope.turned(then, stamp)
        self._gyroscope.compare(turn, stands, then, stamp)
        if turned is None and self._is_told:
            self._pose = reading
            return reading
        self._is_told = False
        if turned is not None:
            # The way was driven while it turned: half of what the wheels missed bends it.
            bend = (turned - turn) / 2
            cos, sin = math.cos(bend), math.sin(bend)
            x, y, turn = cos * x - sin * y, sin * x + cos * y, turned
        self._pose = composed(self._pose, (x, y, turn))
        return self._pose
