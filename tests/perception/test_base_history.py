"""Where the base was: poses of the localisation, and the odometry between them."""

from __future__ import annotations

import pytest

from surveillance_perception.observing.base_history import BaseHistory


def driven(until: float = 1.0) -> BaseHistory:
    """Return a base that drives a metre a second along x; its odometry began elsewhere."""
    base = BaseHistory()
    for tick in range(-20, round(10 * until) + 1):
        stamp = 10.0 + tick / 10
        base.take_odometry(stamp, stamp, (tick / 10, 0.0, 0.0))
        base.take_pose(stamp, (tick / 10, 5.0, 0.0), stamp)
    return base


def test_between_two_poses_it_went_as_its_odometry_says():
    assert driven().at(10.75) == pytest.approx((0.75, 5.0, 0.0))
    assert driven().at(11.0) == pytest.approx((1.0, 5.0, 0.0))


def test_nobody_knows_what_is_ahead_long_ago_or_before_the_first_pose():
    base = driven()
    assert base.at(11.2) is None
    assert base.at(8.5) is None
    assert BaseHistory().at(10.0) is None
    assert not BaseHistory().is_localised


def test_in_passing_the_odometry_alone_tells():
    assert driven().passing(9.55) == pytest.approx((-0.45, 5.0, 0.0))
    assert driven().passing(20.0) is None


def test_it_stood_where_neither_pose_nor_odometry_moved():
    base = driven()
    assert base.stood(10.0, 10.5) is None
    for tick in range(11, 31):
        base.take_odometry(10.0 + tick / 10, 10.0 + tick / 10, (1.0, 0.0, 0.0))
    assert base.stood(11.5, 12.5) == pytest.approx((1.0, 5.0, 0.0))
    assert base.covers(10.0, 12.5)
    assert not base.covers(10.0, 14.0)
