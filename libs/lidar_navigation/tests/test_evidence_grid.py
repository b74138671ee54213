"""What a scan votes for: the cells that its rays pass and meet."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from lidar_navigation.exploration.evidence_grid import HIT, PASSED, EvidenceGrid
from lidar_navigation.geometry import Scan, composed


def test_a_ray_votes_once_for_each_cell_on_its_way() -> None:
    grid = EvidenceGrid(0.1)
    scan = Scan(np.array([0.0]), np.array([1.02]), 8.0)
    pose = (0.05, 0.05, 0.0)
    grid.add(pose, scan)
    found = grid.grid()

    def value(x: float, y: float) -> int:
        return int(found.at(found.cells, x, y))

    assert [value(0.05 + 0.1 * n, 0.05) for n in range(13)] == [0] * 10 + [100, -1, -1]
    assert value(0.55, 0.15) == -1
    assert value(-0.05, 0.05) == -1
    passing = Scan(np.array([0.0]), np.array([np.inf]), 8.0)
    for _ in range(2):  # two that passed are less than the one that met something
        grid.add(pose, passing)
    assert grid.grid().occupied[grid.grid().cell_of(1.05, 0.05)]
    grid.add(pose, passing)
    assert grid.grid().free[grid.grid().cell_of(1.05, 0.05)]
    assert grid.grid().free[grid.grid().cell_of(7.85, 0.05)]
    for _ in range(3):
        grid.remove(pose, passing)
    grid.remove(pose, scan)
    assert (grid.grid().cells == -1).all()


def test_a_map_grows_on_all_sides_and_stays_where_it_is() -> None:
    grid = EvidenceGrid(0.1)
    angles = np.linspace(-math.pi, math.pi, 721)
    scan = Scan(angles, np.full(721, 2.0), 8.0, (0.0, 0.0, 0.0))
    for x, y in ((0.0, 0.0), (-9.0, 0.0), (0.0, 12.0), (5.0, -7.0)):
        grid.add((x, y, 0.3), scan)
        found = grid.grid()
        assert found.cells.shape[0] % 32 == found.cells.shape[1] % 32 == 0
        rows, columns = np.indices(found.cells.shape)
        away = np.hypot(
            (columns + 0.5) * 0.1 + found.origin[0] - x, (rows + 0.5) * 0.1 + found.origin[1] - y
        )
        assert (found.cells[away < 1.8] == 0).all(), 'no cell is left between the rays'
        assert (found.cells[(away > 1.9) & (away < 2.05)] == 100).mean() > 0.7
    assert (found.cells[found.cell_of(0.0, 0.0)]) == 0


def test_between_rays_that_were_left_out_nothing_is_known() -> None:
    grid = EvidenceGrid(0.1)
    angles = np.concatenate([np.arange(-0.5, -0.1, 0.02), np.arange(0.1, 0.5, 0.02)])
    grid.add((0.0, 0.0, 0.0), Scan(angles, np.full(len(angles), 4.0), 8.0))
    found = grid.grid()
    assert found.at(found.cells, 3.0, 0.05) == -1
    assert found.at(found.cells, 3.0, 0.9) == 0


@pytest.mark.parametrize('seed', range(3))
def test_a_scan_votes_for_the_cells_that_its_rays_pass_and_meet(seed: int) -> None:
    draw = np.random.default_rng(seed)
    angles = np.sort(np.concatenate([np.arange(-1.0, 0.6, 0.1), np.arange(1.2, 2.0, 0.1)]))
    ranges = draw.uniform(0.5, 2.5, len(angles))
    ranges[::5], ranges[3] = np.inf, np.nan
    scan = Scan(angles, ranges, 2.0, (0.1, 0.0, 0.5))
    pose = (0.93, -1.21, 0.4)
    x, y, yaw = composed(pose, scan.mount)
    grid = EvidenceGrid(0.1)
    grid.add(pose, scan)

    known = [(a, r) for a, r in zip(angles, ranges, strict=True) if not math.isnan(r)]
    rays = [(a, r - 0.1 if r < 2.0 else 2.0) for a, r in known]
    for (first, near), (second, far) in itertools.pairwise(known):
        gap, between = second - first, min(near, far, 2.0) - 0.15
        count = min(max(math.ceil(gap * between / 0.1), 1), 8)
        if gap < 0.15:
            rays += [(first + gap * part / count, between) for part in range(1, count)]

    def cells(step: float) -> set[tuple[int, int]]:
        """Return the cells that rays pass, looked at in such steps."""
        return {
            (math.floor((y + way * math.sin(a + yaw)) / 0.1),
             math.floor((x + way * math.cos(a + yaw)) / 0.1))
            for a, length in rays
            for way in np.arange(0.0, max(length, 0.0) + 1e-9, step)
        }  # fmt: skip

    met = {
        (math.floor((y + r * math.sin(a + yaw)) / 0.1),
         math.floor((x + r * math.cos(a + yaw)) / 0.1))
        for a, r in known
        if r < 2.0
    }  # fmt: skip
    row, column = grid._corner
    odds = {
        (int(at[0]) + row, int(at[1]) + column): int(grid._odds[tuple(at)])
        for at in np.argwhere(grid._odds)
    }
    assert {cell for cell, value in odds.items() if value == HIT} == met
    passed = {cell for cell, value in odds.items() if value == PASSED}
    assert passed | met == odds.keys()
    assert cells(0.09) - met <= passed <= cells(0.002) - met
    assert {tuple(at) for at in np.argwhere(grid._votes == 1)} == {
        (cell[0] - row, cell[1] - column) for cell in odds
    }
