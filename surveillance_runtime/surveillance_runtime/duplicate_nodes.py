"""Two robots of the same names in one ROS domain, by mistake: found, named, and one is refused.

Each node tells once a second on `/diagnostics` of which launch it is (`launch_of_process`). Where
nodes of one name speak from two launches, their services would be mixed: the launch that is
younger ends, the other one says so in an incident for as long as it hears the other. Robots that
are to share a domain have a namespace each, and so other names.

What is said of a node counts only where the graph says that its publisher is of that node's
process, and one message alone counts for nothing: a node that was killed stays in the graph, but
says nothing more.

`python -m surveillance_runtime.duplicate_nodes NODE...` listens before a launch begins, prints
who is there already, one line each, and ends with exit code 3 if anybody is.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from surveillance_runtime.diagnostics import PERIOD, TOPIC
from surveillance_runtime.incidents import Severity
from surveillance_runtime.launch_protocol import AGE, EXIT_THERE, LAUNCH, launch_of_process
from surveillance_runtime.message_source import SOURCE
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import RUN_NODES
from surveillance_runtime.periods import every
from surveillance_runtime.state_topics import publishers_of

ALIVE = 3.5 * PERIOD
"""A node that was silent for longer is not there, seconds."""
ENOUGH = 2
"""How many messages of a node it takes."""
CLOSE = 5.0
"""Launches whose ages differ by less began together, seconds; then the one whose name comes first
stays."""
LISTEN = 2.5
"""How long one listens before a launch begins, seconds."""


@dataclass(frozen=True)
class Launch:
    """Where nodes come from.

    Attributes:
        name: Host and process of who started them.
        age: For how long that process has run, seconds.
    """

    name: str
    age: float

    def yields_to(self, other: Launch) -> bool:
        """Return whether this one ends where both have nodes of the same names."""
        if abs(self.age - other.age) > CLOSE:
            return self.age < other.age
        return self.name > other.name


@dataclass
class _Spoken:
    launch: Launch
    times: int
    last: float


class DuplicateNodes:
    """What was heard of nodes, and which of them have a namesake in another launch.

    Args:
        own: The launch of whoever listens.
    """

    def __init__(self, own: str) -> None:
        self._own = own
        self._spoken: dict[tuple[str, bytes], _Spoken] = {}

    def hear(self, node: str, publisher: bytes, launch: Launch, now: float) -> None:
        """Take that a node has spoken.

        Args:
            node: Its full name.
            publisher: Who said so; the graph knows it for one of this node's process.
            launch: Where it says that it comes from.
            now: Steady time, seconds.
        """
        spoken = self._spoken.setdefault((node, publisher), _Spoken(launch, 0, now))
        spoken.launch, spoken.times, spoken.last = launch, spoken.times + 1, now

    def launches(self, now: float, nodes: Collection[str] = ()) -> dict[Launch, list[str]]:
        """Return the other launches that have nodes of some names, with these names.

        Args:
            now: Steady time, seconds.
            nodes: The names; empty: those that the own launch has.
        """
        self._spoken = {
            key: spoken for key, spoken in self._spoken.items() if now - spoken.last <= ALIVE
        }
        names = set(nodes) or {
            node for (node, _), each in self._spoken.items() if each.launch.name == self._own
        }
        found: dict[str, tuple[Launch, list[str]]] = {}
        for (node, _), spoken in self._spoken.items():
            if node in names and spoken.launch.name != self._own and spoken.times >= ENOUGH:
                found.setdefault(spoken.launch.name, (spoken.launch, []))[1].append(node)
        return {launch: sorted(there) for launch, there in found.values()}

    def own_age(self) -> float:
        """Return the age of the own launch, as its nodes said last, seconds."""
        ages = [each.launch.age for each in self._spoken.values() if each.launch.name == self._own]
        return max(ages, default=0.0)


LONGEST = 65_536
"""Bytes of what a process of a launch says of its nodes at most."""
_PARTICIPANT = 12
"""So many bytes at the beginning of an endpoint's identity are those of its process (RTPS 2.2,
8.2.4.1)."""


class _Ears:
    """Hears the nodes of a ROS domain for a `DuplicateNodes`."""

    def __init__(self, node: PatrolNode, duplicates: DuplicateNodes) -> None:
        self._node = node
        self._duplicates = duplicates
        self._nodes: dict[bytes, set[str]] = {}
        self._looked_at = -PERIOD
        node.create_subscription(DiagnosticArray, TOPIC, self._on_heard, 50, raw=True)

    def _on_heard(self, heard: bytes, info: dict[str, Any]) -> None:
        if len(heard) > LONGEST:
            return  # no process of a launch says so much
        publisher = info.get(SOURCE, b'')
        for status in deserialize_message(heard, DiagnosticArray).status:
            name = f'/{status.name}'
            values = {each.key: each.value for each in status.values}
            if name.rpartition('/')[2] not in RUN_NODES or LAUNCH not in values:
                continue
            if not self._is_of(name, publisher):
                continue
            try:
                launch = Launch(values[LAUNCH], float(values[AGE]))
            except (KeyError, ValueError):
                continue
            self._duplicates.hear(name, publisher, launch, time.monotonic())

    def _is_of(self, name: str, publisher: bytes) -> bool:
        """Return whether a node is in the process of a publisher."""
        process, now = publisher[:_PARTICIPANT], time.monotonic()
        if name not in self._nodes.get(process, ()) and now - self._looked_at >= PERIOD:
            self._looked_at, self._nodes = now, {}
            for log, node in publishers_of(self._node, '/rosout').items():  # every node has one
                self._nodes.setdefault(log[:_PARTICIPANT], set()).add(node)
        return name in self._nodes.get(process, ())


class DuplicateNodeWatch:
    """Has a node tell of another robot of the same names, and end where its own is the younger.

    Args:
        node: The node; its launch is the own one.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._own, _ = launch_of_process()
        self._duplicates = DuplicateNodes(self._own)
        self._told: set[str] = set()
        _Ears(node, self._duplicates)
        every(node, PERIOD, self._look)

    def _look(self) -> None:
        found = self._duplicates.launches(time.monotonic())
        own = Launch(self._own, self._duplicates.own_age())
        for launch, nodes in found.items():
            text = described(launch, nodes, self._node.context.get_domain_id())
            if own.yields_to(launch):
                self._node.fail(f'{text}; this launch ends', unusable=True)
                return
            if launch.name not in self._told:
                self._told.add(launch.name)
                self._node.incidents.begin(('robot', launch.name), text, Severity.ALARM)
        for name in self._told - {launch.name for launch in found}:
            self._told.discard(name)
            self._node.incidents.end(('robot', name))


