"""A robot that the doctor moves: what it is commanded, and when it is left alone."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from lidar_navigation.geometry import Mount
from surveillance_operator import motion_probe
from surveillance_operator.motion_probe import MotionProbe
from surveillance_runtime.profile.motion_check import STEPS, TURN, WAY
from surveillance_runtime.profile.record import RobotProfile, Types


class Robot:
    """Takes commands by a clock that passes when somebody spins."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.said: list[tuple[float, Any]] = []
        self.heard: dict[str, Any] = {}
        clock = SimpleNamespace(monotonic=lambda: self.now)
        monkeypatch.setattr(motion_probe, 'time', clock)

    def create_publisher(self, kind: Any, topic: str, _qos: Any) -> Any:
        self.topic, self.kind = topic, kind
        return SimpleNamespace(publish=lambda message: self.said.append((self.now, message)))

    def create_subscription(self, _kind: Any, topic: str, take: Any, _qos: Any) -> None:
        self.heard[topic] = take

    def get_clock(self) -> Any:
        stamp = Odometry().header.stamp
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: stamp))

    def spin(self, seconds: float) -> None:
        self.now += seconds
        self.heard['/tb/odom'](Odometry())


def probe_of(robot: Any, profile: RobotProfile) -> MotionProbe:
    return MotionProbe(robot, profile, 'tb', Mount())


def scan(distance: float) -> LaserScan:
    step = math.tau / 90
    return LaserScan(
        angle_min=-math.pi, angle_increment=step, range_max=8.0, ranges=[distance] * 90
    )


def test_it_is_moved_as_said_and_stands_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Robot(monkeypatch)
    record = probe_of(robot, RobotProfile()).carry_out(robot.spin)
    assert (robot.topic, robot.kind) == ('/tb/cmd_vel_monitored', Twist)
    way = sum(message.linear.x for _, message in robot.said) * motion_probe.PERIOD
    turn = sum(message.angular.z for _, message in robot.said) * motion_probe.PERIOD
    assert way == pytest.approx(0.0, abs=0.02)
    assert max(message.linear.x for _, message in robot.said) * STEPS[0].seconds == WAY
    assert turn == pytest.approx(TURN, abs=0.03)
    assert robot.said[-1][1] == Twist()
    # After the way forth nobody commands for a while.
    silent = [at for at, _ in robot.said if record.ceased[0] < at < record.ceased[0] + 1.4]
    assert not silent
    assert len(record.odometry) > 50


def test_it_stands_also_where_something_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Robot(monkeypatch)
    stamped = replace(RobotProfile(), types=Types(command='TwistStamped'))

    def spin(seconds: float) -> None:
        robot.spin(seconds)
        if robot.said:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        probe_of(robot, stamped).carry_out(spin)
    assert robot.kind is TwistStamped
    assert robot.said[-1][1].twist == Twist()


def test_without_room_it_is_not_moved(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Robot(monkeypatch)
    probe = probe_of(robot, RobotProfile())
    assert not probe.has_room()
    robot.heard['/tb/scan'](scan(0.5))
    assert not probe.has_room()
    robot.heard['/tb/scan'](scan(3.0))
    assert probe.has_room()
