"""Moves a robot 30 cm forth and back and a quarter turn, and records what was heard of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

from lidar_navigation.geometry import Mount, Pose
from surveillance_runtime.conversions import pose_from
from surveillance_runtime.profile.check_up import named
from surveillance_runtime.profile.motion_check import REST, STEPS, MotionRecord, MotionStep
from surveillance_runtime.profile.record import RobotProfile
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.conversions import scan_from

PERIOD = 0.05
"""Time between two commands, seconds."""
NEAR = 0.55
"""A robot with something nearer than this before, behind or beside it is not moved, metres beyond
its edge."""


class MotionProbe:
    """Commands the steps and listens; the caller spins the node.

    Args:
        node: The node that commands.
        profile: The robot.
        namespace: That its names are in.
        mount: Where its first lidar is believed to sit.

    Attributes:
        record: What was heard.
    """

    def __init__(self, node: Node, profile: RobotProfile, namespace: str, mount: Mount) -> None:
        self._node, self._profile, self._mount = node, profile, mount
        self.record = MotionRecord()
        topics = profile.topics
        is_stamped = profile.types.command == 'TwistStamped'
        kind: Any = TwistStamped if is_stamped else Twist
        self._commands = node.create_publisher(kind, named(topics.command, namespace), 1)
        self._is_stamped = is_stamped
        for topic, message, take in (
            (topics.odom, Odometry, self._on_odometry),
            (topics.scans[0], LaserScan, self._on_scan),
        ):
            node.create_subscription(message, named(topic, namespace), take, SENSOR_QOS)

    def _on_odometry(self, message: Odometry) -> None:
        pose: Pose = pose_from(message.pose.pose)
        self.record.odometry.append((time.monotonic(), pose))

    def _on_scan(self, message: LaserScan) -> None:
        try:
            scan = scan_from(message, self._mount, self._profile.body.reach)
        except ValueError:
            return
        self.record.scans.append((time.monotonic(), scan))

    def has_room(self) -> bool:
        """Tell whether nothing stands near by the last scan; no scan is no room."""
        if not self.record.scans:
            return False
        _, scan = self.record.scans[-1]
        near = self._profile.body.reach + NEAR
        return not (scan.ranges < near).any()

    def carry_out(self, spin: Callable[[float], None]) -> MotionRecord:
        """Move; `spin` lets messages come for so many seconds.

        The robot is commanded to stand at the end, whatever happens.
        """
        try:
            spin(REST)
            for step in STEPS:
                self.record.began.append(time.monotonic())
                self._command_for(step, step.seconds, spin)
                self.record.ceased.append(time.monotonic())
                if step.silence:
                    spin(step.silence)
                self._command_for(MotionStep(0.0, 0.0, 0.0), REST, spin)
        finally:
            stand = partial(self._command, MotionStep(0.0, 0.0, 0.0))
            for _ in range(5):
                stand()
        return self.record

    def _command_for(self, step: MotionStep, seconds: float, spin: Callable[[float], None]) -> None:
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._command(step)
            spin(PERIOD)

    def _command(self, step: MotionStep) -> None:
        twist = Twist()
        twist.linear.x, twist.angular.z = step.speed, step.turn
        if not self._is_stamped:
            self._commands.publish(twist)
            return
        message = TwistStamped(twist=twist)
        message.header.frame_id = self._profile.frames.base
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._commands.publish(message)
