"""One log for all processes: time, the node's name, the text; coloured on a terminal."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from datetime import datetime
from logging import LogRecord, makeLogRecord
from logging.handlers import RotatingFileHandler
from pathlib import Path
from typing import TextIO

from surveillance_runtime.launch_protocol import FOR_THE_TERMINAL

_FIELD = '\x1f'
"""Stands between the fields of a line that a node logs: no text of a node holds it."""
ROS_FORMAT = _FIELD.join(('', '{severity}', '{name}', '{message}'))
"""What the nodes are told to print: how severe it is, who says it, what."""
_ESCAPES = re.compile(r'\x1b\[[0-9;?]*[ -/]*[@-~]')
_SEVERITY_COLOURS = {'WARN': '33', 'ERROR': '31', 'FATAL': '1;31', 'DEBUG': '2'}
_NODE_COLOURS = ('36', '32', '35', '34', '96', '92', '95', '94')
LAUNCHER = 'launch'
LOG_BYTES = 10_000_000
"""Size of a log file from which on another one is begun; two are kept."""
LONGEST_LINE = 4000
"""Characters of a line that are kept."""
_LEAST_TEXT = 40
"""Columns that text must have beside time and name for long lines to be broken at words."""


class MergedLog:
    """Writes what the processes print, one line at a time.

    Args:
        stream: where the lines go; None is standard output, looked up anew for each line, so that a
            prompt that shares the terminal can take it over.
        names: the names that will come, for the width of the column and the colours.
        colour: None decides by the stream: a terminal and no NO_COLOR.
        path: a file that gets the same lines without colours.
    """

    def __init__(
        self,
        stream: TextIO | None,
        names: Sequence[str],
        colour: bool | None = None,
        path: Path | None = None,
    ) -> None:
        self._stream = stream
        self.broken = False
        self._names = frozenset(names)
        self._width = max(map(len, (*names, LAUNCHER)))
        self._colours = {n: _NODE_COLOURS[i % len(_NODE_COLOURS)] for i, n in enumerate(names)}
        self._colours[LAUNCHER] = '1'
        self._terminal = (stream or sys.stdout).isatty()
        if colour is None:
            colour = self._terminal and not os.environ.get('NO_COLOR')
        self._colour = colour
        self._file = LogFile(path, self.warn) if path is not None else None

    def say(self, text: str) -> None:
        """Print a line of the launcher's own."""
        self._write(LAUNCHER, '', text)

    def warn(self, text: str) -> None:
        self._write(LAUNCHER, 'WARN', text)

    def error(self, text: str) -> None:
        self._write(LAUNCHER, 'ERROR', text)

    def line(self, process: str, raw: str) -> None:
        """Print a line that `process` printed."""
        # A progress bar redraws its line: only what it ended with belongs into a log.
        text = raw.rstrip('\r\n\t ').rsplit('\r', 1)[-1]
        if text.startswith(FOR_THE_TERMINAL):
            if self._terminal:
                self._show(bounded(text.removeprefix(FOR_THE_TERMINAL)))
            return
        if text.startswith(_FIELD) and text.count(_FIELD) >= 3:
            _, severity, origin, message = text.split(_FIELD, 3)
            severity, origin, message = map(bounded, (severity, origin, message))
            message = _ESCAPES.sub('', message)
            name = origin.rsplit('.', 1)[-1]
            if (of_robot := '/'.join(origin.split('.')[-2:])) in self._names:
                name = of_robot
            if name in self._names:
                self._write(name, severity, message)
            else:
                self._write(process, severity, f'{origin}: {message}')
            return
        text = bounded(text)
        # A prompt prints past the logger, with its node's name in front.
        name, sign, message = text.removeprefix('[').partition('] ')
        if sign and text.startswith('[') and name in self._names:
            self._write(name, '', message)
        elif text:
            self._write(process, '', text)

    def plain(self, text: str) -> None:
        """Print a block of text without time and name, such as the summary."""
        self._emit(text, text)

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, name: str, severity: str, text: str) -> None:
        clock = datetime.now().strftime('%H:%M:%S.%f')[:-3]
        word = '' if severity in ('', 'INFO') else f'{severity}: '
        plain = f'{clock} {name:<{self._width}} | {word}{_ESCAPES.sub("", text)}'
        if not self._terminal and not self._colour:
            self._emit(plain, plain)
            return
        head, more = f'{clock} {name:<{self._width}} | ', f'{"":{len(clock) + self._width}}  | '
        lines = self._fitting(word + text, len(head))
        if self._colour:
            shade = _SEVERITY_COLOURS.get(severity, '')
            if shade:
                lines = [f'\x1b[{shade}m{line}\x1b[0m' for line in lines]
            head = (
                f'\x1b[2m{clock}\x1b[0m \x1b[{self._colours.get(name, "0")}m'
                f'{name:<{self._width}}\x1b[0m | '
            )
        self._emit('\n'.join([head + lines[0], *(more + line for line in lines[1:])]), plain)

    def _fitting(self, text: str, taken: int) -> list[str]:
        """Return the text as lines that fit beside what is `taken` of a terminal's columns."""
        if not self._terminal or '\x1b' in text:
            return [text]
        room = shutil.get_terminal_size().columns - taken
        if room < _LEAST_TEXT or len(text) <= room:
            return [text]
        return textwrap.wrap(text, room, break_on_hyphens=False) or [text]

    def _emit(self, shown: str, plain: str) -> None:
        if self._file is not None:
            self._file.write(plain)
        self._show(shown)

    def _show(self, shown: str) -> None:
        if self.broken:
            return
        stream = self._stream or sys.stdout
        try:
            stream.write(shown + '\n')
            stream.flush()
        except (OSError, ValueError):
            self.broken = True
            _discard(stream)


class LogFile(RotatingFileHandler):
    """A log of bounded size: the older half is in a second file, whose name ends with `.1`.

    A disk that is full costs the lines until there is space again.

    Args:
        path: The file; continued when it exists.
        warn: Told once when a line could not be written.
        most: Bytes of each of the two files.

    Raises:
        OSError: It cannot be opened.
    """

    def __init__(self, path: Path, warn: Callable[[str], None], most: int = LOG_BYTES) -> None:
        super().__init__(path, maxBytes=most, backupCount=1, encoding='utf-8')
        self._warn = warn
        self._told = False

    def write(self, line: str) -> None:
        """Append a line, if that is possible now."""
        self.emit(makeLogRecord({'msg': line}))
        if self.stream is not None:
            self._told = False

    def handleError(self, record: LogRecord) -> None:  # noqa: N802 - logging's name
        """Let go of a file that cannot be written; the next line opens it again."""
        error = sys.exc_info()[1]
        with contextlib.suppress(OSError):
            self.close()
        self.stream = None
        if not self._told:
            self._told = True
            why = getattr(error, 'strerror', None) or error
            self._warn(f'{self.baseFilename}: {why}: the log continues only here')


def bounded(text: str) -> str:
    """Return a line of bounded length in which only colours are left of the control characters."""
    if len(text) > LONGEST_LINE:
        text = f'{text[:LONGEST_LINE]} ... ({len(text) - LONGEST_LINE} characters left out)'
    if text.isprintable():
        return text
    return ''.join(
        each if each.isprintable() or each == '\x1b' else each.encode('unicode_escape').decode()
        for each in text
    )


def _discard(stream: TextIO) -> None:
    """Send what is still buffered nowhere: at its exit, Python would fail to write it."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
