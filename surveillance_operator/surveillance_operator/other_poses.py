"""Where the robots of other namespaces are."""

from __future__ import annotations

import contextlib

from geometry_msgs.msg import PoseWithCovarianceStamped

from surveillance_operator.mission_state import Pose
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.topics import POSE_TOPIC
from surveillance_runtime.conversions import pose_from
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

POSE_TYPE = 'geometry_msgs/msg/PoseWithCovarianceStamped'


class OtherPoses:
    """Hears the poses of robots of other namespaces.

    Args:
        node: The node that watches.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._own = node.get_namespace().strip('/')
        self._poses: dict[str, PolledSubscription] = {}

    def find(self, left_out: frozenset[str]) -> frozenset[str]:
        """Hear the robots that came; return the names of those that went, or are left out."""
        for topic, kinds in self._node.get_topic_names_and_types():
            namespace, _, name = topic.strip('/').rpartition('/')
            robot = namespace or 'robot'
            is_pose = name == POSE_TOPIC and POSE_TYPE in kinds
            is_other = is_pose and namespace != self._own and namespace not in left_out
            if is_other and robot not in self._poses and self._node.count_publishers(topic):
                self._poses[robot] = PolledSubscription(
                    self._node, PoseWithCovarianceStamped, topic, STATE_QOS
                )
        gone = frozenset(
            robot
            for robot, subscription in self._poses.items()
            if robot in left_out or not self._node.count_publishers(subscription.topic)
        )
        for robot in gone:
            self._poses.pop(robot).destroy()
        return gone

    def take(self) -> dict[str, Pose]:
        """Return the poses that came."""
        came = {}
        for robot, subscription in self._poses.items():
            if (newest := subscription.newest()) is not None:
                with contextlib.suppress(ValueError):
                    came[robot] = pose_from(newest[0].pose.pose)
        return came
