"""A path that has the robot turn says where to, and no other path does."""

from __future__ import annotations

import math

import pytest

from surveillance_runtime.spin_in_place import SHORT, bearing_of, spin_path

pytestmark = pytest.mark.unit


@pytest.mark.parametrize('degrees', [-170, -90, -30, 0, 60, 90, 135, 180])
def test_a_turn_leads_where_it_was_asked_to_from_anywhere(degrees: int) -> None:
    bearing = math.radians(degrees)
    path = spin_path((3.5, -2.0, 9.0), bearing)
    assert path[0] == (3.5, -2.0, 0.0)
    found = bearing_of(path)
    assert found is not None
    assert math.remainder(found - bearing, math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ('path', 'bearing'),
    [
        ([], None),
        ([(1.0, 2.0)], None),
        ([(0.0, 0.0), (0.0, 0.0)], None),
        ([(0.0, 0.0), (SHORT, 0.0)], 0.0),
        ([(0.0, 0.0), (SHORT + 1e-6, 0.0)], None),
        ([(0.0, 0.0, 5.0), (0.0, SHORT / 4, 7.0), (0.0, SHORT / 2, 9.0)], math.pi / 2),
        ([(0.0, 0.0), (0.5, 0.0), (0.01, 0.0)], None),
    ],
)
def test_what_is_to_be_driven_along_is_no_turn(
    path: list[tuple[float, ...]], bearing: float | None
) -> None:
    assert bearing_of(path) == bearing
