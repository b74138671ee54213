"""The camera's image for the page: heard only while somebody looks, the newest one only."""

from __future__ import annotations

import threading
import time

from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image as ImageMessage

from surveillance_operator.conversions import jpeg_from
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_runtime.node import PatrolNode

ANNOTATED, RAW = 'aruco_detector/annotated', 'camera/rgb/image_raw'
"""The image with the markers drawn in, which a detector publishes while it looks; the plain one."""
PATIENCE = 4.0
"""The plain image is heard when none with markers came for this time, seconds; and an image that
is older than this is not shown as if it were new."""
IDLE_SECONDS = 5.0
"""After this time without a question nobody listens to the camera any more."""


class Camera:
    """Gives the newest image of a node's camera.

    Args:
        node: The node that listens.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._lock = threading.Lock()
        self._subscriptions: dict[str, PolledSubscription] = {}
        self._asked = self._annotated_at = self._came_at = 0.0
        self._jpeg: bytes | None = None

    def jpeg(self) -> bytes | None:
        """Return the newest image; None where nothing came for a while."""
        with self._lock:
            now = time.monotonic()
            if not self._subscriptions:
                self._annotated_at = now if self._node.count_publishers(ANNOTATED) else 0.0
            self._asked = now
            newest = self._newest(ANNOTATED)
            if newest is not None:
                self._annotated_at = now
                self._leave(RAW)
            elif now - self._annotated_at > PATIENCE:
                newest = self._newest(RAW)
            if newest is not None:
                self._jpeg, self._came_at = jpeg_from(newest), now
            return self._jpeg if now - self._came_at <= PATIENCE else None

    def rest(self) -> None:
        """Leave the topics when nobody has asked for a while; call it now and then."""
        with self._lock:
            if time.monotonic() - self._asked > IDLE_SECONDS:
                self._leave(ANNOTATED)
                self._leave(RAW)
                self._jpeg = None

    def _newest(self, topic: str) -> ImageMessage | None:
        if topic not in self._subscriptions:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._subscriptions[topic] = PolledSubscription(self._node, ImageMessage, topic, qos)
        newest = self._subscriptions[topic].newest()
        return None if newest is None else newest[0]

    def _leave(self, topic: str) -> None:
        if (subscription := self._subscriptions.pop(topic, None)) is not None:
            subscription.destroy()
