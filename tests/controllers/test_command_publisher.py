"""A robot that sees nothing stands; one whose lidar is a little late drives on."""

from __future__ import annotations

import math
import random
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lidar_navigation import Footprint, Velocity
from surveillance_controllers.motion.command_publisher import (
    LEAD,
    LONGEST_SILENCE,
    REACTION,
    STANDSTILL,
    WALKING,
    CommandPublisher,
    SensorAge,
    blind_time,
)
from surveillance_runtime.node import PatrolNode

DECELERATION = 2.5
LOOK_PERIOD = 0.01
BODY = Footprint(0.22)


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


class Bases:
    """Publishers one behind the other, with a clock that the test sets.

    Attributes:
        sent: What the last one let through last, m/s.
    """

    def __init__(self, graph: Any, patch: pytest.MonkeyPatch, count: int, patience: float) -> None:
        self.now, self.sent = 0.0, 0.0
        self._chain = [
            CommandPublisher(
                graph.add(PatrolNode, name=f'commander{number}'),
                'cmd_vel',
                ['scan', *['wanted'][:number]],
                DECELERATION,
                lambda _topic: None,
                patience=lambda _velocity: patience,
                commands='wanted',
            )
            for number in range(count)
        ]
        for base, behind in zip(self._chain, [*self._chain[1:], None], strict=True):
            patch.setattr(base, '_now', lambda: self.now)
            passed = SimpleNamespace(publish=partial(self._pass, behind))
            patch.setattr(base, '_publisher', passed)
            base._timer.cancel()
            idle = SimpleNamespace(cancel=lambda: None, reset=lambda: None)
            patch.setattr(base, '_timer', idle)

    def _pass(self, behind: CommandPublisher | None, twist: Any) -> None:
        if behind is None:
            self.sent = twist.linear.x
        else:
            behind.hear('wanted')
            behind.command(Velocity(twist.linear.x))

    def see(self, now: float) -> None:
        """Have a scan come, and a command for it."""
        self.now = now
        for base in self._chain:
            base.hear('scan')
        self._chain[0].command(Velocity(0.5))

    def blind_until(self, end: float) -> list[float]:
        """Let time pass; return the speeds."""
        speeds = []
        while self.now < end:
            self.now += LOOK_PERIOD
            for base in self._chain:
                base._limit_again()
            speeds.append(self.sent)
        return speeds


def test_a_scan_that_is_late_where_nothing_is_ahead_slows_the_robot_down_by_its_age(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    bases = Bases(graph, monkeypatch, 1, LONGEST_SILENCE)
    for count in range(30):
        bases.see(0.1 * count)
    assert bases.blind_until(2.9 + 0.1 + 0.25)[-1] == 0.5, 'it drives on'
    assert 0.1 < bases.blind_until(2.9 + 0.1 + 0.6)[-1] < 0.4
    speeds = bases.blind_until(2.9 + 0.1 + LONGEST_SILENCE)
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-1] == 0.0
    bases.see(4.1)
    assert bases.sent == 0.5


