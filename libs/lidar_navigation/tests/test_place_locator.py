"""Which place a point belongs to: rooms divided by doors, rooms without a place, shared rooms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import PlaceLocator
from lidar_navigation.localisation.place_locator import PlaceRegions, _stretched

SIDE = 0.05
DOORS = {'D1': (2.0, 0.5, 2.0, 1.5), 'D2': (4.0, 1.5, 4.0, 0.5)}
"""Of three rooms of 2 m x 2 m beside each other, with walls of one cell between them."""
POINTS = {'A': (1.0, 1.0, 0.0), 'B': (3.0, 1.0, 0.0), 'C': (5.0, 1.5, 0.0)}


@pytest.fixture(scope='module')
def grid() -> Grid:
    y, x = np.mgrid[0:40, 0:120] * SIDE + SIDE / 2
    wall = (np.abs(x - 2.0) < SIDE) | (np.abs(x - 4.0) < SIDE)
    wall &= (y < 0.5) | (y > 1.5)
    cells = np.where(wall, 100, 0).astype(np.int8)
    return Grid(cells, SIDE, (0.0, 0.0))


def test_each_point_is_in_the_room_around_it(grid: Grid) -> None:
    regions = PlaceRegions(grid, DOORS.values(), POINTS)
    for x in np.arange(0.05, 6.0, 0.1):
        for y in (0.05, 0.7, 1.0, 1.3, 1.95):
            if min(abs(x - 2.0), abs(x - 4.0)) > 2.5 * SIDE:
                assert regions.place_at((x, y)) == 'ABC'[int(x / 2)], (x, y)
    assert regions.place_at((-0.1, 1.0)) is None
    assert regions.place_at((1.0, math.inf)) is None


def test_a_room_without_a_place_belongs_to_the_nearest_one_through_doors(grid: Grid) -> None:
    ends = {name: POINTS[name] for name in 'AC'}
    regions = PlaceRegions(grid, DOORS.values(), ends)
    assert regions.place_at((2.5, 1.0)) == 'A'
    assert regions.place_at((3.5, 1.0)) == 'C', 'both are one door away: the nearer point'
    first = PlaceRegions(grid, DOORS.values(), {'A': POINTS['A']})
    assert first.place_at((5.0, 1.0)) == 'A', 'two doors away'
    middle_and_last = PlaceRegions(grid, DOORS.values(), {name: POINTS[name] for name in 'BC'})
    assert middle_and_last.place_at((0.1, 0.1)) == 'B'
    assert PlaceRegions(grid, [DOORS['D1']], {'A': (9.0, 9.0)}).place_at((5.0, 1.0)) is None


def test_the_cells_of_a_place_are_those_nearest_to_its_point(grid: Grid) -> None:
    regions = PlaceRegions(grid, [DOORS['D1']], POINTS)  # B and C are one room
    rows, columns = np.indices(grid.cells.shape)
    x, y = (columns + 0.5) * SIDE, (rows + 0.5) * SIDE
    to_b, to_c = (np.hypot(x - POINTS[name][0], y - POINTS[name][1]) for name in 'BC')
    free = grid.free
    found = {name: regions.cells_of(name) for name in 'ABC'}
    a, b, c = found['A'], found['B'], found['C']
    assert a is not None
    assert b is not None
    assert c is not None
    away = np.abs(x - 2.0) > 0.1
    assert np.array_equal(a & away, free & (x < 2.0) & away)
    assert np.array_equal(b & away, free & (x > 2.0) & (to_b <= to_c) & away)
    assert np.array_equal(c & away, free & (x > 2.0) & (to_c <= to_b) & away)
    assert regions.cells_of('Z') is None
    assert PlaceRegions(grid, [], {'A': (90.0, 1.0)}).cells_of('A') is None


def test_a_door_in_a_slanted_wall_is_closed_beyond_both_its_ends() -> None:
    assert _stretched((1.0, 2.0, 4.0, 6.0), 0.5) == pytest.approx((0.7, 1.6, 4.3, 6.4))
    assert _stretched((4.0, 6.0, 1.0, 2.0), 0.5) == pytest.approx((4.3, 6.4, 0.7, 1.6))
    assert _stretched((1.0, 2.0, 1.0, 2.0), 0.5) == (1.0, 2.0, 1.0, 2.0)


def test_the_places_are_known_once_there_are_a_map_and_points(grid: Grid) -> None:
    locator = PlaceLocator(iter(DOORS.values()))
    assert (locator.is_known, locator.place_at((1.0, 1.0)), locator.cells_of('A')) == (
        False,
        None,
        None,
    )
    locator.set_positions({})
    locator.set_map(grid)
    assert not locator.is_known
    locator.set_positions(POINTS)
    assert locator.is_known
    assert locator.place_at((3.0, 1.0)) == 'B'
    cells = locator.cells_of('B')
    assert cells is not None
    assert cells.sum() * SIDE**2 == pytest.approx(4.0, abs=0.3)
    moved = Grid(grid.cells, SIDE, (10.0, 0.0))
    locator.set_map(moved)
    assert locator.place_at((3.0, 1.0)) is None
    locator.set_positions({'Z': (11.0, 1.0)})
    assert locator.place_at((11.5, 1.0)) == 'Z'
