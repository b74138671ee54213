"""The node `mission_view`: shows a running mission in its terminal, and stops the robot there.

In a terminal that can it draws, elsewhere it prints one line for each change.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

from rich.console import Console

from state_machines.exceptions import CallError
from surveillance_operator.mission_feed import MissionFeed
from surveillance_operator.snapshot import Change, Snapshot
from surveillance_operator.stop_button import StopButton
from surveillance_operator.watch.view import show_moving, show_once
from surveillance_runtime.logging import clean, print_lines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node

POLL_PERIOD = 0.1
"""Seconds between two looks at the topics."""


class MissionViewNode(PatrolNode):
    """Gathers what a mission tells, and shows it."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('mission_view', **node_options)
        self._once = self.parameter('once', False, 'Print one picture and end.', read_only=True)
        self._timeout = self.parameter(
            'timeout', 5.0, 'With once: longest wait for a mission, seconds.', minimum=0.1
        )
        self._console = Console(highlight=False)
        self._draws = self._once or (
            self._console.is_terminal and not self._console.is_dumb_terminal
        )
        self._said = ''
        self._stop: StopButton | None = None
        self._feed = MissionFeed(self, POLL_PERIOD, self._tell)
        if self._draws:
            if not self._once:
                self._stop = StopButton(self)
            self.spawn(self._draw, 'display')
        else:
            self._print(f'watching {self.snapshot.where}')

    @property
    def snapshot(self) -> Snapshot:
        """All that is known."""
        return self._feed.snapshot

    def see(self) -> Snapshot:
        """Return all that is known, at the mission's present time, or the time of its end."""
        return self._feed.see()

    def _tell(self, _new: Snapshot, told: Sequence[Change]) -> None:
        if not self._draws:
            at = time.strftime('%H:%M:%S')
            for each in told:
                self._print(f'{at} {each.text} {each.detail}'.rstrip())

    def _draw(self) -> None:
        try:
            if not self._once:
                show_moving(
                    self.see, self.stopping, self._console, self._press_stop, lambda: self._said
                )
            elif not show_once(self.see, self.stopping, self._console, self._timeout):
                where = f'{self.snapshot.where} within {self._timeout:g} s'
                print(f'watch: no mission on {where}', file=sys.stderr)
                self.fail('no mission')
        except (OSError, SystemExit):  # nobody reads it any more; rich exits on a broken pipe
            pass
        finally:
            self.finish()

    def _press_stop(self, stop: bool) -> None:
        """Stop the robot, or release it, on a thread of its own."""

        def press() -> None:
            assert self._stop is not None
            try:
                self._said = self._stop.press(stop)
            except CallError as error:
                self._said = f'NOT {"stopped" if stop else "released"}: {error}'

        self._said = 'stopping the robot' if stop else 'releasing it'
        self.spawn(press, 'stop')

    def _print(self, line: str) -> None:
        try:
            print_lines(clean(line))  # a name may have come from any peer
        except BrokenPipeError:
            self.finish()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionViewNode, args)
