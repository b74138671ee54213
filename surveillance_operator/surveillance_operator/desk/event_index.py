"""All that was noticed, told and done, of the run that goes on and of those before it: to search.

It is made of the logs (`events.jsonl`), which have one owner for each fact, and holds nothing of
its own: the page that goes on, a replay, the hand-over and the search have the same from it.

A finding of the observer and the incident that it made are one event here. What is not over, and
what is over but was not acknowledged, is open (`open_at`).
"""

from __future__ import annotations

import bisect
import gzip
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from indoor_watch import Kind
from strict_files.regular_files import parse_json
from surveillance_operator.desk.handling import AlarmState, Handled, Handling, Mutes
from surveillance_runtime.event_log import record_in, segments

SEVERITIES = ('note', 'notice', 'warning', 'alert')
ALERT, WARNING = 3, 2
NOTICED, GOING_ON = 'noticed', 'open'
STATES = (*(str(each) for each in AlarmState), GOING_ON, NOTICED)
"""Of an alert those of ISA-18.2; what nobody is called for is noticed, goes on, or is over."""
PAGE = 100
"""Events of one answer, unless more are asked for."""
MOST = 1000
LONGEST_LINE = 1_000_000
_ANSWERED = {'normal': 'normal', 'false alarm': 'false'}
_READ = ('incident', 'finding', 'handling', 'failure', 'restart', 'gap')
_HEADS = tuple(f'{{"event": "{name}"'.encode() for name in _READ)


@dataclass
class DeskEvent:
    """One thing that was noticed or told.

    Attributes:
        key: Of this event alone, in all runs.
        run, robot: Whose it is.
        kind, subject, seen: As the observer or the incident's cause has them.
        text, rule, place, position: What, by which rule, where (map frame, metres).
        severity: 0 to 3, see `SEVERITIES`.
        began, last: First and last sighting, seconds since 1970.
        ended: When it was over, seconds since 1970; None: it goes on.
        number: The observer's; 0: it is none of its.
        ids: The incident's numbers, the newest last; none: nobody was to know.
        is_alarm: Whether people were to be called.
        calls: When they were, seconds since 1970.
        handling: What people have done about it.
    """

    key: str
    run: str
    robot: str
    kind: str
    subject: str
    began: float
    seen: str = ''
    text: str = ''
    rule: str = ''
    place: str = ''
    position: tuple[float, float] | None = None
    severity: int = 0
    last: float = 0.0
    ended: float | None = None
    number: int = 0
    ids: tuple[str, ...] = ()
    is_alarm: bool = False
    calls: list[float] = field(default_factory=list)
    evidence: tuple[str, ...] = ()
    confidence: float = 0.0
    looks: int = 0
    action: str = ''
    handling: Handling = field(default_factory=Handling)
    words: str = ''

    def state(self, now: float, mutes: Mutes | None = None, *, later: bool = False) -> str:
        """Return the state at a time, seconds since 1970.

        Args:
            now: The time.
            mutes: The kinds that are muted.
            later: Whether more is known than was at that time, as in a replay.
        """
        handling, ended = self.handling, self.ended
        if later:
            handling = Handling()
            for each in self.handling.said:
                handling = handling.after(each) if each.at <= now else handling
            ended = None if ended is None or ended > now else ended
        if self.is_alarm:
            muted = mutes is not None and mutes.holds((self.kind,), now)
            return str(handling.state(goes_on=ended is None, now=now, muted=muted))
        if ended is not None:
            return str(AlarmState.OVER)
        return GOING_ON if self.severity >= WARNING else NOTICED

    def to_json(self, now: float, mutes: Mutes | None = None, *, later: bool = False) -> Any:
        """Return it as plain values, see `state`."""
        state = self.state(now, mutes, later=later)
        said = [each for each in self.handling.said if not later or each.at <= now]
        handling = self.handling
        if later:
            handling = Handling()
            for each in said:
                handling = handling.after(each)
        return {
            'key': self.key,
            'run': self.run,
            'robot': self.robot,
            'id': self.ids[-1] if self.ids else '',
            'number': self.number,
            'kind': self.kind,
            'subject': self.subject,
            'seen': self.seen,
            'text': self.text,
            'rule': self.rule,
            'place': self.place,
            'position': None if self.position is None else list(self.position),
            'severity': self.severity,
            'level': SEVERITIES[self.severity],
            'state': state,
            'began': self.began,
            'last': self.last,
            'ended': None if later and (self.ended or 0.0) > now else self.ended,
            'calls': len(self.calls),
            'evidence': list(self.evidence),
            'confidence': round(self.confidence, 2),
            'looks': self.looks,
            'action': self.action,
            'by': handling.acknowledged_by,
            'acknowledged_at': handling.acknowledged_at,
            'assigned': handling.assigned_to,
            'until': handling.shelved_until,
            'answer': handling.answer,
            'said': [[each.at, each.by, each.text] for each in said],
        }


