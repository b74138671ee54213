"""What each topic tells of a mission: from its messages to the fields of a state.

A running mission (`mission_subscriber`) and a recording (`recording.stored`) are read by the same
table. A message from the network may hold anything. What cannot be used raises `ValueError` with
one line.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from numpy.typing import NDArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState, LaserScan, PointCloud2
from std_msgs.msg import Bool, String, UInt8

from armor_service.facts import ShortFact, parse_fact
from floor_plans import Grid
from surveillance_behaviour.conversions import decision_from, idleness_bounds_from
from surveillance_interfaces.action import Control, FollowPath, ScanSurroundings
from surveillance_interfaces.msg import (
    Decision,
    DoorStates,
    FleetRobot,
    FsmStatus,
    FsmStructure,
    FsmTransition,
    Incident,
    MarkerDetectionArray,
    MissionStatus,
    PlaceCoverages,
    RobotPlace,
)
from surveillance_ontology.armor_client import value_in
from surveillance_ontology.patrol_vocabulary import CONNECTIONS, URGENT_PLACES, VISITS
from surveillance_operator.figures import FIGURES, Figure
from surveillance_operator.mission_state import (
    NO_POINTS,
    TRAIL_STEP,
    FleetReport,
    MachineContainer,
    MachineTransition,
    MissionState,
    NodeReport,
    Pose,
    Status,
)
from surveillance_operator.recording.schemas import message_class
from surveillance_runtime.conversions import map_from, points_from_cloud, pose_from, seconds_of
from surveillance_runtime.fleet_messages import FLEET_TOPIC
from surveillance_runtime.incident_topic import INCIDENTS_QOS, update_from
from surveillance_runtime.incident_topic import TOPIC as INCIDENTS_TOPIC
from surveillance_runtime.node_table import BY_NAME
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.robot_arm import ARM

MOST_CELLS = 16_000_000
MOST_POINTS = 20_000
MOST_NAMES = 10_000
MOST_INCIDENTS = 200
MOST_BEAMS = 120
"""Of a scan with more beams every n-th is shown."""
URGENT_MARK = ' URGENT'
"""Follows the name of a place on `place_markers`."""
TRAIL_POINTS = 1000
"""How many points of the trail are kept."""
KEPT_TRANSITIONS = 60
SAME_MOMENT = 0.03
"""Most seconds between the stamps of a pose and a scan that belong together."""
SAME_VIEW = 0.8
"""Most seconds between the stamps of an image and of the arm's joints, which stand still."""
STILL = 0.01
"""Metres and radians within which the robot counts as standing still between two poses."""
JOINT_STILL = 0.01
"""A joint that is slower stands still, rad/s."""

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
    """One topic that a state takes from.

    Attributes:
        name: Relative to the namespace, or absolute.
        kind: The type of its messages.
        read: The state's fields that a message changes; raises `ValueError` for one that cannot
            be used.
        qos: How it is heard.
        stream: Whether a view may do without it.
        beside: Taken only together with a message of this topic, and read before it.
        period: Least time between two looks at it, seconds.
        whose: Of a topic on which all robots speak: the last names of the namespaces that a message
            concerns; None: it may concern every robot.
    """

    name: str
    kind: Any
    read: Callable[[Any, MissionState], Fields]
    qos: QoSProfile = STATE_QOS
    stream: bool = False
    beside: str = ''
    period: float = 0.0
    whose: Callable[[Any], frozenset[str] | None] | None = None

    @property
    def is_of_mission(self) -> bool:
        """Whether that somebody speaks on it means that a mission runs.

        On the others nodes speak, too, that only look on and stay after a mission's end.
        """
        return not self.name.startswith('/') and self.name != INCIDENTS_TOPIC

    @property
    def is_state(self) -> bool:
        """Whether a message that repeats the one before tells nothing."""
        return self.qos is STATE_QOS


def read_message(state: MissionState, topic: Topic, message: Any) -> MissionState:
    """Return the state with what a message says, or why it cannot be used."""
    try:
        fields = topic.read(message, state)
    except (ValueError, TypeError, OverflowError) as error:
        return state.having(silent={**state.health.silent, topic.name: str(error)})
    return state.having(**fields) if fields else state


def moved(pose: Pose, old: MissionState) -> Fields:
    """Return the fields that a new pose changes: the pose, and the trail."""
    trail = old.sensors.trail
    if not len(trail) or math.dist(trail[-1], pose[:2]) >= TRAIL_STEP:
        trail = np.vstack([trail[1 - TRAIL_POINTS :], pose[:2]])
    return {'pose': pose, 'trail': trail}


