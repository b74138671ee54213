"""Poses and what was measured between them agree as well as they can."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from lidar_navigation.exploration.pose_graph import Constraint, PoseGraph
from lidar_navigation.geometry import Pose, angle_between, composed, relative


def test_two_measurements_of_one_step_meet_by_their_weights() -> None:
    light, heavy = np.diag([100.0, 100.0, 100.0]), np.diag([300.0, 300.0, 300.0])
    graph = PoseGraph(
        [(1.0, 2.0, math.pi / 2), (1.0, 2.0, math.pi / 2)],
        [Constraint(0, 1, (1.0, 0.0, 0.0), light), Constraint(0, 1, (2.0, 0.0, 0.2), heavy)],
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
        Constraint(
            first, second, relative(true[first], true[second]), np.eye(3) * 50.0, second == 12
        )
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
        edges.append(Constraint(first, second, (x, y, turn), root @ root.T))
    if doubtful:
        x, y, turn = relative(poses[2], poses[5])
        edges.append(
            Constraint(2, 5, (x + 1.5, y, turn + 0.2), np.eye(3) * 90.0, may_be_wrong=True)
        )
    return PoseGraph(poses, edges)


def errors(poses: np.ndarray, edges: list[Constraint], scales: list[float]) -> np.ndarray:
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
    scales = [1.0] * len(graph.constraints)
    if doubtful:
        # What dynamic covariance scaling leaves of the loop, by its error (phi is 12).
        squared = float((errors(found, graph.constraints[-1:], [1.0]) ** 2).sum())
        scales[-1] = min(1.0, 24.0 / (12.0 + squared))
        assert scales[-1] < 0.9

    def off(free: np.ndarray) -> np.ndarray:
        return errors(np.vstack([before[:1], free.reshape(-1, 3)]), graph.constraints, scales)

    best = least_squares(off, found[1:].ravel(), xtol=1e-12, ftol=1e-12).x.reshape(-1, 3)
    assert found[0] == pytest.approx(before[0])
    assert found[1:] == pytest.approx(best, abs=2e-4)
    assert moved == pytest.approx(np.hypot(*(found - before)[:, :2].T).max())
    assert moved > 0.01
