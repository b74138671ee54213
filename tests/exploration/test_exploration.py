"""A robot in an unknown place: it sees all of it, comes back, and says what it left."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from benchmarks import regular_places
from floor_plans import Grid
from lidar_navigation import (
    Exploration,
    ForeignMap,
    FrontierParameters,
    GridPlanner,
    MapBuilder,
    Phase,
)
from lidar_navigation.exploration.frontiers import find_frontiers, frontier_cells
from lidar_navigation.geometry import Scan
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace


def explored(world: SimulatedPlace, *, most: float = 120.0, stop_at: float = math.inf) -> Any:
    """Explore a place; return the exploration and the robot."""
    robot = Robot(world, rng=np.random.default_rng(0))
    exploration = Exploration(MapBuilder(start=robot.base.pose))
    while exploration.phase is not Phase.DONE and robot.time < most:
        scan = Scan(robot.lidar.angles, robot.scan().astype(float), robot.lidar.range_max)
        velocity = exploration.see(scan, robot.base.odometry, robot.time)
        robot.base.command(velocity.speed, velocity.turn)
        robot.advance(0.1)
        exploration.think()
        if robot.time >= stop_at:
            exploration.stop()
    return exploration, robot


def test_two_rooms_are_seen_whole_and_the_robot_comes_back() -> None:
    world = SimulatedPlace.from_parameters(regular_places.grid(2, 1))
    exploration, robot = explored(world)
    assert exploration.phase is Phase.DONE
    assert exploration.reason == ''
    assert exploration.unreached == []
    assert robot.base.collisions == 0
    assert math.dist(robot.base.pose[:2], world.plan.start[:2]) < 0.4
    for x, y in ((0.3, 0.3), (3.7, 3.7), (4.3, 0.3), (7.7, 3.7)):
        assert exploration.grid.at(exploration.grid.free, x, y)


def test_what_the_robot_does_not_fit_into_is_said() -> None:
    parameters = regular_places.grid(2, 1)
    (door,) = parameters['doors']
    parameters['doors'][door][3] = 0.5
    exploration, robot = explored(SimulatedPlace.from_parameters(parameters))
    assert exploration.phase is Phase.DONE
    assert math.dist(robot.base.pose[:2], exploration.builder.start[:2]) < 0.4
    assert exploration.unreached
    assert {each.reason for each in exploration.unreached} == {'the robot does not fit there'}


def test_what_was_seen_before_a_stop_is_there() -> None:
    exploration, _ = explored(
        SimulatedPlace.from_parameters(regular_places.grid(2, 1)), stop_at=1.0
    )
    assert exploration.phase is Phase.DONE
    assert exploration.grid.free.any()


def test_a_robot_that_is_held_goes_on_afterwards() -> None:
    robot = Robot(
        SimulatedPlace.from_parameters(regular_places.grid(2, 1)), rng=np.random.default_rng(0)
    )
    exploration = Exploration(MapBuilder(start=robot.base.pose))
    held = 0
    while held < 90:
        scan = Scan(robot.lidar.angles, robot.scan().astype(float), robot.lidar.range_max)
        held += int(robot.time > 3.0)
        velocity = exploration.see(scan, robot.base.odometry, robot.time, stands=held > 0)
        assert not (held and velocity.speed)
        robot.base.command(velocity.speed, velocity.turn)
        robot.advance(1.0 if held > 5 else 0.1)
        exploration.think()
        if held == 5:
            goal = exploration.goal
    assert goal is not None
    assert exploration.goal is goal
    scan = Scan(robot.lidar.angles, robot.scan().astype(float), robot.lidar.range_max)
    exploration.see(scan, robot.base.odometry, robot.time)
    exploration.think()
    assert exploration.goal is goal
    assert exploration.unreached == []


def test_another_programs_map_without_floor_is_waited_out() -> None:
    foreign, cells = ForeignMap(), np.full((40, 40), -1, np.int8)
    foreign.take_correction((0.0, 0.0, 0.0))
    foreign.take_map(Grid(cells, 0.05))
    assert foreign.missing == 'map'
    assert not foreign.is_due((0.0, 0.0, 0.0))
    cells = cells.copy()
    cells[10:20, 10:20] = 0
    foreign.take_map(Grid(cells, 0.05))
    assert foreign.is_due((0.0, 0.0, 0.0))


def hall(unknown_from: int) -> Grid:
    """Return a hall of 6 m x 4 m of which the east is unknown from this column on."""
    cells = np.full((80, 120), 0, np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[:, unknown_from:] = -1
    return Grid(cells, 0.05)


def test_the_frontier_of_a_hall_is_one_line() -> None:
    grid = hall(80)
    assert frontier_cells(grid)[40, 79]
    (found,) = find_frontiers(grid, GridPlanner(grid).cost, (1.0, 2.0, 0.0), FrontierParameters())
    assert found.length == pytest.approx(3.9, abs=0.1)
    assert found.viewpoint is not None
    assert found.viewpoint[0] == pytest.approx(3.6, abs=0.2)
    assert found.path_length == pytest.approx(2.6, abs=0.4)


def test_a_viewpoint_that_showed_nothing_is_not_tried_again() -> None:
    grid = hall(80)
    cost = GridPlanner(grid).cost
    (first,) = find_frontiers(grid, cost, (1.0, 2.0, 0.0), FrontierParameters())
    assert first.viewpoint is not None
    spent = first.viewpoint[None]
    (second,) = find_frontiers(grid, cost, (1.0, 2.0, 0.0), FrontierParameters(), spent)
    assert second.viewpoint is not None
    assert math.dist(first.viewpoint, second.viewpoint) > 0.35


def test_a_map_without_unknown_has_no_frontier_but_its_rim() -> None:
    grid = hall(120)
    assert find_frontiers(grid, GridPlanner(grid).cost, (1.0, 2.0, 0.0), FrontierParameters()) == []
