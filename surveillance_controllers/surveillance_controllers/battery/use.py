"""The battery of a robot that moves: fed with what the robot reports, it drains and charges by
itself.

Poses come at any rate. A jump that no drive could make is a correction of the estimate, not a way
driven, so the counted way and turn are held to what the robot's top speeds allow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from surveillance_controllers.battery.model import Battery
from surveillance_controllers.geometry import Pose, angle_between
from surveillance_runtime.robot_arm import ARM, TrajectoryPoint

LONGEST_AWAY = 86_400.0
"""A longer time between two steps is none, but a jump of the clock, seconds."""
LONGEST_MOTION = 20.0
"""No motion of the arm is counted for longer, seconds, whatever its trajectory says."""

TOP_SPEED, TOP_TURN = 2.0, 3.0
"""No robot is faster, m/s and rad/s: what is more is a correction of the estimate."""


class BatteryInUse:
    """A battery in a robot that drives, uses its arm, and charges at the station only.

    Args:
        battery: The battery.
        station: Where the charging station is.
        dock_reach: Distance from the station within which the robot charges, metres.
        since: When the battery had its level, seconds; None: when time first passes.

    Attributes:
        pose: Where the robot was last; None until it reports.
    """

    def __init__(
        self, battery: Battery, station: Pose, dock_reach: float, since: float | None
    ) -> None:
        self._battery = battery
        self._station = station
        self._dock_reach = dock_reach
        self._last = since
        self.pose: Pose | None = None
        self._seen_at = 0.0
        self._metres = self._radians = 0.0
        self._arm_seconds = 0.0
        # When the arm moves: since when that was not counted yet, and until when.
        self._arm_moves = 0.0, 0.0

    @property
    def docked(self) -> bool:
        """Whether the robot stands at the station."""
        return (
            self.pose is not None
            and math.dist(self.pose[:2], self._station[:2]) <= self._dock_reach
        )

    def see_pose(self, pose: Pose, now: float) -> None:
        """Take where the robot is at `now` (seconds)."""
        if self.pose is not None and now > self._seen_at:
            passed = now - self._seen_at
            self._metres += min(math.dist(pose[:2], self.pose[:2]), TOP_SPEED * passed)
            turn = abs(angle_between(self.pose[2], pose[2]))
            self._radians += min(turn, TOP_TURN * passed)
        self.pose, self._seen_at = pose, now

    def move_arm(self, names: Sequence[str], points: Sequence[TrajectoryPoint], now: float) -> None:
        """Take that the arm follows a trajectory from `now` (seconds) on, instead of what it did
        before, unless it cannot follow that."""
        try:
            ARM.check(names, points)
        except ValueError:
            return  # Whoever moves the arm says so.
        self._count_arm(now)
        self._arm_moves = now, now + min(points[-1].time if points else 0.0, LONGEST_MOTION)

    def _count_arm(self, now: float) -> None:
        since, until = self._arm_moves
        self._arm_seconds += max(0.0, min(now, until) - since)
        self._arm_moves = now, until

    def advance(self, now: float) -> None:
        """Let time pass up to `now` (seconds): draw, and charge at the station."""
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        if not 0.0 <= passed <= LONGEST_AWAY:
            passed = 0.0  # Another clock.
        self._count_arm(now)
        self._battery.draw(passed, self._metres, self._radians, min(self._arm_seconds, passed))
        self._metres = self._radians = self._arm_seconds = 0.0
        if self.docked:
            self._battery.charge(passed)

    def why_not_charging(self) -> str | None:
        """Say why the battery cannot charge now; None when it can."""
        if self.docked:
            return None
        if self.pose is None:
            return 'where the robot is is not known (nothing came on amcl_pose)'
        x, y, _ = self.pose
        at_x, at_y, _ = self._station
        return f'the robot is at ({x:.2f}, {y:.2f}), not at the station ({at_x:.2f}, {at_y:.2f})'
