"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from sensor_msgs.msg import BatteryState

from surveillance_controllers.battery_model import Battery
from surveillance_controllers.battery_use import Pose
from surveillance_controllers.polyline import Points


def array_from_points(points: Iterable[Point]) -> Points:
    """Points as an array of shape (n, 3), metres."""
    return np.array([(p.x, p.y, p.z) for p in points], dtype=float).reshape(-1, 3)


def point_from(coordinates: Sequence[float] | Points) -> Point:
    """A point from x, y and perhaps z, metres."""
    x, y, z = (*(float(c) for c in coordinates), 0.0)[:3]
    return Point(x=x, y=y, z=z)


def points_from_array(array: Points) -> list[Point]:
    """The rows of an array of shape (n, 2) or (n, 3) as points."""
    return [point_from(row) for row in array]


def battery_state(battery: Battery, *, charging: bool) -> BatteryState:
    """A battery's charge as the message that ROS has for it; the caller stamps it."""
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


def pose_from(message: PoseMessage) -> Pose:
    """A pose in the plane: x, y in metres and yaw in radians."""
    q = message.orientation
    # Yaw of a quaternion in Z-Y-X order; exact for any tilt that is not straight up.
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    return message.position.x, message.position.y, yaw


def pose_message(pose: Pose) -> PoseMessage:
    """A pose in the plane as a message."""
    message = PoseMessage()
    message.position = point_from(pose[:2])
    message.orientation = Quaternion(z=math.sin(pose[2] / 2), w=math.cos(pose[2] / 2))
    return message
