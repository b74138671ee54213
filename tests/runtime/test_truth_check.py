"""Robots whose drivers say what cannot be true: the doctor's cases, each with its cause.

Half of them are taken from reports (the address stands beside the case).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from surveillance_runtime.profile.check_up import (
    Endpoint,
    GraphSample,
    TopicSample,
    awaited,
    findings,
    unplaced,
)
from surveillance_runtime.profile.record import (
    BatterySource,
    Docking,
    Frames,
    Lidars,
    RobotProfile,
    Topics,
    Types,
)
from surveillance_runtime.profile.truth_check import RobotDoubt, amended, battery_doubt, doubts

SCAN, ODOM, MAP = 'sensor_msgs/LaserScan', 'nav_msgs/Odometry', 'nav_msgs/OccupancyGrid'
BATTERY, TWIST = 'sensor_msgs/BatteryState', 'geometry_msgs/Twist'
PROFILE = RobotProfile(
    topics=Topics(
        command='cmd_vel', wanted='wanted', camera_info='camera/info', image='camera/image'
    ),
    battery=BatterySource(source='topic'),
)


def sound() -> dict[str, Any]:
    """Return what a robot says with which all is well."""
    return {
        'publishers': {
            '/scan': [Endpoint('/lidar', SCAN, reliable=False)],
            '/odom': [Endpoint('/base', ODOM)],
            '/map': [Endpoint('/map_server', MAP, latched=True)],
            '/battery_state': [Endpoint('/base', BATTERY)],
        },
        'subscribers': {'/cmd_vel': [Endpoint('/base', TWIST)]},
        'heard': {
            '/scan': TopicSample(40, 10.0, 'base_scan', 0.03, {'told': 0.9, 'near': 0.0}),
            '/odom': TopicSample(200, 50.0, 'odom', 0.01, {'child': 'base_link'}),
            '/map': TopicSample(1, 0.0, 'map', 100.0),
            '/battery_state': TopicSample(
                4, 1.0, '', 0.1, {'percentages': (0.8,), 'voltage': 12.1}
            ),
        },
        'parents': {'base_scan': 'base_link'},
    }


def said(profile: RobotProfile = PROFILE, **changes: Any) -> list[str]:
    """Return what the doctor says of a robot that stands; a dictionary changes its topics."""
    given = sound()
    for name, value in changes.items():
        given[name] = given.get(name, {}) | value if isinstance(value, dict) else value
    seen = GraphSample(**given)
    lines = [line for each in awaited(profile) for line in findings(each, seen, 4.0)]
    told = list(doubts(profile, seen))
    return [*lines, *unplaced(profile, seen), *(f'{d.text} [{d.line}]' for d in told)]


def heard(topic: str, **changes: Any) -> dict[str, Any]:
    """Return the samples with one changed; `values` are added to those that are there."""
    sample = sound()['heard'].get(topic, TopicSample(1))
    if 'values' in changes:
        changes['values'] = {**sample.values, **changes['values']}
    return {'heard': {topic: replace(sample, **changes)}}


def published(topic: str, kind: str, *nodes: str) -> dict[str, Any]:
    return {'publishers': {topic: [Endpoint(node, kind) for node in nodes]}}


# What each robot says that stands.
UNPLACED = replace(PROFILE, lidars=Lidars(mounts=()))
OWN_MOUNT = replace(PROFILE, lidars=Lidars(mounts=(0.0, 0.0, 0.0, 0.0)))
# fmt: off
STANDING: list[tuple[str, Callable[[], list[str]], str]] = [
    # github.com/turtlebot/turtlebot4/issues/622, teleop_twist_joy and a patrol at once
    ('rival', lambda: said(**published('/cmd_vel', TWIST, '/teleop')), 'teleop commands the base'),
    # github.com/ros-navigation/navigation2/issues/2768
    ('late stamps', lambda: said(**heard('/scan', age=0.8)), '/scan: its messages are 0.8 s old'),
    # github.com/turtlebot/turtlebot4/issues/611
    ('clocks', lambda: said(**heard('/odom', age=-3600.0)), '3600.0 s ahead of the clock'),
    (
        'stamp 0',
        lambda: said(**heard('/scan', age=None, values={'unstamped': True})),
        'stamps are 0',
    ),
    (
        'child frame',
        lambda: said(**heard('/odom', values={'child': 'base_footprint'})),
        '[frames: {base: base_footprint}]',
    ),
    # github.com/kobuki-base/kobuki_ros/pull/56
    (
        'percent',
        lambda: said(**heard('/battery_state', values={'percentages': (60.0,)})),
        '[battery: {full: 100}]',
    ),
    (
        'one percent',
        lambda: said(
        **heard('/battery_state', values={'percentages': (1.0,), 'voltage': 9.8})),
        'percentage 1 says full, and 9.8 V say nearly empty (3.27 V a cell of 3): is it 1 percent?',
    ),
    (
        'counted down',
        lambda: said(
        **heard('/battery_state', values={'percentages': (3.0, 2.0, 1.0)})),
        'it tells percent',
    ),
    # github.com/pal-robotics/aruco_ros/issues/120
    (
        'no camera_info',
        lambda: said(**published('/camera/image', 'sensor_msgs/Image', '/cam')),
        '/camera/info: nobody publishes it, and /cam publishes pictures',
    ),
    # github.com/JMU-ROBOTICS-VIVA/ros2_aruco/issues/7
    (
        'not calibrated',
        lambda: said(
            publishers={
                '/camera/image': [Endpoint('/cam', 'sensor_msgs/Image')],
                '/camera/info': [Endpoint('/cam', 'sensor_msgs/CameraInfo')],
            },
            heard={'/camera/info': TopicSample(3, 1.0, 'cam', 0.1, {'focal': 0.0})},
        ),
        'the camera is not calibrated',
    ),
    (
        'tf alone',
        lambda: said(
            publishers={'/odom': []}, heard={'/odom': TopicSample()}, moving={'base_link': 'odom'}
        ),
        'odometry comes by tf alone',
    ),
    # github.com/ros-controls/ros_controllers/issues/499, robot_localization beside a controller
    (
        'two odometries',
        lambda: said(
        doubled=('base_link is told below odom and below origin_link',)),
        'tf: base_link is told below odom and below origin_link',
    ),
    (
        'two lidars',
        lambda: said(**published('/scan', SCAN, '/front', '/rear')),
        '/scan: published by /front and /rear',
    ),
    # github.com/ros-navigation/navigation2/issues/3032, goals before bt_navigator is active
    (
        'inactive',
        lambda: said(
            replace(PROFILE, dock=Docking(navigator='nav2')),
            states={'controller_server': 'inactive'},
        ),
        "Nav2's controller_server is inactive",
    ),
    ('two localisers', lambda: said(moving={'odom': 'map'}), 'another program tells map -> odom'),
    # github.com/turtlebot/turtlebot4/issues/504, ROBOTIS-GIT/turtlebot3/issues/1135
    (
        'stamped',
        lambda: said(subscribers={'/cmd_vel': [Endpoint('/base', f'{TWIST}Stamped')]}),
        'types.command: TwistStamped in the robot profile fits it',
    ),
    # github.com/EAIBOT/ydlidar/issues/21
    (
        'mount',
        lambda: said(OWN_MOUNT, places={'base_scan': (0.1, 0.0, math.pi, False)}),
        '[lidars: {mounts: [[0.1, 0, 3.142, 0]]}]',
    ),
    # github.com/joshnewans/articubot_one/issues/6
    (
        'no frame',
        lambda: said(UNPLACED, parents={}, **heard('/scan', frame='laser_frame')),
        "where its frame 'laser_frame' is on the robot is not known",
    ),
    (
        'namespace',
        lambda: said(publishers={'/scan': [], '/tb3/scan': [Endpoint('/tb3/lidar', SCAN)]}),
        'the nearest that is there is /tb3/scan',
    ),
    ('covered', lambda: said(**heard('/scan', values={'told': 0.02})), 'the lidar is covered'),
    ('sees itself', lambda: said(**heard('/scan', values={'near': 0.4})), 'it sees its own body'),
    (
        'simulated time',
        lambda: said(has_clock=True, **heard('/odom', age=1e9)),
        'use_sim_time:=true',
    ),
]
# fmt: on


@pytest.mark.parametrize(('case', 'look', 'cause'), STANDING, ids=[row[0] for row in STANDING])
def test_what_cannot_be_true_of_a_robot_that_stands_is_named(
    case: str, look: Callable[[], list[str]], cause: str
) -> None:
    found = look()
    assert any(cause in line for line in found), f'{case}: {found}'
    assert len(found) <= 2, found


def test_nothing_is_said_of_a_sound_robot() -> None:
    assert said() == []
    assert said(OWN_MOUNT, places={'base_scan': (0.0, 0.0, 0.0, False)}) == []


@pytest.mark.parametrize(
    ('percentage', 'more', 'is_doubted'),
    [
        (1.0, {'voltage': 12.5}, False),
        (1.0, {'voltage': 13.3}, False),
        (1.0, {'voltage': 25.2}, False),
        (1.0, {'voltage': 9.8}, True),
        (1.0, {'voltage': 9.8, 'cells': 3}, True),
        (1.0, {'most': 60.0}, True),
        (0.4, {'voltage': 9.8}, False),
        (1.0, {}, False),
    ],
)
def test_a_full_battery_is_doubted_when_something_speaks_against_it(
    percentage: float, more: dict[str, Any], is_doubted: bool
) -> None:
    assert bool(battery_doubt(percentage, 1.0, **more)) is is_doubted


@pytest.mark.parametrize(
    ('text', 'key', 'value', 'expected'),
    [
        (
            'frames:\n  odom: odom  # of the driver\n  base: base_link\n',
            'frames.base',
            'base_footprint',
            'frames:\n  odom: odom  # of the driver\n  base: base_footprint\n',
        ),
        ('name: a\n', 'battery.full', '100', 'name: a\nbattery:\n  full: 100\n'),
        (
            'battery: {source: topic, voltages: [[11, 0], [12, 100]]}\n',
            'battery.full',
            '100',
            'battery:\n  full: 100\n  source: topic\n  voltages: [[11, 0], [12, 100]]\n',
        ),
        (
            'lidars:\n  mounts:\n    - [0, 0, 0]\n    - [1, 0, 0]\n  height: 0.2\n',
            'lidars.mounts',
            '[[0, 0, 1.57, 0]]',
            'lidars:\n  mounts: [[0, 0, 1.57, 0]]\n  height: 0.2\n',
        ),
    ],
)
def test_a_profile_is_amended_in_one_place(text: str, key: str, value: str, expected: str) -> None:
    assert amended(text, key, value) == expected


def test_a_doubt_has_the_line_of_the_profile() -> None:
    assert RobotDoubt('x', 'frames.base', 'base_footprint').line == 'frames: {base: base_footprint}'
    assert RobotDoubt('x').line == ''


def test_beside_nav2_its_own_nodes_command_the_base() -> None:
    profile = replace(PROFILE, dock=Docking(navigator='nav2'), types=Types(), frames=Frames())
    both = published('/cmd_vel', TWIST, '/collision_monitor', '/docking_server')
    assert said(profile, **both) == []
    assert 'joy' in said(profile, **published('/cmd_vel', TWIST, '/controller_server', '/joy'))[0]
