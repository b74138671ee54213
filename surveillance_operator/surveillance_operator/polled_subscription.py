"""Subscriptions that are asked for their messages instead of calling back.

An executor of rclpy looks at every entity of its nodes for each message it takes. A watcher with
thirty topics costs less when it takes what has come, every few milliseconds, on a thread of its
own; and what a queue of bounded depth drops meanwhile is never waited for.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile


class _Unattended(CallbackGroup):
    """Keeps executors from waiting for what is in it."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        return


class PolledSubscription:
    """One topic, whose messages wait until `take` is called; always from the same thread.

    Args:
        node: The node that subscribes.
        kind: The type of the messages.
        topic: Its name.
        qos: Its depth bounds what waits.
        raw: Take messages as serialised bytes.
    """

    def __init__(
        self, node: Node, kind: Any, topic: str, qos: QoSProfile, *, raw: bool = False
    ) -> None:
        self._node = node
        self.qos = qos
        self._subscription = node.create_subscription(
            kind,
            topic,
            _never,
            qos,
            raw=raw,
            callback_group=_Unattended(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self.topic: str = self._subscription.topic_name

    def take(self) -> tuple[Any, dict[str, Any]] | None:
        """Return the oldest message that waits, with its time stamps, or None."""
        subscription = self._subscription
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        return None if taken is None else (taken[0], taken[1])

    def newest(self) -> tuple[Any, dict[str, Any]] | None:
        """Drop all messages that wait but the newest; return that as `take` does, or None."""
        newest = None
        while (taken := self.take()) is not None:
            newest = taken
        return newest

    def destroy(self) -> None:
        """Leave the topic."""
        self._node.destroy_subscription(self._subscription)


def await_message(
    context: Context, subscriptions: Iterable[PolledSubscription], timeout: float
) -> None:
    """Wait until one of the subscriptions has a message, at most that many seconds."""
    handles = [each._subscription.handle for each in subscriptions]
    with contextlib.ExitStack() as held:
        if context.handle is None:
            return
        held.enter_context(context.handle)
        for handle in handles:
            held.enter_context(handle)
        # Of subscriptions, guard conditions, timers, clients, services, events.
        waiting = _rclpy.WaitSet(len(handles), 0, 0, 0, 0, 0, context.handle)
        held.enter_context(waiting)
        waiting.clear_entities()
        for handle in handles:
            waiting.add_subscription(handle)
        waiting.wait(int(timeout * 1e9))


def _never(_message: Any) -> None:
    raise AssertionError('no executor attends to this subscription')
