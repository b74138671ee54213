"""Following a path: arrival, limits, the corridor around the path, and stopping for what is
seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers import geometry
from surveillance_controllers.footprint import Footprint
from surveillance_controllers.geometry import composed
from surveillance_controllers.motion.path_following import (
    DriveParameters,
    PathFollower,
    Velocity,
    room_ahead,
)

NOTHING = np.zeros((0, 2))
PERIOD = 0.1
ROBOT = DriveParameters()


def moved(pose: tuple[float, float, float], velocity: Velocity) -> tuple[float, float, float]:
    """Return the pose after one period on the arc of a velocity."""
    turn = velocity.turn * PERIOD
    distance = velocity.speed * PERIOD
    chord = distance if abs(turn) < 1e-9 else 2 * distance * math.sin(turn / 2) / turn
    return composed(
        pose, (chord * math.cos(turn / 2), chord * math.sin(turn / 2), velocity.turn * PERIOD)
    )


def follow(
    path: np.ndarray, pose: tuple[float, float, float]
) -> tuple[list[tuple[float, float, float]], list[Velocity], bool]:
    """Drive without errors until the end, or for as long as a slow robot would need."""
    follower = PathFollower(path, ROBOT)
    poses, velocities = [pose], [Velocity()]
    for _ in range(int(60 + 30 * geometry.length(path)) * 10):
        guidance = follower.step(pose, NOTHING, PERIOD)
        velocities.append(guidance.velocity)
        if guidance.done:
            return poses, velocities, True
        pose = moved(pose, guidance.velocity)
        poses.append(pose)
    return poses, velocities, False


@st.composite
def paths(draw: st.DrawFn) -> np.ndarray:
    """Paths of legs of 0.6 m and more, with turns of up to 140 degrees, rounded at the corners."""
    heading, points = draw(st.floats(-3, 3)), [np.zeros(2)]
    for _ in range(draw(st.integers(1, 6))):
        step = draw(st.floats(0.6, 4.0))
        points.append(points[-1] + step * np.array([math.cos(heading), math.sin(heading)]))
        heading += draw(st.floats(-2.4, 2.4))
    return np.array(points)


@given(paths(), st.floats(-3.1, 3.1))
@settings(max_examples=40)
def test_any_path_is_followed_to_its_end_within_its_corridor(path: np.ndarray, yaw: float) -> None:
    poses, velocities, arrived = follow(path, (float(path[0, 0]), float(path[0, 1]), yaw))
    assert arrived
    assert math.dist(poses[-1][:2], path[-1]) <= ROBOT.tolerance
    line = geometry.equally_spaced(path, 0.02)
    at = np.array(poses)[:, :2]
    off = np.hypot(*(at[:, None] - line).transpose(2, 0, 1)).min(axis=1)
    assert off.max() <= 0.25
    speeds = np.array([v.speed for v in velocities])
    turns = np.array([v.turn for v in velocities])
    assert speeds.min() >= 0
    assert speeds.max() <= ROBOT.speed + 1e-9
    assert np.abs(turns).max() <= ROBOT.turn + 1e-9
    assert np.diff(speeds).max() <= ROBOT.acceleration * PERIOD + 1e-9
    assert np.abs(np.diff(turns[:-1])).max(initial=0) <= ROBOT.turn_acceleration * PERIOD + 1e-9


def test_a_straight_path_is_driven_straight_and_mostly_at_top_speed() -> None:
    poses, velocities, arrived = follow(np.array([[0.0, 0.0], [6.0, 0.0]]), (0, 0, 0))
    assert arrived
    assert max(abs(y) for _, y, _ in poses) < 1e-6
    assert len(poses) * PERIOD < 6 / ROBOT.speed + 4
    assert sum(v.speed > 0.95 * ROBOT.speed for v in velocities) > 0.6 * len(velocities)


def test_a_path_of_one_point_where_the_robot_stands_is_done_at_once() -> None:
    assert PathFollower([[1.0, 2.0]], ROBOT).step((1, 2, 0.5), NOTHING, PERIOD).done


@pytest.mark.parametrize('distance', [0.8, 1.5, 3.0])
@pytest.mark.parametrize('lag', [0, 2])
def test_the_robot_stops_before_what_it_sees(distance: float, lag: int) -> None:
    follower = PathFollower([[0.0, 0.0], [6.0, 0.0]], ROBOT)
    pose = (0.0, 0.0, 0.0)
    waiting = [Velocity()] * lag
    wall = np.stack([np.full(41, distance), np.linspace(-1, 1, 41)], axis=1)
    blocked = False
    for _ in range(200):
        seen = np.array([composed((0, 0, 0), (x - pose[0], y, 0.0))[:2] for x, y in wall])
        guidance = follower.step(pose, seen, PERIOD)
        blocked = guidance.blocked
        waiting.append(guidance.velocity)
        pose = moved(pose, waiting.pop(0))
    assert blocked
    assert ROBOT.radius <= distance - pose[0] <= ROBOT.radius + 0.12
    assert abs(pose[1]) < 1e-6


def at_top_speed() -> PathFollower:
    """Return a follower of a straight path that has come up to speed, at (3, 0)."""
    follower, pose = PathFollower([[0.0, 0.0], [6.0, 0.0]], ROBOT), (0.0, 0.0, 0.0)
    while pose[0] < 3.0:
        pose = moved(pose, follower.step(pose, NOTHING, PERIOD).velocity)
    return follower


AHEAD = np.array([[0.3, y] for y in np.linspace(-0.2, 0.2, 21)])
"""A wall right before the robot, in its own frame."""


@pytest.mark.parametrize('yaw', [0.6, 1.2])
def test_a_robot_that_was_turned_to_a_wall_stops_before_it_turns_back(yaw: float) -> None:
    # Off by 0.6 rad it would drive an arc back to its path, by 1.2 rad turn on the spot first.
    velocity = at_top_speed().step((3.0, 0.0, yaw), AHEAD, PERIOD).velocity
    assert velocity.turn < 0
    assert velocity.speed < 0.15


def test_a_robot_that_halts_before_a_wall_does_not_do_so_gently() -> None:
    assert at_top_speed().halt(NOTHING, PERIOD).speed == pytest.approx(ROBOT.speed, abs=0.1)
    assert at_top_speed().halt(AHEAD, PERIOD).speed < 0.15


def test_what_is_beside_the_way_does_not_stop_the_robot() -> None:
    beside = np.array([[x, side * 0.3] for x in np.arange(-1, 3, 0.05) for side in (-1, 1)])
    assert room_ahead(beside, 0.0, ROBOT.body, ROBOT.margin, 2.0) == 2.0
    follower = PathFollower([[0.0, 0.0], [2.0, 0.0]], ROBOT)
    assert not follower.step((0, 0, 0), beside, PERIOD).blocked


def test_room_ahead_is_measured_along_the_arc() -> None:
    radius, body, margin = 1.0, Footprint(0.15), 0.05
    quarter = np.array([[radius, radius]])
    room = room_ahead(quarter, 1 / radius, body, margin, 3.0)
    assert room == pytest.approx(math.pi / 2 - 0.2, abs=0.05)
    assert room_ahead(quarter, -1 / radius, body, margin, 3.0) == 3.0
    assert room_ahead(NOTHING, 0.3, body, margin, 3.0) == 3.0


def test_a_robot_that_touches_something_may_leave_it() -> None:
    behind = np.array([[-0.2, 0.0]])
    assert room_ahead(behind, 0.0, Footprint(0.22), 0.04, 1.0) == 1.0
    assert room_ahead(-behind, 0.0, Footprint(0.22), 0.04, 1.0) < 0.05


def test_acceleration_and_jerk_keep_their_limits_on_a_free_path() -> None:
    robot = DriveParameters()
    follower = PathFollower([[0, 0], [4, 0]], robot)
    pose, speeds = (0.0, 0.0, 0.0), [0.0]
    for _ in range(200):
        guidance = follower.step(pose, np.zeros((0, 2)), 0.1)
        if guidance.done:
            break
        speeds.append(guidance.velocity.speed)
        pose = (pose[0] + 0.1 * guidance.velocity.speed, 0.0, 0.0)
    assert guidance.done
    assert max(speeds) == pytest.approx(robot.speed, abs=0.01)
    accelerations = np.diff(speeds) / 0.1
    assert np.abs(accelerations).max() <= robot.acceleration + 1e-9
    # Where the wanted speed is met, the acceleration may end within one step.
    assert np.diff(accelerations).max() / 0.1 <= robot.jerk + 1e-6
    assert min(speeds) >= 0.0


@pytest.mark.parametrize(('y', 'slower'), [(-0.2, True), (0.2, False)])
def test_a_robot_that_backs_out_in_an_arc_looks_where_the_arc_leads(y: float, slower: bool) -> None:
    follower = PathFollower([[0.0, 0.0], [3.0, 0.0]], ROBOT)
    backs = Velocity(-0.3, 1.0)  # its back goes to the right
    for _ in range(20):
        guidance = follower.step_with(
            lambda _way, _last: backs, (0.0, 0.0, 0.0), np.array([[-0.28, y]]), PERIOD
        )
    assert (guidance.velocity.speed > -0.28) == slower
