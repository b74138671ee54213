"""The operator's terminal in MANUAL mode: its lines go to the node `console`."""

from __future__ import annotations

import contextlib
import os
import signal
import threading

from launcher.log_merge import MergedLog
from launcher.supervisor import Supervisor
from surveillance_controllers.manual.prompt import Console
from surveillance_operator.console_commands import completions, help_text


class OperatorConsole:
    """Reads the operator's lines and hands them to the process that holds the console node.

    Args:
        supervisor: holds that process; lines reach it on its own thread, through a pipe.
        log: where answers go.
        reader: the program that the lines are for.
    """

    def __init__(self, supervisor: Supervisor, log: MergedLog, reader: str) -> None:
        self._supervisor = supervisor
        self._log = log
        self._reader = reader
        source, self._writer = os.pipe()
        supervisor.read_from(source, self._on_line)
        self._console = Console('patrol', self._forward, completions)
        self._thread = threading.Thread(target=self._read, name='console', daemon=True)

    def start(self) -> None:
        """Say what can be typed and begin to read."""
        self._log.say('You can type these commands:')
        for line in help_text().splitlines():
            self._log.say(line)
        self._thread.start()

    def stop(self) -> None:
        """Give the terminal back."""
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
        if line.split() == ['exit']:
            self._log.say('exit: stopping')
            self._supervisor.stop()
        elif line.strip() and not self._supervisor.send(self._reader, line):
            self._log.warn(f'{self._reader} is not reading commands at the moment')
