"""The topic `fleet_robots`, on which the robots of a fleet tell each other their facts.

All robots publish on one topic, so a message names the robot that it is of. What a robot does is
told by a node in its own namespace alone: whoever else speaks for it is not believed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from surveillance_interfaces.msg import FleetRobot
from surveillance_runtime.incidents import Severity
from surveillance_runtime.message_source import SOURCE
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import NAMELESS, publishers_of

FLEET_TOPIC = 'fleet_robots'
FLEET_QOS = QoSProfile(
    depth=200,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
"""Not latched: what a robot said last is repeated each second, and a late joiner soon hears it."""
PATIENCE = 0.1
"""Seconds between two looks at the graph for publishers that are not known."""
MOST_TOLD = 100
"""Of how many nodes that speak for a robot of another namespace the log tells."""


class RobotSpeakers:
    """Tells whether a publisher may speak for a robot.

    Args:
        graph: Returns the full name of the node of each publisher by its identity; empty where the
            middleware does not know the name yet.
        above: The namespace that the robots share, without a slash at its end.
    """

    def __init__(self, graph: Callable[[], Mapping[bytes, str]], above: str) -> None:
        self._graph = graph
        self._above = above
        self._nodes: Mapping[bytes, str] = {}
        self._looked_at = float('-inf')

    def stranger(self, robot: str, publisher: bytes, now: float) -> str | None:
        """Return who speaks for a robot that is not its own; None: it may be believed.

        Args:
            robot: The robot's name.
            publisher: Identity of the publisher; empty where the middleware does not tell.
            now: Steady time, seconds.

        Returns:
            The full name of the node, or words for one whose name is not known.
        """
        if not publisher:
            return None
        node = self._nodes.get(publisher, '')
        if not node and now - self._looked_at >= PATIENCE:
            self._looked_at = now
            self._nodes = self._graph()
            node = self._nodes.get(publisher, '')
        own = f'{self._above}/{robot}/'
        if node:
            return None if node.startswith(own) and '/' not in node[len(own) :] else node
        # Names travel behind the first messages: one that nobody contradicts is believed.
        is_told = any(each.startswith(own) for each in self._nodes.values())
        return 'a node without a name' if is_told else None


SPEAKS_FOR = 5.0
"""Seconds for which a publisher counts that has spoken: robots repeat their facts each second."""
SPEAKER_CAUSE = 'robot', 'second speaker'


class OwnVoices:
    """Tells whether somebody else speaks as a robot, which hears itself among all others.

    A node that has taken the full name of another one is believed by the fleet; the robot itself
    hears two publishers with its own words, and knows.
    """

    def __init__(self) -> None:
        self._last: dict[bytes, float] = {}

    def hear(self, publisher: bytes, now: float) -> tuple[bytes, ...]:
        """Return the publishers that speak as this robot; more than one: somebody poses as it.

        Args:
            publisher: Who has just spoken as this robot.
            now: Steady time, seconds.
        """
        self._last[publisher] = now
        self._last = {each: at for each, at in self._last.items() if now - at < SPEAKS_FOR}
        return tuple(self._last)


def hear_fleet(
    node: PatrolNode,
    take: Callable[[FleetRobot], object],
    depth: int = FLEET_QOS.depth,
    own: str = '',
) -> None:
    """Listen to what the robots of a fleet say of themselves.

    Args:
        node: A node of one robot of the fleet.
        take: Called with each message, in the executor's thread.
        depth: How many messages may wait.
        own: The robot whose node it is: who else speaks as it is an incident; empty: of none.
    """

    def look() -> dict[bytes, str]:
        found = publishers_of(node, subscription.topic_name)
        return {each: '' if NAMELESS in name else name for each, name in found.items()}

    speakers = RobotSpeakers(look, node.get_namespace().rstrip('/').rpartition('/')[0])
    told: set[tuple[str, str]] = set()
    voices = OwnVoices()

    def look_for_second(publisher: bytes) -> None:
        found = voices.hear(publisher, time.monotonic())
        if len(found) > 1:
            named = look()
            who = ', '.join(
                f'{named.get(each) or "a node without a name"} (participant {each[:12].hex()})'
                for each in sorted(found)
            )
            text = (
                f'{len(found)} nodes speak as {own} on {FLEET_TOPIC}: {who}; one is not this robot'
            )
            node.incidents.begin(SPEAKER_CAUSE, text, Severity.ALARM)
        else:
            node.incidents.end(SPEAKER_CAUSE, f'nobody else speaks as {own}')

    def on_message(heard: bytes, info: dict[str, Any]) -> None:
        message = deserialize_message(heard, FleetRobot)
        who = speakers.stranger(message.robot, info.get(SOURCE, b''), time.monotonic())
        if who is None:
            if own and message.robot == own:
                look_for_second(info.get(SOURCE, b''))
            take(message)
        elif (who, message.robot) not in told and len(told) < MOST_TOLD:
            told.add((who, message.robot))
            node.get_logger().error(
                f'{FLEET_TOPIC}: {who} speaks for {message.robot[:40]!r}, which is not believed: '
                f'expected a node in the namespace of that robot'
            )

    qos = QoSProfile(
        depth=depth, reliability=FLEET_QOS.reliability, durability=FLEET_QOS.durability
    )
    subscription = node.create_subscription(FleetRobot, FLEET_TOPIC, on_message, qos, raw=True)
