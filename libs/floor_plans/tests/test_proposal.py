"""Rooms of a map as a place: what is proposed is what the place's own reader takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from floor_plans import FloorPlan, RoomMap
from floor_plans.map_rooms import (
    Segmentation,
    proposal,
    propose,
)
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
    # The rooms are as the test has them, also where no wall parts them.
    monkeypatch.setattr(proposal, '_without_false_doors', lambda _, rooms: rooms)
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

    `python -m libs.floor_plans.tests.proposed_places` takes what is proposed now.
    """
    before = (proposed_places.RECORDS / f'{variant}.txt').read_text('utf-8').splitlines()
    assert proposed_places.proposed(variant) == before


def test_a_gap_between_a_wall_and_furniture_is_no_door() -> None:
    cells = np.zeros((120, 220), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[:, 110] = 100
    cells[50:70, 110] = 0  # the door between two rooms
    behind_wall = OccupancyMap(Path('map.yaml'), cells[::-1].copy(), 0.05, (0.0, 0.0, 0.0))
    assert len(propose(behind_wall, RADIUS).names) == 2
    # Cupboards 1 m deep leave 1.25 m to the west wall, and a niche of 3 m2 behind.
    cells[22:42, 26:48] = 100
    cells[1:22, 34:48] = 100
    with_cupboard = OccupancyMap(Path('map.yaml'), cells[::-1].copy(), 0.05, (0.0, 0.0, 0.0))
    found = propose(with_cupboard, RADIUS)
    assert len(found.names) == 2
    assert list(found.parameters['doors']) == ['D1']


@pytest.mark.parametrize(('value', 'said'), [(-1, '100% unknown'), (100, '100% occupied')])
def test_a_map_without_floor_is_told_what_it_has(value: int, said: str) -> None:
    cells = np.full((50, 50), value, np.int8)
    with pytest.raises(ValueError, match=f'no cell of the map is free .*{said}'):
        propose(OccupancyMap(Path('map.yaml'), cells, 0.05, (0.0, 0.0, 0.0)), 0.22)


def test_furniture_across_a_room_makes_no_rooms_of_it() -> None:
    building = hall(0.05, 14.0, 3.6)
    cells = building.cells.copy()
    cells[:, 139:141] = 100
    cells[26:46, 139:141] = 0  # the door
    # A table in the middle, a bed at the wall.
    for rows, columns in (((20, 52), (56, 82)), ((2, 44), (200, 232))):
        # The laser sees their faces alone.
        cells[slice(*rows), slice(*columns)] = 100
        cells[rows[0] + 1 : rows[1] - 1, columns[0] + 1 : columns[1] - 1] = -1
    found = propose(replace(building, cells=cells), RADIUS).parameters
    assert (len(found['map']), list(found['doors'])) == (2, ['D1'])
