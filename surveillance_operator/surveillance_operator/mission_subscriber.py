"""Feeds a snapshot from a running mission: its topics, its ontology, its nodes and parameters.

Topics are polled, see `polled_subscription`: of what comes faster than it is looked at, only the
newest counts. What nobody publishes is asked for: the ontology's facts, positions of places, the
lines of doors, parameters; again when another mission has begun.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosgraph_msgs.msg import Clock as ClockMessage

from armor_service.facts import ShortFact
from state_machines.ros import CallError, ServiceCaller
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor_client import ArmorClient, FactSubscription
from surveillance_ontology.patrol_vocabulary import CONNECTIONS, PLACES, URGENT_PLACES, VISITS
from surveillance_operator.mission_state import STALE, Change, MissionState, Pose, follow
from surveillance_operator.polled_subscription import PolledSubscription, await_message
from surveillance_operator.topics import (
    BEHAVIOUR,
    POSE_TOPIC,
    TOPICS,
    Topic,
    behaviour_fields,
    point_from,
    read_message,
    with_fact,
    without,
)
from surveillance_runtime.conversions import clean_texts, pose_from, seconds_of
from surveillance_runtime.diagnostics import STALE_AFTER
from surveillance_runtime.fleet_messages import FLEET_TOPIC
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.place.floor_plan import Door
from surveillance_runtime.place.rooms import ZONE_TABLES, PlaceError, nested
from surveillance_runtime.place.stations import stations_in
from surveillance_runtime.place.zones import Zone, zones_from
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

LOOK_PERIOD = 0.5
"""Seconds of steady time between two looks at which nodes there are."""
WHOLE_LOOK_PERIOD = 5.0
"""And between two at the publishers of each topic, while no node comes or goes."""
TIMEOUT = 2.0
"""Deadline of each question, seconds of steady time; then it is asked again."""

MOST_PASSED_ON = 1000
"""Messages of a topic that all robots speak on that wait for a robot's feed."""
WAKE_PERIOD = 0.1
"""Longest wait for a message, seconds."""
BUILDER = 'ontology_map_builder'
PLANNER = 'planner_controller'
"""The node that knows the doors' lines and the execution mode, as its parameters."""
POSE_TYPE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
OF_THE_PLACE = ('map', 'door_states')
"""The topics that the robots of a fleet share."""
SHARED = ('grid', 'positions', 'links', 'doors', 'visited_at', 'urgent', 'others', 'stations')
"""The fields of a snapshot that are the same for all robots of a fleet."""
OBSERVERS = ('mission_', 'console', 'fleet_')
"""How the names of nodes begin that only look on: after a mission they may go."""
TERMINALS = ('mission_view', 'console', 'fleet_')
"""And of those that are a person's terminal: they may go at any time."""


