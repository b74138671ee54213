"""Keeps the state of a running mission: its topics, its ontology, its nodes and parameters.

Topics are polled, see `polled_subscription`: of what comes faster than it is looked at, only the
newest counts. What nobody publishes is asked for (`mission_questions`); the graph says which nodes
there are (`node_graph_watch`).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from weakref import WeakValueDictionary

from rclpy.context import Context
from rosgraph_msgs.msg import Clock as ClockMessage

from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_questions import MissionQuestions
from surveillance_operator.mission_state import RECORD_OF, MissionState, Notice
from surveillance_operator.node_graph_watch import NodeGraphWatch, current_reports
from surveillance_operator.other_poses import OtherPoses
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.topic_reader import WAKE_PERIOD, TopicReader
from surveillance_operator.topics import read_message
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS

OF_ROBOT = ('door_lines', 'zones', 'coverage')
"""What each robot of a fleet tells of the place by itself; all else of it they share."""
SHARED = tuple(
    name for name, record in RECORD_OF.items() if record == 'place' and name not in OF_ROBOT
)
"""The fields of a state that are the same for all robots of a fleet."""
KEPT = ('notices', 'visited_at', 'urgent', 'links', 'restarts')
"""What is still known when another mission begins: who follows the ontology is told what goes."""


TOGETHER_PERIOD = 0.4
"""Seconds between two looks for nodes that share a subscriber."""
_OF_PROCESS: WeakValueDictionary[tuple[Context, str], MissionSubscriber] = WeakValueDictionary()


class WatchedClock:
    """The mission's time: the topic `/clock` where there is one, else the node's clock.

    Args:
        node: The node that watches.
        shared: The clock of whoever reads the topic already.
    """

    def __init__(self, node: PatrolNode, shared: WatchedClock | None = None) -> None:
        self._node = node
        self._shared = shared
        self._topic = (
            PolledSubscription(node, ClockMessage, '/clock', SENSOR_QOS) if shared is None else None
        )
        self._time: float | None = None

    def read(self) -> None:
        """Take the time that came; from the thread of one reader."""
        if self._shared is not None:
            self._time = self._shared._time
        elif self._topic is not None and (newest := self._topic.newest()) is not None:
            self._time = seconds_of(newest[0].clock)

    def now(self) -> float:
        """Return the time in seconds."""
        if self._time is not None:
            return self._time
        return float(self._node.get_clock().now().nanoseconds) / 1e9

    def forget(self) -> None:
        """Go by the node's clock again, where nobody publishes one."""
        if not self._node.count_publishers('/clock'):
            self._time = None

    def destroy(self) -> None:
        """Leave the topic."""
        if self._topic is not None:
            self._topic.destroy()


