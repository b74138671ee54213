"""The frames of a robot as `tf` and `tf_static` tell them: where one is in another, and how old
that is. No ROS in here: who hears the topics hands over matrices.

As in tf2, each frame has one parent; the last word counts. tf2 does not say who else told of a
frame, so that two drivers which both do make a robot jump: `doubled` names them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidar_navigation.geometry import Pose

SAME_PLACE = 0.02
"""Two words on a fixed frame that differ by less agree, metres and radians."""
MOST_FRAMES = 10_000
"""Beyond so many frames, of what a stranger may make up, none is taken."""


@dataclass(frozen=True)
class FrameLink:
    """Where a frame is in its parent.

    Attributes:
        parent: The parent's name.
        matrix: Homogeneous, shape (4, 4), metres.
        stamp: Of when, seconds of the publisher's clock; infinite: it does not move.
        came: When it was heard, steady seconds.
    """

    parent: str
    matrix: NDArray[np.float64]
    stamp: float = math.inf
    came: float = math.inf


def plain(frame: str) -> str:
    """Return a frame's name without the slash that older drivers begin it with, as tf2 does."""
    return frame.removeprefix('/')


@dataclass
class FrameTree:
    """What was told so far.

    Attributes:
        links: By the name of the child.
        doubled: Of each frame of which two words differ, what they are, in words.
    """

    links: dict[str, FrameLink] = field(default_factory=dict)
    doubled: dict[str, str] = field(default_factory=dict)

    def take(self, child: str, link: FrameLink) -> None:
        """Take where a frame is."""
        child = plain(child)
        before = self.links.get(child)
        if before is None and len(self.links) >= MOST_FRAMES:
            return
        if before is not None:
            if before.parent != link.parent:
                self.doubled[child] = (
                    f'{child} is told below {before.parent} and below {link.parent}: expected one '
                    'parent'
                )
            elif math.isinf(link.stamp) and math.isinf(before.stamp):
                off = float(np.abs(link.matrix - before.matrix).max())
                if off > SAME_PLACE:
                    self.doubled[child] = (
                        f'{child} is told at two places on {link.parent}, {off:.2f} apart: '
                        "expected it once, from the robot's own description or from the profile"
                    )
        self.links[child] = link

    def matrix(
        self, child: str, is_root: Callable[[str], bool]
    ) -> tuple[NDArray[np.float64], float, float] | None:
        """Return where a frame is in the first frame above it that is wanted.

        Args:
            child: The frame.
            is_root: Tells whether a frame is one to stop at.

        Returns:
            Its matrix, the oldest stamp on the way, and when the oldest word on it came; None:
            nobody tells of all of it.
        """
        at = plain(child)
        found, stamp, came = np.eye(4), math.inf, math.inf
        for _ in range(len(self.links) + 1):
            if is_root(at):
                return found, stamp, came
            link = self.links.get(at)
            if link is None:
                return None
            found = link.matrix @ found
            stamp, came = min(stamp, link.stamp), min(came, link.came)
            at = link.parent
        return None

    def pose(self, child: str, root: str, now: float, most_age: float) -> tuple[Pose, float] | None:
        """Return where a frame is in the plane of another one, and its stamp in seconds.

        Args:
            child: The frame.
            root: The other one.
            now: Steady seconds.
            most_age: What came longer ago than this is not believed, seconds.

        Returns:
            None: That is not told, or not any more.
        """
        found = self.matrix(child, plain(root).__eq__)
        if found is None or now - found[2] > most_age:
            return None
        matrix, stamp, _ = found
        yaw = math.atan2(matrix[1, 0], matrix[0, 0])
        return (float(matrix[0, 3]), float(matrix[1, 3]), yaw), stamp
