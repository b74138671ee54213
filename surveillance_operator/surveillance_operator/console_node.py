"""The node `console`: one prompt for a whole mission.

It answers the controllers' requests of mode MANUAL, opens doors, sends the robot somewhere and asks
why. What the controllers announce is shown with the controller's name in front.
"""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Sequence
from functools import partial
from typing import Any, TextIO

from std_msgs.msg import String

from surveillance_controllers.manual.prompt import Console
from surveillance_operator.console_commands import (
    CONTROLLED,
    answer,
    completions,
    help_text,
    wrapped,
)
from surveillance_operator.mission_actions import MissionActions
from surveillance_operator.mission_feed import MissionFeed
from surveillance_operator.snapshot import Snapshot, why
from surveillance_runtime.logging import clean, print_lines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS

FEED_PERIOD = 0.5
"""Seconds between two looks at what the status line shows."""


class ConsoleNode(PatrolNode):
    """An operator's terminal for a mission.

    Args:
        console_source: Where the operator's lines come from; standard input unless given.
    """

    def __init__(self, console_source: TextIO | None = None, **node_options: Any) -> None:
        super().__init__('console', **node_options)
        timeout = self.parameter(
            'peer_timeout',
            2.0,
            'How long a node may take to appear and answer, s of real time.',
            minimum=0.1,
            maximum=3600.0,
        )
        self._timeout = timeout
        self._actions = MissionActions(self, timeout)
        self._feed = MissionFeed(self, FEED_PERIOD)
        self._left_out = 0
        for name in CONTROLLED:
            self.create_subscription(
                String, f'{name}/announcement', partial(self._on_announcement, name), STATE_QOS
            )
        self._console = Console(
            'console', self._on_line, completions, source=console_source, status=self._status
        )
        self.stopping.subscribe(self._console.stop)
        if self._console.on_terminal:
            _tell('You can type these commands:\n' + help_text(_columns()))
        self.spawn(self._read)

    def _status(self) -> str:
        return status_line(self._feed.snapshot)

    def _on_announcement(self, controller: str, message: String) -> None:
        allowance = self.get_logger().lines
        for line in message.data.splitlines():
            if not allowance.take():
                self._left_out += 1
                continue
            left_out, self._left_out = self._left_out, 0
            note = f' ({left_out} lines left out before this one)' if left_out else ''
            _tell(clean(line) + note, controller)

    def _read(self) -> None:
        if self._console.run() != 'stopped':
            self.finish()

    def _on_line(self, line: str) -> None:
        if self.ended.is_set():
            return  # a pipe has more lines than the `exit`
        for each in answer(line, self._actions, self._why, _columns()):
            if each.ends:
                self.finish()
            elif each.text:
                _tell(each.text, each.who)

    def _why(self) -> str:
        deadline = time.monotonic() + self._timeout
        while (said := why(self._feed.snapshot)) is None:
            # The feed of a console that was just opened has not heard of it yet.
            if time.monotonic() > deadline or self.stopping.wait(FEED_PERIOD):
                return 'no decision yet'
        return '\n'.join(said)


def status_line(snapshot: Snapshot) -> str:
    """Return the mission in one line: what it does, where, how much charge is left."""
    status = snapshot.status
    if status is None or not snapshot.nodes:
        return f' no mission on {snapshot.where} '
    battery = '–' if snapshot.battery is None else f'{snapshot.battery:.0f} %'
    paused = 'PAUSED · ' if snapshot.paused else ''
    paused = 'STOPPED · ' if snapshot.stopped else paused
    return f' {paused}{status.state} · {status.whereabouts} · battery {battery} '


def _tell(text: str, controller: str = '') -> None:
    head = f'[{controller}] ' if controller else ''
    said = '\n'.join(head + line for line in text.splitlines())
    print_lines(wrapped(said, _columns()))


def _columns() -> int:
    """Return how many columns the terminal has; elsewhere lines are as long as they are."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else 10_000


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until `exit`, the end of the input, or a signal."""
    return run_node(ConsoleNode, args)
