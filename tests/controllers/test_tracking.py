"""Bodies in the lidar's points: told apart, followed, and known to move or to stand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_controllers.geometry import Points
from surveillance_controllers.motion.tracking import Tracker

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