class MissionSubscriber:
    """Keeps a snapshot of the mission that a node listens to.

    Args:
        node: The node that watches.
        period: Least seconds of steady time between two looks at the topics, or what tells them.
        on_change: Called on the feed's thread with each new snapshot and what changed.
        streams: Follow the lidar, too, and look as soon as something comes, where the period is
            short.
        robot: The robot of a fleet whose mission it is; empty: that of the node's own namespace.
        place: With a robot: follows what the robots share, in the node's own namespace.

    Attributes:
        robots: With the place's feed: those of the robots, by name. It hears what they all say on
            one topic, and passes on to each what concerns it: each would otherwise hear all.
    """

    def __init__(
        self,
        node: PatrolNode,
        period: float | Callable[[], float],
        on_change: Callable[[MissionState, Sequence[Change]], None] = lambda _new, _told: None,
        *,
        streams: bool = False,
        robot: str = '',
        place: MissionSubscriber | None = None,
    ) -> None:
        self._node = node
        self._place = place
        self._period = period if callable(period) else lambda: period
        self._on_change = on_change
        self._prefix = '/'.join((node.get_namespace().rstrip('/'), *filter(None, (robot,)))) or '/'
        namespace = self._prefix.strip('/')
        where = f'ROS domain {node.context.get_domain_id()}'
        where += f', namespace {namespace}' if namespace else ''
        self._empty = MissionState(where=where, namespace=namespace)
        self._snapshot = self._empty
        self._lock = threading.Lock()
        self._over = False
        self._clock_time: float | None = None
        self._clock = None
        if place is None:
            self._clock = PolledSubscription(node, ClockMessage, '/clock', SENSOR_QOS)
        self._topics = [
            (topic, PolledSubscription(node, topic.kind, name_for(robot, topic.name), topic.qos))
            for topic in TOPICS
            if (streams or not topic.stream)
            and not (robot and (topic.name in OF_THE_PLACE or topic.whose is not None))
        ]
        # The lidar comes with the pose, and health now and then.
        self._prompt = [
            subscription
            for topic, subscription in self._topics
            if streams and not topic.beside and not topic.period
        ]
        self._left = threading.Event()
        self._facts = _Facts(node, self.update, robot)
        self._others = _OtherRobots(node) if streams and not robot else None
        self.robots: Mapping[str, MissionSubscriber] = {}
        self._passed_on: deque[tuple[Topic, Any]] = deque(maxlen=MOST_PASSED_ON)
        self._publishers: Sequence[TopicEndpointInfo] = ()
        self._next_look = self._next_whole_look = self._changed_at = 0.0
        self._processes: Mapping[str, set[str]] = {}
        self._next_reading: dict[str, float] = {}
        node.spawn(self._run, 'mission feed')

    @property
    def snapshot(self) -> MissionState:
        """All that is known, with the time of the last change."""
        return self._snapshot

    def see(self) -> MissionState:
        """Return all that is known, at the mission's present time, or the time of its end."""
        with self._lock:
            return self._snapshot if self._over else replace(self._snapshot, now=self._now())

    def update(
        self, change: Callable[[MissionState], MissionState], *, begins: bool = True
    ) -> None:
        """Take a change into the snapshot; from any thread.

        Args:
            change: From the old snapshot to the new one.
            begins: Whether it tells of a mission, so that after the end of one it is the next.
        """
        with self._lock:
            old = self._snapshot
            new = self._with_place(change(old))
            if new is old or self._left.is_set():
                return
            if self._over and begins:
                old = self._begin_anew()
                new = self._with_place(change(old))
            # Nothing passes after a mission's end.
            now = old.now if self._over else self._now()
            new, told = follow(old, replace(new, now=now), time.time())
            self._over = self._over or bool(old.nodes and not new.nodes)
            self._snapshot = new
        self._on_change(new, told)

    def leave(self) -> None:
        """Follow the mission no longer: nothing more is told of it, and no topic heard."""
        self._left.set()

    def _with_place(self, snapshot: MissionState) -> MissionState:
        """Return the snapshot of a robot with what the robots of its fleet share."""
        if self._place is None:
            return snapshot
        shared = self._place.snapshot
        fields = {
            name: value
            for name in SHARED
            if (value := getattr(shared, name)) is not getattr(snapshot, name)
        }
        return replace(snapshot, **fields) if fields else snapshot

    def _begin_anew(self) -> MissionState:
        """Return what is still known when another mission begins."""
        self._over = False
        self._facts.forget()
        if not self._node.count_publishers('/clock'):
            self._clock_time = None
        # What follows the ontology tells what goes, too.
        kept = ('events', 'visited_at', 'urgent', 'links', 'restarts')
        return replace(self._empty, **{name: getattr(self._snapshot, name) for name in kept})

    def _run(self) -> None:
        stopping = self._node.stopping
        while not stopping.is_set() and not self._left.is_set():
            self._take()
            if time.monotonic() >= self._next_look:
                self._next_look = time.monotonic() + LOOK_PERIOD
                self._look()
            period = self._period()
            stopping.wait(period)
            if self._prompt and period < WAKE_PERIOD:
                await_message(self._node.context, self._prompt, WAKE_PERIOD)
        if self._left.is_set():
            for _, subscription in self._topics:
                subscription.destroy()
            if self._clock is not None:
                self._clock.destroy()

    def _take(self) -> None:
        """Take all messages that came into one new snapshot."""
        if self._place is not None:
            self._clock_time = self._place._clock_time
        elif self._clock is not None and (newest := self._clock.newest()) is not None:
            self._clock_time = seconds_of(newest[0].clock)
        came: list[tuple[Topic, Any]] = []
        while self._passed_on:
            came.append(self._passed_on.popleft())
        for topic, subscription in self._topics:
            if topic.beside and not any(each.name == topic.beside for each, _ in came):
                continue
            if topic.period and not self._is_due(topic):
                continue
            for _ in range(subscription.qos.depth):
                if (taken := subscription.take()) is None:
                    break
                clean_texts(taken[0])
                if topic.whose is not None:
                    self._pass_on(topic, topic.whose(taken[0]), taken[0])
                # In front: what it stands beside is read with it.
                came.insert(0 if topic.beside else len(came), (topic, taken[0]))
        others = self._others.take() if self._others is not None else {}
        if not came and not others:
            return

        def changed(snapshot: MissionState) -> MissionState:
            for topic, message in came:
                snapshot = read_message(snapshot, topic, message)
            return replace(snapshot, others={**snapshot.others, **others}) if others else snapshot

        # Observers go on reporting after a mission's end.
        self.update(changed, begins=any(topic.name[0] != '/' for topic, _ in came))

    def _pass_on(self, topic: Topic, whose: frozenset[str] | None, message: Any) -> None:
        robots = self.robots
        for name in robots if whose is None else whose & robots.keys():
            robots[name]._passed_on.append((topic, message))

    def _is_due(self, topic: Topic) -> bool:
        now = time.monotonic()
        if now < self._next_reading.get(topic.name, 0.0):
            return False
        self._next_reading[topic.name] = now + topic.period
        return True

    def _look(self) -> None:
        node, now = self._node, time.monotonic()
        processes: dict[str, set[str]] = {}
        if self._place is None:
            self._publishers = node.get_publishers_info_by_topic('/rosout')  # which every node has
        for log in self._publishers if self._place is None else self._place._publishers:
            if log.node_namespace == self._prefix:
                processes.setdefault(log.node_name, set()).add(str(log.endpoint_gid))
        if processes != self._processes:
            self._processes, self._changed_at = processes, now
        # A node's topics are found some time after the node.
        if now < self._changed_at + WHOLE_LOOK_PERIOD or now >= self._next_whole_look:
            self._next_whole_look = now + WHOLE_LOOK_PERIOD
            self._look_at_topics(processes)
        self._note_silent()
        self._facts.ask()
        if self._others is not None and (
            gone := self._others.find(
                frozenset(each.snapshot.namespace for each in self.robots.values())
            )
        ):
            self.update(
                lambda old: replace(
                    old, others={name: at for name, at in old.others.items() if name not in gone}
                ),
                begins=False,
            )

    def _look_at_topics(self, processes: Mapping[str, set[str]]) -> None:
        """Note which nodes there are, and whose topics cannot be heard."""
        old = self._snapshot
        names, silent = set(self._facts.servers()), dict(old.silent)
        for topic, subscription in self._topics:
            for info in self._node.get_publishers_info_by_topic(subscription.topic):
                is_of_all = topic.name.startswith('/') or topic.name == FLEET_TOPIC
                if not is_of_all and not info.node_name.startswith('_'):
                    names.add(info.node_name)
                fits, reason = qos_check_compatible(info.qos_profile, subscription.qos)
                if fits == QoSCompatibility.ERROR:
                    silent[topic.name] = _mismatch(reason)
        if names:  # there is a mission: all its nodes count, also those that tell nothing of it
            names |= {name for name in processes if not name.startswith(('_', *OBSERVERS))}
        nodes = {name: frozenset(processes.get(name, ())) for name in names}
        if nodes == old.nodes and silent == old.silent:
            return
        ended = old.ended.union(old.nodes).difference(nodes)
        self.update(
            lambda old: replace(old, nodes=nodes, ended=ended, silent=silent), begins=bool(nodes)
        )

    def _note_silent(self) -> None:
        """Mark the nodes whose own reports have ceased, and forget those that may go."""
        now = time.monotonic()
        may_go = TERMINALS if self._snapshot.nodes else OBSERVERS
        health = dict(self._snapshot.health)
        for name, each in self._snapshot.health.items():
            if now - each.heard <= STALE_AFTER:
                continue
            if name.rpartition('/')[2].startswith(may_go):
                del health[name]
            elif each.level != STALE:
                health[name] = replace(each, level=STALE, message=f'silent, last: {each.message}')
        if health != self._snapshot.health:
            self.update(lambda old: replace(old, health=health), begins=False)

    def _now(self) -> float:
        if self._clock_time is not None:
            return self._clock_time
        return float(self._node.get_clock().now().nanoseconds) / 1e9


