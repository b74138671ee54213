"""What sweeps and pictures are judged by, beside the plain sums and tables that define it."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch import doors, views
from indoor_watch.doors import DoorState, read_door
from indoor_watch.floor import Change, FloorView, FloorVisit, changes, is_leaf
from indoor_watch.hung_markers import (
    CameraView,
    HungMarkers,
    SeenMarker,
    _box,
    _cut,
    _foreign,
    _is_seen_alike,
    _laid,
)
from indoor_watch.motion import WalkFinder, _steadiness, _things, _walk
from indoor_watch.privacy import MARGIN, _inside
from indoor_watch.reference_views import SAME_VIEW, _overlap, same_view
from indoor_watch.views import Sight

from .marked_walls import camera, hang, seen_at, wall

SIDE = 0.1


def hall() -> Grid:
    """Return a hall of 6 by 4 metres with a pillar, its south-west corner at (-1, 2)."""
    cells = np.zeros((40, 60), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[20:23, 30:33] = 100
    return Grid(cells, SIDE, (-1.0, 2.0))


# --- the floor ---


def sweeps(seed: int, count: int) -> list[tuple[tuple[float, float], np.ndarray, np.ndarray]]:
    """Return where the lidar was, the ends of some beams, and whether something was met."""
    draw = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        sensor = (float(draw.uniform(0, 1)), float(draw.uniform(2.5, 5)))
        angles, ranges = draw.uniform(-3, 3, 60), draw.uniform(0.2, 3.0, 60)
        ends = sensor + ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        ends[0], ends[1] = np.nan, sensor
        found.append((sensor, ends, draw.random(60) < 0.7))
    return found


@pytest.mark.parametrize('seed', range(3))
def test_a_visit_counts_the_beams_that_end_in_a_cell_and_that_pass_it(seed: int) -> None:
    grid, farthest = hall(), 2.5
    visit = FloorVisit(grid, farthest)
    occupied = np.argwhere(grid.occupied)
    shape = grid.cells.shape
    ends_of, passes, met_at = (np.zeros(shape, int) for _ in range(3))
    for number, (sensor, ends, met) in enumerate(sweeps(seed, 4)):
        visit.add(sensor, ends, met, 0.2 * number)
        passed, ended, things = set(), set(), set()
        for end, is_met in zip(ends, met, strict=True):
            length = math.dist(end, sensor)
            if not 1e-3 < length < 99:
                continue
            ray = (end - sensor) / length
            is_end = is_met and length <= farthest
            row, column = (math.floor(v / SIDE) for v in (end[1] - 2.0, end[0] + 1.0))
            if is_end and 0 <= row < 40 and 0 <= column < 60:
                ended.add((row, column))
                wall_away = SIDE * np.hypot(*(occupied - (row, column)).T).min()
                if wall_away > math.hypot(0.12, 0.025 * length):
                    things.add((row, column))
            until = min(length, farthest) - (0.15 if is_end else 0.0)
            for step in range(1, 50):
                if 0.05 * step < until:
                    x, y = sensor + 0.05 * step * ray
                    cell = math.floor((y - 2.0) / SIDE), math.floor((x + 1.0) / SIDE)
                    if 0 <= cell[0] < 40 and 0 <= cell[1] < 60:
                        passed.add(cell)
        for cell in passed - ended:
            passes[cell] += 1
        for cell in things:
            ends_of[cell] += 1
        for cell in ended:
            met_at[cell] = 1
    assert visit.sweeps == 4
    assert (visit._ends == ends_of).all()
    assert (visit._met == met_at).all()
    # A sample may fall on the edge of a cell.
    assert (visit._passes != passes).mean() < 0.002
    passes = visit._passes.astype(int)
    view = visit.view()
    for cell in np.ndindex(shape):
        far = SIDE * np.hypot(*(occupied - cell).T).min() > 0.12
        is_thing = far and ends_of[cell] >= 2 and ends_of[cell] >= 0.3 * (ends_of + passes)[cell]
        moves = far and ends_of[cell] >= 1 and not is_thing and passes[cell] > 3 * ends_of[cell]
        assert view.occupied[cell] == is_thing
        assert view.moving[cell] == moves
        assert view.free[cell] == (passes[cell] >= 2 and not met_at[cell])
        assert view.seen[cell] == (is_thing or moves or view.free[cell])


def fan(sensor: tuple[float, float], ahead: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of beams of 3 m, but of those straight ahead, which are so long."""
    angles = np.linspace(-0.6, 0.6, 121)
    ranges = np.where(np.abs(angles) < 0.06, ahead, 3.0)
    ends = sensor + ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return ends, ranges < 3.0


