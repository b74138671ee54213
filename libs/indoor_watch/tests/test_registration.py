"""A sweep whose pose is off is moved onto what stands there; what nothing holds stays in doubt."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from floor_plans import Grid
from indoor_watch.floor import FloorView
from indoor_watch.hung_markers import CameraView
from indoor_watch.registration import Registration
from indoor_watch.visit import LidarSweep

from .marked_walls import camera_pose

SIDE = 0.05
HERE = (2.0, 1.5)


def hall(width: float = 6.0, depth: float = 5.0) -> Grid:
    """Return a room between walls of two cells; without ends where it is very wide."""
    cells = np.zeros((round(depth / SIDE), round(width / SIDE)), np.int8)
    cells[[0, 1, -1, -2], :] = 100
    cells[:, [0, 1, -1, -2]] = 100
    return Grid(cells, SIDE, (0.0, 0.0))


def swept(
    off: tuple[float, float, float],
    size: tuple[float, float] = (6.0, 5.0),
    box: tuple[float, float, float] | None = None,
    seed: int = 1,
) -> tuple[LidarSweep, np.ndarray]:
    """Return what a lidar in that room measures, at a pose that is off, and its true ends."""
    noise = np.random.default_rng(seed)
    angles = np.linspace(-math.pi, math.pi, 360, endpoint=False) + 0.004
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    low, high = np.full(2, 2 * SIDE), np.array(size) - 2 * SIDE
    ranges = np.where(rays > 0, (high - HERE) / rays, (low - HERE) / rays).min(axis=1)
    if box is not None:
        to = np.array(box[:2]) - HERE
        along, aside = rays @ to, np.abs(rays[:, 0] * to[1] - rays[:, 1] * to[0])
        ranges = np.where((along > 0) & (aside < box[2]), np.minimum(ranges, along), ranges)
    met = ranges < 8.0
    ranges = np.minimum(ranges, 8.0) + noise.normal(0.0, 0.01, len(ranges))
    true = rays * ranges[:, None] + HERE
    turned = angles + off[2]
    sensor = HERE[0] + off[0], HERE[1] + off[1]
    ends = np.stack([np.cos(turned), np.sin(turned)], axis=1) * ranges[:, None] + sensor
    return LidarSweep(sensor, ends, met, 1.0), true


errors = st.tuples(
    st.floats(-0.12, 0.12), st.floats(-0.12, 0.12), st.floats(-math.radians(2), math.radians(2))
)


@given(errors)
def test_a_sweep_comes_to_where_it_was_made(off: tuple[float, float, float]) -> None:
    sweep, true = swept(off)
    found = Registration().registered(sweep, hall(), None)
    assert math.dist(found.sensor, HERE) < 0.03
    assert np.linalg.norm(found.ends - true, axis=1).max() < 0.06
    assert found.doubt is not None
    assert found.doubt.max() < 0.04


def test_what_is_new_does_not_pull() -> None:
    sweep, true = swept((0.08, -0.05, 0.02), box=(3.5, 2.0, 0.4))
    found = Registration().registered(sweep, hall(), None)
    assert np.linalg.norm(found.ends - true, axis=1).max() < 0.06


def test_what_stands_there_normally_holds_a_sweep_too() -> None:
    """A shelf before a wall is no error of the pose, once it is known."""
    grid = hall()
    sweep, true = swept((0.06, 0.06, 0.0), size=(5.8, 5.0))
    occupied = np.zeros(grid.cells.shape, np.bool_)
    occupied[:, 114:] = True
    normal = FloorView(grid, occupied, ~occupied, np.zeros_like(occupied))
    found = Registration().registered(sweep, grid, normal)
    assert np.linalg.norm(found.ends - true, axis=1).max() < 0.06


def test_along_a_bare_corridor_the_doubt_is_left_and_across_it_is_not() -> None:
    size = (40.0, 3.0)
    sweep, _ = swept((0.0, 0.1, 0.02), size=size)
    near = np.abs(sweep.ends[:, 0] - HERE[0]) < 6.0
    sweep = sweep._replace(met=sweep.met & near & (sweep.ends[:, 0] > 0.5))
    found = Registration().registered(sweep, hall(*size), None)
    assert abs(found.sensor[1] - HERE[1]) < 0.03
    assert found.doubt is not None
    ahead = np.abs(found.ends[:, 1] - HERE[1]) < 0.2
    assert found.doubt[sweep.met].max() < 0.04, 'its side walls are where they were'
    assert ahead.any()


@pytest.mark.parametrize('count', [0, 5])
def test_with_too_few_ends_a_sweep_stays_and_its_doubt_is_that_of_the_localisation(
    count: int,
) -> None:
    sweep, _ = swept((0.05, 0.0, 0.0))
    few = sweep._replace(met=np.arange(len(sweep.ends)) < count)
    found = Registration().registered(few, hall(), None, (0.2, 0.1))
    assert found.sensor == pytest.approx(few.sensor)
    assert found.doubt is not None
    assert found.doubt.max() > 0.15


@given(errors, st.floats(-math.pi, math.pi))
def test_a_camera_is_placed_by_the_same_correction(
    off: tuple[float, float, float], bearing: float
) -> None:
    true = camera_pose(HERE[0] + 0.2, HERE[1] - 0.1, bearing, pitch=-0.1)
    turn = np.eye(4)
    turn[:2, :2] = [[math.cos(off[2]), -math.sin(off[2])], [math.sin(off[2]), math.cos(off[2])]]
    told = turn @ true
    told[:2, 3] = turn[:2, :2] @ (true[:2, 3] - HERE) + HERE + off[:2]
    registration = Registration()
    camera = CameraView(told, np.eye(3), 0.03, 0.02)
    assert registration.placed(camera, 1.0) is camera, 'no sweep yet'
    registration.registered(swept(off)[0], hall(), None)
    placed = registration.placed(camera, 1.5)
    assert np.abs(placed.pose - true).max() < 0.03
    assert (placed.deviation, placed.turn) == (0.03, 0.02)
    assert registration.placed(camera, 60.0) is camera, 'the robot may be anywhere since'
    registration.begin()
    assert registration.placed(camera, 1.5) is camera


def test_a_map_without_walls_holds_nothing() -> None:
    sweep, _ = swept((0.05, 0.0, 0.0))
    empty = Grid(np.zeros((100, 120), np.int8), SIDE, (0.0, 0.0))
    found = Registration().registered(sweep, empty, None)
    assert found.sensor == pytest.approx(sweep.sensor, abs=0.05)
    off_the_map = sweep._replace(sensor=(90.0, 90.0), ends=sweep.ends + 88.0)
    assert np.isfinite(Registration().registered(off_the_map, hall(), None).ends).all()
