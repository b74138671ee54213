"""The parts of a scan's matching, beside plain sums over its points and lines."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation.exploration.scan_matching import (
    Matcher,
    MatchingParameters,
    Surface,
    joined,
    surface_of,
)
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, in_map

ANGLES = (np.arange(240) + 0.5) * math.tau / 240 - math.pi


def room(pose: Pose, reach: float = 8.0) -> Scan:
    """Return what a lidar sees in a room of 6 by 4 metres with its south-west corner at 0, 0."""
    along, up = np.cos(ANGLES + pose[2]), np.sin(ANGLES + pose[2])
    x = np.where(along > 0, 6.0 - pose[0], -pose[0]) / along
    y = np.where(up > 0, 4.0 - pose[1], -pose[1]) / up
    return Scan(ANGLES, np.minimum(x, y), reach)


HOME = (2.0, 1.5, 0.3)
SEEN = surface_of(room(HOME)).moved(HOME)


def test_points_on_walls_face_the_lidar_and_corners_are_left_out() -> None:
    for x, y in SEEN.points:
        assert min(abs(x), abs(x - 6), abs(y), abs(y - 4)) < 1e-9
    for (x, y), normal in zip(SEEN.points, SEEN.normals, strict=True):
        wall = min((abs(x), (1, 0)), (abs(6 - x), (-1, 0)), (abs(y), (0, 1)), (abs(4 - y), (0, -1)))
        if abs(x - 3) < 2.6 or abs(y - 2) < 1.6:
            assert normal == pytest.approx(wall[1], abs=0.25)
    corners = np.array([[0, 0], [6, 0], [0, 4], [6, 4]])
    away = np.hypot(*(SEEN.points[:, None] - corners).transpose(2, 0, 1)).min(axis=1)
    assert away.min() > 0.02
    # Over the end of the turn, too, neighbours are neighbours.
    assert 240 - 4 * 6 <= len(SEEN.points) < 240


@pytest.mark.parametrize(
    ('ranges', 'kept'),
    [
        (np.full(7, 2.0), 1),
        (np.full(6, 2.0), 0),
        (np.array([2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 9.0]), 0),
    ],
)
def test_a_line_is_of_seven_neighbours_at_least(ranges: np.ndarray, kept: int) -> None:
    angles = (np.arange(len(ranges)) - 3) * 0.03
    straight = ranges / np.cos(angles)
    met = np.where(ranges < 8, straight, np.inf).astype(np.float64)
    found = surface_of(Scan(angles.astype(np.float64), met, 8.0))
    assert len(found.points) == kept
    assert found.normals.shape == found.points.shape
    assert np.abs(found.normals - (-1.0, 0.0)).max(initial=0.0) < 1e-6


@pytest.mark.parametrize(
    ('step', 'away', 'lines'),
    [(0.29, 2.0, True), (0.31, 2.0, False), (0.31, 6.0, True), (0.41, 6.0, False)],
)
def test_neighbours_that_are_far_apart_make_no_line(step: float, away: float, lines: bool) -> None:
    side = np.arange(-4, 5) * step
    scan = Scan(np.arctan2(side, away), np.hypot(side, away), 30.0)
    points = surface_of(scan).points
    assert bool(len(points)) is lines


def test_a_mounted_lidar_decides_which_side_a_wall_faces() -> None:
    side = np.arange(-4, 5) * 0.1
    # It sits 3 m ahead of the robot and looks back: the wall at 2 m faces away from the robot.
    scan = Scan(np.arctan2(side, 1.0), np.hypot(side, 1.0), 8.0, (3.0, 0.0, math.pi))
    found = surface_of(scan)
    assert found.points[:, 0] == pytest.approx(2.0)
    assert found.normals == pytest.approx(np.tile([1.0, 0.0], (len(found.points), 1)))


def test_surfaces_are_moved_joined_and_thinned() -> None:
    surface = Surface(np.array([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]), np.array([[0.0, 1.0]] * 3))
    moved = surface.moved((5.0, 1.0, math.pi / 2))
    assert moved.points == pytest.approx(np.array([[5.0, 2.0], [5.0, 3.0], [5.0, 4.0]]))
    assert moved.normals == pytest.approx(np.array([[-1.0, 0.0]] * 3))
    both = joined([surface, moved])
    assert both.points.tolist() == [*surface.points.tolist(), *moved.points.tolist()]
    assert both.normals.shape == (6, 2)
    assert both.thinned(3).points.tolist() == both.points[::2].tolist()
    assert both.thinned(4).normals.tolist() == both.normals.tolist()
    assert both.thinned(100).points.shape == (6, 2)


@pytest.mark.parametrize('window', [(0.3, 0.2), (0.6, 0.0), (0.0, 0.3)])
def test_the_search_finds_the_brightest_pose_of_its_window(window: tuple[float, float]) -> None:
    matcher = Matcher(SEEN)
    true = (2.17, 1.41, 0.36)
    guess = (
        true[0] + 0.5 * window[0],
        true[1] - 0.4 * window[0],
        true[2] + 0.6 * window[1],
    )
    points = surface_of(room(true)).points
    found = matcher._searched(points, guess, window)
    assert found[:2] == pytest.approx(true[:2], abs=0.04)
    assert angle_between(found[2], true[2]) == pytest.approx(0.0, abs=0.012)

    def bright(pose: Pose) -> float:
        seen = SEEN.points
        gaps = np.hypot(*(in_map(pose, points[::8])[:, None] - seen).transpose(2, 0, 1)).min(axis=1)
        return float(np.exp(-0.5 * (gaps / 0.08) ** 2).mean())

    assert bright(found) > 0.88
    assert bright(found) > bright(guess)


def test_of_poses_that_fit_as_well_the_search_takes_the_one_next_to_the_guess() -> None:
    wall = np.array([[x, 2.0] for x in np.arange(-5.0, 5.0, 0.02)])
    matcher = Matcher(Surface(wall, np.tile([0.0, -1.0], (len(wall), 1))))
    points = wall[np.abs(wall[:, 0]) < 1.0]
    found = matcher._searched(points, (0.3, 0.1, 0.0), (0.4, 0.1))
    assert found == pytest.approx((0.3, 0.0, 0.0), abs=0.03)
    assert matcher._best(points, (0.3, 0.0, 0.0), (0.2, 0.1), 0.1, 0.05) == (0.3, 0.0, 0.0)


@pytest.mark.parametrize('prior', [None, np.diag([2e4, 1e4, 3e4])])
def test_a_refined_pose_is_where_robust_errors_and_the_prior_are_least(
    prior: np.ndarray | None,
) -> None:
    matcher, true, guess = Matcher(SEEN), (2.1, 1.45, 0.34), (2.13, 1.42, 0.32)
    scan = room(true)
    noise = np.random.default_rng(4).normal(0, 0.015, 240)
    few = surface_of(Scan(ANGLES, scan.ranges + noise, 8.0)).thinned(180)
    pose, information = matcher._refined(few, guess, guess, prior)
    assert pose[:2] == pytest.approx(true[:2], abs=0.02)
    placed = few.moved(pose)
    faced = np.hstack([placed.points, 0.3 * placed.normals])
    seen = np.hstack([SEEN.points, 0.3 * SEEN.normals])
    gaps = np.sqrt(((faced[:, None] - seen) ** 2).sum(axis=2))
    near = gaps.min(axis=1) <= 0.3
    at = gaps.argmin(axis=1)[near]

    def price(tried: Pose) -> float:
        moved = in_map(tried, few.points[near])
        squares = ((moved - SEEN.points[at]) * SEEN.normals[at]).sum(axis=1) ** 2
        # The weights are those of Geman and McClure.
        own = (squares / (1 + squares / 0.06**2)).sum() / 0.02**2
        if prior is None:
            return float(own)
        cos, sin = math.cos(tried[2]), math.sin(tried[2])
        dx, dy = tried[0] - guess[0], tried[1] - guess[1]
        back = np.array([cos * dx + sin * dy, cos * dy - sin * dx, tried[2] - guess[2]])
        return float(own + back @ prior @ back)

    least = price(pose)
    for step in ((0.003, 0, 0), (0, 0.003, 0), (0, 0, 0.003)):
        for side in (-1, 1):
            x, y, turn = (side * each for each in step)
            assert price((pose[0] + x, pose[1] + y, pose[2] + turn)) > least
    # The information is the slope's own product, shared by four, and what was known before.
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    turned = placed.points[near] - pose[:2]
    normals = SEEN.normals[at]
    slope = np.column_stack(
        [
            normals @ (cos, sin),
            normals @ (-sin, cos),
            normals[:, 1] * turned[:, 0] - normals[:, 0] * turned[:, 1],
        ]
    )
    error = ((placed.points[near] - SEEN.points[at]) * normals).sum(axis=1)
    weight = (1 + (error / 0.06) ** 2) ** -2 / 0.02**2
    expected = (slope * weight[:, None]).T @ slope / 4
    if prior is not None:
        expected = expected + prior
    assert information == pytest.approx(expected, rel=2e-2, abs=0.01 * expected.max())


def test_where_next_to_nothing_is_near_a_pose_stays_as_it_is() -> None:
    matcher = Matcher(SEEN)
    few = surface_of(room(HOME)).thinned(180)
    far = (20.0, 20.0, 0.0)
    pose, information = matcher._refined(few, far, far, np.eye(3))
    assert pose == far
    assert information.tolist() == np.eye(3).tolist()
    found = matcher.match(room(HOME), few, far, (0.0, 0.0))
    assert found is not None
    assert (found.agreement, found.contradiction) == (0.0, 0.0)
    assert matcher.match(room(HOME), few.thinned(19), HOME, (0.0, 0.0)) is not None
    nine = Surface(few.points[:9], few.normals[:9])
    assert matcher.match(room(HOME), nine, HOME, (0.0, 0.0)) is None


def test_the_part_of_the_points_that_lie_on_lines_agrees() -> None:
    matcher = Matcher(SEEN)
    wall = SEEN.points[np.abs(SEEN.points[:, 1]) < 1e-9][5:25]
    normals = np.tile([0.0, 1.0], (20, 1))
    offsets = np.repeat([0.0, 0.07, 0.09, 0.31], 5)
    lifted = Surface(wall + np.column_stack([np.zeros(20), offsets]), normals)
    assert matcher._agreement(lifted, (0.0, 0.0, 0.0)) == 0.5
    turned = Surface(wall, -normals)
    assert matcher._agreement(turned, (0.0, 0.0, 0.0)) == 0.0, 'the other side of the wall'


@pytest.mark.parametrize(
    ('ahead', 'through'),
    [(2.0, 0.0), (2.29, 0.0), (2.31, 1.0), (1.71, 0.0), (1.0, 0.0), (np.inf, 1.0), (np.nan, 0.0)],
)
def test_rays_that_go_on_behind_a_line_contradict_it(ahead: float, through: float) -> None:
    wall = np.array([[2.0, y] for y in np.linspace(-0.1, 0.1, 9)])
    matcher = Matcher(Surface(wall, np.tile([-1.0, 0.0], (9, 1))))
    angles = np.linspace(-math.pi, math.pi, 400, endpoint=False)
    ranges = np.full(400, 5.0)
    ranges[np.abs(angles) < 0.3] = ahead
    scan = Scan(angles, ranges, 8.0)
    assert matcher.contradiction(scan, (0.0, 0.0, 0.0)) == through
    mounted = Scan(angles, ranges, 8.0, (-1.0, 0.0, 0.0))
    assert matcher.contradiction(mounted, (1.0, 0.0, 0.0)) == through
    assert matcher.contradiction(scan, (0.0, 0.0, math.pi)) == 1.0
    assert matcher.contradiction(Scan(angles, ranges, 1.9), (0.0, 0.0, 0.0)) == 0.0, 'out of reach'


def test_an_edge_is_seen_past_on_one_side() -> None:
    wall = np.array([[2.0, y] for y in np.linspace(-0.5, 0.0, 26)])
    matcher = Matcher(Surface(wall, np.tile([-1.0, 0.0], (26, 1))))
    angles = np.linspace(-math.pi, math.pi, 400, endpoint=False)
    ranges = np.where(angles < -1e-9, 2.0 / np.maximum(np.cos(angles), 0.1), 5.0)
    assert matcher.contradiction(Scan(angles, ranges, 8.0), (0.0, 0.0, 0.0)) == 0.0
    behind = Scan(angles[150:250], np.full(100, 5.0), 8.0)
    assert matcher.contradiction(behind, (4.0, 0.0, 0.0)) == 0.0, 'what is not in view'


def test_a_match_says_where_a_scan_was_made_and_how_well_it_fits() -> None:
    true = (2.3, 1.6, 0.4)
    parameters = MatchingParameters(points=60)
    matcher = Matcher(SEEN, parameters)
    scan = room(true)
    found = matcher.match(scan, surface_of(scan), composed(true, (0.15, -0.1, 0.1)), (0.3, 0.2))
    assert found is not None
    assert found.pose == pytest.approx(true, abs=0.004)
    assert found.agreement > 0.97
    assert found.contradiction < 0.01
    assert (np.linalg.eigvalsh(found.information) > 1e3).all()
