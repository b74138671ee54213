"""The parameters of the SIMULATED mode: the place's geometry, and the robot's size and habits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.grid_planning import PlanningParameters
from surveillance_controllers.path_following import DriveParameters
from surveillance_controllers.place_regions import Segment, door_segment
from surveillance_controllers.polyline import Points
from surveillance_controllers.poses import Pose
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError


def door_segments(node: PatrolNode) -> dict[str, Segment]:
    """Declares and reads the doors of the place, `doors.NAME: [x, y, yaw, width]`.

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
    """Declares and reads the places' points, `room_positions.NAME: [x, y]`.

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
    """Declares how `planner_controller` plans in SIMULATED mode."""
    default = PlanningParameters()

    def length(name: str, value: float, description: str) -> float:
        number: float = node.parameter(
            name, value, 'SIMULATED: ' + description, minimum=0.0, maximum=20.0, read_only=True
        )
        return number

    return PlanningParameters(
        radius=length('robot_radius', default.radius, 'Radius of the robot, m.'),
        margin=length('planning.margin', default.margin, 'Kept beyond the radius, m.'),
        comfort=length('planning.comfort', default.comfort, 'Room that a path prefers, m.'),
        aversion=length(
            'planning.aversion', default.aversion, 'How much dearer a path near obstacles is.'
        ),
    )


@dataclass(frozen=True)
class RobotSettings:
    """What `motion_controller` is told about the robot and its place in SIMULATED mode."""

    drive: DriveParameters
    station: Pose
    doors: dict[str, Segment]
    positions: dict[str, Points]
    feedback_period: float
    sensor_timeout: float
    peer_timeout: float
    track_place: bool
    spin: bool


def robot_settings(node: PatrolNode, motion: MotionSettings) -> RobotSettings:
    """Declares the parameters of `motion_controller` in SIMULATED mode.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    default = DriveParameters()

    def positive(name: str, value: float, description: str) -> float:
        number: float = node.parameter(
            name, value, 'SIMULATED: ' + description, minimum=0.01, maximum=20.0, read_only=True
        )
        return number

    drive = DriveParameters(
        radius=positive('robot_radius', default.radius, 'Radius of the robot, m.'),
        margin=positive('drive.margin', default.margin, 'Kept from what the lidar sees, m.'),
        speed=positive('drive.speed', default.speed, 'Top speed, m/s.'),
        turn=positive('drive.turn', default.turn, 'Top turning speed, rad/s.'),
        acceleration=positive('drive.acceleration', default.acceleration, 'Acceleration, m/s^2.'),
        turn_acceleration=positive(
            'drive.turn_acceleration', default.turn_acceleration, 'Turning acceleration, rad/s^2.'
        ),
        tolerance=positive(
            'drive.tolerance', default.tolerance, 'The end is reached within this distance, m.'
        ),
    )
    return RobotSettings(
        drive=drive,
        station=motion.station,
        doors=door_segments(node),
        positions=place_positions(node),
        feedback_period=motion.feedback_period,
        sensor_timeout=node.parameter(
            'sensor_timeout',
            5.0,
            'SIMULATED: how long map, odom and scan may be silent, s of real time.',
            minimum=0.1,
            maximum=3600.0,
            read_only=True,
        ),
        peer_timeout=motion.peer_timeout,
        track_place=node.parameter(
            'track_place',
            True,
            'SIMULATED: keep isIn in the ontology where the robot really is.',
            read_only=True,
        ),
        spin=node.parameter(
            'spin_on_arrival',
            True,
            'SIMULATED: motion/controller ends with one turn on the spot.',
            read_only=True,
        ),
    )
