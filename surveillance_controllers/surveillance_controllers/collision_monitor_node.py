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
from surveillance_controllers.motion.base_interface import Transforms, share_of_speed
from surveillance_controllers.motion.path_following import Velocity, room_ahead
from surveillance_controllers.motion.robot_parameters import lidar_mount
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS

HORIZON = 3.0
"""How far ahead is looked, metres."""
PERIOD = 0.05
"""Time between two looks at the age of what was heard, seconds."""


@dataclass(frozen=True)
class MonitorSettings:
    """What the monitor allows.

    Attributes:
        radius: Of the robot, metres.
        margin: Kept free beside it, metres.
        deceleration: With which the base brakes, m/s^2.
        longest_silence: Age of a scan or a command from which on the robot stands, seconds.
    """

    radius: float = 0.25
    margin: float = 0.02
    deceleration: float = 0.8
    longest_silence: float = 0.25


_SETTINGS = {
    'radius': Described('Radius of the robot, m.', 0.01, 20.0, name='robot_radius'),
    'margin': Described('Kept free beside the robot, m.', 0.0, 20.0),
    'deceleration': Described('With which the base brakes, m/s^2.', 0.01, 20.0),
    'longest_silence': Described(
        'The robot stands when scan or cmd_vel is older, and is slower before, s of ROS time.',
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
    speed = math.sqrt(2.0 * settings.deceleration * room) if room < HORIZON else math.inf
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
        self._heard = {'scan': -math.inf, 'cmd_vel': -math.inf}
        self._stands_for = ''
        self._base = self.create_publisher(Twist, 'cmd_vel_monitored', 1)
        self.create_subscription(Twist, 'cmd_vel', self._on_command, 1)
        self.create_subscription(LaserScan, 'scan', self._on_scan, SENSOR_QOS)
        self.create_timer(PERIOD, self._on_time)

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds) / 1e9

    def _on_command(self, message: Twist) -> None:
        speed, turn = message.linear.x, message.angular.z
        if not (math.isfinite(speed) and math.isfinite(turn)):
            self.get_logger().error(f'cmd_vel: {speed} m/s, {turn} rad/s: expected finite numbers')
            speed = turn = 0.0
        self._wanted = Velocity(speed, turn)
        self._heard['cmd_vel'] = self._now()
        self._pass_on()

    def _on_scan(self, message: LaserScan) -> None:
        try:
            mount = self._mount or self._frames.mount_of(message.header.frame_id)
            self._seen = conversions.scan_from(message, mount).points
        except ValueError as error:
            self.get_logger().error(f'scan: {error}')
            return
        self._heard['scan'] = self._now()
        if self._wanted.speed != 0.0:
            self._pass_on()

    def _on_time(self) -> None:
        if self._wanted != Velocity() and self._share()[0] < 1.0:
            self._pass_on()

    def _share(self) -> tuple[float, str]:
        """Return the part of the speed that the age of what was heard leaves, and the topic."""
        now = self._now()
        age, topic = max((now - at, topic) for topic, at in self._heard.items())
        return share_of_speed(age, self._settings.longest_silence), topic

    def _pass_on(self) -> None:
        share, topic = self._share()
        if share == 0.0 or self._seen is None:
            velocity, why = Velocity(), f'nothing on the topic {topic}'
        else:
            velocity = allowed(self._wanted, self._seen, self._settings)
            near = abs(velocity.speed) < 0.5 * abs(self._wanted.speed)
            why = 'something is in the way' if near else ''
            velocity = Velocity(share * velocity.speed, share * velocity.turn)
        if share == 0.0 and topic == 'cmd_vel':
            self._wanted, why = Velocity(), ''
        if why != self._stands_for:
            self._stands_for = why
            if why:
                self.get_logger().warn(f'{why}: the robot is held back')
        self._base.publish(conversions.twist_from(velocity))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(CollisionMonitor, args)
