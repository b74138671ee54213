"""The flat's lidar sees the walls where they are, and what is put into its way."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation.testing import Flat


def ahead(flat: Flat, **more: object) -> float:
    """Return how far it is along y = 1.5 from x = 2.0, metres."""
    scan = flat.scan((2.0, 1.5, 0.0), **more)  # type: ignore[arg-type]
    return float(scan.ranges[int(np.argmin(np.abs(scan.angles)))])


def test_a_ray_through_the_door_ends_at_the_far_wall_a_shut_door_or_an_obstacle(flat: Flat) -> None:
    assert ahead(flat) == pytest.approx(7.1 - 2.0, abs=0.08)
    assert ahead(flat, closed=True) == pytest.approx(4.05 - 2.0, abs=0.08)
    assert ahead(flat, obstacles=[(3.0, 1.5, 0.2)]) == pytest.approx(0.8, abs=0.08)


def test_what_is_beyond_the_lidar_s_reach_is_infinite(flat: Flat) -> None:
    flat.grid.cells[:] = 0
    assert set(flat.scan((2.0, 1.5, 0.0)).ranges) == {math.inf}
