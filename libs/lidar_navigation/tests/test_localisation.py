"""Localisation: precise tracking, recovery from pushes and slips, and no panic about obstacles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from floor_plans import Grid
from lidar_navigation import Localiser
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, relative
from lidar_navigation.localisation.scan_fit import ScanFit

POSES = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))


def error(localiser: Localiser, true: tuple[float, float, float]) -> tuple[float, float]:
    gap = math.dist(localiser.pose[:2], true[:2])
    return gap, abs(math.remainder(localiser.pose[2] - true[2], math.tau))


@given(POSES, POSES)
@settings(max_examples=60)
def test_a_step_between_two_poses_leads_from_one_to_the_other(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    reached = composed(first, relative(first, second))
    assert reached[:2] == pytest.approx(second[:2], abs=1e-9)
    assert math.remainder(reached[2] - second[2], math.tau) == pytest.approx(0, abs=1e-9)


def test_a_drive_with_drifting_odometry_is_tracked(flat: Any) -> None:
    true = (1.0, 1.5, 0.0)
    localiser = Localiser(flat.grid, true)
    odometry = (7.0, -3.0, 1.0)
    localiser.move(odometry)
    for step in range(60):
        turn = 0.05 * math.sin(step / 9)
        true = composed(true, (0.05, 0.0, turn))
        odometry = composed(odometry, (0.05 * 1.08, 0.002, turn + 0.006))
        localiser.move(odometry)
        localiser.see(flat.scan(true), now=0.1 * step)
        assert localiser.certain
    gap, turn = error(localiser, true)
    assert gap < 0.05
    assert turn < 0.02
    assert localiser.jumps == 0


@given(st.floats(-0.8, 0.8), st.floats(-0.6, 0.6), st.floats(-3.1, 3.1))
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_pushed_robot_finds_itself(flat: Any, dx: float, dy: float, dyaw: float) -> None:
    localiser = Localiser(flat.grid, (2.2, 1.4, 0.3))
    true = (2.2 + dx, 1.4 + dy, 0.3 + dyaw)
    # One that is turned round is followed for some scans before it is believed.
    for step in range(14):
        localiser.see(flat.scan(true), now=float(step))
    gap, turn = error(localiser, true)
    assert gap < 0.06
    assert turn < 0.04
    assert localiser.certain


def test_a_robot_carried_into_another_room_finds_itself_after_some_scans(flat: Any) -> None:
    localiser = Localiser(flat.grid, (1.0, 1.0, 0.0))
    true = (6.0, 2.2, 2.0)
    for step in range(20):
        localiser.see(flat.scan(true), now=float(step))
    assert error(localiser, true)[0] < 0.06
    assert localiser.jumps == 1


def test_of_rooms_that_look_alike_the_one_wins_that_the_way_out_shows() -> None:
    # Four rooms of 2 m, all the same, with their doors to a corridor.
    cells = np.full((68, 164), 100, np.int8)
    for column in (2, 42, 82, 122):
        cells[2:42, column : column + 38] = 0
        cells[42:44, column + 14 : column + 26] = 0
    cells[44:64, 2:160] = 0
    grid = Grid(cells, 0.05, (0.0, 0.0))
    localiser = Localiser(grid, (1.0, 1.0, 0.0))
    angles = np.linspace(-math.pi, math.pi, 180, endpoint=False)

    def scan(pose: Pose) -> Scan:
        return Scan(angles, ScanFit(grid).cast(pose, angles, 8.0), 8.0)

    start = (5.1, 1.0, math.pi / 2)
    localiser.move(start)
    for step in range(10):
        localiser.see(scan(start), now=float(step))
    assert not localiser.lost, 'it can be driven with'
    assert localiser.ambiguous
    for step in range(1, 18):
        true = composed(start, (0.1 * step, 0.0, 0.0))
        localiser.move(true)
        localiser.see(scan(true), now=10.0 + step)
    assert error(localiser, true)[0] < 0.1
    assert not localiser.ambiguous


def test_a_slip_of_the_odometry_is_not_believed(flat: Any) -> None:
    true = (2.0, 1.5, 0.5)
    localiser = Localiser(flat.grid, true)
    localiser.move((0, 0, 0))
    localiser.see(flat.scan(true), now=0)
    localiser.move((1.5, 0.4, 0.9))
    localiser.see(flat.scan(true), now=1)
    assert error(localiser, true)[0] < 0.05
    localiser.move((1.6, 0.45, 1.1))
    for step in range(4):
        localiser.see(flat.scan(true), now=2.0 + step)
    assert error(localiser, true)[0] < 0.05


def test_obstacles_and_a_closed_door_do_not_carry_the_estimate_away(flat: Any) -> None:
    true = (3.2, 1.5, 0.1)
    localiser = Localiser(flat.grid, true)
    obstacles = [(2.5, 1.9, 0.2), (3.6, 0.8, 0.15)]
    for step in range(12):
        localiser.see(flat.scan(true, obstacles, closed=True), now=float(step))
    assert error(localiser, true)[0] < 0.06
    assert localiser.jumps == 0
    assert not localiser.lost


def test_rays_that_tell_nothing_are_no_doubt(flat: Any) -> None:
    true = (2.0, 1.5, 0.0)
    localiser = Localiser(flat.grid, true)
    scan = flat.scan(true)
    scan.ranges[::3] = math.nan
    localiser.see(scan, now=0.0)
    assert localiser.certain
    assert localiser.agreement == pytest.approx(1.0, abs=0.05)
    scan.ranges[:] = math.nan
    assert localiser.explained(true, scan) == 0.0


@pytest.mark.parametrize('shape', [(1, 1), (1, 40), (3, 2), (60, 60)])
@pytest.mark.parametrize('value', [-1, 0, 100])
def test_a_map_of_any_size_is_searched(shape: tuple[int, int], value: int) -> None:
    localiser = Localiser(Grid(np.full(shape, value, np.int8), 0.05, (0.0, 0.0)), (0.02, 0.02, 0.0))
    angles = np.linspace(0.0, 6.2, 90)
    for met, reach in ((0.5, 8.0), (999.0, 1000.0)):
        scan = Scan(angles, np.full(90, met), reach)
        localiser.see(scan, now=0.0)
        assert all(explained.fit <= 1.0 for _, explained in localiser.search(scan))


def test_a_robot_that_sees_nothing_of_its_map_is_lost_and_found_again(flat: Any) -> None:
    true = (2.0, 1.5, 0.0)
    localiser = Localiser(flat.grid, true)
    scan = flat.scan(true)
    nonsense = np.random.default_rng(2).uniform(0.3, 7.0, len(scan.angles))
    for step in range(6):
        localiser.see(Scan(scan.angles, nonsense, scan.range_max), now=float(step))
    assert localiser.lost
    for step in range(30):
        localiser.see(flat.scan(true), now=10.0 + step)
    assert not localiser.lost
    assert error(localiser, true)[0] < 0.06


def test_scans_that_tell_nothing_new_are_not_used(flat: Any) -> None:
    localiser = Localiser(flat.grid, (2.0, 1.5, 0.0))
    scan = flat.scan((2.0, 1.5, 0.0))
    assert localiser.see(scan, now=0.0)
    assert not localiser.see(scan, now=0.1)
    assert localiser.see(scan, now=0.6)
    localiser.move((0, 0, 0))
    localiser.move((0.2, 0, 0))
    assert localiser.see(flat.scan((2.2, 1.5, 0.0)), now=0.65)


def clutter(flat: Any, pose: Pose, seed: int, share: float = 0.15) -> Scan:
    """Return a scan of which a share of the rays meet what the map does not have."""
    seen, draw = flat.scan(pose), np.random.default_rng(seed)
    blocked = draw.random(len(seen.ranges)) < share
    return Scan(seen.angles, np.where(blocked, 0.7 * seen.ranges, seen.ranges), seen.range_max)


def test_where_much_is_not_on_the_map_the_robot_looks_once_and_not_with_each_scan(
    flat: Any,
) -> None:
    searches: list[int] = []
    localiser = Localiser(flat.grid, (1.0, 0.8, 0.0), lambda: searches.append(1))
    for step in range(80):
        true = (1.0 + 0.03 * step, 0.8 + 0.3 * math.sin(0.1 * step), 0.02 * step)
        localiser.move(true)
        localiser.see(clutter(flat, true, step), now=0.3 * step)
    assert error(localiser, true)[0] < 0.06
    assert localiser.jumps == 0
    assert len(searches) <= 8


def test_a_slip_in_a_cluttered_room_is_mended_nearby_and_the_robot_is_not_turned_round(
    flat: Any,
) -> None:
    localiser = Localiser(flat.grid, (1.0, 0.8, 0.0))
    slipped = (0.0, 0.0, 0.0)
    for step in range(60):
        true = (1.0 + 0.03 * step, 0.8, 0.0)
        if step % 15 == 14:
            slipped = (slipped[0] + 0.05, slipped[1], slipped[2] + 0.25)
        localiser.move(composed(true, slipped))
        localiser.see(clutter(flat, true, step), now=0.3 * step)
        assert abs(angle_between(localiser.pose[2], true[2])) < 0.4
    assert error(localiser, true)[0] < 0.1
    assert localiser.jumps == 0


@pytest.mark.parametrize('corner', [(-3.0, -1.0), (200.0, -300.0)], ids=['near', 'far'])
def test_it_is_all_the_same_where_the_map_has_its_origin(
    flat: Any, corner: tuple[float, float]
) -> None:
    grid = Grid(flat.grid.cells, flat.grid.resolution, corner)
    pose, off = (1.2, 1.3, 0.7), (0.08, -0.06, 0.09)
    scan = flat.scan(pose)
    true = (pose[0] + corner[0], pose[1] + corner[1], pose[2])
    localiser = Localiser(grid, composed(true, off))
    localiser.see(scan, now=0.0)
    gap, turn = error(localiser, true)
    assert gap < 0.03
    assert turn < 0.02
    assert localiser.certain


def box() -> Grid:
    """Return a room of 4 x 2 m between walls of one cell, its south-west corner at (10, -20)."""
    cells = np.zeros((42, 82), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return Grid(cells, 0.05, (9.95, -20.05))


def test_a_scan_of_few_points_moves_nothing() -> None:
    localiser = Localiser(box(), (11.0, -19.0, 0.0))
    angles = np.linspace(-1.0, 1.0, 7)
    localiser.see(Scan(angles, np.full(7, 0.9), 8.0), now=0.0)
    assert localiser.pose == (11.0, -19.0, 0.0)
    assert localiser.search(Scan(angles, np.full(7, 0.9), 8.0)) == []
