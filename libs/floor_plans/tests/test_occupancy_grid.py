"""A map's cells: where a point lies, what is near it, what a line runs through."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from floor_plans.occupancy_grid import (
    distance_to,
    divided,
    drawn_lines,
    empty_around,
    outlines,
    points_on,
    regions,
    walled_off,
    with_walls,
)


def grid(rows: int = 40, columns: int = 60, origin: tuple[float, float] = (-1.0, 2.0)) -> Grid:
    return Grid(np.zeros((rows, columns), np.int8), 0.1, origin)


def test_points_and_cells_find_each_other_and_off_the_map_is_nothing() -> None:
    some = grid()
    cells = np.array([[0, 0], [39, 59], [7, 31]])
    assert (some.cells_of(some.centres_of(cells)) == cells).all()
    assert some.cell_of(*some.centre_of(7, 31)) == (7, 31)
    assert some.at(some.cells, -0.95, 2.05) == 0
    for x, y in ((-1.05, 2.05), (5.05, 2.05), (math.nan, 2.0), (math.inf, 2.0)):
        assert some.at(some.cells, x, y) is None
    assert some.contains([[0, 0], [-1, 0], [40, 0], [0, 60]]).tolist() == [True, *[False] * 3]
    assert some.bounds == pytest.approx((-1.0, 2.0, 5.0, 6.0))
    with pytest.raises(ValueError, match='expected rows and columns'):
        Grid(np.zeros(3, np.int8), 0.1)


def test_what_is_known_is_enclosed() -> None:
    some = grid()
    some.cells[:] = -1
    assert some.known == some.bounds
    some = grid()
    some.cells[:] = -1
    some.cells[10:20, 30:35] = 100
    assert some.known == pytest.approx((2.0, 3.0, 2.5, 4.0))


def test_a_field_is_interpolated_between_the_centres() -> None:
    some = grid()
    field = np.add.outer(np.arange(40.0), np.arange(60.0)).astype(np.float32)
    x, y = some.centre_of(10, 20)
    found = some.interpolated(field, [(x, y), (x + 0.05, y), (x + 0.05, y + 0.05), (-9.0, -9.0)])
    assert found == pytest.approx([30.0, 30.5, 31.0, 0.0])


def test_distances_are_from_centre_to_centre() -> None:
    mask = np.zeros((5, 9), np.bool_)
    assert np.isinf(distance_to(mask, 0.1)).all()
    mask[2, 0] = True
    assert distance_to(mask, 0.1)[2] == pytest.approx(np.arange(9) * 0.1)


def test_lines_have_no_gaps_and_walls_are_as_thick_as_walls() -> None:
    some = grid()
    line = (0.0, 2.5, 4.0, 5.5)
    assert np.hypot(*np.diff(points_on(line, 0.3), axis=0).T).max() <= 0.3 + 1e-9
    thin = drawn_lines(some, [line])
    assert (thin == with_walls(some, [line]).occupied).all()
    thick = walled_off(some, [((0.0, 2.5), (4.0, 5.5))]).occupied
    assert thick.sum() > 1.5 * thin.sum()
    for solid in (thin, thick):
        assert len(np.unique(regions(~solid)[~solid])) == 1, 'one walks round its ends'
    across = drawn_lines(some, [(-1.0, 4.0, 5.0, 4.0)])
    labels = regions(~across)
    assert len(np.unique(labels)) == 2
    assert (labels > 0).all(), 'a cell of the line belongs to the region beside it'


def test_maps_of_one_place_line_up_whatever_is_around_it() -> None:
    near, far = (empty_around((0.31, 0.0, 2.0, 1.0), 0.1, margin) for margin in (0.5, 1.5))
    for small, large in zip(near.origin, far.origin, strict=True):
        assert math.remainder(small - large, 0.1) == pytest.approx(0.0, abs=1e-9)
    west, south, east, north = far.bounds
    assert west <= 0.31 - 1.5
    assert (south, east, north) <= (-1.5, math.inf, math.inf)
    assert east >= 3.5
    assert north >= 2.5


def test_an_outline_runs_round_what_stands_there() -> None:
    some = grid()
    some.cells[10:20, 30:40] = 100
    (outline,) = outlines(some, 0.1)
    assert (outline[0] == outline[-1]).all()
    (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
    assert (west, south, east, north) == pytest.approx((2.0, 3.0, 3.0, 4.0), abs=0.1)


def test_a_map_is_divided_into_the_rooms_of_its_points() -> None:
    some = grid()  # 6 m x 4 m from (-1, 2)
    some.cells[:, 20] = some.cells[:, 40] = 100  # walls at x = 1 and x = 3
    some.cells[0:8, 50] = some.cells[8, 50:60] = 100  # 0.7 m2 in the corner: below a table
    labels = divided(some, [(0.0, 3.0), (0.0, 5.5), (4.0, 5.0), (99.0, 0.0)])
    assert some.at(labels, 0.5, 2.5) == 1
    assert some.at(labels, 0.5, 5.0) == 2, 'the nearer point of one part'
    assert some.at(labels, 4.8, 2.3) == 3, 'a small part belongs to the room beside it'
    assert some.at(labels, 2.0, 4.0) < 0, 'a large part without a point is no room'
    assert some.at(labels, 1.02, 3.0) in (1, some.at(labels, 2.0, 4.0)), 'walls are shared out'
    assert set(np.unique(labels)) == {1, 2, 3, some.at(labels, 2.0, 4.0)}
    solid = Grid(np.full((5, 5), 100, np.int8), 0.1)
    assert (divided(solid, [(0.2, 0.2)]) == 0).all()