class _Facts:
    """Asks and follows what is not published: facts, positions, parameters.

    Args:
        node: The node that watches.
        update: Takes a function from the old snapshot to the new one.
        robot: The robot of a fleet; then what the robots share is not asked for.
    """

    def __init__(
        self,
        node: PatrolNode,
        update: Callable[[Callable[[MissionState], MissionState]], None],
        robot: str = '',
    ) -> None:
        self._node = node
        self._update = update
        self._reference = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        self._position = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        planner, behaviour = name_for(robot, PLANNER), name_for(robot, BEHAVIOUR)
        self._list = ServiceCaller(node, ListParameters, f'{planner}/list_parameters')
        self._get = ServiceCaller(node, GetParameters, f'{planner}/get_parameters')
        self._list_stations = ServiceCaller(node, ListParameters, f'{BUILDER}/list_parameters')
        self._get_stations = ServiceCaller(node, GetParameters, f'{BUILDER}/get_parameters')
        self._get_behaviour = ServiceCaller(node, GetParameters, f'{behaviour}/get_parameters')
        follow_place(node, self._take_place)
        self._armor: ArmorClient | None = None
        self._followed: list[FactSubscription] = []
        self._places: set[str] = set()
        self._without_position: set[str] = set()
        of_robot = (self._ask_doors, self._ask_behaviour)
        shared = (self._ask_reference, self._ask_stations)
        self._questions = of_robot if robot else (*of_robot, *shared)
        self._asks_places = not robot
        self._changed = False
        self._unanswered = set(self._questions)
        self._asking = False

    def _take_place(self, described: Mapping[str, Any]) -> None:
        """Take doors, zones, stations and points of a place that was changed."""
        lines = {
            name: Door(name, *row).segment for name, row in (described.get('doors') or {}).items()
        }
        zones, stations = _zones_of(described), _poses_of(described)
        self._without_position |= self._places
        # From now on the nodes' parameters are those of the place as it was.
        self._changed = True
        self._update(lambda old: replace(old, door_lines=lines, zones=zones, stations=stations))

    def forget(self) -> None:
        """Ask anew: another mission may have another map."""
        self._changed = False
        self._unanswered = set(self._questions)
        self._without_position = set(self._places)

    def servers(self) -> frozenset[str]:
        """Return the nodes that there are now to answer."""
        known = [(PLANNER, self._get)]
        if self._asks_places:
            known.append((BUILDER, self._position))
        return frozenset(name for name, service in known if service.is_ready())

    def ask(self) -> None:
        """Ask for what is missing, if it is not being asked for; call it now and then."""
        missing = self._unanswered or self._without_position
        if missing and not self._asking and self._node.executor is not None:
            self._asking = True
            self._node.executor.create_task(self._ask)

    async def _ask(self) -> None:
        try:
            for question in (*self._questions, self._ask_positions):
                if question in self._unanswered or question == self._ask_positions:
                    # Not after it: what is to be asked anew meanwhile stays so.
                    self._unanswered.discard(question)
                    try:
                        await question()
                    except CallError as error:
                        if question in self._questions:
                            self._unanswered.add(question)
                        self._node.get_logger().debug(str(error))
        finally:
            self._asking = False

    async def _ask_reference(self) -> None:
        name = (await self._reference.call_async(ReferenceName.Request(), TIMEOUT)).name
        if self._armor is not None:
            if name != self._armor.reference_name:
                self._armor.reference_name = name
                for followed in self._followed:
                    followed.ask_anew()
            return
        self._armor = ArmorClient(self._node, self._node.get_name(), name, timeout=TIMEOUT)
        for pattern, callback in (
            (PLACES, self._on_place),
            (URGENT_PLACES, self._on_fact),
            (VISITS, self._on_fact),
            (CONNECTIONS, self._on_fact),
        ):
            self._followed.append(FactSubscription(self._node, self._armor, pattern, callback))

    async def _ask_positions(self) -> None:
        for place in sorted(self._without_position):
            request = RoomPosition.Request(room_name=place)
            self._without_position.discard(place)
            try:
                answer = await self._position.call_async(request, TIMEOUT)
            except CallError:
                self._without_position.add(place)
                raise
            if answer.valid and place in self._places:
                self._update(_with_position(place, point_from(answer.position)))

    async def _ask_doors(self) -> None:
        request = ListParameters.Request(prefixes=['doors', *ZONE_TABLES])
        listed = await self._list.call_async(request, TIMEOUT)
        names = ['execution_mode', *listed.result.names]
        values = (await self._get.call_async(GetParameters.Request(names=names), TIMEOUT)).values
        if len(values) != len(names):
            raise CallError(f'{PLANNER} gave {len(values)} of {len(names)} parameters')
        found = nested(
            dict(zip(names[1:], map(parameter_value_to_python, values[1:]), strict=True))
        )
        lines = {
            name: Door(name, *row).segment
            for name, row in (found.get('doors') or {}).items()
            if row is not None and len(row) == 4
        }
        mode, zones = values[0].string_value, _zones_of(found)
        if self._changed:
            self._update(lambda old: replace(old, mode=mode))
        else:
            self._update(lambda old: replace(old, mode=mode, door_lines=lines, zones=zones))

    async def _ask_stations(self) -> None:
        """Ask who answers for the places' points where the stations are."""
        request = ListParameters.Request(prefixes=['stations'])
        listed = await self._list_stations.call_async(request, TIMEOUT)
        names = ['recharge_rooms', 'station', *listed.result.names]
        answer = await self._get_stations.call_async(GetParameters.Request(names=names), TIMEOUT)
        if len(answer.values) != len(names):
            raise CallError(f'{BUILDER} gave {len(answer.values)} of {len(names)} parameters')
        given = dict(zip(names, map(parameter_value_to_python, answer.values), strict=True))
        single = {name: given.pop(name) for name in names[:2]}
        table = nested(nested(given).get('stations', {}))
        stations = _poses_of({**single, 'stations': table})
        if not self._changed:
            self._update(lambda old: replace(old, stations=stations))

    async def _ask_behaviour(self) -> None:
        names = ['urgency_threshold', 'policy']
        request = GetParameters.Request(names=names)
        values = (await self._get_behaviour.call_async(request, TIMEOUT)).values
        fields = behaviour_fields(dict(zip(names, values, strict=False)))
        self._update(lambda old: replace(old, **fields))

    def _on_place(self, fact: ShortFact, came: bool) -> None:
        (place,) = fact.arguments
        for places in (self._places, self._without_position):
            (places.add if came else places.discard)(place)
        if not came:
            self._update(lambda old: replace(old, positions=without(old.positions, place)))

    def _on_fact(self, fact: ShortFact, came: bool) -> None:
        self._update(lambda old: with_fact(old, fact, came))


