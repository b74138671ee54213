"""What the page showed at a time of the run that goes on, from its time line."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

from strict_files.files import FileError
from surveillance_operator.recording.timeline import Timeline
from surveillance_runtime.run_files import TIMELINE


class PastParts:
    """Reads the time lines of a run's robots as they grow.

    Args:
        folder: Of the run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._lines: dict[str, Timeline] = {}

    def past(self, at: str, robot: str = '') -> Any:
        """Tell what the page showed of a robot at a time, seconds since 1970."""
        time = float(at)
        if '/' in robot or robot.startswith('.'):
            raise ValueError(f'no robot {robot[:40]!r}')
        with self._lock:
            line = self._line(robot)
            if time < line.times[0]:
                raise ValueError('nothing is recorded of this time')
            _, now, parts = line.at(time)
        return {'ok': True, 'now': now, 'parts': parts}

    def close(self) -> None:
        """Close the files."""
        with self._lock:
            for each in self._lines.values():
                each.close()

    def _line(self, robot: str) -> Timeline:
        try:
            if robot not in self._lines:
                self._lines[robot] = Timeline(self._folder / robot / TIMELINE)
            self._lines[robot].extend()
        except FileError:
            raise ValueError('nothing is recorded: start with --record') from None
        return self._lines[robot]
