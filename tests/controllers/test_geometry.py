"""Points along a path: what spacing, ends and degenerate paths give."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers import geometry

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
