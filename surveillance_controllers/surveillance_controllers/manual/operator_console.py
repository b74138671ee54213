"""Gives a controller its console: commands from its own terminal or pipe, and from a service.

The service `~/command` takes the same lines, so that one console elsewhere can serve all
controllers; what the operator is told also goes out on the topic `~/announcement`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any, TextIO

from std_msgs.msg import String

from surveillance_controllers.manual.console import Console
from surveillance_controllers.manual.console_commands import (
    EXIT,
    HELP,
    STATUS,
    Command,
    CommandError,
    Grammar,
    ParsedCommand,
)
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS


class OperatorConsole:
    """The console of one controller.

    Args:
        node: The controller.
        commands: Its own commands.
        carry_out: Does what a command says and returns what to tell the operator; raises
            `CommandError`.
        status: What `status` answers.
    """

    def __init__(
        self,
        node: PatrolNode,
        commands: Sequence[Command],
        carry_out: Callable[[ParsedCommand], str],
        status: Callable[[], str],
    ) -> None:
        self._node = node
        self._grammar = Grammar(commands)
        self._carry_out = carry_out
        self._status = status
        self._console: Console | None = None
        self._announcements = node.create_publisher(String, '~/announcement', STATE_QOS)
        node.create_service(ConsoleCommand, '~/command', self._on_request)

    def open(self, source: TextIO | None = None) -> None:
        """Starts to read commands from a terminal or pipe, standard input unless given."""
        name = self._node.get_name()
        self._console = Console(name, self._on_line, self._grammar.completions, source=source)
        if self._console.on_terminal:
            _tell('You can type these commands:\n' + self._grammar.help())
        self._node.stopping.subscribe(self._console.stop)
        self._node.spawn(self._read, name=f'{name} console')

    @property
    def has_terminal(self) -> bool:
        """Whether an operator edits lines on the terminal that this process writes to."""
        return self._console is not None and self._console.on_terminal

    def announce(self, text: str) -> None:
        """Tells the operator something, wherever the operator is."""
        if self._console is not None:
            _tell(text)
        self._announcements.publish(String(data=text))

    def _read(self) -> None:
        assert self._console is not None
        ending = self._console.run()
        if ending == 'interrupted':
            self._node.finish()
        elif ending != 'stopped':
            self._node.get_logger().info(
                'The console is closed (end of input); commands still come by the service '
                f'{self._node.get_name()}/command.'
            )

    def _on_line(self, line: str) -> None:
        _, answer = self._answer(line)
        if answer:
            _tell(answer)

    def _on_request(self, request: Any, response: Any) -> Any:
        response.accepted, response.answer = self._answer(request.line)
        return response

    def _answer(self, line: str) -> tuple[bool, str]:
        try:
            command = self._grammar.parse(line)
            if command is None:
                return True, ''
            if command.name == HELP.name:
                return True, self._grammar.help()
            if command.name == STATUS.name:
                return True, self._status()
            if command.name == EXIT.name:
                self._node.finish()
                return True, 'Stopping.'
            return True, self._carry_out(command)
        except CommandError as error:
            return False, str(error)


def _tell(text: str) -> None:
    print(text, file=sys.stdout, flush=True)
