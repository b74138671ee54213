"""The simulator's parameters, declared with their descriptions and checked in one place."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields
from surveillance_simulation.camera.lighting import LIGHTINGS
from surveillance_simulation.camera.model import Conditions
from surveillance_simulation.clock_rate import ClockRateModel
from surveillance_simulation.robot.base import BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.world.people import MANNERS, PeopleModel

_CLOCK_RATE = {
    'speed': Described(
        'Simulated seconds per real second; 0: as fast as the nodes keep up.', 0.0, 1000.0
    ),
    'ceiling': Described(
        'Simulated seconds per real second at most when speed is 0.',
        *(1.0, 10_000.0),
        name='top_speed',
    ),
    'step': Described(
        'Simulated seconds between two messages on clock, odom and scan.', 0.005, 0.5
    ),
    'idle_step': Described('The same while nothing moves and speed is 0.', 0.005, 5.0),
}
_BASE = {
    'radius': Described('Radius of the robot, metres.', 0.01, 20.0, name='robot_radius'),
    'speed': Described('Greatest speed, m/s.', 0.01, 20.0),
    'turn_speed': Described('Greatest turn speed, rad/s.', 0.01, 20.0),
    'acceleration': Described('Greatest acceleration, m/s^2.', 0.01, 20.0),
    'deceleration': Described(
        'With which the base brakes when it must, m/s^2.', *(0.05, 20.0), name='robot_deceleration'
    ),
    'turn_acceleration': Described('Greatest turning acceleration, rad/s^2.', 0.01, 20.0),
    'command_timeout': Described(
        'Seconds without a command after which the base stops.', 0.01, 20.0
    ),
    'distance_error': Described(
        "Standard deviation of the odometry's distance after one metre, metres.", 0.0, 1.0
    ),
    'turn_error': Described(
        "Standard deviation of the odometry's heading after one radian, rad.", 0.0, 1.0
    ),
}
_LIDAR = {
    'rays': Described('Rays of a full turn.', 4, 7200),
    'range_max': Described('Greatest distance measured, metres.', 0.5, 200.0),
    'noise': Described('Standard deviation of a distance, metres.', 0.0, 1.0),
}
_PEOPLE = {
    'count': Described('People who walk about.', 0, 100),
    'speed': Described('How fast they walk, m/s.', 0.1, 3.0),
    'manner': Described(
        'polite: they keep 0.6 m from the robot; pushy: 5 cm.',
        choices=MANNERS,
    ),
    'radius': Described('Radius of a person, metres.', 0.05, 1.0),
    'shortest_rest': Described('Least time a person stays in a room, s.', 0.0, 86_400.0),
    'longest_rest': Described('Greatest time a person stays in a room, s.', 0.0, 86_400.0),
}
_PUBLISHED = {
    'map_resolution': Described('Side of a cell of the map, metres.', 0.01, 0.5),
    'announce_pose': Described(
        'Tell each new subscriber of initialpose, such as AMCL, where the robot is.'
    ),
}
_CAMERA = {
    'width': Described('Columns of a picture.', 16, 4096),
    'height': Described('Rows of a picture.', 16, 4096),
    'field_of_view': Described('Horizontal field of view, degrees.', 5.0, 150.0),
    'renderer': Described(
        'What draws the pictures; mujoco adds shadows and needs the package mujoco.',
        choices=('opencv', 'mujoco'),
    ),
    'rate': Described('Pictures per second at most.', 0.1, 100.0),
    'wall_brightness': Described(
        'Brightness of the walls: 1 white plaster, 0.2 dark paint.', 0.0, 1.0
    ),
}
_CONDITIONS = {
    'light': Described(
        "Brightness of the camera's pictures: 1 a lit room, 0.1 a dark one.", 0.0, 100.0
    ),
    'noise': Described("Standard deviation of the camera's noise, grey levels.", 0.0, 100.0),
    'blur': Described("Standard deviation of the lens's blur, pixels.", 0.0, 100.0),
    'motion': Described('Length of the streak that motion draws in a picture, pixels.', 0.0, 100.0),
    'motion_angle': Described('Direction of that streak, rad.', -math.pi, math.pi),
    'lighting': Described('How evenly the light falls on what the camera sees.', choices=LIGHTINGS),
}


@dataclass(frozen=True)
class PublishedOptions:
    """How the place is published; units as declared."""

    map_resolution: float = 0.05
    announce_pose: bool = False


@dataclass(frozen=True)
class CameraOptions:
    """The camera that does not change; units as declared."""

    width: int = 640
    height: int = 480
    field_of_view: float = 60.0
    renderer: str = 'opencv'
    rate: float = 10.0
    wall_brightness: float = 1.0


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
    return declare_fields(node, ClockRateModel(), _CLOCK_RATE)


def published(node: PatrolNode) -> PublishedOptions:
    """Declare how the place is published."""
    return declare_fields(node, PublishedOptions(), _PUBLISHED)


def base(node: PatrolNode) -> BaseModel:
    """Declare body, limits and errors of the base."""
    return declare_fields(node, BaseModel(), _BASE, prefix='base.')


def lidar(node: PatrolNode) -> LidarModel:
    """Declare what the lidar can do."""
    return declare_fields(node, LidarModel(), _LIDAR, prefix='lidar.')


def people(node: PatrolNode) -> PeopleModel:
    """Declare who walks about."""
    return declare_fields(node, PeopleModel(), _PEOPLE, prefix='people.')


def camera(node: PatrolNode) -> CameraOptions:
    """Declare the camera's lens and picture, and what draws it."""
    return declare_fields(node, CameraOptions(), _CAMERA, prefix='camera.')


def conditions(node: PatrolNode, on_change: Callable[[Conditions], None]) -> Conditions:
    """Declare light, noise and blur, which may be changed while the node runs."""
    present = Conditions()

    def changed(field: str, value: Any) -> None:
        nonlocal present
        present = replace(present, **{field: value})
        on_change(present)

    present = declare_fields(node, present, _CONDITIONS, prefix='camera.', on_change=changed)
    return present
