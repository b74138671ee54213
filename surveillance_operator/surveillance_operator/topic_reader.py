"""Takes what came on the topics of a mission, as often as it is asked."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.serialization import deserialize_message

from surveillance_operator.polled_subscription import PolledSubscription, await_message
from surveillance_operator.topics import TOPICS, Topic
from surveillance_runtime.conversions import clean_texts
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for

MOST_PASSED_ON = 1000
"""Messages of a topic that all robots speak on that wait for a robot's reader."""
WAKE_PERIOD = 0.1
"""Longest wait for a message, seconds."""
OF_THE_PLACE = ('map', 'door_states')
"""The topics that the robots of a fleet share."""


class TopicReader:
    """The topics of one robot's mission; always from the same thread.

    A latched state is repeated each second: it is compared by its bytes, and read when it changed.

    Args:
        node: The node that listens.
        robot: The robot of a fleet; empty: that of the node's own namespace.
        streams: Hear the lidar, too.

    Attributes:
        robots: The readers of a fleet's robots, by name: they get what all robots say on one topic
            from the one who hears it. Each would otherwise hear all.
    """

    def __init__(self, node: PatrolNode, robot: str = '', *, streams: bool = False) -> None:
        self._context = node.context
        self._topics = [
            (
                topic,
                PolledSubscription(
                    node, topic.kind, name_for(robot, topic.name), topic.qos, raw=topic.is_state
                ),
            )
            for topic in TOPICS
            if (streams or not topic.stream)
            and not (robot and (topic.name in OF_THE_PLACE or topic.whose is not None))
        ]
        # The lidar comes with the pose, and health now and then.
        self._prompt = [
            subscription
            for topic, subscription in self._topics
            if streams and not topic.beside and not topic.period
        ]
        self._states: dict[str, bytes] = {}
        self._next_reading: dict[str, float] = {}
        self._passed_on: deque[tuple[Topic, Any]] = deque(maxlen=MOST_PASSED_ON)
        self.robots: Mapping[str, TopicReader] = {}

    def __iter__(self) -> Iterator[tuple[Topic, PolledSubscription]]:
        return iter(self._topics)

    def take(self) -> list[tuple[Topic, Any]]:
        """Return the messages that came, in the order in which they are to be read."""
        came: list[tuple[Topic, Any]] = []
        while self._passed_on:
            came.append(self._passed_on.popleft())
        for topic, subscription in self._topics:
            if topic.beside and not any(each.name == topic.beside for each, _ in came):
                continue
            if topic.period and not self._is_due(topic):
                continue
            for _ in range(subscription.qos.depth):
                if (taken := subscription.take()) is None:
                    break
                message = self._changed(topic, taken[0]) if topic.is_state else taken[0]
                if message is None:
                    continue
                clean_texts(message)
                if topic.whose is not None:
                    self._pass_on(topic, topic.whose(message), message)
                # In front: what it stands beside is read with it.
                came.insert(0 if topic.beside else len(came), (topic, message))
        return came

    def wait(self) -> None:
        """Wait until something comes that a view shows at once, or for a moment."""
        if self._prompt:
            await_message(self._context, self._prompt, WAKE_PERIOD)

    def forget(self) -> None:
        """Read each state once more when it is repeated; from any thread."""
        self._states.clear()

    def destroy(self) -> None:
        """Leave all topics."""
        for _, subscription in self._topics:
            subscription.destroy()

    def _changed(self, topic: Topic, state: bytes) -> Any | None:
        """Return the message of a state; None where it was read before, or is none."""
        if state == self._states.get(topic.name):
            return None
        self._states[topic.name] = state
        try:
            return deserialize_message(state, topic.kind)
        except _rclpy.RMWError:  # the bytes of a stranger may be anything
            return None

    def _pass_on(self, topic: Topic, whose: Iterable[str] | None, message: Any) -> None:
        readers = self.robots
        for name in readers if whose is None else readers.keys() & whose:
            readers[name]._passed_on.append((topic, message))

    def _is_due(self, topic: Topic) -> bool:
        now = time.monotonic()
        if now < self._next_reading.get(topic.name, 0.0):
            return False
        self._next_reading[topic.name] = now + topic.period
        return True
