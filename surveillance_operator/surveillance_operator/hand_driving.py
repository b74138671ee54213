"""A person drives the robot by hand, and tells it where it is.

The stick is a dead man's switch: a command holds for `HELD` seconds, so that a browser that goes
away stops the robot, as does a page that ends: the collision monitor, through which the commands
go, hears them no more. The mission is paused first, and goes on when a person says so.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from rclpy.clock import Clock, ClockType

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for

TOPIC = 'cmd_vel_manual'
"""Commands by hand, which the collision monitor takes before all others."""
HELD = 0.3
"""A command holds so long, seconds of real time: three that a browser sends."""
PERIOD = 0.1
TOP_SPEED, TOP_TURN = 0.6, 1.0
"""Bounds of a command by hand, m/s and rad/s; the base's own are the monitor's."""
NEW_AFTER = 2.0
"""After this time without a command the next one begins a new drive, seconds."""
SPREAD, TURN_SPREAD = 0.5, 0.26
"""How far a pose that a person points at may be off, metres and radians: as in RViz."""


class HandDriving:
    """Drives a robot by hand.

    Args:
        node: The node that publishes; an executor must spin it.
        pause: Pauses the mission; raises `CallError`.
        robot: The robot of a fleet; empty: that of the node's namespace.
    """

    def __init__(self, node: PatrolNode, pause: Callable[[], object], robot: str = '') -> None:
        self._node, self._pause = node, pause
        self._commands = node.create_publisher(Twist, name_for(robot, TOPIC), 1)
        self._poses = node.create_publisher(
            PoseWithCovarianceStamped, name_for(robot, 'initialpose'), 1
        )
        self._lock = threading.Lock()
        self._wanted = 0.0, 0.0
        self._last = -math.inf
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._repeat, clock=steady, autostart=False)

    def drive(self, speed: float, turn: float) -> str:
        """Drive for the next moment, m/s and rad/s; both 0: stand.

        Raises:
            ValueError: A number is none, or beyond its bound.
            CallError: The mission cannot be paused.
        """
        given = _bounded('speed', speed, TOP_SPEED), _bounded('turn', turn, TOP_TURN)
        now = time.monotonic()
        if now - self._last > NEW_AFTER and given != (0.0, 0.0):
            self._pause()
        with self._lock:
            self._wanted, self._last = given, time.monotonic()
        self._publish(given)
        self._timer.reset()
        return 'you drive: the mission is paused' if any(given) else 'it stands'

    def set_pose(self, x: float, y: float, yaw: float) -> str:
        """Tell the robot where it is, metres and radians on the map.

        Raises:
            ValueError: A number is none.
        """
        x, y = _bounded('x', x, 1e5), _bounded('y', y, 1e5)
        yaw = _bounded('yaw', yaw, 2 * math.pi)
        message = PoseWithCovarianceStamped()
        message.header.frame_id = 'map'
        message.header.stamp = self._node.get_clock().now().to_msg()
        pose = message.pose.pose
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = SPREAD**2
        covariance[35] = TURN_SPREAD**2
        message.pose.covariance = covariance
        if not self._poses.get_subscription_count():
            raise ValueError('nobody listens to initialpose: this robot finds out where it is')
        self._poses.publish(message)
        return f'it is told that it is at {x:.1f}, {y:.1f}, looking to {math.degrees(yaw):.0f}°'

    def _repeat(self) -> None:
        """Go on with the last command, or end it when nobody has held it."""
        with self._lock:
            if time.monotonic() - self._last > HELD:
                wanted, self._wanted = (0.0, 0.0), (0.0, 0.0)
            else:
                wanted = self._wanted
        self._publish(wanted)
        if wanted == (0.0, 0.0):
            self._timer.cancel()

    def _publish(self, wanted: tuple[float, float]) -> None:
        message = Twist()
        message.linear.x, message.angular.z = wanted
        self._commands.publish(message)


def _bounded(name: str, value: float, most: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not abs(number) <= most:
        raise ValueError(
            f'{name} {str(value)[:40]!r}: expected a number from -{most:g} to {most:g}'
        )
    return number
