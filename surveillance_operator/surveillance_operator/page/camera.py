"""The camera's image for the page: heard only while somebody looks, the newest one only."""

from __future__ import annotations

import io
import threading
import time
from typing import Any

import numpy as np
from PIL import Image
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image as ImageMessage

from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_runtime.node import PatrolNode

TOPICS = ('aruco_detector/annotated', 'camera/rgb/image_raw')
"""The first that has a publisher is shown: with the markers drawn in, where a detector runs."""
IDLE_SECONDS = 5.0
"""After this time without a question nobody listens to the camera any more."""
MOST_PIXELS = 20_000_000
QUALITY = 75


class Camera:
    """Gives the newest image of a node's camera.

    Args:
        node: The node that listens.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._lock = threading.Lock()
        self._subscription: PolledSubscription | None = None
        self._asked = 0.0
        self._jpeg: bytes | None = None

    def jpeg(self) -> bytes | None:
        """Return the newest image; None where nothing came yet."""
        with self._lock:
            self._asked = time.monotonic()
            if self._subscription is None:
                self._listen()
            newest = None
            while self._subscription and (taken := self._subscription.take()) is not None:
                newest = taken[0]
            if newest is not None:
                self._jpeg = jpeg_of(newest)
            return self._jpeg

    def rest(self) -> None:
        """Leave the topic when nobody has asked for a while; call it now and then."""
        with self._lock:
            if self._subscription and time.monotonic() - self._asked > IDLE_SECONDS:
                self._subscription.destroy()
                self._subscription = self._jpeg = None

    def _listen(self) -> None:
        for topic in TOPICS:
            if self._node.count_publishers(topic):
                qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
                self._subscription = PolledSubscription(self._node, ImageMessage, topic, qos)
                return


def jpeg_of(message: Any) -> bytes | None:
    """Return an image message as JPEG; None when its encoding or its size cannot be used."""
    channels = {'rgb8': 3, 'bgr8': 3, 'mono8': 1}.get(message.encoding)
    if channels is None or not 0 < message.width * message.height <= MOST_PIXELS:
        return None
    pixels = np.frombuffer(bytes(message.data), np.uint8)
    if message.step < message.width * channels or pixels.size < message.step * message.height:
        return None
    rows = pixels[: message.step * message.height].reshape(message.height, message.step)
    image = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
    if message.encoding == 'bgr8':
        image = image[:, :, ::-1]
    file = io.BytesIO()
    Image.fromarray(image if channels == 3 else image[:, :, 0]).save(file, 'JPEG', quality=QUALITY)
    return file.getvalue()
