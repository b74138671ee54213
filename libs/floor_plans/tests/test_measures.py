"""Openings, doors on walls and free points of an edited place."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from floor_plans import Door, Grid, read_place
from floor_plans.editor.measures import (
    door_on_wall,
    fitted_door,
    free_point,
    sides_of,
)
from floor_plans.occupancy_grid import distance_to

SEVEN_ROOMS = Path(__file__).with_name('places') / 'seven_rooms.yaml'


PLAN = read_place(SEVEN_ROOMS).plan


def opening(turn: float = 0.0) -> Grid:
    """Return two rooms with a wall between them at x = 3 that has an opening of 1 m at y = 2."""
    side = 0.02
    y, x = np.mgrid[0:200, 0:300] * side + side / 2
    dx, dy = x - 3.0, y - 2.0
    along, across = (
        -math.sin(turn) * dx + math.cos(turn) * dy,
        math.cos(turn) * dx + math.sin(turn) * dy,
    )
    solid = (np.abs(across) < 0.1) & (np.abs(along) > 0.5)
    solid |= (x < 0.1) | (x > 5.9) | (y < 0.1) | (y > 3.9)
    return Grid(np.where(solid, 100, 0).astype(np.int8), side)


@pytest.mark.parametrize('turn', [0.0, 0.35, -0.5])
def test_an_opening_is_found_from_beside_its_middle(turn: float) -> None:
    x, y = 3.0 - math.sin(turn) * 0.2, 2.0 + math.cos(turn) * 0.2
    door = fitted_door(opening(turn), x, y)
    assert (door.x, door.y) == pytest.approx((3.0, 2.0), abs=0.06)
    assert door.width == pytest.approx(1.0, abs=0.06)
    assert abs(math.remainder(door.yaw - turn - math.pi / 2, math.pi)) < 0.15


def test_where_there_is_no_opening_it_is_said() -> None:
    grid = opening()
    with pytest.raises(ValueError, match=r'\(3\.00, 1\.00\) is not free: expected a point in'):
        fitted_door(grid, 3.0, 1.0)
    open_field = Grid(np.zeros((700, 700), np.int8), 0.02)
    with pytest.raises(ValueError, match=r'no walls within 6 m of \(7\.00, 7\.00\)'):
        fitted_door(open_field, 7.0, 7.0)


def test_a_door_on_a_wall_stays_on_it_with_its_whole_width() -> None:
    wall = next(iter(PLAN.walls.values()))
    (x1, y1), (x2, y2) = wall.start, wall.end
    dx, dy = (x2 - x1) / wall.length, (y2 - y1) / wall.length
    beside = (x1 + 2.0 * dx - 0.3 * dy, y1 + 2.0 * dy + 0.3 * dx)
    alone = replace(PLAN, walls={'w': wall})
    door = door_on_wall(alone, *beside, 0.9)
    assert (door.x, door.y, door.width) == pytest.approx((x1 + 2.0 * dx, y1 + 2.0 * dy, 0.9))
    assert door.yaw == pytest.approx(math.atan2(dy, dx))
    at_its_end = door_on_wall(alone, x1 + 0.1 * dx, y1 + 0.1 * dy, 0.9)
    assert (at_its_end.x, at_its_end.y) == pytest.approx((x1 + 0.45 * dx, y1 + 0.45 * dy))
    at_its_other = door_on_wall(alone, x2, y2, 0.9)
    assert (at_its_other.x, at_its_other.y) == pytest.approx((x2 - 0.45 * dx, y2 - 0.45 * dy))
    middle = (x1 + x2) / 2, (y1 + y2) / 2
    assert door_on_wall(alone, *middle, wall.length).width == wall.length
    for far, width in ((1.01, 0.9), (0.3, wall.length + 0.1)):
        with pytest.raises(ValueError, match='m or more within 1 m of'):
            door_on_wall(alone, x1 + 2.0 * dx - far * dy, y1 + 2.0 * dy + far * dx, width)
    assert door_on_wall(alone, x1 + 2.0 * dx - 0.99 * dy, y1 + 2.0 * dy + 0.99 * dx, 0.9)


def test_a_door_leads_into_the_part_beside_it_or_else_the_nearest() -> None:
    grid = Grid(np.zeros((100, 100), np.int8), 0.05)
    west, east = np.zeros((100, 100), np.bool_), np.zeros((100, 100), np.bool_)
    west[:, :48], east[:, 80:] = True, True
    door = Door('D', 2.5, 2.5, math.pi / 2, 0.9)  # at x = 2.5, so it leads along x
    assert sides_of(door, {'e': east, 'w': west}, grid) == 'w'
    far = Door('D', 3.3, 2.5, math.pi / 2, 0.9)
    assert sides_of(far, {'e': east, 'w': west}, grid) == 'e', '0.7 m to the east, 0.9 to the west'
    assert sides_of(Door('D', 3.1, 2.5, 0.0, 0.9), {'e': east, 'w': west}, grid) == 'w'


def test_a_free_point_is_in_the_largest_part_that_the_robot_fits_into() -> None:
    cells = np.full((60, 100), 100, np.int8)
    cells[5:55, 5:30] = cells[5:55, 34:95] = 0
    cells[28:31, 30:34] = 0  # too narrow for the robot
    grid = Grid(cells, 0.05)
    room = grid.free
    x, y = free_point(grid, room, 0.3)
    assert 34 * 0.05 + 0.3 < x < 95 * 0.05 - 0.3
    row, column = grid.cell_of(x, y)
    assert distance_to(~grid.free, 0.05)[row, column] > 0.3
    with pytest.raises(ValueError, match=r'a robot of 3 m has no room in one of the parts'):
        free_point(grid, room, 1.5)
