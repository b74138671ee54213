"""Points along a path: what spacing, ends and degenerate paths give."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidar_navigation import geometry

PATHS = st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=1, max_size=12)


@given(PATHS, st.floats(0.2, 30))
@settings(max_examples=50)
def test_spaced_points_keep_the_ends_and_the_spacing(
    path: list[tuple[float, float, float]], spacing: float
) -> None:
    points = geometry.equally_spaced(path, spacing)
    total = geometry.length(path)
    assert points[0] == pytest.approx(np.array(path[0]))
    if total > 0:
        assert points[-1] == pytest.approx(np.array(path[-1]))
        along = np.linspace(0, total, len(points))
        assert along[1] - along[0] <= spacing * (1 + 1e-6)
        assert points == pytest.approx(geometry.point_at(path, along))


def test_a_point_along_is_held_at_the_ends() -> None:
    path = [(0, 0, 0), (3, 0, 0), (3, 4, 0)]
    assert geometry.length(path) == 7
    assert list(geometry.point_at(path, 5)) == [3, 2, 0]
    assert list(geometry.point_at(path, -1)) == [0, 0, 0]
    assert list(geometry.point_at(path, 99)) == [3, 4, 0]


def test_a_path_without_points_is_refused() -> None:
    with pytest.raises(ValueError, match='no points'):
        geometry.point_at(np.zeros((0, 3)), 0)


@given(PATHS, st.floats(0, 1))
@settings(max_examples=60)
def test_a_point_of_a_path_is_found_on_it(
    path: list[tuple[float, float, float]], share: float
) -> None:
    at = geometry.point_at(path, share * geometry.length(path))
    found = geometry.point_at(path, geometry.distance_nearest(path, at))
    assert found == pytest.approx(at, abs=1e-4)


def test_points_passed_are_counted_from_the_start() -> None:
    path = [(0, 0), (1, 0), (1, 2)]
    assert [geometry.points_passed(path, d) for d in (0, 0.9, 1, 2.9, 3, 9)] == [1, 1, 2, 2, 3, 3]


POSES = st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))


@given(POSES, POSES)
@settings(max_examples=50)
def test_the_step_between_two_poses_leads_from_one_to_the_other(
    first: geometry.Pose, second: geometry.Pose
) -> None:
    step = geometry.relative(first, second)
    assert geometry.composed(first, step) == pytest.approx(second, abs=1e-9)
    x, y = geometry.in_map(first, np.array([step[:2]]))[0]
    assert (x, y) == pytest.approx(second[:2], abs=1e-9)


def test_a_step_is_told_in_the_own_frame_of_the_first_pose() -> None:
    north = (2.0, 1.0, np.pi / 2)
    assert geometry.relative(north, (2.0, 4.0, np.pi)) == pytest.approx((3.0, 0.0, np.pi / 2))
    assert geometry.relative(north, (1.0, 1.0, 0.0)) == pytest.approx((0.0, 1.0, -np.pi / 2))


def test_what_a_lidar_met_is_told_in_the_robots_frame() -> None:
    """The lidar sits 0.3 m ahead and 0.1 m to the left, and looks to the left."""
    mount = (0.3, 0.1, np.pi / 2)
    angles = np.array([0.0, np.pi / 2, np.pi, 0.1, 0.2])
    ranges = np.array([2.0, 1.0, 8.0, np.inf, np.nan])
    scan = geometry.Scan(angles, ranges, 8.0, mount, np.arange(5.0))
    assert scan.points == pytest.approx(np.array([[0.3, 2.1], [-0.7, 0.1]]))
    thin = scan.thinned(2)
    assert thin.angles.tolist() == angles[::2].tolist()
    assert thin.ranges[0] == 2.0
    assert (thin.range_max, thin.mount) == (8.0, mount)
    assert thin.times is not None
    assert thin.times.tolist() == [0.0, 2.0, 4.0]
    assert scan.thinned(100).angles.tolist() == angles.tolist()
    assert geometry.Scan(angles, ranges, 8.0).thinned(1).times is None
