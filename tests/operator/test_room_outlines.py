"""Which floor belongs to which place."""

from __future__ import annotations

import numpy as np
import pytest

from floor_plans import Grid
from surveillance_operator.room_outlines import RoomOutline, room_outlines

WALL = 100


def two_rooms(*, size: int = 40) -> Grid:
    """Two rooms of 10 x 20 m side by side, with a door of 2 m in the wall between them."""
    cells = np.zeros((size, size), np.int8)
    cells[0] = cells[-1] = WALL
    cells[:, 0] = cells[:, -1] = cells[:, size // 2] = WALL
    cells[18:22, size // 2] = 0
    return Grid(cells, 0.5, (-1.0, -2.0))


DOOR = {'D': (9.25, 7.0, 9.25, 9.0)}
POINTS = {'A': (4.0, 8.0), 'B': (14.0, 8.0)}


def area(region: RoomOutline) -> float:
    return sum((right - left) * (top - bottom) for left, bottom, right, top in region.boxes)


def test_a_door_parts_two_rooms_and_names_stand_inside() -> None:
    found = room_outlines(two_rooms(), POINTS, DOOR)
    assert found.keys() == {'A', 'B'}
    for name, region in found.items():
        assert area(region) == pytest.approx(19 * 9.25, rel=0.05)
        x, y = region.label
        assert any(l < x < r and b < y < t for l, b, r, t in region.boxes)  # noqa: E741
        assert np.hypot(x - POINTS[name][0], y - POINTS[name][1]) > 1.0  # the robot stops there
        assert region.room > 1.0


def test_without_a_door_each_cell_is_the_nearer_places() -> None:
    found = room_outlines(two_rooms(), {'A': (4.0, 8.0), 'C': (4.0, -1.0), 'B': (14.0, 8.0)}, {})
    assert area(found['A']) + area(found['C']) + area(found['B']) == pytest.approx(343.0, rel=0.05)
    assert max(top for _, _, _, top in found['C'].boxes) == pytest.approx(3.5, abs=0.5)


def test_a_place_in_a_wall_or_off_the_map_has_no_region() -> None:
    assert room_outlines(two_rooms(), {'A': (9.2, 1.0), 'B': (100.0, 0.0)}, DOOR) == {}


def test_a_large_map_is_taken_coarsely() -> None:
    found = room_outlines(two_rooms(size=1200), {'A': (20.0, 300.0)}, {})
    assert len(found['A'].boxes) < 20


def test_a_map_of_one_long_row_of_cells_has_its_region() -> None:
    strip = Grid(np.zeros((1, 900_000), np.int8), 0.05)
    assert room_outlines(strip, {'A': (5.0, 0.02)}, {})['A'].boxes == ((0.0, 0.0, 45_000.0, 0.05),)


@pytest.mark.parametrize('size', [40, 41])
def test_places_that_share_a_floor_have_the_cells_that_are_nearer_to_them(size: int) -> None:
    """Beside the distance of each cell's middle, in a room that begins nowhere near the corner."""
    grid = two_rooms(size=size)
    wall = -1.0 + size // 2 * 0.5
    points = {'B': (wall + 5.25, 8.25), 'F': (wall + 3.25, 1.25), 'G': (wall + 7.25, 2.25)}
    found = room_outlines(grid, points, {'D': (wall + 0.25, 7.0, wall + 0.25, 9.0)})
    assert found.keys() == points.keys()
    for row in range(3, size - 2, 2):
        for column in range(size // 2 + 3, size - 2, 2):
            x, y = -1.0 + (column + 0.5) * 0.5, -2.0 + (row + 0.5) * 0.5
            away = {name: np.hypot(x - at[0], y - at[1]) for name, at in points.items()}
            first, second = sorted(away.values())[:2]
            within = [
                name
                for name, region in found.items()
                for left, bottom, right, top in region.boxes
                if left < x < right and bottom < y < top
            ]
            assert len(within) == 1, 'each cell once'
            if second - first > 0.01:
                assert within == [min(away, key=lambda name: away[name])]
