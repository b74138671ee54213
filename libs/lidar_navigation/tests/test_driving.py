"""A drive's recoveries, one after the other, on a clock of the test's own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from lidar_navigation import Drive, DriveParameters, DriveState, Spin, Velocity
from lidar_navigation.driving.driving import RecoveryParameters
from lidar_navigation.geometry import composed
from lidar_navigation.localisation.tracking import Mover

NOTHING = np.zeros((0, 2))
PERIOD = 0.1


class Robot:
    """A robot without errors that a drive steers."""

    def __init__(self, drive: Drive, wall: float | None = None) -> None:
        self.drive = drive
        self.pose = (0.0, 0.0, 0.0)
        self.wall = wall
        self.now = 0.0
        self.states: list[DriveState] = []
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

    def run(self, seconds: float, until: DriveState | None = None) -> None:
        end = self.now + seconds
        while self.now < end and not self.drive.state.ended and self.drive.state is not until:
            self.step()


def test_a_free_path_is_driven_to_its_end_where_the_robot_stands() -> None:
    robot = Robot(Drive([[0, 0], [2, 0]]))
    robot.run(30)
    assert robot.states == [DriveState.DRIVING, DriveState.STOPPING, DriveState.ARRIVED]
    assert robot.pose[0] == pytest.approx(2, abs=0.1)


def test_before_a_wall_it_waits_asks_backs_up_looks_around_and_gives_up() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive, wall=1.5)
    asked = 0
    while not drive.state.ended and robot.now < 200:
        robot.run(100, until=DriveState.ASKING)
        if drive.state is DriveState.ASKING:
            asked += 1
            drive.no_path('the closed door D5 is in the way')
    assert asked == 3
    assert robot.states == [
        DriveState.DRIVING,
        DriveState.WAITING,
        DriveState.ASKING,
        DriveState.BACKING,
        DriveState.ASKING,
        DriveState.LOOKING,
        DriveState.ASKING,
    ]
    assert drive.state is DriveState.FAILED
    assert drive.reason == 'the closed door D5 is in the way'
    assert robot.pose[0] < 1.5 - DriveParameters().radius


def test_something_that_moves_away_while_it_waits_costs_only_the_wait() -> None:
    drive = Drive([[0, 0], [3, 0]])
    robot = Robot(drive, wall=1.5)
    robot.run(100, until=DriveState.WAITING)
    robot.wall = None
    robot.run(100, until=DriveState.ASKING)
    drive.new_path([robot.pose[:2], (3, 0)])
    robot.run(60)
    assert drive.state is DriveState.ARRIVED


def test_an_obstacle_seen_far_ahead_on_the_path_asks_for_another_one_at_once() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    drive.heed(np.array([[2.5, 1.0]]))
    assert drive.state is DriveState.DRIVING
    drive.heed(np.array([[2.5, 0.1]]))
    assert drive.state is DriveState.ASKING
    for _ in range(20):
        velocity = robot.step()
    assert velocity == Velocity()


def test_a_path_in_spite_of_an_obstacle_is_followed_until_something_stands_there() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    drive.heed(np.array([[2.5, 0.1]]))
    assert drive.state is DriveState.ASKING
    drive.new_path([robot.pose[:2], (4, 0)])
    drive.heed(np.array([[2.5, 0.1], [2.5, 0.15]]))
    assert drive.state is DriveState.DRIVING
    robot.wall = 2.5
    robot.run(60, until=DriveState.WAITING)
    assert 1.5 < robot.pose[0] < 2.5 - DriveParameters().radius
    robot.wall = None
    robot.run(60, until=DriveState.ASKING)
    drive.new_path([robot.pose[:2], (4, 0)])
    robot.run(60)
    assert drive.state is DriveState.ARRIVED


def test_a_robot_that_was_carried_off_asks_for_another_path() -> None:
    drive = Drive([[0, 0], [4, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    robot.pose = (1.0, 2.0, 0.0)
    robot.step()
    assert drive.state is DriveState.ASKING
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
    assert drive.state is DriveState.FAILED
    assert 'does not know where it is' in drive.reason


def test_a_robot_that_was_lost_for_a_moment_goes_on() -> None:
    drive = Drive([[0, 0], [3, 0]])
    robot = Robot(drive)
    robot.run(1.0)
    robot.lost = True
    robot.run(1.5)
    robot.lost = False
    robot.run(60)
    assert drive.state is DriveState.ARRIVED


def test_no_progress_is_noticed_without_anything_in_sight() -> None:
    drive = Drive([[0, 0], [4, 0]])
    now = 0.0
    while drive.state is DriveState.DRIVING and now < 60:
        drive.step(now, (0.5, 0, 0), NOTHING)
        now += PERIOD
    assert drive.state is DriveState.WAITING
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


WALL = np.array([[0.26, y] for y in np.linspace(-0.3, 0.3, 31)])
"""Right before the robot, in its frame."""
AHEAD = [[0.0, 0.0], [5.0, 0.0]]
ORIGIN = (0.0, 0.0, 0.0)


def stand(drive: Drive, begin: float, end: float, seen: np.ndarray = WALL, **more: Any) -> Velocity:
    """Step a drive of a robot that stands, every 0.1 s from one time up to before another."""
    velocity = Velocity()
    for moment in range(round((end - begin) * 10)):
        velocity = drive.step(begin + 0.1 * moment, ORIGIN, seen, **more)
    return velocity


def test_each_recovery_takes_its_time_and_then_another_path_is_asked_for() -> None:
    drive = Drive(AHEAD)
    stand(drive, 0.0, 0.5)
    assert (drive.state, drive.recoveries) == (DriveState.DRIVING, 0)
    drive.step(0.5, ORIGIN, WALL)
    assert (drive.state, drive.recoveries) == (DriveState.WAITING, 1)
    assert drive.reason == 'something stands in the way at (0.26, 0.00)'
    assert stand(drive, 0.6, 3.5) == Velocity()
    assert drive.state is DriveState.WAITING
    drive.step(3.5, ORIGIN, WALL)
    assert drive.state is DriveState.ASKING
    drive.new_path(AHEAD)
    stand(drive, 4.0, 4.5)
    drive.step(4.5, ORIGIN, WALL)
    assert (drive.state, drive.recoveries) == (DriveState.BACKING, 2)
    for moment, x in enumerate((0.0, -0.1, -0.2, -0.3, -0.39)):
        velocity = drive.step(4.6 + 0.1 * moment, (x, 0.0, 0.0), WALL)
        assert (velocity, drive.state) == (Velocity(-0.15, 0.0), DriveState.BACKING)
    assert drive.step(5.2, (-0.4, 0.0, 0.0), WALL) == Velocity()
    assert drive.state is DriveState.ASKING
    drive.no_path('a wall')
    assert (drive.state, drive.reason, drive.recoveries) == (DriveState.LOOKING, 'a wall', 3)
    for turned in (0.5, 2.5, 4.5, 6.2):
        assert drive.step(5.3, (-0.4, 0.0, turned), WALL) == Velocity(0.0, 1.0)
    drive.step(5.4, (-0.4, 0.0, 6.3), WALL)
    assert drive.state is DriveState.ASKING
    drive.no_path('a wall still')
    assert (drive.state, drive.reason, drive.recoveries) == (DriveState.FAILED, 'a wall still', 3)
    assert drive.state.ended


def finish(drive: Drive, now: float, movers: Sequence[Mover] = ()) -> None:
    """Let what a drive tries come to its end: it waited, has backed up, or has looked around."""
    for part in range(5):
        if drive.state is not DriveState.ASKING:
            drive.step(now, (0.5 * part, 0.0, 2.0 * part), WALL, movers=movers)


def trying(state: DriveState) -> Drive:
    """Return a drive that begins a recovery at 10 s."""
    drive = Drive(AHEAD)
    drive.step(0.0, (0.0, 2.0, 0.0), NOTHING)  # off its path
    drive.no_path('stuck')
    for now in (9.0, 10.0):
        if drive.state is not state:
            finish(drive, now)
            drive.step(10.0, ORIGIN, WALL)
            drive.no_path('stuck')
    assert drive.state is state
    return drive


def test_a_recovery_that_does_not_go_on_ends() -> None:
    backing = trying(DriveState.BACKING)
    assert stand(backing, 10.0, 20.0) == Velocity(-0.15, 0.0)
    assert backing.step(20.1, ORIGIN, WALL) == Velocity()
    assert backing.state is DriveState.ASKING
    looking = trying(DriveState.LOOKING)
    assert stand(looking, 10.0, 30.0) == Velocity(0.0, 1.0)
    looking.step(30.1, ORIGIN, WALL)
    assert looking.state is DriveState.ASKING


@pytest.mark.parametrize(('behind', 'backs'), [(-0.34, True), (-0.27, False)])
def test_it_backs_up_where_there_is_room_behind(behind: float, backs: bool) -> None:
    drive = trying(DriveState.BACKING)
    around = np.vstack([WALL, [[behind, 0.0]]])
    assert (drive.step(10.1, ORIGIN, around) == Velocity(-0.15, 0.0)) is backs
    assert (drive.state is DriveState.BACKING) is backs


def test_a_robot_that_is_lost_stands_looks_and_gives_up() -> None:
    drive = Drive(AHEAD)
    assert stand(drive, 0.0, 1.0, lost=True) == Velocity()
    assert drive.step(1.0, ORIGIN, WALL, lost=True) == Velocity(0.0, 0.5)
    assert stand(drive, 1.1, 31.0, lost=True) == Velocity(0.0, 0.5)
    assert drive.step(31.1, ORIGIN, WALL, lost=True) == Velocity()
    assert drive.state is DriveState.FAILED
    assert drive.reason == (
        'the robot does not know where it is: what it sees is nowhere on the map'
    )
    found = Drive(AHEAD)
    stand(found, 0.0, 30.0, lost=True)
    found.step(30.0, ORIGIN, WALL)
    stand(found, 30.1, 60.0, lost=True)
    assert found.state is DriveState.DRIVING, 'it knew for a moment'


@pytest.mark.parametrize(
    ('off', 'movers', 'asks'),
    [
        (0.49, (), False),
        (0.51, (), True),
        (0.99, (Mover(4.0, 4.0, 0.3, 0.0, 0.25),), False),
        (1.01, (Mover(4.0, 4.0, 0.3, 0.0, 0.25),), True),
    ],
)
def test_far_off_its_path_it_asks_for_another(
    off: float, movers: tuple[Mover, ...], asks: bool
) -> None:
    drive = Drive(AHEAD)
    drive.step(0.0, (1.0, off, 0.0), NOTHING, movers=movers)
    assert (drive.state is DriveState.ASKING) is asks
    assert (drive.reason == f'the robot is {off:.2f} m off its path') is asks


def test_after_six_other_paths_the_next_recovery_is_tried() -> None:
    drive = Drive(AHEAD)
    for number in range(1, 8):
        drive.step(number, (1.0, 2.0, 0.0), NOTHING)
        assert (drive.state is DriveState.ASKING) is (number <= 6)
        assert drive.recoveries == number
        drive.new_path(AHEAD)
    assert drive.state is DriveState.DRIVING
    drive.step(9.0, (1.0, 2.0, 0.0), NOTHING)
    assert drive.state is DriveState.ASKING, 'it is counted anew'


def test_no_progress_begins_a_recovery_after_eight_seconds() -> None:
    def held(step: float) -> tuple[DriveState, str]:
        drive, nothing = Drive(AHEAD), NOTHING
        for moment in range(82):
            drive.step(0.1 * moment, (step * moment, 0.0, 0.0), nothing)
        return drive.state, drive.reason

    assert held(0.0) == (DriveState.WAITING, 'no progress for 8 s')
    assert held(0.0013) == (DriveState.DRIVING, '')
    assert held(0.0011) == (DriveState.WAITING, 'no progress for 8 s')


def test_it_has_arrived_when_it_stands() -> None:
    drive, nothing = Drive([[0.0, 0.0]]), NOTHING
    drive.step(0.0, ORIGIN, nothing)
    assert drive.state is DriveState.STOPPING
    drive.step(0.1, (0.005, 0.0, 0.0), nothing)
    drive.step(0.2, (0.005, 0.0, 0.01), nothing)
    assert drive.state is DriveState.STOPPING
    drive.step(0.3, (0.005, 0.003, 0.01), nothing)
    assert drive.state is DriveState.ARRIVED
    assert drive.state.ended
    sliding = Drive([[0.0, 0.0]])
    for moment in range(31):
        sliding.step(0.1 * moment, (0.01 * moment, 0.0, 0.0), nothing)
    assert sliding.state is DriveState.STOPPING
    sliding.step(3.2, (0.5, 0.0, 0.0), nothing)
    assert sliding.state is DriveState.ARRIVED


def test_an_obstacle_on_the_path_is_asked_around_once() -> None:
    drive, nothing = Drive(AHEAD), NOTHING
    drive.heed(np.array([[2.0, 0.1]]))
    assert drive.state is DriveState.DRIVING, 'it has not begun'
    drive.heed(NOTHING)
    drive.step(0.0, ORIGIN, nothing)
    drive.heed(np.array([[3.5, 0.0]]))
    assert drive.state is DriveState.DRIVING, 'too far ahead'
    drive.heed(np.array([[2.0, 0.1]]))
    assert (drive.state, drive.reason) == (DriveState.ASKING, 'something is on the path ahead')
    drive.new_path(AHEAD)
    drive.heed(np.array([[2.0, 0.1]]))
    assert drive.state is DriveState.DRIVING, 'this path was found in spite of it'


def test_among_people_the_list_of_recoveries_starts_anew_for_a_minute() -> None:
    def tried(until: float) -> tuple[list[DriveState], float]:
        """Try all, every 10 s, beside somebody who is there up to a time."""
        drive, now = Drive(AHEAD), 0.0
        drive.step(now, (0.0, 2.0, 0.0), NOTHING)
        states: list[DriveState] = []
        while drive.state is not DriveState.FAILED:
            drive.no_path('people')
            states.append(drive.state)
            now += 10.0
            finish(drive, now, (Mover(3.0, 3.0, 0.3, 0.0, 0.25),) if now <= until else ())
        return states, now - 10.0

    once = [DriveState.WAITING, DriveState.BACKING, DriveState.LOOKING]
    assert tried(0.0) == ([*once, DriveState.FAILED], 30.0)
    assert tried(100.0) == ([*once, *once[1:], *once[1:], DriveState.FAILED], 70.0)


def test_a_turn_goes_the_shorter_way_and_slows_down() -> None:
    spin = Spin(math.pi / 2)
    assert not spin.done
    assert spin.step(0.0, 0.0) == Velocity(0.0, 1.0)
    left = 0.1
    assert spin.step(math.pi / 2 - left, 1.0).turn == pytest.approx(math.sqrt(6.0 * left))
    assert spin.step(math.pi / 2 - 0.021, 1.1).turn > 0.0
    assert not spin.done
    assert spin.step(math.pi / 2 + 0.019, 1.2) == Velocity()
    assert spin.done
    back = Spin(-2.5)
    assert back.step(2.5, 0.0).turn == 1.0, 'over the half circle'
    back.step(-2.4, 0.5)
    assert back.step(-2.4, 0.6).turn < 0.0, 'too far: it comes back'
    assert not back.done


def test_a_whole_turn_is_a_whole_turn_and_one_that_is_stuck_ends() -> None:
    spin = Spin()
    for part in range(1, 62):
        assert spin.step(0.1 * part, 0.1 * part).turn > 0.0
        assert not spin.done
    spin.step(0.1 + math.tau, 6.3)
    assert spin.done
    stuck = Spin()
    stuck.step(0.0, 0.0)
    stuck.step(0.1, 1.0)
    stuck.step(0.103, 4.9)
    assert not stuck.done
    stuck.step(0.103, 5.0)
    assert stuck.done
