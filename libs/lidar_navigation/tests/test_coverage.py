"""A floor is seen from few viewpoints, in the order of a short way; what was seen is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation.coverage import FloorSweep, PlaceFloors, SeenFloor, SweepPlanner, coarse

START = 0.5, 0.5


def warehouse() -> Grid:
    """Return 12 m x 8 m of floor with two shelves, so that it has three aisles."""
    cells = np.full((164, 244), 100, np.int8)
    cells[2:-2, 2:-2] = 0
    for south in (44, 98):
        cells[south : south + 22, 42:202] = 100
    return Grid(cells, 0.05, (-0.1, -0.1))


@pytest.fixture
def planner() -> SweepPlanner:
    return SweepPlanner(coarse(warehouse()), 0.22, 4.0)


def test_a_sweep_shows_the_aisles_by_a_way_not_much_longer_than_they_are(planner):
    floor = SeenFloor(warehouse(), 4.0)
    cells = planner.reachable(floor.grid.free, START)
    stops = planner.sweep(cells, START, cells)
    for stop in stops:
        floor.see(stop, 0.0, 5.0)
    assert (floor.seen_since(5.0) & cells).sum() >= 0.95 * cells.sum()
    # Back and forth through three aisles of 12 m, and across.
    assert planner.metres(START, stops) <= 3 * 12.0 + 2 * 3.0
    assert all(math.hypot(*np.subtract(a, b)) > 0.5 for a in stops for b in stops if a != b)


def test_what_was_seen_on_the_way_is_not_driven_to(planner):
    floor = SeenFloor(warehouse(), 4.0)
    cells = planner.reachable(floor.grid.free, START)
    sweep = FloorSweep(floor, planner, cells, since=10.0)
    here, stops = START, []
    while (stop := sweep.next_stop(here)) is not None:
        for part in np.linspace(0.0, 1.0, 20):
            x, y = np.asarray(here) * (1 - part) + np.asarray(stop) * part
            if floor.grid.at(floor.grid.free, x, y):
                floor.see((x, y), 0.0, 20.0)
        here = stop
        stops.append(stop)
        assert len(stops) < 40
    assert len(stops) <= len(planner.sweep(cells, START, cells))
    assert sweep.left.sum() <= 0.05 * cells.sum()
    assert FloorSweep(floor, planner, cells, since=20.0).next_stop(here) is None
    assert FloorSweep(floor, planner, cells, since=30.0).next_stop(here) is not None


def test_a_stop_that_cannot_be_reached_is_left_out_with_what_it_shows(planner):
    floor = SeenFloor(warehouse(), 4.0)
    cells = planner.reachable(floor.grid.free, START)
    sweep = FloorSweep(floor, planner, cells, since=0.0)
    tried = 0
    while (stop := sweep.next_stop(START)) is not None:
        sweep.leave_out(stop)
        tried += 1
        assert tried < 40
    assert sweep.left.sum() < 0.2 * cells.sum()


def test_the_part_of_each_place_that_was_in_view_within_a_time_of_its_own():
    grid = Grid(np.zeros((40, 80), np.int8), 0.1)
    west = np.zeros(grid.cells.shape, np.bool_)
    west[:, :40] = True
    floor = SeenFloor(grid, 100.0, camera=(100.0, math.pi / 2))
    places = PlaceFloors(floor.grid, {'A': west, 'B': ~west, 'none': west & ~west})
    floor.see((4.05, 2.05), 0.0, 7.0)  # in the middle, looking east
    fractions = places.fractions(floor, {'A': 5.0, 'B': 8.0, 'none': 0.0})
    assert fractions.keys() == {'A', 'B'}
    assert fractions['A'].seen == 1.0
    assert fractions['A'].area == pytest.approx(16.0)
    assert fractions['A'].shown < 0.01
    assert fractions['A'].counted == fractions['A'].shown
    assert fractions['B'].seen == 0.0
    shown = places.fractions(floor, {'A': 5.0, 'B': 5.0, 'none': 0.0})['B'].shown
    assert 0.6 < shown < 0.9
    assert places.of('none') is None
    assert places.of('nowhere') is None


def test_a_camera_is_turned_to_what_is_not_shown_yet(planner):
    floor = SeenFloor(warehouse(), 4.0, camera=(4.0, math.pi / 2))
    cells = planner.reachable(floor.grid.free, START)
    stop = planner.sweep(cells, START, cells)[0]
    bearings = planner.bearings(stop, cells, math.pi / 2)
    assert bearings
    for bearing in bearings:
        floor.see(stop, bearing, 1.0)
    left = cells & ~floor.seen_since(1.0, camera=True)
    assert planner.bearings(stop, left, math.pi / 2) == []


def test_a_coarse_map_keeps_walls_and_what_is_unknown():
    cells = np.zeros((5, 6), np.int8)
    cells[0, 0], cells[4, 5] = 100, -1
    found = coarse(Grid(cells, 0.05))
    assert found.resolution == pytest.approx(0.1)
    assert found.cells.tolist() == [[100, 0, 0], [0, 0, 0], [-1, -1, -1]]
    assert coarse(found) is found
    # Nobody stands anywhere: nothing to drive to, and no error.
    blocked = Grid(np.full((10, 10), 100, np.int8), 0.1)
    nothing = SweepPlanner(blocked, 0.2, 4.0)
    assert nothing.sweep(blocked.free, (0.0, 0.0), blocked.free) == []
