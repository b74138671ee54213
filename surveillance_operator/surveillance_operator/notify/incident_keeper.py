"""Keeps the incidents of a run: the book that says whom to call when, and the log of each robot.

What was called for is in the log before anybody is called. So a keeper that is started again knows
what goes on and who was called for it, and nobody is called twice or never told that it is over.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from strict_files.files import FileError
from surveillance_operator.desk.handling import AlarmDesk, Handled
from surveillance_runtime.event_log import (
    KINDS,
    Clocks,
    EventLog,
    RecordEntry,
    age,
    read_newest,
    record_in,
    steady_now,
)
from surveillance_runtime.incidents import (
    Cause,
    Incident,
    IncidentBook,
    IncidentCall,
    IncidentPhase,
    IncidentUpdate,
    SeenThing,
    Severity,
)
from surveillance_runtime.run_files import folder_of

MOST_PAST = 1000
"""So many alarms that are over can still be acknowledged, the newest."""
LISTED = 20


class IncidentKeeper:
    """Keeps the incidents of a run; one thread at a time.

    Args:
        call: Called with each call.
        folder: Of the run, in which each robot of a fleet has a folder of its name; None: nothing
            is kept.
        mission_time: Returns the seconds on the mission's clock.
        steady: Returns the seconds since the machine was started.
        wall: Returns the seconds since 1970.
        lost: Called with each incident that is over since its owner tells of it no more.
        escalations: After how long without an acknowledgement others are called, too, seconds.
        warn: Called with each warning that begins or is over: nobody is called for it.
    """

    def __init__(
        self,
        call: Callable[[IncidentCall], object],
        folder: Path | None = None,
        mission_time: Callable[[], float | None] = lambda: None,
        steady: Callable[[], float] = steady_now,
        wall: Callable[[], float] = time.time,
        lost: Callable[[IncidentUpdate], object] = lambda _told: None,
        escalations: Sequence[float] = (),
        warn: Callable[[IncidentCall], object] = lambda _call: None,
    ) -> None:
        self._lost, self._warn = lost, warn
        self._call, self._folder, self._mission_time = call, folder, mission_time
        self._steady, self._clocks = steady, Clocks(wall, steady)
        self._logs: dict[Path, EventLog] = {}
        self.desk = AlarmDesk(self._write_handled, wall)
        self.book = IncidentBook(self._on_call, self._on_note, self.desk.is_quiet, escalations)
        # What is over, by its number: it can still be acknowledged.
        self._past: dict[str, IncidentUpdate] = {}
        if folder is not None:
            self._restore(folder)

    def hear(self, told: IncidentUpdate) -> None:
        """Take what the owner of an incident tells."""
        self.book.hear(told, self._steady())
        if told.acknowledged_by:
            for each in self.book.open():
                if told.owner == each.told.owner and told.cause == each.told.cause:
                    self.desk.heard(each.told)

    def carry_out(self, line: str) -> str:
        """Do what a person says of an alarm, or list those that are open; return what was done.

        Args:
            line: See `desk.handling`; or `list`.

        Raises:
            ValueError: What was wrong, and what was expected.
        """
        going_on = {each.told.id: each.told for each in self.book.open()}
        if line.strip() == 'list':
            now, lines = self._clocks.wall(), []
            for number, told in list(going_on.items())[:LISTED]:
                state = self.desk.of(number).state(goes_on=True, now=now)
                lines.append(f'{number}: {told.text} ({state})')
            more = [f'and {len(going_on) - LISTED} more'] if len(going_on) > LISTED else []
            return '; '.join([*lines, *more]) or 'no alarm is open'
        return self.desk.carry_out(line, self._past | going_on)

    def restarted(self, owner: str) -> None:
        """Take that a node was started again."""
        self.book.restarted(owner, self._steady())

    def advance(self) -> float | None:
        """Call whom it is time to call; return in how many seconds to look again, None: no need."""
        now = self._steady()
        due = self.book.advance(now)
        change = self.desk.next_change()
        waits = [*([] if due is None else [max(0.0, due - now)]), *([change] if change else [])]
        return min(waits, default=None)

    def close(self) -> None:
        """Tell what is over, and end."""
        self.book.close(self._steady())
        for log in self._logs.values():
            log.close()

    def write(self, kind: str, robot: str, /, **fields: object) -> None:
        """Write an entry to the log of a robot, or to that of what robots share."""
        if self._folder is None:
            return
        path = record_in(folder_of(self._folder, robot))
        # A full disk: the entry waits, and people are told all the same.
        with contextlib.suppress(FileError):
            if path not in self._logs:
                self._logs[path] = EventLog(path, self._clocks)
            self._logs[path].write(kind, self._mission_time(), **fields)

    def _write_handled(self, done: Handled, robot: str) -> None:
        self.write('handling', robot, **done.to_fields())

    def _on_call(self, call: IncidentCall) -> None:
        if call.only is not None:
            self._write_incident(call.incident, 'escalate', after=call.only)
        elif not call.over:
            self._write_incident(call.incident, 'call', number=call.number)
        self._call(call)

    def _on_note(self, incident: Incident) -> None:
        told = incident.told
        if told.severity is Severity.WARNING:
            self._warn(IncidentCall(told.text, incident, 0, incident.ended is not None))
        if incident.ended is None:
            self._write_incident(incident, 'begin')
            self.desk.began(told)
        else:
            self._take_past(told)
            lasted = round(incident.ended - incident.began, 1)
            more: dict[str, object] = {'is_lost': True} if incident.is_lost else {}
            if incident.also:
                more['also'] = list(incident.also)
            self._write_incident(incident, 'end', seconds=lasted, **more)
            if incident.is_lost:
                self._lost(replace(incident.told, phase=IncidentPhase.END))

    def _take_past(self, told: IncidentUpdate) -> None:
        self._past[told.id] = told
        while len(self._past) > MOST_PAST:
            oldest = next(iter(self._past))
            del self._past[oldest]
            self.desk.forget([oldest])

    def _write_incident(self, incident: Incident, phase: str, **more: object) -> None:
        told = incident.told
        fields: dict[str, object] = {
            'id': told.id,
            'phase': phase,
            'robot': told.robot,
            'node': told.node,
            'kind': told.cause.kind,
            'name': told.cause.name,
            'severity': told.severity.value,
            'text': told.text,
            'place': told.place,
            'action': told.action,
            'acknowledged_by': told.acknowledged_by,
            'evidence': list(told.evidence),
        }
        if told.finding is not None:
            fields['finding'] = vars(told.finding)
        required = KINDS['incident'].fields
        given = {k: value for k, value in fields.items() if value not in ('', []) or k in required}
        self.write('incident', told.robot, **given, **more)

    def _restore(self, folder: Path) -> None:
        """Take up what an earlier keeper of the same run had."""
        for own in (folder, *(each for each in _below(folder) if record_in(each).is_file())):
            begun: dict[str, tuple[RecordEntry, list[RecordEntry]]] = {}
            known: dict[str, IncidentUpdate] = {}
            # A file may have been packed away while something went on.
            for entry in read_newest(record_in(own), packed=1):
                with contextlib.suppress(ValueError, TypeError, LookupError):  # a stranger's line
                    if entry.name == 'handling':
                        done = Handled.from_fields(entry.fields, entry.at or 0.0)
                        self.desk.restore(done, known.get(done.id))
                    elif entry.name == 'incident':
                        known[entry.text('id')] = _update_of(entry.fields)
                if entry.name != 'incident':
                    continue
                number, phase = entry.text('id'), entry.text('phase')
                if phase == 'begin':
                    begun[number] = entry, []
                elif phase == 'end':
                    begun.pop(number, None)
                    self._take_end(entry)
                    if number in known:
                        self._take_past(known[number])
                elif number in begun:
                    begun[number][1].append(entry)
            for first, calls in begun.values():
                self._take_up(first, calls)

    def _take_end(self, entry: RecordEntry) -> None:
        if not entry.fields.get('is_lost'):
            robot, node = str(entry.fields.get('robot', '')), entry.text('node')
            also = entry.names('also') if 'also' in entry.fields else ()
            self.book.forget(f'{robot}/{node}' if robot else node, entry.text('id'), *also)

    def _take_up(self, first: RecordEntry, calls: list[RecordEntry]) -> None:
        now = self._steady()
        escalated = sum(each.text('phase') == 'escalate' for each in calls)
        calls = [each for each in calls if each.text('phase') == 'call']
        last = calls[-1] if calls else first
        with contextlib.suppress(ValueError, TypeError, LookupError):  # a stranger's line
            told = _update_of(last.fields)
            began, called = (now - age(each, self._clocks) for each in (first, last))
            self.book.restore(told, began, len(calls), called, now, escalated)


def _below(folder: Path) -> list[Path]:
    try:
        return sorted(each for each in folder.iterdir() if each.is_dir())
    except OSError:
        return []


def _update_of(fields: Any) -> IncidentUpdate:
    """Return the incident of an entry.

    Raises:
        ValueError, TypeError, LookupError: It is none.
    """

    def text(key: str) -> str:
        return str(fields.get(key, ''))

    seen = fields.get('finding')
    return IncidentUpdate(
        IncidentPhase.UPDATE,
        Cause(str(fields['kind']), str(fields['name'])),
        Severity(fields['severity']),
        str(fields['text']),
        str(fields['id']),
        robot=text('robot'),
        node=text('node'),
        place=text('place'),
        action=text('action'),
        acknowledged_by=text('acknowledged_by'),
        evidence=tuple(map(str, fields.get('evidence', ()))),
        finding=None if seen is None else SeenThing.from_json(seen),
    )
