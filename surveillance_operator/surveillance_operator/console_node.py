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

from strict_files.one_line import clean
from strict_files.suggestions import nearest
from surveillance_controllers.manual.prompt import Console
from surveillance_operator.console_commands import (
    CONTROLLED,
    answer,
    completions,
    help_text,
    is_for_robot,
    wrapped,
)
from surveillance_operator.figures import figures_line
from surveillance_operator.fleet_actions import ALL, WORDS, FleetActions
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_actions import MissionActions
from surveillance_operator.mission_state import MissionState
from surveillance_operator.mission_words import why as reason
from surveillance_runtime.logging import print_lines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS

STATE_PERIOD = 0.5
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
        self._robot = self.parameter(
            'robot', '', 'The robot of a fleet that is spoken to first; empty: the first one.'
        )
        self._found_by = time.monotonic() + timeout
        self._left_out = 0
        self._met: set[str] = set()
        self._subscriber = FleetSubscriber(
            self, STATE_PERIOD, lambda name, _new, _told: self._meet(name)
        )
        self._actions = FleetActions(self, lambda: self._subscriber.robots, timeout)
        self._meet('')
        self._console = Console(
            'console', self._on_line, completions, source=console_source, status=self._status
        )
        self.stopping.subscribe(self._console.stop)
        if self._console.on_terminal:
            _tell('You can type these commands:\n' + help_text(_columns()))
        self.spawn(self._read)

    @property
    def robot(self) -> str:
        """The robot that is spoken to; one that is alone has no name.

        One that was chosen, or was told something, stays chosen while it is not heard, and when
        others come: no other gets its commands.
        """
        return self._robot or self._subscriber.robots[0]

    def figures(self) -> str:
        """Return the figures of the robot's mission that are known."""
        known = self._subscriber.robots
        return figures_line(self._subscriber.state(self.robot)) if self.robot in known else ''

    def lines(self) -> list[str]:
        """Return what each robot of the fleet does."""
        if self._subscriber.robots == ('',):
            raise ValueError('this robot is alone')
        return fleet_lines(self._subscriber.see())

    def choose(self, robot: str) -> str:
        """Speak to another robot of the fleet."""
        if robot not in (known := self._subscriber.robots):
            raise ValueError(f'{robot!r}: expected {nearest(robot, filter(None, known))}')
        self._robot = robot
        return f'you speak to {robot}'

    def tell_all(self, word: str) -> str:
        """Have all robots do something."""
        return self._actions.carry_out(ALL, WORDS[word][1]).replace('; ', '\n')

    def _meet(self, robot: str) -> None:
        """Hear what the controllers of a robot announce."""
        if robot in self._met:
            return
        self._met.add(robot)
        for name in map(partial(name_for, robot), CONTROLLED):
            self.create_subscription(
                String, f'{name}/announcement', partial(self._on_announcement, name), STATE_QOS
            )

    def _status(self) -> str:
        name = self.robot
        if name not in self._subscriber.robots:
            return f' {name} is not heard '
        return status_line(self._subscriber.state(name), name)

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
        # The robots of a fleet are found some time after the console is opened.
        while time.monotonic() < self._found_by and self._subscriber.state('').task.status is None:
            if self.stopping.wait(0.05):
                return
        try:
            actions = self._actions_for(line)
        except ValueError as error:
            _tell(str(error))
            return
        for each in answer(line, actions, self, _columns()):
            if each.ends:
                self.finish()
            elif each.text:
                _tell(each.text, each.who)

    def _actions_for(self, line: str) -> MissionActions:
        """Return the actions that a line is for: those of the robot that is spoken to.

        Raises:
            ValueError: That robot is not heard, and the line is for it.
        """
        if not is_for_robot(line):
            return self._actions.shared
        robot, known = self.robot, self._subscriber.robots
        if robot in known:
            self._robot = robot
            return self._actions.of(robot)
        others = ', '.join(filter(None, known)) or 'a run with several robots'
        raise ValueError(f'robot {robot!r} is not heard: expected {others}')

    def why(self) -> str:
        """Return why the robot goes where it goes."""
        deadline = time.monotonic() + self._timeout
        while (said := reason(self._subscriber.state(self.robot))) is None:
            # The subscriber of a console that was just opened has not heard of it yet.
            if time.monotonic() > deadline or self.stopping.wait(STATE_PERIOD):
                return 'no decision yet'
        return '\n'.join(said)


def status_line(state: MissionState, robot: str = '') -> str:
    """Return the mission in one line: what it does, where, and the brief figures."""
    status = state.task.status
    if status is None or not state.health.nodes:
        return f' no mission on {state.where} '
    how = 'STOPPED' if state.task.stopped else 'PAUSED' if state.machine.paused else ''
    words = (robot, how, status.state, state.whereabouts, figures_line(state, brief=True))
    return f' {" · ".join(filter(None, words))} '


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
