"""A long robot in the rooms of a foreign physics."""

from __future__ import annotations

import numpy as np
import pytest

from lidar_navigation import (
    Drive,
    DriveParameters,
    DriveState,
    Footprint,
    GridPlanner,
    Navigator,
    PlanningParameters,
    Velocity,
)
from lidar_navigation.geometry import Scan

LONG = (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)
"""0.8 m long, 0.4 m wide; its wheels are 0.3 m before its rear."""
BODY = Footprint(9.0, LONG)


def test_a_long_robot_drives_through_doors_of_a_foreign_physics_without_a_contact(
    seven_rooms_world: object,
) -> None:
    pytest.importorskip('mujoco')
    from surveillance_simulation.physics.model import PhysicsModel
    from surveillance_simulation.robot.base import BaseModel
    from surveillance_simulation.robot.robot import Robot
    from surveillance_simulation.world.simulated_place import SimulatedPlace

    world = seven_rooms_world
    assert isinstance(world, SimulatedPlace)
    physics = PhysicsModel(footprint=LONG, friction=0.5, sweep=0.0)
    robot = Robot(world, BaseModel(radius=BODY.circumscribed), physics=physics)
    grid = world.plan.grid()
    paths, parameters = (
        GridPlanner(grid, PlanningParameters(footprint=LONG)),
        DriveParameters(footprint=LONG),
    )
    navigator = Navigator()
    navigator.set_map(grid)
    goal = world.plan.place.positions['R1'][:2]
    drive = Drive(paths.plan(robot.base.pose[:2], goal), parameters)
    navigator.move(robot.base.odometry, 0.0)
    navigator.task = drive
    while not drive.state.ended and robot.time < 60.0:
        told = robot.measure()
        assert told is not None
        scan = Scan(robot.lidar.angles, np.asarray(told.ranges, float), 8.0)
        velocity = navigator.see(scan, robot.time) or Velocity()
        robot.base.command(velocity.speed, velocity.turn)
        robot.advance(0.1)
        navigator.move(robot.base.odometry, robot.time)
    assert drive.state is DriveState.ARRIVED, drive.reason
    assert world.place_at(*robot.base.pose[:2]) == 'R1'
    assert robot.base.collisions == 0
