"""Queue of pending operator requests (MANUAL mode), and the commands that answer them.

A worker thread that carries out an action calls `CommandConsole.ask` and sleeps until somebody
answers or its goal is interrupted; requests are answered in the order in which they came. Commands
come from the controller's own terminal or pipe and from the service `~/command`, so that one
console elsewhere can serve all controllers; what the operator is told also goes out on the topic
`~/announcement`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from typing import Any, Generic, TextIO, TypeVar

from std_msgs.msg import String

from state_machines import Interrupt
from surveillance_controllers.manual.commands import (
    EXIT,
    HELP,
    STATUS,
    Command,
    CommandError,
    Grammar,
    ParsedCommand,
)
from surveillance_controllers.manual.prompt import Console
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.logging import print_lines
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

Answer = TypeVar('Answer')


class CommandConsole(Generic[Answer]):
    """The operator of one controller, who gives it commands and answers its requests.

    Args:
        node: The controller.
        commands: Its own commands.
        carry_out: Does what a command says and returns what to tell the operator; raises
            `CommandError`.
        status: What `status` answers; unless given, the requests that wait.
    """

    def __init__(
        self,
        node: PatrolNode,
        commands: Sequence[Command],
        carry_out: Callable[[ParsedCommand], str],
        status: Callable[[], str] | None = None,
    ) -> None:
        self._node = node
        self._grammar = Grammar(commands)
        self._carry_out = carry_out
        self._status = status or self._what_waits
        self._lock = threading.Lock()
        self._waiting: dict[Future[Answer], str] = {}
        self._console: Console | None = None
        self._announcements = node.create_publisher(String, '~/announcement', STATE_QOS)
        node.create_service(ConsoleCommand, '~/command', self._on_request)

    def open(self, source: TextIO | None = None) -> None:
        """Start to read commands from a terminal or pipe, standard input unless given."""
        name = self._node.get_name()
        self._console = Console(name, self._on_line, self._grammar.completions, source=source)
        if self._console.on_terminal:
            print_lines('You can type these commands:\n' + self._grammar.help())
        self._node.stopping.subscribe(self._console.stop)
        self._node.spawn(self._read, name=f'{name} console')

    def ask(self, description: str, interruption: Interrupt) -> Answer | None:
        """Wait until the operator answers.

        Args:
            description: What is asked, shown to the operator: lines of text.
            interruption: Ends the wait; the operator is told.

        Returns:
            The answer, or None when the wait was interrupted.
        """
        request: Future[Answer] = Future()

        def withdraw() -> None:
            request.cancel()

        with self._lock:
            self._waiting[request] = description
        self._announce(description)
        unsubscribe = interruption.subscribe(withdraw)
        try:
            return request.result()
        except CancelledError:
            with self._lock:
                self._waiting.pop(request, None)
            self._announce('The request was withdrawn: ' + description.partition('\n')[0])
            return None
        finally:
            unsubscribe()

    def answer(self, answer: Answer) -> None:
        """Answer the request that has waited longest.

        Raises:
            CommandError: No request is waiting.
        """
        with self._lock:
            for request in tuple(self._waiting):
                del self._waiting[request]
                if request.set_running_or_notify_cancel():
                    request.set_result(answer)
                    return
        raise CommandError('no request is waiting: expected one before this command')

    def _what_waits(self) -> str:
        with self._lock:
            return '\n'.join(self._waiting.values()) or 'No request is waiting.'

    @property
    def has_terminal(self) -> bool:
        """Whether an operator edits lines on the terminal that this process writes to."""
        return self._console is not None and self._console.on_terminal

    def _announce(self, text: str) -> None:
        """Tell the operator something, wherever the operator is."""
        if self._console is not None:
            print_lines(text)
        self._announcements.publish(String(data=text))

    def _read(self) -> None:
        assert self._console is not None
        ending = self._console.run()
        if ending == 'interrupted':
            self._node.finish()
        elif ending != 'stopped':
            self._node.get_logger().info(
                'The console is closed (end of input); commands are still taken by the service '
                f'{self._node.get_name()}/command.'
            )

    def _on_line(self, line: str) -> None:
        _, answer = self._answer(line)
        if answer:
            print_lines(answer)

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
