"""The simulator node among real subscribers, publishers and clients."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import UInt32
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from surveillance_controllers import conversions as received
from surveillance_interfaces.msg import DoorStates
from surveillance_interfaces.srv import (
    PushRobot,
    SetDoor,
)
from surveillance_runtime.conversions import pose_from, seconds_of
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.simulator_node import Simulator
from tests.places import changed, flat

from .simulators import ask, simulator


def test_a_killed_process_loses_neither_pose_nor_time_nor_doors(graph: Any, tmp_path: Path) -> None:
    path = tmp_path / 'simulator.json'
    first = simulator(graph, state_file=str(path))
    ask(graph, SetDoor, 'set_door', door='D', open=False)
    ask(graph, PushRobot, 'push_robot', dx=-0.5, dy=0.25, dyaw=1.0)
    pose = first.robot.base.pose
    graph.until(lambda: path.exists() and json.loads(path.read_text())['x'] == pose[0])
    graph.until(lambda: json.loads(path.read_text())['time'] > 5.0)
    graph.drop(first)
    kept = json.loads(path.read_text())
    second = simulator(graph, state_file=str(path))
    assert second.robot.base.pose == pose
    assert second.robot.base.odometry == first.robot.base.odometry
    assert second.robot.time >= kept['time']
    assert second.robot.world.closed_doors == {'D'}


@pytest.mark.parametrize(
    'state', ['[]', '{"x": 1.0}', '{"x": "far"}', '{"x": 1e308, "y": 0.0}', '{"x": NaN}']
)
def test_a_state_of_no_robot_in_this_place_begins_anew(
    graph: Any, tmp_path: Path, state: str
) -> None:
    path = tmp_path / 'simulator.json'
    whole = {
        **dict.fromkeys(('y', 'yaw', 'odometry_x', 'odometry_y', 'odometry_yaw', 'time'), 0.0),
        **{'closed': '', 'collisions': 0},
    }
    given = json.loads(state)
    path.write_text(json.dumps({**whole, **given} if given and len(given) == 1 else given))
    robot = simulator(graph, state_file=str(path)).robot
    assert robot.base.pose == robot.world.plan.start


def test_it_publishes_map_doors_clock_and_odometry(graph: Any) -> None:
    maps = graph.listen(OccupancyGrid, 'map', STATE_QOS)
    doors = graph.listen(DoorStates, 'door_states', STATE_QOS)
    clocks = graph.listen(Clock, '/clock')
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    simulator(graph)
    graph.until(lambda: maps and doors and len(clocks) > 3 and odometry)
    grid = received.grid_from(maps[0])
    assert grid.cells[tuple(grid.cells_of(np.array((1.0, 1.0)))[0])] == 0
    assert list(doors[0].open) == ['D']
    times = [clock.clock.sec + clock.clock.nanosec / 1e9 for clock in clocks]
    steps = np.diff(times) / 0.1  # the last one alone is kept: on a busy machine some are lost
    assert min(steps) > 0.5
    assert steps == pytest.approx(np.round(steps))
    assert pose_from(odometry[0].pose.pose) == (1.0, 1.0, 0.0)


def test_it_drives_on_command_and_stops_at_the_wall(graph: Any) -> None:
    truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
    collisions = graph.listen(UInt32, 'collisions', STATE_QOS)
    simulator(graph, **{'speed': 0.0, 'station': [1.0, 1.0, math.pi]})
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    forward = Twist()
    forward.linear.x = 0.6
    graph.node.create_subscription(
        Odometry, 'odom', lambda _: commands.publish(forward), SENSOR_QOS
    )
    graph.until(lambda: collisions and collisions[-1].data == 1)
    graph.until(lambda: truth and truth[-1].pose.position.x < 0.28)
    assert truth[-1].pose.position.x > 0.27


def test_a_base_behind_the_collision_monitor_obeys_nobody_else(graph: Any) -> None:
    base = simulator(graph, **{'speed': 0.0}).robot.base
    foreign = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    monitor = graph.node.create_publisher(Twist, 'cmd_vel_monitored', 1)
    turn = Twist()
    turn.angular.z = 1.0

    def turned(commands: Any) -> bool:
        commands.publish(turn)
        return base.turn_speed != 0.0

    graph.until(lambda: turned(foreign))
    turn.angular.z = -1.0
    graph.until(lambda: turned(monitor) and base.turn_speed < 0.0)
    turn.angular.z = 1.0
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    graph.until(lambda: (foreign.publish(turn), len(odometry) > 20)[1])
    assert base.turn_speed <= 0.0


def test_a_trajectory_it_cannot_follow_leaves_the_arm(graph: Any) -> None:
    node = simulator(graph)
    joints = graph.listen(JointState, 'joint_states', SENSOR_QOS)
    arm = graph.node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 1)
    graph.until(lambda: arm.get_subscription_count() and joints)
    errors: list[str] = []
    node.get_logger().error = errors.append
    point = JointTrajectoryPoint(positions=[9.0], time_from_start=Duration(sec=1))
    arm.publish(JointTrajectory(joint_names=['arm_pan'], points=[point]))
    graph.until(lambda: errors)
    assert errors == ['arm/joint_trajectory: point 1: arm_pan at 9 rad: expected -3.2 to 3.2']
    count = len(joints)
    graph.until(lambda: len(joints) > count + 15)
    assert joints[-1].position[0] == 0.0
    times = [seconds_of(each.header.stamp) for each in joints[-5:]]
    assert min(b - a for a, b in itertools.pairwise(times)) == pytest.approx(0.1)


def test_a_damaged_estimate_costs_one_line_that_names_its_topic(graph: Any) -> None:
    node = simulator(graph)
    estimates = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    graph.until(lambda: estimates.get_subscription_count())
    errors: list[str] = []
    node.get_logger().error = errors.append
    estimates.publish(b'\x00\x01\x00\x00\x05')
    graph.until(lambda: errors)
    assert errors == ['amcl_pose: a message of 5 bytes: expected a longer one']


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        (changed(doors__D=[3.0, 1.0, 0.0, 1.0]), 'simulator: doors.D: (3, 1) with width 1 m'),
        (changed(marker_dictionary='DICT_X'), "simulator: marker dictionary 'DICT_X'"),
    ],
)
def test_it_does_not_start_in_a_wrong_place(
    graph: Any, parameters: dict[str, Any], message: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        graph.add(Simulator, parameters=flat(parameters))
    assert str(caught.value).startswith(message)


def test_it_does_not_start_with_a_wrong_speed(graph: Any) -> None:
    with pytest.raises(ParameterError, match=r'speed: got -1\.0, expected'):
        simulator(graph, speed=-1.0)


def test_at_real_time_it_leaves_the_clock_alone(graph: Any) -> None:
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    clocks = graph.listen(Clock, '/clock')
    simulator(graph, speed=1.0)
    graph.until(lambda: len(odometry) > 2)
    assert not clocks
    assert odometry[-1].header.stamp.sec > 1_000_000_000


def test_a_second_clock_in_the_domain_is_named_once(graph: Any) -> None:
    said = graph.said()
    graph.node.create_publisher(Clock, '/clock', 1)
    simulator(graph)
    graph.until(lambda: any('publisher(s) of /clock' in line for line in said))


def test_time_stands_while_the_mission_is_at_work(graph: Any) -> None:
    node = simulator(graph, speed=0.0)
    waits = graph.node.create_publisher(Time, 'mission_waits_until', STATE_QOS)
    clocks = graph.listen(Clock, '/clock')
    graph.until(lambda: clocks)
    until = int(node.robot.time) + 30
    waits.publish(Time(sec=until))
    graph.until(lambda: node.robot.time == pytest.approx(until))
    waits.publish(Time(sec=until + 2))
    graph.until(lambda: node.robot.time == pytest.approx(until + 2))
