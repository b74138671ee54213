"""A drive's recoveries, one after the other, on a clock of the test's own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_controllers.geometry import composed
from surveillance_controllers.motion.driving import Drive, RecoveryParameters, Spin, State
from surveillance_controllers.motion.path_following import DriveParameters, Velocity

NOTHING = np.zeros((0, 2))
PERIOD = 0.1


class Robot:
    """A robot without errors that a drive steers."""

    def __init__(self, drive: Drive, wall: float | None = None) -> None:
        self.drive = drive
        self.pose = (0.0, 0.0, 0.0)
        self.wall = wall
        self.now = 0.0
        self.states: list[State] = []
        self.lost = False

    def seen(self) -> np.ndarray:
        if self.wall is None:
            return NOTHING
        points = np.stack([np.full(41, self.wall), np.linspace(-2, 2, 41)], axis=1)
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        return (points - self.pose[:2]) @ np.array([[cos, -sin], [sin, cos]])

    def step(self) -> Velocity:
        velocity = self.drive.step(self.now, self.pose, self.seen(), lost=self.lost)
        if not self.states or self.states[-1] is not self.drive.state:
            self.states.append(self.drive.state)
        turn = velocity.turn * PERIOD
        self.pose = composed(self.pose, (velocity.speed * PERIOD, 0.0, turn))
        self.now += PERIOD
        return velocity

    def run(self, seconds: float, until: State | None = None) -> None:
        end = self.now + seconds
        while self.now < end and not self.drive.state.ended and self.drive.state is not until:
            self.step()


def test_a_free_path_is_driven_to_its_end_where_the_robot_stands() -> None:
    robot = Robot(Drive([[0, 0], [2, 0]]))
    robot.run(30)
    assert robot.states == [State.DRIVING, State.STOPPING, State.ARRIVED]
    assert robot.pose[0] == pytest.approx(2, abs=0.1)


def test_before_a_wall_it_waits_asks_backs_up_looks_around_and_gives_up() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive, wall=1.5)
    asked = 0
    while not drive.state.ended and robot.now < 200:
        robot.run(100, until=State.ASKING)
        if drive.state is State.ASKING:
            asked += 1
            drive.no_path('the closed door D5 is in the way')
    assert asked == 3
    assert robot.states == [
        State.DRIVING,
        State.WAITING,
        State.ASKING,
        State.BACKING,
        State.ASKING,
        State.LOOKING,
        State.ASKING,
    ]
    assert drive.state is State.FAILED
    assert drive.reason == 'the closed door D5 is in the way'
    assert robot.pose[0] < 1.5 - DriveParameters().radius


def test_something_that_moves_away_while_it_waits_costs_only_the_wait() -> None:
    drive = Drive([[0, 0], [3, 0]])
    robot = Robot(drive, wall=1.5)
    robot.run(100, until=State.WAITING)
    robot.wall = None
    robot.run(100, until=State.ASKING)
    drive.new_path([robot.pose[:2], (3, 0)])
    robot.run(60)
    assert drive.state is State.ARRIVED


def test_an_obstacle_seen_far_ahead_on_the_path_asks_for_another_one_at_once() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    drive.heed(np.array([[2.5, 1.0]]))
    assert drive.state is State.DRIVING
    drive.heed(np.array([[2.5, 0.1]]))
    assert drive.state is State.ASKING
    for _ in range(20):
        velocity = robot.step()
    assert velocity == Velocity()


def test_a_path_in_spite_of_an_obstacle_is_followed_until_something_stands_there() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    drive.heed(np.array([[2.5, 0.1]]))
    assert drive.state is State.ASKING
    drive.new_path([robot.pose[:2], (4, 0)])
    drive.heed(np.array([[2.5, 0.1], [2.5, 0.15]]))
    assert drive.state is State.DRIVING
    robot.wall = 2.5
    robot.run(60, until=State.WAITING)
    assert 1.5 < robot.pose[0] < 2.5 - DriveParameters().radius
    robot.wall = None
    robot.run(60, until=State.ASKING)
    drive.new_path([robot.pose[:2], (4, 0)])
    robot.run(60)
    assert drive.state is State.ARRIVED


def test_a_robot_that_was_carried_off_asks_for_another_path() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    robot.pose = (1.0, 2.0, 0.0)
    robot.step()
    assert drive.state is State.ASKING
    assert 'off its path' in drive.reason


def test_a_lost_robot_stands_looks_around_and_fails_in_the_end() -> None:
    drive = Drive([[0, 0], [4, 0]], recovery=RecoveryParameters(stand_lost=1, look_lost=3))
    robot = Robot(drive)
    robot.run(2.0)
    robot.lost = True
    robot.run(0.9)
    assert abs(robot.step().turn) < 1e-9
    robot.run(1.0)
    assert robot.step().turn > 0
    robot.run(10)
    assert drive.state is State.FAILED
    assert 'does not know where it is' in drive.reason


def test_a_robot_that_was_lost_for_a_moment_goes_on() -> None:
    drive = Drive([[0, 0], [3, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    robot.lost = True
    robot.run(1.5)
    robot.lost = False
    robot.run(60)
    assert drive.state is State.ARRIVED


def test_no_progress_is_noticed_without_anything_in_sight() -> None:
    drive = Drive([[0, 0], [4, 0]])
    now = 0.0
    while drive.state is State.DRIVING and now < 60:
        drive.step(now, (0.5, 0, 0), NOTHING)
        now += PERIOD
    assert drive.state is State.WAITING
    assert drive.reason.startswith('no progress')


def test_a_spin_turns_once() -> None:
    spin, yaw, turned, now = Spin(), 2.0, 0.0, 0.0
    for _ in range(200):
        now += PERIOD
        velocity = spin.step(yaw, now)
        if spin.done:
            break
        turned += velocity.turn * PERIOD
        yaw = math.remainder(yaw + velocity.turn * PERIOD, math.tau)
    assert turned == pytest.approx(math.tau, abs=0.05)
    assert spin.step(yaw, now) == Velocity()


@pytest.mark.parametrize(
    ('yaw', 'bearing', 'way'), [(2.0, 2.5, 0.5), (3.0, -3.0, 0.283), (0.1, 0.11, 0.0), (0, -2, -2)]
)
def test_a_spin_to_a_bearing_takes_the_shorter_way(yaw: float, bearing: float, way: float) -> None:
    spin, turned, now, late = Spin(bearing), 0.0, 0.0, 0.0
    for _ in range(100):
        now += PERIOD
        velocity = spin.step(yaw, now)
        if spin.done:
            break
        # The base does in one period what it was told in the one before.
        turned += late * PERIOD
        yaw = math.remainder(yaw + late * PERIOD, math.tau)
        late = velocity.turn
    assert spin.done
    assert turned == pytest.approx(way, abs=0.03)
    assert now < 6.0


def test_a_spin_that_does_not_go_on_ends() -> None:
    spin = Spin()
    steps = 0
    while not spin.done:
        spin.step(1.0, steps * PERIOD)
        steps += 1
    assert 2.0 < steps * PERIOD < 10.0
