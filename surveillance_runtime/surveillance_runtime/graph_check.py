"""Looks at the ROS graph for what a robot's drivers say: endpoints, rates, frames, stamps."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from sensor_msgs.msg import BatteryState, CameraInfo, Image, LaserScan

from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.periods import every
from surveillance_runtime.profile.check_up import (
    BASE_FRAMES,
    NAMELESS,
    Endpoint,
    ExpectedTopic,
    GraphSample,
    TopicSample,
    findings,
)
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.conversions import matrix_from
from surveillance_runtime.sensing.frame_tree import FrameLink, FrameTree, plain
from surveillance_runtime.topic_names import asked_as

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
        name = asked_as(node, topic)
        for found, infos in (
            (publishers, node.get_publishers_info_by_topic(name)),
            (subscribers, node.get_subscriptions_info_by_topic(name)),
        ):
            ends = [_endpoint(info) for info in infos if info.node_name != node.get_name()]
            if ends:
                found[topic] = ends
    return GraphSample(publishers, subscribers)


def _endpoint(info: Any) -> Endpoint:
    quality = info.qos_profile
    name = f'{info.node_namespace.rstrip("/")}/{info.node_name}'
    return Endpoint(
        NAMELESS if '_UNKNOWN_' in name else name,
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
        within: What a lidar sees nearer than this is its own robot, metres.
    """

    def __init__(self, node: Node, wanted: Iterable[ExpectedTopic], *, within: float = 0.0) -> None:
        self._node = node
        self._wanted = [each for each in wanted if each.heard]
        self._within = within
        self._subscriptions: dict[str, Subscription] = {}
        self._samples: dict[str, TopicListening] = {}
        self._fixed, self._moving = FrameTree(), FrameTree()
        if TFMessage is not None:
            latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            take = self._on_transforms
            node.create_subscription(TFMessage, 'tf_static', partial(take, self._fixed), latched)
            node.create_subscription(TFMessage, 'tf', partial(take, self._moving), 100)

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
                sample = self._samples[each.topic] = TopicListening(self._node, self._within)
                self._subscriptions[each.topic] = self._node.create_subscription(
                    kind, each.topic, sample.hear, quality
                )
        fixed = self._fixed.links
        doubled = (*self._fixed.doubled.values(), *self._moving.doubled.values())
        return replace(
            seen,
            heard={topic: each.sample() for topic, each in self._samples.items() if each.count},
            parents={child: link.parent for child, link in fixed.items()},
            moving={child: link.parent for child, link in self._moving.links.items()},
            places={child: place for child in fixed if (place := self._place(child)) is not None},
            doubled=doubled,
            clashes=tuple(type_clashes(seen).values()),
            has_clock=bool(seen.publishers.get('/clock')),
        )

    def _place(self, frame: str) -> tuple[float, float, float, bool] | None:
        found = self._fixed.matrix(frame, lambda at: at.rpartition('/')[2] in BASE_FRAMES)
        if found is None:
            return None
        matrix = found[0]
        yaw = math.atan2(matrix[1, 0], matrix[0, 0])
        return float(matrix[0, 3]), float(matrix[1, 3]), yaw, bool(matrix[2, 2] < 0.0)

    def _on_transforms(self, tree: FrameTree, message: Any) -> None:
        for each in message.transforms:
            try:
                matrix = matrix_from(each.transform)
            except ValueError:
                continue
            tree.take(each.child_frame_id, FrameLink(plain(each.header.frame_id), matrix))


