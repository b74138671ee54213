"""Publishes what the robot's sensors measure; the costly ones only while somebody listens."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.event_handler import PublisherEventCallbacks
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import String, UInt32

from floor_plans.shapes import Pose
from strict_files.settings import parameter
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import map_message, nanoseconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.description import description, fixed_frames
from surveillance_runtime.profile.parameters import LidarSettings, declared_frames
from surveillance_runtime.profile.record import Body, Frames, Lidars, RobotProfile, Wheels
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.state_topics import OwnedTopic
from surveillance_simulation import conversions
from surveillance_simulation.physics.model import PhysicsModel
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.simulated_place import SimulatedPlace

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # the wheels on PyPI hold no tf2_msgs; an installed ROS 2 does
    TFMessage = None

SENSOR_DEPTH = 5
"""Sensors offer reliable delivery, so that subscribers of either kind are served (REP-2003)."""


@dataclass(frozen=True)
class PublishedOptions:
    """How place and robots are published; units as declared."""

    map_resolution: float = parameter(0.05, 'Side of a cell of the map, metres.', 0.01, 0.5)
    publish_map: bool = parameter(
        True, 'Publish the map of the place; without it a robot has to build its own.'
    )
    announce_pose: bool = parameter(
        False, 'Tell each new subscriber of initialpose, such as AMCL, where the robot is.'
    )


def topic_of(robot: Robot, name: str) -> str:
    """Return the name of a robot's topic or service for the node that simulates it."""
    return f'{robot.name}/{name}' if robot.name else name


MAP_REPEAT = 5.0
"""Seconds of real time between two repetitions of the map, which is large."""


@dataclass(frozen=True)
class SensorSetup:
    """What a node's parameters say of the sensors of its robots, which are all alike.

    Attributes:
        frames: The names of the frames.
        lidars: Topic, frame and mount of each lidar, and whether it hangs upside down; one that
            tf_static knows is at the centre.
        published: How it is published.
        physics: The robots' bodies.
    """

    frames: Frames
    lidars: tuple[tuple[str, str, Pose, bool], ...]
    published: PublishedOptions
    physics: PhysicsModel

    @classmethod
    def declared(cls, node: PatrolNode, physics: PhysicsModel) -> SensorSetup:
        """Declare the parameters on a node."""
        frames = declared_frames(node, 'map', 'odom', 'base', 'scans', 'camera')
        lidars = node.declare_fields(LidarSettings(), without=('sweep',))
        published = node.declare_fields(PublishedOptions())
        return cls(frames, tuple(_lidars_of(lidars, frames)), published, physics)

    def profile(self, radius: float) -> RobotProfile:
        """Return what is known of a robot of this radius, metres, as its profile."""
        physics = self.physics
        mounts = [
            value
            for _, _, mount, upside_down in self.lidars
            for value in (*mount, math.pi if upside_down else 0.0)
        ]
        wheels = replace(Wheels(), separation=physics.wheel_separation, radius=physics.wheel_radius)
        return replace(
            RobotProfile(),
            frames=replace(self.frames, scans=tuple(frame for _, frame, *_ in self.lidars)),
            body=Body(radius, physics.footprint, physics.height),
            lidars=Lidars(tuple(mounts), height=physics.lidar_height),
            wheels=wheels,
        )


def _lidars_of(lidars: LidarSettings, frames: Frames) -> list[tuple[str, str, Pose, bool]]:
    names = list(frames.scans)
    rows = np.array(lidars.mounts or [0.0] * 4 * len(lidars.scans)).reshape(-1, 4).tolist()
    return [
        (
            topic,
            names[i] if i < len(names) else f'{topic}_frame',
            (rows[i][0], rows[i][1], rows[i][2]),
            math.cos(rows[i][3]) < 0.0,
        )
        for i, topic in enumerate(lidars.scans)
    ]


def _earlier(stamp: Time, seconds: float) -> Time:
    """Return the time that lies before another by some seconds; never less than 0."""
    nanoseconds = max(nanoseconds_of(stamp) - round(1e9 * seconds), 0)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


