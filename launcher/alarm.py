"""The alarm: reads the nodes' incidents from their log lines, and calls a person when it is time.

A call is a line of the log, the argument of the command of `--alarm`, and news for the sinks of
`--notify` (`surveillance_operator.notify`).

Each incident is also kept as a line of the run's `incidents.jsonl`, for the report.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path

from launcher.log_merge import MergedLog
from strict_files.files import LineFile
from surveillance_runtime.incidents import (
    Call,
    Cause,
    Incident,
    IncidentBook,
    Severity,
    Told,
    read_line,
)
from surveillance_runtime.run_files import INCIDENTS

LAUNCHER = 'launch'
QUIET_AGAIN = 600.0
"""A node that died again and again, and has not for this long, is well again, seconds."""


def caller(
    alarm: str, log: MergedLog, tell: Callable[[Call], object] = lambda _: None
) -> Callable[[Call], None]:
    """Return what calls somebody: it says so in the log, runs the user's command with one line as
    its argument, and tells the sinks.
    """

    def call(told: Call) -> None:
        text = told.text
        log.warn(f'alarm: {text}')
        tell(told)
        if not alarm:
            return
        try:
            subprocess.Popen(
                [*shlex.split(alarm), text],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            log.error(f'--alarm {alarm}: {error}')

    return call


class Alarm:
    """Keeps the book of a run's incidents on a thread of its own.

    Args:
        call: Calls somebody.
        folder: Of the run; None: incidents are not kept.
        now: Steady time, seconds.
    """

    def __init__(
        self,
        call: Callable[[Call], object],
        folder: Path | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now = now
        self._changed = threading.Condition()
        self._ended = False
        self._dying: dict[str, float] = {}
        self._file: LineFile | None = None
        if folder is not None:
            try:
                self._file = LineFile(folder / INCIDENTS)
            except OSError:
                self._file = None  # a full disk: the incidents are told all the same
        self._book = IncidentBook(call, self._note)
        self._thread = threading.Thread(target=self._work, name='alarm', daemon=True)
        self._thread.start()

    def hear(self, node: str, line: str) -> None:
        """Take a line that a node has printed."""
        if (told := read_line(line)) is not None:
            with self._changed:
                self._book.hear(node, told, self._now())
                self._changed.notify()

    def trouble(self, text: str) -> None:
        """Take that a process dies again and again; the text begins with its name."""
        name = text.split()[0]
        with self._changed:
            now = self._now()
            self._dying[name] = now
            told = Told(Cause('node', name), Severity.ALARM, text, over=False)
            self._book.hear(LAUNCHER, told, now)
            self._changed.notify()

    def restarted(self, node: str) -> None:
        """Take that a process was started again."""
        with self._changed:
            now = self._now()
            if node in self._dying:
                self._dying[node] = now
            self._book.restarted(node, now)
            self._changed.notify()

    def close(self) -> None:
        """End; nobody is called any more."""
        with self._changed:
            self._ended = True
            self._changed.notify()
        self._thread.join()
        if self._file is not None:
            self._file.close()

    def _work(self) -> None:
        with self._changed:
            while not self._ended:
                now = self._now()
                for name, at in list(self._dying.items()):
                    if now - at >= QUIET_AGAIN:
                        del self._dying[name]
                        over = Told(Cause('node', name), Severity.ALARM, f'{name} lives', over=True)
                        self._book.hear(LAUNCHER, over, now)
                due = self._book.advance(now)
                due = min(
                    [
                        *([] if due is None else [due]),
                        *(at + QUIET_AGAIN for at in self._dying.values()),
                    ],
                    default=None,
                )
                self._changed.wait(None if due is None else max(0.0, due - now))

    def _note(self, incident: Incident) -> None:
        if self._file is None:
            return
        ended = incident.ended
        entry = {
            'at': round(time.time(), 3),
            'node': incident.node,
            'kind': incident.cause.kind,
            'name': incident.cause.name,
            'severity': incident.severity.value,
            'text': incident.text,
            'seconds': None if ended is None else round(ended - incident.began, 1),
        }
        try:
            self._file.append((json.dumps(entry) + '\n').encode())
        except OSError:
            self._file = None
