"""Nothing that the lidar does not allow reaches the base, whoever commands it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist, TwistStamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from lidar_navigation import Velocity
from surveillance_controllers import collision_monitor_node
from surveillance_controllers.collision_monitor_node import (
    CollisionMonitor,
)
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

ROBOT = collision_monitor_node.MonitorSettings(radius=0.25, margin=0.05, deceleration=0.8)


def wall(x: float) -> np.ndarray:
    return np.array([(x, y) for y in np.arange(-1.0, 1.01, 0.05)])


@pytest.mark.parametrize('way', [1.0, -1.0])
def test_the_speed_is_what_the_robot_can_brake_from(way: float) -> None:
    for gap in (0.0, 0.05, 0.2, 0.5):
        found = collision_monitor_node.allowed(Velocity(way, 0.2), wall(way * (0.3 + gap)), ROBOT)
        assert abs(found.speed) <= math.sqrt(2 * 0.8 * gap) + 0.1
        assert found.speed * way >= 0.0
        if found.speed:
            assert found.turn / found.speed == pytest.approx(0.2 / way), 'the same arc'
    free = Velocity(way, 0.2)
    assert collision_monitor_node.allowed(free, wall(-way * 0.35), ROBOT) == free, (
        'what is behind does not matter'
    )
    assert collision_monitor_node.allowed(free, np.zeros((0, 2)), ROBOT) == free
    assert collision_monitor_node.allowed(Velocity(0.0, 1.0), wall(0.26), ROBOT) == Velocity(
        0.0, 1.0
    )


def test_a_command_drives_into_nothing() -> None:
    # Simulated: a command that never changes, a wall, a base that obeys with limited braking.
    at, speed = 0.0, 0.0
    for _ in range(400):
        wanted = collision_monitor_node.allowed(Velocity(1.5, 0.0), wall(3.0 - at), ROBOT).speed
        speed = min(wanted, speed + 0.08) if wanted > speed else max(wanted, speed - 0.08)
        at += 0.1 * speed / 2
    assert 3.0 - at >= 0.25


def test_a_foreign_command_is_stopped_before_a_wall_and_without_a_scan(graph: Any) -> None:
    said = graph.said()
    graph.add(CollisionMonitor)
    told = graph.listen(Twist, 'cmd_vel_monitored', 1)
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    command = Twist()
    command.linear.x = 0.5

    def passes(gap: float | None) -> Any:
        if gap is not None:
            scans.publish(
                LaserScan(
                    angle_min=-0.2, angle_increment=0.02, range_max=8.0, ranges=[0.24 + gap] * 21
                )
            )
        commands.publish(command)
        return told[-1].linear.x if told else None

    def told_of(words: str) -> int:
        return sum(words in line for line in said)

    graph.until(lambda: passes(3.0) == 0.5)
    graph.until(lambda: 0.0 <= passes(0.01) < 0.2)
    graph.until(lambda: passes(3.0) == 0.5)
    graph.until(lambda: passes(None) == 0.0 and told_of('nothing on the topic scan'))
    graph.until(lambda: passes(3.0) == 0.5)
    # All rays are 0.
    graph.until(lambda: passes(-0.24) == 0.0 and told_of('may be covered or broken'))
    graph.until(lambda: passes(3.0) == 0.5)
    graph.until(lambda: told[-1].linear.x == 0.0)
    command.linear.x = math.nan
    graph.until(lambda: passes(3.0) == 0.0)
    assert told_of('may be covered or broken') == 1


def test_what_nav2_commands_is_limited_alike(graph: Any) -> None:
    graph.add(
        CollisionMonitor,
        {'robot.wanted_type': 'TwistStamped', 'robot.command_type': 'TwistStamped'},
    )
    told = graph.listen(TwistStamped, 'cmd_vel_monitored', 1)
    commands = graph.node.create_publisher(TwistStamped, 'cmd_vel', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    command = TwistStamped()
    command.twist.linear.x = 0.5

    def passes(gap: float) -> Any:
        ranges = [0.24 + gap] * 21
        scans.publish(LaserScan(angle_min=-0.2, angle_increment=0.02, range_max=8.0, ranges=ranges))
        commands.publish(command)
        return told[-1].twist.linear.x if told else None

    graph.until(lambda: passes(3.0) == 0.5)
    graph.until(lambda: 0.0 <= passes(0.01) < 0.2)


def test_a_base_that_goes_round_the_monitor_is_told_of_once(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collision_monitor_node, 'UNGUARDED_AFTER', 0.02)
    said = graph.said()
    graph.add(CollisionMonitor)
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    command = Twist()
    command.angular.z = 0.5

    def warned() -> bool:
        commands.publish(command)
        return any('the base is not protected' in line for line in said)

    graph.until(warned)


def test_two_lidars_on_one_topic_are_told_of_once(graph: Any) -> None:
    said = graph.said()
    monitor = graph.add(CollisionMonitor, {'lidar_mounts': [0.0, 0.0, 0.0, 0.0]})

    def see(frame: str) -> None:
        scan = LaserScan(angle_increment=0.02, range_max=8.0, ranges=[3.0] * 21)
        scan.header.frame_id = frame
        monitor._lidar._take('scan', monitor._on_scan, scan)

    def warnings() -> list[str]:
        return [line for line in said if 'hide each other' in line]

    see('front')
    see('front')
    see('back')
    see('front')
    see('a third one')
    see('back')
    graph.until(warnings)
    assert len(warnings()) == 1
    assert "the frames 'front' and 'back' share the topic" in warnings()[0]


def test_no_command_enters_a_keep_out_zone_or_is_fast_in_a_slow_one(graph: Any) -> None:
    graph.add(
        CollisionMonitor,
        {
            'keep_out_zones.Z': [2.0, -1.0, 3.0, -1.0, 3.0, 1.0, 2.0, 1.0],
            'slow_zones.S': [0.2, -3.0, -1.0, -1.0, -1.0, -1.0, 1.0, -3.0, 1.0],
        },
    )
    told = graph.listen(Twist, 'cmd_vel_monitored', 1)
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    command = Twist()
    command.linear.x = 0.5

    def at(x: float) -> float:
        pose = PoseWithCovarianceStamped()
        pose.header.stamp = graph.node.get_clock().now().to_msg()
        pose.pose.pose.position.x, pose.pose.pose.orientation.w = x, 1.0
        poses.publish(pose)
        scans.publish(LaserScan(angle_min=-0.2, angle_increment=0.02, range_max=8.0, ranges=[5.0]))
        commands.publish(command)
        return told[-1].linear.x if told else math.nan

    graph.until(lambda: at(0.0) == 0.5)
    graph.until(lambda: at(1.74) < 0.15)
    graph.until(lambda: at(-2.0) == pytest.approx(0.2))
    graph.until(lambda: at(0.0) == 0.5)
    # Somebody took the zones away, on the page.
    places = graph.node.create_publisher(String, 'place', STATE_QOS)
    places.publish(String(data='{"map": {}}'))
    graph.until(lambda: at(1.74) == 0.5)
    places.publish(String(data='{"keep_out_zones": {"Z": [1]}}'))
    graph.until(lambda: at(-2.0) == 0.5)


def test_a_long_robot_whose_corners_swing_out_turns_slower() -> None:
    long = (0.5, 0.2, -0.3, 0.2, -0.3, -0.2, 0.5, -0.2)
    beside = np.array([[0.42, 0.32]])
    settings = collision_monitor_node.MonitorSettings(footprint=long)
    assert collision_monitor_node.allowed(Velocity(0.0, 1.0), beside, settings).turn < 0.9
    assert collision_monitor_node.allowed(Velocity(0.0, -1.0), beside, settings) == Velocity(
        0.0, -1.0
    )
    slow = collision_monitor_node.allowed(Velocity(0.3, 1.5), beside, settings)
    assert slow.speed < 0.25
    assert slow.turn == pytest.approx(5 * slow.speed)


def test_a_hand_comes_before_all_others_and_is_limited_alike(graph: Any) -> None:
    graph.add(CollisionMonitor)
    told = graph.listen(Twist, 'cmd_vel_monitored', 1)
    others = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    hand = graph.node.create_publisher(Twist, 'cmd_vel_manual', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    other, mine = Twist(), Twist()
    other.linear.x, mine.linear.x = 0.5, 0.2

    def passes(gap: float, *, held: bool) -> Any:
        scans.publish(
            LaserScan(angle_min=-0.2, angle_increment=0.02, range_max=8.0, ranges=[0.24 + gap] * 21)
        )
        others.publish(other)
        if held:
            hand.publish(mine)
        return told[-1].linear.x if told else None

    graph.until(lambda: passes(3.0, held=False) == 0.5)
    graph.until(lambda: passes(3.0, held=True) == 0.2)
    graph.until(lambda: 0.0 <= passes(0.01, held=True) < 0.15)
    graph.until(lambda: passes(3.0, held=True) == 0.2)
    # Who lets go gives the robot back.
    graph.until(lambda: passes(3.0, held=False) == 0.5)


def test_of_a_base_whose_type_is_not_known_yet_nothing_is_told(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monitor = graph.add(CollisionMonitor)
    unknown = [SimpleNamespace(topic_type='')]
    monkeypatch.setattr(monitor, 'get_subscriptions_info_by_topic', lambda _topic: unknown)
    begun: list[str] = []
    monkeypatch.setattr(monitor.incidents, 'begin', lambda _cause, text: begun.append(text))
    for name in ('findings', 'endpoints_of'):
        monkeypatch.setattr(collision_monitor_node, name, lambda *_: ())
    monitor._look_for_base()
    assert begun == []
