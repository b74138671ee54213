"""Simulated robot and place: camera, arm, base, lidar and time.

    from surveillance_simulation import Robot, read_simulated_place

    robot = Robot(read_simulated_place('config/seven_rooms.yaml'))
    robot.base.command(0.5, 0.0)  # m/s, rad/s
    robot.advance(0.1)  # seconds
    robot.scan()  # (360,) metres

None of that needs ROS. The node `simulator` has it on ROS topics (`feeds`, `conversions`), at a
rate of its own (`clock_rate`).
"""

from __future__ import annotations

from surveillance_simulation.camera.model import Camera, Conditions
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.robot.base import Base, BaseModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.people import People, PeopleModel
from surveillance_simulation.world.simulated_place import (
    MarkerPanel,
    SimulatedPlace,
    read_simulated_place,
)
from surveillance_simulation.world.things import Thing

__all__ = [
    'Base',
    'BaseModel',
    'Camera',
    'Conditions',
    'LidarModel',
    'MarkerPanel',
    'People',
    'PeopleModel',
    'Renderer',
    'Robot',
    'SimulatedPlace',
    'Thing',
    'read_simulated_place',
]
