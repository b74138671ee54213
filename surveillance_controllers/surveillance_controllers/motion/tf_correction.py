"""The transform from the map to the odometry's frame on `tf`, where tf2's messages are installed.

The wheels on PyPI hold no tf2_msgs; an installed ROS 2 does. Without them nothing is published.
"""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import TransformStamped

from surveillance_controllers import conversions
from surveillance_controllers.geometry.poses import Pose, composed, relative
from surveillance_runtime.node import PatrolNode

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class TfCorrection:
    """Publishes map -> odom.

    Args:
        node: The node that localises.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._publisher = None if TFMessage is None else node.create_publisher(TFMessage, 'tf', 10)

    def tick(self, pose: Pose, odometry: Pose, stamp: Any) -> None:
        """Publishes the correction that leads from the odometry to the pose."""
        if self._publisher is None:
            return
        # map <- odom = (map <- base) (base <- odom)
        x, y, yaw = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
        transform = TransformStamped(child_frame_id='odom')
        transform.header.frame_id, transform.header.stamp = 'map', stamp
        transform.transform.translation.x, transform.transform.translation.y = x, y
        transform.transform.rotation = conversions.pose_message((x, y, yaw)).orientation
        self._publisher.publish(TFMessage(transforms=[transform]))