class EventIndex:
    """What the logs of runs hold; safe from any thread."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._events: dict[str, DeskEvent] = {}
        self._ids: dict[tuple[str, str], DeskEvent] = {}
        # By when they began: a search goes through them from the newest on.
        self._order: list[DeskEvent] = []
        self._is_sorted = True
        self.mutes = Mutes()
        self._open: dict[str, DeskEvent] = {}
        self.version = 0

    def __len__(self) -> int:
        return len(self._events)

    def read(self, lines: Iterable[bytes], run: str, robot: str = '', *, live: bool = False) -> int:
        """Take lines of a log; return how many meant something.

        Args:
            lines: The lines.
            run: The name of the run.
            robot: Whose log it is.
            live: Whether the run goes on: else nothing of it is open.
        """
        found = 0
        with self._lock:
            for line in lines:
                if not line.startswith(_HEADS) or len(line) > LONGEST_LINE:
                    continue
                try:
                    entry = parse_json(line)
                    self._take(entry, float(entry['at']), run, robot, live)
                except (ValueError, KeyError, TypeError, AttributeError, IndexError):
                    continue  # a stranger's line, or of another version
                found += 1
            self.version += bool(found)
        return found

    def find(self, key: str) -> DeskEvent | None:
        """Return the event of a key, or of an incident's number in the run that goes on."""
        with self._lock:
            if key in self._events:
                return self._events[key]
            return next((e for (_, number), e in self._ids.items() if number == key), None)

    def open_at(self, now: float) -> list[DeskEvent]:
        """Return the alarms and warnings that are open now, the worst and newest first."""
        with self._lock:
            over = str(AlarmState.OVER)
            for key, each in list(self._open.items()):
                if each.state(now, self.mutes) == over:
                    del self._open[key]
            return sorted(self._open.values(), key=lambda e: (-e.severity, -e.began))

    def were_open_at(self, at: float) -> list[DeskEvent]:
        """Return what was open at an earlier time, as `open_at`."""
        over = str(AlarmState.OVER)
        with self._lock:
            found = [
                each
                for each in self._all()
                if each.began <= at and each.severity >= WARNING and each.ids
                if each.state(at, later=True) != over
            ]
        return sorted(found, key=lambda e: (-e.severity, -e.began))

    def between(self, begin: float, end: float) -> list[DeskEvent]:
        """Return what went on at some time between two, seconds since 1970, the oldest first."""
        with self._lock:
            return [
                each
                for each in self._all()
                if each.began < end and (each.ended if each.ended is not None else end) >= begin
            ]

    def search(
        self,
        now: float,
        *,
        text: str = '',
        begin: float | None = None,
        end: float | None = None,
        place: str = '',
        kind: str = '',
        severity: int = 0,
        state: str = '',
        robot: str = '',
        run: str = '',
        skip: int = 0,
        most: int = PAGE,
        until: float | None = None,
    ) -> dict[str, Any]:
        """Return what fits, the newest first, and how many there are in all.

        Args:
            now: Seconds since 1970.
            text: Words that all are in it.
            begin, end: When it went on, seconds since 1970.
            place, kind, state, robot, run: What it is to have; empty: whatever it has.
            severity: The least.
            skip, most: The part of what is found that is wanted.
            until: What is known later is left out, as in a replay; None: nothing is.
        """
        wanted = text.lower().split()
        found: list[DeskEvent] = []
        count = 0
        later = until is not None
        at = now if until is None else until
        with self._lock:
            events = self._all()
            last = len(events)
            if end is not None or later:
                bound = min(at if later else end or at, end if end is not None else at)
                last = bisect.bisect_right(events, bound, key=lambda e: e.began)
            for each in reversed(events[:last]):
                if each.severity < severity:
                    continue
                if (place and each.place != place) or (kind and each.kind != kind):
                    continue
                if (robot and each.robot != robot) or (run and each.run != run):
                    continue
                if begin is not None and (each.ended or each.last) < begin:
                    continue
                if wanted and not all(word in each.words for word in wanted):
                    continue
                if state and each.state(at, self.mutes, later=later) != state:
                    continue
                count += 1
                if count > skip and len(found) < min(most, MOST):
                    found.append(each)
            return {
                'ok': True,
                'count': count,
                'events': [each.to_json(at, self.mutes, later=later) for each in found],
            }

    def choices(self) -> dict[str, list[str]]:
        """Return what there is to choose from in a search."""
        with self._lock:
            events = self._events.values()
            return {
                'places': sorted({each.place for each in events if each.place}),
                'kinds': sorted({each.kind for each in events}),
                'states': list(STATES),
                'severities': list(SEVERITIES),
                'robots': sorted({each.robot for each in events if each.robot}),
            }

    def _all(self) -> list[DeskEvent]:
        if not self._is_sorted:
            self._order.sort(key=lambda each: each.began)
            self._is_sorted = True
        return self._order

    def _take(self, entry: Mapping[str, Any], at: float, run: str, robot: str, live: bool) -> None:
        name = entry['event']
        if name == 'handling':
            self._handle(Handled.from_fields(entry, at), run)
            return
        if name == 'incident':
            event = self._incident(entry, at, run, robot)
        elif name == 'finding':
            event = self._finding(entry, at, run, robot)
        else:
            event = self._other(entry, at, run, robot)
        parts = (event.kind, event.subject, event.seen, event.text, event.rule, event.place)
        event.words = ' '.join(
            (*parts, event.robot, *(e.note for e in event.handling.said))
        ).lower()
        if live and event.ids and event.severity >= WARNING:
            self._open[event.key] = event

    def _event(
        self, key: str, run: str, robot: str, kind: str, subject: str, at: float
    ) -> DeskEvent:
        if key not in self._events:
            event = DeskEvent(key, run, robot, kind, subject, at, last=at)
            self._events[key] = event
            if self._order and at < self._order[-1].began:
                self._is_sorted = False
            self._order.append(event)
        return self._events[key]

    def _incident(self, entry: Mapping[str, Any], at: float, run: str, robot: str) -> DeskEvent:
        robot = str(entry.get('robot', '')) or robot
        number, kind, name = str(entry['id']), str(entry['kind']), str(entry['name'])
        seen = entry.get('finding')
        event = self._ids.get((run, number))
        if event is None and seen is not None:
            event = self._events.get(f'{run}/{robot}/{int(seen["number"])}')
        if event is None:
            of_finding = f'{run}/{robot}/{int(seen["number"])}' if seen is not None else ''
            key = of_finding or f'{run}/{robot}/{number}'
            event = self._event(key, run, robot, kind, name, at)
        self._ids[run, number] = event
        if number not in event.ids:
            event.ids = (*event.ids, number)
        phase = entry['phase']
        is_alarm = entry['severity'] == 'alarm'
        event.is_alarm = event.is_alarm or is_alarm
        event.severity = max(event.severity, ALERT if is_alarm else WARNING)
        event.text, event.place = str(entry['text']), str(entry.get('place', '')) or event.place
        event.action = str(entry.get('action', ''))
        event.evidence = tuple(map(str, entry.get('evidence', ()))) or event.evidence
        if seen is not None:
            event.kind, event.subject = str(seen['kind']), str(seen['subject'])
            event.seen, event.rule = str(seen['seen']), str(seen['rule'])
            event.number, event.confidence = int(seen['number']), float(seen['confidence'])
            event.position = _point(seen.get('position'))
            event.text = _words(event)
        if phase == 'call':
            event.calls.append(at)
        event.ended = at if phase == 'end' else None
        event.last = max(event.last, at)
        return event

    def _finding(self, entry: Mapping[str, Any], at: float, run: str, robot: str) -> DeskEvent:
        number = int(entry['number'])
        began = float(entry.get('began', at))
        # A simulation counts from 0: then the log's own time is the date.
        began = began if began > 1e9 else at
        key = f'{run}/{robot}/{number}'
        event = self._event(
            key, run, robot, str(entry['kind']), str(entry.get('subject', '')), began
        )
        event.number, event.seen = number, str(entry['seen'])
        event.place, event.rule = str(entry['place']), str(entry.get('rule', ''))
        event.severity = max(event.severity, min(ALERT, int(entry['severity'])))
        event.confidence, event.looks = (
            float(entry.get('confidence', 0.0)),
            int(entry.get('looks', 0)),
        )
        event.position = _point(entry.get('position'))
        event.evidence = tuple(map(str, entry.get('evidence', ())))
        last = float(entry.get('last', at))
        event.last = max(event.last, last if last > 1e9 else at)
        event.text = _words(event)
        state = str(entry['state'])
        if not event.ids:
            event.ended = None if state in ('open', 'acknowledged') else at
        verb = _ANSWERED.get(state, 'acknowledge' if state == 'acknowledged' else '')
        if verb and not any(each.verb == verb for each in event.handling.said):
            number_of = event.ids[-1] if event.ids else ''
            event.handling = event.handling.after(Handled(verb, number_of, 'a person', at))
        return event

    def _other(self, entry: Mapping[str, Any], at: float, run: str, robot: str) -> DeskEvent:
        name = str(entry['event'])
        what = str(entry.get('what', entry.get('node', '')))
        event: DeskEvent = self._event(f'{run}/{robot}/{name}-{at:.3f}', run, robot, name, what, at)
        event.text = f'{what}: {entry.get("reason", entry.get("why", ""))}'
        event.place = str(entry.get('place', ''))
        event.severity, event.ended = 1, at
        return event

    def _handle(self, done: Handled, run: str) -> None:
        if done.verb in ('mute', 'unmute'):
            self.mutes.take(done)
            return
        event = self._ids.get((run, done.id))
        if event is None:
            return
        said = event.handling.said
        # The observer has told the same of a person without a name.
        if said and said[-1].verb == done.verb and said[-1].by == 'a person':
            handling = Handling()
            for each in said[:-1]:
                handling = handling.after(each)
            event.handling = handling
        elif done.by == 'a person' and any(each.verb == done.verb for each in said):
            return
        event.handling = event.handling.after(done)
        event.words = f'{event.words} {done.note} {done.by}'.lower()