def _fed_back(point: Any, old: MissionState) -> Fields:
    # Where somebody estimates the pose, it is known better than from the drive's feedback.
    if old.sensors.localised and old.task.mode not in ('RANDOM', 'MANUAL'):
        return {}
    x, y = point_from(point)
    yaw = 0.0
    if old.sensors.pose is not None:
        dx, dy = x - old.sensors.pose[0], y - old.sensors.pose[1]
        yaw = math.atan2(dy, dx) if dx or dy else old.sensors.pose[2]
    return moved((x, y, yaw), old)


def _on_map(message: OccupancyGrid, old: MissionState) -> Fields:
    grid, known = map_from(message, MOST_CELLS), old.place.grid
    # It is repeated: what is drawn of it costs a fifth of a second.
    if known is not None and _is_same(known, grid):
        return {}
    return {'grid': grid, 'trail': NO_POINTS}


def _is_same(one: Grid, other: Grid) -> bool:
    placed = one.resolution == other.resolution and tuple(one.origin) == tuple(other.origin)
    return placed and np.array_equal(one.cells, other.cells)


def _on_transition(message: FsmTransition, old: MissionState) -> Fields:
    transition = transition_from(message)
    return {'transitions': (*old.machine.transitions, transition)[-KEPT_TRANSITIONS:]}


def _on_pose(message: PoseWithCovarianceStamped, old: MissionState) -> Fields:
    at = seconds_of(message.header.stamp)
    pose = pose_from(message.pose.pose)
    return {
        **moved(pose, old),
        **_seen(pose, at, old.sensors.lidar),
        'localised': True,
        'pose_time': at,
        'stands': old.sensors.pose is not None and np.allclose(pose, old.sensors.pose, atol=STILL),
    }


def _on_scan(message: LaserScan, old: MissionState) -> Fields:
    lidar = seconds_of(message.header.stamp), scan_from(message)
    return {'lidar': lidar, **_seen(old.sensors.pose, old.sensors.pose_time, lidar)}


def _seen(pose: Pose | None, at: float, lidar: tuple[float, Any] | None) -> Fields:
    """Return what the lidar sees in the map's frame, where pose and scan are of one moment.

    The lidar is taken to sit in the robot's middle.
    """
    if pose is None or lidar is None or abs(lidar[0] - at) > SAME_MOMENT:
        return {}
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    return {'scan': lidar[1] @ turn + (x, y)}


def _on_joints(message: JointState, _old: MissionState) -> Fields:
    if len(message.name) != len(message.position):
        raise ValueError(f'{len(message.position)} positions came for {len(message.name)} joints')
    if not all(map(math.isfinite, message.position)):
        raise ValueError('joints whose positions are not finite')
    positions = dict(zip(message.name, message.position, strict=True))
    still = all(abs(speed) < JOINT_STILL for speed in message.velocity)
    if not still or not set(ARM.names) <= positions.keys():
        return {'camera': None}
    frame = ARM.camera_frame([positions[name] for name in ARM.names])
    return {'camera': (seconds_of(message.header.stamp), frame)}


def _on_detections(message: MarkerDetectionArray, old: MissionState) -> Fields:
    """Take in the markers of an image, also on the map where robot and camera stood still."""
    found = message.detections[:MOST_NAMES]
    fields: Fields = {
        'detections': tuple(
            (each.id, each.known, each.confirmed, round(float(each.confidence), 2))
            for each in found
        )
    }
    if old.sensors.pose is None or old.sensors.camera is None or not old.sensors.stands:
        return fields
    at, frame = old.sensors.camera
    if abs(at - seconds_of(message.header.stamp)) > SAME_VIEW:
        return fields
    x, y, yaw = old.sensors.pose
    placed = dict(old.sensors.markers)
    for each in found:
        point = each.pose.position
        seen = np.array([point.x, point.y, point.z])
        if not each.confirmed or not np.isfinite(seen).all():
            continue
        ahead, left, _ = frame[:3, :3] @ seen + frame[:3, 3]
        placed[int(each.id)] = (
            round(float(x + ahead * math.cos(yaw) - left * math.sin(yaw)), 2),
            round(float(y + ahead * math.sin(yaw) + left * math.cos(yaw)), 2),
        )
    if len(placed) > MOST_NAMES:
        raise ValueError(f'{len(placed)} markers: expected at most {MOST_NAMES}')
    return {**fields, 'markers': placed} if placed != old.sensors.markers else fields


