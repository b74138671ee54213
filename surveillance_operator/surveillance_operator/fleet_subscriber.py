"""Keeps the states of all robots that a watcher sees: of one, or of those that share a patrol.

A watcher listens in one namespace. Either a robot's mission is there, or what the robots of a fleet
share; then each robot has a namespace of its own below. Which these are, the publishers of
`fleet_robots` tell, and the readers of the shared `place`, which any program of a robot may be: a
robot whose behaviour is down is stopped with the others. The state of the watcher's own
namespace has no name.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from floor_plans.fleet import problem_in_robot_name
from surveillance_operator.mission_state import MissionState, Notice
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_operator.node_graph_watch import LOOK_PERIOD
from surveillance_runtime.fleet_messages import FLEET_TOPIC
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import BY_NAME
from surveillance_runtime.place_changes import TOPIC as PLACE_TOPIC

OnChange = Callable[[str, MissionState, Sequence[Notice]], None]
"""Takes a robot's name, its state, and what changed."""


class FleetSubscriber:
    """Keeps a state of each robot.

    Args:
        node: The node that watches.
        period: As of a `MissionSubscriber`.
        on_change: Called on a subscriber's thread.
        on_leave: Called when a robot of an earlier mission is no longer shown.
        streams: As of a `MissionSubscriber`.
    """

    def __init__(
        self,
        node: PatrolNode,
        period: float | Callable[[], float],
        on_change: OnChange = lambda _robot, _new, _told: None,
        on_leave: Callable[[str], None] = lambda _robot: None,
        *,
        streams: bool = False,
    ) -> None:
        self._node = node
        self._period, self._streams = period, streams
        self._on_change, self._on_leave = on_change, on_leave
        self._lock = threading.Lock()
        self._subscribers: dict[str, MissionSubscriber] = {}
        self._place = MissionSubscriber(node, period, self._on_place, streams=streams)
        self._subscribers[''] = self._place
        node.spawn(self._run, 'fleet subscriber')

    @property
    def robots(self) -> tuple[str, ...]:
        """The names of the robots, in order; one that is alone has none: ''."""
        with self._lock:
            return tuple(sorted(self._subscribers.keys() - {''})) or ('',)

    def state(self, robot: str) -> MissionState:
        """Return all that is known of a robot, with the time of the last change.

        Raises:
            KeyError: There is no such robot.
        """
        return self._subscribers[robot].state

    def see(self) -> dict[str, MissionState]:
        """Return the state of each robot at the mission's present time.

        Of a fleet, what the robots share is there, too, last and without a name.
        """
        with self._lock:
            subscribers = sorted(self._subscribers.items(), key=lambda each: (not each[0], each[0]))
        return {name: each.see() for name, each in subscribers}

    def _on_place(self, new: MissionState, told: Sequence[Notice]) -> None:
        self._on_change('', new, told)
        for name, each in list(self._subscribers.items()):
            if name:
                each.update(lambda old: old, begins=False)  # which takes in what is shared

    def _run(self) -> None:
        while not self._node.stopping.wait(LOOK_PERIOD):
            found = self._find()
            known = self._subscribers.keys() - {''}
            if found - known and not any(
                self._subscribers[name].state.health.nodes for name in known
            ):
                # Another fleet begins: whoever has ended before is not missed.
                for name in known - found:
                    self._subscribers.pop(name).leave()
                    self._on_leave(name)
                self._tell_place()
            for name in sorted(found - known):
                self._follow(name)

    def _tell_place(self) -> None:
        """Have the place's subscriber know whom to pass on what all robots say on one topic."""
        self._place.pass_on_to(
            {name.rpartition('/')[2]: each for name, each in self._subscribers.items() if name}
        )

    def _find(self) -> set[str]:
        """Return the robots of which a program says or reads what all of them share."""
        node = self._node
        own = node.get_namespace().rstrip('/') + '/'
        ends = node.get_publishers_info_by_topic(node.resolve_topic_name(FLEET_TOPIC))
        ends += node.get_subscriptions_info_by_topic(node.resolve_topic_name(PLACE_TOPIC))
        below = {
            each.node_namespace.removeprefix(own)
            for each in ends
            if each.node_namespace.startswith(own) and each.node_namespace != own
        }
        return {name for name in below if not problem_in_robot_name(name, BY_NAME)}

    def _follow(self, name: str) -> None:
        def on_change(new: MissionState, told: Sequence[Notice]) -> None:
            self._on_change(name, new, told)

        subscriber = MissionSubscriber(
            self._node,
            self._period,
            on_change,
            streams=self._streams,
            robot=name,
            place=self._place,
        )
        with self._lock:
            self._subscribers = {**self._subscribers, name: subscriber}
        self._tell_place()
        self._on_change(name, subscriber.state, ())
