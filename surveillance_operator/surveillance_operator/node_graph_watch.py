"""Which nodes of a mission there are, and whose words cannot be heard or have ceased."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from surveillance_operator.mission_state import STALE, HealthView, NodeReport
from surveillance_operator.polled_subscription import PolledSubscription
from surveillance_operator.topics import Topic
from surveillance_runtime.diagnostics import STALE_AFTER
from surveillance_runtime.node import PatrolNode

LOOK_PERIOD = 0.5
"""Seconds of steady time between two looks at which nodes there are."""
WHOLE_LOOK_PERIOD = 5.0
"""And between two at the publishers of each topic, while no node comes or goes."""
OBSERVERS = ('mission_', 'console', 'fleet_')
"""How the names of nodes begin that only look on: after a mission they may go."""
TERMINALS = ('mission_view', 'console', 'fleet_')
"""And of those that are a person's terminal: they may go at any time."""


class NodeGraphWatch:
    """Looks at the graph for the nodes of one robot's mission.

    Args:
        node: The node that looks.
        namespace: Of the mission, as the graph has it: `/` or `/robot1`.
        shared: Whoever looks for the whole fleet, whose list of all nodes serves this one, too.
    """

    def __init__(
        self, node: PatrolNode, namespace: str, shared: NodeGraphWatch | None = None
    ) -> None:
        self._node = node
        self._namespace = namespace
        self._shared = shared
        self._logs: Sequence[TopicEndpointInfo] = ()
        self._processes: Mapping[str, set[str]] = {}
        self._next_look = self._next_whole_look = self._changed_at = 0.0

    def is_due(self) -> bool:
        """Tell whether it is time for the next look, and count it as taken."""
        if (now := time.monotonic()) < self._next_look:
            return False
        self._next_look = now + LOOK_PERIOD
        return True

    def look(
        self,
        health: HealthView,
        topics: Iterable[tuple[Topic, PolledSubscription]],
        servers: Callable[[], frozenset[str]],
    ) -> dict[str, Any]:
        """Return the fields of the health that have changed.

        Args:
            health: As it was known.
            topics: The topics that are listened to.
            servers: Returns the nodes that answer the questions to a mission.
        """
        now = time.monotonic()
        if self._shared is None:  # which every node has:
            self._logs = self._node.get_publishers_info_by_topic('/rosout')
        processes: dict[str, set[str]] = {}
        for log in self._logs if self._shared is None else self._shared._logs:
            if log.node_namespace == self._namespace:
                processes.setdefault(log.node_name, set()).add(str(log.endpoint_gid))
        if processes != self._processes:
            self._processes, self._changed_at = processes, now
        # A node's topics are found some time after the node.
        if now >= self._changed_at + WHOLE_LOOK_PERIOD and now < self._next_whole_look:
            return {}
        self._next_whole_look = now + WHOLE_LOOK_PERIOD
        names, silent = set(servers()), dict(health.silent)
        for topic, subscription in topics:
            for info in self._node.get_publishers_info_by_topic(subscription.topic):
                # On a topic of a whole fleet, other robots' nodes speak.
                is_own = topic.is_of_mission and topic.whose is None
                if is_own and not info.node_name.startswith('_'):
                    names.add(info.node_name)
                fits, reason = qos_check_compatible(info.qos_profile, subscription.qos)
                if fits == QoSCompatibility.ERROR:
                    silent[topic.name] = _mismatch(reason)
        if names:  # there is a mission: all its nodes count, also those that tell nothing of it
            names |= {name for name in processes if not name.startswith(('_', *OBSERVERS))}
        nodes = {name: frozenset(processes.get(name, ())) for name in names}
        if nodes == health.nodes and silent == health.silent:
            return {}
        ended = health.ended.union(health.nodes).difference(nodes)
        return {'nodes': nodes, 'ended': ended, 'silent': silent}


def current_reports(health: HealthView, now: float) -> Mapping[str, NodeReport]:
    """Return the nodes' reports: those that have ceased marked, without those of who may go.

    Args:
        health: What is known.
        now: Seconds of steady time.
    """
    may_go = TERMINALS if health.nodes else OBSERVERS
    reports = dict(health.reports)
    for name, each in health.reports.items():
        if now - each.heard <= STALE_AFTER:
            continue
        if name.rpartition('/')[2].startswith(may_go):
            del reports[name]
        elif each.level != STALE:
            reports[name] = replace(each, level=STALE, message=f'silent, last: {each.message}')
    return health.reports if reports == health.reports else reports


def _mismatch(reason: str) -> str:
    for words, policy in (('transient local', 'DURABILITY'), ('best effort', 'RELIABILITY')):
        if words in reason.lower():
            return f'its publisher offers another {policy}'
    return f'its publisher does not fit: {reason}'
