"""Full names of topics where a run renames some for all its nodes alike.

rclpy renames a full name again: who asks for `/cmd_vel`, which a run calls `/cmd_vel_wanted`, is
answered about that one. What the base hears is asked for by the name that leads to it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

BASE_COMMAND = 'cmd_vel_monitored'
"""What the base hears, before a run's remappings."""


def asked_as(node: Node, topic: str) -> str:
    """Return the name by which a node asks for a topic, or subscribes to it.

    Args:
        node: Who asks.
        topic: The topic's full name, as the graph tells it.
    """
    for name in (topic, BASE_COMMAND):
        if node.resolve_topic_name(name) == topic:
            return name
    return topic
