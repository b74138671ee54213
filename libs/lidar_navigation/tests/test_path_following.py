"""Following a path: arrival, limits, the corridor around the path, and stopping for what is
seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidar_navigation import DriveParameters, Footprint, Velocity, geometry
from lidar_navigation.driving.path_following import (
    PathFollower,
    as_forwards,
    room_ahead,
    safe_turn,
    speed_to_stop,
)
from lidar_navigation.geometry import composed

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


STRAIGHT = [[0.0, 0.0], [6.0, 0.0]]
LONG = 10.0
"""A period in which any speed can be reached, seconds."""


def first_step(
    pose: tuple[float, float, float], seen: np.ndarray = NOTHING, limit: float = math.inf
) -> Velocity:
    """Return what is commanded at a pose when acceleration holds nothing back."""
    follower = PathFollower(STRAIGHT, ROBOT)
    follower.limit = limit
    follower.progress = max(0.0, pose[0] - 0.5)
    return follower.step(pose, seen, LONG).velocity


@pytest.mark.parametrize(
    ('x', 'speed'),
    [(3.0, 0.6), (5.3, 0.6), (5.6, 0.4), (5.8, 0.2), (5.91, 0.1), (5.93, 0.0), (6.07, 0.0)],
)
def test_towards_the_end_the_speed_falls_with_the_remaining_way(x: float, speed: float) -> None:
    assert first_step((x, 0.0, 0.0)).speed == pytest.approx(speed)


def test_a_limit_of_the_moment_holds() -> None:
    assert first_step((3.0, 0.0, 0.0), limit=0.25) == Velocity(0.25, 0.0)
    assert first_step((3.0, 0.0, 0.0), limit=0.05) == Velocity(0.05, 0.0)


@pytest.mark.parametrize(('gap', 'speed'), [(0.3, 0.6), (0.25, 0.6), (0.2, 0.48), (0.1, 0.24)])
def test_beside_something_it_drives_slower(gap: float, speed: float) -> None:
    seen = np.array([[0.0, ROBOT.radius + gap]])
    assert first_step((3.0, 0.0, 0.0), seen).speed == pytest.approx(speed)


def test_nothing_makes_it_slower_than_it_creeps() -> None:
    seen = np.array([[0.0, ROBOT.radius + 0.01]])
    assert first_step((3.0, 0.0, 0.0), seen).speed == pytest.approx(0.1)
    assert PathFollower(STRAIGHT, ROBOT).step((0.0, 0.0, 0.0), NOTHING, 0.0).velocity.speed == 0.0


def test_a_tight_arc_is_driven_slower_and_turns_as_pure_pursuit_does() -> None:
    off = 0.3
    velocity = first_step((0.0, -off, 0.0))
    # The point steered to is (0.25, 0): the arc through it has this curvature (Coulter 1992).
    curvature = 2 * off / (0.25**2 + off**2)
    assert velocity.speed == pytest.approx(0.6 / (0.6 * curvature))
    assert velocity.turn == pytest.approx(velocity.speed * curvature)
    wide = first_step((0.0, -0.04, 0.0))
    assert wide.turn == pytest.approx(2 * 0.04 / (0.25**2 + 0.04**2) * wide.speed)
    mirrored = first_step((0.0, off, 0.0))
    assert (mirrored.speed, mirrored.turn) == pytest.approx((velocity.speed, -velocity.turn))


@pytest.mark.parametrize(('yaw', 'turn'), [(1.0, -1.5), (-1.0, 1.5), (0.91, -1.5), (3.0, -1.5)])
def test_what_lies_far_to_the_side_is_turned_to_on_the_spot(yaw: float, turn: float) -> None:
    assert first_step((3.0, 0.0, yaw)) == Velocity(0.0, turn)


@pytest.mark.parametrize(
    ('room', 'deceleration', 'latency'), [(1.0, 0.8, 0.3), (0.3, 2.0, 0.0), (0.0, 1.0, 0.5)]
)
def test_from_the_speed_to_stop_it_stops_within_the_room(
    room: float, deceleration: float, latency: float
) -> None:
    speed = speed_to_stop(room, deceleration, latency)
    way = speed * latency + speed**2 / (2 * deceleration)
    assert way == pytest.approx(room)


@pytest.mark.parametrize('ahead', [0.5, 0.7, 0.9])
def test_what_is_ahead_leaves_the_speed_from_which_it_stops(ahead: float) -> None:
    room = ahead - ROBOT.radius - ROBOT.margin
    expected = min(0.6, speed_to_stop(room, 0.8 * ROBOT.acceleration, 0.3))
    seen = np.array([[ahead, 0.0]])
    gap = ahead - ROBOT.radius
    beside = 0.6 * min(1.0, gap / 0.25)
    assert first_step((3.0, 0.0, 0.0), seen).speed == pytest.approx(min(expected, beside), abs=1e-3)


def walked(seen: np.ndarray, curvature: float, body: Footprint, margin: float) -> float:
    """Return the room ahead in steps of 2 mm, up to 1.5 m."""
    ways = np.arange(0.002, 1.5, 0.002)
    turns = ways * curvature
    x, y = ways, np.zeros_like(ways)
    if curvature:
        x, y = np.sin(turns) / curvature, (1 - np.cos(turns)) / curvature
    gaps = body.gap_at(np.column_stack([x, y, turns]), seen)
    near = (gaps < np.minimum(margin, body.gap(*seen.T) - 1e-3)).any(axis=1)
    return float(ways[np.argmax(near)]) if near.any() else 1.5


@pytest.mark.parametrize('corners', [(), (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)])
@pytest.mark.parametrize('seed', range(4))
def test_room_ahead_is_what_small_steps_find(seed: int, corners: tuple[float, ...]) -> None:
    rng, body = np.random.default_rng(seed), Footprint(0.22, corners)
    for curvature in (0.0, 0.7, -1.6):
        angles = rng.uniform(-3.0, 3.0, 6)
        seen = (rng.uniform(0.6, 1.6, 6) * np.array([np.cos(angles), np.sin(angles)])).T
        found = room_ahead(seen, curvature, body, 0.05, 1.5)
        assert found == pytest.approx(walked(seen, curvature, body, 0.05), abs=0.012)


def test_a_round_robot_may_turn_and_a_long_one_as_fast_as_it_can_stop() -> None:
    long = Footprint(9.0, (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2))
    near = np.array([[0.42, 0.32]])
    # Steps of a thousandth of a radian until the corner is within the margin.
    angles = np.arange(0.0, 1.0, 0.001)
    poses = np.column_stack([np.zeros((1000, 2)), angles])
    room = float(angles[np.argmax(long.gap_at(poses, near)[:, 0] < 0.02)])
    expected = speed_to_stop(room, 3.0, 0.15)
    assert 0.2 < expected < 1.0
    assert safe_turn(1.0, near, long, 0.02, 3.0, 0.15) == pytest.approx(expected, abs=0.03)
    assert safe_turn(-1.0, near * (1, -1), long, 0.02, 3.0, 0.15) == pytest.approx(
        expected, abs=0.03
    )
    assert safe_turn(-1.0, near, long, 0.02, 3.0, 0.15) == 1.0
    assert safe_turn(-0.7, near, Footprint(0.5), 0.02, 3.0, 0.15) == 0.7
    assert safe_turn(0.9, NOTHING, long, 0.02, 3.0, 0.15) == 0.9
    assert safe_turn(0.0, near, long, 0.02, 3.0, 0.15) == 0.0
    assert safe_turn(0.9, near * 2, long, 0.02, 3.0, 0.15) == 0.9


def test_what_drives_backwards_is_turned_round() -> None:
    long = Footprint(9.0, (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2))
    seen = np.array([[1.0, 0.5]])
    same, curvature, body = as_forwards(0.5, 0.2, seen, long)
    assert (same.tolist(), curvature, body) == ([[1.0, 0.5]], 0.4, long)
    turned, curvature, body = as_forwards(-0.5, 0.2, seen, long)
    assert (turned.tolist(), curvature) == ([[-1.0, -0.5]], 0.4)
    assert body.gap(0.31, 0.0) == pytest.approx(0.01), 'its rear is ahead'


@pytest.mark.parametrize(
    ('at', 'clear'), [((1.0, 0.34), True), ((1.0, 0.30), False), ((1.7, 0.0), True)]
)
def test_the_next_part_of_a_path_is_clear_of_obstacles(
    at: tuple[float, float], clear: bool
) -> None:
    follower = PathFollower(STRAIGHT, DriveParameters(radius=0.22))
    assert follower.is_clear(np.array([at]), 0.1, 1.3) is clear
    assert follower.is_clear(NOTHING, 0.1, 1.3)


def test_what_is_near_already_counts_where_the_path_comes_nearer() -> None:
    follower = PathFollower(STRAIGHT, DriveParameters(radius=0.22))
    assert follower.is_clear(np.array([[-0.25, 0.0]]), 0.1, 1.3)
    assert not follower.is_clear(np.array([[0.25, 0.0]]), 0.1, 1.3)


def test_a_path_that_comes_back_past_itself_is_followed_in_its_order() -> None:
    there_and_back = [[0.0, 0.0], [4.0, 0.0], [4.0, 0.1], [0.0, 0.1]]
    follower = PathFollower([*there_and_back, there_and_back[-1]], ROBOT)
    assert len(follower.path) == 4, 'the same point twice is once'
    assert follower.length == pytest.approx(8.1)
    guidance = follower.step((0.5, 0.09, 0.0), NOTHING, PERIOD)
    assert follower.progress == pytest.approx(0.5)
    assert guidance.off_path == pytest.approx(0.09)
    follower.step((0.2, 0.0, 0.0), NOTHING, PERIOD)
    assert follower.progress == pytest.approx(0.5), 'it does not go back'
    one = PathFollower([[1.0, 2.0]], ROBOT)
    guidance = one.step((4.0, 6.0, 0.0), NOTHING, PERIOD)
    assert (guidance.off_path, guidance.done) == (5.0, False)


def test_who_chooses_is_shown_the_way_ahead_in_the_robots_frame() -> None:
    shown: list[np.ndarray] = []

    def choose(way: np.ndarray, last: Velocity) -> Velocity:
        shown.append(way)
        return Velocity(9.0, 9.0)

    follower = PathFollower(STRAIGHT, ROBOT)
    follower.limit = 0.3
    guidance = follower.step_with(choose, (1.0, 0.0, math.pi / 2), NOTHING, LONG)
    assert shown[0] == pytest.approx(np.array([[0.0, -0.1 * n] for n in range(26)]), abs=1e-9)
    assert guidance.velocity == Velocity(0.3, 9.0)
    follower.progress = 5.9
    assert follower.step_with(choose, (5.95, 0.0, 0.0), NOTHING, PERIOD).done
    assert len(shown) == 1
