"""What each topic tells of a mission: from its messages to the fields of a snapshot.

A running mission (`mission_feed`) and a recording (`recording.stored`) are read by the same
table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, LaserScan, PointCloud2
from std_msgs.msg import Bool, String, UInt8

from surveillance_behaviour.conversions import decision_from
from surveillance_interfaces.action import Control, FollowPath, ScanSurroundings
from surveillance_interfaces.msg import (
    Decision,
    DoorStates,
    FsmStatus,
    FsmStructure,
    FsmTransition,
    MarkerDetectionArray,
    MissionStatus,
)
from surveillance_ontology.armor.facts import ShortFact, parse_fact
from surveillance_ontology.armor_client import value_in
from surveillance_ontology.patrol_ontology import CONNECTIONS, URGENT_PLACES, VISITS
from surveillance_operator import conversions
from surveillance_operator.conversions import MOST_NAMES
from surveillance_operator.snapshot import NO_POINTS, TRAIL_STEP, Pose, Snapshot
from surveillance_runtime.conversions import pose_from, seconds_of
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.robot_arm import ARM

TRAIL_POINTS = 1000
"""How many points of the trail are kept."""
KEPT_TRANSITIONS = 60
SAME_MOMENT = 0.03
"""Most seconds between the stamps of a pose and a scan that belong together."""
SAME_VIEW = 0.8
"""Most seconds between the stamps of an image and of the arm's joints, which stand still."""
STILL = 0.01
"""Metres and radians within which the robot counts as standing still between two poses."""

POSE_TOPIC = 'amcl_pose'
DETECTIONS_TOPIC = 'aruco_detector/detections'
BEHAVIOUR = 'robot_behavior'
FSM = f'{BEHAVIOUR}/fsm'
CONTROLLERS = ('battery_controller', 'planner_controller', 'motion_controller')

_QUEUE = QoSProfile(
    depth=200, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_STREAM = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_NEWEST = QoSProfile(depth=1)
_MANY = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)

Fields = dict[str, Any]


class Topic(NamedTuple):
    """One topic that a snapshot takes from.

    Attributes:
        name: Relative to the namespace, or absolute.
        kind: The type of its messages.
        read: The snapshot's fields that a message changes; raises `ValueError` for one that cannot
            be used.
        qos: How it is heard.
        stream: Whether a view may do without it.
        beside: Taken only together with a message of this topic, and read before it.
        period: Least time between two looks at it, seconds.
    """

    name: str
    kind: Any
    read: Callable[[Any, Snapshot], Fields]
    qos: QoSProfile = STATE_QOS
    stream: bool = False
    beside: str = ''
    period: float = 0.0


def read_message(snapshot: Snapshot, topic: Topic, message: Any) -> Snapshot:
    """Return the snapshot with what a message says, or why it cannot be used."""
    try:
        fields = topic.read(message, snapshot)
    except (ValueError, TypeError, OverflowError) as error:
        return replace(snapshot, silent={**snapshot.silent, topic.name: str(error)})
    return replace(snapshot, **fields) if fields else snapshot


def moved(pose: Pose, old: Snapshot) -> Fields:
    """Return the fields that a new pose changes: the pose, and the trail."""
    trail = old.trail
    if not len(trail) or math.dist(trail[-1], pose[:2]) >= TRAIL_STEP:
        trail = np.vstack([trail[1 - TRAIL_POINTS :], pose[:2]])
    return {'pose': pose, 'trail': trail}


def _fed_back(point: Any, old: Snapshot) -> Fields:
    # Where somebody estimates the pose, it is known better than from the drive's feedback.
    if old.localised and old.mode not in ('RANDOM', 'MANUAL'):
        return {}
    x, y = conversions.point_from(point)
    yaw = 0.0
    if old.pose is not None:
        dx, dy = x - old.pose[0], y - old.pose[1]
        yaw = math.atan2(dy, dx) if dx or dy else old.pose[2]
    return moved((x, y, yaw), old)


def _on_map(message: OccupancyGrid, _old: Snapshot) -> Fields:
    return {'grid': conversions.grid_from(message), 'trail': NO_POINTS}


