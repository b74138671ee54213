"""The node `mission_recorder`: writes all topics of a mission to a recording, and its time line.

It takes serialised messages as they came and never looks into them. Topics are found as they
appear. On a full disk it says so once, and goes on when there is space again.

Of images one a second of each topic that somebody looks at is taken, compressed, unless all are
asked for: all images are 300 times as much as the rest of a recording; one a second, as JPEG, is a
few times as much and costs half a percent of a core. A camera that nobody looks at is left alone: a
simulated one draws no image until somebody does.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage, Image

from strict_files.files import in_one_line
from surveillance_operator.images import COMPRESSED, KINDS, SUFFIX, jpeg_from
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.recording.bag import (
    BagWriter,
    TopicType,
    prune,
    repair,
)
from surveillance_operator.recording.schemas import definition, message_class
from surveillance_operator.recording.timeline import TimelineWriter
from surveillance_runtime.graph_check import endpoints_of, type_clashes
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.run_files import RECORDING, TIMELINE
from surveillance_runtime.topic_names import asked_as

DRAIN_PERIOD, SEAL_PERIOD, STATE_PERIOD = 0.15, 0.6, 0.4
"""Seconds between two looks at all queues, two chunks, and two lines of the time line."""
PRUNE_PERIOD = 60.0
RETRY_PERIOD = 3.0
"""Seconds after which a recording that could not be written is tried again."""
STREAMS = frozenset(
    (
        *(f'geometry_msgs/msg/{name}' for name in ('Twist', 'TwistStamped')),
        *(f'sensor_msgs/msg/{name}' for name in ('CameraInfo', 'Imu', 'JointState', 'LaserScan')),
        *('nav_msgs/msg/Odometry', 'tf2_msgs/msg/TFMessage'),
    )
)
"""Types of topics on which, unless they are latched, one message soon follows another."""
OWN = 'surveillance_interfaces/'
DISK_FULL = errno.ENOSPC, errno.EDQUOT
QUEUE = 2000
"""Messages of one topic that may come within `DRAIN_PERIOD`; a latched topic brings its own."""


class MissionRecorder(PatrolNode):
    """Records until it is stopped."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('mission_recorder', **node_options)
        folder: str = self.parameter(
            'folder', 'recording', 'Folder of the recording.', read_only=True
        )
        self._all_images = self.parameter(
            'images', False, 'Record every image as it came.', read_only=True
        )
        image_period = self.parameter(
            'image_period',
            1.0,
            'Seconds between two images, compressed, of each topic that somebody looks at.',
            minimum=0.1,
            maximum=86_400.0,
            read_only=True,
        )
        self._keep = self.parameter(
            'keep',
            20.0,
            'Most of all recordings beside this one to keep, gigabytes; the oldest are deleted.',
            minimum=0.0,
        )
        others = self.parameter(
            'other_robots',
            (),
            "Namespaces of a fleet's other robots, whose topics their own recorders keep.",
            of=str,
            read_only=True,
        )
        self._left_out = tuple(f'{namespace.rstrip("/")}/' for namespace in others)
        megabytes = self.parameter('segment_size', 128.0, 'Megabytes of a file.', minimum=0.1)
        seconds = self.parameter('segment_age', 3600.0, 'Seconds of a file.', minimum=1.0)
        path = Path(folder)
        self._bag = BagWriter(path, segment_bytes=int(megabytes * 1e6), segment_seconds=seconds)
        self._timeline = TimelineWriter(path.with_name(TIMELINE))
        self._waits_for_disk = False
        self._next_seal = self._next_line = self._next_prune = 0.0
        try:
            self._bag.seal()
        except OSError as error:
            if error.errno not in DISK_FULL:  # else it is tried again
                raise NotNowError(f'parameter folder: {in_one_line(error)}') from error
        self._images = ImageRecorder(self, self._bag, image_period)
        self._subscriptions_by_topic: dict[str, PolledSubscription] = {}
        self._clashes: set[str] = set()
        self._unknown: set[str] = set()
        self._subscriber = MissionSubscriber.of_process(self)
        self.spawn(self._record, 'recording')
        if path.name == RECORDING:
            self.spawn(self._repair, 'repair')

    def _repair(self) -> None:
        """Mend what earlier runs left torn."""
        own = self._bag.folder.resolve()
        for folder in sorted(own.parent.parent.glob(f'*/{RECORDING}')):
            if self.stopping.is_set():
                return
            if folder.resolve() == own:
                continue
            try:
                for line in repair(folder):
                    self.get_logger().info(f'repair: {line}')
            except OSError as error:
                self.get_logger().warn(f'{folder}: cannot be repaired: {error.strerror}')

    def _record(self) -> None:
        while not self.stopping.wait(DRAIN_PERIOD):
            self._attempt(self._record_once)
        self._attempt(self._end)

    def _attempt(self, work: Callable[[], None]) -> None:
        """Write; what fails is said once, and tried again after a pause."""
        try:
            work()
        except OSError as error:
            if not self._waits_for_disk:
                self._waits_for_disk = True
                self.get_logger().warn(f'nothing is recorded at present: {in_one_line(error)}')
            self._next_line = self._next_seal = 0.0
            self.stopping.wait(RETRY_PERIOD)

    def _record_once(self) -> None:
        now = time.monotonic()
        self._drain()
        if now >= self._next_line:
            self._timeline.add(self._subscriber.see(), time.time())
            self._next_line = now + STATE_PERIOD
        if now >= self._next_seal:
            self._bag.seal()
            self._next_seal = now + SEAL_PERIOD
            if self._waits_for_disk:
                self._waits_for_disk = False
                self.get_logger().info('the recording continues')
            self._find_topics()
            self._images.attend()
        if now >= self._next_prune and self._bag.folder.name == RECORDING:
            self._next_prune = now + PRUNE_PERIOD
            prune(self._bag.folder.resolve().parent.parent, self._keep * 1e9)

    def _end(self) -> None:
        self._drain()
        self._bag.close()
        self._timeline.add(self._subscriber.see(), time.time())
        self._timeline.close()

    def _drain(self) -> None:
        self._images.drain()
        for topic, subscription in self._subscriptions_by_topic.items():
            while (taken := subscription.take()) is not None:
                data, stamps = taken
                self._bag.write(
                    topic, data, stamps['received_timestamp'], stamps['source_timestamp']
                )

    def _find_topics(self) -> None:
        found = self.get_topic_names_and_types()
        self._look_for_clashes([topic for topic, types in found if len(types) > 1])
        for topic, types in found:
            if topic in self._subscriptions_by_topic or topic in self._unknown:
                continue
            if topic.startswith(self._left_out):
                continue
            offers = [
                each
                for each in self.get_publishers_info_by_topic(asked_as(self, topic))
                if each.node_name != self.get_name()
            ]
            if offers:
                # Of two types that of this project, which this process hears in any case.
                kind = next((each for each in types if each.startswith(OWN)), types[0])
                self._follow(topic, kind, offers)

    def _look_for_clashes(self, topics: Sequence[str]) -> None:
        """Tell of topics that have more than one type, and of those that have not any more."""
        clashes = type_clashes(endpoints_of(self, topics)) if topics else {}
        for topic, text in clashes.items():
            self.incidents.begin(('topic', topic), text)
        for topic in self._clashes - clashes.keys():
            self.incidents.end(('topic', topic), f'{topic} has one type')
        self._clashes = set(clashes)

    def _follow(self, topic: str, kind: str, offers: Sequence[Any]) -> None:
        if kind in KINDS and not self._all_images:
            self._images.offer(topic, kind)
            return
        profiles = [each.qos_profile for each in offers]
        reliable = all(each.reliability == ReliabilityPolicy.RELIABLE for each in profiles)
        latched = all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in profiles)
        depth = max((each.depth for each in profiles), default=10) or 10
        # Each message that is heard reliably is acknowledged: four wakeups of two processes.
        heard_reliably = reliable and (latched or kind not in STREAMS)
        qos = QoSProfile(
            depth=QUEUE,
            reliability=ReliabilityPolicy.RELIABLE
            if heard_reliably
            else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        try:
            type_hash = str(getattr(offers[0], 'topic_type_hash', ''))
            self._bag.add_topic(
                TopicType(topic, kind, definition(kind), reliable, latched, depth, type_hash)
            )
            subscription = PolledSubscription(
                self, message_class(kind), asked_as(self, topic), qos, raw=True
            )
        except (ValueError, ImportError, AttributeError, _rclpy.RCLError) as error:
            # A type that is not installed here, or a second one on a topic: the middleware refuses
            # that to a process that has the other already.
            self._unknown.add(topic)
            self.get_logger().warn(f'topic {topic} is not recorded: {" ".join(str(error).split())}')
            return
        self._subscriptions_by_topic[topic] = subscription


class ImageRecorder:
    """Records images now and then.

    Args:
        node: The node that listens.
        bag: Where to.
        period: Seconds between two images of a topic.
    """

    def __init__(self, node: Node, bag: BagWriter, period: float) -> None:
        self._node = node
        self._bag = bag
        self._period = period
        self._next = 0.0
        self._subscriptions: dict[str, PolledSubscription] = {}
        self._offers: dict[str, Any] = {}

    def offer(self, topic: str, kind: str) -> None:
        """Take note of a topic with images."""
        self._offers[topic] = KINDS[kind]

    def attend(self) -> None:
        """Hear the topics that others hear too, and leave those that they left."""
        for topic, kind in self._offers.items():
            own = self._node.get_name(), self._node.get_namespace()
            heard = any(
                (each.node_name, each.node_namespace) != own
                for each in self._node.get_subscriptions_info_by_topic(topic)
            )
            if heard and topic not in self._subscriptions:
                qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
                self._subscriptions[topic] = PolledSubscription(self._node, kind, topic, qos)
            elif not heard and topic in self._subscriptions:
                self._subscriptions.pop(topic).destroy()

    def drain(self) -> None:
        """Write the newest image of each topic, if it is time."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + self._period
        for topic, subscription in self._subscriptions.items():
            if (taken := subscription.take()) is not None:
                image, stamps = taken
                self._write(topic, image, stamps['received_timestamp'], stamps['source_timestamp'])

    def _write(self, topic: str, image: Any, received: int, published: int) -> None:
        if isinstance(image, Image):
            # With both, the publisher's own compressed image is the one that is kept.
            if (topic := topic + SUFFIX) in self._offers:
                return
            data = jpeg_from(image)
            if data is None:
                return
            image = CompressedImage(header=image.header, format='jpeg', data=data)
        self._bag.add_topic(TopicType(topic, COMPRESSED, definition(COMPRESSED), reliable=False))
        self._bag.write(topic, serialize_message(image), received, published)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionRecorder, args)
