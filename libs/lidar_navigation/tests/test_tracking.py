"""Bodies in the lidar's points: told apart, followed, and known to move or to stand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation.geometry import Points
from lidar_navigation.localisation.tracking import Tracker

ROBOT = (0.0, 0.0, 0.0)
NOISE = np.random.default_rng(3)


def body(x: float, y: float, radius: float = 0.25) -> Points:
    """Return the near half of a round body, as a lidar at the origin sees it at one degree a
    ray.
    """
    away, bearing = math.hypot(x, y), math.atan2(y, x)
    half = math.asin(radius / away)
    angles = np.arange(bearing - half, bearing + half, math.radians(1))[1:]
    off = angles - bearing
    ranges = away * np.cos(off) - np.sqrt(np.maximum(radius**2 - (away * np.sin(off)) ** 2, 0))
    ranges += NOISE.normal(0, 0.01, len(ranges))
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)


def test_somebody_who_walks_is_followed_with_their_velocity() -> None:
    tracker = Tracker()
    for step in range(20):
        tracker.update(ROBOT, body(3.0, -1.2 + 0.12 * step), 0.1 * step)
    (mover,) = tracker.movers
    assert (mover.x, mover.y) == pytest.approx((3.0, 1.08), abs=0.12)
    assert (mover.vx, mover.vy) == pytest.approx((0.0, 1.2), abs=0.3)
    assert mover.radius == pytest.approx(0.25, abs=0.06)


def test_two_who_cross_each_other_s_way_stay_two() -> None:
    tracker = Tracker()
    for step in range(15):
        left, right = body(2.0, 1.5 - 0.1 * step), body(3.5, -1.5 + 0.1 * step)
        tracker.update(ROBOT, np.concatenate([right, left]), 0.1 * step)
    assert sorted(round(mover.vy) for mover in tracker.movers) == [-1, 1]


def test_what_stands_does_not_move_however_the_lidar_trembles() -> None:
    tracker = Tracker()
    for step in range(50):
        points = body(2.0, 0.5)
        tracker.update(ROBOT, points, 0.1 * step)
        assert tracker.movers == []
    assert not tracker.may_move(points).any()


def test_what_is_new_may_move() -> None:
    tracker = Tracker()
    points = body(2.0, 0.5)
    tracker.update(ROBOT, points, 0.0)
    assert tracker.may_move(points).all()


def test_somebody_who_stops_stands_after_a_while() -> None:
    tracker = Tracker()
    for step in range(40):
        tracker.update(ROBOT, body(2.0, min(0.1 * step, 1.0)), 0.1 * step)
    assert tracker.movers == []


def test_a_wall_that_the_map_lacks_is_nobody() -> None:
    tracker = Tracker()
    for step in range(20):
        wall = np.stack([np.full(40, 2.0 - 0.1 * step), np.linspace(-1, 1, 40)], axis=1)
        tracker.update(ROBOT, wall, 0.1 * step)
    assert tracker.movers == []


def test_who_is_out_of_sight_is_forgotten() -> None:
    tracker = Tracker()
    for step in range(10):
        tracker.update(ROBOT, body(2.0, -0.5 + 0.1 * step), 0.1 * step)
    assert tracker.movers
    for step in range(10, 20):
        tracker.update(ROBOT, np.zeros((0, 2)), 0.1 * step)
    assert tracker.movers == []


def pair(x: float, width: float = 0.2) -> Points:
    """Return the two ends of what is so wide and stands straight ahead."""
    return np.array([[x, -width / 2], [x, width / 2]])


AHEAD = math.pi / 4 * 0.2
"""The middle of a round body of 0.2 m lies so far behind what is seen of it."""


def test_a_body_is_followed_as_an_alpha_beta_filter_does() -> None:
    tracker = Tracker()
    at, velocity, first, since = 2.0 + AHEAD, 0.0, 2.0 + AHEAD, -math.inf
    tracker.update(ROBOT, pair(2.0), 0.0)
    for step in range(1, 30):
        # It walks for a second and a half, and stands from then on.
        now, seen = 0.1 * step, 2.0 + 0.08 * min(step, 15) + AHEAD
        tracker.update(ROBOT, pair(seen - AHEAD), now)
        at += velocity * 0.1
        off = seen - at
        at, velocity = at + 0.5 * off, velocity + 0.15 / 0.1 * off
        if abs(velocity) >= 0.3 and abs(at - first) >= 0.2:
            since = now
        elif abs(velocity) < 0.3:
            first = at
        if now - since > 1.0 + 1e-9:
            assert tracker.movers == []
        elif now - since < 1.0 - 1e-9:
            (mover,) = tracker.movers
            assert (mover.x, mover.y) == pytest.approx((at, 0.0))
            assert (mover.vx, mover.vy) == pytest.approx((velocity, 0.0))
            assert mover.radius == pytest.approx(0.2)
    assert since > 1.0


@pytest.mark.parametrize(
    ('points', 'found'),
    [
        (pair(2.0), True),
        (pair(4.95), True),
        (pair(5.05), False),
        (np.array([[2.0, 0.0]]), False),
        (np.vstack([pair(2.0, 0.6), [[2.0, 0.0], [2.0, 0.29]]])[[0, 2, 3]], True),
        (np.array([[2.0, -0.29], [2.0, 0.0], [2.0, 0.29]]), True),
        (np.array([[2.0, -0.31], [2.0, 0.0], [2.0, 0.31]]), False),
        (np.array([[2.0, y] for y in np.linspace(-0.32, 0.32, 9)]), True),
        (np.array([[2.0, y] for y in np.linspace(-0.34, 0.34, 9)]), False),
    ],
)
def test_a_body_is_two_points_or_more_together_and_no_wider_than_a_person(
    points: Points, found: bool
) -> None:
    tracker = Tracker()
    tracker.update(ROBOT, points, 0.0)
    assert tracker.may_move(points).any() == found


def test_nobody_knows_for_half_a_second_whether_a_new_body_moves() -> None:
    tracker = Tracker()
    around = np.array([[2.0 + AHEAD, away] for away in (0.0, 0.34, 0.36)])
    for step in range(5):
        tracker.update(ROBOT, pair(2.0), 0.1 * step)
        assert tracker.may_move(around).tolist() == [True, True, False]
    tracker.update(ROBOT, pair(2.0), 0.51)
    assert not tracker.may_move(around).any()
    # What is found more than half a metre away is another one, and new.
    tracker.update(ROBOT, pair(2.51), 0.6)
    assert tracker.may_move(pair(2.51)).all()
    assert tracker.movers == []
    near = Tracker()
    for step in range(6):
        near.update(ROBOT, pair(2.0), 0.11 * step)
    near.update(ROBOT, pair(2.49), 0.66)
    assert len(near.movers) == 1, 'the same one, that is fast now'


def test_a_body_behind_the_robot_is_one_though_the_first_ray_looks_there() -> None:
    tracker = Tracker()
    cut_in_two = np.array([[-2.0, -0.1], [-2.0, -0.2], [3.0, 3.0], [-2.0, 0.1], [-2.0, 0.0]])
    tracker.update(ROBOT, cut_in_two, 0.0)
    assert tracker.may_move(np.array([[-2.0 - AHEAD, -0.05]])).all()
    assert not tracker.may_move(np.array([[3.0, 3.0]])).any()
    away = np.array([[-2.0 - AHEAD, -0.45]])
    assert not tracker.may_move(away).any(), 'one body with its middle at -0.05 m'


@pytest.mark.parametrize(('silent', 'kept'), [(0.6, True), (0.8, False)])
def test_a_body_out_of_sight_is_followed_for_a_while(silent: float, kept: bool) -> None:
    tracker = Tracker()
    for step in range(10):
        tracker.update(ROBOT, pair(2.0 + 0.1 * step), 0.1 * step)
    assert tracker.movers
    for step in range(1, 1 + round(silent / 0.1)):
        tracker.update(ROBOT, np.zeros((0, 2)), 0.9 + 0.1 * step)
    assert bool(tracker.movers) is kept
    tracker.update(ROBOT, pair(2.0), 0.9 + silent + 0.75)
    assert tracker.movers == [], 'after a pause all is new'
