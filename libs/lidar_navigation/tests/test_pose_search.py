"""Poses anywhere on a map that explain a scan, the likeliest first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from lidar_navigation import Localiser
from lidar_navigation.geometry import Scan, angle_between
from lidar_navigation.localisation import pose_search
from lidar_navigation.localisation.scan_fit import ScanFit


def box() -> Grid:
    """Return a room of 4 x 2 m between walls of one cell, its south-west corner at (10, -20)."""
    cells = np.zeros((42, 82), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return Grid(cells, 0.05, (9.95, -20.05))


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


def test_the_lattice_of_a_search_scores_what_adding_up_point_by_point_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    grid = cluttered(7)
    fit = ScanFit(grid)
    monkeypatch.setattr(pose_search, 'LATTICE', 0.3)
    points = random_points(3, 15)
    headings = 0.4 + np.arange(5) * math.tau / 5
    places, scores = pose_search._scored(fit, points, headings)
    step, rows, columns = 3, *grid.cells.shape
    near = np.exp(-0.5 * (fit.edges / 0.2) ** 2)
    can_stand = [
        (row, column)
        for row in range(0, rows, step)
        for column in range(0, columns, step)
        if fit.can_stand((-2.0 + 0.1 * column + 0.05, 3.0 + 0.1 * row + 0.05, 0.0))
    ]
    assert places == pytest.approx(grid.centres_of(np.array(can_stand)))
    assert scores.shape == (5, len(can_stand))
    for heading in range(5):
        yaw = 0.4 + heading * math.tau / 5
        for number, (row, column) in enumerate(can_stand):
            expected = 0.0
            for x, y in points:
                right = round((math.cos(yaw) * x - math.sin(yaw) * y) / 0.1) + column
                up = round((math.sin(yaw) * x + math.cos(yaw) * y) / 0.1) + row
                if 0 <= right < columns and 0 <= up < rows:
                    expected += near[up, right]
            assert scores[heading, number] == pytest.approx(expected, abs=1e-4)


def test_a_search_tells_the_likeliest_first_and_prefers_what_is_near(flat: Any) -> None:
    true = (5.5, 1.0, 1.0)
    localiser, scan = Localiser(flat.grid, (2.0, 1.5, 0.0)), flat.scan(true)
    fit, found = ScanFit(flat.grid), localiser.search(scan)
    assert found[0][0] == pytest.approx(true, abs=0.05)
    assert found[0][1].hit > 0.95
    worth = [
        explained.hit
        - 0.003 * math.hypot(pose[0] - 2.0, pose[1] - 1.5)
        - 0.02 * abs(angle_between(0.0, pose[2]))
        for pose, explained in found
    ]
    assert worth == sorted(worth, reverse=True)
    for pose, explained in found:
        assert fit.can_stand(pose)
        assert explained == fit.evidence(pose, scan)
    assert len({pose for pose, _ in found}) > 5
    # A room that is the same turned round: near the last pose the way that it looked comes first.
    even = Localiser(box(), (11.4, -19.2, 3.0))
    angles = np.linspace(-math.pi, math.pi, 90, endpoint=False)
    seen = Scan(angles, ScanFit(even.grid).cast((11.5, -19.2, -3.1), angles, 8.0), 8.0)
    assert even.search(seen)[0][0] == pytest.approx((11.5, -19.2, -3.1), abs=0.06)
    even.believe((12.4, -18.8, 0.0))
    assert even.search(seen)[0][0] == pytest.approx((12.4, -18.85, 0.04), abs=0.12)