class PlaceFeed:
    """The topics of simulated time, of the map and of the doors: one of each for all robots."""

    def __init__(
        self, node: PatrolNode, world: SimulatedPlace, setup: SensorSetup, *, drives_clock: bool
    ) -> None:
        """Create the topics on a node; publish the map and the doors' states."""
        self._world = world
        self._clock = node.create_publisher(Clock, '/clock', 1) if drives_clock else None
        self._doors = OwnedTopic(node, DoorStates, 'door_states')
        if setup.published.publish_map:
            self._map = OwnedTopic(node, OccupancyGrid, 'map', repeat=MAP_REPEAT)
            grid = world.plan.grid(setup.published.map_resolution)
            self._map.publish(map_message(grid, setup.frames.map, Time()))
        self.tell_doors()

    def tell_doors(self) -> None:
        """Publish which doors are open."""
        self._doors.publish(conversions.doors_to_ros(self._world))

    def tell_time(self, stamp: Time) -> None:
        """Publish the clock, if that is this node's."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp))


class SensorFeed:
    """The topics of a robot's sensors."""

    def __init__(self, node: PatrolNode, robot: Robot, setup: SensorSetup) -> None:
        """Create the topics on a node, below the robot's name if it has one."""
        self._robot = robot
        topic = partial(topic_of, robot)
        self._odometry = node.create_publisher(Odometry, topic('odom'), SENSOR_DEPTH)
        # One message for all measurements: making a new one takes longer than to publish it.
        self._frames = setup.frames
        self._told_odometry = conversions.odometry_message(self._frames.odom, self._frames.base)
        self._scans = [
            (node.create_publisher(LaserScan, topic(name), SENSOR_DEPTH), frame, mount, upside_down)
            for name, frame, mount, upside_down in setup.lidars
        ]
        self._joints = node.create_publisher(JointState, topic('joint_states'), SENSOR_DEPTH)
        self._truth = node.create_publisher(PoseStamped, topic('ground_truth'), SENSOR_DEPTH)
        self._collisions = OwnedTopic(node, UInt32, topic('collisions'))
        self._tf = None if TFMessage is None else node.create_publisher(TFMessage, topic('tf'), 10)
        self._camera_at: TransformStamped | None = None
        self._camera_moved = True
        self._describe(node, setup)
        self._told_collisions = -1
        if setup.published.announce_pose:
            self._announce_pose(node)

    def publish(self, stamp: Time) -> None:
        """Publish everything measured at this moment."""
        base = self._robot.base
        conversions.set_odometry(
            self._told_odometry, base.odometry, base.speed, base.turn_speed, stamp
        )
        self._odometry.publish(self._told_odometry)
        if self._tf is not None:
            transform = conversions.transform_to_ros(
                base.odometry, self._frames.odom, self._frames.base, stamp
            )
            self._tf.publish(TFMessage(transforms=[transform, self._camera_frame(stamp)]))
        for publisher, frame, mount, upside_down in self._scans:
            if publisher.get_subscription_count():
                sweep = self._robot.measure(mount)
                if sweep is not None:
                    begun = _earlier(stamp, sweep.age)
                    publisher.publish(
                        conversions.scan_to_ros(
                            sweep.ranges,
                            self._robot.lidar,
                            frame,
                            begun,
                            sweep.duration,
                            upside_down=upside_down,
                        )
                    )
        if self._joints.get_subscription_count():
            arm, now = self._robot.arm, self._robot.time
            self._joints.publish(
                conversions.joints_to_ros(
                    arm.arm.names, arm.positions(now), arm.velocities(now), stamp
                )
            )
        if self._truth.get_subscription_count():
            self._truth.publish(conversions.stamped_pose_to_ros(base.pose, self._frames.map, stamp))
        if base.collisions != self._told_collisions:
            self._told_collisions = base.collisions
            self._collisions.publish(UInt32(data=base.collisions))

    def _camera_frame(self, stamp: Time) -> TransformStamped:
        """Return where the arm holds the camera."""
        arm, now = self._robot.arm, self._robot.time
        if self._camera_at is None or self._camera_moved or arm.is_moving(now):
            matrix = arm.arm.camera_frame(arm.positions(now))
            self._camera_at = conversions.matrix_to_ros(
                matrix, self._frames.base, self._frames.camera
            )
            self._camera_moved = arm.is_moving(now)
        self._camera_at.header.stamp = stamp
        return self._camera_at

    def _describe(self, node: PatrolNode, setup: SensorSetup) -> None:
        """Publish the robot's description, and its frames that do not move."""
        profile, topic = (
            setup.profile(self._robot.base.model.radius),
            partial(topic_of, self._robot),
        )
        self._description = node.create_publisher(String, topic('robot_description'), STATE_QOS)
        self._description.publish(String(data=description(profile)))
        if TFMessage is not None:
            self._static = node.create_publisher(TFMessage, topic('tf_static'), STATE_QOS)
            fixed = [conversions.fixed_frame_to_ros(each, Time()) for each in fixed_frames(profile)]
            self._static.publish(TFMessage(transforms=fixed))

    def _announce_pose(self, node: PatrolNode) -> None:
        def on_match(matched: object) -> None:
            if getattr(matched, 'current_count_change', 0) > 0:
                stamp = node.get_clock().now().to_msg()
                publisher.publish(
                    conversions.uncertain_pose_to_ros(
                        self._robot.base.pose, self._frames.map, stamp, 0.1, 0.05
                    )
                )

        publisher = node.create_publisher(
            PoseWithCovarianceStamped,
            topic_of(self._robot, 'initialpose'),
            1,
            event_callbacks=PublisherEventCallbacks(matched=on_match),
        )
