"""Hears `tf` and `tf_static`: keeps a `FrameTree` up to date for a node."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from lidar_navigation.geometry import Pose
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.sensing import conversions
from surveillance_runtime.sensing.frame_tree import FrameLink, FrameTree, plain

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

STATIC_QOS = QoSProfile(
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


class FramesHeard:
    """Hears the frames of a robot, in the executor's thread.

    Args:
        node: The node that hears.
        moving: Whether `tf` is heard, too; else `tf_static` alone.
        news: Called when something came.

    Attributes:
        tree: What is known.
    """

    def __init__(
        self, node: PatrolNode, *, moving: bool = True, news: Callable[[], object] = lambda: None
    ) -> None:
        self._node, self._news = node, news
        self._told: set[str] = set()
        self.tree = FrameTree()
        if TFMessage is None:
            return
        # All robots of a domain may share these topics.
        node.create_subscription(TFMessage, 'tf_static', self.hear_fixed, STATIC_QOS)
        if moving:
            node.create_subscription(TFMessage, 'tf', self.hear_moving, 100)

    def hear_fixed(self, message: Any) -> None:
        """Take a message of `tf_static`."""
        self._take(message, fixed=True)

    def hear_moving(self, message: Any) -> None:
        """Take a message of `tf`."""
        self._take(message, fixed=False)

    def _take(self, message: Any, *, fixed: bool) -> None:
        now = math.inf if fixed else time.monotonic()
        for each in message.transforms:
            with conversions.refusing(self._node, f'tf: {each.child_frame_id}'):
                matrix = conversions.matrix_from(each.transform)
                stamp = math.inf if fixed else seconds_of(each.header.stamp)
                link = FrameLink(plain(each.header.frame_id), matrix, stamp, now)
                self.tree.take(each.child_frame_id, link)
        for text in self.tree.doubled.values():
            if text not in self._told:
                self._told.add(text)
                self._node.incidents.begin(('topic', 'tf'), text)
        self._news()

    def pose(self, child: str, root: str, most_age: float) -> tuple[Pose, float] | None:
        """See `FrameTree.pose`; as of now."""
        return self.tree.pose(child, root, time.monotonic(), most_age)
