"""Feeds a snapshot from a running mission: its topics, its ontology, its nodes and parameters.

Topics are polled, see `polled_subscription`: of what comes faster than it is looked at, only the
newest counts. What nobody publishes is asked for: the ontology's facts, positions of places, the
lines of doors, parameters; again when another mission has begun.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import Bool, String, UInt8

from surveillance_behaviour.conversions import decision_from
from surveillance_fsm.ros import CallError, ServiceCaller
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
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor.facts import ShortFact
from surveillance_ontology.armor_client import ArmorClient, FactSubscription, value_in
from surveillance_ontology.patrol_ontology import CONNECTIONS, PLACES, URGENT_PLACES, VISITS
from surveillance_operator import conversions
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.snapshot import NO_POINTS, Change, Pose, Snapshot, follow
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

LOOK_PERIOD = 0.5
"""Seconds of steady time between two looks at which nodes there are."""
TIMEOUT = 2.0
"""Deadline of each question, seconds of steady time; then it is asked again."""
TRAIL_STEP, TRAIL_POINTS = 0.05, 3000
"""Least distance of two points of the trail, metres, and how many are kept."""
KEPT_TRANSITIONS = 60
SAME_MOMENT = 0.03
"""Most seconds between the stamps of a pose and a scan that belong together."""

BUILDER = 'ontology_map_builder'
PLANNER = 'planner_controller'
"""The node that knows the doors' lines and the execution mode, as its parameters."""
BEHAVIOUR = 'robot_behavior'
OBSERVERS = ('mission_', 'console')
"""How the names of nodes begin that only look on."""
CONTROLLERS = ('battery_controller', 'planner_controller', 'motion_controller', 'arm_controller')

