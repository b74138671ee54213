"""A robot that does not know where it is moves so that it sees what tells.

What a person with a joystick would do: it turns once around, then drives back the way it came, a
few metres at a time, and turns again; where that is used up or barred, it drives to where there is
most room. All of that goes by odometry and lidar alone, for the map tells nothing then. It drives
slowly, and ends when it has tried enough: somebody else has to say where it is.

A robot that may be where the map forbids to drive only turns: no lidar sees a staircase.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import numpy as np

from lidar_navigation.driving.driving import Spin
from lidar_navigation.driving.path_following import (
    DriveParameters,
    PathFollower,
    Velocity,
    room_ahead,
)
from lidar_navigation.geometry import Points, Pose, composed

SPEED = 0.25
"""How fast it drives, m/s."""
PIECE = 2.0
"""It looks around after so much of its way, metres."""
ROAMS = 6
"""So often it drives to where there is most room."""
_LEAST_ROOM = 0.4
"""A way that is shorter than this shows nothing new, metres."""
_LEG_SECONDS = 30.0
"""A way that takes longer ends, seconds,"""
_BLOCKED_SECONDS = 2.0
"""and one on which something stands for so long."""
_BEARINGS = 24


class OdometryTrack:
    """The way that a robot came, in the frame of its odometry."""

    SPACING, MOST = 0.15, 200

    def __init__(self) -> None:
        self._points: deque[tuple[float, float]] = deque(maxlen=self.MOST)

    def add(self, pose: Pose) -> None:
        """Take where the robot is."""
        if not self._points or math.dist(self._points[-1], pose[:2]) >= self.SPACING:
            self._points.append(pose[:2])

    def taken_back(self, pose: Pose, length: float) -> Points:
        """Take the last part of the way, from a pose backwards, shape (n, 2), metres."""
        back, way = [pose[:2]], 0.0
        while self._points and way < length:
            point = self._points.pop()
            way += math.dist(back[-1], point)
            back.append(point)
        return np.array(back)


class Relocation:
    """One search by moving; whoever calls it ends it when the robot knows where it is.

    Args:
        track: The way that the robot came.
        robot: Its limits.
        may_drive: Whether it may leave the spot.

    Attributes:
        is_over: Whether all was tried.
    """

    def __init__(
        self, track: OdometryTrack, robot: DriveParameters | None = None, *, may_drive: bool = True
    ) -> None:
        robot = robot or DriveParameters()
        self._robot = replace(robot, speed=min(robot.speed, SPEED))
        self._track, self._may_drive = track, may_drive
        self._task: Spin | PathFollower = Spin()
        self._roams = 0
        self._now: float | None = None
        self._begun = 0.0
        self._free_at = 0.0
        self.is_over = False

    def step(self, now: float, pose: Pose, seen: Points) -> Velocity:
        """Decide the velocity for the next moment.

        Args:
            now: The time, seconds.
            pose: Where the odometry has the robot, in a frame that goes on.
            seen: What the lidar sees, robot's frame, shape (n, 2), metres.
        """
        dt = 0.0 if self._now is None else max(0.0, now - self._now)
        self._now = now
        if self.is_over:
            return Velocity()
        if isinstance(self._task, Spin):
            velocity = self._task.step(pose[2], now)
            if not self._task.done:
                return Velocity(0.0, max(-0.5, min(0.5, velocity.turn)))
            self._drive_on(now, pose, seen)
            return Velocity()
        guidance = self._task.step(pose, seen, dt)
        if not guidance.blocked:
            self._free_at = now
        if (
            guidance.done
            or now - self._free_at > _BLOCKED_SECONDS
            or now - self._begun > _LEG_SECONDS
        ):
            self._task = Spin()
            return Velocity()
        return guidance.velocity

    def _drive_on(self, now: float, pose: Pose, seen: Points) -> None:
        """Choose the next way; end where there is none."""
        self._begun = self._free_at = now
        if not self._may_drive:
            self.is_over = True
            return
        back = self._track.taken_back(pose, PIECE)
        if len(back) > 1 and math.dist(back[0], back[-1]) >= _LEAST_ROOM:
            self._task = PathFollower(back, self._robot)
            return
        room, bearing = self._most_room(seen)
        if self._roams >= ROAMS or room < _LEAST_ROOM:
            self.is_over = True
            return
        self._roams += 1
        end = composed(pose, (room * math.cos(bearing), room * math.sin(bearing), 0.0))
        self._task = PathFollower([pose[:2], end[:2]], self._robot)

    def _most_room(self, seen: Points) -> tuple[float, float]:
        """Return how far there is room, metres, and in which direction, rad, robot's frame."""
        best = 0.0, 0.0
        for bearing in (np.arange(_BEARINGS) * (math.tau / _BEARINGS)).tolist():
            cos, sin = math.cos(bearing), math.sin(bearing)
            turned = seen @ np.array([[cos, -sin], [sin, cos]])
            room = room_ahead(turned, 0.0, self._robot.body, 2 * self._robot.margin, PIECE)
            if room > best[0] + 1e-6:
                best = room, bearing
        return best
