"""The frames of a robot as `tf` and `tf_static` tell them: where one is in another, and how old
that is. No ROS in here: who hears the topics hands over matrices.

As in tf2, each frame has one parent; the last word counts, and where a frame was at a time lies
between the two words before and behind it. tf2 does not say who else told of a
frame, so that two drivers which both do make a robot jump: `doubled` names them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidar_navigation.geometry import Pose

SAME_PLACE = 0.02
"""Two words on a fixed frame that differ by less agree, metres and radians."""
MOST_FRAMES = 10_000
"""Beyond so many frames, of what a stranger may make up, none is taken."""
KEPT_SECONDS, MOST_KEPT = 5.0, 1000
"""So long, and so many words long, it is known where a frame was."""
WIDEST_GAP = 1.5
"""Between two words that are farther apart, seconds, nobody knows where a frame was."""


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
    _past: dict[str, deque[FrameLink]] = field(default_factory=dict)

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
        if not math.isinf(link.stamp):
            self._remember(child, link)

    def _remember(self, child: str, link: FrameLink) -> None:
        past = self._past.setdefault(child, deque(maxlen=MOST_KEPT))
        if past and (link.stamp < past[-1].stamp or link.parent != past[-1].parent):
            past.clear()  # the clock was set, or it begins anew
        if past and link.stamp == past[-1].stamp:
            past.pop()
        past.append(link)
        while link.stamp - past[0].stamp > KEPT_SECONDS:
            past.popleft()

    def _link_at(self, child: str, stamp: float) -> FrameLink | None:
        """Return where a frame was at a time, seconds; None: that is not known, or not yet."""
        last = self.links.get(child)
        if last is None or math.isinf(last.stamp):
            return last
        behind = None
        for link in reversed(self._past[child]):
            if link.stamp == stamp:
                return link
            if link.stamp < stamp:
                if behind is None or behind.stamp - link.stamp > WIDEST_GAP:
                    return None
                part = (stamp - link.stamp) / (behind.stamp - link.stamp)
                return FrameLink(link.parent, _between(link.matrix, behind.matrix, part), stamp)
            behind = link
        return None

    def is_past(self, child: str, root: str, stamp: float) -> bool:
        """Tell whether all of the way from a frame to another one is told of a time or later."""
        found = self.matrix(child, plain(root).__eq__)
        return found is not None and found[1] >= stamp

    def matrix(
        self, child: str, is_root: Callable[[str], bool], at_time: float | None = None
    ) -> tuple[NDArray[np.float64], float, float] | None:
        """Return where a frame is in the first frame above it that is wanted.

        Args:
            child: The frame.
            is_root: Tells whether a frame is one to stop at.
            at_time: Of when, seconds of the publishers' clock; None: the last word.

        Returns:
            Its matrix, the oldest stamp on the way, and when the oldest word on it came; None:
            nobody tells of all of it.
        """
        at = plain(child)
        found, stamp, came = np.eye(4), math.inf, math.inf
        for _ in range(len(self.links) + 1):
            if is_root(at):
                return found, stamp, came
            link = self.links.get(at) if at_time is None else self._link_at(at, at_time)
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
        return _in_plane(found[0]), found[1]

    def pose_at(self, child: str, root: str, stamp: float) -> Pose | None:
        """Return where a frame was in the plane of another one at a time, seconds; None: that is
        not known, or not yet.
        """
        found = self.matrix(child, plain(root).__eq__, stamp)
        return None if found is None else _in_plane(found[0])


def _in_plane(matrix: NDArray[np.float64]) -> Pose:
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    return float(matrix[0, 3]), float(matrix[1, 3]), yaw


def _between(
    before: NDArray[np.float64], behind: NDArray[np.float64], part: float
) -> NDArray[np.float64]:
    """Return the transform at a part of the way between two, shape (4, 4)."""
    found: NDArray[np.float64] = before + part * (behind - before)
    # The rotation nearest to the mean of two (the orthogonal factor of its polar decomposition).
    left, _, right = np.linalg.svd(found[:3, :3])
    found[:3, :3] = left @ right
    return found
