"""Scans with the pose from which they were made, by the frames that `tf` tells.

As tf2's MessageFilter does, a scan waits until the frames of its time are told: it may come before
them, or long after.
"""

from __future__ import annotations

from collections.abc import Callable

from lidar_navigation.geometry import Pose, Scan, angle_between
from surveillance_runtime.sensing.frame_tree import FrameTree

LONGEST_WAIT = 1.5
"""The next scan takes the place of one that has waited for so long, seconds."""
MOST_TURN_RATE = 0.3
"""A robot that turns faster, rad/s, turns noticeably while one scan is made."""


class PlacedScans:
    """Holds one scan at a time until it is known from where it was made.

    Args:
        tree: The frames.
        base: The robot's frame.
        root: The map's frame.
        placed: Called with a scan's pose, the scan, its time, seconds, and whether the robot turned
            slowly since the scan before it.
    """

    def __init__(
        self,
        tree: FrameTree,
        base: str,
        root: str,
        placed: Callable[[Pose, Scan, float, bool], None],
    ) -> None:
        self._tree, self._frames, self._placed = tree, (base, root), placed
        self._waiting: tuple[Scan, float, float] | None = None
        self._before: tuple[Pose, float] | None = None

    def take(self, scan: Scan, made: float, now: float) -> None:
        """Take a scan.

        Args:
            scan: The scan.
            made: Its time, seconds of the robot's clock.
            now: Steady seconds.
        """
        if self._waiting is None or now - self._waiting[2] > LONGEST_WAIT:
            self._waiting = scan, made, now
            self.look()

    def look(self) -> None:
        """Hand over the scan that waits if the frames tell by now from where it was made."""
        if self._waiting is None or not self._tree.is_past(*self._frames, self._waiting[1]):
            return
        (scan, made, _), self._waiting = self._waiting, None
        pose = self._tree.pose_at(*self._frames, made)
        before, self._before = self._before, None
        if pose is None:
            return
        self._before = pose, made
        is_slow = False
        if before is not None and 0.0 < made - before[1] < LONGEST_WAIT:
            turned = abs(angle_between(before[0][2], pose[2]))
            is_slow = turned <= MOST_TURN_RATE * (made - before[1])
        self._placed(pose, scan, made, is_slow)
