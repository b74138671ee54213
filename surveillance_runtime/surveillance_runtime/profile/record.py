"""The profile of a robot as a record: each field has its default, its meaning and its bounds.

The defaults are the built-in robot, the one that the simulator is. Names of topics are as ROS has
them: relative ones get the robot's namespace.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from floor_plans import ROBOT_RADIUS
from lidar_navigation.robot_base import ROBOT_DECELERATION, footprint
from strict_files.settings import parameter, parameters
from surveillance_runtime import parameter_checks

COMMAND_TYPES = ('Twist', 'TwistStamped')
BATTERY_SOURCES = ('model', 'topic')
ARMS = ('built_in', 'none')
ARM_TYPES = ('JointTrajectory', 'FollowJointTrajectory')
"""A topic, and ros2_control's action."""
_NAME = re.compile(r'[~/]?[A-Za-z_]\w*(/[A-Za-z_]\w*)*\Z', re.ASCII)
_FRAME = re.compile(r'/?[A-Za-z_][\w/.-]*\Z', re.ASCII)


def topic_name(text: str) -> str | None:
    """Ask for the name of a topic, or none."""
    return None if not text or _NAME.match(text) else 'the name of a topic like scan or front/scan'


def topic_names(names: Sequence[str]) -> str | None:
    """Ask for one name of a topic, or more that differ."""
    good = names and all(map(_NAME.match, names)) and len(set(names)) == len(names)
    return None if good else 'one name of a topic like scan, or more that differ'


MOST_TIMEOUT = 0.5
"""Seconds that a base may obey a command which nobody repeats: what a dead program began ends by
that alone."""


def frame_name(text: str) -> str | None:
    """Ask for the name of a frame."""
    return None if _FRAME.match(text) else 'the name of a frame like base_link'


def voltage_curve(values: Sequence[float]) -> str | None:
    """Ask for voltages with the charge that each stands for, both rising, if for anything."""
    volts, percents = values[::2], values[1::2]
    rising = all(a < b for a, b in pairwise(volts)) and all(a < b for a, b in pairwise(percents))
    good = not values or (
        len(values) >= 4
        and len(values) % 2 == 0
        and rising
        and volts[0] > 0
        and 0 <= percents[0] < percents[-1] <= 100
    )
    return None if good else 'pairs of a voltage, V, and the percent it stands for, both rising'


@dataclass(frozen=True)
class Topics:
    """Names of the topics between the robot's drivers and the patrol."""

    command: str = parameter(
        'cmd_vel_monitored', 'The base takes its velocity from here.', check=topic_name
    )
    wanted: str = parameter(
        'cmd_vel',
        'What drives the robot publishes here; the collision monitor passes it on to `command`.',
        check=topic_name,
    )
    odom: str = parameter('odom', 'Odometry, nav_msgs/Odometry.', check=topic_name)
    imu: str = parameter(
        'imu',
        'A gyroscope where there is one, sensor_msgs/Imu: its turns count beside the wheels.',
        check=topic_name,
    )
    scans: tuple[str, ...] = parameter(
        ('scan',), 'One for each lidar, sensor_msgs/LaserScan.', check=topic_names
    )
    map: str = parameter('map', 'The map, nav_msgs/OccupancyGrid.', check=topic_name)
    battery: str = parameter(
        'battery_state', 'sensor_msgs/BatteryState, from a driver or a model.', check=topic_name
    )
    image: str = parameter(
        'camera/rgb/image_raw', "The camera's pictures, sensor_msgs/Image.", check=topic_name
    )
    camera_info: str = parameter(
        'camera/rgb/camera_info', 'sensor_msgs/CameraInfo of the pictures.', check=topic_name
    )
    joint_states: str = parameter(
        'joint_states', 'sensor_msgs/JointState of the arm.', check=topic_name
    )
    arm: str = parameter(
        'arm/joint_trajectory',
        "trajectory_msgs/JointTrajectory for the arm, on ros2_control's topic joint_trajectory; "
        'with types.arm FollowJointTrajectory the name of its action follow_joint_trajectory.',
        check=topic_name,
    )


