"""One console for all controllers: a line's first word says which of them it is for."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from launcher.log_merge import MergedLog
from launcher.node_table import Node
from launcher.supervisor import Supervisor
from surveillance_controllers.manual.console import Console
from surveillance_controllers.manual.console_commands import BATTERY, MOTION, PLANNER, Grammar

_GRAMMAR = Grammar((*BATTERY, *PLANNER, *MOTION))


@dataclass(frozen=True)
class Routed:
    """What becomes of a line: sent to nodes, answered with a message, or the end of the run."""

    nodes: tuple[str, ...] = ()
    line: str = ''
    message: str = ''
    ends: bool = False


def route(line: str, controllers: Sequence[Node]) -> Routed:
    """Decides by a line's first word where it belongs."""
    words = line.split()
    if not words or words[0].startswith('#'):
        return Routed()
    first = words[0].lower()
    by_word = {node.console: node.name for node in controllers}
    names = [node.name for node in controllers]
    if first in by_word:
        return Routed((by_word[first],), line)
    if first == 'status':
        return Routed(tuple(names), line)
    if first == 'help':
        *own, exit_line = _GRAMMAR.help().splitlines()
        width = len(exit_line) - len(exit_line.removeprefix('  exit').lstrip())
        notes = (('exit NODE', 'Stop one controller.'), ('exit', 'Stop the whole run.'))
        lines = [f'  {usage}'.ljust(width) + text for usage, text in notes]
        return Routed(message='\n'.join([*own, *lines]))
    if first == 'exit' and len(words) == 1:
        return Routed(ends=True)
    if first == 'exit':
        target = by_word.get(words[1], words[1])
        if target in names and len(words) == 2:
            return Routed((target,), 'exit')
        return Routed(message=f'exit {" ".join(words[1:])}: expected one of {", ".join(names)}')
    known = ', '.join([*by_word, 'status', 'help', 'exit'])
    return Routed(message=f'{words[0]!r} is no command: expected one of {known}')


def completions(text: str, controllers: Sequence[Node]) -> list[str]:
    """The words that can stand where the last word of `text` is being typed."""
    words = text.lower().split()
    if words[:1] == ['exit'] and (len(words) > 1 or text[-1:].isspace()):
        typed = words[1] if len(words) > 1 else ''
        return [node.name for node in controllers if node.name.startswith(typed)]
    return _GRAMMAR.completions(text)


class OperatorConsole:
    """Reads the operator's lines and hands them to the supervised controllers.

    Args:
        supervisor: holds the controllers; lines reach it on its own thread, through a pipe.
        controllers: the nodes with a console that this run starts.
        log: where answers go.
        reader: the program that reads every line by itself; None hands each to its controller.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        controllers: Sequence[Node],
        log: MergedLog,
        reader: str | None = None,
    ) -> None:
        self._supervisor = supervisor
        self._controllers = controllers
        self._log = log
        self._reader = reader
        source, self._writer = os.pipe()
        supervisor.read_from(source, self._on_line)
        self._console = Console(
            'patrol', self._forward, lambda text: completions(text, controllers)
        )
        self._thread = threading.Thread(target=self._read, name='console', daemon=True)

    def start(self) -> None:
        """Says what can be typed and begins to read."""
        self._log.say('You can type these commands:')
        for line in route('help', self._controllers).message.splitlines():
            self._log.say(line)
        self._thread.start()

    def stop(self) -> None:
        """Gives the terminal back."""
        if self._thread.is_alive():
            with contextlib.suppress(OSError):
                self._console.stop()
            self._thread.join(1.0)

    def _read(self) -> None:
        if self._console.run() == 'interrupted':  # Ctrl-C, which the prompt took as a key
            os.kill(os.getpid(), signal.SIGINT)

    def _forward(self, line: str) -> None:
        os.write(self._writer, line.encode() + b'\n')

    def _on_line(self, line: str) -> None:
        routed = route(line, self._controllers)
        if self._reader is not None and not routed.ends:
            routed = Routed((self._reader,), line)
        for answer in routed.message.splitlines():
            self._log.say(answer)
        if routed.ends:
            self._log.say('exit: stopping')
            self._supervisor.stop()
        for name in routed.nodes:
            if not self._supervisor.send(name, routed.line):
                self._log.warn(f'{name} is not reading commands at the moment')
