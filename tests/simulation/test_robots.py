"""Several robots in one world, and their topics."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.robot.robots import Robots
from surveillance_simulation.simulator_node import Simulator
from tests.places import TWO_ROOMS, two_rooms

from .test_simulator_node import flat


def pair(gap: float) -> Robots:
    """Return two robots that look at each other, so far apart, metres."""
    world = two_rooms()
    x, y, _ = world.plan.start
    first = Robot(world, name='robot1', start=(x, y, 0.0))
    return Robots([first, Robot(world, name='robot2', start=(x + gap, y, math.pi))])


def test_each_sees_the_other_and_not_itself() -> None:
    first, second = pair(1.0).robots
    for robot in (first, second):
        ahead = int(np.argmin(np.abs(robot.lidar.angles)))
        assert robot.scan()[ahead] == pytest.approx(1.0 - robot.base.model.radius, abs=0.01)
    second.base.pose = (second.base.pose[0] + 0.2, *second.base.pose[1:])
    ahead = int(np.argmin(np.abs(first.lidar.angles)))
    assert first.scan()[ahead] == pytest.approx(1.2 - first.base.model.radius, abs=0.01)


def test_they_touch_and_do_not_pass_through_each_other() -> None:
    robots = pair(1.2)
    first, second = robots.robots
    for _ in range(60):
        first.base.command(0.5, 0.0)
        second.base.command(0.2, 0.0)
        robots.advance(0.1)
    gap = math.dist(first.base.pose[:2], second.base.pose[:2])
    assert gap == pytest.approx(2 * first.base.model.radius, abs=0.01)
    assert first.base.collisions + second.base.collisions >= 1
    first.base.command(-0.5, 0.0)
    robots.advance(0.4)
    assert math.dist(first.base.pose[:2], second.base.pose[:2]) > gap + 0.02


def test_their_state_outlives_the_process() -> None:
    robots = pair(1.0)
    robots.robots[1].base.push(0.4, 0.1, 0.3)
    robots.world.set_door('D', is_open=False)
    kept = robots.state()
    again = pair(1.0)
    assert again.restore(kept)
    assert [r.base.pose for r in again.robots] == [r.base.pose for r in robots.robots]
    assert again.world.closed_doors == {'D'}
    assert not again.restore({**kept, 'robot2.x': 'nowhere'})


def test_each_robot_of_a_fleet_has_its_own_topics(graph: Any) -> None:
    x, y, _ = two_rooms().plan.start
    starts = {'robots.a.start': [x, y, 0.0], 'robots.b.start': [x + 1.0, y, 0.0]}
    described = flat(TWO_ROOMS) | {'speed': 20.0} | starts
    node = graph.add(Simulator, parameters=described)
    seen: dict[str, Any] = {}
    for robot in ('a', 'b'):
        graph.node.create_subscription(
            Odometry, f'{robot}/odom', lambda m, r=robot: seen.__setitem__(f'{r}/odom', m), 5
        )
        graph.node.create_subscription(
            LaserScan,
            f'{robot}/scan',
            lambda m, r=robot: seen.__setitem__(f'{r}/scan', m),
            SENSOR_QOS,
        )
    command = graph.node.create_publisher(Twist, 'b/cmd_vel', 1)

    def driven() -> bool:
        command.publish(Twist())
        return len(seen) == 4

    graph.until(driven)
    assert seen['b/odom'].pose.pose.position.x == pytest.approx(x + 1.0, abs=0.05)
    assert seen['a/odom'].pose.pose.position.x == pytest.approx(x, abs=0.05)
    assert node.robots.robots[0].name == 'a'


def test_a_robot_without_a_start_is_named(graph: Any) -> None:
    with pytest.raises(ParameterError, match=r'robots\.a: has no start'):
        graph.add(Simulator, parameters=flat(TWO_ROOMS) | {'robots.a.dock': 'A'})
