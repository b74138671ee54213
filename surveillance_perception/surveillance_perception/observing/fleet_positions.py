"""Where the other robots of a fleet are: each one's `amcl_pose`, once its name was heard."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

from geometry_msgs.msg import PoseWithCovarianceStamped

from surveillance_interfaces.msg import FleetRobot
from surveillance_runtime.conversions import pose_of_serialized, stamp_of_serialized
from surveillance_runtime.fleet_messages import hear_fleet
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.state_topics import StateSubscription

MOST_HEARD = 20
"""Depth of the queue of what the fleet tells."""
MOST_PEERS = 100
_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*\Z', re.ASCII)


class FleetPositions:
    """Hears the other robots; in the executor's thread. A robot that is alone hears nothing.

    Args:
        node: The node that hears.
        robot: Its own robot's name.
        hear: Called with a robot's name, where it is, map frame, metres, and the stamp, seconds.
    """

    def __init__(
        self, node: PatrolNode, robot: str, hear: Callable[[str, float, float, float], object]
    ) -> None:
        self._node, self._robot, self._hear = node, robot, hear
        self._peers: dict[str, StateSubscription[PoseWithCovarianceStamped]] = {}
        hear_fleet(node, self._on_fleet, MOST_HEARD)

    def _on_fleet(self, message: FleetRobot) -> None:
        """Hear from now on where another robot of the fleet is."""
        name = message.robot
        if name == self._robot or name in self._peers or len(self._peers) >= MOST_PEERS:
            return
        above = self._node.get_namespace().rstrip('/').rpartition('/')[0]
        if not _NAME.match(name):
            self._node.get_logger().error(
                f'fleet_robots: {name[:40]!r} is no name of a robot', throttle_duration_sec=60.0
            )
            return
        self._peers[name] = StateSubscription(
            self._node,
            PoseWithCovarianceStamped,
            f'{above}/{name}/amcl_pose',
            partial(self._on_pose, name),
            raw=True,
        )

    def _on_pose(self, name: str, serialized: bytes) -> None:
        with refusing(self._node, f'{name}/amcl_pose'):
            x, y, _ = pose_of_serialized(serialized)
            self._hear(name, x, y, stamp_of_serialized(serialized))
