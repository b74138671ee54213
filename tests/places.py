"""Places that tests of several packages share."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np

from strict_files.yaml_file import read_yaml_file
from surveillance_simulation.camera.model import Array
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place

CONFIG = Path(__file__).parents[1] / 'config'
SEVEN_ROOMS_FILE = CONFIG / 'seven_rooms.yaml'
SEVEN_ROOMS = {
    'R1': ['D1'],
    'R2': ['D2'],
    'R3': ['D3'],
    'R4': ['D4'],
    'E': ['D6', 'D7'],
    'C1': ['D1', 'D2', 'D5', 'D6'],
    'C2': ['D3', 'D4', 'D5', 'D7'],
}
"""The seven rooms of the assignment: each room with its doors."""

TWO_ROOMS: dict[str, Any] = {
    'map': {'A': ['D'], 'B': ['D']},
    'room_positions': {'A': [1.0, 1.0], 'B': [5.0, 1.0]},
    'robot_room': 'A',
    'recharge_rooms': ['A'],
    'walls': {
        'south': [0.0, 0.0, 6.0, 0.0],
        'east': [6.0, 0.0, 6.0, 2.0],
        'north': [6.0, 2.0, 0.0, 2.0],
        'west': [0.0, 2.0, 0.0, 0.0],
        'between': [3.0, 0.0, 3.0, 2.0],
    },
    'doors': {'D': [3.0, 1.0, 1.5707963, 1.0]},
    'markers': {'m1': [1.0, 0.06, 1.0, 1.0, 0.0]},
    'station': [1.0, 1.0, 0.0],
}
"""Two rooms of 3 m x 2 m side by side, a door in the middle of the wall between them."""


def changed(**sections: Any) -> dict[str, Any]:
    """Return the two rooms with some entries replaced; `walls__south` is that below `walls`."""
    parameters = copy.deepcopy(TWO_ROOMS)
    for name, value in sections.items():
        section, _, entry = name.partition('__')
        if entry:
            parameters[section][entry] = value
        else:
            parameters[section] = value
    return parameters


def two_rooms() -> SimulatedPlace:
    """Return the two rooms as a world."""
    return SimulatedPlace.from_parameters(TWO_ROOMS)


def camera_pose(
    x: float, y: float, z: float, yaw: float, pitch: float = 0.0, roll: float = 0.0
) -> Array:
    """Return the transform (4, 4) from the optical frame to the world.

    Args:
        x: Position, metres.
        y: Position, metres.
        z: Height, metres.
        yaw: Direction of view in the plane, rad, anticlockwise from x.
        pitch: Angle of view above the horizon, rad.
        roll: Rotation about the line of sight, rad, clockwise as the camera sees it.
    """
    forward = np.array(
        [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)]
    )
    right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
    down = np.cross(forward, right)
    pose = np.eye(4)
    pose[:3, 0] = math.cos(roll) * right + math.sin(roll) * down
    pose[:3, 1] = math.cos(roll) * down - math.sin(roll) * right
    pose[:3, 2] = forward
    pose[:3, 3] = (x, y, z)
    return pose


def flat(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return nested parameters with dotted names and with numbers as ROS lists hold them."""
    values: dict[str, Any] = {}
    for name, value in parameters.items():
        if isinstance(value, dict):
            values |= {f'{name}.{entry}': each for entry, each in value.items()}
        else:
            values[name] = value
    return values


def seven_rooms() -> SimulatedPlace:
    """Return the seven rooms, as simulated."""
    return read_simulated_place(SEVEN_ROOMS_FILE)


def seven_rooms_parameters() -> dict[str, Any]:
    """Return the seven rooms' file as flat parameter overrides."""
    return flat(read_yaml_file(SEVEN_ROOMS_FILE).values['/**']['ros__parameters'])
