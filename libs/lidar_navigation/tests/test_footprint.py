"""A robot that is not round: how near things are to it, where it passes, and what it may not do."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from floor_plans import Grid
from lidar_navigation import (
    DriveParameters,
    Footprint,
    GridPlanner,
    NoPathError,
    PlanningParameters,
    Velocity,
    robot_base,
)
from lidar_navigation.driving.path_following import room_ahead, safe_turn
from lidar_navigation.driving.sampled_planning import SampledPlanner, is_safe
from lidar_navigation.localisation.tracking import Mover

LONG = (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)
"""0.8 m long, 0.4 m wide; its wheels are 0.3 m before its rear."""
WIDE = (0.2, 0.45, -0.2, 0.45, -0.2, -0.45, 0.2, -0.45)
BODY = Footprint(9.0, LONG)


@given(st.floats(-2, 2), st.floats(-2, 2))
def test_gaps_are_those_that_opencv_measures(x: float, y: float) -> None:
    corners = np.array(LONG, np.float32).reshape(-1, 1, 2)
    peer = -cv2.pointPolygonTest(corners, (x, y), True)
    assert float(BODY.gap(x, y)) == pytest.approx(peer, abs=1e-5)


L_SHAPED = (0.5, 0.2, -0.3, 0.2, -0.3, -0.6, 0.0, -0.6, 0.0, -0.2, 0.5, -0.2)
PRONGED = (1.2, 0.3, -0.4, 0.3, -0.4, -0.3, 1.2, -0.3, 1.2, -0.2, 0.2, -0.2, 0.2, 0.2, 1.2, 0.2)
"""A forklift: between its prongs there is nothing of it."""


@given(st.sampled_from([L_SHAPED, PRONGED]), st.floats(-2, 2), st.floats(-2, 2))
def test_gaps_of_a_robot_that_is_not_convex_are_those_that_opencv_measures(
    shape: tuple[float, ...], x: float, y: float
) -> None:
    corners = np.array(shape, np.float32).reshape(-1, 1, 2)
    peer = -cv2.pointPolygonTest(corners, (x, y), True)
    assert float(Footprint(9.0, shape).gap(x, y)) == pytest.approx(peer, abs=1e-5)


@pytest.mark.parametrize('shape', [LONG, L_SHAPED, PRONGED])
def test_its_convex_parts_cover_it_once(shape: tuple[float, ...]) -> None:
    whole = Footprint(9.0, shape)
    parts = [Footprint(9.0, tuple(part.ravel().tolist())) for part in whole.convex_parts]
    assert all(part.is_convex for part in parts)
    assert len(parts) <= 4
    x, y = np.random.default_rng(1).uniform(-1.5, 1.5, (2, 4000))
    held = sum((part.gap(x, y) <= 0.0).astype(int) for part in parts)
    assert (held == (whole.gap(x, y) <= 0.0)).all()


def test_what_is_between_the_prongs_is_not_touched() -> None:
    forklift = Footprint(9.0, PRONGED)
    assert forklift.gap(0.7, 0.0) == pytest.approx(0.2)
    assert forklift.inscribed == pytest.approx(0.2)
    assert robot_base.footprint(PRONGED) is None
    assert robot_base.footprint(L_SHAPED) is None


def test_its_radii_are_those_of_nav2() -> None:
    assert BODY.inscribed == pytest.approx(0.2)
    assert BODY.circumscribed == pytest.approx(math.hypot(0.5, 0.2))
    clockwise = Footprint(9.0, tuple(np.array(LONG).reshape(-1, 2)[::-1].ravel()))
    assert clockwise.gap(1.0, 0.0) == pytest.approx(0.5)
    assert BODY.turned_round.gap(1.0, 0.0) == pytest.approx(0.7)
    outline = BODY.outline(0.1)
    assert BODY.gap(*outline.T) == pytest.approx(0.0, abs=1e-9)


def test_it_drives_closely_past_what_a_disc_around_it_would_touch() -> None:
    beside = np.array([[x, side * 0.26] for x in np.arange(-1, 3, 0.05) for side in (-1, 1)])
    assert room_ahead(beside, 0.0, BODY, 0.04, 2.0) == 2.0
    ahead = np.array([[1.0, 0.0]])
    assert room_ahead(ahead, 0.0, BODY, 0.04, 2.0) == pytest.approx(0.46, abs=0.01)
    assert room_ahead(ahead, 0.0, BODY.turned_round, 0.04, 2.0) == pytest.approx(0.66, abs=0.01)


def test_its_corners_swing_out_in_a_turn() -> None:
    beside = np.array([[0.42, 0.32]])
    assert safe_turn(1.0, beside, BODY, 0.02, 3.0, 0.15) < 0.9
    assert safe_turn(-1.0, beside, BODY, 0.02, 3.0, 0.15) == 1.0
    assert safe_turn(1.0, beside, Footprint(0.2), 0.02, 3.0, 0.15) == 1.0


def corridor(width: float, corner: bool) -> Grid:
    """Return a corridor along y = 0 from x = -3 to 3, with a turn to the north at its end."""
    side = 0.05
    y, x = np.mgrid[-60:60, -70:70] * side + side / 2
    free = (np.abs(y) < width / 2) & (x > -3) & (x < 3)
    if corner:
        free |= (y > -width / 2) & (x < 3) & (x > 3 - width)
    return Grid(np.where(free, 0, 100).astype(np.int8), side, (-70 * side, -60 * side))


def planner(grid: Grid, footprint: tuple[float, ...]) -> GridPlanner:
    return GridPlanner(grid, PlanningParameters(footprint=footprint, margin=0.04))


def test_paths_lead_where_its_footprint_fits_and_not_where_it_does_not() -> None:
    straight, bent = corridor(0.6, corner=False), corridor(0.7, corner=True)
    assert len(planner(straight, LONG).plan((-2, 0), (2, 0))) >= 2
    with pytest.raises(NoPathError, match='does not fit through at'):
        planner(straight, WIDE).plan((-2, 0), (2, 0))
    with pytest.raises(NoPathError, match='does not fit through at'):
        planner(bent, LONG).plan((-2, 0), (2.65, 2))
    small = (0.2, 0.15, -0.2, 0.15, -0.2, -0.15, 0.2, -0.15)
    path = planner(bent, small).plan((-2, 0), (2.65, 2))
    again = planner(bent, small)
    again.plan((-2, 0), (2.65, 2))
    # What one search made dear is not dear for the next one.
    assert np.array_equal(again.plan((-2, 0), (2.65, 2)), path)


def test_among_people_it_keeps_its_whole_length_from_them() -> None:
    robot = DriveParameters(footprint=LONG)
    person = Mover(1.0, 0.0, 0.0, 0.0, 0.2)
    assert not is_safe(Velocity(0.6, 0.0), [person], robot)
    assert is_safe(Velocity(0.6, 0.0), [person], DriveParameters(radius=0.2))
    path = np.stack([np.arange(0, 2.5, 0.1), np.zeros(25)], axis=1)
    walls = np.array([[x, side * 0.3] for x in np.arange(-2, 3, 0.05) for side in (-1, 1)])
    local = SampledPlanner(robot)
    velocity = Velocity()
    for _ in range(5):
        velocity = local.step(path, walls, [Mover(2.5, 0.0, 0.5, 0.0, 0.2)], velocity, 0.1)
    assert velocity.speed > 0.1
