"""Preempting a machine when ROS goes down."""

from __future__ import annotations

from rclpy.node import Node

from surveillance_fsm.active import ActiveContainer


def set_preempt_handler(node: Node, container: ActiveContainer, timeout: float = 5.0) -> None:
    """Preempt a container when the node stops or its ROS context shuts down.

    Args:
        node: The node whose end counts.
        container: A root.
        timeout: How long a shutdown of the context is held up for the container to end, seconds of
            steady time.
    """

    def ended() -> None:
        container.request_preempt()
        with container.control.condition:
            container.control.condition.wait_for(lambda: not container.is_running(), timeout)

    stopping = getattr(node, 'stopping', None)
    if stopping is not None:
        # The executor still spins then, and brings what the states wait for: no need to block.
        stopping.subscribe(container.request_preempt)
    node.context.on_shutdown(ended)