def test_what_is_met_where_all_was_free_is_fresh() -> None:
    grid, sensor = Grid(np.zeros((60, 80), np.int8), SIDE, (-1.0, -3.0)), (0.0, 0.0)
    visit = FloorVisit(grid)
    point = np.array([[1.5, 0.0]])
    for number in range(3):
        assert visit.fresh(sensor, point).tolist() == [False], 'passed three times at least'
        visit.add(sensor, *fan(sensor, 3.0), 1.0 * number)
    assert visit.fresh(sensor, point).tolist() == [True]
    assert visit.fresh(sensor, np.array([[-0.5, 0.0], [9.0, 0.0]])).tolist() == [False, False]
    # What was met there within half a second may be who is met there now; and then it is known.
    visit.add(sensor, *fan(sensor, 1.5), 3.0)
    visit.add(sensor, *fan(sensor, 3.0), 3.5)
    assert visit.fresh(sensor, point).tolist() == [True]
    visit.add(sensor, *fan(sensor, 3.0), 3.6)
    assert visit.fresh(sensor, point).tolist() == [False]
    # Free again: it was met in no more than 0.15 of the sweeps.
    for number in range(3):
        visit.add(sensor, *fan(sensor, 3.0), 4.0 + number)
        assert visit.fresh(sensor, point).tolist() == [number >= 1]
    # The clock was set back: what was met counts as met long ago.
    visit.add(sensor, *fan(sensor, 1.5), 7.0)
    visit.add(sensor, *fan(sensor, 3.0), 1.0)
    assert visit.fresh(sensor, point).tolist() == [False]
    assert visit.fresh(sensor, np.array([[1.5, 0.5]])).tolist() == [True]


@pytest.mark.parametrize(('x', 'fresh'), [(1.0, True), (2.1, True), (2.5, True), (2.6, False)])
def test_nothing_is_fresh_beside_a_wall(x: float, fresh: bool) -> None:
    cells = np.zeros((60, 80), np.int8)
    cells[:, 38:] = 100  # from x = 2.8 m on
    visit, sensor = FloorVisit(Grid(cells, SIDE, (-1.0, -3.0))), (0.0, 0.0)
    for number in range(4):
        visit.add(sensor, *fan(sensor, 3.0), 1.0 * number)
    # From the middle of a cell to that of the wall, 0.25 m and 0.035 of the distance at least.
    assert visit.fresh(sensor, np.array([[x, 0.0]])).tolist() == [fresh]


def floor(*, occupied: list[tuple[int, int]], free: bool = True) -> FloorView:
    """Return a view of a floor of 4 by 4 metres on which these cells are occupied."""
    mask = np.zeros((40, 40), np.bool_)
    for cell in occupied:
        mask[cell] = True
    return FloorView(
        Grid(np.zeros((40, 40), np.int8), SIDE), mask, ~mask & free, np.zeros_like(mask)
    )


def block(row: int, column: int, height: int, width: int) -> list[tuple[int, int]]:
    return [(row + down, column + right) for down in range(height) for right in range(width)]


def test_what_appears_goes_and_moves_is_told_with_place_size_and_sureness() -> None:
    nothing, thing = floor(occupied=[]), floor(occupied=block(10, 20, 2, 3))
    (new,) = changes(nothing, thing)
    assert (new.change, new.extent) == (Change.APPEARED, pytest.approx(0.3))
    # Half rows are rounded to even ones: the middle of rows 10 and 11, of columns 20 to 22.
    assert new.position == pytest.approx((2.15, 1.05))
    assert new.confidence == pytest.approx(1 - math.exp(-2.0))
    expected = [(2.05 + 0.1 * right, 1.05 + 0.1 * down) for down in (0, 1) for right in (0, 1, 2)]
    assert new.points == pytest.approx(np.array(expected))
    assert new.before is None
    (gone,) = changes(thing, nothing)
    assert (gone.change, gone.position) == (Change.REMOVED, new.position)
    (moved,) = changes(thing, floor(occupied=block(30, 5, 2, 3)))
    assert (moved.change, moved.before) == (Change.MOVED, new.position)
    assert moved.position == pytest.approx((0.65, 3.05))
    assert changes(thing, thing) == []
    # A cell and a half beside is the same one.
    assert changes(thing, floor(occupied=block(11, 21, 2, 3))) == []


def test_a_thing_of_quite_another_size_has_not_moved() -> None:
    one = floor(occupied=block(10, 20, 2, 2))
    kinds = [
        [each.change for each in changes(one, floor(occupied=block(30, 5, 2, width)))]
        for width in (4, 5)
    ]
    # 1.6 times 0.2 m and 0.1 m: the larger ones come first.
    assert kinds == [[Change.MOVED], [Change.APPEARED, Change.REMOVED]]
    two = floor(occupied=[*block(30, 5, 2, 2), *block(10, 32, 2, 2)])
    (first, second) = changes(one, two)
    assert (first.change, second.change) == (Change.MOVED, Change.APPEARED)
    assert first.position == pytest.approx((3.25, 1.05)), 'the nearer one'


@pytest.mark.parametrize(
    ('cells', 'count'),
    [
        (block(10, 20, 1, 1), 0),
        (block(10, 20, 1, 2), 1),
        ([*block(10, 20, 1, 2), *block(10, 27, 1, 2)], 2),
        ([*block(10, 20, 1, 2), *block(10, 26, 1, 2)], 1),
    ],
)
def test_a_thing_is_two_cells_or_more_that_lie_together(
    cells: list[tuple[int, int]], count: int
) -> None:
    assert len(changes(floor(occupied=[]), floor(occupied=cells))) == count


def test_of_what_was_never_in_view_nobody_knows() -> None:
    thing = floor(occupied=block(10, 20, 2, 4))
    dark = floor(occupied=[], free=False)
    assert changes(dark, thing) == []
    assert changes(thing, dark) == []
    half = replace(dark, free=np.indices((40, 40))[1] >= 23)
    # Seen free beside it: of its four columns two, for a cell beside counts.
    (found,) = changes(half, thing)
    assert found.confidence == pytest.approx(0.5 * (1 - math.exp(-8 / 3)))
    assert changes(replace(half, free=np.indices((40, 40))[1] >= 24), thing) == []
    assert changes(thing, half) == [], 'it must be passed through itself'


