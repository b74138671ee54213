"""What is awaited of the drivers, and what is there instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from surveillance_runtime.profile import ProfileFile, read_profile
from surveillance_runtime.profile.check_up import (
    Endpoint,
    ExpectedTopic,
    GraphSample,
    TopicSample,
    awaited,
    findings,
    unplaced,
)
from surveillance_runtime.profile.record import Frames, Lidars, RobotProfile

PROFILE = """
topics: {command: base/cmd, wanted: wanted, odom: base/odom, scans: [front, rear], battery: power}
types: {command: TwistStamped}
frames: {odom: odom_combined, base: chassis, scans: [front_laser, rear_laser]}
body: {footprint: [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]}
lidars: {mounts: [[0.25, 0, 0], [-0.25, 0, 3.1416]]}
battery: {source: topic}
"""


@pytest.fixture
def profile(tmp_path: Path) -> ProfileFile:
    path = tmp_path / 'robot.yaml'
    path.write_text(PROFILE)
    return read_profile(path)


COMMAND = ExpectedTopic('topics.command', '/cmd_vel', 'geometry_msgs/Twist', False, 'to drive')
SCAN = ExpectedTopic(
    'topics.scans', '/scan', 'sensor_msgs/LaserScan', True, 'to see', frame='laser'
)


@pytest.mark.parametrize(
    ('wanted', 'seen', 'said'),
    [
        (
            COMMAND,
            GraphSample(
                subscribers={'/cmd_vel': [Endpoint('/base', 'geometry_msgs/TwistStamped')]}
            ),
            '/cmd_vel has a subscriber of geometry_msgs/TwistStamped (/base), the profile says '
            'geometry_msgs/Twist; types.command: TwistStamped in the robot profile fits it',
        ),
        (
            COMMAND,
            GraphSample(subscribers={'/base/cmd_vel': [Endpoint('/base', 'geometry_msgs/Twist')]}),
            'the nearest that is there is /base/cmd_vel (geometry_msgs/Twist): topics.command',
        ),
        (
            COMMAND,
            GraphSample(subscribers={'/cmd_vel': [Endpoint('/b', 'geometry_msgs/Twist')]}),
            '',
        ),
        (SCAN, GraphSample(), '/scan: nobody publishes it (sensor_msgs/LaserScan, to see)'),
        (
            SCAN,
            GraphSample({'/scan': [Endpoint('/lidar', 'sensor_msgs/LaserScan')]}),
            '/scan: /lidar publishes it, but nothing came for 4 s',
        ),
        (
            SCAN,
            GraphSample(
                {'/scan': [Endpoint('/lidar', 'sensor_msgs/LaserScan')]},
                heard={'/scan': TopicSample(20, 10.0, 'base_scan', 0.1)},
            ),
            "/scan: its frame is 'base_scan', the profile says frames.scans: 'laser'",
        ),
        (
            SCAN,
            GraphSample(
                {'/scan': [Endpoint('/lidar', 'sensor_msgs/LaserScan')]},
                heard={'/scan': TopicSample(20, 10.0, 'laser', 12.0)},
            ),
            '/scan: its stamps are 12.0 s behind the clock',
        ),
    ],
)
def test_what_is_not_as_awaited_is_said_with_what_is_there(
    wanted: ExpectedTopic, seen: GraphSample, said: str
) -> None:
    lines = list(findings(wanted, seen, 4.0))
    assert said in '\n'.join(lines)
    assert bool(lines) == bool(said)


@pytest.mark.parametrize(
    ('parents', 'mounts', 'is_told'),
    [
        ({}, (), True),
        ({'laser': 'mast'}, (), True),
        ({'laser': 'mast', 'mast': 'laser'}, (), True),
        ({'laser': 'mast', 'mast': 'base_link'}, (), False),
        ({'laser': 'mast', 'mast': 'chassis'}, (), False),
        ({}, (0.1, 0.0, 0.0, 0.0), False),
    ],
)
def test_a_lidar_of_which_nobody_says_where_it_is_is_named(
    parents: dict[str, str], mounts: tuple[float, ...], is_told: bool
) -> None:
    robot = replace(
        RobotProfile(), frames=replace(Frames(), base='chassis'), lidars=Lidars(mounts=mounts)
    )
    seen = GraphSample(heard={'/r/scan': TopicSample(9, 10.0, '/laser', 0.1)}, parents=parents)
    lines = list(unplaced(robot, seen, 'r'))
    assert len(lines) == is_told
    assert not lines or "/r/scan: where its frame 'laser' is on the robot is not known" in lines[0]


def test_a_namespace_leads_to_the_topics_of_its_robot(profile: ProfileFile) -> None:
    names = {each.key: each.topic for each in awaited(profile.profile, 'robot2')}
    assert names['topics.command'] == '/robot2/base/cmd'
    assert np.unique([each.topic for each in awaited(profile.profile)]).size == 6
