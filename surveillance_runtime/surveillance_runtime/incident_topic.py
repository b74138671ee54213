"""The topic `incidents`, on which all nodes of a run tell of what goes wrong.

Each node publishes its own, reliable and latched. A late subscriber gets the last `DEPTH` messages
of each node; a node that has told of so much tells again of what goes on, so that nothing that is
open is ever older than that.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from strict_files.one_line import clean
from surveillance_interfaces.msg import Incident as IncidentMessage
from surveillance_interfaces.msg import IncidentFinding
from surveillance_runtime.conversions import seconds_of, stamp_from
from surveillance_runtime.incidents import (
    Cause,
    IncidentPhase,
    Incidents,
    IncidentUpdate,
    SeenThing,
    Severity,
)
from surveillance_runtime.message_source import SOURCE

if TYPE_CHECKING:
    from surveillance_runtime.node import PatrolNode

TOPIC = 'incidents'
DEPTH = 100
INCIDENTS_QOS = QoSProfile(
    depth=DEPTH,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
MOST_PICTURES = 10
"""Of one incident."""
_PHASES = {
    IncidentPhase.BEGIN: IncidentMessage.BEGIN,
    IncidentPhase.UPDATE: IncidentMessage.UPDATE,
    IncidentPhase.END: IncidentMessage.END,
}
_SEVERITIES = {Severity.WARNING: IncidentMessage.WARNING, Severity.ALARM: IncidentMessage.ALARM}
_PHASE_OF = {number: phase for phase, number in _PHASES.items()}
_SEVERITY_OF = {number: severity for severity, number in _SEVERITIES.items()}
_TEXTS = ('id', 'robot', 'node', 'text', 'place', 'action', 'acknowledged_by')


class IncidentPublisher:
    """Publishes the incidents of a node.

    Args:
        node: The node.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._publisher = node.create_publisher(IncidentMessage, TOPIC, INCIDENTS_QOS)
        self._lock = threading.Lock()
        self._since_all = 0

    def tell(self, told: IncidentUpdate, incidents: Incidents) -> None:
        """Publish what has happened, and now and then all that goes on.

        Args:
            told: What has happened.
            incidents: All of the node.
        """
        with self._lock:
            self.publish(told)
            self._since_all += 1
            going_on = incidents.updates()
            # Those that go on stand among the last messages, however many others there are.
            if self._since_all + len(going_on) >= DEPTH // 2 and len(going_on) < DEPTH // 2:
                self._since_all = 0
                for each in going_on:
                    self.publish(each)

    def publish(self, told: IncidentUpdate) -> None:
        """Publish what has happened."""
        now = self._node.get_clock().now().nanoseconds
        self._publisher.publish(message_from(told, 1e-9 * now))


def hear_incidents(
    node: PatrolNode, take: Callable[[IncidentUpdate, bytes], object], name: str = TOPIC
) -> None:
    """Listen to the incidents of all nodes.

    Args:
        node: Who listens.
        take: Called with each, and with the identity of its publisher, in the executor's thread.
        name: Of the topic.
    """

    def on_message(heard: bytes, info: dict[str, Any]) -> None:
        try:
            told = update_from(deserialize_message(heard, IncidentMessage))
        except ValueError as error:
            node.get_logger().warn(f'{name}: {error}', throttle_duration_sec=10.0)
            return
        take(told, info.get(SOURCE, b''))

    # Many nodes have told of something when one begins to listen.
    qos = QoSProfile(
        depth=10 * DEPTH,
        reliability=INCIDENTS_QOS.reliability,
        durability=INCIDENTS_QOS.durability,
    )
    node.create_subscription(IncidentMessage, name, on_message, qos, raw=True)


def message_from(told: IncidentUpdate, now: float) -> IncidentMessage:
    """Return an incident as a message; texts are one line each.

    Args:
        told: The incident.
        now: When it is told, seconds on the node's clock.
    """
    message = IncidentMessage(
        stamp=stamp_from(round(1e9 * now)),
        since=stamp_from(round(1e9 * told.since)),
        phase=_PHASES[told.phase],
        kind=clean(told.cause.kind),
        name=clean(told.cause.name),
        severity=_SEVERITIES[told.severity],
        evidence=[clean(each) for each in told.evidence[:MOST_PICTURES]],
        **{name: clean(getattr(told, name)) for name in _TEXTS},
    )
    if (seen := told.finding) is not None:
        x, y = seen.position or (0.0, 0.0)
        message.finding = [
            IncidentFinding(
                number=seen.number,
                kind=clean(seen.kind),
                seen=clean(seen.seen),
                subject=clean(seen.subject),
                has_position=seen.position is not None,
                x=float(x),
                y=float(y),
                confidence=float(seen.confidence),
                rule=clean(seen.rule),
            )
        ]
    return message


def update_from(message: IncidentMessage) -> IncidentUpdate:
    """Return what a message tells; its texts are one line each.

    Raises:
        ValueError: It has a phase or severity that there is not, or no cause.
    """
    try:
        phase, severity = _PHASE_OF[message.phase], _SEVERITY_OF[message.severity]
    except KeyError as error:
        raise ValueError(f'phase or severity {error}: expected one of Incident.msg') from None
    if not message.kind:
        raise ValueError('an incident without a kind: expected what it is about')
    seen = None
    if message.finding:
        found = message.finding[0]
        seen = SeenThing(
            found.number,
            clean(found.kind),
            clean(found.seen),
            clean(found.subject),
            (found.x, found.y) if found.has_position and math.isfinite(found.x + found.y) else None,
            found.confidence,
            clean(found.rule),
        )
    return IncidentUpdate(
        phase,
        Cause(clean(message.kind), clean(message.name)),
        severity,
        since=seconds_of(message.since),
        evidence=tuple(clean(each) for each in message.evidence[:MOST_PICTURES]),
        finding=seen,
        **{name: clean(getattr(message, name)) for name in _TEXTS},
    )
