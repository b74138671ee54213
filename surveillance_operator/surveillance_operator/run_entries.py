"""What happened on a robot's run, as reports and replays read it, also of an older version."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from strict_files.files import FileError, read_file
from strict_files.regular_files import parse_json
from surveillance_behaviour.mission.mission_log import account_of
from surveillance_runtime.event_log import (
    LARGEST,
    RecordEntry,
    UnreadLines,
    on_one_clock,
    read,
    read_all,
    record_in,
)

OLD_INCIDENTS = 'incidents.jsonl'
"""Where an earlier version kept what the log has now."""


@dataclass(frozen=True)
class RunEntries:
    """The entries of a run.

    Attributes:
        entries: On one clock, so that what lies between two of them is how long it took.
        left_out: What of the log is damaged, or of a later version.
    """

    entries: list[RecordEntry]
    left_out: UnreadLines

    @property
    def of_mission(self) -> list[RecordEntry]:
        """Those that the behaviour wrote."""
        return [each for each in self.entries if each.kind.is_of_mission]

    def problem(self) -> str:
        """Return what is not in it; empty: nothing."""
        return self.left_out.words()


def entries_of_run(folder: Path, *, whole: bool = False) -> RunEntries:
    """Return what happened to a robot.

    Args:
        folder: Of its run.
        whole: Whether what was packed away is read, too.

    Raises:
        FileError: There is no log, or it cannot be read.
    """
    path, left_out = record_in(folder), UnreadLines()
    old = list(_old_incidents(folder / OLD_INCIDENTS, left_out))
    found: list[RecordEntry] = []
    if path.exists() or not old:
        found = list(read_all(path, left_out)) if whole else read(path, left_out)
        try:
            account_of(found[:1])  # a snapshot
        except FileError as error:
            left_out.damaged.append(f'{path}: {error}')
            found = list(read_all(path, left_out))
    return RunEntries([*old, *on_one_clock(found)], left_out)


def _old_incidents(path: Path, left_out: UnreadLines) -> Iterator[RecordEntry]:
    """Give the incidents of a run of an earlier version, whose clock the log does not share."""
    try:
        lines = read_file(path, LARGEST).split(b'\n')
    except FileError:
        return
    for number, line in enumerate(each for each in lines if each.strip()):
        try:
            told = parse_json(line)
            at, lasted = float(told['at']), told['seconds']
            fields = {key: str(told[key]) for key in ('kind', 'name', 'severity', 'text')}
            fields['node'] = str(told.get('node', ''))
        except (ValueError, KeyError, TypeError, OverflowError):
            left_out.damaged.append(f'{path}:{number + 1}: expected an incident')
            continue
        phase = 'begin' if lasted is None else 'end'
        more = {'id': f'{fields["node"]} {fields["kind"]} {fields["name"]}', 'phase': phase}
        if lasted is not None:
            more['seconds'] = lasted
        yield RecordEntry('incident', math.nan, {**fields, **more, 'line': number}, at)


def marks_of(path: Path) -> dict[str, list[float]]:
    """Return when what happened that a replay can jump to, seconds since 1970, ascending.

    Args:
        path: The log; none that tells dates, as of an earlier version, gives nothing.
    """
    marks: dict[str, list[float]] = {}
    with contextlib.suppress(FileError):
        for entry in read_all(path):
            is_late = entry.name == 'incident' and entry.text('phase') != 'begin'
            if entry.kind.mark and entry.at is not None and not is_late:
                marks.setdefault(entry.kind.mark, []).append(entry.at)
    return {mark: sorted(times) for mark, times in marks.items()}


@dataclass(frozen=True)
class PastIncident:
    """An incident as the log tells it.

    Attributes:
        at: When it began, seconds since 1970.
        cause: What it was about.
        severity: How much it mattered, at its worst.
        text: What was said of it.
        lasted: For how long, seconds; None: it goes on.
        calls: How often somebody was called.
    """

    at: float
    cause: str
    severity: str
    text: str
    lasted: float | None = None
    calls: int = 0


def incidents_of(entries: Iterable[RecordEntry]) -> list[PastIncident]:
    """Return the incidents of a run, in the order in which they began."""
    found: list[dict[str, Any]] = []
    begun: dict[str, dict[str, Any]] = {}
    for entry in entries:
        if entry.name != 'incident':
            continue
        phase, number = entry.text('phase'), entry.text('id')
        if phase == 'begin' or number not in begun:
            if phase == 'end':
                continue  # its beginning is in a file that was packed away
            begun[number] = {
                'at': entry.at or 0.0,
                'cause': f'{entry.text("kind")} {entry.text("name")}',
                'severity': entry.text('severity'),
                'text': entry.text('text'),
            }
            found.append(begun[number])
        if phase == 'call':
            begun[number]['calls'] = begun[number].get('calls', 0) + 1
            begun[number]['severity'] = entry.text('severity')
        elif phase == 'end':
            begun.pop(number)['lasted'] = _number(entry.fields.get('seconds'))
    return [PastIncident(**each) for each in found]


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
