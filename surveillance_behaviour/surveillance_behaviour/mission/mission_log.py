"""What happened on a mission, one JSON object per line, and the summary printed at its end.

A record has to outlive whoever writes it: every line goes to the operating system in one
piece as soon as it is known, so a process that is killed loses nothing, and a machine that
loses power loses at most the line it was writing. A reader skips such a torn line, and the
next writer cuts it off before it goes on.

Each line holds ``event`` (one of :data:`EVENTS`), ``time`` (seconds on the mission's clock)
and the event's own fields::

    {"event": "start", "time": 0.0, "machine": "surveillance", "place": "E", "places": ["C1", "E"]}
    {"event": "exploring", "time": 1.0, "place": "E", "seconds": 1.0}
    {"event": "decision", "time": 2.0, "place": "C1", "rule": "URGENT", "reason": "..."}
    {"event": "visit", "time": 9.4, "place": "C1", "distance": 5.4, "path": [[5, 10], ...]}
"""

from __future__ import annotations

import errno
import json
import math
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType

from surveillance_behaviour.decision import RECHARGE

EVENTS: Mapping[str, tuple[str, ...]] = {
    'start': ('machine', 'place', 'places'),
    'map': ('places',),
    'exploring': ('place', 'seconds'),
    'visit': ('place', 'distance'),
    'decision': ('place', 'rule', 'reason'),
    'recharge': ('place', 'seconds'),
    'failure': ('what', 'reason'),
    'end': (),
}
"""The events of a record with the fields each must have, beside ``event`` and ``time``."""


class RecordError(ValueError):
    """A record cannot be read or written; the message names the file and the line."""


@dataclass(frozen=True)
class Event:
    """One line of a record.

    Attributes:
        name: One of :data:`EVENTS`.
        time: Seconds on the mission's clock.
        fields: The event's own fields.
    """

    name: str
    time: float
    fields: Mapping[str, object]

    def text(self, key: str) -> str:
        """The field ``key`` as text."""
        return str(self.fields[key])

    def number(self, key: str) -> float:
        """The field ``key`` as a number."""
        return float(str(self.fields[key]))

    def names(self, key: str) -> tuple[str, ...]:
        """The field ``key`` as a sequence of names."""
        value = self.fields[key]
        return tuple(str(name) for name in value) if isinstance(value, list) else ()