def described(launch: Launch, nodes: Sequence[str], domain: int) -> str:
    """Say who else is there, and what was expected."""
    return (
        f'another robot of these names is in ROS domain {domain}, started by {launch.name} '
        f'{launch.age:.0f} s ago: {", ".join(nodes)}; expected another --domain or --namespace'
    )


def main(words: Sequence[str] | None = None) -> int:
    """Listen for nodes of some names before a launch begins."""
    from surveillance_runtime.process import ExecutorThread

    parser = argparse.ArgumentParser(description='Name the launches that have nodes of some names.')
    parser.add_argument('nodes', nargs='+', help='their full names')
    names = parser.parse_args(words).nodes
    rclpy.init(args=[])
    spinner = ExecutorThread()
    node = PatrolNode(f'listener_{os.getpid()}', use_global_arguments=False)
    duplicates = DuplicateNodes('')
    _Ears(node, duplicates)
    spinner.executor.add_node(node)
    spinner.start()
    end, found = time.monotonic() + LISTEN, dict[Launch, list[str]]()
    while time.monotonic() < end and not found:
        time.sleep(0.05)
        found = duplicates.launches(time.monotonic(), names)
    for launch, nodes in found.items():
        print(described(launch, nodes, node.context.get_domain_id()))
    node.stop()
    spinner.stop()
    node.destroy_node()
    rclpy.try_shutdown()
    return EXIT_THERE if found else 0


if __name__ == '__main__':
    sys.exit(main())
