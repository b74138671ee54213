"""The transform from odom to the robot on `tf`, where tf2's messages are installed.

The wheels on PyPI hold no tf2_msgs; an installed ROS 2 does. Without them nothing is published.
"""

from __future__ import annotations

from typing import Any

from builtin_interfaces.msg import Time

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place.floor_plan import Pose
from surveillance_simulation import conversions

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


class TfFeed:
    """Publishes where the odometry says the robot is."""

    def __init__(self, node: PatrolNode, message_type: Any = TFMessage) -> None:
        """Create the publisher, if there is a message type for it."""
        self._type = message_type
        self._publisher = (
            None if message_type is None else node.create_publisher(message_type, 'tf', 10)
        )

    def tick(self, odometry: Pose, stamp: Time) -> None:
        """Publish odom -> base_link."""
        if self._publisher is not None:
            transform = conversions.transform_to_ros(odometry, 'odom', 'base_link', stamp)
            self._publisher.publish(self._type(transforms=[transform]))
