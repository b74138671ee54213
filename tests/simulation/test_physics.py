"""The robot in MuJoCo: how it drives, what its odometry and lidar believe, and what stops it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation.geometry import Scan
from lidar_navigation.localisation.odometry import OdometryBuffer, joined
from surveillance_simulation.physics import base as physics_base
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import changed, two_rooms

pytest.importorskip('mujoco')

QUIET = LidarModel(noise=0.0)


def robot_in(world: SimulatedPlace | None = None, **physics: object) -> Robot:
    return Robot(world or two_rooms(), lidar=QUIET, physics=PhysicsModel(**physics))  # type: ignore[arg-type]


def drive(robot: Robot, speed: float, turn: float, seconds: float) -> None:
    for _ in range(round(seconds / 0.1)):
        robot.base.command(speed, turn)
        robot.advance(0.1)


def test_it_drives_as_told_and_its_odometry_is_right_on_a_good_floor() -> None:
    robot = robot_in()
    drive(robot, 0.0, 0.5, 2.0)
    drive(robot, 0.3, 0.0, 2.0)
    drive(robot, 0.0, 0.0, 1.6)
    x, y, yaw = robot.base.pose
    assert math.hypot(x - 1.0, y - 1.0) == pytest.approx(0.6, abs=0.05)
    assert robot.base.odometry == pytest.approx((x, y, yaw), abs=0.03)
    assert not robot.base.is_moving


def test_a_wheel_that_is_larger_makes_it_drive_an_arc_that_the_odometry_does_not_see() -> None:
    robot = robot_in(wheel_errors=(0.0, 0.05))
    drive(robot, 0.4, 0.0, 4.0)
    way = robot.base.odometry[0] - 1.0
    assert robot.base.odometry[2] == pytest.approx(0.0, abs=0.01)
    # The right wheel goes 5 % farther than the left one, on 0.34 m.
    assert robot.base.pose[2] == pytest.approx(0.05 * way / 0.34, rel=0.15)


def test_on_a_slippery_floor_the_wheels_turn_and_the_robot_lags_behind() -> None:
    ways = []
    for friction in (0.8, 0.05):
        robot = robot_in(friction=friction)
        drive(robot, 0.5, 0.0, 1.5)
        ways.append(robot.base.odometry[0] - robot.base.pose[0])
    assert ways[0] < 0.02
    assert ways[1] > 0.1


def test_a_wall_stops_it_once_and_the_wheels_spin_on() -> None:
    robot = robot_in(friction=0.3)
    drive(robot, 0.0, math.pi / 4, 2.2)
    drive(robot, 0.4, 0.0, 4.0)
    x, y, _ = robot.base.pose
    assert robot.base.collisions == 1
    assert robot.world.is_free(x, y, robot.base.model.radius - 0.01)
    # What the wheels did on the spot the odometry takes for a way.
    assert math.dist(robot.base.odometry[:2], (x, y)) > 0.2


def test_each_ray_of_a_turn_is_measured_at_its_own_moment() -> None:
    robot = robot_in(sweep=0.1)
    readings = OdometryBuffer()
    robot.measure()
    told = None
    for _ in range(100):
        robot.base.command(0.0, 1.2)
        robot.advance(0.01)
        readings.add(robot.time, robot.base.pose)
        told = robot.measure() or told
    assert told is not None
    assert told.age == pytest.approx(0.1, abs=0.011)
    angles = QUIET.angles
    times = np.arange(QUIET.rays) * told.duration / QUIET.rays
    swept = Scan(angles, np.asarray(told.ranges, float), 8.0, times=times)
    true = robot.scan().astype(float)

    def off(scan: Scan) -> float:
        turned = np.mod(scan.angles + scan.mount[2] + math.pi, math.tau) - math.pi
        seen = np.interp(angles, *np.array(sorted(zip(turned, scan.ranges, strict=True))).T)
        return float(np.median(np.abs(seen - true)))

    # A whole turn lasts while the robot turns by 0.12 rad.
    assert off(joined(swept, readings, robot.time - told.age)) < 0.5 * off(swept)


def test_a_mount_is_off_along_each_axis() -> None:
    assert physics_base.moved_by((0.1, 0.2, 0.3), (0.01, 0.04, 0.5)) == pytest.approx(
        (0.11, 0.24, 0.8)
    )


def test_its_lidar_sits_where_it_is_said_not_to() -> None:
    there = robot_in(sweep=0.0).measure()
    off = robot_in(sweep=0.0, lidar_offset=(0.1, 0.0, 0.0)).measure()
    assert there is not None
    assert off is not None
    assert float(there.ranges[180] - off.ranges[180]) == pytest.approx(0.1, abs=1e-3)


def test_a_long_robot_passes_a_gap_that_it_fits_and_a_wide_one_does_not() -> None:
    # A gap of 0.6 m between the wall and a thing.
    for footprint, passes in (
        ((0.4, 0.15, -0.4, 0.15, -0.4, -0.15, 0.4, -0.15), True),
        ((0.15, 0.4, -0.15, 0.4, -0.15, -0.4, 0.15, -0.4), False),
    ):
        world = SimulatedPlace.from_parameters(changed())
        for name, y in (('north', 1.6), ('south', 0.4)):
            world.place_obstacle(name, 2.0, y, 0.3)
        robot = robot_in(world, footprint=footprint)
        drive(robot, 0.4, 0.0, 4.0)
        assert (robot.base.pose[0] > 2.2) == passes
        assert (robot.base.collisions == 0) == passes


def test_doors_and_things_are_there_at_once_and_it_goes_on_where_it_was() -> None:
    robot = robot_in()
    drive(robot, 0.3, 0.0, 1.0)
    before = robot.base.pose
    robot.world.set_door('D', is_open=False)
    robot.advance(0.01)
    assert robot.base.pose == pytest.approx(before, abs=0.01)
    assert robot.scan()[180] == pytest.approx(2.95 - robot.base.pose[0], abs=0.02)


def test_a_state_is_kept_and_a_push_is_unseen_by_the_odometry() -> None:
    robot = robot_in()
    drive(robot, 0.3, 0.0, 1.0)
    odometry = robot.base.odometry
    assert robot.base.push(0.0, 0.3, 0.1) == pytest.approx(0.3)
    assert robot.base.odometry == odometry
    other = robot_in()
    assert other.restore(robot.state())
    assert other.base.pose == pytest.approx(robot.base.pose)


def test_without_mujoco_one_line_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('surveillance_simulation.physics.model.mujoco', None)
    with pytest.raises(ImportError, match='expected the package mujoco'):
        physics_base.PhysicsBase(two_rooms(), (1.0, 1.0, 0.0))