def _on_diagnostics(message: DiagnosticArray, old: MissionState) -> Fields:
    came = health_from(message)
    health = {
        **old.health.reports,
        **{name: came[name] for name in came if not _is_of_another(name, old.namespace)},
    }
    if len(health) > MOST_NAMES:
        raise ValueError(f'{len(health)} parts report: expected at most {MOST_NAMES}')
    return {'reports': health}


def _who_reports(message: DiagnosticArray) -> frozenset[str] | None:
    found = set()
    for status in message.status:
        where, _, node = status.name.partition(':')[0].rpartition('/')
        if not where or node not in BY_NAME:
            return None
        found.add(where.rpartition('/')[2])
    return frozenset(found)


def _is_of_another(status: str, namespace: str) -> bool:
    """Tell whether a node of another robot says it: one that is neither ours nor shared."""
    where, _, node = status.partition(':')[0].rpartition('/')
    return node in BY_NAME and not f'{namespace}/'.startswith(f'{where}/' if where else '')


def _on_fleet_robot(message: FleetRobot, old: MissionState) -> Fields:
    if message.robot != old.namespace.rpartition('/')[2]:
        return {}
    report = FleetReport(
        _names(message.tour, 'places'),
        message.stop,
        message.dock,
        message.heading_to,
        message.is_moving,
        message.runs_until if math.isfinite(message.runs_until) else None,
        message.taken_out,
    )
    return {} if report == old.task.fleet_report else {'fleet_report': report}


def _in_fleet(message: FleetRobot) -> frozenset[str]:
    return frozenset((message.robot,))


def _whose_incident(message: Incident) -> frozenset[str] | None:
    return frozenset({message.robot}) if message.robot else None


def _on_incident(message: Incident, old: MissionState) -> Fields:
    told = update_from(message)
    if told.robot not in ('', old.namespace.rpartition('/')[2]):
        return {}
    open_ones = dict(old.health.incidents)
    open_ones.pop((told.owner, told.cause), None)
    if not told.over:
        open_ones[told.owner, told.cause] = told
    # Of what a stranger may make up, the newest.
    return {'incidents': dict(list(open_ones.items())[-MOST_INCIDENTS:])}


def _whose_parameters(message: ParameterEvent) -> frozenset[str]:
    return frozenset(message.node.strip('/').split('/')[-2:-1])


def _on_parameters(message: ParameterEvent, old: MissionState) -> Fields:
    if message.node.strip('/') != '/'.join(filter(None, (old.namespace, BEHAVIOUR))):
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


def with_fact(state: MissionState, fact: ShortFact, came: bool) -> MissionState:
    """Return the state after a fact of the ontology came or went; most facts change nothing."""
    if _URGENT.matches(fact):
        place = frozenset(fact.arguments)
        urgent = state.place.urgent
        return state.having(urgent=urgent | place if came else urgent - place)
    if _CONNECTED.matches(fact):
        pair = frozenset({(fact.arguments[0], fact.arguments[1])})
        return state.having(links=state.place.links | pair if came else state.place.links - pair)
    if _VISITED.matches(fact):
        # A time of 0 or before stands for never.
        name, seconds = fact.arguments[0], max(0.0, float(value_in(fact.arguments[1])))
        if came:
            return state.having(visited_at={**state.place.visited_at, name: seconds})
        if state.place.visited_at.get(name) == seconds:
            return state.having(visited_at=without(state.place.visited_at, name))
    return state


_URGENT, _CONNECTED, _VISITED = map(parse_fact, (URGENT_PLACES, CONNECTIONS, VISITS))