class _OtherRobots:
    """Where the robots of other namespaces are.

    Args:
        node: The node that watches.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._own = node.get_namespace().strip('/')
        self._poses: dict[str, PolledSubscription] = {}

    def find(self, left_out: frozenset[str]) -> frozenset[str]:
        """Hear the robots that came; return the names of those that went, or are left out."""
        for topic, kinds in self._node.get_topic_names_and_types():
            namespace, _, name = topic.strip('/').rpartition('/')
            robot = namespace or 'robot'
            is_pose = name == POSE_TOPIC and POSE_TYPE in kinds
            is_other = is_pose and namespace != self._own and namespace not in left_out
            if is_other and robot not in self._poses and self._node.count_publishers(topic):
                self._poses[robot] = PolledSubscription(
                    self._node, PoseWithCovarianceStamped, topic, STATE_QOS
                )
        gone = frozenset(
            robot
            for robot, subscription in self._poses.items()
            if robot in left_out or not self._node.count_publishers(subscription.topic)
        )
        for robot in gone:
            self._poses.pop(robot).destroy()
        return gone

    def take(self) -> dict[str, Pose]:
        """Return the poses that came."""
        came = {}
        for robot, subscription in self._poses.items():
            if (newest := subscription.newest()) is not None:
                with contextlib.suppress(ValueError):
                    came[robot] = pose_from(newest[0].pose.pose)
        return came


def _zones_of(described: Mapping[str, Any]) -> dict[str, Zone]:
    """Return the zones of a place, by name; none where they are not sound."""
    tables = {
        table: {name: list(row or ()) for name, row in (described.get(table) or {}).items()}
        for table in ZONE_TABLES
    }
    try:
        zones = zones_from(tables)
    except PlaceError:
        return {}
    return {**zones.keep_out, **zones.slow}


def _poses_of(described: Mapping[str, Any]) -> dict[str, Pose]:
    """Return the poses of a place's stations; none where they are not sound."""
    try:
        return {
            room: station.pose
            for room, station in stations_in(described).items()
            if room and (described.get('station') or described.get('stations'))
        }
    except PlaceError:
        return {}


def _mismatch(reason: str) -> str:
    for words, policy in (('transient local', 'DURABILITY'), ('best effort', 'RELIABILITY')):
        if words in reason.lower():
            return f'its publisher offers another {policy}'
    return f'its publisher does not fit: {reason}'


def _with_position(
    place: str, point: tuple[float, float]
) -> Callable[[MissionState], MissionState]:
    return lambda old: replace(old, positions={**old.positions, place: point})
