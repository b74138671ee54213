"""Localisation: precise tracking, recovery from pushes and slips, and no panic about obstacles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from floor_plans import Grid
from lidar_navigation import Localiser
from lidar_navigation.geometry import Pose, Scan, angle_between, composed, in_map, relative

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
        return Scan(angles, localiser.cast(pose, angles, 8.0), 8.0)

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
        assert all(explained <= 1.0 for _, explained in localiser.search(scan))


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


def test_a_ray_ends_at_the_wall_or_at_the_lidar_s_reach() -> None:
    localiser = Localiser(box(), (11.0, -19.0, 0.0))
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2, math.pi / 4])
    ahead = localiser.cast((11.0, -19.0, 0.0), angles, 8.0)
    assert ahead == pytest.approx([3.0, 1.0, 1.0, 1.0, math.sqrt(2.0)], abs=0.026)
    turned = localiser.cast((11.0, -19.0, math.pi / 2), angles, 8.0)
    assert turned == pytest.approx([1.0, 1.0, 1.0, 3.0, math.sqrt(2.0)], abs=0.026)
    assert localiser.cast((11.0, -19.0, 0.0), angles[:2], 1.5) == pytest.approx(
        [1.5, 1.0], abs=0.026
    )


def test_the_part_of_the_rays_that_a_pose_explains_is_counted() -> None:
    localiser = Localiser(box(), (11.0, -19.0, 0.0))
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2])
    pose = (11.0, -19.0, 0.0)

    def explained(*ranges: float) -> float:
        return localiser.explained(pose, Scan(angles, np.array(ranges), 8.0))

    assert explained(3.0, 1.0, 1.0, 1.0) == 1.0
    assert explained(2.0, 1.0, 1.0, 1.0) == 0.75
    assert explained(np.inf, 1.0, np.nan, np.nan) == 0.5, 'what tells nothing does not count'
    assert explained(*[np.nan] * 4) == 0.0
    slack = localiser.parameters.hit + 0.025
    assert explained(3.0 + slack + 0.03, 1.0 - slack - 0.03, 1.0, 1.0) == 0.5
    assert explained(3.0 + slack - 0.03, 1.0 - slack + 0.03, 1.0, 1.0) == 1.0


def test_a_mounted_lidar_explains_from_where_it_sits() -> None:
    localiser = Localiser(box(), (11.0, -19.0, 0.0))
    scan = Scan(np.array([0.0, math.pi]), np.array([0.5, 1.5]), 8.0, (0.0, 0.5, math.pi / 2))
    assert localiser.explained((11.0, -19.0, 0.0), scan) == 1.0
    assert localiser.explained((11.0, -19.5, 0.0), scan) == 0.0


def test_a_scan_of_few_points_moves_nothing() -> None:
    localiser = Localiser(box(), (11.0, -19.0, 0.0))
    angles = np.linspace(-1.0, 1.0, 7)
    localiser.see(Scan(angles, np.full(7, 0.9), 8.0), now=0.0)
    assert localiser.pose == (11.0, -19.0, 0.0)
    assert localiser.search(Scan(angles, np.full(7, 0.9), 8.0)) == []


def cluttered(seed: int, shape: tuple[int, int] = (26, 34)) -> Grid:
    """Return a map of some blocks, a part of it unknown, whose south-west corner is at (-2, 3)."""
    draw = np.random.default_rng(seed)
    cells = np.zeros(shape, np.int8)
    for _ in range(5):
        row, column = (int(draw.integers(0, size - 4)) for size in shape)
        height, width = draw.integers(1, 5, 2)
        cells[row : row + height, column : column + width] = 100
    cells[:4, :5] = -1
    return Grid(cells, 0.1, (-2.0, 3.0))


def random_points(seed: int, count: int, reach: float = 1.5) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 2))


@pytest.mark.parametrize('seed', range(4))
def test_rays_go_as_far_as_steps_of_half_a_cell_find_nothing(seed: int) -> None:
    grid, draw = cluttered(seed), np.random.default_rng(seed)
    localiser = Localiser(grid, (0.0, 4.0, 0.0))
    for _ in range(5):
        pose = (draw.uniform(-2.2, 1.6), draw.uniform(2.8, 5.8), draw.uniform(-3, 3))
        angles = draw.uniform(-3.2, 3.2, 12)
        found = localiser.cast(pose, angles, 1.7)
        for angle, ray in zip(angles, found, strict=True):
            expected, way = 1.7, 0.0
            while way < 1.7 + 0.05:
                x = pose[0] + way * math.cos(angle + pose[2])
                y = pose[1] + way * math.sin(angle + pose[2])
                # Beyond its edge the map goes on as at the edge.
                column = min(max(int((x + 2.0) * 10), 0), 33)
                row = min(max(int((y - 3.0) * 10), 0), 25)
                if grid.cells[row, column] == 100:
                    expected = min(way, 1.7)
                    break
                way += 0.05
            assert ray == pytest.approx(expected, abs=0.051)
            assert ray <= 1.7
    far = Localiser(Grid(np.zeros((3, 4), np.int8), 0.1), (0.0, 0.0, 0.0))
    assert far.cast((0.1, 0.1, 0.0), np.zeros(2), 1e9).tolist() == [1e9, 1e9]


@pytest.mark.parametrize('seed', range(3))
def test_the_distance_to_an_edge_and_its_slope_are_those_of_scipy(seed: int) -> None:
    grid = cluttered(seed)
    localiser = Localiser(grid, (0.0, 4.0, 0.0))
    occupied = grid.cells == 100
    outside = 0.1 * ndimage.distance_transform_edt(~occupied)
    inside = 0.1 * ndimage.distance_transform_edt(occupied)
    signed = np.where(occupied, 0.05 - inside, outside - 0.05)

    def at(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        rank = np.array([(y - 3.0) / 0.1 - 0.5, (x + 2.0) / 0.1 - 0.5])
        return np.asarray(ndimage.map_coordinates(signed, rank, order=1, mode='nearest'))

    x, y = (random_points(seed, 60) + np.array([-0.3, 4.2])).T
    distance, slope_x, slope_y = localiser._edge_at(x, y)
    assert distance == pytest.approx(at(x, y), abs=2e-4)
    step = 1e-4
    # Where a step does not cross the middle of a cell, and on the map.
    for slope, (dx, dy), free in (
        (slope_x, (step, 0.0), np.abs((x * 10 + 0.5) % 1 - 0.5) < 0.45),
        (slope_y, (0.0, step), np.abs((y * 10 + 0.5) % 1 - 0.5) < 0.45),
    ):
        expected = (at(x + dx, y + dy) - at(x - dx, y - dy)) / (2 * step)
        good = free & (x > -1.9) & (x < 1.3) & (y > 3.1) & (y < 5.5)
        assert good.sum() > 20
        assert slope[good] == pytest.approx(expected[good], abs=2e-3)
    assert localiser._edge_at(np.array([99.0]), np.array([-99.0]))[0] == pytest.approx(
        signed[0, -1], abs=1e-3
    )


@pytest.mark.parametrize('moved', [(0.0, 0.0), (0.3, 0.0), (0.0, 0.4)])
def test_a_corrected_pose_is_where_robust_errors_and_the_pull_are_least(
    flat: Any, moved: tuple[float, float]
) -> None:
    true, start = (1.4, 1.2, 0.6), (1.44, 1.15, 0.63)
    points = np.concatenate([flat.scan(true).points[::3], random_points(1, 12, 1.0)])
    localiser = Localiser(flat.grid, start)
    found = localiser._matched(start, points, moved)
    assert found[:2] == pytest.approx(true[:2], abs=0.04)
    deviation = np.array(
        [0.05 + 0.2 * moved[0], 0.05 + 0.2 * moved[0], 0.04 + 0.1 * moved[0] + 0.2 * moved[1]]
    )

    def price(pose: np.ndarray) -> float:
        # The weights are those of Geman and McClure: this is the sum that they make least.
        squares = localiser._edge_at(*in_map(tuple(pose), points).T)[0] ** 2
        away = (pose - start) * 0.03 / deviation
        return 0.5 * float((squares / (1 + squares / 0.2**2)).sum() + (away**2).sum())

    least = price(np.array(found))
    assert least < price(np.array(start))
    for axis in range(3):
        for side in (-0.004, 0.004):
            beside = np.array(found)
            beside[axis] += side
            assert price(beside) > least


def test_a_correction_takes_no_steps_that_are_too_long(flat: Any) -> None:
    localiser = Localiser(flat.grid, (2.0, 1.5, 0.0))
    points = flat.scan((2.0, 1.5, 0.0)).points
    assert localiser._matched((2.0, 1.5, 0.0), points[:7], (1.0, 1.0)) == (2.0, 1.5, 0.0)
    start = (0.4, 2.6, 3.0)
    found = localiser._matched(start, points, (9.0, 9.0))
    assert max(abs(a - b) for a, b in zip(found[:2], start[:2], strict=True)) <= 8 * 0.15 + 1e-9
    assert -math.pi <= found[2] <= math.pi


def test_the_lattice_of_a_search_scores_what_adding_up_point_by_point_does() -> None:
    grid = cluttered(7)
    localiser = Localiser(grid, (0.0, 4.0, 0.4))
    localiser.parameters = type(localiser.parameters)(headings=5, lattice=0.3)
    points = random_points(3, 15)
    places, scores = localiser._scored(points)
    step, rows, columns = 3, *grid.cells.shape
    fit = np.exp(-0.5 * (localiser._edges / 0.2) ** 2)
    can_stand = [
        (row, column)
        for row in range(0, rows, step)
        for column in range(0, columns, step)
        if localiser._can_stand((-2.0 + 0.1 * column + 0.05, 3.0 + 0.1 * row + 0.05, 0.0))
    ]
    assert places == pytest.approx(grid.centres_of(np.array(can_stand)))
    assert scores.shape == (5, len(can_stand))
    for heading in range(5):
        yaw = 0.4 + heading * math.tau / 5
        for number, (row, column) in enumerate(can_stand):
            expected = 0.0
            for x, y in points:
                right = round((math.cos(yaw) * x - math.sin(yaw) * y) / 0.1) + column
                up = round((math.sin(yaw) * x + math.cos(yaw) * y) / 0.1) + row
                if 0 <= right < columns and 0 <= up < rows:
                    expected += fit[up, right]
            assert scores[heading, number] == pytest.approx(expected, abs=1e-4)


def test_the_robot_can_stand_where_its_body_overlaps_nothing() -> None:
    cells = np.zeros((20, 20), np.int8)
    cells[10, 10] = 100
    cells[:, 0] = -1
    localiser = Localiser(Grid(cells, 0.05), (0.0, 0.0, 0.0))
    assert not localiser._can_stand((0.025, 0.525, 0.0)), 'nobody knows what is there'
    assert localiser._can_stand((0.075, 0.525, 0.0))
    # From the middle of a cell to the edge of the one that is occupied.
    assert not localiser._can_stand((0.525 - 0.15, 0.525, 0.0))
    assert localiser._can_stand((0.525 - 0.2, 0.525, 0.0))
    assert not localiser._can_stand((-0.1, 0.5, 0.0))


def test_a_search_tells_the_likeliest_first_and_prefers_what_is_near(flat: Any) -> None:
    true = (5.5, 1.0, 1.0)
    localiser, scan = Localiser(flat.grid, (2.0, 1.5, 0.0)), flat.scan(true)
    found = localiser.search(scan)
    assert found[0][0] == pytest.approx(true, abs=0.05)
    assert found[0][1] > 0.95
    worth = [
        explained
        - 0.003 * math.hypot(pose[0] - 2.0, pose[1] - 1.5)
        - 0.02 * abs(angle_between(0.0, pose[2]))
        for pose, explained in found
    ]
    assert worth == sorted(worth, reverse=True)
    for pose, explained in found:
        assert localiser._can_stand(pose)
        assert explained == localiser.explained(pose, scan)
    assert len({pose for pose, _ in found}) > 5
    # A room that is the same turned round: near the last pose the way that it looked comes first.
    even = Localiser(box(), (11.4, -19.2, 3.0))
    angles = np.linspace(-math.pi, math.pi, 90, endpoint=False)
    seen = Scan(angles, even.cast((11.5, -19.2, -3.1), angles, 8.0), 8.0)
    assert even.search(seen)[0][0] == pytest.approx((11.5, -19.2, -3.1), abs=0.06)
    even.believe((12.4, -18.8, 0.0))
    assert even.search(seen)[0][0] == pytest.approx((12.4, -18.85, 0.04), abs=0.12)
