"""Odometry beside a gyroscope: slips, gaps, new beginnings, and gyroscopes that tell nonsense."""

from __future__ import annotations

import math
import random

import pytest

from lidar_navigation.geometry import Pose, angle_between, composed
from lidar_navigation.localisation.true_odometry import TrueOdometry


class Driven:
    """A robot that drives, its wheels and its gyroscope, at rates of their own.

    Args:
        gyroscope: What it tells for each radian.
        offset: And beside that, rad/s.
        rate: Readings of the odometry in a second.
    """

    def __init__(self, gyroscope: float = 1.0, offset: float = 0.0, rate: float = 20.0) -> None:
        self.odometry = TrueOdometry()
        self.true = self.wheels = self.told = (0.0, 0.0, 0.0)
        self.now = 100.0
        self._gyroscope, self._offset, self._rate = gyroscope, offset, rate
        self._due = self.now

    def drive(
        self,
        seconds: float,
        speed: float,
        turn: float,
        *,
        counted: float | None = None,
        silent: bool = False,
    ) -> None:
        """Drive; the wheels count another turn than is made, rad/s, or nothing is heard of them."""
        counted = turn if counted is None else counted
        for _ in range(round(seconds * 100)):
            self.now += 0.01
            self.true = composed(self.true, (0.01 * speed, 0.0, 0.01 * turn))
            self.wheels = composed(self.wheels, (0.01 * speed, 0.0, 0.01 * counted))
            self.odometry.turn(self.now, self._gyroscope * turn + self._offset)
            if not silent and self.now >= self._due - 1e-9:
                self._due = self.now + 1 / self._rate
                self.told = self.odometry.take(self.wheels, self.now)

    def prove(self) -> None:
        """Stand for a while, then turn to and fro."""
        self.drive(5.0, 0.0, 0.0)
        self.drive(2.0, 0.0, 0.8)
        self.drive(2.0, 0.2, -0.8)

    def off(self) -> tuple[float, float]:
        """Return by how much the odometry is off, metres and rad, at its last reading."""
        way = math.dist(self.told[:2], self.true[:2])
        return way, abs(angle_between(self.told[2], self.true[2]))


@pytest.mark.parametrize('gyroscope', [1.0, -1.0], ids=['upright', 'upside down'])
@pytest.mark.parametrize('rate', [10.0, 20.0, 100.0])
def test_wheels_that_slip_turn_no_robot_that_has_a_gyroscope(gyroscope: float, rate: float) -> None:
    seed = random.randrange(1_000_000)
    print('seed', seed)
    robot = Driven(gyroscope, offset=random.Random(seed).uniform(-0.02, 0.02), rate=rate)
    robot.prove()
    robot.drive(2.0, 0.4, 0.2, counted=0.9)
    way, turn = robot.off()
    assert way < 0.08
    assert turn < 0.05


def test_without_one_the_wheels_are_believed() -> None:
    odometry = TrueOdometry()
    for step in range(30):
        reading = (0.1 * step, 0.0, 0.02 * step)
        assert odometry.take(reading, 0.05 * step) == reading


@pytest.mark.parametrize('gyroscope', [57.3, 0.0, 0.3], ids=['degrees', 'dead', 'another axis'])
def test_one_that_tells_something_else_is_not_believed(gyroscope: float) -> None:
    robot = Driven(gyroscope)
    robot.prove()
    robot.drive(1.0, 0.3, 0.5)
    assert robot.off()[1] < 0.05


def test_what_the_wheels_did_not_tell_while_they_were_silent_a_gyroscope_does() -> None:
    robot = Driven()
    robot.prove()
    robot.drive(1.0, 0.0, 1.5, silent=True)
    # The driver was started again: it counts from zero.
    robot.wheels = (0.0, 0.0, 0.0)
    robot.drive(0.5, 0.0, 0.0)
    assert robot.off()[1] < 0.05


def test_another_childs_odometry_goes_on_where_the_first_was() -> None:
    odometry = TrueOdometry()
    odometry.take((2.0, 1.0, 0.5), 1.0)
    odometry.restart()
    assert odometry.take((2.1, 1.1, 0.5), 1.05) == (2.0, 1.0, 0.5)
    x, y, yaw = odometry.take((2.2, 1.1, 0.5), 1.1)
    assert (x, y, yaw) == pytest.approx((2.1, 1.0, 0.5))


def test_the_scale_of_a_profile_counts() -> None:
    odometry = TrueOdometry(scale=1.2, turn_scale=0.5)
    start: Pose = (1.0, 1.0, math.pi / 2)
    odometry.take(start, 0.0)
    assert odometry.take((1.0, 1.1, math.pi / 2), 0.1) == pytest.approx((1.0, 1.12, math.pi / 2))
    assert odometry.take((1.0, 1.1, math.pi / 2 + 0.1), 0.2)[2] == pytest.approx(math.pi / 2 + 0.05)
