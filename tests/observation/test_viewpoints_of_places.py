"""The viewpoints of a place of this robot show its rooms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from floor_plans import read_place
from indoor_watch.viewpoints import Viewpoints
from lidar_navigation.localisation.place_locator import PlaceRegions

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.mark.parametrize('name', ['patrol_world'])
def test_the_rooms_of_a_place_are_covered(name: str):
    place = read_place(CONFIG / f'{name}.yaml')
    plan, points = place.plan, place.place.positions
    grid = plan.grid()
    regions = PlaceRegions(grid, [each.segment for each in plan.doors.values()], points)
    chosen = Viewpoints(grid, 0.22)
    for room, point in points.items():
        floor = regions.cells_of(room)
        assert floor is not None
        first = float(point[0]), float(point[1])
        spots = [first, *chosen.of_room(floor, first)]
        seen = np.logical_or.reduce([chosen.seen_from(each) for each in spots]) & floor
        assert seen.sum() >= 0.9 * floor.sum(), room
