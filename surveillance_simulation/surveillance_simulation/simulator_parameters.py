"""The simulator's parameters, declared with their descriptions and checked in one place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import parameter
from surveillance_simulation.camera.model import Conditions
from surveillance_simulation.clock_rate import ClockRateModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.world.people import PeopleModel


@dataclass(frozen=True)
class PublishedOptions:
    """How the place is published; units as declared."""

    map_resolution: float = parameter(0.05, 'Side of a cell of the map, metres.', 0.01, 0.5)
    announce_pose: bool = parameter(
        False, 'Tell each new subscriber of initialpose, such as AMCL, where the robot is.'
    )


@dataclass(frozen=True)
class CameraOptions:
    """The camera that does not change; units as declared."""

    width: int = parameter(640, 'Columns of a picture.', 16, 4096)
    height: int = parameter(480, 'Rows of a picture.', 16, 4096)
    field_of_view: float = parameter(60.0, 'Horizontal field of view, degrees.', 5.0, 150.0)
    renderer: str = parameter(
        'opencv',
        'What draws the pictures; mujoco adds shadows and needs the package mujoco.',
        choices=('opencv', 'mujoco'),
    )
    rate: float = parameter(10.0, 'Pictures per second at most.', 0.1, 100.0)
    wall_brightness: float = parameter(
        1.0, 'Brightness of the walls: 1 white plaster, 0.2 dark paint.', 0.0, 1.0
    )


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


def state_file(node: PatrolNode) -> str:
    """Declare where the state is kept that outlives a process."""
    path: str = node.parameter(
        'state_file',
        '',
        "File that keeps the robot's pose, the time and the doors over a restart of the process; "
        'empty: nothing is kept.',
        read_only=True,
    )
    return path


def clock_rate(node: PatrolNode) -> ClockRateModel:
    """Declare how simulated time goes."""
    return node.declare_fields(ClockRateModel())


def published(node: PatrolNode) -> PublishedOptions:
    """Declare how the place is published."""
    return node.declare_fields(PublishedOptions())


def base(node: PatrolNode) -> BaseModel:
    """Declare body, limits and errors of the base."""
    return node.declare_fields(BaseModel(), prefix='base.')


def lidar(node: PatrolNode) -> LidarModel:
    """Declare what the lidar can do."""
    return node.declare_fields(LidarModel(), prefix='lidar.')


def people(node: PatrolNode) -> PeopleModel:
    """Declare who walks about."""
    return node.declare_fields(PeopleModel(), prefix='people.')


def camera(node: PatrolNode) -> CameraOptions:
    """Declare the camera's lens and picture, and what draws it."""
    return node.declare_fields(CameraOptions(), prefix='camera.')


def conditions(node: PatrolNode, on_change: Callable[[Conditions], None]) -> Conditions:
    """Declare light, noise and blur, which may be changed while the node runs."""
    return node.declare_fields(Conditions(), prefix='camera.', on_change=on_change)
