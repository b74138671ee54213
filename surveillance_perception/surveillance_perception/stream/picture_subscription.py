"""Subscribing to pictures so that they arrive, whatever the camera offers.

A picture is hundreds of network packets. Of a best-effort picture one lost packet loses the whole,
which on a busy machine is most of them; so delivery is asked to be reliable. A camera that offers
best effort only would not be heard at all then: once one shows up, the subscription is made anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy

from surveillance_runtime.node import PatrolNode

PICTURES_QOS = QoSProfile(depth=2, reliability=ReliabilityPolicy.RELIABLE)
"""For whoever publishes or reads pictures; an older one is never waited for."""


class PictureSubscription:
    """Hears one topic of pictures.

    Args:
        node: The node that subscribes.
        kind: The message's type.
        topic: The topic's name, relative to the node's namespace.
        callback: Called with each picture.
    """

    def __init__(
        self, node: PatrolNode, kind: Any, topic: str, callback: Callable[[Any], None]
    ) -> None:
        self._node = node
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
            PICTURES_QOS if reliable else best_effort,
            event_callbacks=events,
        )

    def _on_incompatible(self, _event: Any) -> None:
        # not here: the event belongs to the subscription that goes
        self._node.executor.create_task(self._settle_for_best_effort)

    def _settle_for_best_effort(self) -> None:
        former, self._subscription = self._subscription, self._subscribe(reliable=False)
        self._node.destroy_subscription(former)
        self._node.get_logger().info(f'{self._topic}: the camera offers best effort only')