@dataclass(frozen=True)
class Types:
    """What is told in more than one type."""

    command: str = parameter(
        'Twist',
        'Type of the velocity that the base takes; that of `wanted` is Twist.',
        choices=COMMAND_TYPES,
    )
    arm: str = parameter(
        'JointTrajectory',
        'How the arm takes its motions on `topics.arm`: as a topic, or as an action of '
        "ros2_control's controller, as MoveIt uses it.",
        choices=ARM_TYPES,
    )


@dataclass(frozen=True)
class Frames:
    """Names of the frames of REP-105; a namespace does not change them."""

    map: str = parameter('map', 'The frame of the map.', check=frame_name)
    odom: str = parameter('odom', 'The frame of the odometry.', check=frame_name)
    base: str = parameter(
        'base_link', "The robot's centre on the floor, between its wheels.", check=frame_name
    )
    scans: tuple[str, ...] = parameter(
        ('base_scan',), "The lidars' frames, as their scans name them.", of=str
    )
    camera: str = parameter(
        'camera_optical_frame', "The frame of the camera's pictures.", check=frame_name
    )
    transform_tolerance: float = parameter(
        0.1, 'map -> odom counts for this much longer than the scan it is from, s.', 0.0, 5.0
    )


@dataclass(frozen=True)
class Body:
    """The robot's shape, seen from above, in the frame `base`."""

    radius: float = parameter(
        ROBOT_RADIUS, 'Of a round robot, m; with a footprint that counts.', 0.01, 20.0
    )
    footprint: tuple[float, ...] = parameter(
        (),
        "Corners x, y of a robot that is not round, m, or the text of Nav2's `footprint`; empty: "
        'round.',
        of=float,
        check=footprint,
    )
    height: float = parameter(0.35, 'Height of its body, m; only drawn.', 0.01, 5.0)

    @property
    def reach(self) -> float:
        """The distance of the body's farthest point from the centre, metres."""
        corners = zip(self.footprint[::2], self.footprint[1::2], strict=True)
        return max((math.hypot(x, y) for x, y in corners), default=self.radius)


@dataclass(frozen=True)
class Lidars:
    """Where the lidars sit."""

    mounts: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 0.0),
        'For each lidar x, y in metres, yaw and roll in radians (roll 3.1416: upside down), in the '
        'frame base; empty: as tf_static says of the frame of a scan.',
        of=float,
        check=parameter_checks.lidar_mounts,
    )
    sweep: float = parameter(
        0.0,
        'Time of one turn of a lidar whose scans do not say it (time_increment 0), s; 0: all at '
        'once.',
        0.0,
        2.0,
    )
    height: float = parameter(0.35, 'Height of the lidars above the floor, m.', 0.0, 5.0)


@dataclass(frozen=True)
class OdometryScale:
    """What the odometry counts beside what is true."""

    scale: float = parameter(
        1.0, 'Metres driven for each metre that the odometry counts.', 0.1, 10.0
    )
    turn_scale: float = parameter(
        1.0, 'Radians turned for each radian that the odometry counts.', 0.1, 10.0
    )


@dataclass(frozen=True)
class DriveLimits:
    """What the robot is driven with."""

    speed: float = parameter(0.6, 'Top speed, m/s.', 0.01, 20.0)
    turn: float = parameter(1.5, 'Top turning speed, rad/s.', 0.01, 20.0)
    acceleration: float = parameter(0.8, 'Acceleration, m/s^2.', 0.01, 20.0)
    deceleration: float = parameter(
        ROBOT_DECELERATION, 'With which the base brakes when it must, m/s^2.', 0.05, 20.0
    )
    turn_acceleration: float = parameter(3.0, 'Turning acceleration, rad/s^2.', 0.01, 20.0)
    command_timeout: float = parameter(
        MOST_TIMEOUT, 'Seconds without a command after which the base stands by itself.', 0.0, 60.0
    )
    long_timeout: bool = parameter(
        False, 'Whether a base may take longer for that: it drives on when the patrol dies.'
    )