class TopicListening:
    """What comes on one topic.

    Args:
        node: The node that listens, for its clock.
        within: What a lidar sees nearer than this is its own robot, metres.

    Attributes:
        count: How many messages came.
        last: The last one.
    """

    def __init__(self, node: Node, within: float) -> None:
        self._node, self._within = node, within
        self._times: list[float] = []
        self._ages: list[float] = []
        self._percentages: list[float] = []
        self._is_unstamped = False
        self._jump = 0.0
        self._repeats = 0
        self.count = 0
        self.last: Any = None

    def hear(self, message: Any) -> None:
        """Take a message."""
        before, self.last = self.last, message
        self.count += 1
        self._times.append(time.monotonic())
        header = getattr(message, 'header', None)
        if header is not None:
            stamp = seconds_of(header.stamp)
            now = self._node.get_clock().now().nanoseconds / 1e9
            self._is_unstamped = not stamp
            if stamp:
                self._ages.append(now - stamp)
        if isinstance(message, BatteryState):
            self._percentages.append(message.percentage)
        elif isinstance(message, Odometry) and before is not None:
            a, b = before.pose.pose.position, message.pose.pose.position
            self._jump = max(self._jump, math.hypot(b.x - a.x, b.y - a.y))
        elif isinstance(message, LaserScan) and before is not None:
            self._repeats = self._repeats + 1 if message.ranges == before.ranges else 0

    def sample(self) -> TopicSample:
        """Return what came so far."""
        passed = self._times[-1] - self._times[0]
        rate = (len(self._times) - 1) / passed if passed > 0 else 0.0
        header = getattr(self.last, 'header', None)
        age = sorted(self._ages)[len(self._ages) // 2] if self._ages else None
        frame = '' if header is None else header.frame_id
        return TopicSample(self.count, rate, frame, age, self._values())

    def _values(self) -> dict[str, Any]:
        message = self.last
        values: dict[str, Any] = {'unstamped': self._is_unstamped}
        if isinstance(message, Odometry):
            values['child'] = message.child_frame_id
            values['jumps'] = self._jump if self._jump > 0.3 else 0.0
        elif isinstance(message, LaserScan) and message.ranges:
            ranges = np.frombuffer(message.ranges, dtype=np.float32)
            values['told'] = float((ranges > 0.0).mean())
            values['near'] = float(((ranges > 0.0) & (ranges < self._within)).mean())
            values['frozen'] = self._repeats >= 5
        elif isinstance(message, BatteryState):
            values['percentages'] = tuple(self._percentages)
            values['voltage'] = message.voltage
            values['cells'] = len(message.cell_voltage)
        elif isinstance(message, CameraInfo):
            values['focal'] = float(message.k[0])
            values['size'] = f'{message.width} x {message.height}'
        elif isinstance(message, Image):
            values['size'] = f'{message.width} x {message.height}'
        return values


LOOK_PERIOD = 2.0
"""Seconds of real time between two looks for what is missing."""
PATIENCE = 3.9
"""What has not come after this is missing, seconds: it is told with the third look."""
MOST_COUNTED = 1.1 * LOOK_PERIOD
"""Of the time between two looks at most this counts, seconds: in the rest nobody spun the node."""


class InputWatch:
    """Tells what a node waits for, in the words of `doctor`, as incidents that end when it comes.

    Only time in which the node could hear counts: from the first look on, without what an executor
    stood still in.

    Args:
        node: The node.
        wanted: What it may wait for.
        missing: Returns which of their topics it waits for now.
        refused: Returns why what comes on one of them is of no use; empty: nothing comes.
        now: Returns the steady time, seconds.
    """

    def __init__(
        self,
        node: PatrolNode,
        wanted: Sequence[ExpectedTopic],
        missing: Callable[[], Iterable[str]],
        refused: Callable[[str], str] = lambda _topic: '',
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._node = node
        self._wanted = {each.topic: each for each in wanted}
        self._missing = missing
        self._refused = refused
        self._now = now
        self._silent = {each.topic: 0.0 for each in wanted}
        self._looked_at = math.inf
        every(node, LOOK_PERIOD, self._look)

    def _look(self) -> None:
        now, missing = self._now(), set(self._missing())
        listened = min(max(0.0, now - self._looked_at), MOST_COUNTED)
        self._looked_at = now
        for topic in self._wanted.keys() - missing:
            self._silent[topic] = 0.0
            self._node.incidents.end(('robot', topic), f'{topic}: it is as awaited')
        for topic in missing:
            self._silent[topic] += listened
        late = [topic for topic in missing if self._silent[topic] >= PATIENCE]
        if not late:
            return
        seen = endpoints_of(self._node)
        for topic in late:
            if why := self._refused(topic):
                lines = [f'{topic}: what comes is of no use: {why}']
            else:
                # For how long by now is no news: each other text would be told anew.
                lines = list(findings(self._wanted[topic], seen, round(PATIENCE)))
            if lines:
                self._node.incidents.begin(('robot', topic), '; '.join(lines), Severity.ALARM)
