"""The map of another program, and where that has the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import ForeignMap
from lidar_navigation.geometry import Scan


def test_a_foreign_map_is_due_once_and_says_what_is_missing() -> None:
    foreign = ForeignMap()
    scan = Scan(np.zeros(1), np.ones(1), 8.0)
    assert foreign.missing == 'map'
    assert foreign.pose((1.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    grid = Grid(np.zeros((4, 4), np.int8), 0.1)
    foreign.take_map(grid)
    assert foreign.missing == 'the transform from map to odom'
    assert not foreign.is_due((0.0, 0.0, 0.0))
    assert not foreign.see(scan, (1.0, 0.0, 0.0))
    foreign.take_correction((5.0, 0.0, math.pi / 2))
    assert foreign.missing == ''
    assert foreign.is_due((0.0, 0.0, 0.0))
    assert foreign.see(scan, (1.0, 0.0, 0.0))
    assert foreign.start == pytest.approx((5.0, 1.0, math.pi / 2))
    assert foreign.grid() is grid
    assert not foreign.is_due((0.0, 0.0, 0.0))
    assert not foreign.see(scan, (2.0, 0.0, 0.0))
    foreign.take_map(grid)
    assert foreign.see(scan, (2.0, 0.0, 0.0))
    assert foreign.start == pytest.approx((5.0, 1.0, math.pi / 2)), 'the first one'
    assert foreign.pose((2.0, 0.0, 0.0)) == pytest.approx((5.0, 2.0, math.pi / 2))
