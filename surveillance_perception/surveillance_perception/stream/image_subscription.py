"""Subscribing to images so that they arrive, whatever the camera offers.

An image is hundreds of network packets. Of a best-effort image one lost packet loses the whole,
which on a busy machine is most of them; so delivery is asked to be reliable. A camera that offers
best effort only would not be heard at all then: once one shows up, the subscription is made anew.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy

from state_machines.ros.waiting import executor_of
from surveillance_runtime.node import PatrolNode

IMAGES_QOS = QoSProfile(depth=2, reliability=ReliabilityPolicy.RELIABLE)
"""For whoever publishes or reads images; an older one is never waited for."""


Item = TypeVar('Item')


class ImageSubscription:
    """Hears one topic of images.

    Args:
        node: The node that subscribes.
        kind: The message's type.
        topic: The topic's name, relative to the node's namespace.
        callback: Called with each image.
        raw: Whether it gets the bytes as they came.
    """

    def __init__(
        self,
        node: PatrolNode,
        kind: Any,
        topic: str,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
    ) -> None:
        self._node = node
        self._raw = raw
        self._kind = kind
        self._topic = topic
        self._callback = callback
        self._subscription = self._subscribe(reliable=True)

    def _subscribe(self, *, reliable: bool) -> Any:
        best_effort = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
        events = SubscriptionEventCallbacks(
            incompatible_qos=self._on_incompatible if reliable else None,
            use_default_callbacks=False,
        )
        return self._node.create_subscription(
            self._kind,
            self._topic,
            self._callback,
            IMAGES_QOS if reliable else best_effort,
            event_callbacks=events,
            raw=self._raw,
        )

    def _on_incompatible(self, _event: Any) -> None:
        # not here: the event belongs to the subscription that goes
        executor_of(self._node).create_task(self._settle_for_best_effort)

    def _settle_for_best_effort(self) -> None:
        former, self._subscription = self._subscription, self._subscribe(reliable=False)
        self._node.destroy_subscription(former)
        self._node.get_logger().info(f'{self._topic}: the camera offers best effort only')


class Latest(Generic[Item]):
    """Holds one item; a newer one takes its place.

    Attributes:
        dropped: How many items were replaced before they were taken.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._changed = threading.Condition()
        self._item: Item | None = None
        self._closed = False

    def put(self, item: Item) -> None:
        """Offer an item."""
        with self._changed:
            self.dropped += self._item is not None
            self._item = item
            self._changed.notify()

    def take(self) -> Item | None:
        """Wait for an item; None once closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None or self._closed)
            item, self._item = self._item, None
            return None if self._closed else item

    def close(self) -> None:
        """End all waits."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
