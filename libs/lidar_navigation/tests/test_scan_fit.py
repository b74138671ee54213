"""How well a scan fits a map: rays cast into it, and points drawn onto its edges."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from floor_plans import Grid
from lidar_navigation.geometry import Scan, in_map
from lidar_navigation.localisation.scan_fit import HIT, Evidence, ScanFit


def box() -> Grid:
    """Return a room of 4 x 2 m between walls of one cell, its south-west corner at (10, -20)."""
    cells = np.zeros((42, 82), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return Grid(cells, 0.05, (9.95, -20.05))


def test_a_ray_ends_at_the_wall_or_at_the_lidar_s_reach() -> None:
    fit = ScanFit(box())
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2, math.pi / 4])
    ahead = fit.cast((11.0, -19.0, 0.0), angles, 8.0)
    assert ahead == pytest.approx([3.0, 1.0, 1.0, 1.0, math.sqrt(2.0)], abs=0.026)
    turned = fit.cast((11.0, -19.0, math.pi / 2), angles, 8.0)
    assert turned == pytest.approx([1.0, 1.0, 1.0, 3.0, math.sqrt(2.0)], abs=0.026)
    assert fit.cast((11.0, -19.0, 0.0), angles[:2], 1.5) == pytest.approx([1.5, 1.0], abs=0.026)


def test_the_part_of_the_rays_that_a_pose_explains_is_counted() -> None:
    fit = ScanFit(box())
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2])
    pose = (11.0, -19.0, 0.0)

    def explained(*ranges: float) -> float:
        return fit.evidence(pose, Scan(angles, np.array(ranges), 8.0)).fit

    assert explained(3.0, 1.0, 1.0, 1.0) == 1.0
    assert explained(2.0, 1.0, 1.0, 1.0) == 0.875, 'something new may stand there'
    assert explained(4.0, 1.0, 1.0, 1.0) == 0.75, 'no ray goes through a wall'
    assert explained(2.0, 1.0, np.nan, np.nan) == 0.75, 'what tells nothing does not count'
    assert explained(*[np.nan] * 4) == 0.0
    slack = HIT + 0.025
    assert explained(3.0 + slack + 0.03, 1.0 - slack - 0.03, 1.0, 1.0) == 0.5, 'one is too long'
    assert explained(3.0 + slack - 0.03, 1.0 - slack + 0.03, 1.0, 1.0) == 1.0


def test_a_mounted_lidar_explains_from_where_it_sits() -> None:
    fit = ScanFit(box())
    scan = Scan(np.array([0.0, math.pi]), np.array([0.5, 1.5]), 8.0, (0.0, 0.5, math.pi / 2))
    assert fit.evidence((11.0, -19.0, 0.0), scan).fit == 1.0
    assert fit.evidence((11.0, -19.5, 0.0), scan).fit == 0.0


def cluttered(seed: int, shape: tuple[int, int] = (26, 34)) -> Grid:
    """Return a map of some blocks, a part of it unknown, whose south-west corner is at (-2, 3)."""
    draw = np.random.default_rng(seed)
    cells = np.zeros(shape, np.int8)
    for _ in range(5):
        row, column = (int(draw.integers(0, size - 4)) for size in shape)
        height, width = draw.integers(1, 5, 2)
        cells[row : row + height, column : column + width] = 100
    cells[:4, :5] = -1
    return Grid(cells, 0.1, (-2.0, 3.0))


def random_points(seed: int, count: int, reach: float = 1.5) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 2))


@pytest.mark.parametrize('seed', range(4))
def test_rays_go_as_far_as_steps_of_half_a_cell_find_nothing(seed: int) -> None:
    grid, draw = cluttered(seed), np.random.default_rng(seed)
    fit = ScanFit(grid)
    for _ in range(5):
        pose = (draw.uniform(-2.2, 1.6), draw.uniform(2.8, 5.8), draw.uniform(-3, 3))
        angles = draw.uniform(-3.2, 3.2, 12)
        found = fit.cast(pose, angles, 1.7)
        for angle, ray in zip(angles, found, strict=True):
            expected, way = 1.7, 0.0
            while way < 1.7 + 0.05:
                x = pose[0] + way * math.cos(angle + pose[2])
                y = pose[1] + way * math.sin(angle + pose[2])
                # Beyond its edge the map goes on as at the edge.
                column = min(max(int((x + 2.0) * 10), 0), 33)
                row = min(max(int((y - 3.0) * 10), 0), 25)
                if grid.cells[row, column] == 100:
                    expected = min(way, 1.7)
                    break
                way += 0.05
            assert ray == pytest.approx(expected, abs=0.051)
            assert ray <= 1.7
    far = ScanFit(Grid(np.zeros((3, 4), np.int8), 0.1))
    assert far.cast((0.1, 0.1, 0.0), np.zeros(2), 1e9).tolist() == [1e9, 1e9]


@pytest.mark.parametrize('seed', range(3))
def test_the_distance_to_an_edge_and_its_slope_are_those_of_scipy(seed: int) -> None:
    grid = cluttered(seed)
    fit = ScanFit(grid)
    occupied = grid.cells == 100
    outside = 0.1 * ndimage.distance_transform_edt(~occupied)
    inside = 0.1 * ndimage.distance_transform_edt(occupied)
    signed = np.where(occupied, 0.05 - inside, outside - 0.05)

    def at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rank = np.array([(y - 3.0) / 0.1 - 0.5, (x + 2.0) / 0.1 - 0.5])
        return np.asarray(ndimage.map_coordinates(signed, rank, order=1, mode='nearest'))

    x, y = (random_points(seed, 60) + np.array([-0.3, 4.2])).T
    distance, slope_x, slope_y = fit.edge_at(x, y)
    assert distance == pytest.approx(at(x, y), abs=2e-4)
    step = 1e-4
    # Where a step does not cross the middle of a cell, and on the map.
    for slope, (dx, dy), free in (
        (slope_x, (step, 0.0), np.abs((x * 10 + 0.5) % 1 - 0.5) < 0.45),
        (slope_y, (0.0, step), np.abs((y * 10 + 0.5) % 1 - 0.5) < 0.45),
    ):
        expected = (at(x + dx, y + dy) - at(x - dx, y - dy)) / (2 * step)
        good = free & (x > -1.9) & (x < 1.3) & (y > 3.1) & (y < 5.5)
        assert good.sum() > 20
        assert slope[good] == pytest.approx(expected[good], abs=2e-3)
    assert fit.edge_at(np.array([99.0]), np.array([-99.0]))[0] == pytest.approx(
        signed[0, -1], abs=1e-3
    )


@pytest.mark.parametrize('moved', [(0.0, 0.0), (0.3, 0.0), (0.0, 0.4)])
def test_a_corrected_pose_is_where_robust_errors_and_the_pull_are_least(
    flat: Any, moved: tuple[float, float]
) -> None:
    true, start = (1.4, 1.2, 0.6), (1.44, 1.15, 0.63)
    points = np.concatenate([flat.scan(true).points[::3], random_points(1, 12, 1.0)])
    fit = ScanFit(flat.grid)
    found = fit.matched(start, points, moved)
    assert found[:2] == pytest.approx(true[:2], abs=0.04)
    deviation = np.array(
        [0.05 + 0.2 * moved[0], 0.05 + 0.2 * moved[0], 0.04 + 0.1 * moved[0] + 0.2 * moved[1]]
    )

    def price(pose: np.ndarray) -> float:
        # The weights are those of Geman and McClure: this is the sum that they make least.
        squares = fit.edge_at(*in_map(tuple(pose), points).T)[0] ** 2
        away = (pose - start) * 0.03 / deviation
        return 0.5 * float((squares / (1 + squares / 0.2**2)).sum() + (away**2).sum())

    least = price(np.array(found))
    assert least < price(np.array(start))
    for axis in range(3):
        for side in (-0.004, 0.004):
            beside = np.array(found)
            beside[axis] += side
            assert price(beside) > least


def test_a_correction_takes_no_steps_that_are_too_long(flat: Any) -> None:
    fit = ScanFit(flat.grid)
    points = flat.scan((2.0, 1.5, 0.0)).points
    assert fit.matched((2.0, 1.5, 0.0), points[:7], (1.0, 1.0)) == (2.0, 1.5, 0.0)
    start = (0.4, 2.6, 3.0)
    found = fit.matched(start, points, (9.0, 9.0))
    assert max(abs(a - b) for a, b in zip(found[:2], start[:2], strict=True)) <= 8 * 0.15 + 1e-9
    assert -math.pi <= found[2] <= math.pi


def test_the_robot_can_stand_where_its_body_overlaps_nothing() -> None:
    cells = np.zeros((20, 20), np.int8)
    cells[10, 10] = 100
    cells[:, 0] = -1
    fit = ScanFit(Grid(cells, 0.05))
    assert not fit.can_stand((0.025, 0.525, 0.0)), 'nobody knows what is there'
    assert fit.can_stand((0.075, 0.525, 0.0))
    # From the middle of a cell to the edge of the one that is occupied.
    assert not fit.can_stand((0.525 - 0.15, 0.525, 0.0))
    assert fit.can_stand((0.525 - 0.2, 0.525, 0.0))
    assert not fit.can_stand((-0.1, 0.5, 0.0))


def test_a_pose_is_refuted_by_rays_through_walls_or_where_next_to_none_is_as_mapped() -> None:
    assert not Evidence(0.5, 0.5, 0.0).refutes, 'half of it is new'
    assert not Evidence(0.21, 0.75, 0.04).refutes
    assert Evidence(0.9, 0.0, 0.1).refutes
    assert Evidence(0.19, 0.81, 0.0).refutes
    assert Evidence(0.0, 0.0, 1.0).fit == 0.0


def test_what_is_new_is_left_out_of_a_scan_and_what_is_off_by_a_little_is_not() -> None:
    fit, pose = ScanFit(box()), (11.0, -19.0, 0.0)
    scan = Scan(np.array([0.0, math.pi / 2, math.pi]), np.array([1.0, 0.8, 1.4]), 8.0)
    kept = fit.mapped(pose, scan, 0.1).ranges
    assert kept.tolist() == pytest.approx([math.nan, 0.8, 1.4], nan_ok=True)
    assert fit.mapped(pose, scan, 3.0) is scan