def _words(event: DeskEvent) -> str:
    """Say what was seen."""
    try:
        return Kind(event.kind).words(event.seen, event.subject)
    except ValueError:
        return f'{event.kind} {event.subject} {event.seen}'


def _point(value: Any) -> tuple[float, float] | None:
    return None if not value else (float(value[0]), float(value[1]))


class LogFollower:
    """Reads a log as it grows, also while it is packed away.

    Args:
        folder: Of a robot's run.
        take: Takes whole lines.
    """

    def __init__(self, folder: Path, take: Callable[[Sequence[bytes]], object]) -> None:
        self._folder, self._take = folder, take
        self._file: tuple[int, int] | None = None
        self._offset = 0
        self._packed = 0

    def look(self) -> bool:
        """Take what is new; return whether something was."""
        path = record_in(self._folder)
        try:
            status = os.stat(path)
        except OSError:
            return False
        own = status.st_dev, status.st_ino
        if own == self._file and status.st_size == self._offset:
            return False
        if own != self._file:
            self._read_packed()
            self._file, self._offset = own, 0
        with open(path, 'rb') as file:
            file.seek(self._offset)
            return self._read(file.read())

    def _read(self, data: bytes) -> bool:
        whole = data[: data.rfind(b'\n') + 1]
        self._offset += len(whole)
        if whole:
            self._take(whole.splitlines())
        return bool(whole)

    def _read_packed(self) -> None:
        """Take what was packed away since the last look, or at all."""
        packed = segments(record_in(self._folder))
        for path in packed[self._packed :]:
            try:
                with gzip.open(path, 'rb') as file:
                    # Of the file that was followed the rest.
                    file.read(self._offset)
                    self._read(file.read())
            except (OSError, EOFError):
                pass  # damaged: the rest counts
            self._offset = 0
        self._packed = len(packed)


def folders_of(run: Path) -> Iterator[tuple[str, Path]]:
    """Yield the robots of a run with their folders; what they share, or one alone, has no name."""
    if record_in(run).is_file():
        yield '', run
    try:
        below = sorted(each for each in run.iterdir() if each.is_dir())
    except OSError:
        return
    for each in below:
        if record_in(each).is_file():
            yield each.name, each


def read_run(index: EventIndex, run: Path, *, live: bool = False) -> None:
    """Take all that the logs of a run hold."""
    for robot, folder in folders_of(run):
        take = partial(_read_into, index, run.name, robot, live)
        LogFollower(folder, take).look()


def _read_into(index: EventIndex, run: str, robot: str, live: bool, lines: Sequence[bytes]) -> None:
    index.read(lines, run, robot, live=live)
