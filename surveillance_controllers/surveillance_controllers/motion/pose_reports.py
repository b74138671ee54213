"""What others hear of a navigator: where the robot is, what stands about, and what is in doubt.

Publishes `amcl_pose`, `obstacles` and the transform from the map's frame to the odometry's; begins
and ends the incident of a robot that stands and does not know where it is.
"""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import PointCloud2

from lidar_navigation import Navigator
from surveillance_runtime.conversions import cloud_from_points, pose_estimate, stamp_from
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.record import Frames
from surveillance_runtime.sensing.sensors import OdometryReader
from surveillance_runtime.sensing.transforms import MapFrame
from surveillance_runtime.state_topics import OwnedTopic

POSE_PERIOD = 0.19
"""Least time between two messages on amcl_pose, seconds: with every second scan at 10 Hz."""
UNSURE_FOR = 10.0
"""A robot that stands and does not know where it is calls somebody after this, seconds of real
time."""
POSE = ('robot', 'pose')
"""The cause of that incident."""


class PoseReports:
    """Tells of one navigator; called by whoever owns it, after a scan.

    Args:
        node: The node that publishes.
        navigator: Of which is told.
        frames: The names of the frames.
        odometry: What comes of it: its clock dates the transform.
    """

    def __init__(
        self, node: PatrolNode, navigator: Navigator, frames: Frames, odometry: OdometryReader
    ) -> None:
        self._node, self._navigator, self._frames = node, navigator, frames
        self._odometry = odometry
        self._poses = OwnedTopic(node, PoseWithCovarianceStamped, 'amcl_pose', repeat=None)
        self._obstacles = OwnedTopic(node, PointCloud2, 'obstacles')
        self._map_frame = MapFrame(node, frames)
        self._sent = float('-inf')
        self._unsure_since: float | None = None
        self._was_lost = self._was_ambiguous = False
        self._jumps = 0

    def publish_pose(self, measured: float, stamp: Any) -> None:
        """Publish where the robot is, not too often.

        Args:
            measured: The time of a scan, seconds.
            stamp: The same, as the message has it.
        """
        told = self._navigator.told_pose(measured)
        if told is None or 0 <= measured - self._sent < POSE_PERIOD:
            return
        pose, at = told
        if at != measured:
            stamp = stamp_from(round(1e9 * at))
        deviation = (0.03, 0.02) if self._navigator.is_sure else (5.0, 3.0)
        estimate = PoseWithCovarianceStamped(pose=pose_estimate(pose, *deviation))
        estimate.header.frame_id, estimate.header.stamp = self._frames.map, stamp
        self._sent = measured
        self._poses.publish(estimate)

    def tell(self, stamp: Any) -> None:
        """Say what changed with a scan of this stamp: pose lost, found, in doubt; obstacles."""
        navigator = self._navigator
        if navigator.pose is None:
            return
        self._tell_of_doubt()
        if navigator.lost != self._was_lost:
            self._was_lost = navigator.lost
            if navigator.lost:
                self._node.get_logger().warn('pose lost: the scans do not fit the map')
        if navigator.ambiguous != self._was_ambiguous:
            self._was_ambiguous = navigator.ambiguous
            if navigator.ambiguous:
                self._node.get_logger().info(
                    'the robot may be in one of several places that look alike: which one is told '
                    'once something tells them apart'
                )
        if navigator.jumps != self._jumps:
            self._jumps = navigator.jumps
            x, y, _ = navigator.pose
            self._node.get_logger().info(f'pose found at ({x:.2f}, {y:.2f})')
        if navigator.obstacles_changed:
            navigator.obstacles_changed = False
            cloud = cloud_from_points(
                navigator.obstacles, self._frames.map, stays=navigator.obstacles_stay
            )
            cloud.header.stamp = stamp
            self._obstacles.publish(cloud)
        # The driver publishes its transform as it counts, whatever the profile has for its scale.
        reading = self._odometry.reading or navigator.odometry
        if reading is not None:
            offset = self._odometry.stream.offset
            self._map_frame.publish(navigator.pose, reading, stamp, offset)

    def _tell_of_doubt(self) -> None:
        """Call somebody for a robot that stands and does not know where it is."""
        if self._navigator.is_sure:
            self._unsure_since = None
            self._node.incidents.end(POSE, 'the robot knows where it is')
            return
        now = time.monotonic()
        if self._unsure_since is None:
            self._unsure_since = now
        if now - self._unsure_since < UNSURE_FOR or self._navigator.task is not None:
            return
        why = 'what it sees is nowhere on the map'
        if not self._navigator.lost:
            *others, last = self._navigator.may_be_in or ('a place without a name',)
            here = f'{", ".join(others)} or {last}' if others else last
            why = f'it may be in {here}, at poses that look alike'
        self._node.incidents.begin(
            POSE,
            f'the robot does not know where it is: {why}',
            Severity.ALARM,
            action='say where it is on the page (Set pose), in RViz (2D Pose Estimate) or on the '
            'topic initialpose, or drive it about by hand',
        )
