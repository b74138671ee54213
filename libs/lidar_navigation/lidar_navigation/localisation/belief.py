"""Where a robot may be: several poses, each with the log odds that it is the right one.

One pose is followed; the others are its rivals. All of them move with the odometry, and each scan
changes their odds by how much likelier it makes one than the other (a Bayes filter over a few
hypotheses; Thrun, Burgard, Fox, "Probabilistic Robotics", 7 and 8). Two things are not as in the
textbook. A scan from where the last one was made says the same again, so that it counts by how far
the robot has gone on. And a map is only drawn to half a cell: a small difference says nothing.

A rival that is found while the robot knows where it is had to get there: that somebody pushed it is
unlikely, that somebody carried it is more so. So it begins behind by that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from lidar_navigation.geometry import Pose, angle_between, composed

SURE = 3.0
"""Log odds from which on one pose is told from another: twenty to one."""
FORGOTTEN = 9.0
"""A rival that is behind by this is forgotten; and no one is ever behind by more."""
CARRIED = 5.5
"""Log odds against somebody having carried the robot, or more than a push."""
PUSHED = 2.0
"""Likewise against the least push or slip,"""
PUSHED_BY = 2.5
"""and this much more for each metre or radian of it."""
CHANCE = 0.6
"""A difference of less than this, nats, is how the map is drawn."""
SAME = 0.5
"""Poses nearer than this, metres and rad, are one."""
MOST = 40
"""So many rivals are kept."""


@dataclass
class Rival:
    """Another pose at which the robot may be.

    Attributes:
        pose: The pose.
        odds: Log odds that the robot is there and not at the pose that is followed.
    """

    pose: Pose
    odds: float = 0.0


def same(first: Pose, second: Pose) -> bool:
    """Tell whether two poses are one."""
    turned = abs(angle_between(first[2], second[2]))
    return math.dist(first[:2], second[:2]) < SAME and turned < SAME


def told(difference: float) -> float:
    """Return what is left of a difference of log likelihoods beside chance, nats."""
    return math.copysign(max(0.0, abs(difference) - CHANCE), difference)


class Belief:
    """The pose that is followed, and its rivals.

    Attributes:
        pose: The pose: x, y in metres, yaw in rad, map frame.
        rivals: The others.
    """

    def __init__(self, pose: Pose) -> None:
        self.pose = pose
        self.rivals: list[Rival] = []

    @property
    def alike(self) -> list[Pose]:
        """The poses that are not told from the one that is followed."""
        return [rival.pose for rival in self.rivals if rival.odds > -SURE]

    def believe(self, pose: Pose) -> None:
        """Take a pose as the only one."""
        self.pose = pose
        self.rivals.clear()

    def move(self, step: Pose) -> None:
        """Take how far the robot went, in its own frame."""
        self.pose = composed(self.pose, step)
        for rival in self.rivals:
            rival.pose = composed(rival.pose, step)

    def prior(self, pose: Pose) -> float:
        """Return the log odds that the robot got from the pose that is followed to another one."""
        way = math.dist(pose[:2], self.pose[:2]) + abs(angle_between(self.pose[2], pose[2]))
        return -min(CARRIED, PUSHED + PUSHED_BY * way)

    def add(self, found: Iterable[tuple[Pose, float]]) -> None:
        """Take poses with their log odds, the likeliest first; one that is known stays as it is."""
        for pose, odds in found:
            known = (self.pose, *(rival.pose for rival in self.rivals))
            if odds > -FORGOTTEN and not any(same(pose, other) for other in known):
                self.rivals.append(Rival(pose, odds))
        self.rivals.sort(key=lambda rival: -rival.odds)
        del self.rivals[MOST:]

    def weigh(
        self,
        likelihood: float,
        of: Callable[[Pose], tuple[Pose, float]],
        information: float,
    ) -> None:
        """Take what a scan says of all poses.

        Args:
            likelihood: Its log likelihood at the pose that is followed, nats.
            of: Returns a pose corrected by the scan, and the log likelihood there; minus infinity
                where no robot can be.
            information: How much of the scan is new, 0 to 1.
        """
        kept: list[Rival] = []
        for rival in self.rivals:
            rival.pose, found = of(rival.pose)
            if found == -math.inf:
                continue
            rival.odds += information * told(found - likelihood)
            known = (self.pose, *(other.pose for other in kept))
            if rival.odds > -FORGOTTEN and not any(same(rival.pose, other) for other in known):
                kept.append(rival)
        self.rivals = sorted(kept, key=lambda rival: -rival.odds)

    def follow_best(self, margin: float) -> bool:
        """Follow the likeliest rival if it is so much likelier, or a push off.

        Args:
            margin: The log odds that it must exceed.

        Returns:
            Whether another pose is followed now; the one before is a rival of it.
        """
        if not self.rivals:
            return False
        best = self.rivals[0]
        is_push = self.prior(best.pose) > -CARRIED
        if best.odds <= (0.0 if is_push else margin):
            return False
        before = Rival(self.pose, 0.0)
        self.pose = best.pose
        self.rivals[0] = before
        for rival in self.rivals:
            rival.odds -= best.odds
        self.rivals = [rival for rival in self.rivals if rival.odds > -FORGOTTEN]
        self.rivals.sort(key=lambda rival: -rival.odds)
        return True
