"""The parameters of the SIMULATED mode: the place's geometry, and the robot's size and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.geometry import Mount, Points
from surveillance_controllers.motion.path_following import DriveParameters
from surveillance_controllers.motion.transforms import lidar_mount
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError, parameter
from surveillance_runtime.place.floor_plan import Door, Segment


def door_segments(node: PatrolNode) -> dict[str, Segment]:
    """Declare and read the doors of the place, `doors.NAME: [x, y, yaw, width]`.

    Raises:
        ParameterError: A door is not four numbers.
    """
    segments = {}
    for name, values in node.parameters_under('doors').items():
        if not _are_numbers(values, 4):
            raise ParameterError(
                f'parameter doors.{name}: got {values}, expected [x, y, yaw, width]'
            )
        segments[name] = Door(name, *values).segment
    return segments


def place_positions(node: PatrolNode) -> dict[str, Points]:
    """Declare and read the places' points, `room_positions.NAME: [x, y]`.

    Raises:
        ParameterError: A position is not two or three numbers.
    """
    positions = {}
    for name, values in node.parameters_under('room_positions').items():
        if not (_are_numbers(values, 2) or _are_numbers(values, 3)):
            raise ParameterError(f'parameter room_positions.{name}: got {values}, expected [x, y]')
        positions[name] = np.array([*values, 0.0][:3], dtype=float)
    return positions


def _are_numbers(values: object, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(v, int | float) and math.isfinite(v) for v in values)
    )


@dataclass(frozen=True)
class RobotSettings:
    """What `motion_controller` is told about the robot and its place in SIMULATED mode."""

    motion: MotionSettings
    drive: DriveParameters
    doors: dict[str, Segment]
    positions: dict[str, Points]
    lidar_mount: Mount | None
    sensor_timeout: float = parameter(
        5.0, 'how long map, odom and scan may be silent, s of real time.', 0.1, 3600.0
    )
    track_place: bool = parameter(
        True, 'robot_place follows the robot on its way, not at its end alone.'
    )
    spin: bool = parameter(
        True, 'motion/controller ends with one turn on the spot.', name='spin_on_arrival'
    )


def robot_settings(node: PatrolNode, motion: MotionSettings) -> RobotSettings:
    """Declare the parameters of `motion_controller` in SIMULATED mode.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    drive = node.declare_fields(DriveParameters(), prefix='drive.', mode='SIMULATED')
    doors, positions = door_segments(node), place_positions(node)
    settings = RobotSettings(motion, drive, doors, positions, lidar_mount(node))
    return node.declare_fields(settings, mode='SIMULATED')
