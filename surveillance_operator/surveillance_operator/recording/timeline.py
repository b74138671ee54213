"""The time line of a recording: what the page showed, to be replayed without ROS.

A file of lines, each one JSON object: `t` (seconds since 1970), `now` (the mission's time) and `p`,
the parts that changed. Every minute a line holds all parts (`k` is 1), so that a reader that jumps
reads little. A torn last line is ignored.
"""

from __future__ import annotations

import bisect
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from strict_files.files import FileError, LineFile
from strict_files.regular_files import parse_json
from surveillance_operator.mission_state import MissionState
from surveillance_operator.page_state import Parts, PatchMaker, lengthen

LEFT_OUT = frozenset({'scan', 'usage'})
"""Parts that change all the time: they are in the recording itself."""
WHOLE_PERIOD = 60.0
"""Seconds between two lines that hold everything."""
_HEAD = re.compile(rb'\{"t":([\d.]+),"k":([01]),"e":"(\w*)"')
SHOWN_MARKS = ('decision', 'failure', 'recharge')
"""What of `event_log.MARKS` is to be seen on the page, where a recording has no log."""


class TimelineWriter:
    """Appends to a time line.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: LineFile | None = None
        self._framer = PatchMaker(without=LEFT_OUT)
        self._whole = 0.0
        self._before: MissionState | None = None

    def add(self, state: MissionState, at: float) -> None:
        """Write what changed, if anything did.

        Args:
            state: What is known.
            at: Seconds since 1970.

        Raises:
            OSError: The file takes no more; the next line will hold everything.
        """
        changed = self._framer.patch(state)
        whole = at - self._whole >= WHOLE_PERIOD
        if not changed and not whole:
            return
        if whole:
            self._whole, changed = at, self._framer.whole()
        line = json.dumps({'now': round(state.now, 2), 'p': changed}, separators=(',', ':'))
        head = f'{{"t":{at:.3f},"k":{int(whole)},"e":"{self._event(state)}",'
        try:
            if self._file is None:
                self._file = LineFile(self._path)
            self._file.append((head + line[1:] + '\n').encode())
        except OSError:
            self._whole = 0.0
            self.close()
            raise
        self._before = state

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _event(self, state: MissionState) -> str:
        """Return the most important thing that happened since the last line."""
        before = self._before
        marks = state.history.marks
        if before is not None and marks and marks != before.history.marks:
            kind = marks[-1][1]
            return kind if kind in SHOWN_MARKS else 'failure' if kind == 'help' else ''
        if before is None or state.task.decision_number != before.task.decision_number:
            return 'decision' if state.task.decision is not None else ''
        return ''


class Timeline:
    """Reads a time line.

    Args:
        path: The file.
        warn: Called with one line for each line of the file that is damaged; it changes nothing.

    Attributes:
        times: Of the lines, seconds since 1970, ascending.
        marks: Times by what happened, one of `SHOWN_MARKS`.

    Raises:
        FileError: There is no such file, or nothing in it.
    """

    def __init__(self, path: Path, warn: Callable[[str], None] = lambda _: None) -> None:
        self._warn = warn
        self._damaged: set[int] = set()
        self.times: list[float] = []
        self.marks: dict[str, list[float]] = {name: [] for name in SHOWN_MARKS}
        self._offsets: list[int] = []
        self._wholes: list[int] = []
        try:
            self._file = open(path, 'rb')  # noqa: SIM115 - kept open
        except OSError as error:
            raise FileError(f'{path}: {error.strerror}') from None
        self._offset = 0
        self.extend()
        if not self._wholes:
            raise FileError(f'{path}: holds nothing to replay')

    def extend(self) -> None:
        """Read on in a file that grows."""
        self._file.seek(self._offset)
        for line in self._file:
            if not line.endswith(b'\n'):
                return
            if match := _HEAD.match(line):
                at = float(match.group(1))
                if match.group(2) == b'1':
                    self._wholes.append(len(self.times))
                if (mark := match.group(3).decode()) in self.marks:
                    self.marks[mark].append(at)
                # A clock that was set back must not hide lines.
                self.times.append(max(at, self.times[-1] if self.times else at))
                self._offsets.append(self._offset)
            self._offset += len(line)

    def at(self, time: float) -> tuple[int, float, Parts]:
        """Return the number of the line that holds at a time, the mission's time, and all parts."""
        number = max(self._wholes[0], bisect.bisect_right(self.times, time) - 1)
        first = self._wholes[bisect.bisect_right(self._wholes, number) - 1]
        parts: Parts = {}
        now = 0.0
        trail: list[Any] = []
        for each in range(first, number + 1):
            then, changed = self.line(each)
            now = now if then is None else then
            trail = changed.pop('trail', trail)
            if changed.get('pose') and each > first:
                lengthen(trail, changed['pose'])
            parts.update(changed)
        return number, now, {**parts, 'trail': trail}

    def line(self, number: int) -> tuple[float | None, Parts]:
        """Return the mission's time of a line, and the parts that it changes.

        A damaged line has no time and changes nothing.
        """
        self._file.seek(self._offsets[number])
        try:
            content = parse_json(self._file.readline())
            return float(content['now']), dict(content['p'])
        except (ValueError, LookupError, TypeError, OverflowError) as error:
            if number not in self._damaged:
                self._damaged.add(number)
                self._warn(f'{self._file.name}: a damaged line is left out: {error}')
            return None, {}

    def next_mark(self, kind: str, time: float) -> float | None:
        """Return when the next event of a kind happened after a time."""
        later = bisect.bisect_right(self.marks[kind], time + 1e-3)
        return self.marks[kind][later] if later < len(self.marks[kind]) else None

    def close(self) -> None:
        """Close the file."""
        self._file.close()