def _on_transition(message: FsmTransition, old: Snapshot) -> Fields:
    transition = conversions.transition_from(message)
    return {'transitions': (*old.transitions, transition)[-KEPT_TRANSITIONS:]}


def _on_pose(message: PoseWithCovarianceStamped, old: Snapshot) -> Fields:
    at = seconds_of(message.header.stamp)
    pose = pose_from(message.pose.pose)
    return {
        **moved(pose, old),
        **_seen(pose, at, old.lidar),
        'localised': True,
        'pose_time': at,
        'stands': old.pose is not None and np.allclose(pose, old.pose, atol=STILL),
    }


def _on_scan(message: LaserScan, old: Snapshot) -> Fields:
    lidar = seconds_of(message.header.stamp), conversions.scan_from(message)
    return {'lidar': lidar, **_seen(old.pose, old.pose_time, lidar)}


def _seen(pose: Pose | None, at: float, lidar: tuple[float, Any] | None) -> Fields:
    """Return what the lidar sees in the map's frame, where pose and scan are of one moment.

    The lidar is taken to sit in the robot's middle.
    """
    if pose is None or lidar is None or abs(lidar[0] - at) > SAME_MOMENT:
        return {}
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    return {'scan': lidar[1] @ turn + (x, y)}


def _on_joints(message: JointState, _old: Snapshot) -> Fields:
    positions, still = conversions.joints_from(message)
    if not still or not set(ARM.names) <= positions.keys():
        return {'camera': None}
    frame = ARM.camera_frame([positions[name] for name in ARM.names])
    return {'camera': (seconds_of(message.header.stamp), frame)}


def _on_detections(message: MarkerDetectionArray, old: Snapshot) -> Fields:
    """Take in the markers of an image, also on the map where robot and camera stood still."""
    fields: Fields = {'detections': conversions.detections_from(message)}
    if old.pose is None or old.camera is None or not old.stands:
        return fields
    at, frame = old.camera
    if abs(at - seconds_of(message.header.stamp)) > SAME_VIEW:
        return fields
    x, y, yaw = old.pose
    placed = dict(old.markers)
    for number, point in conversions.confirmed_from(message).items():
        ahead, left, _ = frame[:3, :3] @ point + frame[:3, 3]
        placed[number] = (
            round(float(x + ahead * math.cos(yaw) - left * math.sin(yaw)), 2),
            round(float(y + ahead * math.sin(yaw) + left * math.cos(yaw)), 2),
        )
    if len(placed) > MOST_NAMES:
        raise ValueError(f'{len(placed)} markers: expected at most {MOST_NAMES}')
    return {**fields, 'markers': placed} if placed != old.markers else fields


def _on_diagnostics(message: DiagnosticArray, old: Snapshot) -> Fields:
    health = {**old.health, **conversions.health_from(message)}
    if len(health) > MOST_NAMES:
        raise ValueError(f'{len(health)} parts report: expected at most {MOST_NAMES}')
    return {'health': health}


def _on_parameters(message: ParameterEvent, _old: Snapshot) -> Fields:
    if message.node.rsplit('/', 1)[-1] != BEHAVIOUR:
        return {}
    changed = (*message.new_parameters, *message.changed_parameters)
    return behaviour_fields({each.name: each.value for each in changed})


def behaviour_fields(values: dict[str, Any]) -> Fields:
    """Return the fields that parameters of the behaviour change."""
    fields: Fields = {}
    threshold = values.get('urgency_threshold')
    if threshold is not None and threshold.type in (2, 3):
        seconds = threshold.integer_value if threshold.type == 2 else threshold.double_value
        fields['threshold'] = float(seconds)
    if (policy := values.get('policy')) is not None and policy.type == 4:
        fields['policy'] = policy.string_value
    return fields


