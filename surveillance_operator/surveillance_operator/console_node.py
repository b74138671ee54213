"""The node `console`: one prompt for all controllers.

Each line goes to the controller whose command it is, by that controller's service `~/command`; what
the controllers announce is shown with the controller's name in front.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from typing import Any, TextIO

from std_msgs.msg import String

from surveillance_controllers.manual.console import Console
from surveillance_controllers.manual.console_commands import (
    BATTERY,
    EXIT,
    HELP,
    MOTION,
    PLANNER,
    STATUS,
    CommandError,
    Grammar,
)
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.calls import CallError, ServiceCaller
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS

COMMANDS = {
    'battery_controller': BATTERY,
    'planner_controller': PLANNER,
    'motion_controller': MOTION,
}


class ConsoleNode(PatrolNode):
    """An operator's terminal for the three controllers.

    Args:
        console_source: Where the operator's lines come from; standard input unless given.
    """

    def __init__(self, console_source: TextIO | None = None, **node_options: Any) -> None:
        super().__init__('console', **node_options)
        self._timeout = self.parameter(
            'peer_timeout',
            2.0,
            'How long a controller may take to appear and answer, s of real time.',
            minimum=0.1,
            maximum=3600.0,
        )
        self._grammar = Grammar([command for group in COMMANDS.values() for command in group])
        self._controller_of = {c.name: name for name, group in COMMANDS.items() for c in group}
        self._callers = {
            name: ServiceCaller(self, ConsoleCommand, f'{name}/command') for name in COMMANDS
        }
        for name in COMMANDS:
            self.create_subscription(
                String, f'{name}/announcement', partial(self._on_announcement, name), STATE_QOS
            )
        self._console = Console(
            'console', self._on_line, self._grammar.completions, source=console_source
        )
        self.stopping.subscribe(self._console.stop)
        if self._console.on_terminal:
            _tell('You can type these commands:\n' + self._grammar.help())
        self.spawn(self._read)

    def _on_announcement(self, controller: str, message: String) -> None:
        _tell(message.data, controller)

    def _read(self) -> None:
        if self._console.run() != 'stopped':
            self.finish()

    def _on_line(self, line: str) -> None:
        try:
            command = self._grammar.parse(line)
        except CommandError as error:
            _tell(str(error))
            return
        if command is None:
            return
        if command.name == HELP.name:
            _tell(self._grammar.help())
        elif command.name == EXIT.name:
            self.finish()
        elif command.name == STATUS.name:
            for controller in COMMANDS:
                self._hand_on(controller, line)
        else:
            self._hand_on(self._controller_of[command.name], line)

    def _hand_on(self, controller: str, line: str) -> None:
        request = ConsoleCommand.Request(line=line)
        try:
            answer = self._callers[controller].call(request, self._timeout, self.stopping)
        except CallError as error:
            _tell(f'{controller} does not answer: {error}')
        else:
            _tell(answer.answer, controller)


def _tell(text: str, controller: str = '') -> None:
    head = f'[{controller}] ' if controller else ''
    print('\n'.join(head + line for line in text.splitlines()), file=sys.stdout, flush=True)


def main(args: Sequence[str] | None = None) -> int:
    """Runs the node until `exit`, the end of the input, or a signal."""
    return run_node(ConsoleNode, args)
