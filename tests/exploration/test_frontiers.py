"""Frontiers, votes and poses of an unknown place, beside plain geometry and the definition."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import least_squares
from skimage.graph import MCP_Geometric

from floor_plans import Grid
from lidar_navigation.exploration.evidence_grid import HIT, PASSED, EvidenceGrid
from lidar_navigation.exploration.foreign_map import ForeignMap
from lidar_navigation.exploration.frontiers import (
    FrontierParameters,
    find_frontiers,
    frontier_cells,
    travel_costs,
)
from lidar_navigation.exploration.pose_graph import Edge, PoseGraph
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, relative

SIDE = 0.1


def room(*unknown: tuple[int, int, int, int]) -> Grid:
    """Return a hall of 8 m x 4 m with walls, of which windows (rows, columns) are not known."""
    cells = np.zeros((40, 80), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    for top, bottom, left, right in unknown:
        cells[top:bottom, left:right] = -1
    return Grid(cells, SIDE)


def costs(grid: Grid) -> np.ndarray:
    cost = np.where(grid.free, 1.0, -1.0).astype(np.float32)
    cost[[1, -2]] = -1.0
    cost[:, [1, -2]] = -1.0
    return cost


def test_a_frontier_is_free_and_beside_what_is_unknown() -> None:
    grid = room((10, 20, 30, 40))
    found = frontier_cells(grid)
    for row, column in np.ndindex(grid.cells.shape):
        window = grid.cells[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2]
        rim = row in (0, 39) or column in (0, 79)
        expected = grid.cells[row, column] == 0 and ((window < 0).any() or rim)
        assert found[row, column] == expected


def test_the_way_to_each_cell_is_that_of_the_grid_in_metres() -> None:
    grid = room()
    cost = costs(grid)
    cost[15:25, 38:42] = -1.0
    search = MCP_Geometric(cost)
    expected, _ = search.find_costs([grid.cell_of(1.05, 2.05)])
    found = travel_costs(grid, cost, (1.05, 2.05, 0.0))
    free = cost > 0
    assert found[free] == pytest.approx(expected[free] * SIDE)
    assert np.isinf(found[~free]).all()
    # From where it does not fit it begins at the nearest cell within 0.6 m.
    inside = travel_costs(grid, cost, (3.85, 2.05, 0.0))
    assert np.unravel_index(np.argmin(inside), inside.shape) == (20, 37)
    cost[10:31, 30:50] = -1.0
    assert np.isinf(travel_costs(grid, cost, (4.0, 2.0, 0.0))).all()


def two_frontiers(**more: float) -> list[tuple[float, float]]:
    """Return length and worth of the frontiers, west 1 m and east 4 m long, seen from between."""
    grid = room((16, 26, 1, 11), (1, 39, 68, 79))
    # East of 6.7 m nothing is known; in the west a square of 1 m beside the wall.
    found = find_frontiers(grid, costs(grid), (4.0, 2.0, 0.0), FrontierParameters(**more))
    return [(each.length, each.worth) for each in found]


def test_what_is_near_long_and_ahead_comes_first() -> None:
    (east, west) = two_frontiers()
    assert east[0] == pytest.approx(3.8, abs=0.11)
    assert west[0] == pytest.approx(1.3, abs=0.2)
    # Ahead by about 2.7 m, less 0.3 m for each metre of its length.
    assert east[1] == pytest.approx(2.5 - 0.3 * east[0], abs=0.25)
    # Behind by about 2.8 m: a half turn counts as pi * 0.4 m.
    assert west[1] == pytest.approx(2.7 + math.pi * 0.4 - 0.3 * west[0], abs=0.35)
    assert [each[0] for each in two_frontiers(least=1.5)] == [east[0]]
    plain = two_frontiers(turning=0.0, gain=0.0)
    assert sorted(each[1] for each in plain) == pytest.approx([2.5, 2.7], abs=0.35)
    short = two_frontiers(most_gain=1.0)
    assert short[0][1] == pytest.approx(east[1] + 0.3 * (east[0] - 1.0), abs=1e-6)


def test_a_frontier_that_nobody_can_look_over_comes_last() -> None:
    grid = room((1, 39, 68, 79), (16, 26, 1, 11))
    cost = costs(grid)
    cost[:, 50:] = -1.0
    found = find_frontiers(grid, cost, (4.0, 2.0, 0.0), FrontierParameters())
    assert [each.viewpoint is None for each in found] == [False, True]
    assert math.isinf(found[1].worth)
    assert math.isinf(found[1].way)
    assert found[1].middle == pytest.approx([6.75, 2.0], abs=0.11)
    viewpoint = found[0].viewpoint
    assert viewpoint is not None
    away = np.hypot(*(found[0].points - viewpoint).T).min()
    assert away <= 0.6 + SIDE


def test_what_a_wall_hides_is_not_looked_at_through_it() -> None:
    grid = room((1, 39, 45, 79))
    cells = grid.cells.copy()
    cells[1:39, 42] = 100  # a wall between the robot and the frontier
    walled = Grid(cells, SIDE)
    (only,) = find_frontiers(walled, costs(walled), (2.0, 2.0, 0.0), FrontierParameters())
    assert only.viewpoint is None


# --- votes ---


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


# --- poses ---


def test_two_measurements_of_one_step_meet_by_their_weights() -> None:
    light, heavy = np.diag([100.0, 100.0, 100.0]), np.diag([300.0, 300.0, 300.0])
    graph = PoseGraph(
        [(1.0, 2.0, math.pi / 2), (1.0, 2.0, math.pi / 2)],
        [Edge(0, 1, (1.0, 0.0, 0.0), light), Edge(0, 1, (2.0, 0.0, 0.2), heavy)],
    )
    moved = graph.optimise()
    assert graph.poses[0] == pytest.approx((1.0, 2.0, math.pi / 2))
    assert graph.poses[1] == pytest.approx((1.0, 2.0 + 1.75, math.pi / 2 + 0.15), abs=1e-6)
    assert moved == pytest.approx(1.75, abs=1e-6)
    assert graph.neighbours() == {0: [(1, 1.0), (1, 2.0)], 1: [(0, 1.0), (0, 2.0)]}
    assert PoseGraph([(0.0, 0.0, 0.0)]).optimise() == 0.0
    assert PoseGraph([(0.0, 0.0, 0.0)] * 2).optimise() == 0.0


def test_exact_measurements_bring_poses_to_where_they_were_made() -> None:
    rng = np.random.default_rng(6)
    true: list[Pose] = [(0.0, 0.0, 3.0)]
    for _ in range(12):
        step = (float(rng.uniform(0.5, 1.5)), float(rng.uniform(-0.5, 0.5)), 0.9)
        true.append(composed(true[-1], step))
    edges = [
        Edge(first, second, relative(true[first], true[second]), np.eye(3) * 50.0, second == 12)
        for first in range(13)
        for second in range(first + 1, min(13, first + 3))
    ]
    off: list[Pose] = [true[0]]
    for x, y, yaw in true[1:]:
        dx, dy, turn = rng.normal(0.0, 0.15, 3).tolist()
        off.append((x + dx, y + dy, yaw + turn))
    graph = PoseGraph(off, edges)
    graph.optimise()
    for found, expected in zip(graph.poses, true, strict=True):
        assert found[:2] == pytest.approx(expected[:2], abs=1e-4)
        assert abs(math.remainder(found[2] - expected[2], math.tau)) < 1e-4
        assert -math.pi <= found[2] <= math.pi


def test_a_foreign_map_is_due_once_and_says_what_is_missing() -> None:
    foreign = ForeignMap()
    scan = Scan(np.zeros(1), np.ones(1), 8.0)
    assert foreign.missing == 'map'
    assert foreign.pose((1.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
    grid = Grid(np.zeros((4, 4), np.int8), 0.1)
    foreign.take_map(grid)
    assert foreign.missing == 'the transform from map to odom'
    assert not foreign.is_due((0.0, 0.0, 0.0))
    assert not foreign.see(scan, (1.0, 0.0, 0.0))
    foreign.take_correction((5.0, 0.0, math.pi / 2))
    assert foreign.missing == ''
    assert foreign.is_due((0.0, 0.0, 0.0))
    assert foreign.see(scan, (1.0, 0.0, 0.0))
    assert foreign.start == pytest.approx((5.0, 1.0, math.pi / 2))
    assert foreign.grid() is grid
    assert not foreign.is_due((0.0, 0.0, 0.0))
    assert not foreign.see(scan, (2.0, 0.0, 0.0))
    foreign.take_map(grid)
    assert foreign.see(scan, (2.0, 0.0, 0.0))
    assert foreign.start == pytest.approx((5.0, 1.0, math.pi / 2)), 'the first one'
    assert foreign.pose((2.0, 0.0, 0.0)) == pytest.approx((5.0, 2.0, math.pi / 2))


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


def disagreeing(seed: int, doubtful: bool) -> PoseGraph:
    """Return a graph of six poses whose measurements contradict each other somewhat."""
    draw = np.random.default_rng(seed)
    poses: list[Pose] = [(1.0, 2.0, 0.5)]
    for _ in range(5):
        poses.append(composed(poses[-1], (1.0, 0.2, 0.6)))
    edges = []
    for first, second in ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (0, 3), (1, 4), (5, 0)):
        x, y, turn = (relative(poses[first], poses[second]) + draw.normal(0, 0.05, 3)).tolist()
        root = draw.normal(0, 3.0, (3, 3)) + 8.0 * np.eye(3)
        edges.append(Edge(first, second, (x, y, turn), root @ root.T))
    if doubtful:
        x, y, turn = relative(poses[2], poses[5])
        edges.append(Edge(2, 5, (x + 1.5, y, turn + 0.2), np.eye(3) * 90.0, may_be_wrong=True))
    return PoseGraph(poses, edges)


def errors(poses: np.ndarray, edges: list[Edge], scales: list[float]) -> np.ndarray:
    """Return what edges are off by, in standard deviations."""
    found = []
    for edge, scale in zip(edges, scales, strict=True):
        x, y, turn = relative(tuple(poses[edge.first]), tuple(poses[edge.second]))
        off = np.array([x - edge.step[0], y - edge.step[1], angle_between(edge.step[2], turn)])
        found.append(scale * np.linalg.cholesky(edge.information).T @ off)
    return np.concatenate(found)


@pytest.mark.parametrize('doubtful', [False, True])
@pytest.mark.parametrize('seed', [0, 2, 3])
def test_poses_agree_best_as_scipy_finds_it(seed: int, doubtful: bool) -> None:
    graph = disagreeing(seed, doubtful)
    before = np.array(graph.poses)
    moved = graph.optimise()
    found = np.array(graph.poses)
    scales = [1.0] * len(graph.edges)
    if doubtful:
        # What dynamic covariance scaling leaves of the loop, by its error (phi is 12).
        squared = float((errors(found, graph.edges[-1:], [1.0]) ** 2).sum())
        scales[-1] = min(1.0, 24.0 / (12.0 + squared))
        assert scales[-1] < 0.9

    def off(free: np.ndarray) -> np.ndarray:
        return errors(np.vstack([before[:1], free.reshape(-1, 3)]), graph.edges, scales)

    best = least_squares(off, found[1:].ravel(), xtol=1e-12, ftol=1e-12).x.reshape(-1, 3)
    assert found[0] == pytest.approx(before[0])
    assert found[1:] == pytest.approx(best, abs=2e-4)
    assert moved == pytest.approx(np.hypot(*(found - before)[:, :2].T).max())
    assert moved > 0.01