_QUEUE = QoSProfile(
    depth=200, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
_STREAM = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_MANY = QoSProfile(depth=50, reliability=ReliabilityPolicy.RELIABLE)

Fields = dict[str, Any]


@dataclass(frozen=True)
class Topic:
    """One topic that a snapshot takes from.

    Attributes:
        name: Relative to the namespace, or absolute.
        kind: The type of its messages.
        qos: How it is heard.
        read: The snapshot's fields that a message changes; raises `ValueError` for one that cannot
            be used.
        stream: Whether a view may do without it.
    """

    name: str
    kind: Any
    qos: QoSProfile
    read: Callable[[Any, Snapshot], Fields]
    stream: bool = False


class MissionFeed:
    """Keeps a snapshot of the mission that a node listens to.

    Args:
        node: The node that watches.
        period: Seconds of steady time between two looks at the topics, or what tells them.
        on_change: Called on the feed's thread with each new snapshot and what changed.
        streams: Follow the lidar, too.
    """

    def __init__(
        self,
        node: PatrolNode,
        period: float | Callable[[], float],
        on_change: Callable[[Snapshot, Sequence[Change]], None] = lambda _new, _told: None,
        *,
        streams: bool = False,
    ) -> None:
        self._node = node
        self._period = period if callable(period) else lambda: period
        self._on_change = on_change
        namespace = node.get_namespace().strip('/')
        where = f'ROS domain {node.context.get_domain_id()}'
        self._empty = Snapshot(where=where + (f', namespace {namespace}' if namespace else ''))
        self._snapshot = self._empty
        self._lock = threading.Lock()
        self._over = False
        self._clock_time: float | None = None
        self._clock = PolledSubscription(node, ClockMessage, '/clock', SENSOR_QOS)
        self._topics = [
            (topic, PolledSubscription(node, topic.kind, topic.name, topic.qos))
            for topic in TOPICS
            if streams or not topic.stream
        ]
        self._facts = _Facts(node, self.update)
        self._next_look = 0.0
        node.spawn(self._run, 'mission feed')

    @property
    def snapshot(self) -> Snapshot:
        """All that is known, with the time of the last change."""
        return self._snapshot

    def see(self) -> Snapshot:
        """Return all that is known, at the mission's present time, or the time of its end."""
        return self._snapshot if self._over else replace(self._snapshot, now=self._now())

    def update(self, change: Callable[[Snapshot], Snapshot]) -> None:
        """Take a change into the snapshot; from any thread."""
        with self._lock:
            old = self._snapshot
            new = change(old)
            if new is old:
                return
            if self._over:
                self._over = False
                self._facts.forget()
                # What follows the ontology tells what goes, too.
                kept = {
                    name: getattr(old, name)
                    for name in ('events', 'visited_at', 'urgent', 'links', 'history', 'restarts')
                }
                old = replace(self._empty, **kept)
                new = change(old)
            new, told = follow(old, replace(new, now=self._now()), time.strftime('%H:%M:%S'))
            self._snapshot = new
        self._on_change(new, told)

    def _run(self) -> None:
        stopping = self._node.stopping
        while not stopping.is_set():
            change = self._take()
            if change is not None:
                self.update(change)
            if time.monotonic() >= self._next_look:
                self._next_look = time.monotonic() + LOOK_PERIOD
                self._look()
            stopping.wait(self._period())

    def _take(self) -> Callable[[Snapshot], Snapshot] | None:
        """Return what all messages that came change together."""
        clock = None
        while (taken := self._clock.take()) is not None:
            clock = taken[0].clock
        if clock is not None:
            self._clock_time = clock.sec + clock.nanosec / 1e9
        came: list[tuple[Topic, Any]] = []
        for topic, subscription in self._topics:
            # A scan is shown from the pose of its moment: without a new one it is not wanted.
            if topic.stream and not any(each.kind is PoseWithCovarianceStamped for each, _ in came):
                continue
            for _ in range(subscription.qos.depth):
                if (taken := subscription.take()) is None:
                    break
                came.append((topic, taken[0]))
        if not came:
            return None

        def changed(snapshot: Snapshot) -> Snapshot:
            for topic, message in came:
                snapshot = read_message(snapshot, topic, message)
            return snapshot

        return changed

    def _look(self) -> None:
        node, old = self._node, self._snapshot
        processes: dict[str, set[str]] = {}
        for log in node.get_publishers_info_by_topic('/rosout'):  # which every node has
            if log.node_namespace == node.get_namespace():
                processes.setdefault(log.node_name, set()).add(str(log.endpoint_gid))
        names = set(self._facts.servers())
        silent = dict(old.silent)
        for topic, subscription in self._topics:
            for info in node.get_publishers_info_by_topic(subscription.topic):
                if not info.node_name.startswith('_') and topic.name[0] != '/':
                    names.add(info.node_name)
                fits, reason = qos_check_compatible(info.qos_profile, subscription.qos)
                if fits == QoSCompatibility.ERROR:
                    silent[topic.name] = _mismatch(reason)
        if names:  # there is a mission: all its nodes count, also those that tell nothing of it
            names |= {name for name in processes if not name.startswith(('_', *OBSERVERS))}
        nodes = {name: frozenset(processes.get(name, ())) for name in names}
        if nodes != old.nodes or silent != old.silent:
            ended = old.ended.union(old.nodes).difference(nodes)
            self.update(lambda old: replace(old, nodes=nodes, ended=ended, silent=silent))
            self._over = not nodes and bool(old.nodes)
        if not node.count_publishers('/clock'):
            self._clock_time = None
        self._facts.ask()

    def _now(self) -> float:
        if self._clock_time is not None:
            return self._clock_time
        return float(self._node.get_clock().now().nanoseconds) / 1e9


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
        trail = np.vstack([trail[-TRAIL_POINTS:], pose[:2]])
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


def _on_transition(message: FsmTransition, old: Snapshot) -> Fields:
    transition = conversions.transition_from(message)
    return {'transitions': (*old.transitions, transition)[-KEPT_TRANSITIONS:]}


def _on_pose(message: PoseWithCovarianceStamped, old: Snapshot) -> Fields:
    at = seconds_of(message.header.stamp)
    fields = moved(conversions.pose_from(message.pose.pose), old)
    return {**fields, **_seen(fields['pose'], at, old.lidar), 'localised': True, 'pose_time': at}


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


def _on_parameters(message: ParameterEvent, _old: Snapshot) -> Fields:
    if message.node.rsplit('/', 1)[-1] != BEHAVIOUR:
        return {}
    changed = {each.name: each.value for each in message.changed_parameters}
    return _behaviour_fields(changed)


def _behaviour_fields(values: dict[str, Any]) -> Fields:
    fields: Fields = {}
    threshold = values.get('urgency_threshold')
    if threshold is not None and threshold.type in (2, 3):
        seconds = threshold.integer_value if threshold.type == 2 else threshold.double_value
        fields['threshold'] = float(seconds)
    if (policy := values.get('policy')) is not None and policy.type == 4:
        fields['policy'] = policy.string_value
    return fields


def _on_request(controller: str) -> Callable[[String, Snapshot], Fields]:
    return lambda message, old: {'requests': {**old.requests, controller: message.data}}


TOPICS: tuple[Topic, ...] = (
    Topic(
        'mission_status',
        MissionStatus,
        STATE_QOS,
        lambda m, _: {'status': conversions.status_from(m)},
    ),
    Topic(
        'decision',
        Decision,
        STATE_QOS,
        lambda m, _: {'decision': decision_from(m), 'number': m.sequence},
    ),
    Topic(
        'battery_level',
        UInt8,
        STATE_QOS,
        lambda m, _: {'battery': conversions.percent_from(m.data)},
    ),
    Topic('state/battery_low', Bool, STATE_QOS, lambda m, _: {'battery_low': m.data}),
    Topic(
        'map',
        OccupancyGrid,
        STATE_QOS,
        lambda m, _: {'grid': conversions.grid_from(m), 'trail': NO_POINTS},
    ),
    Topic('door_states', DoorStates, STATE_QOS, lambda m, _: {'doors': conversions.doors_from(m)}),
    Topic(
        'obstacles', PointCloud2, STATE_QOS, lambda m, _: {'obstacles': conversions.cloud_from(m)}
    ),
    Topic('amcl_pose', PoseWithCovarianceStamped, STATE_QOS, _on_pose),
    Topic('plan', PathMessage, STATE_QOS, lambda m, _: {'plan': conversions.path_from(m)}),
    Topic('scan', LaserScan, _STREAM, _on_scan, stream=True),
    Topic(
        'follow_path/_action/feedback',
        FollowPath.Impl.FeedbackMessage,
        QoSProfile(depth=1),
        lambda m, old: _fed_back(m.feedback.position, old),
    ),
    Topic(
        'motion/controller/_action/feedback',
        Control.Impl.FeedbackMessage,
        QoSProfile(depth=1),
        lambda m, old: _fed_back(m.feedback.reached_point, old),
    ),
    Topic(
        'scan_surroundings/_action/feedback',
        ScanSurroundings.Impl.FeedbackMessage,
        QoSProfile(depth=1),
        lambda m, _: {'scan_progress': (m.feedback.view, m.feedback.views)},
    ),
    Topic(
        'aruco_detector/detections',
        MarkerDetectionArray,
        QoSProfile(depth=1),
        lambda m, _: {'detections': conversions.detections_from(m)},
    ),
    Topic(
        f'{BEHAVIOUR}/fsm/structure',
        FsmStructure,
        STATE_QOS,
        lambda m, _: {'containers': conversions.containers_from(m)},
    ),
    Topic(
        f'{BEHAVIOUR}/fsm/status',
        FsmStatus,
        STATE_QOS,
        lambda m, _: {'active': tuple(m.active), 'paused': m.paused},
    ),
    Topic(f'{BEHAVIOUR}/fsm/transition', FsmTransition, _QUEUE, _on_transition),
    *(Topic(f'{name}/announcement', String, STATE_QOS, _on_request(name)) for name in CONTROLLERS),
    Topic(
        '/diagnostics',
        DiagnosticArray,
        _MANY,
        lambda m, old: {'health': {**old.health, **conversions.health_from(m)}},
    ),
    Topic('/parameter_events', ParameterEvent, _MANY, _on_parameters),
)
"""All that a snapshot takes from, with how."""


class _Facts:
    """Asks and follows what is not published: facts, positions, parameters.

    Args:
        node: The node that watches.
        update: Takes a function from the old snapshot to the new one.
    """

    def __init__(
        self, node: PatrolNode, update: Callable[[Callable[[Snapshot], Snapshot]], None]
    ) -> None:
        self._node = node
        self._update = update
        self._reference = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        self._position = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        self._list = ServiceCaller(node, ListParameters, f'{PLANNER}/list_parameters')
        self._get = ServiceCaller(node, GetParameters, f'{PLANNER}/get_parameters')
        self._get_behaviour = ServiceCaller(node, GetParameters, f'{BEHAVIOUR}/get_parameters')
        self._armor: ArmorClient | None = None
        self._places: set[str] = set()
        self._without_position: set[str] = set()
        self._answered: set[str] = set()
        self._asking = False

    def forget(self) -> None:
        """Ask anew: another mission may have another map."""
        self._answered.clear()
        self._without_position = set(self._places)

    def servers(self) -> frozenset[str]:
        """Return the nodes that there are now to answer."""
        known = ((BUILDER, self._position), (PLANNER, self._get))
        return frozenset(name for name, service in known if service.is_ready())

    def ask(self) -> None:
        """Ask for what is missing, if it is not being asked for; call it now and then."""
        missing = self._without_position or len(self._answered) < len(self._questions())
        if missing and not self._asking and self._node.executor is not None:
            self._asking = True
            self._node.executor.create_task(self._ask)

    def _questions(self) -> dict[str, Callable[[], Any]]:
        return {
            'doors': self._ask_doors,
            'behaviour': self._ask_behaviour,
            'reference': self._ask_reference,
        }

    async def _ask(self) -> None:
        try:
            questions = [
                (name, question)
                for name, question in self._questions().items()
                if name not in self._answered
            ]
            for name, question in (*questions, ('positions', self._ask_positions)):
                try:
                    await question()
                    if name != 'positions':
                        self._answered.add(name)
                except CallError as error:
                    self._node.get_logger().debug(str(error))
        finally:
            self._asking = False

    async def _ask_reference(self) -> None:
        name = (await self._reference.call_async(ReferenceName.Request(), TIMEOUT)).name
        if self._armor is not None:
            self._armor.reference_name = name
            return
        self._armor = ArmorClient(self._node, self._node.get_name(), name, timeout=TIMEOUT)
        for pattern, callback in (
            (PLACES, self._on_place),
            (URGENT_PLACES, self._on_urgent),
            (VISITS, self._on_visit),
            (CONNECTIONS, self._on_link),
        ):
            FactSubscription(self._node, self._armor, pattern, callback)

    async def _ask_positions(self) -> None:
        for place in sorted(self._without_position):
            request = RoomPosition.Request(room_name=place)
            answer = await self._position.call_async(request, TIMEOUT)
            self._without_position.discard(place)
            if answer.valid:
                self._update(_with_position(place, conversions.point_from(answer.position)))

    async def _ask_doors(self) -> None:
        listed = await self._list.call_async(ListParameters.Request(prefixes=['doors']), TIMEOUT)
        names = ['execution_mode', *listed.result.names]
        values = (await self._get.call_async(GetParameters.Request(names=names), TIMEOUT)).values
        if len(values) != len(names):
            raise CallError(f'{PLANNER} gave {len(values)} of {len(names)} parameters')
        lines = {
            name.removeprefix('doors.'): _door_line(*value.double_array_value)
            for name, value in zip(names[1:], values[1:], strict=True)
            if len(value.double_array_value) == 4
        }
        mode = values[0].string_value
        self._update(lambda old: replace(old, mode=mode, door_lines=lines))

    async def _ask_behaviour(self) -> None:
        names = ['urgency_threshold', 'policy']
        request = GetParameters.Request(names=names)
        values = (await self._get_behaviour.call_async(request, TIMEOUT)).values
        fields = _behaviour_fields(dict(zip(names, values, strict=False)))
        self._update(lambda old: replace(old, **fields))

    def _on_place(self, fact: ShortFact, came: bool) -> None:
        (place,) = fact.arguments
        for places in (self._places, self._without_position):
            (places.add if came else places.discard)(place)
        if not came:
            self._update(lambda old: replace(old, positions=_without(old.positions, place)))

    def _on_urgent(self, fact: ShortFact, came: bool) -> None:
        place = frozenset(fact.arguments)
        self._update(
            lambda old: replace(old, urgent=old.urgent | place if came else old.urgent - place)
        )

    def _on_visit(self, fact: ShortFact, came: bool) -> None:
        place, rendered = fact.arguments
        seconds = float(value_in(rendered))

        def told(old: Snapshot) -> Snapshot:
            if came:
                return replace(old, visited_at={**old.visited_at, place: seconds})
            if old.visited_at.get(place) != seconds:
                return old
            return replace(old, visited_at=_without(old.visited_at, place))

        self._update(told)

    def _on_link(self, fact: ShortFact, came: bool) -> None:
        pair = frozenset({(fact.arguments[0], fact.arguments[1])})
        self._update(lambda old: replace(old, links=old.links | pair if came else old.links - pair))


def _mismatch(reason: str) -> str:
    for words, policy in (('transient local', 'DURABILITY'), ('best effort', 'RELIABILITY')):
        if words in reason.lower():
            return f'its publisher offers another {policy}'
    return f'its publisher does not fit: {reason}'


def _with_position(place: str, point: tuple[float, float]) -> Callable[[Snapshot], Snapshot]:
    return lambda old: replace(old, positions={**old.positions, place: point})


def _without(values: Any, name: str) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != name}


def _door_line(x: float, y: float, yaw: float, width: float) -> tuple[float, float, float, float]:
    dx, dy = width / 2 * math.cos(yaw), width / 2 * math.sin(yaw)
    return x - dx, y - dy, x + dx, y + dy
