"""What the lidar sees beside the map: where it is, how long it counts, and when it is gone."""

from __future__ import annotations

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation.driving.obstacle_memory import ObstacleMemory
from lidar_navigation.geometry import Scan

ANGLES = np.arange(-40.0, 41.0, dtype=np.float64) * 0.02
"""Rays ahead, 2 cm apart at 1 m."""
HOME = (0.0, 0.0, 0.0)
STRAIGHT = 40
ASIDE = 46
"""The ray that meets the third cell to the left at 1 m."""


def hall(*occupied: tuple[int, int]) -> Grid:
    """Return 8 x 8 m around the robot, with walls at the rim and further cells (row, column)."""
    cells = np.zeros((160, 160), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    for cell in occupied:
        cells[cell] = 100
    return Grid(cells, 0.05, (-4.0, -4.0))


def rays(seen: dict[int, float]) -> Scan:
    """Return a scan of which only some rays tell anything: the number of a ray, how far it went."""
    ranges = np.full(len(ANGLES), np.nan)
    for ray, far in seen.items():
        ranges[ray] = far
    return Scan(ANGLES, ranges, 3.5)


def through(first: int, last: int) -> Scan:
    """Return a scan of rays that meet nothing."""
    return rays(dict.fromkeys(range(first, last + 1), np.inf))


NOTHING_KNOWN = rays({})
AHEAD = rays({STRAIGHT: 1.02})
BESIDE_IT = rays({ASIDE: 1.03})
"""(1.02, 0.12): two cells to the left of what is ahead."""


def test_an_obstacle_is_the_middle_of_its_cell():
    memory = ObstacleMemory(hall())
    assert memory.update(HOME, AHEAD, 0.0)
    assert memory.points == pytest.approx(np.array([[1.025, 0.025]]))
    assert memory.stay.tolist() == [False]
    assert not memory.update(HOME, rays({STRAIGHT: 1.04}), 1.0), 'it is in the same cell'
    assert memory.update((0.0, -1.0, 0.0), AHEAD, 2.0)
    assert memory.points == pytest.approx(np.array([[1.025, -0.975], [1.025, 0.025]]))


def test_what_lies_beyond_the_reach_is_not_taken():
    memory = ObstacleMemory(hall(), reach=2.0)
    assert not memory.update(HOME, rays({STRAIGHT: 2.001}), 0.0)
    assert memory.update(HOME, rays({STRAIGHT: 2.0}), 0.0)


def test_what_may_move_is_not_remembered():
    memory = ObstacleMemory(hall())
    scan = rays({STRAIGHT: 1.02, ASIDE: 1.03})
    memory.update(HOME, scan, 0.0, lambda points: points[:, 1] > 0.1)
    assert memory.points == pytest.approx(np.array([[1.025, 0.025]]))


@pytest.mark.parametrize(('apart', 'taken'), [(0.19, True), (0.21, False)])
def test_what_is_near_to_the_map_s_is_the_map_s(apart: float, taken: bool):
    # The cell at row 80 and column 104 has its middle at (1.225, 0.025).
    known = hall((80, 104))
    assert ObstacleMemory(known, apart=apart).update(HOME, rays({STRAIGHT: 1.025}), 0.0) is taken
    later = ObstacleMemory(hall(), apart=apart)
    later.update(HOME, AHEAD, 0.0)
    later.set_map(known)
    assert len(later.points) == taken, 'also when the map learns of it'


def test_another_map_takes_what_it_has_and_leaves_the_rest():
    memory = ObstacleMemory(hall())
    memory.update(HOME, rays({STRAIGHT: 1.02, 0: 2.0, 80: 2.0}), 0.0)
    assert len(memory.points) == 3
    memory.set_map(hall((80, 100)))
    assert len(memory.points) == 2
    assert (np.abs(memory.points[:, 1]) > 1.4).all()


@pytest.mark.parametrize(
    ('pose', 'apart', 'unknown'),
    [((0.0, 0.0), 3.9, True), ((0.0, 0.0), 4.0, False), ((9.0, 0.0), 0.1, False)],
    ids=['far from all', 'not so far', 'off the map'],
)
def test_unknown_is_what_the_map_has_nothing_near_to(pose, apart: float, unknown: bool):
    assert ObstacleMemory(hall()).is_unknown(np.array([pose]), apart).tolist() == [unknown]


def test_off_the_map_nothing_is_unknown_on_any_side():
    around = np.array([[5.0, 0.0], [-5.0, 0.0], [0.0, 5.0], [0.0, -5.0], [40.0, 40.0]])
    memory = ObstacleMemory(Grid(np.zeros((160, 160), np.int8), 0.05, (-4.0, -4.0)))
    assert not memory.is_unknown(around, 0.1).any()


def test_an_obstacle_that_is_not_seen_again_is_kept_for_its_time():
    memory = ObstacleMemory(hall(), keep=10.0)
    memory.update(HOME, AHEAD, 5.0)
    assert not memory.update(HOME, NOTHING_KNOWN, 15.0)
    assert len(memory.points) == 1
    assert memory.update(HOME, NOTHING_KNOWN, 15.1)
    assert memory.points.shape == (0, 2)
    assert memory.stay.shape == (0,)


@pytest.mark.parametrize(
    ('moments', 'stays'),
    [
        ((0, 5, 10, 15, 20, 25, 30), True),
        ((0, 5, 10, 15, 20, 25, 29), False),
        ((0, 5, 10, 15.1, 20, 25, 30), False),
        ((0, 5, 10, 15, 20, 25, 30, 90), True),
    ],
    ids=['long', 'not quite', 'another one perhaps', 'for ever'],
)
def test_what_stands_for_long_without_a_gap_stays(moments: tuple[float, ...], stays: bool):
    memory = ObstacleMemory(hall(), settle=30.0, gap=5.0)
    for moment in moments:
        memory.update(HOME, AHEAD, float(moment))
    assert memory.stay.tolist() == [stays]


def test_that_something_stays_from_now_on_is_a_change():
    memory = ObstacleMemory(hall(), settle=10.0, gap=5.0)
    changed = [memory.update(HOME, AHEAD, float(moment)) for moment in (0, 5, 10, 15)]
    assert changed == [True, False, True, False]


@pytest.mark.parametrize(
    ('cells', 'stays'), [(1, True), (2, True), (3, False)], ids=['beside', 'near', 'apart']
)
@pytest.mark.parametrize('sign', [1, -1])
def test_what_lies_within_two_cells_is_one_thing(cells: int, stays: bool, sign: int):
    memory = ObstacleMemory(hall(), settle=10.0, gap=5.0)
    for moment in (0, 5, 10):
        memory.update(HOME, AHEAD, float(moment))
    # Its middle ray goes through the cell so many cells to the left or to the right.
    y = 0.025 + sign * 0.05 * cells
    ray = STRAIGHT + round(np.arctan2(y, 1.025) / 0.02)
    seen = rays({ray: 1.025 / np.cos(ANGLES[ray])})
    memory.update(HOME, seen, 10.0)
    assert memory.points[:, 1] == pytest.approx(np.sort([0.025, y]))
    assert memory.stay.all() == stays


def test_where_a_ray_went_through_somebody_new_has_come():
    memory = ObstacleMemory(hall(), settle=10.0, gap=5.0)
    for moment in (0, 5, 10, 15):
        free = through(ASIDE - 3, ASIDE + 3) if moment == 5 else NOTHING_KNOWN
        memory.update(HOME, AHEAD, float(moment))
        memory.update(HOME, free, float(moment))
    memory.update(HOME, BESIDE_IT, 14.0)
    assert memory.stay.tolist() == [True, False], 'here since 5 s at most'
    memory.update(HOME, BESIDE_IT, 15.0)
    assert memory.stay.tolist() == [True, True]


@pytest.mark.parametrize(
    ('free', 'gone'),
    [
        (through(38, 42), True),
        (through(40, 42), True),
        (through(41, 44), False),
        (rays({40: np.inf, 41: np.inf, 42: 1.05}), False),
        (rays(dict.fromkeys(range(38, 45), 1.13)), True),
        (rays(dict.fromkeys(range(38, 45), 1.12)), False),
    ],
    ids=['through it', 'just', 'beside it', 'a neighbour ends', 'beyond it', 'behind it'],
)
def test_an_obstacle_is_gone_when_the_rays_around_it_go_on_behind_it(free: Scan, gone: bool):
    memory = ObstacleMemory(hall())
    # Its cell's middle is 1.0253 m away, 0.0244 rad to the left: the ray after the straight one.
    memory.update(HOME, AHEAD, 0.0)
    assert memory.update(HOME, free, 1.0, lambda points: np.ones(len(points), np.bool_)) is gone
    assert len(memory.points) == (not gone)


def test_only_what_the_lidar_looks_at_is_gone():
    memory = ObstacleMemory(hall())
    memory.update(HOME, AHEAD, 0.0)
    # The rays reach from -0.8 to 0.8 rad.
    for turn in (0.88, -0.86, 3.0):
        assert not memory.update((0.0, 0.0, turn), through(0, 80), 1.0)
    assert memory.update((0.0, 0.0, 0.75), through(0, 80), 1.0)


def test_the_lidar_s_place_on_the_robot_counts():
    # It looks to the left from 0.2 m before the middle.
    mount = (0.2, 0.0, np.pi / 2)
    memory = ObstacleMemory(hall())
    memory.update(HOME, Scan(ANGLES, AHEAD.ranges, 3.5, mount), 0.0)
    assert memory.points == pytest.approx(np.array([[0.225, 1.025]]), abs=0.051)
    free = Scan(ANGLES, through(38, 43).ranges, 3.5, mount)
    assert memory.update(HOME, free, 1.0)
