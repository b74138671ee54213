"""The simulator's parameters, declared with their descriptions and checked in one place."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from surveillance_runtime.node import PatrolNode
from surveillance_simulation.base import BaseModel
from surveillance_simulation.camera import Camera, Conditions
from surveillance_simulation.lidar import LidarModel
from surveillance_simulation.pace import PaceModel

_CONDITIONS = {
    'light': "Brightness of the camera's pictures: 1 a lit room, 0.1 a dark one.",
    'noise': "Standard deviation of the camera's noise, grey levels.",
    'blur': "Standard deviation of the lens's blur, pixels.",
    'motion': 'Length of the streak that motion draws in a picture, pixels.',
    'motion_angle': 'Direction of that streak, rad.',
}
_PLACE_TABLES = ('map', 'room_positions', 'walls', 'doors', 'markers')


def place(node: PatrolNode) -> dict[str, Any]:
    """Declare the description of the place and return it as its file holds it."""
    described: dict[str, Any] = {}
    for table in _PLACE_TABLES:
        entries = node.parameters_under(table)
        if entries:
            described[table] = entries
    described['robot_room'] = node.parameter('robot_room', '', 'Place where the robot starts.')
    described['recharge_rooms'] = node.parameter(
        'recharge_rooms', [], 'Places with a charging station.', of=str
    )
    described['station'] = node.parameter(
        'station', [], 'Pose of the charging station: x, y in metres, yaw in rad.', of=float
    )
    described['marker_size'] = node.parameter(
        'marker_size', 0.2, "Side of a marker's black square, metres."
    )
    described['marker_dictionary'] = node.parameter(
        'marker_dictionary', 'DICT_5X5_100', "OpenCV's name of the markers' dictionary."
    )
    return described


def pace(node: PatrolNode) -> PaceModel:
    """Declare how simulated time goes."""
    default = PaceModel()
    return PaceModel(
        speed=node.parameter(
            'speed',
            default.speed,
            'Simulated seconds per real second; 0: as fast as the nodes keep up.',
            minimum=0.0,
            maximum=1000.0,
            read_only=True,
        ),
        ceiling=node.parameter(
            'top_speed',
            default.ceiling,
            'Simulated seconds per real second at most when speed is 0.',
            minimum=1.0,
            maximum=10000.0,
            read_only=True,
        ),
        step=node.parameter(
            'step',
            default.step,
            'Simulated seconds between two messages on clock, odom and scan.',
            minimum=0.005,
            maximum=0.5,
            read_only=True,
        ),
        idle_step=node.parameter(
            'idle_step',
            default.idle_step,
            'The same while nothing moves and speed is 0.',
            minimum=0.005,
            maximum=5.0,
            read_only=True,
        ),
    )


def map_resolution(node: PatrolNode) -> float:
    """Declare the size of the map's cells."""
    resolution: float = node.parameter(
        'map_resolution',
        0.05,
        'Side of a cell of the map, metres.',
        minimum=0.01,
        maximum=0.5,
        read_only=True,
    )
    return resolution


def announces_pose(node: PatrolNode) -> bool:
    """Declare whether the start is told to a localisation that asks for it."""
    announces: bool = node.parameter(
        'announce_pose',
        False,
        'Tell each new subscriber of initialpose, such as AMCL, where the robot is.',
        read_only=True,
    )
    return announces


def base(node: PatrolNode) -> BaseModel:
    """Declare body, limits and errors of the base."""
    default = BaseModel()

    def positive(name: str, value: float, description: str) -> float:
        number: float = node.parameter(
            name, value, description, minimum=0.01, maximum=20.0, read_only=True
        )
        return number

    def share(name: str, value: float, description: str) -> float:
        number: float = node.parameter(
            name, value, description, minimum=0.0, maximum=1.0, read_only=True
        )
        return number

    return BaseModel(
        radius=positive('robot_radius', default.radius, 'Radius of the robot, metres.'),
        speed=positive('base.speed', default.speed, 'Greatest speed, m/s.'),
        turn_speed=positive('base.turn_speed', default.turn_speed, 'Greatest turn speed, rad/s.'),
        acceleration=positive(
            'base.acceleration', default.acceleration, 'Greatest acceleration, m/s^2.'
        ),
        turn_acceleration=positive(
            'base.turn_acceleration',
            default.turn_acceleration,
            'Greatest turning acceleration, rad/s^2.',
        ),
        command_timeout=positive(
            'base.command_timeout',
            default.command_timeout,
            'Seconds without a command after which the base stops.',
        ),
        distance_error=share(
            'base.distance_error',
            default.distance_error,
            "Standard deviation of the odometry's distance after one metre, metres.",
        ),
        turn_error=share(
            'base.turn_error',
            default.turn_error,
            "Standard deviation of the odometry's heading after one radian, rad.",
        ),
    )


def lidar(node: PatrolNode) -> LidarModel:
    """Declare what the lidar can do."""
    default = LidarModel()
    return LidarModel(
        rays=node.parameter(
            'lidar.rays', default.rays, 'Rays of a full turn.', minimum=4, maximum=7200
        ),
        range_min=default.range_min,
        range_max=node.parameter(
            'lidar.range_max',
            default.range_max,
            'Greatest distance measured, metres.',
            minimum=0.5,
            maximum=200.0,
            read_only=True,
        ),
        noise=node.parameter(
            'lidar.noise',
            default.noise,
            'Standard deviation of a distance, metres.',
            minimum=0.0,
            maximum=1.0,
            read_only=True,
        ),
    )


def camera(node: PatrolNode) -> Camera:
    """Declare the camera's lens and picture."""
    return Camera.from_field_of_view(
        node.parameter(
            'camera.width', 640, 'Columns of a picture.', minimum=16, maximum=4096, read_only=True
        ),
        node.parameter(
            'camera.height', 480, 'Rows of a picture.', minimum=16, maximum=4096, read_only=True
        ),
        math.radians(
            node.parameter(
                'camera.field_of_view',
                60.0,
                'Horizontal field of view, degrees.',
                minimum=5.0,
                maximum=150.0,
                read_only=True,
            )
        ),
    )


def renderer(node: PatrolNode) -> str:
    """Declare what draws the camera's pictures."""
    kind: str = node.parameter(
        'camera.renderer',
        'opencv',
        'What draws the pictures; mujoco adds shadows and needs the package mujoco.',
        choices=('opencv', 'mujoco'),
        read_only=True,
    )
    return kind


def camera_rate(node: PatrolNode) -> float:
    """Declare how often a picture is taken."""
    rate: float = node.parameter(
        'camera.rate',
        10.0,
        'Pictures per second at most.',
        minimum=0.1,
        maximum=100.0,
        read_only=True,
    )
    return rate


def conditions(node: PatrolNode, on_change: Callable[[Conditions], None]) -> Conditions:
    """Declare light, noise and blur, which may be changed while the node runs."""
    values = asdict(Conditions())

    def changed(name: str) -> Callable[[float], None]:
        def change(value: float) -> None:
            values[name] = value
            on_change(Conditions(**values))

        return change

    for name, description in _CONDITIONS.items():
        values[name] = node.parameter(
            f'camera.{name}',
            values[name],
            description,
            minimum=-math.pi if name == 'motion_angle' else 0.0,
            maximum=math.pi if name == 'motion_angle' else 100.0,
            on_change=changed(name),
        )
    return Conditions(**values)
