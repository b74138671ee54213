"""A robot that sees nothing stands; one whose lidar is a little late drives on."""

from __future__ import annotations

import math
import random
from types import SimpleNamespace
from typing import Any

import pytest

from lidar_navigation import Velocity
from surveillance_controllers.motion.command_publisher import (
    LEAD,
    REACTION,
    STANDSTILL,
    CommandPublisher,
    SensorAge,
)

DECELERATION = 2.5
LOOK_PERIOD = 0.01


@pytest.mark.parametrize('period', [0.02, 0.1, 0.2])
@pytest.mark.parametrize('speed', [0.05, 0.2, 0.6])
def test_a_robot_stands_in_time_after_the_first_missed_message(period: float, speed: float) -> None:
    age = SensorAge(['scan'], DECELERATION)
    for count in range(30):
        age.hear('scan', count * period)
    missed = 30 * period
    at, driven, allowed = 29 * period, speed, speed
    while driven > 0.0 and at < missed + 5.0:
        at += LOOK_PERIOD
        allowed = speed * age.share(speed, at)
        driven = max(allowed, driven - DECELERATION * LOOK_PERIOD)
    # The base obeys up to the reaction later than here.
    assert at + REACTION <= missed + STANDSTILL + LOOK_PERIOD + 1e-9


def test_commands_to_brake_that_come_late_do_not_make_the_way_longer() -> None:
    age = SensorAge(['scan'], DECELERATION)
    for count in range(30):
        age.hear('scan', 0.1 * count)
    at = 2.9 + age.seconds_to_brake(0.6, 2.9)
    commanded, driven, next_command = 0.6, 0.6, at
    while driven > 0.0 and at < 9.0:
        if at >= next_command:
            commanded, next_command = 0.6 * age.share(0.6, at + LEAD), at + 0.09
        at += LOOK_PERIOD
        driven = max(commanded, driven - DECELERATION * LOOK_PERIOD)
    assert at + REACTION <= 3.0 + STANDSTILL + LOOK_PERIOD + 1e-9


def test_new_commands_do_not_speed_a_robot_up_that_brakes(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    base = CommandPublisher(graph.node, 'cmd_vel', ['scan'], DECELERATION, told.append)
    sent: list[float] = []
    monkeypatch.setattr(
        base, '_publisher', SimpleNamespace(publish=lambda twist: sent.append(twist.linear.x))
    )
    now = 0.0
    monkeypatch.setattr(base, '_now', lambda: now)
    for count in range(30):
        now = 0.1 * count
        base.hear('scan')
    base.command(Velocity(0.6))
    assert sent == [0.6]
    while now < 3.4:  # a joystick goes on while the scans have ended
        now += 0.01
        base._limit_again()
        base.command(Velocity(0.6))
    assert sent == sorted(sent, reverse=True)
    assert sent[-1] == 0.0
    assert told == ['scan']


def test_a_sensor_that_stammers_is_told_of_once_in_a_while(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    base = CommandPublisher(graph.node, 'cmd_vel', ['scan'], DECELERATION, told.append)
    now = 0.0
    monkeypatch.setattr(base, '_now', lambda: now)
    for count in range(1300):
        now = 0.01 * count
        if count % 50 == 0:  # a scan each half second, while commands come
            base.hear('scan')
        base.command(Velocity(0.6))
    assert told == ['scan', 'scan'], 'once in ten seconds'


@pytest.mark.parametrize('wanted', [0.7, -1.5])
def test_a_speed_too_high_to_brake_from_is_one_that_can_be_kept(
    graph: Any, monkeypatch: pytest.MonkeyPatch, wanted: float
) -> None:
    base = CommandPublisher(graph.node, 'cmd_vel', ['scan'], DECELERATION, lambda _topic: None)
    sent: list[Any] = []
    monkeypatch.setattr(base, '_publisher', SimpleNamespace(publish=sent.append))
    now = 0.0
    monkeypatch.setattr(base, '_now', lambda: now)
    for step in range(100):
        now = 0.01 * step
        if step % 10 == 0:
            base.hear('scan')
            base.command(Velocity(wanted, 1.0))
        base._limit_again()
    speeds = [twist.linear.x for twist in sent]
    assert speeds == pytest.approx([math.copysign(0.6, wanted)] * len(sent))
    assert sent[-1].angular.z == pytest.approx(0.6 / abs(wanted)), 'the arc is the same'


@pytest.mark.parametrize('rate', [5.0, 7.0, 10.0])
def test_a_lidar_with_jitter_stops_nobody(rate: float) -> None:
    rng = random.Random(1)
    age = SensorAge(['scan', 'odom'], DECELERATION)
    shares, now, due = [], 0.0, 0.0
    while now < 60.0:
        now = due + rng.uniform(0.0, 0.25) / rate  # each comes up to a quarter late
        due += 1.0 / rate
        shares.append(age.share(0.6, now))
        age.hear('scan', now)
        age.hear('odom', now)
    assert min(shares[20:]) > 0.8
    assert sum(shares[20:]) / len(shares[20:]) > 0.97


def test_one_lost_scan_slows_a_slow_robot_by_nothing() -> None:
    age = SensorAge(['scan'], DECELERATION)
    for count in range(30):
        age.hear('scan', 0.1 * count)
    assert age.share(0.2, 2.9 + 0.2) == 1.0
    assert age.share(0.6, 2.9 + 0.2) < 0.7


def test_what_was_never_heard_lets_nobody_drive() -> None:
    age = SensorAge(['scan', 'odom'], DECELERATION)
    age.hear('scan', 1.0)
    assert age.left(1.0) == (-math.inf, 'odom')
    assert age.share(0.1, 1.0) == 0.0
    assert age.share(0.0, 1.0) == 0.0


def test_a_sensor_that_is_too_slow_lets_nobody_drive_fast() -> None:
    age = SensorAge(['scan'], DECELERATION)
    for count in range(30):
        age.hear('scan', 1.0 * count)
    assert age.share(0.6, 29.5) == 0.0
