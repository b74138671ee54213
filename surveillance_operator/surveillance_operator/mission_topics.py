"""What a watcher hears: the mission's topics, each taken into a snapshot as it comes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, qos_policy_name_from_kind
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Bool, UInt8

from surveillance_behaviour.conversions import decision_from
from surveillance_interfaces.action import Control, FollowPath
from surveillance_interfaces.msg import Decision, DoorStates, MissionStatus
from surveillance_operator import conversions
from surveillance_operator.map_raster import Pose
from surveillance_operator.snapshot import NO_POINTS, Snapshot
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.point_clouds import points_from_cloud
from surveillance_runtime.qos import STATE_QOS

TRAIL_STEP, TRAIL_POINTS = 0.05, 3000
"""Least distance of two points of the trail, metres, and how many are kept."""

Update = Callable[[Callable[[Snapshot], Snapshot]], None]


class RosMissionTopics:
    """Subscribes to all that is drawn.

    Args:
        node: The node that watches.
        update: Takes a function from the old snapshot to the new one.
    """

    def __init__(self, node: PatrolNode, update: Update) -> None:
        self._node = node
        self._update = update
        self._topics: list[str] = []
        self._listen(MissionStatus, 'mission_status', self._on_status)
        self._listen(Decision, 'decision', self._on_decision)
        self._listen(UInt8, 'battery_level', lambda m, old: {'battery': float(m.data)})
        self._listen(Bool, 'state/battery_low', lambda m, old: {'battery_low': m.data})
        self._listen(OccupancyGrid, 'map', self._on_map)
        self._listen(DoorStates, 'door_states', lambda m, old: {'doors': conversions.doors_from(m)})
        self._listen(PointCloud2, 'obstacles', lambda m, old: {'obstacles': points_from_cloud(m)})
        self._listen(PoseWithCovarianceStamped, 'amcl_pose', self._on_pose)
        # Where nobody estimates the pose, what moves the robot tells how far it is.
        feedback = FollowPath.Impl.FeedbackMessage, 'follow_path/_action/feedback'
        self._listen(*feedback, lambda m, old: self._fed_back(m.feedback.position, old), 1)
        feedback = Control.Impl.FeedbackMessage, 'motion/controller/_action/feedback'
        self._listen(*feedback, lambda m, old: self._fed_back(m.feedback.reached_point, old), 1)

    def publishers(self) -> frozenset[str]:
        """The nodes that there are now behind the topics."""
        return frozenset(
            info.node_name
            for topic in self._topics
            for info in self._node.get_publishers_info_by_topic(topic)
            if not info.node_name.startswith('_')
        )

    def _listen(
        self,
        kind: Any,
        topic: str,
        read: Callable[[Any, Snapshot], dict[str, Any]],
        qos: QoSProfile | int = STATE_QOS,
    ) -> None:
        """Takes what messages say into the snapshot, or why they cannot be used."""

        def take(message: Any) -> Callable[[Snapshot], Snapshot]:
            def taken(old: Snapshot) -> Snapshot:
                try:
                    return replace(old, **read(message, old))
                except ValueError as error:
                    return replace(old, silent={**old.silent, topic: str(error)})

            return taken

        def mismatched(event: Any) -> None:
            policy = qos_policy_name_from_kind(event.last_policy_kind)
            reason = f'its publisher offers another {policy}'
            self._update(lambda old: replace(old, silent={**old.silent, topic: reason}))

        self._topics.append(topic)
        self._node.create_subscription(
            kind,
            topic,
            lambda message: self._update(take(message)),
            qos,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=mismatched, use_default_callbacks=False
            ),
        )

    def _on_status(self, message: MissionStatus, _old: Snapshot) -> dict[str, Any]:
        return {'status': conversions.status_from(message)}

    def _on_decision(self, message: Decision, _old: Snapshot) -> dict[str, Any]:
        return {'decision': decision_from(message), 'number': message.sequence}

    def _on_map(self, message: OccupancyGrid, _old: Snapshot) -> dict[str, Any]:
        return {'grid': conversions.grid_from(message), 'trail': NO_POINTS}

    def _on_pose(self, message: PoseWithCovarianceStamped, old: Snapshot) -> dict[str, Any]:
        return _moved(conversions.pose_from(message.pose.pose), old)

    def _fed_back(self, position: Point, old: Snapshot) -> dict[str, Any]:
        if self._node.count_publishers('amcl_pose') and old.mode not in ('RANDOM', 'MANUAL'):
            return {}
        x, y, yaw = position.x, position.y, 0.0
        if old.pose is not None:
            dx, dy = x - old.pose[0], y - old.pose[1]
            yaw = math.atan2(dy, dx) if dx or dy else old.pose[2]
        return _moved((x, y, yaw), old)


def _moved(pose: Pose, old: Snapshot) -> dict[str, Any]:
    trail = old.trail
    if not len(trail) or math.dist(trail[-1], pose[:2]) >= TRAIL_STEP:
        trail = np.vstack([trail[-TRAIL_POINTS:], pose[:2]])
    return {'pose': pose, 'trail': trail}
