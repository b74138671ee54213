"""How a motion ends: in the place that it was to reach, or with a sentence that says where."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_controllers.motion.arrival import (
    MotionFailedError,
    expect_place,
    nearest_place,
    place_reached,
)

PLACES = {
    'A': np.array([0.0, 0.0, 0.0]),
    'B': np.array([3.0, 4.0, 0.0]),
    'C': np.array([3.0, 4.0, 9.0]),
}


def test_the_nearest_place_is_told_with_its_distance() -> None:
    assert nearest_place(PLACES, np.array([3.0, 0.0, 0.0])) == ('A', 3.0)
    assert nearest_place(PLACES, np.array([3.0, 4.0, 2.0])) == ('B', 2.0)
    assert nearest_place(PLACES, np.array([3.0, 4.0, 8.0])) == ('C', 1.0)
    assert nearest_place({}, np.zeros(3)) == (None, math.inf)


def test_a_place_is_reached_within_its_reach() -> None:
    assert place_reached(PLACES, np.array([0.0, 0.5, 0.0]), 0.5) == 'A'
    end = np.array([0.0, 0.51, 0.0])
    with pytest.raises(MotionFailedError) as found:
        place_reached(PLACES, end, 0.5)
    assert str(found.value) == (
        'the robot stopped at (0, 0.51, 0): expected a place within 0.5 m, A is 0.51 m away'
    )
    assert found.value.end is end
    with pytest.raises(MotionFailedError, match=r'expected a place within 0\.5 m$'):
        place_reached({}, end, 0.5)


@pytest.mark.parametrize(('place', 'wanted'), [('A', 'B'), (None, 'B'), ('A', None), (None, None)])
def test_another_place_than_the_wanted_one_is_a_failure(
    place: str | None, wanted: str | None
) -> None:
    end = np.array([1.0, 2.0, 0.0])
    with pytest.raises(MotionFailedError) as found:
        expect_place(place, wanted, end)
    assert str(found.value) == f'the robot stopped in {place}: expected {wanted}'
    assert found.value.end is end
    assert expect_place('B', 'B', end) == 'B'
