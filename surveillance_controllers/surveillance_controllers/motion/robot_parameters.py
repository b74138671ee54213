"""The parameters of the SIMULATED mode: the place's geometry, and the robot's size and limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.geometry import Points, Pose
from surveillance_controllers.motion.path_following import DriveParameters
from surveillance_controllers.motion.place_regions import Segment, door_segment
from surveillance_controllers.motion.transforms import lidar_mount
from surveillance_controllers.planning.grid_planning import PlanningParameters
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, ParameterError, declare_fields

_RADIUS = 'SIMULATED: Radius of the robot, m.'
_PLANNING = {
    'radius': Described(_RADIUS, 0.0, 20.0, name='robot_radius'),
    'margin': Described('SIMULATED: Kept beyond the radius, m.', 0.0, 20.0),
    'comfort': Described('SIMULATED: Room that a path prefers, m.', 0.0, 20.0),
    'aversion': Described('SIMULATED: How much more a path near obstacles costs.', 0.0, 20.0),
}
_DRIVE = {
    'radius': Described(_RADIUS, 0.01, 20.0, name='robot_radius'),
    'margin': Described('SIMULATED: Kept from what the lidar sees, m.', 0.01, 20.0),
    'speed': Described('SIMULATED: Top speed, m/s.', 0.01, 20.0),
    'turn': Described('SIMULATED: Top turning speed, rad/s.', 0.01, 20.0),
    'acceleration': Described('SIMULATED: Acceleration, m/s^2.', 0.01, 20.0),
    'deceleration': Described(
        'SIMULATED: With which the base brakes when it must, m/s^2.',
        *(0.05, 20.0),
        name='robot_deceleration',
    ),
    'turn_acceleration': Described('SIMULATED: Turning acceleration, rad/s^2.', 0.01, 20.0),
    'tolerance': Described('SIMULATED: The end is reached within this distance, m.', 0.01, 20.0),
}


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
        segments[name] = door_segment(*values)
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


def planning_parameters(node: PatrolNode) -> PlanningParameters:
    """Declare how `planner_controller` plans in SIMULATED mode."""
    return declare_fields(node, PlanningParameters(), _PLANNING, prefix='planning.')


@dataclass(frozen=True)
class RobotSettings:
    """What `motion_controller` is told about the robot and its place in SIMULATED mode."""

    motion: MotionSettings
    drive: DriveParameters
    doors: dict[str, Segment]
    positions: dict[str, Points]
    sensor_timeout: float
    track_place: bool
    spin: bool
    lidar_mount: Pose | None


def robot_settings(node: PatrolNode, motion: MotionSettings) -> RobotSettings:
    """Declare the parameters of `motion_controller` in SIMULATED mode.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    return RobotSettings(
        motion=motion,
        drive=declare_fields(node, DriveParameters(), _DRIVE, prefix='drive.'),
        doors=door_segments(node),
        positions=place_positions(node),
        sensor_timeout=node.parameter(
            'sensor_timeout',
            5.0,
            'SIMULATED: how long map, odom and scan may be silent, s of real time.',
            minimum=0.1,
            maximum=3600.0,
            read_only=True,
        ),
        track_place=node.parameter(
            'track_place',
            True,
            'SIMULATED: robot_place follows the robot on its way, not at its end alone.',
            read_only=True,
        ),
        spin=node.parameter(
            'spin_on_arrival',
            True,
            'SIMULATED: motion/controller ends with one turn on the spot.',
            read_only=True,
        ),
        lidar_mount=lidar_mount(node),
    )
