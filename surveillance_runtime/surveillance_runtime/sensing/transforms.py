"""Where the robot's frames are to each other: the lidars on the robot, the odometry on the map.

The frames are those of REP-105: map -> odom -> base -> lidar. The robot's profile names them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from sensor_msgs.msg import LaserScan

from lidar_navigation.geometry import Mount, Pose, Scan, composed, relative
from surveillance_runtime import parameter_checks
from surveillance_runtime.conversions import nanoseconds_of, pose_message, seconds_of, stamp_from
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.check_up import BASE_FRAMES
from surveillance_runtime.profile.parameters import LidarSettings
from surveillance_runtime.profile.record import Frames
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing import conversions
from surveillance_runtime.sensing.frame_tree import plain
from surveillance_runtime.sensing.frames_heard import FramesHeard
from surveillance_runtime.sensing.sensors import SensorStream
from surveillance_runtime.state_topics import StateSubscription

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

TELL_WITHIN = 3.0
"""A scan is left out for so long, seconds, while nobody says where its frame is."""


class ScanReader:
    """Reads scans as seen from the robot, by where its lidars sit.

    That is given by the parameter `lidar_mounts`, or else by `tf_static`.

    Args:
        node: The node that reads.
        radius: Of the robot, metres.
        base: The frame at the robot's centre.

    Attributes:
        settings: Which lidars there are.
        streams: What comes on the topic of each.
        frames: The fixed frames of the robot.

    Raises:
        ParameterError: A parameter of the lidars is of the wrong type.
    """

    def __init__(self, node: PatrolNode, radius: float, base: str = BASE_FRAMES[0]) -> None:
        self._node = node
        self._radius = radius
        self._base = plain(base)
        self.settings = node.declare_fields(LidarSettings())
        rows = np.array(self.settings.mounts, dtype=float).reshape(-1, 4).tolist()
        self._given = [Mount((x, y, yaw), math.cos(roll) < 0.0) for x, y, yaw, roll in rows]
        self._mounts: dict[str, Mount] = {}
        self._told: set[str] = set()
        self.streams = {topic: SensorStream(node, topic) for topic in self.settings.scans}
        self._waits_until: dict[str, float] = {}
        self.frames = FramesHeard(node, moving=False, news=self._mounts.clear)

    def subscribe(self, heard: Callable[[str, Scan, LaserScan], None]) -> None:
        """Hand over each scan: the name of its topic, the scan, and its message, whose stamp is the
        time of the first ray by the node's clock.
        """
        for topic in self.settings.scans:
            StateSubscription(
                self._node,
                LaserScan,
                topic,
                partial(self._take, topic, heard),
                each=True,
                qos=SENSOR_QOS,
                owner='simulator',
            )

    def _take(
        self, topic: str, heard: Callable[[str, Scan, LaserScan], None], message: LaserScan
    ) -> None:
        stream, header = self.streams[topic], message.header
        with conversions.refusing(self._node, topic):
            given = seconds_of(header.stamp)
            measured = stream.come(given, message.ranges.tobytes())
            if measured is None or self._waits_for(header.frame_id):
                return
            if measured != given:
                header.stamp = stamp_from(round(1e9 * measured))
            heard(topic, self._read(message, topic), message)
            stream.hear()

    def _waits_for(self, frame: str) -> bool:
        """Tell whether it may still be told where a lidar is: a scan may come before `tf_static`
        does.
        """
        if self._given or TFMessage is None or self._matrix_of(frame) is not None:
            return False
        now = time.monotonic()
        return now < self._waits_until.setdefault(frame, now + TELL_WITHIN)

    def _read(self, message: LaserScan, topic: str) -> Scan:
        mount = self.mount_of(message.header.frame_id, topic)
        return conversions.scan_from(message, mount, self._radius, self.settings.sweep)

    def mount_of(self, frame: str, topic: str = '') -> Mount:
        """Return where the lidar of a frame is on the robot; at its centre while nobody says."""
        if self._given:
            scans = self.settings.scans
            return self._given[scans.index(topic) if topic in scans else 0]
        if frame not in self._mounts:
            self._mounts[frame] = self._looked_up(frame)
        return self._mounts[frame]

    def _matrix_of(self, frame: str) -> NDArray[np.float64] | None:
        """Return where a frame is on the robot, shape (4, 4); None where nobody has said it."""
        found = self.frames.tree.matrix(
            frame, lambda at: at == self._base or at.rpartition('/')[2] in BASE_FRAMES
        )
        return None if found is None else found[0]

    def _looked_up(self, frame: str) -> Mount:
        matrix = self._matrix_of(frame)
        if matrix is None:
            self._tell_once(
                f'scan: where its frame {frame!r} is on the robot is not known: expected '
                f'it on tf_static below {self._base}, or lidars.mounts in the robot profile '
                "(parameter lidar_mounts); it is taken for the robot's centre"
            )
            return Mount()
        tilt = math.acos(min(abs(float(matrix[2, 2])), 1.0))
        if tilt > parameter_checks.MOST_TILT:
            self._tell_once(
                f'scan: its frame {frame!r} is tilted by {math.degrees(tilt):.0f} degrees: '
                'expected a lidar in the plane of the floor; it is taken for one'
            )
        x, y, yaw = matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])
        return Mount((float(x), float(y), yaw), bool(matrix[2, 2] < 0.0))

    def _tell_once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            self._node.get_logger().warn(text)


class MapFrame:
    """Publishes map -> odom on `tf`, where tf2_msgs is installed.

    Args:
        node: The node that localises.
        frames: Their names, and for how long a transform counts beyond its scan.
    """

    def __init__(self, node: PatrolNode, frames: Frames) -> None:
        self._frames = frames
        self._publisher = None if TFMessage is None else node.create_publisher(TFMessage, 'tf', 10)

    def publish(self, pose: Pose, odometry: Pose, stamp: Any, offset: float = 0.0) -> None:
        """Publish the correction that leads from the odometry to the pose.

        It is dated ahead, as AMCL does: whoever asks for the present gets the last correction
        instead of waiting for the next. It is dated by the clock of the odometry, whose transform
        it is joined with.

        Args:
            pose: Where the robot is.
            odometry: Where its odometry has it.
            stamp: The time of that, by the node's clock.
            offset: What the clock of the odometry is behind the node's, seconds.
        """
        if self._publisher is None:
            return
        # map <- odom = (map <- base) (base <- odom)
        x, y, yaw = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
        transform = TransformStamped(child_frame_id=self._frames.odom)
        transform.header.frame_id = self._frames.map
        ahead = round(1e9 * (self._frames.transform_tolerance - offset))
        transform.header.stamp = stamp_from(nanoseconds_of(stamp) + ahead)
        transform.transform.translation.x, transform.transform.translation.y = x, y
        transform.transform.rotation = pose_message((x, y, yaw)).orientation
        self._publisher.publish(TFMessage(transforms=[transform]))


class MapFrameReader:
    """Reads map -> odom from `tf`, where tf2_msgs is installed and another program localises.

    Args:
        node: The node that reads.
        frames: Their names.
        take: Called with where the odometry's frame lies on the map.
    """

    def __init__(self, node: PatrolNode, frames: Frames, take: Callable[[Pose], None]) -> None:
        self._node, self._frames, self._take = node, frames, take
        if TFMessage is not None:
            node.create_subscription(TFMessage, 'tf', self._on_transforms, 100)

    def _on_transforms(self, message: Any) -> None:
        wanted = plain(self._frames.map), plain(self._frames.odom)
        for each in message.transforms:
            if (plain(each.header.frame_id), plain(each.child_frame_id)) == wanted:
                with conversions.refusing(self._node, 'tf: map -> odom'):
                    matrix = conversions.matrix_from(each.transform)
                    x, y = matrix[:2, 3].tolist()
                    self._take((x, y, math.atan2(matrix[1, 0], matrix[0, 0])))
