"""Where the robot's frames are to each other: the lidar on the robot, the odometry on the map."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Pose, composed, relative
from surveillance_runtime import parameter_checks
from surveillance_runtime.conversions import pose_message
from surveillance_runtime.node import PatrolNode

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

BASE_FRAMES = ('base_link', 'base_footprint', '')
"""Frames at the robot's centre."""


def lidar_mount(node: PatrolNode) -> Pose | None:
    """Declare where the lidar sits on the robot; None: `tf_static` says it.

    Raises:
        ParameterError: A value is of the wrong type.
    """
    given: list[float] = node.parameter(
        'lidar_mount',
        [],
        'Where the lidar sits on the robot: x, y in metres, yaw in radians; empty: as '
        "tf_static says of the scan's frame.",
        of=float,
        check=parameter_checks.pose_or_nothing,
        read_only=True,
    )
    return (given[0], given[1], given[2]) if given else None


class Transforms:
    """What the robot's frames are to each other, where tf2_msgs is installed.

    Publishes map -> odom on `tf`, and reads from `tf_static` where the lidar sits.

    Args:
        node: The node that localises.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._parents: dict[str, tuple[str, Pose]] = {}
        self._unknown: set[str] = set()
        self._publisher = None
        if TFMessage is not None:
            self._publisher = node.create_publisher(TFMessage, 'tf', 10)
            latched = QoSProfile(
                depth=100,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            )
            node.create_subscription(TFMessage, 'tf_static', self._on_static, latched)

    def tick(self, pose: Pose, odometry: Pose, stamp: Any) -> None:
        """Publish the correction that leads from the odometry to the pose."""
        if self._publisher is None:
            return
        # map <- odom = (map <- base) (base <- odom)
        x, y, yaw = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
        transform = TransformStamped(child_frame_id='odom')
        transform.header.frame_id, transform.header.stamp = 'map', stamp
        transform.transform.translation.x, transform.transform.translation.y = x, y
        transform.transform.rotation = pose_message((x, y, yaw)).orientation
        self._publisher.publish(TFMessage(transforms=[transform]))

    def mount_of(self, frame: str) -> Pose:
        """Return where a sensor's frame is on the robot; at its centre while nobody says."""
        pose: Pose = (0.0, 0.0, 0.0)
        at, passed = frame, 0
        while at.rpartition('/')[2] not in BASE_FRAMES:
            if at not in self._parents or passed > len(self._parents):
                if frame not in self._unknown:
                    self._unknown.add(frame)
                    self._node.get_logger().warn(
                        f'scan: where its frame {frame!r} is on the robot is not known: expected '
                        f'it on tf_static below {BASE_FRAMES[0]}, or the parameter lidar_mount; '
                        "it is taken for the robot's centre"
                    )
                return (0.0, 0.0, 0.0)
            at, step = self._parents[at]
            pose = composed(step, pose)
            passed += 1
        return pose

    def _on_static(self, message: Any) -> None:
        for each in message.transforms:
            try:
                pose = conversions.planar_from(each.transform)
            except ValueError as error:
                # Cameras and arms are tilted; only the lidar must not be.
                self._node.get_logger().debug(f'tf_static: {each.child_frame_id}: {error}')
                continue
            self._parents[each.child_frame_id] = each.header.frame_id, pose
