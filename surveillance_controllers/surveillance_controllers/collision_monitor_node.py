"""The node `collision_monitor`: lets no command through that the lidar does not allow.

It stands between whoever commands `cmd_vel` (`motion_controller`, a joystick, any other program)
and the base, which then listens to `cmd_vel_monitored`. A command is slowed down so that the robot
can brake before the nearest thing on its arc; without a fresh scan, or without a fresh command, the
robot stands. As a process of its own it also stops a robot whose controller hangs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Points
from surveillance_controllers.motion.base_interface import Transforms
from surveillance_controllers.motion.path_following import Velocity, room_ahead
from surveillance_controllers.motion.robot_parameters import lidar_mount
from surveillance_controllers.motion.sensor_age import STANDSTILL, WATCH_PERIOD, SensorAge
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.robot_base import ROBOT_DECELERATION

HORIZON = 3.0
"""How far ahead is looked, metres."""
LATENCY = 0.15
"""Time between seeing and braking, seconds: a period of the lidar and a half."""


@dataclass(frozen=True)
class MonitorSettings:
    """What the monitor allows.

    Attributes:
        radius: Of the robot, metres.
        margin: Kept free beside it, metres.
        deceleration: With which the base brakes when it must, m/s^2.
        longest_silence: The robot stands when a scan or a command is overdue by this, seconds.
    """

    radius: float = 0.25
    margin: float = 0.02
    deceleration: float = ROBOT_DECELERATION
    longest_silence: float = STANDSTILL


_SETTINGS = {
    'radius': Described('Radius of the robot, m.', 0.01, 20.0, name='robot_radius'),
    'margin': Described('Kept free beside the robot, m.', 0.0, 20.0),
    'deceleration': Described(
        'With which the base brakes when it must, m/s^2.', *(0.05, 20.0), name='robot_deceleration'
    ),
    'longest_silence': Described(
        'The robot stands when scan or cmd_vel is overdue by this, and brakes before, '
        's of ROS time.',
        0.05,
        10.0,
    ),
}


def allowed(wanted: Velocity, seen: Points, settings: MonitorSettings) -> Velocity:
    """Return the velocity nearest to a wanted one, on the same arc, from which the robot can still
    brake.

    Args:
        wanted: What is commanded.
        seen: What the lidar saw, robot's frame, shape (n, 2), metres.
        settings: The robot.
    """
    if wanted.speed == 0.0:
        return wanted  # A round robot that turns on the spot touches nothing.
    ahead = seen if wanted.speed > 0.0 else -seen
    curvature = wanted.turn / wanted.speed
    if wanted.speed < 0.0:
        # Seen from behind the robot drives forwards, and turns to the same side.
        curvature = -curvature
    reach = settings.radius + settings.margin
    room = room_ahead(ahead, curvature, reach, HORIZON)
    if room >= HORIZON:
        return wanted
    # Braking begins after the latency.
    late = settings.deceleration * LATENCY
    speed = math.sqrt(late**2 + 2.0 * settings.deceleration * room) - late
    share = min(1.0, speed / abs(wanted.speed))
    return Velocity(wanted.speed * share, wanted.turn * share)


class CollisionMonitor(PatrolNode):
    """Passes commands on to the base as far as they are safe."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('collision_monitor', **node_options)
        self._settings = declare_fields(self, MonitorSettings(), _SETTINGS)
        self._mount = lidar_mount(self)
        self._frames = Transforms(self)
        self._wanted = Velocity()
        self._seen: Points | None = None
        settings = self._settings
        self._age = SensorAge(('scan', 'cmd_vel'), settings.deceleration, settings.longest_silence)
        self._stands_for = ''
        self._base = self.create_publisher(Twist, 'cmd_vel_monitored', 1)
        self.create_subscription(Twist, 'cmd_vel', self._on_command, 1)
        self.create_subscription(LaserScan, 'scan', self._on_scan, SENSOR_QOS)
        self.create_timer(WATCH_PERIOD, self._on_time)

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) / 1e9

    def _on_command(self, message: Twist) -> None:
        speed, turn = message.linear.x, message.angular.z
        if not (math.isfinite(speed) and math.isfinite(turn)):
            self.get_logger().error(f'cmd_vel: {speed} m/s, {turn} rad/s: expected finite numbers')
            speed = turn = 0.0
        self._wanted = Velocity(speed, turn)
        self._age.hear('cmd_vel', self._now())
        self._pass_on()

    def _on_scan(self, message: LaserScan) -> None:
        try:
            mount = self._mount or self._frames.mount_of(message.header.frame_id)
            self._seen = conversions.scan_from(message, mount).points
        except ValueError as error:
            self.get_logger().error(f'scan: {error}')
            return
        self._age.hear('scan', self._now())
        if self._wanted.speed != 0.0:
            self._pass_on()

    def _on_time(self) -> None:
        if self._wanted != Velocity() and self._age.share(self._wanted.speed, self._now()) < 1.0:
            self._pass_on()

    def _pass_on(self) -> None:
        now = self._now()
        if self._seen is None or self._age.share(self._wanted.speed, now) == 0.0:
            topic = self._age.left(now)[1]
            velocity, why = Velocity(), f'nothing on the topic {topic}'
            if topic == 'cmd_vel':
                self._wanted, why = Velocity(), ''
        else:
            velocity = allowed(self._wanted, self._seen, self._settings)
            near = abs(velocity.speed) < 0.5 * abs(self._wanted.speed)
            why = 'something is in the way' if near else ''
            share = self._age.share(velocity.speed, now)
            velocity = Velocity(share * velocity.speed, share * velocity.turn)
        if why != self._stands_for:
            self._stands_for = why
            if why:
                self.get_logger().warn(f'{why}: the robot is held back')
        self._base.publish(conversions.twist_from(velocity))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(CollisionMonitor, args)
