"""Publishes what the robot's sensors measure; the costly ones only while somebody listens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.event_handler import PublisherEventCallbacks
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import UInt32

from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import nanoseconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import parameter
from surveillance_runtime.place import plan_grid
from surveillance_runtime.place.rooms import Pose
from surveillance_runtime.profile.parameters import LidarSettings, declared_frames
from surveillance_runtime.profile.record import Frames
from surveillance_runtime.state_topics import OwnedTopic
from surveillance_simulation import conversions
from surveillance_simulation.robot.robot import Robot

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # the wheels on PyPI hold no tf2_msgs; an installed ROS 2 does
    TFMessage = None

SENSOR_DEPTH = 5
"""Sensors offer reliable delivery, so that subscribers of either kind are served (REP-2003)."""


@dataclass(frozen=True)
class PublishedOptions:
    """How the place is published; units as declared."""

    map_resolution: float = parameter(0.05, 'Side of a cell of the map, metres.', 0.01, 0.5)
    announce_pose: bool = parameter(
        False, 'Tell each new subscriber of initialpose, such as AMCL, where the robot is.'
    )


MAP_REPEAT = 5.0
"""Seconds of real time between two repetitions of the map, which is large."""


def _lidars_of(node: PatrolNode, frames: Frames) -> list[tuple[str, str, Pose]]:
    """Return topic, frame and mount of each lidar; one that tf_static knows is at the centre."""
    lidars = node.declare_fields(LidarSettings(), without=('sweep',))
    names = list(frames.scans)
    rows = np.array(lidars.mounts or [0.0] * 4 * len(lidars.scans)).reshape(-1, 4).tolist()
    return [
        (
            topic,
            names[i] if i < len(names) else f'{topic}_frame',
            (rows[i][0], rows[i][1], rows[i][2]),
        )
        for i, topic in enumerate(lidars.scans)
    ]


def _earlier(stamp: Time, seconds: float) -> Time:
    """Return the time that lies before another by some seconds; never less than 0."""
    nanoseconds = max(nanoseconds_of(stamp) - round(1e9 * seconds), 0)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


class SensorFeed:
    """The topics of a robot's sensors, of the map and of simulated time."""

    def __init__(self, node: PatrolNode, robot: Robot, *, drives_clock: bool) -> None:
        """Create the topics on a node; publish the map and the doors' states."""
        self._robot = robot
        self._drives_clock = drives_clock
        self._clock = node.create_publisher(Clock, '/clock', 1) if drives_clock else None
        self._odometry = node.create_publisher(Odometry, 'odom', SENSOR_DEPTH)
        # One message for all measurements: making a new one takes longer than to publish it.
        self._frames = declared_frames(node, 'map', 'odom', 'base', 'scans')
        self._told_odometry = conversions.odometry_message(self._frames.odom, self._frames.base)
        self._scans = [
            (node.create_publisher(LaserScan, topic, SENSOR_DEPTH), frame, mount)
            for topic, frame, mount in _lidars_of(node, self._frames)
        ]
        self._joints = node.create_publisher(JointState, 'joint_states', SENSOR_DEPTH)
        self._truth = node.create_publisher(PoseStamped, 'ground_truth', SENSOR_DEPTH)
        self._collisions = OwnedTopic(node, UInt32, 'collisions')
        self._doors = OwnedTopic(node, DoorStates, 'door_states')
        self._map = OwnedTopic(node, OccupancyGrid, 'map', repeat=MAP_REPEAT)
        self._tf = None if TFMessage is None else node.create_publisher(TFMessage, 'tf', 10)
        self._told_collisions = -1
        options = node.declare_fields(PublishedOptions())
        grid = plan_grid.draw(robot.world.plan, options.map_resolution)
        self._map.publish(conversions.grid_to_ros(grid, self._frames.map, Time()))
        self.tell_doors()
        if options.announce_pose:
            self._announce_pose(node)

    def tell_doors(self) -> None:
        """Publish which doors are open."""
        self._doors.publish(conversions.doors_to_ros(self._robot.world))

    def publish(self, stamp: Time) -> None:
        """Publish the clock, then everything measured at this moment."""
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp))
        base = self._robot.base
        conversions.set_odometry(
            self._told_odometry, base.odometry, base.speed, base.turn_speed, stamp
        )
        self._odometry.publish(self._told_odometry)
        if self._tf is not None:
            transform = conversions.transform_to_ros(
                base.odometry, self._frames.odom, self._frames.base, stamp
            )
            self._tf.publish(TFMessage(transforms=[transform]))
        for publisher, frame, mount in self._scans:
            if publisher.get_subscription_count():
                sweep = self._robot.measure(mount)
                if sweep is not None:
                    begun = _earlier(stamp, sweep.age)
                    publisher.publish(
                        conversions.scan_to_ros(
                            sweep.ranges, self._robot.lidar, frame, begun, sweep.duration
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
            'initialpose',
            1,
            event_callbacks=PublisherEventCallbacks(matched=on_match),
        )