@pytest.mark.parametrize(
    ('points', 'leaf'),
    [
        ([(0.1, 0.0), (0.9, 0.0)], True),
        ([(0.1, 0.0), (1.02, 0.0)], True),
        ([(0.1, 0.0), (1.04, 0.0)], False),
        ([(0.3, 0.12), (0.8, 0.0)], True),
        ([(0.3, -0.14), (0.8, 0.0)], False),
        ([], False),
    ],
)
def test_a_leaf_is_a_line_from_its_hinge(points: list[tuple[float, float]], leaf: bool) -> None:
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])
    array = np.array(points).reshape(-1, 2)
    assert is_leaf(array + np.array([2.0, 1.0]), (2.0, 1.0), 0.9) is leaf
    assert is_leaf(array @ turn + np.array([2.0, 1.0]), (2.0, 1.0), 0.9) is leaf


# --- what walks ---


def spots(ways: list[float], period: float = 0.3, aside: float = 0.0) -> list:
    """Return where something was met, so far along x, and by turns aside."""
    return [
        (10.0 + period * number, (way, aside * (number % 2))) for number, way in enumerate(ways)
    ]


@pytest.mark.parametrize(
    ('met', 'distance', 'walks'),
    [
        (spots([0.0, 0.13, 0.26, 0.39, 0.52]), 2.0, True),
        (spots([0.0, 0.12, 0.24, 0.36, 0.49]), 2.0, False),
        (spots([0.0, 0.2, 0.4, 0.6]), 2.0, False),
        # Far off it must have gone farther.
        (spots([0.0, 0.16, 0.32, 0.48, 0.61]), 5.0, True),
        (spots([0.0, 0.16, 0.32, 0.48, 0.59]), 5.0, False),
        # To and fro is no way.
        (spots([0.0, 0.2, 0.4, 0.6, 0.8], aside=0.2), 2.0, True),
        (spots([0.0, 0.2, 0.4, 0.6, 0.8], aside=0.3), 2.0, False),
        # One long step, and little else.
        (spots([0.0, 0.15, 0.3, 0.45, 0.75]), 2.0, True),
        (spots([0.0, 0.05, 0.1, 0.15, 0.75]), 2.0, False),
        (spots([0.0, 0.0, 0.8, 0.8, 0.8]), 2.0, False),
        (spots([0.0, 0.15, 0.3, 0.69, 0.8]), 2.0, True),
        (spots([0.0, 0.1, 0.2, 0.7, 0.8]), 2.0, False),
    ],
)
def test_what_walks_goes_far_enough_straight_and_steadily(
    met: list, distance: float, walks: bool
) -> None:
    found = _walk(met, distance)
    assert (found is not None) is walks
    if found is not None:
        assert found.position == met[-1][1]
        way = math.dist(met[0][1], met[-1][1])
        assert found.speed == pytest.approx(way / (met[-1][0] - met[0][0]))


@pytest.mark.parametrize('seed', range(4))
def test_steadiness_is_the_part_that_a_line_over_time_explains(seed: int) -> None:
    draw = np.random.default_rng(seed)
    times, at = np.sort(draw.uniform(0, 3, 8)), draw.normal(0, 1, (8, 2))
    at[:, 0] += seed * times
    rest = sum(float(np.polyfit(times, column, 1, full=True)[1][0]) for column in at.T)
    whole = float(((at - at.mean(axis=0)) ** 2).sum())
    found = _steadiness([(t, tuple(p)) for t, p in zip(times, at, strict=True)])
    assert found == pytest.approx(1 - rest / whole)


def test_things_are_groups_as_large_as_a_person_that_stand_alone() -> None:
    legs = np.array([[1.0, 1.0], [1.0, 1.4], [3.0, 1.0], [3.1, 1.0], [5.0, 5.0]])
    # One point alone is no thing.
    assert np.sort(_things(legs, legs), axis=0) == pytest.approx(
        np.array([[1.0, 1.0], [3.05, 1.2]])
    )
    apart = np.array([[1.0, 1.0], [1.0, 1.46]])
    assert _things(apart, apart) == []
    assert _things(legs[:1], legs) == []
    row = np.array([[0.4 * n, 0.0] for n in range(4)])
    assert _things(row, row) == [], 'longer than a person'
    assert len(_things(row[:3], row[:3])) == 1
    # What hangs together with a wall is the wall's end.
    wall_end = np.array([[3.0, 1.0 - 0.2 * n] for n in range(7)])
    assert _things(legs[2:4], np.vstack([legs, wall_end])) == []
    assert len(_things(legs[2:4], np.vstack([legs, wall_end[:4]]))) == 1
    assert len(_things(legs[2:4], np.vstack([legs, wall_end - (0.26, 0.0)]))) == 1


def walked(finder: WalkFinder, begin: float, steps: int, speed: float = 0.5, beams: int = 360):
    """Have something walk along x in steps of 0.3 s, and return what is told in the end."""
    found: list = []
    for number in range(steps):
        x = speed * 0.3 * number
        points = np.array([[x, 1.0], [x, 1.2]])
        found = finder.add((0.0, -1.0), points, points, beams, begin + 0.3 * number)
    return found


