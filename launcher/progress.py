"""Shows how a set-up comes on: one live line per step on a terminal, plain lines elsewhere."""

from __future__ import annotations

import queue
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from types import TracebackType
from typing import TextIO

_STEPS = tuple(
    (re.compile(output), shown)
    for output, shown in (
        (r'.*\[(\d+/\d+)\]', r'compiling \1'),
        (r'Collecting (\S+)', r'looking for \1'),
        (r'Downloading (?:\S*/)?([^\s/-]+)', r'downloading \1'),
        (r'Installing collected packages', 'installing'),
        (r'Building wheels? for (\S+)', r'building \1'),
        (r'Installing build dependencies|Getting requirements', 'fetching build tools'),
        (r'Get:\d+ \S+ \S+ \S+ ([a-z\d][\w.+-]*) ', r'downloading \1'),
        (r'(?:Unpacking|Setting up) (\S+) ', r'installing \1'),
    )
)
"""Lines of pip, apt and the build, and what each says of progress."""
_PLAIN_EVERY = 15.0
_SILENT = 10.0
"""Seconds without a line of output after which that is said."""


def describe(line: str) -> str:
    """Return what a line of pip's, apt's or the build's output says of progress; or nothing."""
    for output, shown in _STEPS:
        if found := output.match(line.strip()):
            return found.expand(shown)
    return ''


class SetUpStep:
    """One step of the set-up: `with SetUpStep(1, 3, 'wheels') as step: step.feed(line)`."""

    def __init__(self, number: int, total: int, title: str, stream: TextIO | None = None) -> None:
        self._stream = sys.stdout if stream is None else stream
        self._live = self._stream.isatty()
        self._head = f'[{number}/{total}] {title}'
        self._detail = ''
        self._shown = 0.0

    def __enter__(self) -> SetUpStep:
        self._start = self._shown = self._heard = time.monotonic()
        if self._live:
            self._draw('...')
        else:
            self._print(f'{self._head} ...')
        return self

    def feed(self, line: str) -> None:
        """Take one line of the step's output."""
        self._heard = time.monotonic()
        if detail := describe(line):
            self._detail = detail
        self.tick()

    def tick(self) -> None:
        """Redraws; called about four times a second also when there is no output."""
        now = time.monotonic()
        silent = now - self._heard
        words = [self._detail] if self._detail else []
        words += [f'nothing new for {silent:.0f} s'] if silent >= _SILENT else []
        if self._live:
            self._draw(f'{now - self._start:4.0f} s  {", ".join(words)}')
        elif now - self._shown >= _PLAIN_EVERY:
            self._shown = now
            detail = f', {", ".join(words)}' if words else ''
            self._print(f'{self._head}: {now - self._start:.0f} s{detail}')

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        word = 'done in' if kind is None else 'stopped after'
        line = f'{self._head}: {word} {time.monotonic() - self._start:.0f} s'
        if self._live:
            self._stream.write('\r\x1b[K')
        self._print(line)

    def _draw(self, text: str) -> None:
        # A line that wraps could not be drawn over.
        room = shutil.get_terminal_size().columns - 1
        self._stream.write('\r\x1b[K' + f'{self._head} {text}'[:room])
        self._stream.flush()

    def _print(self, text: str) -> None:
        self._stream.write(text + '\n')
        self._stream.flush()


class Output:
    """What a process prints, read as it comes, so that the process never waits to be heard."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        threading.Thread(target=self._read, args=(process,), daemon=True).start()

    def _read(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as stream:
            for line in stream:
                self._lines.put(line.decode('utf-8', 'replace').rstrip())
        self._lines.put(None)

    def lines(self, step: SetUpStep) -> Iterator[str]:
        """Yield the lines to the last one, while the step's clock is kept going."""
        while True:
            try:
                line = self._lines.get(timeout=0.25)
            except queue.Empty:
                step.tick()
                continue
            if line is None:
                return
            step.feed(line)
            yield line
