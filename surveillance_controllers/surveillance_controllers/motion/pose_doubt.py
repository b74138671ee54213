"""Whether the pose that another program tells can be, by what the lidar sees.

AMCL does not find a robot again that was carried away, or whose pose a person set wrong: it goes on
to tell a pose, sure of itself. Rays that go on through walls of the map, seen from there, say so.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from floor_plans import Grid
from lidar_navigation.geometry import Pose, Scan, angle_between
from lidar_navigation.localisation.scan_fit import ScanFit

RAYS = 90
"""So many rays of a scan are looked at."""
THROUGH_MANY = 0.28
"""A pose does not fit when more than this part of the rays goes on through walls,"""
THROUGH = 0.1
"""or more than this part does,"""
HITS = 0.45
"""and less than this part goes as far as it should. (Beside AMCL in the seven rooms, of 100 poses
that were right within 0.4 m 99 had at most 0.23 that went through and at least 0.52 that hit.)"""
HITS_AGAIN = 0.6
"""It fits again from this part on."""
LOOK_PERIOD = 1.0
"""Time between two scans that are compared with the map, seconds."""
AFTER = 5.0
"""A pose is in doubt that has not fitted for so long, seconds."""
KEPT = 20
"""So many poses are kept for the scans that come behind them."""
WIDEST_GAP = 0.6
"""Between two poses that are farther apart, seconds, nobody knows where the robot was;"""
MOST_TURN = 0.1
"""nor, exactly enough, where it turned by more than this, rad."""


class PoseTrace:
    """Where the robot was said to be, by stamp: a scan may come late."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=KEPT)

    def add(self, stamp: float, pose: Pose) -> None:
        """Add a pose of a time, seconds; an older one than the last begins anew."""
        if self._poses and stamp <= self._poses[-1][0]:
            if stamp == self._poses[-1][0]:
                return
            self._poses.clear()
        self._poses.append((stamp, pose))

    def is_past(self, stamp: float) -> bool:
        """Tell whether there is a pose of this time or later."""
        return bool(self._poses) and self._poses[-1][0] >= stamp

    def at(self, stamp: float) -> Pose | None:
        """Return where it was at a time, between two poses; None: that is not known."""
        for (before, a), (after, b) in pairwise(self._poses):
            if before <= stamp <= after:
                turn = angle_between(a[2], b[2])
                if after - before > WIDEST_GAP or abs(turn) > MOST_TURN:
                    return None
                part = (stamp - before) / (after - before)
                x, y = (p + part * (q - p) for p, q in zip(a[:2], b[:2], strict=True))
                return x, y, a[2] + part * turn
        return None


class PoseDoubt:
    """Compares scans with the map.

    Attributes:
        in_doubt: Whether the pose has not fitted for a while.
    """

    def __init__(self) -> None:
        self._fit: ScanFit | None = None
        self._since: float | None = None
        self.in_doubt = False
        self._trace = PoseTrace()
        self._scan: tuple[Scan, float] | None = None
        self._offered_at = -math.inf

    def set_map(self, grid: Grid) -> None:
        """Take the map that the pose is told in."""
        self._fit = ScanFit(grid)
        self._since = None

    def offer(self, scan: Scan, stamp: float, now: float) -> None:
        """Keep a scan each `LOOK_PERIOD` until the pose of its time is told.

        Args:
            scan: The scan.
            stamp: Its time, seconds.
            now: Steady time, seconds.
        """
        if now - self._offered_at >= LOOK_PERIOD:
            self._offered_at = now
            self._scan = scan, stamp

    def take_pose(self, stamp: float, pose: Pose) -> Pose | None:
        """Take where the robot is said to be at a time, seconds, map frame.

        Returns:
            The pose with which a scan was compared now; None: none was.
        """
        self._trace.add(stamp, pose)
        if self._scan is None or not self._trace.is_past(self._scan[1]):
            return None
        (scan, made), self._scan = self._scan, None
        there = self._trace.at(made)
        if there is not None:
            self.look(there, scan, made)
        return there

    def look(self, pose: Pose, scan: Scan, now: float) -> bool:
        """Take a scan from a pose; return whether the pose is in doubt.

        Args:
            pose: Where the robot is said to be, map frame.
            scan: What it sees from there.
            now: The time, seconds.
        """
        if self._fit is None:
            return False
        seen = self._fit.evidence(pose, scan.thinned(RAYS))
        needed = HITS_AGAIN if self.in_doubt else HITS
        if seen.long <= THROUGH or (seen.long <= THROUGH_MANY and seen.hit >= needed):
            self._since, self.in_doubt = None, False
        elif self._since is None:
            self._since = now
        elif now - self._since >= AFTER:
            self.in_doubt = True
        return self.in_doubt
