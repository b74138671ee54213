"""Where the robot's frames are to each other: the lidar on the robot, the odometry on the map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Mount, Pose, Scan, composed, relative
from surveillance_runtime import parameter_checks
from surveillance_runtime.conversions import pose_message
from surveillance_runtime.node import PatrolNode

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

BASE_FRAMES = ('base_link', 'base_footprint', '')
"""Frames at the robot's centre."""


class ScanReader:
    """Reads scans as seen from the robot, by where its lidar sits.

    That is given by the parameter `lidar_mount`, or else by `tf_static`, where tf2_msgs is
    installed.

    Args:
        node: The node that reads.
        radius: Of the robot, metres.

    Raises:
        ParameterError: `lidar_mount` is of the wrong type.
    """

    def __init__(self, node: PatrolNode, radius: float) -> None:
        self._node = node
        self._radius = radius
        self._given = _given_mount(node)
        self._parents: dict[str, tuple[str, NDArray[np.float64]]] = {}
        self._mounts: dict[str, Mount] = {}
        self._told: set[str] = set()
        if TFMessage is not None:
            latched = QoSProfile(
                depth=100,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL,
            )
            node.create_subscription(TFMessage, 'tf_static', self._on_static, latched)

    def read(self, message: LaserScan) -> Scan:
        """Return a scan.

        Raises:
            ValueError: It is not sound; see `conversions.scan_from`.
        """
        return conversions.scan_from(message, self.mount_of(message.header.frame_id), self._radius)

    def mount_of(self, frame: str) -> Mount:
        """Return where the lidar of a frame is on the robot; at its centre while nobody says."""
        if self._given is not None:
            return self._given
        if frame not in self._mounts:
            self._mounts[frame] = self._looked_up(frame)
        return self._mounts[frame]

    def _looked_up(self, frame: str) -> Mount:
        matrix = np.eye(4)
        at, passed = _plain(frame), 0
        while at.rpartition('/')[2] not in BASE_FRAMES:
            if at not in self._parents or passed > len(self._parents):
                self._tell_once(
                    f'scan: where its frame {frame!r} is on the robot is not known: expected '
                    f'it on tf_static below {BASE_FRAMES[0]}, or the parameter lidar_mount; '
                    "it is taken for the robot's centre"
                )
                return Mount()
            at, step = self._parents[at]
            matrix = step @ matrix
            passed += 1
        tilt = math.acos(min(abs(float(matrix[2, 2])), 1.0))
        if tilt > parameter_checks.MOST_TILT:
            self._tell_once(
                f'scan: its frame {frame!r} is tilted by {math.degrees(tilt):.0f} degrees: '
                'expected a lidar in the plane of the floor; it is taken for one'
            )
        x, y, yaw = matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])
        return Mount((float(x), float(y), yaw), bool(matrix[2, 2] < 0.0))

    def _tell_once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._node.get_logger().warn(text)

    def _on_static(self, message: Any) -> None:
        for each in message.transforms:
            with conversions.refusing(self._node, f'tf_static: {each.child_frame_id}'):
                matrix = conversions.matrix_from(each.transform)
                self._parents[_plain(each.child_frame_id)] = _plain(each.header.frame_id), matrix
        self._mounts.clear()


def _given_mount(node: PatrolNode) -> Mount | None:
    """Declare where the lidar sits on the robot; None: `tf_static` says it."""
    given: list[float] = node.parameter(
        'lidar_mount',
        [],
        'Where the lidar sits on the robot: x, y in metres, yaw in radians, and roll: 0, or 3.1416 '
        "for one that hangs upside down; empty: as tf_static says of the scan's frame.",
        of=float,
        check=parameter_checks.lidar_mount,
        read_only=True,
    )
    if not given:
        return None
    x, y, yaw, *roll = given
    return Mount((x, y, yaw), bool(roll) and math.cos(roll[0]) < 0.0)


class MapFrame:
    """Publishes map -> odom on `tf`, where tf2_msgs is installed.

    Args:
        node: The node that localises.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._publisher = None if TFMessage is None else node.create_publisher(TFMessage, 'tf', 10)

    def publish(self, pose: Pose, odometry: Pose, stamp: Any) -> None:
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


def _plain(frame: str) -> str:
    """Return a frame's name without the slash that older drivers begin it with, as tf2 does."""
    return frame.removeprefix('/')