def test_a_walk_is_told_from_its_fifth_spot_on() -> None:
    for steps, told in ((4, 0), (5, 1), (9, 1)):
        found = walked(WalkFinder(), 5.0, steps)
        assert len(found) == told
        for walk in found:
            assert walk.position == pytest.approx((0.15 * (steps - 1), 1.1))
            assert walk.speed == pytest.approx(0.5)
    finder = WalkFinder()
    walked(finder, 5.0, 4)
    finder.clear()
    assert walked(finder, 6.2, 4) == []
    assert walked(WalkFinder(), 5.0, 8, beams=8) == [walked(WalkFinder(), 5.0, 8)[0]]
    assert walked(WalkFinder(), 5.0, 8, beams=7) == [], 'the pose is wrong'


@pytest.mark.parametrize(('speed', 'told'), [(2.4, True), (3.3, False)])
def test_nobody_is_faster_than_a_person(speed: float, told: bool) -> None:
    assert bool(walked(WalkFinder(), 5.0, 8, speed)) is told


@pytest.mark.parametrize(('door', 'told'), [((0.3, 0.8, 0.3, 0.0), False), ((0, 9, 1, 9), True)])
def test_a_leaf_that_swings_does_not_walk(
    door: tuple[float, float, float, float], told: bool
) -> None:
    assert bool(walked(WalkFinder([door]), 5.0, 7)) is told


def test_spots_of_one_moment_are_one_and_old_ones_are_forgotten() -> None:
    finder = WalkFinder()
    for number in range(12):
        points = np.array([[0.06 * number, 1.0], [0.06 * number, 1.2]])
        found = finder.add((0.0, 0.0), points, points, 360, 0.09 * number)
        (track,) = finder._tracks
        assert len(track.spots) == 1 + math.ceil(number / 2)
    assert len(found) == 1
    finder.add((0.0, 0.0), points, points, 360, 3.3)
    assert track.spots[0][0] == pytest.approx(0.36)
    finder.add((0.0, 0.0), points[:0], points, 360, 6.4)
    assert finder._tracks == []


# --- doors ---

OPENING = (-0.45, 0.0, 0.45, 0.0)


def plainly_read(door, sensor, ends):
    """Return state, confidence, angle and beams of a door, beam by beam and leaf by leaf."""
    first, second, origin = (np.array(each, float) for each in (door[:2], door[2:], sensor))
    width = math.dist(first, second)

    def crossing(ray, start, end):
        matrix = np.column_stack([ray, start - end])
        if abs(np.linalg.det(matrix)) < 1e-12:
            return math.inf, math.inf
        distance, part = np.linalg.solve(matrix, start - origin)
        return (distance, part) if distance > 0 else (math.inf, math.inf)

    beams = []
    for end in ends:
        length = math.dist(end, origin)
        if not (math.isfinite(length) and length > 1e-3):
            continue
        ray = (end - origin) / length
        to_line, along = crossing(ray, first, second)
        through = math.isfinite(to_line) and 0.1 < along < 0.9
        seen = through and length > to_line - width
        nearest = origin + ray * min(max((first - origin) @ ray, 0.0), length)
        near = seen or (math.dist(nearest, first) < width and length > 0.3)
        if near:
            beams.append((ray, length, to_line, seen, along))
    counted = [each for each in beams if each[3]]
    if len(counted) < 6 or np.ptp([each[4] for each in counted]) < 0.4:
        return None

    def plain(length, to_line, seen):
        beyond = length - (to_line if math.isfinite(to_line) else 0.0)
        free = 1.0
        if seen:
            free = 0.0 if beyond <= 0.1 else 0.2 if beyond <= width else 1.0
        return math.log(0.05 + 0.95 * free)

    none = sum(plain(*each[1:4]) for each in beams)
    fits = {state: [] for state in DoorState}
    for hinge, other in ((first, second), (second, first)):
        for side in (1, -1):
            for degrees in range(0, 121, 3):
                turn = side * math.radians(degrees)
                x, y = other - hinge
                cos, sin = math.cos(turn), math.sin(turn)
                tip = hinge + np.array([cos * x - sin * y, sin * x + cos * y])
                worth = none
                for ray, length, to_line, seen, _ in beams:
                    expected, part = crossing(ray, hinge, tip)
                    if math.isfinite(expected) and 0 <= part <= 1:
                        error = length - expected
                        hit = 0.0 if error < -0.2 else math.exp(-0.5 * (error / 0.05) ** 2)
                        worth += math.log(0.05 + 0.95 * hit) - plain(length, to_line, seen)
                state = 'closed' if degrees < 7 else 'open' if degrees >= 60 else 'ajar'
                fits[DoorState(state)].append((worth, math.radians(degrees)))
    fits[DoorState.OPEN] += [(none, math.inf)] * len(fits[DoorState.OPEN])
    worths = {
        state: np.mean([math.exp(worth / 1.5) for worth, _ in some]) for state, some in fits.items()
    }
    state = max(worths, key=lambda each: worths[each])
    angle = max(fits[state], key=lambda each: each[0])[1]
    return state, worths[state] / sum(worths.values()), angle, len(counted)