def without(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a mapping without one name."""
    return {key: value for key, value in values.items() if key != name}


def status_from(message: MissionStatus) -> Status:
    """Return what the machine does, as it was published."""
    return Status(
        since=seconds_of(message.stamp),
        machine=message.machine,
        state=message.state,
        place=message.place,
        heading_to=message.heading_to,
        waiting_for_help=message.waiting_for_help,
        text=message.text,
        avoided=_names(message.avoided, 'avoided'),
    )


def doors_from(message: DoorStates) -> dict[str, bool]:
    """Return whether each door is open, by name."""
    opened, closed = _names(message.open, 'open doors'), _names(message.closed, 'closed doors')
    return dict(sorted({**dict.fromkeys(opened, True), **dict.fromkeys(closed, False)}.items()))


def coverage_from(message: PlaceCoverages) -> dict[str, float]:
    """Return which part of each place was in view, 0 to 1; a place of which it is not known: none.

    Raises:
        ValueError: A part is not from 0 to 1, or there are too many places.
    """
    _names((each.place for each in message.places), 'places')
    known = {each.place: each.share for each in message.places if not math.isnan(each.share)}
    for place, share in known.items():
        if not 0.0 <= share <= 1.0:
            raise ValueError(f'a share of {share:g} of {place}: expected 0 to 1')
    return known


def point_from(message: Any) -> tuple[float, float]:
    """Return x and y of a point in metres.

    Raises:
        ValueError: A coordinate is not finite.
    """
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        raise ValueError(f'a point at ({message.x:g}, {message.y:g}): expected finite numbers')
    return message.x, message.y


def percent_from(message: UInt8) -> float:
    """Return a battery level.

    Raises:
        ValueError: It is not from 0 to 100.
    """
    if not 0 <= message.data <= 100:
        raise ValueError(f'a level of {message.data} %: expected 0 to 100')
    return float(message.data)


def cloud_from(message: PointCloud2) -> NDArray[np.float64]:
    """Return the points of a cloud that are finite, shape (n, 2), metres.

    Raises:
        ValueError: It has no x and y, or its sizes contradict each other.
    """
    count = message.width * message.height
    if count > MOST_POINTS:
        raise ValueError(f'a cloud of {count} points: expected at most {MOST_POINTS}')
    if count * message.point_step > len(message.data):
        raise ValueError(f'{len(message.data)} bytes came for {count} points')
    points = points_from_cloud(message)
    return points[np.isfinite(points).all(axis=1)]


def path_from(message: PathMessage) -> NDArray[np.float64]:
    """Return the points of a path, shape (n, 2), metres.

    Raises:
        ValueError: Too many points, or one is not finite.
    """
    if len(message.poses) > MOST_POINTS:
        raise ValueError(f'a path of {len(message.poses)} points: expected at most {MOST_POINTS}')
    points = [point_from(each.pose.position) for each in message.poses]
    return np.array(points, dtype=float).reshape(-1, 2)


def scan_from(message: LaserScan) -> NDArray[np.float64]:
    """Return where a lidar's beams end, shape (n, 2), metres, in the lidar's frame.

    Beams that hit nothing are left out.

    Raises:
        ValueError: Its angles are not finite.
    """
    count = len(message.ranges)
    if not (math.isfinite(message.angle_min) and math.isfinite(message.angle_increment)):
        raise ValueError('a scan whose angles are not finite')
    step = max(1, -(-min(count, MOST_POINTS) // MOST_BEAMS))
    ranges = np.asarray(message.ranges[:MOST_POINTS:step], dtype=float)
    angles = message.angle_min + message.angle_increment * step * np.arange(len(ranges))
    with np.errstate(invalid='ignore'):
        good = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges < message.range_max)
    ranges, angles = ranges[good], angles[good]
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)


def containers_from(message: FsmStructure) -> tuple[MachineContainer, ...]:
    """Return the containers of a state machine, outermost first."""
    if len(message.containers) > MOST_NAMES:
        raise ValueError(f'a state machine of {len(message.containers)} containers')
    return tuple(
        MachineContainer(
            each.path,
            each.kind,
            _names(each.states, 'states'),
            _names(each.initial_states, 'initial states'),
            _names(each.outcomes, 'outcomes'),
            tuple((edge.from_state, edge.outcome, edge.to_state) for edge in each.edges),
        )
        for each in message.containers
    )


def transition_from(message: FsmTransition) -> MachineTransition:
    """Return a transition of the state machine."""
    duration = float(message.duration)
    return MachineTransition(
        message.sequence,
        seconds_of(message.stamp),
        message.path,
        message.from_state,
        message.outcome,
        message.to_state,
        duration if math.isfinite(duration) else 0.0,
    )


def health_from(message: DiagnosticArray) -> dict[str, NodeReport]:
    """Return what each part reports, by name."""
    heard = time.monotonic()
    return {
        each.name: NodeReport(
            each.level[0] if isinstance(each.level, bytes) else int(each.level),
            each.message,
            tuple((value.key, value.value) for value in each.values[:50]),
            each.hardware_id,
            heard,
        )
        for each in message.status[:MOST_NAMES]
    }


def _names(names: Iterable[str], what: str) -> tuple[str, ...]:
    found = tuple(names)
    if len(found) > MOST_NAMES:
        raise ValueError(f'{len(found)} {what}: expected at most {MOST_NAMES}')
    return found


def _on_request(controller: str) -> Callable[[String, MissionState], Fields]:
    return lambda message, old: {'requests': {**old.task.requests, controller: message.data}}


def _sets(name: str, value: Callable[[Any], Any]) -> Callable[[Any, MissionState], Fields]:
    """Return how a message sets one field."""
    return lambda message, _: {name: value(message)}


def topic_of(figure: Figure) -> Topic:
    """Return the topic that brings a figure; it has one of its own."""
    heard = figure.heard
    assert heard is not None

    def read(message: Any, old: MissionState) -> Fields:
        value = heard.value(message)
        known = without(old.measured, figure.name)
        return {'measured': known if value is None else {**known, figure.name: value}}

    # Whoever publishes it, a driver mostly, is heard with this quality.
    return Topic(heard.topic, message_class(heard.kind), read, _STREAM)


def _on_scan_goals(message: GoalStatusArray, _: MissionState) -> Fields:
    running = any(each.status <= GoalStatus.STATUS_CANCELING for each in message.status_list)
    return {} if running else {'scan_progress': None}


def _feedback(action: str, kind: Any, read: Callable[[Any, MissionState], Fields]) -> Topic:
    """Return the topic of an action's feedback, read without its envelope."""
    name, message = f'{action}/_action/feedback', kind.Impl.FeedbackMessage
    return Topic(name, message, lambda m, old: read(m.feedback, old), _NEWEST)


def _on_decision(message: Decision, _: MissionState) -> Fields:
    return {'decision': decision_from(message), 'decision_number': message.sequence}


def _on_idleness_bounds(message: DiagnosticArray, _: MissionState) -> Fields:
    idleness_bounds, hours = idleness_bounds_from(message)
    return {'idleness_bounds': idleness_bounds, 'hours': hours}


def _on_machine(message: FsmStatus, _: MissionState) -> dict[str, Any]:
    waiting = tuple(f'{each.path}: {each.outcome} -> {each.to_state}' for each in message.questions)
    return {'active': tuple(message.active), 'paused': message.paused, 'waiting': waiting}


TOPICS: tuple[Topic, ...] = (
    Topic('mission_status', MissionStatus, _sets('status', status_from)),
    Topic('decision', Decision, _on_decision),
    Topic('robot_place', RobotPlace, lambda m, _: {'robot_place': m.place}),
    Topic('idleness_bounds', DiagnosticArray, _on_idleness_bounds),
    Topic('battery_level', UInt8, _sets('battery', percent_from)),
    Topic('battery_low', Bool, lambda m, _: {'battery_low': m.data}),
    Topic('stopped', Bool, lambda m, _: {'stopped': m.data}),
    Topic('map', OccupancyGrid, _on_map),
    Topic('door_states', DoorStates, _sets('doors', doors_from)),
    Topic('coverage', PlaceCoverages, _sets('coverage', coverage_from)),
    Topic('obstacles', PointCloud2, _sets('obstacles', cloud_from)),
    Topic(POSE_TOPIC, PoseWithCovarianceStamped, _on_pose),
    Topic('plan', PathMessage, _sets('plan', path_from)),
    Topic('scan', LaserScan, _on_scan, _STREAM, stream=True, beside=POSE_TOPIC),
    _feedback('follow_path', FollowPath, lambda m, old: _fed_back(m.position, old)),
    _feedback('motion/controller', Control, lambda m, old: _fed_back(m.reached_point, old)),
    _feedback(
        'scan_surroundings', ScanSurroundings, lambda m, _: {'scan_progress': (m.view, m.views)}
    ),
    Topic('scan_surroundings/_action/status', GoalStatusArray, _on_scan_goals),
    Topic(DETECTIONS_TOPIC, MarkerDetectionArray, _on_detections, _NEWEST),
    Topic('joint_states', JointState, _on_joints, _STREAM, beside=DETECTIONS_TOPIC),
    Topic(f'{FSM}/structure', FsmStructure, _sets('containers', containers_from)),
    Topic(f'{FSM}/status', FsmStatus, _on_machine),
    Topic(f'{FSM}/transition', FsmTransition, _on_transition, _QUEUE),
    *(Topic(f'{name}/announcement', String, _on_request(name)) for name in CONTROLLERS),
    Topic(FLEET_TOPIC, FleetRobot, _on_fleet_robot, _MANY, whose=_in_fleet),
    *(topic_of(each) for each in FIGURES if each.heard is not None),
    Topic(INCIDENTS_TOPIC, Incident, _on_incident, INCIDENTS_QOS, whose=_whose_incident),
    Topic('/diagnostics', DiagnosticArray, _on_diagnostics, _MANY, period=1.0, whose=_who_reports),
    Topic('/parameter_events', ParameterEvent, _on_parameters, _MANY, whose=_whose_parameters),
)
"""All that a state takes from, with how."""
