"""A hall is known, swept, and cut into the aisles between its shelves, whatever its direction."""

from __future__ import annotations

import math
import random
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.editor import PlaceEditor
from floor_plans.imports import ImportRequest, import_place
from floor_plans.map_rooms.halls import aisles_of
from floor_plans.occupancy_map import write_map


def warehouse(shelves: int = 3) -> np.ndarray:
    """Return a hall of 26 m x 16 m with shelves of 18 m, as cells with row 0 in the south."""
    cells = np.full((360, 560), -1, np.int8)
    cells[18:342, 18:542] = 100
    cells[20:340, 20:540] = 0
    for each in range(shelves):
        row = 84 + each * 72
        cells[row : row + 28, 100:460] = 100
    return cells


def turned(cells: np.ndarray, degrees: float) -> np.ndarray:
    height, width = cells.shape
    span = math.ceil(math.hypot(height, width)) + 4
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1.0)
    turn[:, 2] += ((span - width) / 2, (span - height) / 2)
    return cv2.warpAffine(
        cells.astype(np.float32), turn, (span, span), flags=cv2.INTER_NEAREST, borderValue=-1
    ).astype(np.int8)


def test_aisles_are_found_in_every_direction_and_with_specks() -> None:
    seed = random.randrange(10**6)
    print('seed', seed)
    random_ = np.random.default_rng(seed)
    cells = turned(warehouse(), float(random_.uniform(0.0, 180.0)))
    free = cells == 0
    specks = random_.choice(np.flatnonzero(free), 40, replace=False)
    speckled = free.copy()
    speckled.flat[specks] = False
    parts, aisles = aisles_of(free, speckled)
    assert aisles == 4
    assert parts.max() == 6  # and the ways before and behind the shelves
    assert (parts[free] > 0).all()
    sizes = np.sort(np.bincount(parts[free])[1:]) * 0.05**2
    assert sizes[0] > 20.0


@pytest.mark.parametrize('shelves', [0, 1])
def test_a_hall_without_aisles_is_left_whole(shelves: int) -> None:
    free = warehouse(shelves) == 0
    parts, aisles = aisles_of(free, free)
    # One shelf leaves an aisle on each side, which are as wide as the hall lets them.
    assert (aisles, parts.max()) == (0, 1)


def test_import_says_what_it_made_of_a_hall_and_cuts_it_where_asked(tmp_path: Path) -> None:
    source = tmp_path / 'hall.yaml'
    write_map(source, warehouse()[::-1], 0.05, (0.0, 0.0, 0.0))
    whole = import_place(ImportRequest(source, tmp_path / 'whole.yaml'))
    assert 'C1 is a hall of 340 m2: a visit sweeps all of it (sweep); it has 4 aisles' in str(whole)
    assert read_place(tmp_path / 'whole.yaml').rules.swept == {'C1'}
    (hall,) = whole.content['halls']
    assert (hall['name'], hall['aisles']) == ('C1', 4)
    assert hall['area'] == pytest.approx(340.0, abs=3.0)
    assert hall['seen'] < 0.3
    cut = import_place(ImportRequest(source, tmp_path / 'cut.yaml', aisles=True))
    place = read_place(tmp_path / 'cut.yaml')
    assert len(place.place.rooms) == 6
    assert len(place.plan.doors) == 8
    assert cut.content['halls'] == []


def test_a_person_says_which_places_are_swept(tmp_path: Path) -> None:
    write_map(tmp_path / 'hall.yaml', warehouse()[::-1], 0.05, (0.0, 0.0, 0.0))
    import_place(ImportRequest(tmp_path / 'hall.yaml', tmp_path / 'place.yaml', aisles=True))
    editor = PlaceEditor(tmp_path / 'place.yaml')
    room = next(iter(read_place(tmp_path / 'place.yaml').place.rooms))
    assert editor.apply('set_sweep', {'room': room, 'on': True}) == f'{room} is swept'
    editor.apply('rename', {'kind': 'room', 'name': room, 'new': 'north'})
    editor.save()
    assert read_place(tmp_path / 'place.yaml').rules.swept == {'north'}
    editor.apply('set_sweep', {'room': 'north', 'on': False})
    editor.save()
    assert not read_place(tmp_path / 'place.yaml').rules.swept
