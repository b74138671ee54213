"""Which parts of a cut map are rooms of their own."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from floor_plans.map_rooms import (
    joining,
)
from floor_plans.map_rooms.joining import elongation, half_width, joined
from floor_plans.occupancy_grid import distance_to


def strips(*widths: int, opening: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return rooms of 60 rows beside each other, with openings between, as `joined` takes them.

    Cells of 0.1 m; the cut lies in each opening.
    """
    free = np.zeros((62, sum(widths) + len(widths) + 1), np.uint8)
    parts, cuts = np.zeros(free.shape, np.int32), np.zeros(free.shape, np.float32)
    left = 1
    for number, width in enumerate(widths, 1):
        free[1:61, left : left + width] = 1
        parts[1:61, left : left + width] = number
        left += width + 1
        if number < len(widths):
            rows = slice(31 - opening // 2, 31 - opening // 2 + opening)
            free[rows, left - 1] = 1
            cuts[rows, left - 1] = 1.0
    clearance = cv2.distanceTransform(free, cv2.DIST_L2, 5) * np.float32(0.1)
    return parts, cuts, clearance


@pytest.mark.parametrize(
    ('widths', 'opening', 'rooms'),
    [
        ((40, 40), 9, [1, 2]),  # two rooms of 24 m2 and a door of 0.9 m
        ((40, 1), 9, [1, 1]),  # a cupboard of 0.6 m2
        ((40, 3), 40, [1, 1]),  # a niche of 0.3 m depth
        ((1, 40), 9, [2, 2]),  # the larger one keeps its number
        ((40, 1, 40), 9, [1, 1, 3]),
    ],
)
def test_parts_are_rooms_or_belong_to_their_neighbours(
    widths: tuple[int, ...], opening: int, rooms: list[int]
) -> None:
    assert joined(*strips(*widths, opening=opening), 0.1).tolist() == [0, *rooms]


def test_the_width_of_a_strip_follows_from_its_clearance() -> None:
    # A strip of 10 m x 2 m: the mean clearance is a quarter of the width.
    assert half_width(20.0, 20.0 * 0.5) == pytest.approx(1.0)
    assert elongation(20.0, 10.0) == pytest.approx(5.0)
    # Of a square of side 1 it is a sixth: 2.25 squares of two thirds.
    assert elongation(1.0, 1.0 / 6.0) == pytest.approx(2.25)


@pytest.mark.parametrize(('long', 'wide'), [(3.0, 3.0), (8.0, 2.0), (20.0, 1.0)])
def test_half_the_width_of_a_strip_and_how_long_it_is(long: float, wide: float) -> None:
    """The mean distance to the nearer long side is a quarter of the width."""
    step = 0.01
    x, y = np.meshgrid(np.arange(step / 2, long, step), np.arange(step / 2, wide, step))
    depth = float(np.minimum(np.minimum(x, long - x), np.minimum(y, wide - y)).sum()) * step**2
    area = long * wide
    expected = 2 * depth / area
    assert joining.half_width(area, depth) == pytest.approx(expected)
    if long > 4 * wide:
        assert expected == pytest.approx(wide / 2, rel=0.1)
    assert joining.elongation(area, depth) == pytest.approx(area / (2 * expected) ** 2)
    if long == wide:
        assert joining.elongation(area, depth) == pytest.approx(2.25, rel=0.01)


def two_parts(opening: int, deep: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return parts, cuts and clearance of a hall and a part so deep behind an opening, in cells."""
    free = np.zeros((80, 100), np.bool_)
    free[2:78, 2:60] = True
    free[30 : 30 + opening, 60 : 61 + deep] = True
    cuts = np.zeros(free.shape, np.float32)
    cuts[30 : 30 + opening, 60] = 1.0
    parts = np.where(free & (cuts == 0), 1, 0).astype(np.int32)
    parts[:, 61:][free[:, 61:]] = 2
    return parts, cuts, distance_to(~free, 0.05)


@pytest.mark.parametrize(
    ('opening', 'deep', 'apart'),
    [
        # Less than a square metre is no room; of the width of its opening all of it must be deep.
        (20, 19, False),
        (30, 10, False),
        (30, 25, False),
        (30, 35, True),
        (20, 30, True),
    ],
)
def test_a_part_is_a_room_of_its_own_by_its_area_and_its_opening(
    opening: int, deep: int, apart: bool
) -> None:
    into = joining.joined(*two_parts(opening, deep), 0.05)
    assert into.tolist() == ([0, 1, 2] if apart else [0, 1, 1])
