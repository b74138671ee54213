"""Tells on `door_states` which doors the robot has seen shut, where nobody else tells it."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping

from floor_plans.shapes import Segment
from lidar_navigation.geometry import Pose, Scan
from surveillance_controllers.motion.door_sight import DoorSight
from surveillance_interfaces.msg import DoorStates, MissionStatus
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import OwnedTopic

TOPIC = 'door_states'
LOOK_PERIOD = 2.0
"""Seconds between two looks whether another node tells the states, as contacts do."""


class DoorTeller:
    """Reads doors while nobody else tells their states; one thread.

    Args:
        node: Who tells.
        doors: Their openings by name, map frame, metres.
    """

    def __init__(self, node: PatrolNode, doors: Mapping[str, Segment]) -> None:
        self._node = node
        self._sight = DoorSight(doors)
        self._told: OwnedTopic[DoorStates] | None = None
        self._others_tell, self._look_at = False, -math.inf

    @property
    def tells(self) -> bool:
        """Whether this node tells the states."""
        return self._told is not None

    def take_doors(self, doors: Mapping[str, Segment]) -> None:
        """Take where the doors are now."""
        self._sight.take_doors(doors)

    def take_mission(self, message: MissionStatus) -> None:
        """Take whether nothing that the robot tried worked."""
        self._sight.nothing_else = message.waiting_for_help

    def see(self, pose: Pose, scan: Scan, now: float) -> None:
        """Take a scan made at a pose that is to be trusted, see `DoorSight.see`."""
        # Reading the doors is an eighth of the work of driving.
        if self._told is None and self._do_others_tell():
            return
        before = self._sight.shut
        if not self._sight.see(pose, scan, now):
            return
        if self._told is None:
            self._told = OwnedTopic(self._node, DoorStates, TOPIC)
        shut = self._sight.shut
        for door in sorted(shut ^ before):
            words = 'is seen shut' if door in shut else 'is no longer taken for shut'
            self._node.get_logger().info(f'door {door} {words}')
        self._told.publish(DoorStates(open=sorted(self._sight.doors - shut), closed=sorted(shut)))

    def _do_others_tell(self) -> bool:
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + LOOK_PERIOD
            self._others_tell = self._node.count_publishers(TOPIC) > 0
        return self._others_tell
