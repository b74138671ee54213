"""State topics: latched, with one owner that repeats its word and answers whoever else speaks.

The owner (`OwnedTopic`) publishes each change, repeats its state about each second, answers every
foreign value with its own, and tells of a second publisher in an incident with that node's name.
A reader (`StateSubscription`) takes a new state once, refuses stamps ahead of its clock, and
believes the owner: see `publisher_trust`. Where the owner is another program
(map_server, a driver), which tells of nobody, the reader tells of a second publisher.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.timer import Timer

from surveillance_runtime.message_bounds import check_bytes
from surveillance_runtime.message_source import SOURCE
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import RUN_NODES
from surveillance_runtime.periods import every
from surveillance_runtime.publisher_trust import PublisherTrust
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.topic_names import asked_as

M = TypeVar('M')

REPEAT = 1.0
"""Seconds of real time after which an owner repeats a state that did not change."""
AHEAD, AHEAD_SIMULATED = 2.0, 60.0
"""A stamp that is further ahead of the reader's clock is refused, seconds. The reader hears
simulated time by another topic, which may be late."""
REMEMBERED = 32
"""Of how many of its last messages an owner knows that they are its own."""
FOREIGN_FOR = 10.0
"""How long the last foreign value counts as going on, seconds."""
TELL_AGAIN = 10.0
"""A reader tells of a stamp that it refuses at most once in this time, seconds."""
ANSWER_PERIOD = 0.05
"""An owner answers no faster, seconds: two owners would answer each other for ever."""
MOST_COMPARED = 16_384
"""Two values that are serialized longer than this are compared by their bytes, not field by field:
a path of 10,000 poses takes 130 ms of processor time to read."""
MOST_PADDING = 3
"""By so many bytes two serializations of one value may differ in length."""
UNNUMBERED = 0
"""The number of a message that the middleware did not number."""
NAMELESS = '_NODE_NAME_UNKNOWN_'
"""What the graph calls a node that it knows only endpoints of."""


def publishers_of(node: PatrolNode, topic: str) -> dict[bytes, str]:
    """Return the full names of the nodes that publish a topic, by the identity of the publisher.

    Args:
        node: Who asks.
        topic: Full name of the topic.
    """
    return {
        bytes(end.endpoint_gid): f'{end.node_namespace.rstrip("/")}/{end.node_name}'
        for end in node.get_publishers_info_by_topic(asked_as(node, topic))
    }


class OwnedTopic(Generic[M]):
    """A state topic of which a node is the owner; any thread may publish.

    Args:
        node: The owner.
        kind: Type of the messages.
        name: Of the topic.
        repeat: Seconds of real time between two repetitions; None: a state is published once, as
            where readers take each message for a change. Foreign values are answered all the same.
    """

    def __init__(
        self, node: PatrolNode, kind: type[M], name: str, *, repeat: float | None = REPEAT
    ) -> None:
        self._node = node
        self._kind = kind
        self.name = name
        self._publisher = node.create_publisher(kind, name, STATE_QOS)
        self._lock = threading.Lock()
        self._said: bytes | None = None
        self._count = 0
        self._own: deque[tuple[int, bytes]] = deque(maxlen=REMEMBERED)
        self._others: tuple[str, ...] = ()
        self._foreign_at = -FOREIGN_FOR
        self._answered_at = -ANSWER_PERIOD
        self._owes_answer = False
        self._told = ''
        node.create_subscription(kind, name, self._on_heard, STATE_QOS, raw=True)
        self._repeats = repeat is not None
        self._said_at = 0.0
        every(node, repeat or REPEAT, self._on_period)

    def publish(self, message: M) -> None:
        """Publish a state."""
        with self._lock:
            self._say(serialize_message(message))

    def _say(self, state: bytes) -> None:
        self._said, self._said_at = state, time.monotonic()
        self._count += 1
        self._own.append((self._count, state))
        self._publisher.publish(state)

    def _on_period(self) -> None:
        with self._lock:
            # A state that has just changed need not be said twice within a moment.
            old = time.monotonic() - self._said_at >= REPEAT / 2
            if self._said is not None and (self._owes_answer or (self._repeats and old)):
                self._owes_answer = False
                self._say(self._said)
        self._look_for_others()

    def _on_heard(self, heard: bytes, info: dict[str, Any]) -> None:
        number = info['publication_sequence_number']
        with self._lock:
            if any(heard == state and number in (count, UNNUMBERED) for count, state in self._own):
                return
            if self._is_said(heard):
                return
            now = self._foreign_at = time.monotonic()
            self._owes_answer = now - self._answered_at < ANSWER_PERIOD
            if self._said is not None and not self._owes_answer:
                self._answered_at = now
                self._say(self._said)
        self._look_for_others()

    def _is_said(self, heard: bytes) -> bool:
        """Return whether a message says what this owner said last.

        Bytes that differ may do so, for what is between the fields is undefined: short ones are
        read. The cost has a bound, however long a message is.
        """
        said = self._said
        if said is None or heard == said:
            return said is not None
        if len(heard) > MOST_COMPARED or abs(len(heard) - len(said)) > MOST_PADDING:
            return False
        return bool(deserialize_message(heard, self._kind) == deserialize_message(said, self._kind))

    def _look_for_others(self) -> None:
        """Tell of other publishers, until they have been gone for a while."""
        now = time.monotonic()
        foreign = now - self._foreign_at < FOREIGN_FOR
        if not foreign and not self._told and self._publisher_count() <= 1:
            return
        names = self._other_names()
        if names:
            self._others = names
        if not names and not foreign:
            self._others = ()
            if self._told:
                self._told = ''
                self._node.incidents.end(('topic', self.name))
            return
        who = ', '.join(self._others) or 'a node that has left'
        text = f'{self.name} is published by {who}, too: expected only {self._node.get_name()}'
        if text != self._told:
            self._told = text
            self._node.incidents.begin(('topic', self.name), text)

    def _publisher_count(self) -> int:
        return int(self._node.count_publishers(self.name))

    def _other_names(self) -> tuple[str, ...]:
        """Return the nodes that publish the topic beside this one."""
        names = sorted(publishers_of(self._node, self._publisher.topic_name).values())
        own = self._node.get_fully_qualified_name()
        if own in names:
            names.remove(own)
        return tuple(names)


class StateSubscription(Generic[M]):
    """What a node believes of a topic that another one owns: a state, or a sensor's stream.

    Args:
        node: The node that reads.
        kind: Type of the messages.
        name: Of the topic.
        take: Called with each new state, in the executor's thread.
        raw: Give `take` the bytes of a message.
        stamp: Returns the stamp of what `take` is given, seconds; None: it has none.
        each: Give every message of the owner, also one that repeats the state, as of a stream.
        qos: How it is heard, where the owner may be another program.
        owner: The node that owns the topic where it runs; empty: not known.
        only: Whether nobody else may, also where that node does not run.
    """

    def __init__(
        self,
        node: PatrolNode,
        kind: type[M],
        name: str,
        take: Callable[[Any], object],
        *,
        raw: bool = False,
        stamp: Callable[[Any], float] | None = None,
        each: bool = False,
        qos: QoSProfile = STATE_QOS,
        owner: str = '',
        only: bool = False,
    ) -> None:
        self._take = take
        self._raw = raw
        self._stamp = stamp
        self._each = each
        simulated = bool(node.get_parameter('use_sim_time').value)
        self._ahead = AHEAD_SIMULATED if simulated else AHEAD
        self._node = node
        self._kind = kind
        self._name = name
        if owner:
            owner = f'{node.get_namespace().rstrip("/")}/{owner}'
        self._trust = PublisherTrust(self._publishers, owner, only)
        self._told = ''
        self._refused_at = -math.inf
        self._timer: Timer | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._subscription = node.create_subscription(kind, name, self._on_heard, qos, raw=True)

    @property
    def publisher(self) -> bytes:
        """Identity of the publisher that is believed; empty: nobody, or not known."""
        return self._trust.publisher

    def _publishers(self) -> dict[bytes, str]:
        found = publishers_of(self._node, self._subscription.topic_name)
        return {each: '' if NAMELESS in name else name for each, name in found.items()}

    def _on_heard(self, heard: bytes, info: dict[str, Any]) -> None:
        try:
            check_bytes(heard, self._kind)
        except ValueError as error:
            raise ValueError(f'topic {self._name}: {error}') from None
        if self._is_refused(heard):
            return
        before = self._trust.value
        if self._trust.hear(heard, info.get(SOURCE, b''), time.monotonic()):
            self._believed(heard, before)
        elif (due := self._trust.due) is not None:
            self._wake_at(due)

    def _wake_at(self, due: float) -> None:
        period = max(1, int(1e9 * (due - time.monotonic())))
        if self._timer is None:
            self._timer = self._node.create_timer(1e-9 * period, self._on_due, clock=self._steady)
        elif self._timer.is_canceled():
            self._timer.timer_period_ns = period
            self._timer.reset()

    def _on_due(self) -> None:
        assert self._timer is not None
        self._timer.cancel()
        before = self._trust.value
        if self._trust.settle(time.monotonic()):
            assert self._trust.value is not None
            self._believed(self._trust.value, before)
        self._tell_of_rivals()
        if (due := self._trust.due) is not None:
            self._wake_at(due)

    def _tell_of_rivals(self) -> None:
        """Tell who else publishes the topic, where its owner is no node of the robot's own."""
        rivals, owner = ', '.join(self._trust.rivals), self._trust.node
        text = ''
        if rivals and owner and owner.rpartition('/')[2] not in RUN_NODES:
            text = f'{self._name} is published by {rivals}, too: {owner} is believed'
        if text == self._told:
            return
        self._told = text
        if text:
            self._node.incidents.begin(('topic', self._name), text)
        else:
            self._node.incidents.end(('topic', self._name))

    def _believed(self, heard: bytes, before: bytes | None) -> None:
        if self._each or heard != before:
            self._take(heard if self._raw else deserialize_message(heard, self._kind))

    def _is_refused(self, heard: bytes) -> bool:
        """Refuse a stamp that no clock has reached yet."""
        if self._stamp is None or heard == self._trust.value:
            return False
        message = heard if self._raw else deserialize_message(heard, self._kind)
        clock = self._node.get_clock().now().nanoseconds
        if self._ahead == AHEAD_SIMULATED and clock == 0:
            return False  # one that has just begun has not heard the time yet
        ahead = self._stamp(message) - 1e-9 * clock
        if ahead <= self._ahead:
            return False
        now = time.monotonic()
        if now - self._refused_at >= TELL_AGAIN:
            self._refused_at = now
            self._node.get_logger().error(
                f'{self._name}: a stamp {ahead:.1f} s ahead of this clock is refused; expected at '
                f'most {self._ahead:g} s'
            )
        return True