@dataclass(frozen=True)
class Wheels:
    """The wheels, for the simulators."""

    separation: float = parameter(0.34, 'Distance of the two driven wheels, m.', 0.02, 10.0)
    radius: float = parameter(0.05, 'Radius of a driven wheel, m.', 0.01, 2.0)
    speed: float = parameter(0.6, 'Greatest speed of the base, m/s.', 0.01, 20.0)
    turn_speed: float = parameter(1.5, 'Greatest turning speed of the base, rad/s.', 0.01, 20.0)
    acceleration: float = parameter(1.0, 'Greatest acceleration, m/s^2.', 0.01, 20.0)
    turn_acceleration: float = parameter(4.0, 'Greatest turning acceleration, rad/s^2.', 0.01, 20.0)


@dataclass(frozen=True)
class BatterySource:
    """Where the charge of the battery comes from when the robot is a real one."""

    source: str = parameter(
        'model',
        'topic: sensor_msgs/BatteryState of a driver; model: computed from the way driven.',
        choices=BATTERY_SOURCES,
    )
    full: float = parameter(
        1.0, "What the driver's field percentage holds when full: 1, or 100 of many.", 0.01, 1000.0
    )
    voltages: tuple[float, ...] = parameter(
        (),
        'Voltage, V, and the percent that it stands for, pairs that rise: of a driver whose '
        'percentage is none. It is not looked at then.',
        of=float,
        check=voltage_curve,
    )
    timeout: float = parameter(
        30.0, 'The driver is said to be silent after this, s of real time.', 1.0, 3600.0
    )


@dataclass(frozen=True)
class Docking:
    """How the robot drives and docks."""

    navigator: str = parameter(
        'own', 'Who drives the base: this project, or Nav2.', choices=('own', 'nav2')
    )
    monitor: str = parameter(
        'nav2',
        'Whose collision monitor is last before the base where Nav2 drives; own: Nav2 publishes on '
        '`topics.wanted`, and stop, zones and lidar of this project bind it.',
        choices=('nav2', 'own'),
    )
    docking: str = parameter(
        'none', 'What docks it where a way ends at the station.', choices=('none', 'opennav')
    )
    dock_type: str = parameter('', "The dock's type, as the docking server knows it.")
    staging: float = parameter(
        0.0,
        'How far before its dock the robot is brought, m; 0: the docking server brings it to its '
        'staging pose, by Nav2 (0.7 with navigator: own).',
        0.0,
        5.0,
    )
    reach: float = parameter(0.5, 'It is at the station within this distance of it, m.', 0.0, 100.0)


@dataclass(frozen=True)
class RobotProfile:
    """All that differs between robots."""

    name: str = parameter('built_in', "The robot's name.")
    namespace: str = parameter('', 'Prefix of all names, where --namespace gives no other.')
    topics: Topics = parameters(Topics, 'topics.')
    types: Types = parameters(Types, 'types.')
    frames: Frames = parameters(Frames, 'frames.')
    body: Body = parameters(Body, 'body.')
    lidars: Lidars = parameters(Lidars, 'lidars.')
    odometry: OdometryScale = parameters(OdometryScale, 'odometry.')
    drive: DriveLimits = parameters(DriveLimits, 'drive.')
    wheels: Wheels = parameters(Wheels, 'wheels.')
    battery: BatterySource = parameters(BatterySource, 'battery.')
    dock: Docking = parameters(Docking, 'dock.')
    arm: str = parameter('built_in', 'Its arm.', choices=ARMS)
    origins: dict[str, str] = field(default_factory=dict, compare=False)
    """Where each given value stands, `file:line`."""

    @property
    def is_monitored(self) -> bool:
        """Whether this project's collision monitor guards the base; Nav2 has its own."""
        return 'own' in (self.dock.navigator, self.dock.monitor)

    @property
    def wanted_type(self) -> str:
        """Type of the velocity on `topics.wanted`: Nav2 publishes what it would tell the base."""
        return 'Twist' if self.dock.navigator == 'own' else self.types.command
