"""A lidar that sits otherwise than the profile says, and wheels of another size: the robot stands
within half a metre and names what to change."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from geometry_msgs.msg import Point, PoseStamped
from std_msgs.msg import UInt32

from state_machines.ros import GoalCaller
from surveillance_controllers.collision_monitor_node import CollisionMonitor
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import Incident
from surveillance_runtime.incident_topic import INCIDENTS_QOS
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.simulator_node import Simulator


@pytest.mark.parametrize(
    ('true', 'told', 'change'),
    [
        ({'lidar_mounts': [0.0, 0.0, math.pi / 2, 0.0]}, {}, 'lidars: {mounts: [[0, 0, 1.5'),
        ({'lidar_mounts': [0.0, 0.0, 0.0, 3.1416]}, {}, '3.1416]]}'),
        ({}, {'odometry.scale': 1.2}, 'odometry: {scale: 0.8'),
    ],
    ids=['turned', 'upside down', 'wheels'],
)
def test_it_stands_within_half_a_metre_and_names_the_line_to_change(
    graph: Any,
    seven_rooms: dict[str, Any],
    true: dict[str, Any],
    told: dict[str, Any],
    change: str,
) -> None:
    timed = {**seven_rooms, 'use_sim_time': True, 'execution_mode': 'SIMULATED'}
    graph.add(Simulator, {**seven_rooms, **true, 'use_sim_time': True, 'speed': 0.0})
    graph.add(CollisionMonitor, {**timed, **told})
    graph.add(MotionController, {**timed, **told})
    truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
    collisions = graph.listen(UInt32, 'collisions', STATE_QOS)
    incidents = graph.listen(Incident, 'incidents', INCIDENTS_QOS)
    follow = GoalCaller(graph.node, FollowPath, 'follow_path')
    graph.until(lambda: truth)
    start = truth[-1].pose.position
    path = [Point(x=start.x, y=start.y), Point(x=start.x - 2.0, y=start.y - 0.5)]

    end = follow.run(FollowPath.Goal(path=path), accept_timeout=60.0, result_timeout=120.0)

    assert end.status == 'aborted'
    graph.until(lambda: any(change in each.action for each in incidents))
    positions = [(each.pose.position.x, each.pose.position.y) for each in truth]
    assert sum(itertools.starmap(math.dist, itertools.pairwise(positions))) <= 0.5
    assert collisions[-1].data == 0
