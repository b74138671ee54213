"""Where base and arm stood when a picture was taken, by its stamp alone."""

from __future__ import annotations

import math

import pytest

from surveillance_runtime.stamped_readings import SAME_TIME, OdometryStamps, StampedReadings


@pytest.fixture
def driven() -> StampedReadings:
    """Return a base that stands at 0 until 2 s, drives for 2 s, and stands at 1 m until 9 s."""
    readings = StampedReadings(angles=[2])
    for tick in range(91):
        stamp = tick / 10
        readings.add(stamp, (min(max(stamp / 2 - 1, 0.0), 1.0), 0.0, 0.0))
    return readings


@pytest.mark.parametrize(
    ('first', 'last', 'at'),
    [
        (0.5, 1.5, 0.0),
        (4.5, 4.5, 1.0),
        (5.0, 9.1, 1.0),
        (1.5, 2.5, None),
        (3.0, 3.0, None),
        (1.0, 8.0, None),
        (3.5, 5.0, None),
        (8.0, 9.9, None),
        (-1.0, 1.0, None),
    ],
)
def test_it_is_known_where_it_stood_all_the_time_and_nothing_else(driven, first, last, at):
    found = driven.stood(first, last)
    assert found == (None if at is None else (at, 0.0, 0.0))


def test_a_silence_and_a_clock_that_is_set_back_leave_nothing_known(driven):
    driven.add(19.0, (1.0, 0.0, 0.0))
    assert driven.stood(8.0, 18.0) is None
    driven.add(-100.0, (1.0, 0.0, 0.0))
    assert driven.stood(8.0, 8.0) is None
    driven.add(-99.9, (1.0, 0.0, 0.0))
    assert driven.stood(-100.0, -99.8) is not None


def test_times_that_come_once_more_tell_nothing_of_before(driven):
    """A clock that is set back by seconds: it stands at 1 m, and stood at 0 by the same stamps."""
    for tick in range(10):
        driven.add(1.0 + tick / 10, (1.0, 0.0, 0.0))
    assert driven.stood(1.1, 1.8) == (1.0, 0.0, 0.0)
    assert driven.stood(0.5, 0.9) is None


def test_one_stamp_of_the_future_makes_nobody_blind(driven):
    driven.add(39.0, (1.0, 0.0, 0.0))
    for tick in range(10):
        driven.add(9.1 + tick / 10, (1.0, 0.0, 0.0))
    assert driven.stood(9.2, 10.0) == (1.0, 0.0, 0.0)


def test_a_robot_that_faces_backwards_does_not_turn_around_for_a_sign():
    readings = StampedReadings(angles=[2])
    for tick in range(20):
        readings.add(tick / 10, (0.0, 0.0, math.pi * (-1) ** tick))
    assert readings.stood(0.0, 1.9) is not None


def test_readings_of_a_drive_of_hours_are_bounded():
    readings = StampedReadings()
    for tick in range(20_000):
        readings.add(tick / 10, (float(tick),))
    assert len(readings._rests) <= 601


def test_it_is_known_of_which_times_readings_tell_whether_it_moved_or_not(driven):
    assert driven.covers(3.0, 3.0)
    assert driven.covers(1.5, 9.1)
    assert not driven.covers(-1.0, 1.0)
    assert not driven.covers(8.0, 9.5)
    driven.add(19.0, (1.0, 0.0, 0.0))
    assert not driven.covers(8.0, 18.0)
    assert driven.covers(4.5, 8.0)
    assert driven.covers(19.0, 19.1)
    assert not StampedReadings().covers(0.0, 0.0)


def test_odometry_belongs_to_a_pose_with_either_of_its_stamps_the_latest_first() -> None:
    odometry = OdometryStamps[str](4)
    odometry.add('before', 9.99, 9.99)
    odometry.add('now', 10.0, 70.0)
    assert odometry.at(10.0 - SAME_TIME / 4) == odometry.at(70.0) == 'now'
    assert odometry.at(9.99 - 0.75 * SAME_TIME) == 'before'
    assert odometry.at(10.0 + 2 * SAME_TIME) is None
    for later in (20.0, 30.0):
        odometry.add('later', later, later + 60.0)
    assert odometry.at(10.0) is None
