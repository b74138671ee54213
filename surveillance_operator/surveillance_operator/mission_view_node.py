"""The node `mission_view`: shows a running mission in its terminal; it only listens and asks.

In a terminal it draws, elsewhere it prints one line for each change.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from rclpy.clock import Clock, ClockType
from rich.console import Console
from rosgraph_msgs.msg import Clock as ClockMessage

from surveillance_operator.mission_facts import RosMissionFacts
from surveillance_operator.mission_topics import RosMissionTopics
from surveillance_operator.snapshot import Snapshot, changes
from surveillance_operator.watch.screen import show_moving, show_once
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS

LOOK_PERIOD = 0.5
"""Seconds of steady time between two looks at which nodes there are."""
KEPT_EVENTS = 50


class MissionViewNode(PatrolNode):
    """Gathers what a mission tells, and shows it.

    Attributes:
        snapshot: All that is known.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('mission_view', **node_options)
        self._once = self.parameter('once', False, 'Print one picture and end.', read_only=True)
        self._timeout = self.parameter(
            'timeout', 5.0, 'With once: longest wait for a mission, seconds.', minimum=0.1
        )
        self._console = Console(highlight=False)
        self._clock_time: float | None = None
        self._over = False
        namespace = self.get_namespace().strip('/')
        where = f'ROS domain {self.context.get_domain_id()}'
        where += f', namespace {namespace}' if namespace else ''
        self._empty = Snapshot(where=where)
        self.snapshot = self._empty
        self._facts = RosMissionFacts(self, self._update)
        self._topics = RosMissionTopics(self, self._update)
        self.create_subscription(ClockMessage, '/clock', self._on_clock, SENSOR_QOS)
        # Steady time: a simulated clock may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self._draws = self._once or self._console.is_terminal
        if self._draws:
            self.spawn(self._draw, 'display')
        else:
            self._print(f'watching {where}')

    def see(self) -> Snapshot:
        """All that is known, at the mission's present time, or the time of its end."""
        return self.snapshot if self._over else replace(self.snapshot, now=self._now())

    def _update(self, change: Callable[[Snapshot], Snapshot]) -> None:
        old = self.snapshot
        if self._over:
            self._over = False
            self._facts.forget()
            # What follows the ontology tells what goes, too.
            old = replace(
                self._empty,
                events=old.events,
                visited_at=old.visited_at,
                urgent=old.urgent,
                links=old.links,
            )
        new = change(old)
        at = time.strftime('%H:%M:%S')
        told = list(changes(old, new))
        events = [(at, each.text) for each in told if not each.routine]
        self.snapshot = replace(new, events=(*new.events, *events)[-KEPT_EVENTS:])
        if not self._draws:
            for each in told:
                self._print(f'{at} {each.text} {each.detail}'.rstrip())

    def _look(self) -> None:
        old = self.snapshot
        processes: dict[str, set[str]] = {}
        for log in self.get_publishers_info_by_topic('/rosout'):  # which every node has
            if log.node_namespace == self.get_namespace():
                processes.setdefault(log.node_name, set()).add(str(log.endpoint_gid))
        names = self._topics.publishers() | self._facts.servers()
        nodes = {name: frozenset(processes.get(name, ())) for name in names}
        if nodes != old.nodes:
            ended = old.ended.union(old.nodes).difference(nodes)
            now = self._now()
            self._update(lambda old: replace(old, nodes=nodes, ended=ended, now=now))
            self._over = not nodes
        if not self.count_publishers('/clock'):
            self._clock_time = None
        self._facts.ask()

    def _now(self) -> float:
        if self._clock_time is not None:
            return self._clock_time
        return float(self.get_clock().now().nanoseconds) / 1e9

    def _on_clock(self, message: ClockMessage) -> None:
        self._clock_time = message.clock.sec + message.clock.nanosec / 1e9

    def _draw(self) -> None:
        try:
            if not self._once:
                show_moving(self.see, self.stopping, self._console)
            elif not show_once(self.see, self.stopping, self._console, self._timeout):
                where = f'{self._empty.where} within {self._timeout:g} s'
                print(f'watch: no mission on {where}', file=sys.stderr)
                self.fail('no mission')
        except (OSError, SystemExit):  # nobody reads it any more; rich exits on a broken pipe
            pass
        finally:
            self.finish()

    def _print(self, line: str) -> None:
        try:
            print(line, flush=True)
        except BrokenPipeError:
            self.finish()


def main(args: Sequence[str] | None = None) -> int:
    """Runs the node until it is stopped."""
    return run_node(MissionViewNode, args)
