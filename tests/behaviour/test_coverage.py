"""The topic `coverage` says how much of each place was in view; a sweep drives to the rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from floor_plans import Grid
from patrol_policy.decision import DecisionSettings
from state_machines import Interrupt
from state_machines.ros import GoalServer
from surveillance_behaviour.ros_adapters.coverage import RosCoverage, RosSweep
from surveillance_behaviour.ros_adapters.peers import Deadlines
from surveillance_interfaces.action import ComputePath, FollowPath
from surveillance_interfaces.msg import PlaceCoverages
from surveillance_runtime.conversions import pose_estimate
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from tests.places import flat

HALL = {
    'room_positions': {'A': [1.0, 1.0], 'B': [7.0, 1.0]},
    'doors': {'D': [5.0, 1.0, 1.5707963, 1.0]},
    'sweep': ['A'],
    'thresholds': {'A': 1000},
    'coverage.range': 2.0,
}


def building() -> Grid:
    """Return two rooms of 5 m x 2 m and 3 m x 2 m with a door between them."""
    cells = np.full((24, 84), 100, np.int8)
    cells[2:22, 2:82] = 0
    cells[2:22, 51:53] = 100
    cells[8:16, 51:53] = 0
    return Grid(cells, 0.1, (-0.2, -0.2))


@pytest.fixture
def robot(graph: Any) -> Any:
    """Provide a robot that drives by jumps, with what hears its coverage."""
    node = graph.add(PatrolNode, flat(HALL), name='robot_behavior')
    coverage = RosCoverage(node, DecisionSettings(), lambda: 100.0)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    maps = graph.node.create_publisher(OccupancyGrid, 'map', STATE_QOS)
    grid = building()
    told = OccupancyGrid(data=grid.cells.ravel().tolist())
    told.info.height, told.info.width = grid.cells.shape
    told.info.resolution = grid.resolution
    told.info.origin.position.x, told.info.origin.position.y = grid.origin
    maps.publish(told)

    def stand(x: float, y: float) -> None:
        poses.publish(PoseWithCovarianceStamped(pose=pose_estimate((x, y, 0.0), 0.1, 0.1)))
        graph.until(lambda: coverage.pose is not None and coverage.pose[:2] == (x, y))

    motion = graph.add(PatrolNode, name='motion')

    def plan(goal: Any, _run: Any) -> Any:
        return ComputePath.Result(path=[goal.start, goal.goal])

    def follow(goal: Any, _run: Any) -> Any:
        end = goal.path[-1]
        stand(end.x, end.y)
        return FollowPath.Result(position=Point(x=end.x, y=end.y))

    GoalServer(motion, ComputePath, 'compute_path', plan)
    GoalServer(motion, FollowPath, 'follow_path', follow)
    stand(0.5, 1.0)
    graph.until(lambda: coverage.known is not None)
    return coverage, RosSweep(node, coverage, Deadlines())


def test_a_sweep_drives_until_all_of_the_place_was_in_view(robot: Any, graph: Any) -> None:
    _, sweep = robot
    assert sweep.sweeps_any
    assert sweep.is_swept('A')
    assert not sweep.is_swept('B')
    metres = sweep.begin('A', 50.0)
    assert 2.0 < metres < 8.0
    stops = []
    while (stop := sweep.next_stop()) is not None:
        sweep.drive(stop, Interrupt())
        stops.append(stop)
        assert len(stops) < 10
    assert all(x < 5.0 for x, _, _ in stops)
    part, driven = sweep.end(12.0)
    assert part >= 0.95
    assert driven > 1.0
    assert sweep.seconds() == {'A': 12.0}
    assert sweep.covered()['A'] >= 0.95
    assert sweep.covered()['B'] < 0.5
    heard: list[PlaceCoverages] = graph.listen(PlaceCoverages, 'coverage', STATE_QOS)
    graph.until(lambda: heard and heard[-1].places[0].share >= 0.95)
    first, second = heard[-1].places
    assert (first.place, second.place) == ('A', 'B')
    assert first.area == pytest.approx(10.0, abs=0.8)
    assert np.isnan(first.camera_share)


def test_without_a_pose_or_a_map_there_is_nothing_to_sweep(graph: Any) -> None:
    node = graph.add(PatrolNode, flat(HALL), name='robot_behavior')
    sweep = RosSweep(node, RosCoverage(node, DecisionSettings(), lambda: 1.0), Deadlines())
    assert sweep.begin('A', 0.0) is None
    assert sweep.next_stop() is None
    assert sweep.covered() == {}
    assert sweep.end(None) == (0.0, 0.0)