@pytest.mark.parametrize('angle', [0, 20, 50, 75, 110, None])
@pytest.mark.parametrize('sensor', [(0.2, -1.2), (-0.7, -0.9), (0.4, 1.3)])
def test_a_door_is_read_as_each_beam_and_each_leaf_say(
    sensor: tuple[float, float], angle: int | None
) -> None:
    draw = np.random.default_rng(angle or 0)
    ends = []
    for heading in np.linspace(-math.pi, math.pi, 180, endpoint=False):
        ray = np.array([math.cos(heading), math.sin(heading)])
        length = 2.6
        lines = [((-4.0, 0.0), (-0.45, 0.0)), ((0.45, 0.0), (4.0, 0.0))]
        if angle is not None:
            turn = math.radians(angle)
            lines.append(((-0.45, 0.0), (-0.45 + 0.9 * math.cos(turn), 0.9 * math.sin(turn))))
        for start, end in lines:
            matrix = np.column_stack([ray, np.subtract(start, end)])
            if abs(np.linalg.det(matrix)) < 1e-9:
                continue
            distance, part = np.linalg.solve(matrix, np.subtract(start, sensor))
            if distance > 0 and 0 <= part <= 1:
                length = min(length, distance + draw.normal(0, 0.02))
        ends.append(sensor + length * ray)
    ends[5], ends[6] = np.array([np.nan, 0.0]), np.array(sensor)
    found = read_door(OPENING, sensor, np.array(ends))
    expected = plainly_read(OPENING, sensor, np.array(ends))
    assert found is not None
    assert expected is not None
    state, confidence, leaf, beams = expected
    assert (found.state, found.beams) == (state, beams)
    assert found.confidence == pytest.approx(confidence, rel=1e-6)
    assert found.angle == pytest.approx(leaf)
    few = read_door(OPENING, sensor, np.array(ends[::3]))
    assert (few is None) == (plainly_read(OPENING, sensor, np.array(ends[::3])) is None)


def test_each_state_of_a_door_has_its_angles() -> None:
    degrees = (0, 6.9, 7.1, 59, 61, 119)
    states = [doors._state(math.radians(each)) for each in degrees]
    assert [str(each) for each in states] == ['closed', 'closed', 'ajar', 'ajar', 'open', 'open']


# --- views ---


