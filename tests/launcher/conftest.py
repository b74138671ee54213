"""A process under test whose output can be waited for."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest

from surveillance_runtime import discovery

ROOT = Path(__file__).resolve().parents[2]
USER_ENVIRON = {
    **{
        name: os.environ[name]
        for name in os.environ
        if name not in (*discovery.VARIABLES, 'NOTIFY_SOCKET', 'SYSTEMD_EXEC_PID')
    },
    'PYTHONPATH': str(ROOT),
}
"""What a user's shell gives a command: nothing of how nodes find each other, or of systemd."""


class Started:
    """A process in a session of its own, its output collected line by line."""

    def __init__(self, command: Sequence[str], environ: Mapping[str, str] = USER_ENVIRON) -> None:
        self.process = subprocess.Popen(
            command,
            env=environ,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self.lines: list[str] = []
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._collect, daemon=True)
        self._reader.start()

    def _collect(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self._changed:
                self.lines.append(line.rstrip('\n'))
                self._changed.notify_all()
        with self._changed:
            self._changed.notify_all()

    def until(self, pattern: str, timeout: float = 240.0, after: int = 0) -> re.Match[str]:
        """Wait for a line that the pattern is found in, from line number `after` on."""
        deadline = time.monotonic() + timeout
        seen = after
        with self._changed:
            while True:
                while seen < len(self.lines):
                    if match := re.search(pattern, self.lines[seen]):
                        return match
                    seen += 1
                remaining = deadline - time.monotonic()
                more = remaining > 0 and self._reader.is_alive()
                assert more, f'no {pattern!r} in:\n' + '\n'.join(self.lines)
                self._changed.wait(remaining)

    def answer(self, pattern: str, answers: Mapping[str, str], after: int = 0) -> None:
        """Write the answer to each line that asks for one, until a line has the pattern."""
        seen = after
        while True:
            found = self.until('|'.join((pattern, *answers)), after=seen)
            seen = self.lines.index(found.string, seen) + 1
            if re.search(pattern, found.string):
                return
            self.write(next(word for ask, word in answers.items() if re.search(ask, found.string)))

    def write(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + '\n')
        self.process.stdin.flush()

    def end(self, number: int | None = None, timeout: float = 240.0) -> tuple[int, float]:
        """Send a signal, if one is given, and wait; return the exit code and the seconds."""
        start = time.monotonic()
        if number is not None:
            self.process.send_signal(number)
        code = self.process.wait(timeout)
        seconds = time.monotonic() - start
        self._reader.join(timeout)
        return code, seconds


@pytest.fixture
def start() -> Iterator[Callable[..., Started]]:
    """Start Python with the given arguments; what is left at the end of the test is killed."""
    started: list[Started] = []

    def start_python(*arguments: str, environ: Mapping[str, str] = USER_ENVIRON) -> Started:
        started.append(Started([sys.executable, *arguments], environ))
        return started[-1]

    yield start_python
    for item in started:
        if item.process.poll() is None:
            os.killpg(item.process.pid, signal.SIGKILL)
            item.process.wait()


def is_alive(pid: int) -> bool:
    """Tell whether a process exists and is no zombie."""
    try:
        with open(f'/proc/{pid}/stat', encoding='utf-8') as file:
            return file.read().rsplit(')', 1)[1].split()[0] != 'Z'
    except OSError:
        return False


def gone(pids: Sequence[int], timeout: float = 240.0) -> bool:
    """Tell whether all processes end within the time; each is watched by the kernel's own means."""
    deadline = time.monotonic() + timeout
    for pid in pids:
        try:
            handle = os.pidfd_open(pid)
        except ProcessLookupError:
            continue
        try:
            ended, _, _ = select.select([handle], [], [], max(0.0, deadline - time.monotonic()))
            if not ended:
                return False
        finally:
            os.close(handle)
    return True
