"""What is in view from a point ends at walls, at the reach and at the sides of a camera's view."""

from __future__ import annotations

import math

import numpy as np

from floor_plans import Grid
from floor_plans.visibility import in_view


def hall() -> Grid:
    """Return 4 m x 2 m of free floor with a wall of one metre across it at x = 2 m."""
    cells = np.zeros((20, 40), np.int8)
    cells[:10, 20] = 100
    return Grid(cells, 0.1)


def test_a_wall_hides_what_is_behind_it():
    seen = in_view(hall(), (1.05, 0.55), 10.0)
    assert seen[5, 19]
    assert not seen[5, 20:].any()
    assert seen[19, 21]  # past its end
    assert seen[:, :20].all()


def test_no_cell_within_reach_is_missed_and_none_beyond_is_seen():
    grid = Grid(np.zeros((200, 200), np.int8), 0.1)
    seen = in_view(grid, (10.05, 10.05), 6.0)
    rows, columns = np.mgrid[0:200, 0:200]
    away = np.hypot(rows - 100, columns - 100) * 0.1
    assert seen[away < 5.85].all()
    assert not seen[away > 6.1].any()


def test_a_camera_shows_its_part_of_the_horizon():
    seen = in_view(hall(), (1.05, 1.05), 3.0, ahead=math.pi / 2, angle=math.pi / 2)
    assert seen[15, 10]
    assert not seen[5, 10]
    assert not seen[10, 5]
    assert not in_view(hall(), (9.0, 9.0), 3.0).any()  # off the map
