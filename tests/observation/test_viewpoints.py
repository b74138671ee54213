"""Viewpoints: rooms of the project's places, and a corner that one point does not show."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surveillance_controllers.motion.place_locator import PlaceRegions
from surveillance_perception.observation.hung_markers import HungSpot
from surveillance_perception.observation.marker_checks import MarkerChecks
from surveillance_perception.observation.viewpoints import ENOUGH, Viewpoints
from surveillance_perception.observation.watch_rules import rule_from
from surveillance_runtime.place.description import read_place_file
from surveillance_runtime.place.occupancy_grid import Grid
from surveillance_runtime.place.plan_grid import draw

CONFIG = Path(__file__).parents[2] / 'config'


def corner() -> Grid:
    """Return a room of the shape of an L, 8 by 8 metres, with arms 2.5 m wide."""
    cells = np.full((170, 170), 100, np.int8)
    cells[5:165, 5:55] = 0
    cells[5:55, 5:165] = 0
    return Grid(cells, 0.05)


def test_around_a_corner_a_second_viewpoint_shows_the_rest():
    grid = corner()
    chosen = Viewpoints(grid, 0.22)
    first = (1.5, 7.0)
    assert (chosen.seen_from(first) & grid.free).sum() < 0.7 * grid.free.sum()
    spots = chosen.of_room(grid.free, first)
    assert 1 <= len(spots) <= 2
    seen = np.logical_or.reduce([chosen.seen_from(each) for each in [first, *spots]]) & grid.free
    assert seen.sum() >= ENOUGH * grid.free.sum()
    # Beams never pass walls.
    assert not (seen & grid.occupied).any()


def test_a_plain_room_needs_no_second_viewpoint_and_a_check_in_it_brings_one():
    cells = np.full((130, 130), 100, np.int8)
    cells[5:125, 5:125] = 0
    grid = Grid(cells, 0.05)
    chosen = Viewpoints(grid, 0.22)
    assert chosen.of_room(grid.free, (2.5, 2.5)) == []
    (spot,) = chosen.of_room(grid.free, (2.5, 2.5), [(6.2, 6.0)])
    assert math.dist(spot, (6.2, 6.0)) <= 3.0


def test_a_second_look_is_from_another_side():
    grid = corner()
    spot = Viewpoints(grid, 0.22).aside(grid.free, (1.5, 4.0), (1.5, 6.0))
    assert spot is not None
    assert math.dist(spot, (1.5, 6.0)) >= 1.0
    before, now = (math.atan2(y - 4.0, x - 1.5) for x, y in ((1.5, 6.0), spot))
    assert abs(math.remainder(now - before, math.tau)) > math.radians(60.0)


@pytest.mark.parametrize('name', ['patrol_world'])
def test_the_rooms_of_a_place_are_covered(name: str):
    place = read_place_file(CONFIG / f'{name}.yaml')
    plan, points = place.plan, place.place.positions
    grid = draw(plan)
    regions = PlaceRegions(grid, [each.segment for each in plan.doors.values()], points)
    chosen = Viewpoints(grid, 0.22)
    for room, point in points.items():
        floor = regions.cells_of(room)
        assert floor is not None
        first = float(point[0]), float(point[1])
        spots = [first, *chosen.of_room(floor, first)]
        seen = np.logical_or.reduce([chosen.seen_from(each) for each in spots]) & floor
        assert seen.sum() >= 0.9 * floor.sum(), room


def test_a_marker_is_looked_at_from_ahead_and_near_enough_to_be_read():
    grid = corner()
    chosen, first = Viewpoints(grid, 0.22), (1.5, 7.0)
    # On the outer wall of the lower arm, looking upwards.
    panel, facing = (6.0, 0.3), math.pi / 2
    spot = chosen.of_panel(grid.free, first, panel, facing)
    assert spot is not None
    assert 0.8 <= math.dist(spot, panel) <= 2.2
    turn = math.atan2(spot[1] - panel[1], spot[0] - panel[0]) - facing
    assert abs(turn) < math.radians(45.0)
    assert not chosen.seen_from(first)[grid.cell_of(*spot)], 'around the corner'
    assert chosen.of_panel(grid.free, (6.0, 1.8), panel, facing) == (6.0, 1.8), 'its point will do'
    assert chosen.of_panel(grid.free, first, panel, -facing) is None, 'behind the wall'
    near = chosen.of_panel(grid.free, first, panel, facing, scale=0.5)
    assert near is not None
    assert math.dist(near, panel) <= 1.1
    assert chosen.of_panel(grid.free, first, panel, None) is not None


def test_a_marker_is_looked_at_from_the_same_point_while_it_can_be_read_from_there():
    grid = corner()
    rooms: Any = SimpleNamespace(cells_of=lambda _: grid.free, place_at=lambda _: 'R1')
    checks = MarkerChecks([rule_from({'marker': 'all'})], rooms, {'R1': (1.5, 7.0)})
    checks.use(Viewpoints(grid, 0.22))
    at = 6.0, 0.3, 1.0
    # Read in passing from the left it seems to face there, which is wrong by a radian.
    (first,) = checks.of([HungSpot(21, at, math.pi / 2 + 1.0, 0.2)])
    assert first.look_from is not None
    (again,) = checks.of([HungSpot(21, (6.05, 0.28, 1.0), math.pi / 2 + 0.2, 0.2)])
    assert again == first, 'how it looks from there is known'
    (other,) = checks.of([HungSpot(21, at, math.pi / 2 - 1.0, 0.2)])
    assert other.look_from != first.look_from, 'it cannot be read from there'
    assert checks.of([]) == []
