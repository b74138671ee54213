"""Looks at the ROS graph for what a robot's drivers say: endpoints, rates, frames, stamps."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib import import_module
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.check_up import (
    Endpoint,
    ExpectedTopic,
    GraphSample,
    TopicSample,
    findings,
)
from surveillance_runtime.qos import SENSOR_QOS

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None


def endpoints_of(node: Node, topics: Iterable[str] | None = None) -> GraphSample:
    """Return who publishes and who subscribes what, without what the node itself does.

    Args:
        node: Who looks.
        topics: The topics; None: all that there are.
    """
    publishers: dict[str, list[Endpoint]] = {}
    subscribers: dict[str, list[Endpoint]] = {}
    if topics is None:
        topics = [topic for topic, _ in node.get_topic_names_and_types()]
    for topic in topics:
        for found, infos in (
            (publishers, node.get_publishers_info_by_topic(topic)),
            (subscribers, node.get_subscriptions_info_by_topic(topic)),
        ):
            ends = [_endpoint(info) for info in infos if info.node_name != node.get_name()]
            if ends:
                found[topic] = ends
    return GraphSample(publishers, subscribers)


def _endpoint(info: Any) -> Endpoint:
    quality = info.qos_profile
    name = f'{info.node_namespace.rstrip("/")}/{info.node_name}'
    return Endpoint(
        # The graph knows endpoints before it knows whose they are.
        'a node whose name is not known yet' if '_UNKNOWN_' in name else name,
        info.topic_type.replace('/msg/', '/'),
        quality.reliability == ReliabilityPolicy.RELIABLE,
        quality.durability == DurabilityPolicy.TRANSIENT_LOCAL,
    )


def type_clashes(seen: GraphSample) -> dict[str, str]:
    """Return each topic that has more than one type, with who has which, in words.

    An action's topics are among them: two servers of one name and different types.
    """
    found = {}
    for topic in {*seen.publishers, *seen.subscribers}:
        owners: dict[str, set[str]] = {}
        for end in (*seen.publishers.get(topic, ()), *seen.subscribers.get(topic, ())):
            owners.setdefault(end.type, set()).add(end.node)
        if len(owners) > 1:
            said = [f'{kind} of {", ".join(sorted(owners[kind]))}' for kind in sorted(owners)]
            found[topic] = (
                f'{topic} has more than one type: {"; ".join(said)}: expected one; give one of '
                'them another name or namespace (dock.navigator: nav2 in the profile does it for '
                "Nav2's names)"
            )
    return found


class Listener:
    """Listens to what is awaited, as its publishers offer it.

    Args:
        node: The node that listens; spun by somebody.
        wanted: The topics.
    """

    def __init__(self, node: Node, wanted: Iterable[ExpectedTopic]) -> None:
        self._node = node
        self._wanted = [each for each in wanted if each.heard]
        self._subscriptions: dict[str, Subscription] = {}
        self._times: dict[str, list[float]] = {}
        self._last: dict[str, tuple[str, float | None]] = {}
        self._parents: dict[str, str] = {}
        if TFMessage is not None:
            latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            node.create_subscription(TFMessage, 'tf_static', self._on_static, latched)

    def look(self) -> GraphSample:
        """Subscribe what is published by now; return what is there and what came so far."""
        seen = endpoints_of(self._node)
        for each in self._wanted:
            ends = seen.publishers.get(each.topic, ())
            right = [end for end in ends if end.type == each.type]
            if right and each.topic not in self._subscriptions:
                package, _, name = each.type.partition('/')
                kind = getattr(import_module(f'{package}.msg'), name)
                quality = SENSOR_QOS
                if each.is_latched and all(end.latched for end in right):
                    quality = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
                self._subscriptions[each.topic] = self._node.create_subscription(
                    kind, each.topic, partial(self._hear, each.topic), quality
                )
        return GraphSample(seen.publishers, seen.subscribers, self._heard(), self._parents)

    def _on_static(self, message: Any) -> None:
        for each in message.transforms:
            child, parent = each.child_frame_id, each.header.frame_id
            self._parents[child.removeprefix('/')] = parent.removeprefix('/')

    def _hear(self, topic: str, message: Any) -> None:
        self._times.setdefault(topic, []).append(time.monotonic())
        header = getattr(message, 'header', None)
        if header is not None:
            stamp = seconds_of(header.stamp)
            now = self._node.get_clock().now().nanoseconds / 1e9
            self._last[topic] = header.frame_id, now - stamp if stamp else None

    def _heard(self) -> dict[str, TopicSample]:
        found = {}
        for topic, times in self._times.items():
            passed = times[-1] - times[0]
            frame, age = self._last.get(topic, ('', None))
            rate = (len(times) - 1) / passed if passed > 0 else 0.0
            found[topic] = TopicSample(len(times), rate, frame, age)
        return found


LOOK_PERIOD = 2.0
"""Seconds of real time between two looks for what is missing."""
PATIENCE = 3.9
"""What has not come after this is missing, seconds: it is told with the second look."""


class InputWatch:
    """Tells what a node waits for, in the words of `doctor`, as incidents that end when it comes.

    Args:
        node: The node.
        wanted: What it may wait for.
        missing: Returns which of their topics it waits for now.
        refused: Returns why what comes on one of them is of no use; empty: nothing comes.
    """

    def __init__(
        self,
        node: PatrolNode,
        wanted: Sequence[ExpectedTopic],
        missing: Callable[[], Iterable[str]],
        refused: Callable[[str], str] = lambda _topic: '',
    ) -> None:
        self._node = node
        self._wanted = {each.topic: each for each in wanted}
        self._missing = missing
        self._refused = refused
        self._since = {each.topic: time.monotonic() for each in wanted}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self._look, clock=steady)

    def _look(self) -> None:
        now, missing = time.monotonic(), set(self._missing())
        for topic in self._wanted.keys() - missing:
            self._since[topic] = now
            self._node.incidents.end(('robot', topic), f'{topic}: it is as awaited')
        late = [topic for topic in missing if now - self._since[topic] >= PATIENCE]
        if not late:
            return
        seen = endpoints_of(self._node)
        for topic in late:
            if why := self._refused(topic):
                lines = [f'{topic}: what comes is of no use: {why}']
            else:
                lines = list(findings(self._wanted[topic], seen, now - self._since[topic]))
            if lines:
                self._node.incidents.begin(('robot', topic), '; '.join(lines), Severity.ALARM)
