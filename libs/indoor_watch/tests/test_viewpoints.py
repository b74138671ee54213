"""Viewpoints: rooms of the project's places, and a corner that one point does not show."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch import rule_from
from indoor_watch.hung_markers import HungSpot
from indoor_watch.marker_checks import MarkerChecks
from indoor_watch.viewpoints import ENOUGH, Viewpoints


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
    spot = HungSpot(21, (6.05, 0.28, 1.0), math.pi / 2 + 0.2, 0.2)
    assert checks.of([replace(spot, is_open=True)]) == [replace(first, is_open=True)]
    assert checks.of([spot]) == [first], 'it was read'
    (other,) = checks.of([HungSpot(21, at, math.pi / 2 - 1.0, 0.2)])
    assert other.look_from != first.look_from, 'it cannot be read from there'
    assert checks.of([]) == []


def bare_hall() -> Grid:
    """Return a hall of 8 by 6 metres with a wall that ends in the middle, at (-1, -2)."""
    cells = np.zeros((60, 80), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[:30, 40] = 100
    cells[50:, 70:] = -1
    return Grid(cells, 0.1, (-1.0, -2.0))


def test_what_is_in_view_is_what_no_wall_hides_within_six_metres() -> None:
    grid, spot = bare_hall(), (1.05, 0.05)
    seen = Viewpoints(grid, 0.2).seen_from(spot)
    hidden = wrong = 0
    for row, column in itertools.product(range(0, 60, 2), range(1, 80, 2)):
        x, y = grid.centre_of(row, column)
        away = math.dist(spot, (x, y))
        count = max(2, math.ceil(away / 0.04))
        way = [(spot[0] + (x - spot[0]) * n / count, spot[1] + (y - spot[1]) * n / count)
               for n in range(count + 1)]  # fmt: skip
        clear = all(grid.at(grid.cells, *each) == 0 for each in way)
        if away < 5.8:
            hidden += not clear
            wrong += clear != seen[row, column]
        elif away > 6.15:
            assert not seen[row, column]
    assert hidden > 200
    # Cells that a wall cuts, and those that lie between beams.
    assert wrong < 15


@pytest.mark.parametrize(
    ('spot', 'facing', 'scale', 'reads'),
    [
        ((0.81, 1.0), None, 1.0, True),
        ((0.79, 1.0), None, 1.0, False),
        ((2.19, 1.0), None, 1.0, True),
        ((2.21, 1.0), None, 1.0, False),
        ((2.21, 1.0), None, 1.1, True),
        # Of a small panel one may stand nearer, and a large one is not read from nearer.
        ((0.5, 1.0), None, 0.6, True),
        ((1.4, 1.0), None, 0.6, False),
        ((0.79, 1.0), None, 2.0, False),
        ((1.5, 1.0), 1.04, 1.0, True),
        ((1.5, 1.0), 1.06, 1.0, False),
        ((1.5, 1.0), -1.04, 1.0, True),
        ((1.5, 1.0), math.pi, 1.0, False),
    ],
)
def test_a_panel_is_read_from_so_near_and_so_far_aside(
    spot: tuple[float, float], facing: float | None, scale: float, reads: bool
) -> None:
    viewpoints = Viewpoints(bare_hall(), 0.2)
    assert viewpoints.reads_panel(spot, (0.0, 1.0), facing, scale) is reads


def test_nothing_is_read_through_a_wall_but_its_last_part_does_not_count() -> None:
    viewpoints = Viewpoints(bare_hall(), 0.2)
    assert viewpoints.reads_panel((2.2, 0.0), (3.05, 0.0), None), 'on the wall'
    assert not viewpoints.reads_panel((2.2, 0.0), (3.45, 0.0), None), 'behind it'
    assert viewpoints.reads_panel((2.2, 1.5), (3.45, 1.5), None), 'past its end'
    assert viewpoints._shows((0.0, 0.0), (2.9, 0.0))
    assert not viewpoints._shows((0.0, 2.0), (3.01, 2.0))
    assert viewpoints._shows((0.0, 2.0), (3.01, 2.0), 4.0)
    assert viewpoints._shows((1.0, 1.0), (1.0, 1.0))
    assert not viewpoints._shows((-0.5, 0.0), (-2.0, 0.0)), 'off the map'


def test_of_the_candidates_the_best_is_taken_by_its_definition() -> None:
    grid = bare_hall()
    viewpoints, floor = Viewpoints(grid, 0.2), grid.free
    candidates = viewpoints._candidates(floor)
    assert 10 < len(candidates) <= 40
    walls = grid.centres_of(np.argwhere(grid.occupied))
    for spot in candidates:
        # From the middle of a cell to that of a wall's.
        assert np.hypot(*(walls - spot).T).min() > 0.3
    # Evenly, and so far apart that they are not too many.
    cells = np.array([grid.cell_of(*spot) for spot in candidates])
    assert np.gcd.reduce(cells.ravel()) >= 6
    panel, facing = (3.0, -1.0), math.pi
    chosen = viewpoints.of_panel(floor, (5.0, 2.0), panel, facing)
    able = [each for each in candidates if viewpoints.reads_panel(each, panel, facing)]
    assert len(able) > 2

    def cost(spot: tuple[float, float]) -> float:
        bearing = math.atan2(spot[1] - panel[1], spot[0] - panel[0])
        turn = abs(math.remainder(bearing - facing, math.tau))
        return abs(math.dist(spot, panel) - 1.5) + turn

    assert chosen is not None
    assert cost(chosen) == min(map(cost, able))
    assert viewpoints.of_panel(floor, (1.5, -1.0), panel, facing) == (1.5, -1.0)
    assert viewpoints.of_panel(floor, (5.0, 2.0), (9.0, 9.0), None) is None

    thing, first = (1.0, 1.0), (0.0, 0.0)
    again = viewpoints.aside(floor, thing, first)

    def worth(spot: tuple[float, float]) -> float:
        one, other = (math.atan2(s[1] - thing[1], s[0] - thing[0]) for s in (spot, first))
        turn = abs(math.remainder(one - other, math.tau))
        return turn - 0.15 * math.dist(spot, first) - 0.15 * abs(math.dist(spot, thing) - 1.5)

    able = [
        each
        for each in candidates
        if math.dist(each, first) >= 1.0
        and math.dist(each, thing) >= 0.6
        and viewpoints._shows(each, thing, 6.0)
    ]
    assert again is not None
    assert worth(again) == max(map(worth, able))
    nowhere = np.zeros_like(floor)
    assert viewpoints.aside(nowhere, thing, first) is None
    assert viewpoints._candidates(nowhere) == []


def test_a_room_is_covered_greedily_until_enough_is_seen() -> None:
    grid = bare_hall()
    viewpoints, floor, first = Viewpoints(grid, 0.2), grid.free, (1.0, 0.0)
    found = viewpoints.of_room(floor, first)
    covered = viewpoints.seen_from(first) & floor
    total = floor.sum()
    candidates = viewpoints._candidates(floor)
    for spot in found:
        gains = [(viewpoints.seen_from(each) & floor & ~covered).sum() for each in candidates]
        gain = (viewpoints.seen_from(spot) & floor & ~covered).sum()
        assert gain == max(gains)
        assert gain >= 0.04 * total
        assert covered.sum() < 0.95 * total
        covered |= viewpoints.seen_from(spot) & floor
    assert 1 <= len(found) <= 4
    left = max((viewpoints.seen_from(each) & floor & ~covered).sum() for each in candidates)
    assert covered.sum() >= 0.95 * total or left < 0.04 * total or len(found) == 4
    check = (6.5, -1.5)
    with_check = viewpoints.of_room(floor, first, [check])
    assert any(viewpoints._shows(each, check) for each in with_check)
    assert viewpoints.of_room(floor & False, first) == []
