"""Images in recordings: one a second of each topic that somebody looks at, compressed.

All images are 300 times as much as the rest of a recording; one a second, as JPEG, is a few times
as much and costs half a percent of a core. A camera that nobody looks at is left alone: a simulated
one draws no image until somebody does.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CompressedImage, Image

from surveillance_operator.conversions import jpeg_from
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.recording.bag import BagWriter, TopicType
from surveillance_operator.recording.schemas import definition

RAW, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
IMAGES = {RAW: Image, COMPRESSED: CompressedImage}
SUFFIX = '/compressed'
"""Ends the name of a topic of compressed images, as image_transport has it."""


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
        self._offers[topic] = IMAGES[kind]

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
