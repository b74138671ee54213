"""What comes on the topics of a robot's sensors: whether it is new, when it was measured by this
node's clock, and why it is of no use."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from sensor_msgs.msg import Imu

from lidar_navigation import TrueOdometry
from lidar_navigation.geometry import Pose
from surveillance_runtime.conversions import (
    frames_of_serialized,
    pose_of_serialized,
    seconds_of,
    stamp_of_serialized,
    turn_rate_of_serialized,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.check_up import BASE_FRAMES
from surveillance_runtime.profile.record import Frames, OdometryScale
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing import conversions
from surveillance_runtime.stamp_offset import StampOffset
from surveillance_runtime.state_topics import StateSubscription

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

BY_TF_AFTER = 2.0
"""Odometry that nobody publishes as a topic for so long is looked for on `tf`, seconds."""
REPEATED = 'the same message comes again and again'


def measured_at(node: PatrolNode, stamps: StampOffset, stamp: float, now: float) -> float:
    """Return when a message was measured, seconds of a node's clock; warn once of odd stamps.

    Args:
        node: The node that reads.
        stamps: Follows the stamps of that source.
        stamp: The message's, seconds; 0: it has none.
        now: When it came, seconds of the node's clock.
    """
    measured = stamps.time_of(stamp, now) if stamp else now
    if (warning := stamps.warning()) is not None:
        node.get_logger().warn(warning)
    return measured


class SensorStream:
    """The messages of one sensor's topic, in the executor's thread.

    Args:
        node: The node that reads.
        name: Of the topic, as the node names it.

    Attributes:
        topic: The full name of the topic.
        came_at: When a message came last, good or not, steady seconds; None: none came.
        heard_at: When one came that is of use; None: none came.
    """

    def __init__(self, node: PatrolNode, name: str) -> None:
        self.topic = str(node.resolve_topic_name(name))
        self.came_at: float | None = None
        self.heard_at: float | None = None
        self._node = node
        self._name = name
        # Under use_sim_time all have one clock, and its time comes in steps.
        simulated = node.is_simulated
        self._stamps = None if simulated else StampOffset(self.topic)
        self._last: tuple[float, bytes] = (0.0, b'')
        self._repeats = False

    @property
    def problem(self) -> str:
        """Why what came last is of no use; empty where it is."""
        return REPEATED if self._repeats else conversions.refusal(self._node, self._name)

    @property
    def offset(self) -> float:
        """What the sensor's stamps are behind this node's clock, seconds; 0 where they agree."""
        return 0.0 if self._stamps is None else self._stamps.offset

    def come(self, stamp: float, content: bytes) -> float | None:
        """Take that a message came.

        Args:
            stamp: Its stamp, seconds; 0: it has none.
            content: What it says.

        Returns:
            When it was measured, seconds of this node's clock; None where it was there before: who
            publishes what was measured once again and again sees nothing any more.
        """
        self.came_at = time.monotonic()
        last, self._last = self._last, (stamp, content)
        self._repeats = stamp != 0.0 and (stamp, content) == last
        if self._repeats:
            return None
        now = float(self._node.get_clock().now().nanoseconds) / 1e9
        if stamp == 0.0:
            return now
        if self._stamps is None or stamp < 0.0:
            return stamp
        return measured_at(self._node, self._stamps, stamp, now)

    @property
    def stamp(self) -> float:
        """What the message that came last is stamped, seconds of its clock; 0: nothing."""
        return self._last[0]

    def hear(self) -> None:
        """Take that the message which came is of use."""
        self.heard_at = self.came_at


class OdometryReader:
    """Reads `odom`; where nobody publishes that, the odometry's frame on `tf`.

    Args:
        node: The node that reads.
        take: Called with each reading, in true metres as the profile has the scale, and when it
            was made, seconds of the node's clock.
        frames: The names of the frames on `tf`; None: it is not looked at.

    Attributes:
        stream: What comes.
        reading: The last reading as the driver told it; None: none came.
        child: The child frame that the first message names; empty: none came, or it names none.
    """

    def __init__(
        self,
        node: PatrolNode,
        take: Callable[[Pose, float], object],
        frames: Frames | None = None,
    ) -> None:
        self.stream = SensorStream(node, 'odom')
        self.reading: Pose | None = None
        self._node = node
        self._take = take
        self._by_tf: Subscription | None = None
        self.child = ''
        scale = node.declare_fields(OdometryScale(), prefix='odometry.')
        self._true = TrueOdometry(scale.scale, scale.turn_scale)
        self._names: bytes | None = None
        self._gyroscope = StampOffset(str(node.resolve_topic_name('imu')))
        node.create_subscription(Imu, 'imu', self._on_turn_rate, SENSOR_QOS, raw=True)
        StateSubscription(
            node,
            Odometry,
            'odom',
            self._on_odometry,
            raw=True,
            each=True,
            qos=SENSOR_QOS,
            owner='simulator',
        )
        if frames is not None and TFMessage is not None:
            self._odom = frames.odom.removeprefix('/')
            self._bases = {frames.base.removeprefix('/'), *filter(None, BASE_FRAMES)}
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            node.create_timer(BY_TF_AFTER, self._look_for_topic, clock=steady)

    def _on_odometry(self, serialized: bytes) -> None:
        if self.stream.came_at is None:
            self.child = deserialize_message(serialized, Odometry).child_frame_id
        with conversions.refusing(self._node, 'odom'):
            measured = self.stream.come(stamp_of_serialized(serialized), serialized)
            if measured is not None:
                names = frames_of_serialized(serialized, texts=1)
                if names != self._names and self._names is not None:
                    self._true.restart()
                self._names = names
                self._hear(pose_of_serialized(serialized, texts=1), measured)

    def _on_turn_rate(self, serialized: bytes) -> None:
        """Take what a gyroscope tells: turns that the wheels do not, or wrongly."""
        with conversions.refusing(self._node, 'imu'):
            stamp, rate = stamp_of_serialized(serialized), turn_rate_of_serialized(serialized)
            now = float(self._node.get_clock().now().nanoseconds) / 1e9
            if self._node.is_simulated or stamp == 0.0:
                self._true.turn(stamp or now, rate)
            else:
                self._true.turn(measured_at(self._node, self._gyroscope, stamp, now), rate)

    def _hear(self, reading: Pose, measured: float) -> None:
        self.reading = reading
        self._take(self._true.take(reading, measured), measured)
        self.stream.hear()

    def _look_for_topic(self) -> None:
        """Hear `tf` while nobody publishes the topic; it costs much where all robots share it."""
        if self._node.count_publishers('odom'):
            if self._by_tf is not None:
                self._node.destroy_subscription(self._by_tf)
                self._by_tf = None
        elif self._by_tf is None:
            self._by_tf = self._node.create_subscription(TFMessage, 'tf', self._on_transforms, 100)

    def _on_transforms(self, message: Any) -> None:
        for each in message.transforms:
            names = each.header.frame_id.removeprefix('/'), each.child_frame_id.removeprefix('/')
            if names[0] != self._odom or names[1] not in self._bases:
                continue
            with conversions.refusing(self._node, 'tf: odometry'):
                matrix = conversions.matrix_from(each.transform)
                measured = self.stream.come(seconds_of(each.header.stamp), matrix.tobytes())
                if measured is not None:
                    x, y = matrix[:2, 3].tolist()
                    self._hear((x, y, math.atan2(matrix[1, 0], matrix[0, 0])), measured)
