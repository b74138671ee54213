"""The map of an unknown place: scans are matched, loops closed, and the walls come out straight."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lidar_navigation import MapBuilder
from lidar_navigation.exploration.evidence_grid import EvidenceGrid
from lidar_navigation.exploration.pose_graph import Constraint, PoseGraph
from lidar_navigation.exploration.scan_matching import Matcher, surface_of
from lidar_navigation.geometry import Pose, Scan, composed, relative
from surveillance_simulation.robot.lidar import LidarModel, scan
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place

LIDAR = LidarModel()


@pytest.fixture(scope='module')
def world() -> SimulatedPlace:
    return read_simulated_place('config/seven_rooms.yaml')


def seen(world: SimulatedPlace, pose: Pose, seed: int = 0) -> Scan:
    ranges = scan(world, pose, LIDAR, np.random.default_rng(seed)).astype(float)
    return Scan(LIDAR.angles, ranges, LIDAR.range_max)


@pytest.mark.parametrize('off', [(0.2, -0.15, 0.15), (-0.2, 0.2, -0.18), (0.0, 0.0, 0.0)])
def test_a_scan_is_found_to_a_centimetre(world: SimulatedPlace, off: Pose) -> None:
    before, true = (4.0, 11.0, 0.3), (4.3, 11.1, 0.45)
    matcher = Matcher(surface_of(seen(world, before)).moved(before))
    made = seen(world, true, seed=1)
    found = matcher.match(made, surface_of(made), composed(true, off), (0.3, 0.25))
    assert found is not None
    assert math.dist(found.pose[:2], true[:2]) < 0.01
    assert abs(found.pose[2] - true[2]) < 0.005
    assert found.agreement > 0.9
    assert found.contradiction < 0.02


def test_a_corridor_says_nothing_of_its_length() -> None:
    angles = np.arange(360) * math.tau / 360 - math.pi
    with np.errstate(divide='ignore'):
        ranges = np.abs(1.0 / np.sin(angles))
    corridor = Scan(angles, np.where(ranges < 8.0, ranges, np.inf), 8.0)
    found = Matcher(surface_of(corridor)).match(
        corridor, surface_of(corridor), (0.0, 0.02, 0.01), (0.0, 0.0)
    )
    assert found is not None
    along, across = found.information[0, 0], found.information[1, 1]
    assert along < 1e-3 * across


def test_the_two_sides_of_a_wall_are_not_taken_for_each_other(world: SimulatedPlace) -> None:
    # Between the corridors is a wall of 10 cm at y = 10.
    south, north = (9.0, 8.3, 0.0), (9.0, 12.0, 0.0)
    matcher = Matcher(surface_of(seen(world, south)).moved(south))
    made = seen(world, north, seed=1)
    found = matcher.match(made, surface_of(made), north, (0.0, 0.0), np.diag([1e3, 1e3, 1e4]))
    assert found is not None
    assert found.agreement < 0.2
    # Drawn onto the wrong side it would be off by the wall.
    assert abs(found.pose[1] - north[1]) < 0.05


def test_a_scan_of_another_room_is_contradicted(world: SimulatedPlace) -> None:
    matcher = Matcher(surface_of(seen(world, (10.0, 8.0, 0.0))).moved((10.0, 8.0, 0.0)))
    made = seen(world, (5.0, 10.0, 0.0))
    found = matcher.match(made, surface_of(made), (10.0, 8.0, 0.0), (1.0, 0.3))
    assert found is not None
    assert found.agreement < 0.6 or found.contradiction > 0.1


def ring(count: int, rng: np.random.Generator) -> PoseGraph:
    """Return a ring of poses whose steps are measured with errors, and one exact loop."""
    true: list[Pose] = []
    for number in range(count):
        angle = number * math.tau / count
        true.append((10 * math.cos(angle), 10 * math.sin(angle), angle + math.pi / 2))
    information = np.diag([400.0, 400.0, 2500.0])
    poses, edges = [true[0]], []
    for number in range(count - 1):
        x, y, yaw = relative(true[number], true[number + 1])
        error = rng.normal(0.0, (0.05, 0.05, 0.02))
        step = (x + float(error[0]), y + float(error[1]), yaw + float(error[2]))
        edges.append(Constraint(number, number + 1, step, information))
        poses.append(composed(poses[-1], step))
    closing = relative(true[-1], true[0])
    edges.append(Constraint(count - 1, 0, closing, 100 * information, may_be_wrong=True))
    return PoseGraph(poses, edges)


def test_a_loop_takes_the_error_out_of_the_whole_ring() -> None:
    graph = ring(60, np.random.default_rng(1))
    loop = graph.constraints[-1]

    def gap() -> float:
        back = relative(graph.poses[loop.first], graph.poses[loop.second])
        return math.dist(back[:2], loop.step[:2])

    before, first = gap(), graph.poses[0]
    graph.optimise()
    assert before > 0.5
    assert gap() < 0.03
    assert graph.poses[0] == pytest.approx(first)


def test_a_wrong_loop_among_right_ones_loses() -> None:
    graph = ring(60, np.random.default_rng(1))
    graph.optimise()
    right = list(graph.poses)
    information = np.diag([4e4, 4e4, 2.5e5])
    graph.constraints.append(Constraint(10, 40, (1.0, 0.0, 0.0), information, may_be_wrong=True))
    graph.optimise()
    off = [math.dist(one[:2], other[:2]) for one, other in zip(graph.poses, right, strict=True)]
    assert max(off) < 0.5


def test_a_scan_is_taken_away_as_if_it_had_never_been_there(world: SimulatedPlace) -> None:
    one, two = (5.0, 10.0, 0.0), (10.0, 8.0, 1.0)
    grid, alone = EvidenceGrid(), EvidenceGrid()
    grid.add(one, seen(world, one))
    grid.add(two, seen(world, two))
    grid.remove(two, seen(world, two))
    alone.add(one, seen(world, one))
    both, single = grid.grid(), alone.grid()
    cells = single.cells_of(single.centres_of(np.argwhere(single.cells >= 0)))
    known = both.cells_of(single.centres_of(cells))
    assert (both.cells[tuple(known.T)] == single.cells[tuple(cells.T)]).all()
    assert (both.cells >= 0).sum() == (single.cells >= 0).sum()


def test_a_ray_of_unknown_length_shows_nothing() -> None:
    ranges = np.full(8, np.nan)
    grid = EvidenceGrid()
    grid.add((0.0, 0.0, 0.0), Scan(np.linspace(-3.0, 3.0, 8), ranges, 8.0))
    assert (grid.grid().cells < 0).all()


def test_what_walked_away_leaves_the_map(world: SimulatedPlace) -> None:
    pose = (5.0, 10.0, 0.0)
    empty = seen(world, pose)
    near = empty.ranges.copy()
    near[np.abs(empty.angles) < 0.1] = 1.5
    grid = EvidenceGrid()
    grid.add(pose, replace(empty, ranges=near))
    person = grid.grid().cell_of(6.5, 10.0)
    assert grid.grid().occupied[person]
    for _ in range(4):
        grid.add(pose, empty)
    assert grid.grid().free[grid.grid().cell_of(6.5, 10.0)]


def test_a_round_is_mapped_in_spite_of_a_bad_odometry(world: SimulatedPlace) -> None:
    rng = np.random.default_rng(2)
    stops = [(5.0, 10.0), (6.0, 8.5), (12.5, 8.5), (12.5, 12.0), (6.0, 11.5), (5.0, 10.0)]
    points = [np.array(stops[0])]
    for begin, end in pairwise(stops):
        count = math.ceil(math.dist(begin, end) / 0.25)
        points += list(np.linspace(begin, end, count + 1)[1:])
    builder = MapBuilder(start=(5.0, 10.0, 0.0))
    true, odometry = builder.start, builder.start
    builder.see(seen(world, true), odometry)
    for before, after in pairwise(points):
        yaw = math.atan2(*(after - before)[::-1])
        new = (float(after[0]), float(after[1]), yaw)
        dx, dy, turn = relative(true, new)
        bad = (1.05 * dx, 1.05 * dy, turn + 0.01 + float(rng.normal(0.0, 0.01)))
        true, odometry = new, composed(odometry, bad)
        builder.see(seen(world, true, seed=builder.kept), odometry, keep=True)
    assert math.dist(odometry[:2], true[:2]) > 0.5
    assert math.dist(builder.pose(odometry)[:2], true[:2]) < 0.03
    assert builder.loops > 0


def test_odometry_that_begins_anew_does_not_tear_the_map(world: SimulatedPlace) -> None:
    builder, pose = MapBuilder(start=(4.0, 11.0, 0.3)), (4.0, 11.0, 0.3)
    builder.see(seen(world, pose), (3e6, -7.0, 0.0))
    before = builder.grid().cells.shape
    assert builder.see(seen(world, pose, seed=1), (0.0, 0.0, 1.0))
    assert math.dist(builder.pose((0.0, 0.0, 1.0))[:2], pose[:2]) < 0.02
    assert builder.grid().cells.shape == before
