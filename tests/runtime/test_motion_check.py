"""Robots that move otherwise than they are commanded, or whose sensors tell another motion.

Half of the cases are taken from reports (the address stands beside the case).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from lidar_navigation.geometry import Mount, Pose, Scan, composed
from lidar_navigation.testing import Flat
from surveillance_runtime.profile.motion_check import (
    REST,
    SPEED,
    STEPS,
    MotionRecord,
    motion_doubts,
    scan_lag,
)
from surveillance_runtime.profile.record import RobotProfile

TIMEOUT = 'drive.command_timeout'
PROFILE = RobotProfile(origins={TIMEOUT: 'robot.yaml:3'})
BRAKES = SPEED / PROFILE.drive.deceleration
"""What a base that brakes as the profile says moves on for, seconds; `Moving` stands at once."""


class Moving:
    """A robot in a flat that goes as it is commanded, as its odometry and its lidar have it.

    Args:
        timeout: For how long it obeys its last command, seconds.
        lag: How late its scans come, seconds.
        mount: Where its lidar really sits.
        scale, turn_sign: Of its odometry.
        stuck: Whether it does not move.
    """

    def __init__(self, **changes: Any) -> None:
        given = {'timeout': 0.2, 'lag': 0.0, 'mount': Mount(), 'scale': 1.0, 'turn_sign': 1.0}
        given |= {'stuck': False, 'axes': 0.0, 'sign': 1.0}
        self._like: dict[str, Any] = given | changes
        self._flat = Flat()

    def record(self) -> MotionRecord:
        like, record = self._like, MotionRecord()
        pose: Pose = (1.6, 1.6, 0.2)
        told: Pose = (0.0, 0.0, 0.0)
        now, dt = 10.0, 0.02
        scans: list[tuple[float, Scan]] = []
        for step in STEPS:
            record.began.append(now)
            record.ceased.append(now + step.seconds)
            stop = (
                now + step.seconds + (min(step.silence, like['timeout']) if step.silence else 0.0)
            )
            end = now + step.seconds + step.silence + REST
            while now < end:
                moves = now < stop and not like['stuck']
                v, w = (step.speed * dt, step.turn * dt) if moves else (0.0, 0.0)
                pose = composed(pose, (like['sign'] * v, 0.0, w))
                way, turn = like['scale'] * like['sign'] * v, like['turn_sign'] * w
                axes = like['axes']
                told = composed(told, (way * math.cos(axes), way * math.sin(axes), turn))
                record.odometry.append((now, told))
                if round(now / dt) % 5 == 0:
                    scans.append((now + like['lag'], self._seen(pose)))
                now += dt
        record.scans = [each for each in scans if each[0] < now]
        return record

    def _seen(self, pose: Pose) -> Scan:
        mount = self._like['mount']
        seen = self._flat.scan(composed(pose, mount.pose))
        ranges = seen.ranges[::-1] if mount.upside_down else seen.ranges
        return Scan(seen.angles, ranges, seen.range_max)

    def said(self) -> list[str]:
        return [f'{d.text} [{d.line}]' for d in motion_doubts(self.record(), PROFILE)]


MOVING: list[tuple[str, dict[str, Any], str]] = [
    # github.com/ouster-lidar/ouster-ros/issues/340, Slamtec/rplidar_ros/issues/55
    ('mirrored', {'mount': Mount(upside_down=True)}, 'is mirrored: the lidar hangs upside down'),
    # github.com/Slamtec/rplidar_ros/issues/7
    ('turned', {'mount': Mount((0.0, 0.0, math.pi / 2))}, 'is turned by 1.57 rad'),
    # github.com/SteveMacenski/slam_toolbox/issues/198, the cord towards the rear
    ('backwards', {'mount': Mount((0.0, 0.0, math.pi))}, 'is turned by 3.14 rad'),
    ('late', {'lag': 0.8}, '0.8 s later than the odometry'),
    # github.com/ROBOTIS-GIT/turtlebot3/issues/409
    ('half', {'scale': 0.5}, 'it counts 0.50 m for each metre'),
    # github.com/AutonomyLab/libcreate/issues/35, of a greater measure
    ('more', {'scale': 1.3}, '[odometry: {scale: 0.7'),
    # github.com/PR2/pr2_mechanism/issues/25, amor-ros-pkg/rosaria/pull/51
    ('obeys on', {'timeout': 5.0}, 'obeys the last command for more than 1'),
    # github.com/turtlebot/turtlebot4/issues/513
    ('stuck', {'stuck': True}, 'the base does not move'),
    # github.com/sonyccd/roboclaw_ros/pull/18
    ('odometry turns the wrong way', {'turn_sign': -1.0}, 'its sense of turning is wrong'),
    ('motors reversed', {'sign': -1.0}, 'on a command forwards the odometry goes backwards'),
    ('axes', {'axes': math.pi / 2}, 'on a command forwards it goes to the side'),
]


@pytest.mark.parametrize(('case', 'like', 'cause'), MOVING, ids=[row[0] for row in MOVING])
def test_what_a_motion_shows_is_named(case: str, like: dict[str, Any], cause: str) -> None:
    found = Moving(**like).said()
    assert any(cause in line for line in found), f'{case}: {found}'


def test_a_sound_robot_moves_without_a_doubt() -> None:
    assert Moving().said() == []
    assert Moving(mount=Mount((0.12, 0.0, 0.0)), timeout=0.4).said() == []


def test_the_time_out_that_was_measured_is_a_line_for_the_profile() -> None:
    record = Moving(timeout=0.38 + BRAKES).record()
    (doubt,) = motion_doubts(record, RobotProfile())
    assert (doubt.key, doubt.value) == (TIMEOUT, '0.4')
    assert 'the profile does not say so' in doubt.text
    told = replace(PROFILE, drive=replace(PROFILE.drive, command_timeout=0.1))
    (doubt,) = motion_doubts(record, told)
    assert (doubt.line, 'says 0.1 s' in doubt.text) == ('drive: {command_timeout: 0.4}', True)
    (doubt,) = motion_doubts(Moving(timeout=0.95 + BRAKES).record(), RobotProfile())
    assert doubt.key == TIMEOUT
    assert float(doubt.value) == pytest.approx(0.95, abs=0.11)
    assert 'is refused' in doubt.text
    (doubt,) = motion_doubts(Moving(timeout=5.0).record(), RobotProfile())
    assert not doubt.key, 'it did not stand: how long it takes is not known'
    consents = replace(PROFILE, drive=replace(PROFILE.drive, long_timeout=True))
    assert not [*motion_doubts(Moving(timeout=5.0).record(), consents)]


def test_the_lag_of_scans_is_measured() -> None:
    lag = scan_lag(Moving(lag=0.5).record())
    assert lag == pytest.approx(0.5, abs=0.11)


def test_a_robot_that_was_not_moved_is_not_called_sound() -> None:
    (doubt,) = motion_doubts(MotionRecord(), PROFILE)
    assert 'was not moved' in doubt.text
