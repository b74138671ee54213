"""The topic `place`: what a place's file says now, after it was changed during a mission.

Its owner is the map builder, which takes another place by the service `ontology_map/set_place` and
checks it. Nothing is on the topic until somebody changes the place: until then the parameters hold.
The message is the place's parameters as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from std_msgs.msg import String

from strict_files.regular_files import parse_json
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

TOPIC = 'place'
OWNER = 'ontology_map_builder'
LONGEST = 10_000_000
"""Characters of the longest description that is read."""


def description_text(described: Mapping[str, Any]) -> str:
    """Return a place's parameters as they are sent."""
    return json.dumps(described, separators=(',', ':'))


def described_in_text(text: str) -> dict[str, Any]:
    """Return the parameters in a text that came.

    Raises:
        ValueError: It is no JSON object, or too long.
    """
    if len(text) > LONGEST:
        raise ValueError(f'{len(text)} characters: expected at most {LONGEST}')
    found = parse_json(text.encode())
    if not isinstance(found, dict):
        raise ValueError('expected a JSON object')
    return found


def follow_place(node: PatrolNode, take: Callable[[dict[str, Any]], object]) -> None:
    """Have a function take the place's parameters whenever they have changed.

    Args:
        node: The node that reads.
        take: Called in the executor's thread; what it raises as a `ValueError` is logged.
    """

    def on_place(message: String) -> None:
        try:
            take(described_in_text(message.data))
        except ValueError as error:
            node.get_logger().error(f'topic {TOPIC}: {error}')

    StateSubscription(node, String, TOPIC, on_place, owner=OWNER)
