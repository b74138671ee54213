"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import (
    Point,
    PoseStamped,
    Twist,
)
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from sensor_msgs.msg import BatteryState

from floor_plans.occupancy_map import MOST_CELLS
from lidar_navigation import Velocity
from lidar_navigation.geometry import Points
from surveillance_controllers.battery import BatteryModel
from surveillance_runtime.conversions import map_from, point_message

if TYPE_CHECKING:
    from floor_plans import Grid


def array_from_points(points: Iterable[Point]) -> Points:
    """Return points as an array of shape (n, 3), metres."""
    return np.array([(p.x, p.y, p.z) for p in points], dtype=float).reshape(-1, 3)


def path_from_array(array: Points, stamp: Any, frame: str = 'map') -> PathMessage:
    """Return the rows of an array of shape (n, 2) or (n, 3), metres, as a path in the map frame."""
    message = PathMessage()
    message.header.frame_id, message.header.stamp = frame, stamp
    for row in array:
        pose = PoseStamped(header=message.header)
        pose.pose.position = point_message(row)
        message.poses.append(pose)
    return message


def battery_state(battery: BatteryModel, *, charging: bool) -> BatteryState:
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


def twist_from(velocity: Velocity) -> Twist:
    """Return a velocity of a differential drive as a message."""
    message = Twist()
    message.linear.x = float(velocity.speed)
    message.angular.z = float(velocity.turn)
    return message


def grid_from(message: OccupancyGrid) -> Grid:
    """Return a map; see `map_from`."""
    return map_from(message, MOST_CELLS)
