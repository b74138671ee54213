"""Where an operator's lines come from: a terminal with history and completion, or a pipe read line
by line.

`Console.run` reads until the end of the input, until `stop`, or until the operator interrupts; it
belongs on a thread of its own. On a terminal the line editor is prompt_toolkit's. The end of the
input only ends the console.
"""

from __future__ import annotations

import os
import selectors
import sys
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from prompt_toolkit.input import Input
    from prompt_toolkit.output import Output


LONGEST_UNFINISHED_LINE = 1_000_000
"""Bytes of a line without an end that are kept from a pipe before they are dropped."""


class Console:
    """Reads lines and hands each to `on_line`.

    Args:
        name: Names the prompt and the file with the history.
        on_line: Called with each line, without its end, on the thread of `run`.
        completions: The words that can follow a text; asked while the operator types.
        source: Where lines come from; standard input unless given.
        status: What stands below the prompt of a terminal, asked for now and then.
        terminal: The two ends of a terminal for prompt_toolkit; asked of the system unless given.

    Attributes:
        on_terminal: Whether lines are edited on a terminal.
    """

    def __init__(
        self,
        name: str,
        on_line: Callable[[str], None],
        completions: Callable[[str], list[str]],
        *,
        source: TextIO | None = None,
        status: Callable[[], str] | None = None,
        terminal: tuple[Input, Output] | None = None,
    ) -> None:
        self._name = name
        self._on_line = on_line
        self._completions = completions
        self._source = sys.stdin if source is None else source
        self._terminal = terminal
        self._status = status
        self._stopped = False
        self._stop_reading: Callable[[], None] = lambda: None
        self.on_terminal = terminal is not None or _is_terminal(self._source)
        self._wake_read, self._wake_write = os.pipe()
        self._lock = threading.Lock()

    def run(self) -> str:
        """Read lines until there are no more.

        Returns:
            Why it ended: 'end of input', 'stopped', or 'interrupted' (Ctrl-C at the prompt).
        """
        try:
            if self.on_terminal:
                return self._run_terminal()
            return self._run_pipe()
        finally:
            with self._lock:
                self._stopped = True
                os.close(self._wake_read)
                os.close(self._wake_write)

    def stop(self) -> None:
        """End `run` from another thread, also while it waits for a line."""
        with self._lock:
            if self._stopped:
                return
            self._stopped = True
            os.write(self._wake_write, b'x')
        self._stop_reading()

    def _run_pipe(self) -> str:
        try:
            descriptor = self._source.fileno()
        except (OSError, ValueError, AttributeError):
            return 'end of input'
        buffer = b''
        # Unlike the default one, it takes files, too.
        with selectors.PollSelector() as selector:
            selector.register(descriptor, selectors.EVENT_READ)
            selector.register(self._wake_read, selectors.EVENT_READ)
            while not self._stopped:
                selector.select()
                if self._stopped:
                    break
                try:
                    chunk = os.read(descriptor, 65_536)
                except OSError:
                    chunk = b''
                *lines, buffer = (buffer + chunk).split(b'\n')
                buffer = buffer[:LONGEST_UNFINISHED_LINE]
                if not chunk and buffer:
                    lines.append(buffer)
                for line in lines:
                    if self._stopped:  # by the line before, perhaps
                        return 'stopped'
                    self._on_line(line.decode(errors='replace').rstrip('\r'))
                if not chunk:
                    return 'end of input'
        return 'stopped'

    def _run_terminal(self) -> str:
        # Only here, for most consoles never have a terminal and need not wait for the import.
        from surveillance_controllers.manual.terminal import TerminalLines

        terminal = TerminalLines(self._name, self._completions, self._terminal, self._status)
        with self._lock:
            if self._stopped:
                return 'stopped'
            self._stop_reading = terminal.stop
        with terminal.shown():
            while not self._stopped:
                try:
                    line = terminal.read()
                except EOFError:
                    return 'stopped' if self._stopped else 'end of input'
                except KeyboardInterrupt:
                    return 'interrupted'
                self._on_line(line)
        return 'stopped'


def _is_terminal(source: TextIO) -> bool:
    try:
        return source.isatty() and sys.stdout.isatty()
    except (ValueError, AttributeError):
        return False
