"""A person stops the robot, or pauses its mission: it stands, and goes on afterwards."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from state_machines.ros import ServiceCaller
from surveillance_controllers.collision_monitor_node import CollisionMonitor
from surveillance_controllers.motion.nav2 import rest_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.state_topics import OwnedTopic

from .test_navigation_motion import World, world  # noqa: F401 - a fixture


def press(graph: Any, stop: bool) -> str:
    caller = ServiceCaller(graph.node, SetBool, 'stop')
    return str(caller.call(SetBool.Request(data=stop), 60.0).message)


class Joystick:
    """Commands the base past the mission, in an empty hall."""

    def __init__(self, graph: Any) -> None:
        self._commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
        self._scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        self._told = graph.listen(Twist, 'cmd_vel_monitored', 1)

    def speed(self) -> float:
        self._scans.publish(LaserScan(angle_increment=0.02, range_max=8.0, ranges=[7.0] * 21))
        command = Twist()
        command.linear.x = 0.5
        self._commands.publish(command)
        return float(self._told[-1].linear.x) if self._told else math.nan


def test_a_stop_holds_whoever_commands_and_only_a_person_ends_it(
    graph: Any, tmp_path: Path
) -> None:
    kept = {'state_file': str(tmp_path / 'monitor.json')}
    monitor = graph.add(CollisionMonitor, kept)
    joystick = Joystick(graph)
    stopped = graph.listen(Bool, 'stopped', 1)
    graph.until(lambda: joystick.speed() == 0.5)
    assert press(graph, True) == 'the robot is stopped'
    graph.until(lambda: joystick.speed() == 0.0)
    assert ('person', 'stop') in monitor.incidents.open()
    # Nobody else's word counts, neither on the topic nor that of a node that begins anew.
    stranger = graph.add(PatrolNode, name='stranger')
    stranger.create_publisher(Bool, 'stopped', 1).publish(Bool(data=False))
    graph.remove(monitor)
    graph.add(CollisionMonitor, kept)
    graph.until(lambda: stopped and stopped[-1].data)
    for _try in range(20):
        assert joystick.speed() == 0.0
    assert press(graph, False) == 'the robot may move again'
    graph.until(lambda: joystick.speed() == 0.5)


@pytest.mark.parametrize('topic', ['stopped', 'paused'])
def test_a_robot_that_is_held_stands_and_then_ends_its_leg(
    world: World,  # noqa: F811
    topic: str,
) -> None:
    graph = world.graph
    owner = {'stopped': 'collision_monitor', 'paused': 'robot_behavior'}[topic]
    hold = OwnedTopic(graph.add(PatrolNode, name=owner), Bool, topic)
    path = world.compute((10.0, 8.0)).result.path
    ends: list[Any] = []
    begun = world.position
    thread = threading.Thread(target=lambda: ends.append(world.follow(path)))
    thread.start()
    graph.until(lambda: math.dist(world.position, begun) > 0.5)
    hold.publish(Bool(data=True))
    still = [world.position]

    def stands() -> bool:
        seen = len(world.truth)
        graph.until(lambda: len(world.truth) > seen + 20)
        still.append(world.position)
        return math.dist(still[-1], still[-2]) < 1e-3

    world.ask_until(stands)
    assert not ends
    assert math.dist(still[-1], begun) < math.dist((10.0, 8.0), begun) - 0.5
    # Longer than a drive waits for what is in the way, in the robot's time.
    before = world.truth[-1].header.stamp.sec
    graph.until(lambda: world.truth[-1].header.stamp.sec > before + 60)
    hold.publish(Bool(data=False))
    graph.until(lambda: ends)
    thread.join()
    assert ends[0].status == 'succeeded'
    assert world.position == pytest.approx((10, 8), abs=0.15)
    assert world.collisions[-1].data == 0


def test_what_is_left_of_a_path_begins_where_the_robot_is() -> None:
    path = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    left = rest_of(path, np.array([1.2, 0.1, 0.0]))
    assert left.tolist() == [[1.2, 0.1, 0.0], [2.0, 0.0, 0.0]]
    assert len(rest_of(path, np.array([2.0, 0.0, 0.0]))) == 2