def with_fact(snapshot: Snapshot, fact: ShortFact, came: bool) -> Snapshot:
    """Return the snapshot after a fact of the ontology came or went; most facts change nothing."""
    if _URGENT.matches(fact):
        place = frozenset(fact.arguments)
        return replace(
            snapshot, urgent=snapshot.urgent | place if came else snapshot.urgent - place
        )
    if _CONNECTED.matches(fact):
        pair = frozenset({(fact.arguments[0], fact.arguments[1])})
        return replace(snapshot, links=snapshot.links | pair if came else snapshot.links - pair)
    if _VISITED.matches(fact):
        # A time of 0 or before stands for never.
        name, seconds = fact.arguments[0], max(0.0, float(value_in(fact.arguments[1])))
        if came:
            return replace(snapshot, visited_at={**snapshot.visited_at, name: seconds})
        if snapshot.visited_at.get(name) == seconds:
            return replace(snapshot, visited_at=without(snapshot.visited_at, name))
    return snapshot


_URGENT, _CONNECTED, _VISITED = map(parse_fact, (URGENT_PLACES, CONNECTIONS, VISITS))


def without(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a mapping without one name."""
    return {key: value for key, value in values.items() if key != name}


def _on_request(controller: str) -> Callable[[String, Snapshot], Fields]:
    return lambda message, old: {'requests': {**old.requests, controller: message.data}}


def _sets(name: str, value: Callable[[Any], Any]) -> Callable[[Any, Snapshot], Fields]:
    """Return how a message sets one field."""
    return lambda message, _: {name: value(message)}


def _on_scan_goals(message: GoalStatusArray, _: Snapshot) -> Fields:
    running = any(each.status <= GoalStatus.STATUS_CANCELING for each in message.status_list)
    return {} if running else {'scan_progress': None}


def _feedback(action: str, kind: Any, read: Callable[[Any, Snapshot], Fields]) -> Topic:
    """Return the topic of an action's feedback, read without its envelope."""
    name, message = f'{action}/_action/feedback', kind.Impl.FeedbackMessage
    return Topic(name, message, lambda m, old: read(m.feedback, old), _NEWEST)


TOPICS: tuple[Topic, ...] = (
    Topic('mission_status', MissionStatus, _sets('status', conversions.status_from)),
    Topic('decision', Decision, lambda m, _: {'decision': decision_from(m), 'number': m.sequence}),
    Topic('battery_level', UInt8, _sets('battery', conversions.percent_from)),
    Topic('state/battery_low', Bool, lambda m, _: {'battery_low': m.data}),
    Topic('map', OccupancyGrid, _on_map),
    Topic('door_states', DoorStates, _sets('doors', conversions.doors_from)),
    Topic('obstacles', PointCloud2, _sets('obstacles', conversions.cloud_from)),
    Topic(POSE_TOPIC, PoseWithCovarianceStamped, _on_pose),
    Topic('plan', PathMessage, _sets('plan', conversions.path_from)),
    Topic('scan', LaserScan, _on_scan, _STREAM, stream=True, beside=POSE_TOPIC),
    _feedback('follow_path', FollowPath, lambda m, old: _fed_back(m.position, old)),
    _feedback('motion/controller', Control, lambda m, old: _fed_back(m.reached_point, old)),
    _feedback(
        'scan_surroundings', ScanSurroundings, lambda m, _: {'scan_progress': (m.view, m.views)}
    ),
    Topic('scan_surroundings/_action/status', GoalStatusArray, _on_scan_goals),
    Topic(DETECTIONS_TOPIC, MarkerDetectionArray, _on_detections, _NEWEST),
    Topic('joint_states', JointState, _on_joints, _STREAM, beside=DETECTIONS_TOPIC),
    Topic(f'{FSM}/structure', FsmStructure, _sets('containers', conversions.containers_from)),
    Topic(f'{FSM}/status', FsmStatus, lambda m, _: {'active': tuple(m.active), 'paused': m.paused}),
    Topic(f'{FSM}/transition', FsmTransition, _on_transition, _QUEUE),
    *(Topic(f'{name}/announcement', String, _on_request(name)) for name in CONTROLLERS),
    Topic('/diagnostics', DiagnosticArray, _on_diagnostics, _MANY, period=1.0),
    Topic('/parameter_events', ParameterEvent, _on_parameters, _MANY),
)
"""All that a snapshot takes from, with how."""