def test_windows_correlate_as_numpy_says() -> None:
    draw = np.random.default_rng(2)
    first = draw.uniform(0, 250, (14, 18)).astype(np.float32)
    second = (0.4 * first + draw.uniform(0, 150, (14, 18))).astype(np.float32)
    first[:5, :6], second[9:, 10:] = 3.0, 252.0
    found = views._correlation(first, second, 5)
    one, other = (np.pad(each, 2, mode='reflect').astype(float) for each in (first, second))
    single = np.zeros((14, 18))
    for row, column in np.ndindex(14, 18):
        a, b = (each[row : row + 5, column : column + 5].ravel() for each in (one, other))
        together = float(np.mean((a - a.mean()) * (b - b.mean())))
        single[row, column] = (together + 12.5) / (a.std() * b.std() + 12.5)
        assert found.deviation[row, column] == pytest.approx(max(a.std(), b.std()), abs=0.05)
        exposed = min(a.mean(), b.mean()) > 8 and max(a.mean(), b.mean()) < 247
        assert found.exposed[row, column] == exposed
    for row, column in np.ndindex(14, 18):
        around = single[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        assert found.best[row, column] == pytest.approx(around.max(), abs=2e-3)


def test_colours_are_put_into_classes_and_what_is_common_to_one_is_its_median() -> None:
    ratios = np.array([[(-1.2, -1.2), (-1.05, -1.2), (-9.0, 9.0), (0.02, -0.1)]], np.float32)
    grey = np.array([[0.0, 64.0, 255.0, 130.0]], np.float32)
    assert views._classes(ratios, grey).tolist() == [
        [0, 16 * 4 + 1, 15 * 4 + 3, (8 * 16 + 7) * 4 + 2]
    ]
    draw = np.random.default_rng(3)
    classes = draw.integers(0, 5, (60, 80)).astype(np.int32)
    change = draw.normal(0, 1, (60, 80, 2)).astype(np.float32)
    counted = draw.random((60, 80)) < 0.8
    found = views._common(change, classes, counted)
    some, values = classes[counted][::3], change[counted][::3]
    for number in range(5):
        of_class = values[some == number]
        of_class = of_class[:: max(1, len(of_class) // 400)]
        assert found[classes == number] == pytest.approx(
            np.broadcast_to(np.median(of_class, axis=0), (int((classes == number).sum()), 2))
        )
    assert (views._common(change, classes + 9, counted & False) == 0).all()


@pytest.mark.parametrize(
    ('before', 'now', 'gain'),
    [(99, 49, 1.0), (99, 32, 1.0), (99, 31, 100 / 32), (99, 11, 100 / 12), (99, 10, None)],
)
def test_a_dim_picture_is_brightened_by_what_it_lacks(
    before: int, now: int, gain: float | None
) -> None:
    one, other = (np.full((4, 4), each, np.uint8) for each in (before, now))
    assert views._gain(one, other) == (gain if gain is None else pytest.approx(gain))


@pytest.mark.parametrize(
    ('other', 'touch'),
    [
        ((10, 10, 5, 5), True),
        ((14, 14, 5, 5), True),
        ((15, 10, 5, 5), False),
        ((10, 15, 5, 5), False),
        ((5, 10, 5, 5), False),
        ((6, 6, 5, 5), True),
        ((0, 12, 40, 1), True),
    ],
)
def test_boxes_touch_where_they_share_a_pixel(
    other: tuple[int, int, int, int], touch: bool
) -> None:
    assert views._touch((10, 10, 5, 5), other) is touch
    assert views._touch(other, (10, 10, 5, 5)) is touch


def test_regions_are_told_the_largest_first_in_pixels_of_the_picture() -> None:
    mask = np.zeros((100, 200), np.uint8)
    mask[10:20, 20:40] = 1
    mask[60:90, 100:130] = 1
    mask[40:45, 150:160] = 1  # 0.0025 of the picture
    strength = np.zeros((100, 200), np.float32)
    strength[10:20, 20:40], strength[60:90, 100:130] = 0.4, 1.5
    large, small = views._regions(mask, strength, 2.0)
    assert large.box == (200, 120, 60, 60)
    assert (large.area, large.confidence) == (pytest.approx(900 / 20000), 1.0)
    assert small.box == (40, 20, 40, 20)
    assert (small.area, small.confidence) == (pytest.approx(0.01), pytest.approx(0.4))
    assert not large.may_be_light
    near = np.zeros((100, 200), np.uint8)
    near[10:20, 20:40] = near[10:20, 48:68] = 1
    (joined,) = views._regions(near, strength, 1.0)
    assert joined.box == (20, 10, 48, 10)


def test_pictures_are_compared_at_one_width() -> None:
    wide = np.zeros((270, 960, 3), np.uint8)
    assert views._scaled(wide).shape == (135, 480, 3)
    narrow = np.zeros((90, 480), np.uint8)
    assert views._scaled(narrow) is narrow
    assert views.grey_of(narrow) is narrow
    assert views._scaled(np.zeros((1, 5000), np.uint8)).shape == (1, 480)


def test_a_picture_is_laid_over_another_as_it_was_taken() -> None:
    draw = np.random.default_rng(4)
    before = cv2.resize(draw.integers(30, 220, (40, 60)).astype(np.uint8), (480, 320))
    true = np.array([[1.02, 0.01, -6.0], [-0.01, 0.99, 4.0], [0.0, 0.0, 1.0]])
    now = cv2.warpPerspective(before, np.linalg.inv(true), (480, 320))
    onto = views.registration(before, now)
    assert onto is not None
    for corner in ((60.0, 60.0), (400.0, 60.0), (60.0, 260.0), (400.0, 260.0)):
        x, y, w = onto @ (*corner, 1.0)
        expected = true @ (*corner, 1.0)
        assert (x / w, y / w) == pytest.approx(expected[:2].tolist(), abs=2.0)
    assert views.registration(before, np.full_like(before, 120)) is None
    smaller = cv2.resize(before, (240, 160))
    assert views.registration(before, smaller) is None, 'four times as large is another view'
    assert views.sight_of(before) == Sight.CLEAR


def test_light_and_its_shadows_are_taken_out_and_a_thing_is_not() -> None:
    draw = np.random.default_rng(6)
    before = cv2.resize(draw.integers(90, 200, (48, 64)).astype(np.uint8), (320, 240))
    covered = np.ones((240, 320), np.bool_)
    lit = np.clip(before * 0.7, 0, 255)
    lit[:, 160:] *= 0.8
    thing = lit.copy()
    thing[100:140, 60:110] = draw.integers(20, 200, (40, 50))
    found = views._differences(before, lit.astype(np.uint8), covered)
    assert found.correlation[20:-20, 20:-20].min() > 0.8
    assert (found.colour == 0).all()
    assert found.judged.all()
    found = views._differences(before, thing.astype(np.uint8), covered)
    assert found.correlation[110:130, 75:95].max() < 0.5
    away = np.ones_like(covered)
    away[80:160, 40:130] = False
    assert found.correlation[20:-20, 20:-20][away[20:-20, 20:-20]].min() > 0.8
    dark = views._differences(before, (before * 0.15).astype(np.uint8), covered)
    assert not dark.judged[:, 20:300].all()
    none = views._differences(before, thing.astype(np.uint8), ~covered)
    assert not none.judged.any()


def test_another_colour_is_one_and_what_the_lamp_does_to_all_is_none() -> None:
    draw = np.random.default_rng(8)
    base = cv2.resize(draw.integers(80, 160, (12, 16)).astype(np.uint8), (160, 120))
    before = np.stack([base, base, base], axis=2)
    tinted = np.clip(before * (0.8, 1.0, 1.2), 0, 255).astype(np.uint8)
    covered = np.ones((120, 160), np.bool_)

    def change(now: np.ndarray) -> np.ndarray:
        first, second = (views.grey_of(each).astype(np.float32) for each in (before, now))
        return views._colour_change(before, now, first, second, covered)

    assert change(tinted).max() < 0.06
    painted = tinted.copy()
    painted[40:80, 50:100, 2] = (painted[40:80, 50:100, 2] * 0.5).astype(np.uint8)
    found = change(painted)
    assert found[50:70, 60:90].min() > 0.22
    assert found[:30].max() < 0.1
    shadow = (tinted * 0.6).astype(np.uint8)
    assert change(shadow).max() < 0.12
    assert (change((tinted * 0.1).astype(np.uint8)) == 0).all(), 'in the dark there is no colour'


# --- markers ---


def test_a_point_is_in_the_picture_where_the_pinhole_has_it() -> None:
    view = camera(y=0.5, deviation=0.03, turn=0.02)
    points = np.array([[2.0, 0.5, 1.0], [2.0, 0.0, 1.25], [4.0, 1.5, 0.5], [-1.0, 0.0, 1.0]])
    found = view.pixels(points)
    assert found[0] == pytest.approx((159.5, 119.5))
    assert found[1] == pytest.approx((159.5 + 320 * 0.25, 119.5 - 320 * 0.125))
    assert found[2] == pytest.approx((159.5 - 320 * 0.25, 119.5 + 320 * 0.125))
    assert np.isnan(found[3]).all(), 'behind the camera'
    assert view.doubt(points[0]) == pytest.approx(math.hypot(0.03, 0.04))
    rotation = view.pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    onto = view.onto_wall(points[0], rotation)
    for x, y in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.2)):
        u, v, w = onto @ (x, y, 1.0)
        assert (u / w, v / w) == pytest.approx((159.5 + 160 * x, 119.5 - 160 * y))


@pytest.mark.parametrize(
    ('values', 'placed'),
    [
        ({}, True),
        ({'position': None}, False),
        ({'position': np.array([0.0, -100.0, 2.0])}, True),
        ({'position': np.array([0.0, -100.1, 2.0])}, False),
        ({'side': 0.0}, False),
        ({'side': 10.0}, True),
        ({'side': 10.1}, False),
        ({'covariance': np.eye(3) * 1e4}, True),
        ({'covariance': np.eye(3) * -1.1e4}, False),
        ({'covariance': np.eye(3) * np.nan}, False),
    ],
)
def test_a_marker_is_placed_where_a_camera_can_measure(values: dict, placed: bool) -> None:
    seen = replace(SeenMarker(3, 0.2, np.array([0.0, 0.0, 2.0])), **values)
    assert seen.is_placed is placed


@pytest.mark.parametrize(
    ('deviation', 'turn', 'x', 'known'),
    [(100.0, 100.0, 1e8, True), (100.1, 0, 0, False), (0, 100.1, 0, False), (0, 0, -1.1e8, False)],
)
def test_a_camera_that_may_be_anywhere_is_nowhere(
    deviation: float, turn: float, x: float, known: bool
) -> None:
    pose = np.eye(4)
    pose[0, 3] = x
    assert CameraView(pose, np.eye(3), deviation, turn).is_known is known


@pytest.mark.parametrize(
    ('other', 'share', 'alike'),
    [
        ((2.0, 0.0, 0.0), 1.0, True),
        ((3.19, 0.0, 0.0), 1.0, True),
        ((3.21, 0.0, 0.0), 1.0, False),
        ((1.26, 0.0, 0.0), 1.0, True),
        ((1.24, 0.0, 0.0), 1.0, False),
        ((2.52, 0.0, 0.0), 0.5, True),
        ((2.54, 0.0, 0.0), 0.5, False),
        ((2 * math.cos(0.34), 2 * math.sin(0.34), 0.0), 1.0, True),
        ((2 * math.cos(0.36), 2 * math.sin(0.36), 0.0), 1.0, False),
        ((2 * math.cos(0.17), 0.0, 2 * math.sin(0.17)), 0.5, True),
        ((2 * math.cos(0.18), 0.0, 2 * math.sin(0.18)), 0.5, False),
    ],
)
def test_a_marker_is_seen_alike_from_about_there(
    other: tuple[float, float, float], share: float, alike: bool
) -> None:
    picture, markers = wall(), HungMarkers()
    seen = hang(picture, 14, 140, 100)
    markers.take(picture, camera(), [seen], 1)
    aspect = replace(
        markers._spots[14].aspects[0], camera=np.array([3.0, 1.0, 1.0]), position=np.ones(3)
    )
    camera_at = np.ones(3) + other
    assert _is_seen_alike(aspect, camera_at, share) is alike


def test_a_place_is_the_mean_of_readings_by_their_weights() -> None:
    picture, markers = wall(), HungMarkers()
    hang(picture, 14, 140, 100)
    position, covariance = None, None
    for number, left in enumerate((140, 144, 138, 141)):
        view = camera(deviation=0.01 * (1 + number), turn=0.0)
        seen = seen_at(14, left, 100)
        assert seen.position is not None
        at = view.pose[:3, :3] @ seen.position + view.at
        doubt = np.eye(3) * (1e-4 + (0.01 * (1 + number)) ** 2)
        markers.take(picture, view, [seen], 1)
        if position is None or covariance is None:
            position, covariance = at, doubt
        else:
            gain = covariance @ np.linalg.inv(covariance + doubt)
            position = position + gain @ (at - position)
            covariance = (np.eye(3) - gain) @ covariance + np.eye(3) * 1e-4
        assert markers.position_of(14) == pytest.approx(position.tolist())
        assert markers._spots[14].covariance == pytest.approx(covariance)
        assert markers._spots[14].pictures == number + 1
    assert markers.position_of(15) is None


def test_markers_read_in_passing_tell_where_to_look() -> None:
    markers = HungMarkers({3: (9.0, 9.0, 1.0)})
    pose = camera(y=0.5).pose
    near = SeenMarker(7, 0.2, np.array([0.0, 0.0, 7.9]))
    far = SeenMarker(8, 0.2, np.array([0.0, 0.0, 8.1]))
    known, nowhere = SeenMarker(3, 0.2, np.array([0.0, 0.0, 2.0])), SeenMarker(5)
    markers.pass_by(pose, [near, far, known, nowhere])
    given, passed = markers.spots()
    assert (given.number, given.position, given.facing, given.side) == (3, (9.0, 9.0, 1.0), None, 0)
    assert (passed.number, passed.side, passed.is_open) == (7, 0.2, False)
    assert passed.position == pytest.approx((7.9, 0.5, 1.0))
    assert passed.facing == pytest.approx(math.pi)
    markers.pass_by(pose, [replace(near, position=np.array([0.0, 0.0, 4.0]))])
    assert markers.spots()[1].position == pytest.approx((4.0, 0.5, 1.0))
    picture = wall()
    markers.take(picture, camera(), [hang(picture, 7, 140, 100)], 1)
    read = markers.spots()[1]
    assert read.position == pytest.approx((2.0, 0.05, 1.05), abs=0.01)
    assert read.facing == pytest.approx(math.pi)


def test_the_middle_of_a_square_of_pixels() -> None:
    values = np.arange(64 * 64).reshape(64, 64)
    assert _cut(values, 0.5).tolist() == values[24:40, 24:40].tolist()
    mask = _box(64, 1.0)
    assert mask.sum() == 32 * 32
    assert mask[16, 16]
    assert mask[47, 47]
    assert not mask[15, 16]
    assert not mask[16, 48]


def test_surroundings_are_laid_where_they_fit_and_in_the_middle_where_nothing_does() -> None:
    now = wall(3)[:100, :100]
    before = now[13:93, 6:86].copy()
    judged = np.ones((80, 80), np.bool_)
    judged[30:50, 30:50] = False
    before[30:50, 30:50] = 0
    assert _laid(before, judged, now) == (13, 6)
    assert _laid(wall(9)[:80, :80], judged, now) == (10, 10)
    assert _laid(now, np.ones((100, 100), np.bool_), now) == (0, 0)
    assert _laid(np.full((80, 80), 90, np.uint8), judged, np.full((100, 100), 90, np.uint8)) == (
        10,
        10,
    )


@pytest.mark.parametrize('gain', [1.0, 0.6])
def test_foreign_pixels_are_those_of_another_surface_and_not_of_another_light(gain: float) -> None:
    before = wall(5)[:90, :90]
    judged = np.ones((90, 90), np.bool_)
    judged[35:55, 35:55] = False
    slope = 1.0 + 0.15 * (np.arange(90) / 90 - 0.5)
    lit = np.clip(before * gain * slope[:, None, None], 0, 255).astype(np.uint8)
    assert _foreign(before, lit, judged, gain) == 0.0
    covered = lit.copy()
    covered[10:22, 60:80] = np.array([15, 230, 15])
    found = _foreign(before, covered, judged, gain)
    assert found == pytest.approx(12 * 20, abs=70)
    covered[35:55, 35:55] = 0
    assert _foreign(before, covered, judged, gain) == pytest.approx(found, abs=30)
    few = np.zeros_like(judged)
    few[:10, :10] = True
    assert _foreign(before, lit, few, gain) == 100.0, 'too little to judge by'
    assert _foreign(before, np.zeros_like(before), judged, gain) > 0.9 * judged.sum()


@pytest.mark.parametrize(
    ('other', 'same'),
    [
        ((1.0, 2.0, 0.5, 0.1), True),
        ((1.0 + SAME_VIEW[0] - 0.001, 2.0, 0.5, 0.1), True),
        ((1.0, 2.0 - SAME_VIEW[0] - 0.001, 0.5, 0.1), False),
        ((1.0, 2.0, 0.5 + SAME_VIEW[1] - 0.001 - math.tau, 0.1), True),
        ((1.0, 2.0, 0.5 - SAME_VIEW[1] - 0.001, 0.1), False),
        ((1.0, 2.0, 0.5, 0.1 + SAME_VIEW[1] + 0.001), False),
        ((1.0, 2.0, 0.5), False),
        ((1.0, 2.0, 0.5, 0.1, 0.0), False),
    ],
)
def test_two_viewpoints_show_the_same_within_a_way_and_a_turn(
    other: tuple[float, ...], same: bool
) -> None:
    assert same_view((1.0, 2.0, 0.5, 0.1), other) is same
    assert same_view(other, (1.0, 2.0, 0.5, 0.1)) is same


def test_parts_overlap_by_their_common_area_of_the_whole() -> None:
    assert _overlap((0, 0, 4, 4), (2, 2, 4, 4)) == pytest.approx(4 / 28)
    assert _overlap((0, 0, 4, 4), (4, 0, 4, 4)) == 0.0
    assert _overlap((0, 0, 4, 4), (9, 9, 4, 4)) == 0.0
    assert _overlap((1, 1, 3, 2), (1, 1, 3, 2)) == 1.0
    assert _overlap((0, 0, 0, 0), (0, 0, 0, 0)) == 0.0


def test_a_person_is_blurred_with_a_margin_up_to_the_edge_of_the_picture() -> None:
    assert _inside((100, 50, 40, 20), 300, 400) == (
        round(100 - MARGIN * 40),
        round(50 - MARGIN * 20),
        round(100 + (1 + MARGIN) * 40) - round(100 - MARGIN * 40),
        round(50 + (1 + MARGIN) * 20) - round(50 - MARGIN * 20),
    )
    assert _inside((0, 0, 400, 300), 300, 400) == (0, 0, 400, 300)
    assert _inside((390, 295, 40, 20), 300, 400)[2:] == (
        400 - round(390 - MARGIN * 40),
        300 - round(295 - MARGIN * 20),
    )
    assert _inside((500, 400, 10, 10), 300, 400)[2:] == (0, 0)