class MissionRecord:
    """Appends events to a record file, each in one write.

    Args:
        path: The file; made with its directory when missing, continued when it exists.

    Raises:
        RecordError: The file cannot be opened for writing.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
            self._cut_torn_line()
        except OSError as error:
            raise RecordError(f'cannot write the mission record {path}: {error.strerror}') from None

    def _cut_torn_line(self) -> None:
        """Drops an unfinished last line, so that the next one starts on a line of its own."""
        with open(self.path, 'rb') as reader:
            content = reader.read()
        complete = content.rfind(b'\n') + 1
        if complete != len(content):
            os.ftruncate(self._file, complete)

    def write(self, name: str, time: float, **fields: object) -> None:
        """Appends one event.

        Args:
            name: One of :data:`EVENTS`.
            time: Seconds on the mission's clock.
            fields: The event's own fields; those of :data:`EVENTS` are required.

        Raises:
            RecordError: Unknown event, a required field is missing, or the file takes no more.
        """
        _check(name, fields, f'{self.path}')
        line = json.dumps({'event': name, 'time': round(time, 3), **fields}) + '\n'
        data = line.encode()
        try:
            written = os.write(self._file, data)
            if written != len(data):
                # No line may begin behind half of one.
                os.ftruncate(self._file, os.fstat(self._file).st_size - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise RecordError(
                f'cannot write the mission record {self.path}: {error.strerror}'
            ) from None

    def start(self, time: float, machine: str, place: str, places: Sequence[str]) -> None:
        """A machine starts, or starts again, in ``place``; ``places`` are all to be patrolled."""
        self.write('start', time, machine=machine, place=place, places=sorted(places))

    def visit(self, time: float, place: str, distance: float = 0.0) -> None:
        """The robot arrived in ``place`` after ``distance`` metres."""
        self.write('visit', time, place=place, distance=round(distance, 3))

    def decision(self, time: float, place: str, rule: str, reason: str) -> None:
        """``place`` was chosen by ``rule``."""
        self.write('decision', time, place=place, rule=rule, reason=reason)

    def recharge(self, time: float, place: str, seconds: float) -> None:
        """The robot was charged in ``place`` for ``seconds``."""
        self.write('recharge', time, place=place, seconds=round(seconds, 3))

    def failure(self, time: float, what: str, reason: str) -> None:
        """``what`` (a state's label) failed because of ``reason``."""
        self.write('failure', time, what=what, reason=reason)

    def end(self, time: float) -> None:
        """The mission was told to end."""
        self.write('end', time)

    def close(self) -> None:
        """Closes the file; nothing is lost without it."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> MissionRecord:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _check(name: str, fields: Mapping[str, object], where: str) -> None:
    if name not in EVENTS:
        raise RecordError(f'{where}: unknown event {name!r}, expected one of {", ".join(EVENTS)}')
    missing = [key for key in EVENTS[name] if key not in fields]
    if missing:
        raise RecordError(f'{where}: event {name!r} lacks {", ".join(missing)}')


def read(path: str | Path) -> list[Event]:
    """Reads a record, without an unfinished last line.

    Raises:
        RecordError: The file cannot be read, or a finished line is not an event.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise RecordError(f'cannot read the mission record {path}: {error.strerror}') from None
    return [
        _event(line, f'{path}:{number}')
        for number, line in enumerate(content.split(b'\n')[:-1], start=1)
        if line.strip()
    ]


def _event(line: bytes, where: str) -> Event:
    try:
        values = json.loads(line)
        name, time = str(values.pop('event')), float(values.pop('time'))
    except (ValueError, KeyError, TypeError, AttributeError):
        shown = line.decode(errors='replace')[:60]
        raise RecordError(
            f'{where}: expected a JSON object with event and time, got {shown!r}'
        ) from None
    _check(name, values, where)
    return Event(name, time, values)


@dataclass
class Summary:
    """A mission in numbers; ``str()`` gives the text for a terminal.

    Attributes:
        seconds: From the first to the last event, on the mission's clock.
        visits: Times each place was reached, all places of the map included.
        unvisited: The longest time each place went unvisited, seconds.
        recharges: How often the robot was charged.
        charging_seconds: How long it charged in all.
        distance: Metres driven.
        rules: Decisions by rule.
        failures: Failures by the state in which they happened.
        restarts: Times the machine started again in the middle of the mission.
    """

    seconds: float = 0.0
    visits: Counter[str] = field(default_factory=Counter)
    unvisited: dict[str, float] = field(default_factory=dict)
    recharges: int = 0
    charging_seconds: float = 0.0
    distance: float = 0.0
    rules: Counter[str] = field(default_factory=Counter)
    failures: Counter[str] = field(default_factory=Counter)
    restarts: int = 0

    def __str__(self) -> str:
        if not self.visits:
            return 'Mission: nothing was recorded.'
        visited = [place for place, times in self.visits.items() if times]
        lines = [
            f'Mission: {_duration(self.seconds)}, {len(visited)} of {len(self.visits)} places '
            f'visited, {sum(self.visits.values())} visits, {self.distance:.1f} m'
        ]
        width = max(len('place'), *(len(place) for place in self.visits))
        lines.append(f'  {"place":<{width}}  visits  longest unvisited')
        for place in sorted(self.visits):
            longest = f'{self.unvisited.get(place, 0.0):.1f} s'
            lines.append(f'  {place:<{width}}  {self.visits[place]:>6}  {longest:>17}')
        lines.append(f'  recharges: {self.recharges} ({_duration(self.charging_seconds)})')
        lines.append(f'  decisions by rule: {_counts(self.rules)}')
        lines.append(f'  failures: {_counts(self.failures)}')
        if self.restarts:
            lines.append(f'  restarts of the behaviour: {self.restarts}')
        return '\n'.join(lines)


def summarize(events: Iterable[Event]) -> Summary:
    """Counts a record.

    The time a place went unvisited runs from start to first visit, from visit to visit, and from
    the last visit to the end. When the clock jumps back (another simulation writes to the
    same file), the events from there on count as a mission of their own and their times add up.
    """
    summary = Summary()
    last_seen: dict[str, float] = {}
    now: float | None = None
    for event in events:
        if now is None or event.time < now:
            _close_gaps(summary, last_seen, now)
            last_seen = dict.fromkeys(summary.visits, event.time)
        else:
            summary.seconds += event.time - now
        now = event.time
        _count(summary, event, last_seen)
    _close_gaps(summary, last_seen, now)
    return summary


def _count(summary: Summary, event: Event, last_seen: dict[str, float]) -> None:
    match event.name:
        case 'start':
            summary.restarts += bool(summary.visits)
            _count_places(summary, {*event.names('places'), event.text('place')}, event, last_seen)
        case 'map':
            _count_places(summary, set(event.names('places')), event, last_seen)
        case 'visit':
            place = event.text('place')
            gap = event.time - last_seen.get(place, event.time)
            summary.unvisited[place] = max(gap, summary.unvisited.get(place, 0.0))
            last_seen[place] = event.time
            summary.visits[place] += 1
            summary.distance += event.number('distance')
        case 'recharge':
            summary.recharges += 1
            summary.charging_seconds += event.number('seconds')
        case 'decision':
            summary.rules[event.text('rule')] += 1
        case 'failure':
            summary.failures[event.text('what')] += 1


def _count_places(
    summary: Summary, places: set[str], event: Event, last_seen: dict[str, float]
) -> None:
    """Count the places that there are from now on; nobody waits for those that went."""
    for place in [place for place in last_seen if place not in places]:
        gap = event.time - last_seen.pop(place)
        summary.unvisited[place] = max(gap, summary.unvisited.get(place, 0.0))
        if not summary.visits[place]:
            del summary.visits[place], summary.unvisited[place]
    for place in sorted(places):
        summary.visits.setdefault(place, 0)
        last_seen.setdefault(place, event.time)


def _close_gaps(summary: Summary, last_seen: Mapping[str, float], now: float | None) -> None:
    if now is not None:
        for place, seen in last_seen.items():
            summary.unvisited[place] = max(now - seen, summary.unvisited.get(place, 0.0))


def _counts(counter: Counter[str]) -> str:
    return ', '.join(f'{name} {times}' for name, times in counter.most_common()) or 'none'


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f'{hours} h {minutes:02} min {rest:02} s' if hours else f'{minutes} min {rest:02} s'


@dataclass(frozen=True)
class CutOff:
    """The last that is known of a mission that did not end as told.

    Attributes:
        time: When that was, seconds on the mission's clock.
        place: Where the robot was last.
        explored: Seconds for which it had explored that place; inf when it was done there.
        left: Another place had been chosen since, so that it may be anywhere by now.
        charging: Why it had been sent to charge and has not been charged since; empty: it was not.
    """

    time: float
    place: str
    explored: float = 0.0
    left: bool = False
    charging: str = ''

    def __str__(self) -> str:
        parts = [f'the robot was in {self.place}']
        if self.left:
            parts = [f'the robot was on its way from {self.place}']
        elif self.explored:
            done = 'whole' if math.isinf(self.explored) else f'for {self.explored:.1f} s'
            parts.append(f'had explored it {done}')
        if self.charging:
            parts.append('was to charge')
        return ', '.join(parts)


def cut_off(events: Iterable[Event]) -> CutOff | None:
    """Where the last mission of a record stood; None when it ended as told, or never began."""
    known: CutOff | None = None
    for event in events:
        if known is not None and event.time < known.time:
            known = None  # Another clock: another simulation.
        known = _after(known, event)
        if known is not None:
            known = replace(known, time=event.time)
    return known


def _after(known: CutOff | None, event: Event) -> CutOff | None:
    match event.name:
        case 'end':
            return None
        case 'start' | 'visit':
            place = event.text('place')
            if event.name == 'start' and known is not None and known.place == place:
                return known
            return CutOff(event.time, place, charging=known.charging if known else '')
    if known is None:
        return None
    match event.name:
        case 'exploring':
            return replace(known, explored=event.number('seconds'))
        case 'decision':
            reason = event.text('reason') if event.text('rule') == RECHARGE else ''
            return replace(known, explored=math.inf, left=True, charging=reason)
        case 'recharge':
            return replace(known, explored=math.inf, left=False, charging='')
    return known