def test_two_that_brake_for_one_silence_brake_no_harder_than_one(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = []
    for count in (1, 2):
        bases = Bases(graph, monkeypatch, count, LONGEST_SILENCE)
        for number in range(30):
            bases.see(0.1 * number)
        ways.append(LOOK_PERIOD * sum(bases.blind_until(4.5)))
        for number in range(46, 60):
            bases.see(0.1 * number)
            # Not each step: a command and its timer may come in any order.
            assert min(bases.blind_until(0.1 * number + 0.09)) == 0.5, number
    assert ways[1] == pytest.approx(ways[0], rel=0.1)


def test_a_robot_that_takes_longer_to_stand_meets_nothing_that_it_saw_ahead() -> None:
    seed = random.randrange(1 << 30)
    print('seed', seed)
    rng = random.Random(seed)
    for _ in range(300):
        speed = rng.uniform(0.05, 0.6)
        room = rng.uniform(speed * 0.15 + speed**2 / (2 * DECELERATION), 3.0)
        wall = np.array([[0.22 + room, 0.0]])
        time = blind_time(Velocity(speed), wall, BODY, 0.0)
        assert STANDSTILL <= time <= LONGEST_SILENCE
        if time == STANDSTILL:
            continue
        walks = rng.choice([0.0, rng.uniform(0.0, WALKING)])
        age = SensorAge(['scan'], DECELERATION)
        for count in range(30):
            age.hear('scan', 0.1 * count)
        at, driven, left = 2.9, speed, room
        while at < 2.9 + 2.0 and driven > 0.0:
            at += LOOK_PERIOD
            allowed = speed * age.share(speed, at - REACTION, time - STANDSTILL)
            driven = max(allowed, driven - DECELERATION * LOOK_PERIOD)
            left -= (driven + walks) * LOOK_PERIOD
        assert driven == 0.0
        assert left > -0.02, (speed, room, walks)


def test_a_turn_on_the_spot_ends_as_soon_as_ever() -> None:
    assert blind_time(Velocity(0.0, 1.0), np.empty((0, 2)), BODY, 0.02) == STANDSTILL


@pytest.mark.parametrize('speed', [0.1, 0.5])
def test_a_robot_that_sees_and_that_nobody_commands_stands_as_soon_as_ever(
    graph: Any, monkeypatch: pytest.MonkeyPatch, speed: float
) -> None:
    base = CommandPublisher(
        *(graph.node, 'cmd_vel', ['scan', 'wanted'], DECELERATION, lambda _topic: None),
        patience=lambda _velocity: LONGEST_SILENCE,
        commands='wanted',
    )
    sent: list[float] = []
    monkeypatch.setattr(
        base, '_publisher', SimpleNamespace(publish=lambda twist: sent.append(twist.linear.x))
    )
    now = 0.0
    monkeypatch.setattr(base, '_now', lambda: now)
    rng = random.Random(3)
    for step in range(1, 300 + 40):
        now = 0.01 * step
        if step % 10 == rng.choice([0, 0, 1, 2]):
            base.hear('scan')
        if step % 10 == 0 and step < 300:
            base.hear('wanted')
            base.command(Velocity(speed))
        base._limit_again()
    assert sent[-1] == 0.0, 'within the standstill of the first command that did not come'


def test_a_robot_that_slows_down_while_it_is_blind_gains_no_time_by_that(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Velocity] = []

    def patience(velocity: Velocity) -> float:
        asked.append(velocity)
        return LONGEST_SILENCE

    base = CommandPublisher(
        *(graph.node, 'cmd_vel', ['scan'], DECELERATION, lambda _topic: None), patience=patience
    )
    monkeypatch.setattr(base, '_publisher', SimpleNamespace(publish=lambda _: None))
    now = 0.0
    monkeypatch.setattr(base, '_now', lambda: now)
    for count in range(30):
        now = 0.1 * count
        base.hear('scan')
        base.command(Velocity(0.5, 0.2))
    for step in range(3, 7):
        now = 2.9 + 0.1 * step
        base.command(Velocity(0.1, 0.04))
    assert [each.speed for each in asked] == pytest.approx([0.5] * len(asked))
    assert [each.turn for each in asked] == pytest.approx([0.2] * len(asked)), 'the same arc'
    assert asked


def test_commands_that_are_repeated_while_scans_are_late_are_not_expected_as_often() -> None:
    age = SensorAge(['scan', 'wanted'], DECELERATION, commands='wanted')
    for count in range(30):
        age.hear('scan', 0.1 * count)
        age.hear('wanted', 0.1 * count)
    for count in range(20):
        age.hear('wanted', 3.02 + 0.03 * count)
    age.hear('scan', 3.6)
    age.hear('wanted', 3.6)
    assert age.share(0.6, 3.7) == 1.0


@pytest.mark.parametrize('way', [1.0, -1.0])
@pytest.mark.parametrize(
    'body', [BODY, Footprint(0.22, (-0.2, -0.2, 0.2, -0.2, 0.2, 0.2, -0.2, 0.2))]
)
def test_who_may_step_onto_the_arc_from_its_side_counts_as_ahead(
    way: float, body: Footprint
) -> None:
    velocity = Velocity(way * 0.5)
    for x, y, is_near in (
        *((0.0, 0.45, True), (0.0, 0.9, False)),
        *((way * 0.5, 0.45, True), (way * 0.5, 0.9, False), (-way * 0.9, 0.0, False)),
    ):
        time = blind_time(velocity, np.array([[x, y]]), body, 0.02)
        assert (time == STANDSTILL) == is_near, (x, y)
        assert is_near or time == pytest.approx(LONGEST_SILENCE)
    assert blind_time(velocity, np.empty((0, 2)), body, 0.02) == pytest.approx(LONGEST_SILENCE)
