"""Things that appear, go and move, on real floor maps that nobody here drew."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch.floor import Change, FloorView, FloorVisit, changes

pytestmark = pytest.mark.early

RESOLUTION = 0.05


@pytest.fixture(scope='module')
def office() -> Grid:
    """Provide a hall of 12 by 8 metres with two pillars and a wall with a gap."""
    cells = np.zeros((160, 240), np.int8)
    cells[[0, 1, -1, -2], :] = 100
    cells[:, [0, 1, -1, -2]] = 100
    cells[40:44, 60:64] = cells[100:104, 160:164] = 100
    cells[:110, 120:122] = 100
    return Grid(cells, RESOLUTION)


def sweep(
    grid: Grid, things: list[tuple[float, float, float]], sensor: tuple[float, float], seed: int
):
    """Walk along beams in small steps until a wall or a round thing (x, y, radius) is met."""
    generator = np.random.default_rng(seed)
    angles = np.linspace(-math.pi, math.pi, 360, endpoint=False)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    steps = np.arange(0.05, 8.0, 0.01)
    points = np.asarray(sensor) + rays[:, None, :] * steps[None, :, None]
    rows = np.clip(((points[..., 1]) / grid.resolution).astype(int), 0, grid.cells.shape[0] - 1)
    columns = np.clip(((points[..., 0]) / grid.resolution).astype(int), 0, grid.cells.shape[1] - 1)
    blocked = grid.occupied[rows, columns]
    for x, y, radius in things:
        blocked |= np.hypot(points[..., 0] - x, points[..., 1] - y) < radius
    first = np.where(blocked.any(axis=1), blocked.argmax(axis=1), len(steps) - 1)
    met = blocked.any(axis=1)
    ranges = steps[first] + generator.normal(0, 0.02, len(first)) * met
    return np.asarray(sensor) + rays * ranges[:, None], met


def visit(grid: Grid, *looks: list[tuple[float, float, float]], seed: int = 0) -> FloorView:
    """Drive past with one look after the other, each with what stands there at that time."""
    gathered = FloorVisit(grid)
    path = [(2.0, 4.0), (2.5, 4.2), (3.0, 4.4), (3.5, 4.6), (4.0, 4.8), (4.5, 5.0)]
    for number, sensor in enumerate(path):
        things = looks[number % len(looks)]
        gathered.add(sensor, *sweep(grid, things, sensor, seed + number), stamp=0.2 * number)
    return gathered.view()


BOX = (4.5, 2.5, 0.12)
CHAIR = (2.5, 6.5, 0.2)


def test_nothing_happens_in_an_office_that_stays_as_it_is(office):
    before = visit(office, [CHAIR], seed=0)
    for seed in range(10, 60, 10):
        assert changes(before, visit(office, [CHAIR], seed=seed)) == []


def test_a_far_wall_stays_a_wall_when_the_heading_is_a_degree_off() -> None:
    cells = np.zeros((160, 240), np.int8)
    cells[10:40, 140:142] = 100
    grid, turn = Grid(cells, RESOLUTION), math.radians(1.4)
    views = []
    for error in (0.0, turn, -turn):
        gathered = FloorVisit(grid)
        for seed in range(12):
            # A beam each degree: it stands a little elsewhere, so that all of the wall is met.
            sensor = 0.5, 1.0 + 0.02 * seed
            ends, met = sweep(grid, [], sensor, seed)
            turned = np.array(
                [[math.cos(error), -math.sin(error)], [math.sin(error), math.cos(error)]]
            )
            gathered.add(sensor, (ends - sensor) @ turned.T + sensor, met, 0.2 * seed)
        views.append(gathered.view())
    for now in views[1:]:
        assert changes(views[0], now) == []


def test_a_slanting_far_wall_stays_a_wall_when_place_and_heading_are_off() -> None:
    cells = np.zeros((160, 240), np.int8)
    cells[10:12] = 100
    grid, error = Grid(cells, RESOLUTION), math.radians(1.2)
    turn = np.array([[math.cos(error), -math.sin(error)], [math.sin(error), math.cos(error)]])
    views = []
    for off in (0, 1):
        gathered = FloorVisit(grid)
        for seed in range(8):
            # The wall is 4 m away; where it is met under 45 degrees both errors lift its ends.
            sensor = 2.0 + 0.03 * seed, 4.6
            ends, met = sweep(grid, [], sensor, seed)
            if off:
                told = sensor[0], sensor[1] + 0.04
                gathered.add(told, (ends - sensor) @ turn.T + told, met, float(gathered.sweeps))
            else:
                gathered.add(sensor, ends, met, float(gathered.sweeps))
        views.append(gathered.view())
    assert changes(*views) == []


def test_what_appears_and_what_goes_is_found_where_it_is(office):
    before, after = visit(office, [CHAIR]), visit(office, [CHAIR, BOX], seed=10)
    (found,) = changes(before, after)
    assert found.change == Change.APPEARED
    assert math.dist(found.position, BOX[:2]) < 0.2
    assert 0.1 < found.extent < 0.4
    (gone,) = changes(after, before)
    assert gone.change == Change.REMOVED
    assert math.dist(gone.position, BOX[:2]) < 0.2


def test_a_chair_that_was_moved_is_one_thing_with_two_places(office):
    moved = (CHAIR[0] + 0.6, CHAIR[1], CHAIR[2])
    (found,) = changes(visit(office, [CHAIR]), visit(office, [moved], seed=10))
    assert found.change == Change.MOVED
    assert found.before is not None
    assert math.dist(found.position, moved[:2]) < 0.3
    assert math.dist(found.before, CHAIR[:2]) < 0.3


def seen_at(*middles: tuple[float, float]) -> FloorView:
    """Return a view of a free hall of 12 by 12 m with square things of 0.3 m."""
    occupied = np.zeros((240, 240), np.bool_)
    for x, y in middles:
        row, column = round(y / RESOLUTION), round(x / RESOLUTION)
        occupied[row - 3 : row + 3, column - 3 : column + 3] = True
    grid = Grid(np.zeros((240, 240), np.int8), RESOLUTION)
    return FloorView(grid, occupied, ~occupied, np.zeros_like(occupied))


def test_what_comes_far_from_what_went_is_another_thing():
    far = changes(seen_at((1.0, 1.0)), seen_at((1.0, 4.2)))
    assert sorted(each.change for each in far) == [Change.APPEARED, Change.REMOVED]
    near = changes(seen_at((1.0, 1.0)), seen_at((1.0, 3.8)))
    assert [each.change for each in near] == [Change.MOVED]


def test_each_thing_that_moved_is_paired_with_its_own():
    """The first would take what is nearest to it, and belongs to the second."""
    found = changes(seen_at((1.0, 5.0), (3.0, 5.0)), seen_at((3.0, 5.6), (1.0, 7.3)))
    assert [each.change for each in found] == [Change.MOVED] * 2
    for each in found:
        assert each.before is not None
        assert each.position[0] == pytest.approx(each.before[0], abs=0.1)


def test_what_was_hidden_is_neither_gone_nor_new(office):
    behind = (4.5, 2.0, 0.12)
    screen = (3.9, 3.0, 0.7)
    before = visit(office, [behind])
    found = changes(before, visit(office, [behind, screen], seed=10))
    assert [each.change for each in found] == [Change.APPEARED], 'the screen alone'
    # Beyond the wall nothing was ever in view.
    far = (10.0, 2.0, 0.3)
    assert changes(visit(office, []), visit(office, [far], seed=10)) == []


def test_a_person_who_walks_through_is_no_thing(office):
    walk = [[(3.0 + 0.4 * step, 3.0, 0.15)] for step in range(6)]
    found = changes(visit(office, []), visit(office, *walk, seed=10))
    assert [each for each in found if each.confidence > 0.6] == []


def test_a_stay_of_many_hours_is_counted_to_its_end(office):
    sensor = (2.0, 4.0)
    gathered = FloorVisit(office)
    for number in range(5):
        gathered.add(sensor, *sweep(office, [CHAIR], sensor, number), stamp=0.2 * number)
    # A hundred thousand sweeps like these, of a robot at its dock.
    gathered._ends *= 20_000
    gathered._passes *= 20_000
    gathered.sweeps *= 20_000
    before = gathered.view()
    gathered.add(sensor, *sweep(office, [CHAIR], sensor, 0), stamp=1.0)
    after = gathered.view()
    x, y, radius = CHAIR
    assert after.occupied[office.cell_of(x, y - radius)], 'its near side stands'
    assert gathered.sweeps == 100_001
    assert np.array_equal(after.occupied, before.occupied)
    assert np.array_equal(after.free, before.free)


def test_what_stands_is_not_fresh_for_long_though_the_clock_was_set_back(office):
    sensor, spot = (2.0, 4.0), np.array([[CHAIR[0], CHAIR[1] - CHAIR[2]]])
    gathered = FloorVisit(office)
    for number in range(10):
        gathered.add(sensor, *sweep(office, [], sensor, number), stamp=3600.0 + 0.2 * number)
    assert gathered.fresh(sensor, spot).all()
    for number in range(10):
        gathered.add(sensor, *sweep(office, [CHAIR], sensor, number), stamp=0.2 * number)
    assert not gathered.fresh(sensor, spot).any()


MAPS = sorted((Path(__file__).resolve().parents[4] / 'shared' / 'maps').glob('*_scan.png'))


@pytest.mark.skipif(not MAPS, reason='the shared maps are not there')
@pytest.mark.parametrize('path', MAPS, ids=lambda path: path.stem)
def test_on_real_floor_plans_a_barrel_is_found_and_nothing_else(path):
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    grid = Grid(np.where(picture[::-1] > 250, 0, 100).astype(np.int8), 0.05)
    free = cv2.distanceTransform((picture[::-1] > 250).astype(np.uint8), cv2.DIST_L2, 5)
    row, column = np.unravel_index(int(free.argmax()), free.shape)
    x, y = grid.centre_of(int(row), int(column))
    room = min(2.0, 0.05 * float(free.max()))
    barrel = (x + 0.6 * room, y, 0.15)

    def look(things: list[tuple[float, float, float]], seed: int) -> FloorView:
        gathered = FloorVisit(grid)
        for number in range(5):
            sensor = (x - 0.3 * room + 0.05 * number, y + 0.02 * number)
            gathered.add(sensor, *sweep(grid, things, sensor, seed + number), stamp=0.2 * number)
        return gathered.view()

    before = look([], 0)
    assert changes(before, look([], 10)) == []
    (found,) = changes(before, look([barrel], 20))
    assert found.change == Change.APPEARED
    assert math.dist(found.position, barrel[:2]) < 0.25
