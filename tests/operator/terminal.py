"""A program on a terminal of its own: what it shows is read from the screen, as a person does."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Mapping, Sequence

import pyte

from tests.launcher.conftest import USER_ENVIRON

ASKS_FOR_CURSOR = b'\x1b[6n'


class Terminal:
    """A program on a pseudo terminal.

    Args:
        command: The program.
        columns, rows: Of the terminal.
        environ: Further variables.
    """

    def __init__(
        self,
        command: Sequence[str],
        columns: int = 80,
        rows: int = 40,
        environ: Mapping[str, str] | None = None,
    ) -> None:
        self._screen = pyte.HistoryScreen(columns, rows, history=2000)
        self._stream = pyte.ByteStream(self._screen)
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack('HHHH', rows, columns, 0, 0))
        self.process = subprocess.Popen(
            command,
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env={**USER_ENVIRON, 'TERM': 'xterm-256color', **(environ or {})},
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
            start_new_session=True,
        )
        os.close(theirs)

    @property
    def lines(self) -> list[str]:
        """What the screen shows now."""
        return [line.rstrip() for line in self._screen.display]

    def type(self, text: str) -> None:
        """Press keys."""
        os.write(self._ours, text.encode())

    def until(self, *words: str, timeout: float = 240.0) -> str:
        """Wait until the screen shows all words; return what it shows."""
        deadline = time.monotonic() + timeout
        while True:
            shown = '\n'.join(self.lines)
            if all(word in shown for word in words):
                return shown
            left = deadline - time.monotonic()
            more = left > 0 and self._read(left)
            assert more, f'{words} not seen in:\n{shown}'

    def ended(self, timeout: float = 240.0) -> int:
        """Return the exit code, once the program has ended."""
        deadline = time.monotonic() + timeout
        while self.process.poll() is None:
            assert time.monotonic() < deadline, 'it goes on:\n' + '\n'.join(self.lines)
            self._read(0.1)
        while self._read(0.1):
            pass
        return self.process.wait()

    def close(self) -> None:
        """End the program, if it has not."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        os.close(self._ours)

    def _read(self, seconds: float) -> bool:
        """Take in what comes; return whether more may come."""
        if select.select([self._ours], [], [], seconds)[0]:
            try:
                data = os.read(self._ours, 65_536)
            except OSError:  # nobody holds the other end any more
                return False
            self._stream.feed(data)
            for _ in range(data.count(ASKS_FOR_CURSOR)):
                cursor = self._screen.cursor
                self.type(f'\x1b[{cursor.y + 1};{cursor.x + 1}R')
        return True
