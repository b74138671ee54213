"""Rooms of a map as a place: what is proposed is what the place's own reader takes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import FloorPlan, Grid, RoomMap
from floor_plans.map_rooms import (
    Segmentation,
    joining,
    openings,
    proposal,
    propose,
)
from floor_plans.map_rooms.segmentation import spread
from floor_plans.occupancy_grid import distance_to
from floor_plans.occupancy_map import OccupancyMap
from floor_plans.room_map import check_passable

from . import proposed_places

RADIUS = 0.22


def hall(resolution: float, wide: float = 8.0, high: float = 5.0) -> OccupancyMap:
    rows, columns = (round(each / resolution) for each in (high, wide))
    cells = np.zeros((rows, columns), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    return OccupancyMap(Path('map.yaml'), cells, resolution, (0.0, 0.0, 0.0))


def proposed(
    building: OccupancyMap, labels: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> FloorPlan:
    """Return what is proposed where the rooms are found so; the reader's checks are passed."""

    def found(grid: object, shut: object = ()) -> Segmentation:
        own = building.own_grid
        known = np.where(own.free, labels, 0).astype(np.int32)
        return Segmentation(known, int(labels.max()), frozenset(), own, known)

    monkeypatch.setattr(proposal, 'segment', found)
    parameters = propose(building, RADIUS).parameters
    plan = FloorPlan.from_parameters(parameters, building)
    RoomMap(plan)
    check_passable(plan, RADIUS)
    return plan


def test_a_room_that_the_line_of_its_door_fills_is_one_with_the_room_beside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    building = hall(0.05)
    labels = np.ones(building.cells.shape, np.int32)
    labels[:, 80:86] = 2
    labels[:, 86:] = 3
    assert len(proposed(building, labels, monkeypatch).place.rooms) == 2


def test_gaps_beside_a_door_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    building = hall(0.05)
    cells = building.cells.copy()
    cells[:, 79:81] = 100
    cells[40:60, 79:81] = 0
    cells[5:8, 79:81] = 0  # a hole in the wall that nobody fits through, with something in it
    cells[6, 79] = 100
    building = replace(building, cells=cells)
    labels = np.ones(cells.shape, np.int32)
    labels[:, 80:] = 2
    plan = proposed(building, labels, monkeypatch)
    assert list(plan.doors) == ['D1']
    assert RoomMap(plan).room_at(7.0, 1.0) == 'R2'


def test_a_door_reaches_equally_far_from_its_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    building = hall(0.05)
    cells = building.cells.copy()
    cells[:, 79:81] = 100
    cells[20:80, 79:81] = 0  # an opening of 3 m, with a bin beside its southern half
    cells[70:74, 74:77] = 100
    building = replace(building, cells=cells)
    labels = np.ones(cells.shape, np.int32)
    labels[:, 80:] = 2
    door = proposed(building, labels, monkeypatch).doors['D1']
    assert (door.y, door.width) == pytest.approx((2.5, 3.0), abs=0.15)


@pytest.mark.parametrize('variant', proposed_places.VARIANTS)
def test_a_building_is_proposed_as_it_was(variant: str) -> None:
    """Where a map is cut follows from many small numbers: what changes it is to be looked at.

    `python -m tests.runtime.proposed_places` takes what is proposed now.
    """
    before = (proposed_places.RECORDS / f'{variant}.txt').read_text('utf-8').splitlines()
    assert proposed_places.proposed(variant) == before


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


def test_cuts_are_drawn_without_gaps_and_share_out_their_length() -> None:
    cut = openings.Cut(np.array([2.0, 3.0]), np.array([10.0, 7.0]), 9.5)
    weights = openings.drawn([cut], (12, 14))
    rows, columns = np.nonzero(weights)
    assert sorted(set(columns.tolist())) == list(range(2, 11))
    assert (np.abs(rows - (3 + (columns - 2) / 2)) <= 0.51).all()
    assert weights[rows, columns] == pytest.approx(9.5 / 9.0)
    # 4-connected neighbours on both sides do not meet through it.
    free = (weights == 0).astype(np.uint8)
    free[:3], free[8:], free[:, :2], free[:, 11:] = 0, 0, 0, 0
    assert cv2.connectedComponents(free, connectivity=4)[0] == 3
    off = openings.Cut(np.array([-3.0, 5.0]), np.array([20.0, 5.0]), 23.0)
    assert np.count_nonzero(openings.drawn([off], (12, 14))) == 14


def test_of_cuts_with_the_same_ends_the_shortest_is_kept() -> None:
    def cut(x1: float, y1: float, x2: float, y2: float, length: float) -> openings.Cut:
        return openings.Cut(np.array([x1, y1]), np.array([x2, y2]), length)

    first, turned = cut(0, 0, 20, 0, 20.0), cut(20, 6, 0, 6.9, 19.0)
    apart, near_one = cut(0, 8, 20, 8, 20.5), cut(0, 0, 20, 14, 24.0)
    kept = openings.without_doubles([first, turned, apart, near_one])
    assert kept == [turned, near_one]
    assert openings.without_doubles([first, near_one]) == [first, near_one]
    assert openings.without_doubles([]) == []


def test_a_passage_is_cut_across_where_it_is_narrowest() -> None:
    free = np.zeros((40, 60), np.bool_)
    free[5:35, 2:28] = free[5:35, 32:58] = True
    free[15:25, 28:32] = True
    (cut,) = openings.saddle_cuts(free, [(19, 30, 5.0)])
    assert cut.narrow
    assert sorted([cut.start[1], cut.end[1]]) == [14.0, 25.0]
    assert abs(cut.start[0] - 30) <= 2
    assert cut.length == pytest.approx(math.dist(cut.start, cut.end))
    assert openings.saddle_cuts(np.ones((40, 60), np.bool_), [(19, 30, 5.0)]) == []


def test_rooms_that_are_joined_are_numbered_without_a_gap() -> None:
    labels = np.array([[1, 1, 2, 3], [1, 0, 4, 4]], np.int32)
    grid = Grid(np.zeros((2, 4), np.int8), 0.05)
    found = Segmentation(labels, 4, frozenset({2, 4}), grid, labels)
    both = found.joined(3, 1)
    assert both.labels.tolist() == [[1, 1, 2, 1], [1, 0, 3, 3]]
    assert (both.rooms, both.corridors) == (3, {2, 3})
    assert both.working_labels.tolist() == both.labels.tolist()
    assert found.joined(4, 2).corridors == {2}, 'the larger one is long'
    assert found.joined(1, 2).corridors == {3}, 'the smaller one was'


def test_cells_without_a_room_get_that_of_the_nearest() -> None:
    labels = np.zeros((9, 12), np.int32)
    labels[1, 1], labels[7, 10] = 5, 2
    found = spread(labels)
    for row, column in np.ndindex(9, 12):
        one, other = math.dist((row, column), (1, 1)), math.dist((row, column), (7, 10))
        if abs(one - other) > 0.3:
            assert found[row, column] == (5 if one < other else 2)
    assert (spread(np.zeros((3, 3), np.int32)) == 0).all()
