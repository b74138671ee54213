"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Transform,
    Twist,
)
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node
from sensor_msgs.msg import BatteryState, LaserScan

from surveillance_controllers.battery.model import Battery
from surveillance_controllers.geometry import Points, Pose, Scan
from surveillance_runtime.conversions import map_from, point_message, pose_from

if TYPE_CHECKING:
    from surveillance_controllers.motion.path_following import Velocity
    from surveillance_controllers.planning.grid_map import GridMap


@contextmanager
def refusing(node: Node, topic: str) -> Iterator[None]:
    """Let a message that is not sound cost one line in the node's log, and nothing else."""
    try:
        yield
    except ValueError as error:
        node.get_logger().error(f'{topic}: {error}')


def array_from_points(points: Iterable[Point]) -> Points:
    """Return points as an array of shape (n, 3), metres."""
    return np.array([(p.x, p.y, p.z) for p in points], dtype=float).reshape(-1, 3)


def points_from_array(array: Points) -> list[Point]:
    """Return the rows of an array of shape (n, 2) or (n, 3) as points."""
    return [point_message(row) for row in array]


def path_from_array(array: Points, stamp: Any) -> PathMessage:
    """Return the rows of an array of shape (n, 2) or (n, 3), metres, as a path in the map frame."""
    message = PathMessage()
    message.header.frame_id, message.header.stamp = 'map', stamp
    for row in array:
        pose = PoseStamped(header=message.header)
        pose.pose.position = point_message(row)
        message.poses.append(pose)
    return message


def battery_state(battery: Battery, *, charging: bool) -> BatteryState:
    """Return a battery's charge as the message that ROS has for it; the caller stamps it."""
    p = battery.parameters
    message = BatteryState()
    message.voltage = float(battery.voltage)
    message.percentage = float(battery.state_of_charge)
    nominal = (p.empty_voltage + p.full_voltage) / 2
    message.charge = float(battery.energy / nominal)
    message.capacity = message.design_capacity = float(p.capacity / nominal)
    message.temperature = float('nan')
    message.current = float('nan')
    if charging and battery.level < 100.0:
        status = BatteryState.POWER_SUPPLY_STATUS_CHARGING
        message.current = float(battery.charging_power() / battery.voltage)
    elif charging:
        status = BatteryState.POWER_SUPPLY_STATUS_FULL
    else:
        status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    message.power_supply_status = status
    message.power_supply_technology = BatteryState.POWER_SUPPLY_TECHNOLOGY_LION
    message.present = True
    return message


MOST_CELLS = 100_000_000
"""Cells of the largest map that is taken."""
MOST_RAYS = 100_000
"""Rays of the largest scan that is taken."""
LONGEST_RANGE = 1000.0
"""No ray of a lidar goes farther, metres."""


def twist_from(velocity: Velocity) -> Twist:
    """Return a velocity of a differential drive as a message."""
    message = Twist()
    message.linear.x = float(velocity.speed)
    message.angular.z = float(velocity.turn)
    return message


def grid_from(message: OccupancyGrid) -> GridMap:
    """Return a map; see `map_from`."""
    # Only here: a node without a map starts without OpenCV.
    from surveillance_controllers.planning.grid_map import GridMap

    return GridMap(*map_from(message, MOST_CELLS))


def scan_from(message: LaserScan, mount: Pose = (0.0, 0.0, 0.0)) -> Scan:
    """Return a turn of a lidar; rays that are out of its range or not a number met nothing.

    Args:
        message: The scan; of a lidar that turns clockwise, its rays come back the other way round.
        mount: Where the lidar sits on the robot, robot's frame.

    Raises:
        ValueError: Angles or reach are no lidar's, there are too many rays, or it was made before
            time began.
    """
    count = len(message.ranges)
    first, step, reach = message.angle_min, message.angle_increment, message.range_max
    if message.header.stamp.sec < 0:
        raise ValueError(f'a scan made at {message.header.stamp.sec} s: expected 0 s or later')
    if not 1 <= count <= MOST_RAYS:
        raise ValueError(f'a scan of {count} rays: expected 1 to {MOST_RAYS}')
    if not (math.isfinite(first) and math.isfinite(step) and abs(step) * count < 20.0):
        raise ValueError(
            f'a scan of {count} rays from {first:g} rad, {step:g} rad apart: expected one turn'
        )
    if abs(first) > 20.0 or (count > 1 and step == 0.0) or not reach > 0.0:
        raise ValueError(
            f'a scan from {first:g} rad, {step:g} rad apart, of {reach:g} m: expected one turn of '
            'a lidar that reaches farther than 0 m'
        )
    reach = min(float(reach), LONGEST_RANGE)
    ranges = np.frombuffer(message.ranges, dtype=np.float32).astype(float)
    angles = first + step * np.arange(count)
    # The lidar gives what is nearer than it can measure as its least range, or below it.
    good = (ranges > 0) & (ranges < reach)
    ranges = np.where(good, ranges, np.inf)
    return Scan(*((angles, ranges) if step >= 0 else (angles[::-1], ranges[::-1])), reach, mount)


def planar_from(transform: Transform) -> Pose:
    """Return a transform as a pose in the plane.

    Raises:
        ValueError: It is not finite, or leaves the plane by more than 0.1 rad.
    """
    message = PoseMessage(orientation=transform.rotation)
    moved = transform.translation
    message.position = Point(x=moved.x, y=moved.y, z=moved.z)
    q = transform.rotation
    # The z axis of the turned frame, as seen from the other one.
    upright = 1 - 2 * (q.x * q.x + q.y * q.y)
    pose = pose_from(message)
    if upright < math.cos(0.1):
        raise ValueError('a mount that is tilted: expected one in the plane of the floor')
    return pose