class MissionSubscriber:
    """Keeps the state of the mission that a node listens to.

    Its own thread takes messages and looks at the graph; answers to questions come on the node's
    executor. `update` is the one way into the state, under a lock.

    Args:
        node: The node that watches.
        period: Least seconds of steady time between two looks at the topics, or what tells them.
        on_change: Called on the subscriber's thread with each new state and what changed.
        streams: Follow the lidar, too, and look as soon as something comes, where the period is
            short.
        robot: The robot of a fleet whose mission it is; empty: that of the node's own namespace.
        place: With a robot: follows what the robots share, in the node's own namespace.
    """

    def __init__(
        self,
        node: PatrolNode,
        period: float | Callable[[], float],
        on_change: Callable[[MissionState, Sequence[Notice]], None] = lambda _new, _told: None,
        *,
        streams: bool = False,
        robot: str = '',
        place: MissionSubscriber | None = None,
    ) -> None:
        self._node = node
        self._place = place
        self._period = period if callable(period) else lambda: period
        self._on_change = on_change
        prefix = '/'.join((node.get_namespace().rstrip('/'), *filter(None, (robot,)))) or '/'
        namespace = prefix.strip('/')
        where = f'ROS domain {node.context.get_domain_id()}'
        where += f', namespace {namespace}' if namespace else ''
        self._empty = MissionState(where=where, namespace=namespace)
        self._state = self._empty
        self._lock = threading.Lock()
        self._over = False
        self._left = threading.Event()
        clock, graph = (None, None) if place is None else (place._clock, place._graph)
        self._clock: WatchedClock = WatchedClock(node, clock)
        self._reader = TopicReader(node, robot, streams=streams)
        self._graph: NodeGraphWatch = NodeGraphWatch(node, prefix, graph)
        self._questions = MissionQuestions(node, self.update, robot)
        self._others = OtherPoses(node) if streams and not robot else None
        self._robots: Mapping[str, MissionSubscriber] = {}
        node.spawn(self._run, 'mission subscriber')

    @classmethod
    def of_process(cls, node: PatrolNode) -> MissionSubscriber:
        """Return the one subscriber that the nodes of a process and namespace have together.

        It ends with the node that asked first: the nodes of a process end together.
        """
        key = node.context, node.get_namespace()
        found = _OF_PROCESS.get(key)
        if found is None or found._node.stopping.is_set():
            found = _OF_PROCESS[key] = cls(node, TOGETHER_PERIOD)
        return found

    @property
    def state(self) -> MissionState:
        """All that is known, with the time of the last change."""
        return self._state

    def see(self) -> MissionState:
        """Return all that is known, at the mission's present time, or the time of its end."""
        with self._lock:
            return self._state if self._over else replace(self._state, now=self._clock.now())

    def update(
        self, change: Callable[[MissionState], MissionState], *, begins: bool = True
    ) -> None:
        """Take a change into the state; from any thread.

        Args:
            change: From the old state to the new one.
            begins: Whether it tells of a mission, so that after the end of one it is the next.
        """
        with self._lock:
            old = self._state
            new = self._with_place(change(old))
            if new is old or self._left.is_set():
                return
            if self._over and begins:
                old = self._begin_anew()
                new = self._with_place(change(old))
            # Nothing passes after a mission's end.
            now = old.now if self._over else self._clock.now()
            new, told = follow(old, replace(new, now=now), time.time())
            if not self._over and old.health.nodes and not new.health.nodes:
                self._over = True
                self._reader.forget()
            self._state = new
        self._on_change(new, told)

    def pass_on_to(self, robots: Mapping[str, MissionSubscriber]) -> None:
        """Pass on what all robots of a fleet say on one topic to those of the robots, by name."""
        self._robots = robots
        self._reader.robots = {name: each._reader for name, each in robots.items()}

    def leave(self) -> None:
        """Follow the mission no longer: nothing more is told of it, and no topic heard."""
        self._left.set()

    def _with_place(self, state: MissionState) -> MissionState:
        """Return the state of a robot with what the robots of its fleet share."""
        if self._place is None:
            return state
        shared = self._place.state.place
        fields = {
            name: value
            for name in SHARED
            if (value := getattr(shared, name)) is not getattr(state.place, name)
        }
        return state.having(**fields) if fields else state

    def _begin_anew(self) -> MissionState:
        """Return what is still known when another mission begins."""
        self._over = False
        self._reader.forget()
        self._questions.forget()
        self._clock.forget()
        return self._empty.having(**{name: self._state.field(name) for name in KEPT})

    def _run(self) -> None:
        stopping = self._node.stopping
        while not stopping.is_set() and not self._left.is_set():
            self._clock.read()
            self._take()
            if self._graph.is_due():
                self._look()
            period = self._period()
            stopping.wait(period)
            if period < WAKE_PERIOD:
                self._reader.wait()
        if self._left.is_set():
            self._reader.destroy()
            self._clock.destroy()

    def _take(self) -> None:
        """Take all messages that came into one new state."""
        came = self._reader.take()
        others = self._others.take() if self._others is not None else {}
        if not came and not others:
            return

        def changed(state: MissionState) -> MissionState:
            for topic, message in came:
                state = read_message(state, topic, message)
            return state.having(others={**state.place.others, **others}) if others else state

        # Observers go on reporting after a mission's end.
        self.update(changed, begins=any(topic.is_of_mission for topic, _ in came))

    def _look(self) -> None:
        """Look at the graph, and ask for what is missing."""
        found = self._graph.look(self._state.health, self._reader, self._questions.servers)
        if found:
            self.update(lambda old: old.having(**found), begins=bool(found['nodes']))
        reports = current_reports(self._state.health, time.monotonic())
        if reports is not self._state.health.reports:
            self.update(lambda old: old.having(reports=reports), begins=False)
        self._questions.ask()
        if self._others is not None and (gone := self._others.find(self._namespaces())):
            self.update(lambda old: _without_robots(old, gone), begins=False)

    def _namespaces(self) -> frozenset[str]:
        return frozenset(each.state.namespace for each in self._robots.values())


def _without_robots(state: MissionState, gone: frozenset[str]) -> MissionState:
    left = {name: at for name, at in state.place.others.items() if name not in gone}
    return state.having(others=left)
