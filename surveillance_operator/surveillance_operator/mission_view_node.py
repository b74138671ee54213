"""The node `mission_view`: shows a running mission in its terminal, and stops the robot there.

In a terminal that can it draws, elsewhere it prints one line for each change.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from functools import partial
from typing import Any

from rich.console import Console

from state_machines.exceptions import CallError
from strict_files.one_line import clean
from surveillance_operator.fleet_actions import ALL
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.mission_state import MissionState, Notice
from surveillance_operator.stop_button import StopButton
from surveillance_operator.watch.view import show_moving, show_once
from surveillance_runtime.logging import print_lines
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
        self._robot = self.parameter(
            'robot', '', 'The robot of a fleet that is drawn first; empty: the first one.'
        )
        self._console = Console(highlight=False)
        self._draws = self._once or (
            self._console.is_terminal and not self._console.is_dumb_terminal
        )
        self._said = ''
        self._stops: dict[str, StopButton] = {}
        self._subscriber = FleetSubscriber(self, POLL_PERIOD, self._tell)
        if self._draws:
            if not self._once:
                self._stops[''] = StopButton(self)
            self.spawn(self._draw, 'display')
        else:
            self._print(f'watching {self.state.where}')

    @property
    def state(self) -> MissionState:
        """All that is known of the robot that is alone, or of what the robots of a fleet share."""
        return self._subscriber.state('')

    def see(self) -> dict[str, MissionState]:
        """Return all that is known, at the mission's present time, or the time of its end."""
        seen = self._subscriber.see()
        if self._stops:
            for robot in seen.keys() - self._stops.keys():
                self._stops[robot] = StopButton(self, robot)  # found before it is needed
        return seen

    def _tell(self, robot: str, _new: MissionState, told: Sequence[Notice]) -> None:
        if not self._draws:
            at = time.strftime('%H:%M:%S')
            for each in told:
                if robot and each.shared:
                    continue  # it is told with what all robots share
                who = f'{robot}: ' if robot else ''
                self._print(f'{at} {who}{each.text} {each.detail}'.rstrip())

    def _draw(self) -> None:
        try:
            if not self._once:
                show_moving(
                    self.see,
                    self.stopping,
                    self._console,
                    self._press_stop,
                    lambda: self._said,
                    self._robot,
                )
            elif not show_once(self.see, self.stopping, self._console, self._timeout, self._robot):
                where = f'{self.state.where} within {self._timeout:g} s'
                what = f'robot {self._robot}' if self._robot else 'mission'
                print(f'watch: no {what} on {where}', file=sys.stderr)
                self.fail('no mission')
        except (OSError, SystemExit):  # nobody reads it any more; rich exits on a broken pipe
            pass
        finally:
            self.finish()

    def _press_stop(self, stop: bool, robot: str) -> None:
        """Stop a robot or all of them, or release them, each on a thread of its own."""
        done: dict[str, str] = {}

        def press(name: str) -> None:
            try:
                said = self._stops[name].press(stop)
            except CallError as error:
                said = f'NOT {"stopped" if stop else "released"}: {error}'
            done[name] = f'{name}: {said}' if name else said
            self._said = '; '.join(done[each] for each in sorted(done))

        self._said = 'stopping' if stop else 'releasing'
        for name in self._subscriber.robots if robot == ALL else (robot,):
            self.spawn(partial(press, name), 'stop')

    def _print(self, line: str) -> None:
        try:
            print_lines(clean(line))  # a name may have come from any peer
        except BrokenPipeError:
            self.finish()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MissionViewNode, args)
