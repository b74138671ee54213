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
    {"event": "visit", "time": 9.4, "place": "C1", "distance": 5.4, "path": [[5, 10], ...],
     "driven": [[5, 10], ...]}

A start, and a decision under another threshold than the last one, has ``urgency_threshold``,
seconds. The ``path`` was planned; ``driven`` is where the robot was, where the motion controller
tells it. An ``exploring`` may have ``bearing``: the camera had looked there then, whole degrees of
the map frame, as the ``sides`` of a ``look`` are, with ``point`` where that was not the place's own
one; or ``check``, by its name. To the ``unseen`` of a ``look`` the camera was turned, and nobody
looked at a picture of it. ``promises`` says what can be kept of each place:
``place``, ``verdict``, ``words``, and ``threshold`` and ``wait`` in seconds, null where they have
no end.

A record of a month stays small to read: a file that has grown to :data:`SEGMENT_BYTES` is packed as
``FILE.0001.gz``, ``FILE.0002.gz``, ..., and the new one begins with a ``snapshot`` of all that was
counted. `read` takes the last file only, which tells how the mission stands and sums up all of it;
`read_all` gives every event.

To go on with a mission (``launch.py --resume``), hand the same file to `robot_behavior` and
`reasoner` as the parameter ``record``: the one goes on where `MissionRecord.left_at` says, and the
visits, leg times and the battery's draw come from the record and from ``FILE.experience.json``
beside it.

The record is what happened, and where the mission stands follows from it. The engine's checkpoint
(`state_machines.checkpoint`) would say in which state the machine was, in a second file that could
contradict this one after a crash; and a state such as "on its way to R1" must not be gone on with
before the robot has looked where it is, what the rules allow now, and whether it was charged.
"""

from __future__ import annotations

import dataclasses
import glob
import gzip
import json
import math
import os
import shutil
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from patrol_policy.decision import RECHARGE
from patrol_policy.promises import Promise
from state_machines.files import parse_json
from surveillance_runtime.files import FileError, LineFile, read_file

EVENTS: Mapping[str, tuple[str, ...]] = {
    'start': ('machine', 'place', 'places'),
    'map': ('places',),
    'exploring': ('place', 'seconds'),
    'viewpoint': ('place', 'point'),
    'look': ('place', 'sides', 'left_out'),
    'verify': ('place', 'number', 'found'),
    'visit': ('place', 'distance'),
    'decision': ('place', 'rule', 'reason'),
    'recharge': ('place', 'seconds'),
    'promises': ('places',),
    'failure': ('what', 'reason'),
    'end': (),
    'snapshot': ('account',),
}
"""The events of a record with the fields each must have, beside ``event`` and ``time``."""
_NUMBERS = frozenset({'distance', 'seconds'})
"""Which of the fields are numbers, metres and seconds."""


A_DATE = 1e9
"""From here on, in seconds, a time is a date of a machine's clock; a simulation counts from 0."""
SEGMENT_BYTES = 4_000_000
"""Size from which on a record's file is packed away and a new one begun."""
MOST_WAITING = 4_000_000
"""Bytes of events that wait until the disk takes more; of more than these the newest."""
LARGEST = 1_000_000_000
"""Bytes of a record's file that are read at most."""


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
        """Return the field ``key`` as text."""
        return str(self.fields[key])

    def number(self, key: str) -> float:
        """Return the field ``key`` as a number."""
        return float(str(self.fields[key]))

    def names(self, key: str) -> tuple[str, ...]:
        """Return the field ``key`` as a sequence of names."""
        value = self.fields[key]
        return tuple(str(name) for name in value) if isinstance(value, list) else ()


class MissionRecord:
    """Appends events to a record file, each in one write.

    Args:
        path: The file; made with its directory when missing, continued when it exists.
        segment_bytes: Size from which on it is packed away and a new one begun.

    Attributes:
        path: The file.
        problem: Why nothing is known of what the file holds already; empty: it is known.

    Raises:
        FileError: The file cannot be opened for writing.
    """

    def __init__(self, path: str | Path, segment_bytes: int = SEGMENT_BYTES) -> None:
        self.path = Path(path)
        self._segment_bytes = segment_bytes
        self._account = Account()
        self._waiting, self._lost = b'', ''
        self._next = self.path.with_name(self.path.name + '.next')
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self._next.exists() and not self.path.exists():
                # A writer was killed between the two steps of a change of files.
                os.replace(self._next, self.path)
            self._file = LineFile(self.path)
            content = self.path.read_bytes()
        except OSError as error:
            raise FileError(f'cannot write the mission record {path}: {error.strerror}') from None
        self.problem = ''
        try:
            self._account = account_of(_events(content, f'{self.path}'))
        except FileError as error:
            self.problem = str(error)

    @property
    def left_at(self) -> CutOff | None:
        """Where the mission stands; None: it ended as told, or never began."""
        return self._account.left_at

    @property
    def is_begun(self) -> bool:
        """Whether it holds a mission already, which is gone on with."""
        return self._account.now is not None

    @property
    def looked(self) -> Looked:
        """What was looked at in each place."""
        return self._account.looked

    def write(self, name: str, time: float, **fields: object) -> None:
        """Append one event, after those that the disk did not take before.

        Args:
            name: One of :data:`EVENTS`.
            time: Seconds on the mission's clock.
            fields: The event's own fields; those of :data:`EVENTS` are required.

        Raises:
            FileError: Unknown event, a required field is missing, or the file takes no more: then
                the event waits for the next one.
        """
        _check(name, fields, f'{self.path}')
        line = json.dumps({'event': name, 'time': round(time, 3), **fields}) + '\n'
        self._account.take(Event(name, round(time, 3), json.loads(line)))
        self._waiting += line.encode()
        try:
            size = self._file.append(self._waiting)
        except OSError as error:
            if len(self._waiting) > MOST_WAITING:
                self._waiting = self._waiting[-MOST_WAITING:].partition(b'\n')[2]
                self._lost = '; the oldest events that waited for it are lost'
            raise FileError(
                f'cannot write the mission record {self.path}: {error.strerror}{self._lost}'
            ) from None
        self._waiting, self._lost = b'', ''
        if size >= self._segment_bytes:
            self._begin_segment(time)

    def _begin_segment(self, time: float) -> None:
        """Pack the file away and begin a new one; if that cannot be done now, it is done later."""
        snapshot = {'event': 'snapshot', 'time': round(time, 3), 'account': self._account.to_json()}
        number = 1 + len(_segments(self.path))
        packed = self.path.with_name(f'{self.path.name}.{number:04}.gz')
        try:
            with open(self.path, 'rb') as old, gzip.open(packed, 'wb', 6) as new:
                shutil.copyfileobj(old, new)
            self._next.write_text(json.dumps(snapshot) + '\n', encoding='utf-8')
            file = LineFile(self._next)
            os.replace(self._next, self.path)
        except OSError:
            packed.unlink(missing_ok=True)
            return
        self._file.close()
        self._file = file

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        self._file.close()

    def __enter__(self) -> MissionRecord:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _check(name: str, fields: Mapping[str, object], where: str) -> None:
    if name not in EVENTS:
        raise FileError(f'{where}: unknown event {name!r}, expected one of {", ".join(EVENTS)}')
    missing = [key for key in EVENTS[name] if key not in fields]
    if missing:
        raise FileError(f'{where}: event {name!r} lacks {", ".join(missing)}')
    for key in _NUMBERS.intersection(EVENTS[name]):
        try:
            found = math.isfinite(float(str(fields[key])))
        except ValueError:
            found = False
        if not found:
            shown = str(fields[key])[:40]
            raise FileError(f'{where}: event {name!r}: {key} is {shown!r}, expected a number')


def read(path: str | Path) -> list[Event]:
    """Read a record, without an unfinished last line.

    Raises:
        FileError: The file cannot be read, or a finished line is not an event.
    """
    try:
        content = read_file(Path(path), LARGEST)
    except FileError as error:
        raise FileError(f'cannot read the mission record {error}') from None
    return list(_events(content, f'{path}'))


def read_all(path: str | Path) -> Iterator[Event]:
    """Give every event of a record, those that were packed away too, one file at a time.

    Raises:
        FileError: A file cannot be read, or a finished line is not an event.
    """
    for packed in _segments(Path(path)):
        try:
            content = gzip.decompress(packed.read_bytes())
        except (OSError, EOFError, zlib.error) as error:
            raise FileError(f'cannot read the mission record {packed}: {error}') from None
        yield from (e for e in _events(content, f'{packed}') if e.name != 'snapshot')
    yield from (event for event in read(path) if event.name != 'snapshot')


def _segments(path: Path) -> list[Path]:
    return sorted(path.parent.glob(glob.escape(path.name) + '.[0-9][0-9][0-9][0-9]*.gz'))


def _events(content: bytes, where: str) -> Iterator[Event]:
    for number, line in enumerate(content.split(b'\n')[:-1], start=1):
        if line.strip():
            yield _event(line, f'{where}:{number}')


def _event(line: bytes, where: str) -> Event:
    try:
        values = parse_json(line)
        name, time = str(values.pop('event')), float(values.pop('time'))
        if not math.isfinite(time):
            raise ValueError
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
        shown = line.decode(errors='replace')[:60]
        raise FileError(
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
        threshold: The urgency threshold of the last decision, seconds; None: it is not known.
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
    threshold: float | None = None

    def __str__(self) -> str:
        if not self.visits:
            return 'Mission: nothing was recorded.'
        visited = [place for place, times in self.visits.items() if times]
        visits = self.visits.total()
        lines = [
            f'Mission: {_duration(self.seconds)}, {len(visited)} of {len(self.visits)} places '
            f'visited, {visits} visit{"" if visits == 1 else "s"}, {self.distance:.1f} m'
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


MOST_LOOKED = 200
"""So much is kept of each place."""


class Looked:
    """What was looked at in each place, so that what waits longest comes first.

    That is a side (`side_name`), a point from which the place was looked at (`stand_name`), or a
    check by its name.

    Args:
        kept: What `to_json` gave; nothing: nowhere.
    """

    def __init__(self, kept: Mapping[str, Iterable[str | int]] | None = None) -> None:
        self._seen = {str(place): list(map(str, some)) for place, some in (kept or {}).items()}

    def note(self, place: str, *names: str) -> None:
        """Take that something was looked at, now."""
        others = [each for each in self._seen.get(place, ()) if each not in names]
        self._seen[place] = [*others, *names][-MOST_LOOKED:]

    def rank(self, place: str, name: str) -> int:
        """Return how long ago that was, among all of a place: 0: never, else greater where it is
        less long ago.
        """
        seen = self._seen.get(place, [])
        return seen.index(name) + 1 if name in seen else 0

    def latest(self, place: str) -> str:
        """Return what was looked at last in a place; empty: nothing."""
        return self._seen.get(place, [''])[-1]

    def to_json(self) -> dict[str, list[str]]:
        """Return it as plain values: the names of each place, the latest last."""
        return {place: list(names) for place, names in self._seen.items()}


def stand_name(point: Sequence[float] | None) -> str:
    """Return how a point is called from which a place is looked at; None: the place's own."""
    return 'own point' if point is None else f'{point[0]:g} {point[1]:g}'


def side_name(bearing: int, point: Sequence[float] | None) -> str:
    """Return how a side is called.

    Args:
        bearing: Whole degrees of the map frame.
        point: From where it was looked at; None: from the place's own point.
    """
    return f'{bearing}' if point is None else f'{bearing} from {stand_name(point)}'


def _looked_at(event: Event) -> list[str]:
    """Return what an event tells to have been looked at."""
    fields, at = event.fields, None
    if isinstance(check := fields.get('check'), str):
        return [check]
    point = fields.get('point')
    if isinstance(point, list) and [type(each) for each in point] == [float, float]:
        at = point[0], point[1]
    if event.name == 'viewpoint':
        return [] if at is None else [stand_name(at)]
    bearing = fields.get('bearing')
    return [stand_name(at), side_name(bearing, at)] if isinstance(bearing, int) else []


@dataclass
class Account:
    """What is counted and known of a mission while its events are taken one by one.

    Attributes:
        summary: Counts, without the waits that go on.
        last_seen: Since when each place waits, seconds.
        now: Time of the last event; None: there was none.
        left_at: Where the mission stands; None: it ended as told, or never began.
        visits: When the robot was in each place last, seconds on the present clock.
        looked: What was looked at in each place.
    """

    summary: Summary = field(default_factory=Summary)
    last_seen: dict[str, float] = field(default_factory=dict)
    now: float | None = None
    left_at: CutOff | None = None
    visits: dict[str, float] = field(default_factory=dict)
    looked: Looked = field(default_factory=Looked)

    def take(self, event: Event) -> None:
        """Count one event.

        Raises:
            FileError: A snapshot does not hold what it should.
        """
        if event.name == 'snapshot':
            self._restore(event.fields['account'])
            self.now = event.time
            return
        summary, before = self.summary, event.time if self.now is None else self.now
        if is_other_simulation(before, event.time):
            _close_gaps(summary, self.last_seen, self.now)
            self.last_seen = dict.fromkeys(summary.visits, event.time)
            self.left_at = None
        else:
            summary.seconds += max(0.0, event.time - before)
            self.last_seen = on_present_clock(self.last_seen, before, event.time)
        self.visits = on_present_clock(self.visits, before, event.time)
        self.now = event.time
        _count(summary, event, self.last_seen)
        if event.name == 'visit':
            self.visits[event.text('place')] = event.time
        if event.name in ('exploring', 'viewpoint'):
            self.looked.note(event.text('place'), *_looked_at(event))
        self.left_at = _after(self.left_at, event)
        if self.left_at is not None:
            self.left_at = replace(self.left_at, time=event.time)

    def to_json(self) -> dict[str, object]:
        """Return everything, for a snapshot."""
        left_at = None if self.left_at is None else dict(vars(self.left_at))
        if left_at is not None and math.isinf(left_at['explored']):
            left_at['explored'] = -1.0
        return {
            'summary': vars(self.summary),
            'last_seen': self.last_seen,
            'left_at': left_at,
            'visits': self.visits,
            'looked': self.looked.to_json(),
        }

    def _restore(self, kept: Any) -> None:
        try:
            summary = Summary(**kept['summary'])
            for counter in ('visits', 'rules', 'failures'):
                counts = getattr(summary, counter).items()
                setattr(summary, counter, Counter({key: int(count) for key, count in counts}))
            for number in ('seconds', 'charging_seconds', 'distance'):
                setattr(summary, number, float(getattr(summary, number)))
            summary.recharges, summary.restarts = int(summary.recharges), int(summary.restarts)
            if summary.threshold is not None:
                summary.threshold = float(summary.threshold)
            summary.unvisited = _times(summary.unvisited)
            left_at = None if kept['left_at'] is None else CutOff(**kept['left_at'])
            if left_at is not None and left_at.explored < 0.0:
                left_at = replace(left_at, explored=math.inf)
            self.summary, self.left_at = summary, left_at
            self.last_seen, self.visits = _times(kept['last_seen']), _times(kept['visits'])
            self.looked = Looked(kept.get('looked', {}))
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise FileError(f'a snapshot of the mission record is damaged: {error}') from None


def _times(kept: Mapping[str, float]) -> dict[str, float]:
    return {place: float(at) for place, at in kept.items()}


def is_other_simulation(before: float, now: float) -> bool:
    """Tell whether a clock went back because another simulation counts it, not as it was set."""
    return now < min(before, A_DATE)


def on_present_clock(times: Mapping[str, float], before: float, now: float) -> dict[str, float]:
    """Return times by a clock that has gone from one time to another.

    A machine's clock that was set back takes them with it. Of what was on the clock of another
    simulation, nothing is known.
    """
    if is_other_simulation(before, now):
        return {name: at for name, at in times.items() if at <= now}
    return {name: at - max(0.0, before - now) for name, at in times.items()}


def last_promises(events: Iterable[Event]) -> tuple[Promise, ...]:
    """Return what was said last of what can be kept; may be empty."""
    found: tuple[Promise, ...] = ()
    for event in events:
        if event.name == 'promises' and isinstance(places := event.fields['places'], list):
            found = tuple(filter(None, map(_promise, places)))
    return found


def _promise(kept: Any) -> Promise | None:
    """Return a promise as the record keeps it, without bounds as null; None: it is none."""
    if not isinstance(kept, dict) or not kept.keys() >= {
        each.name for each in dataclasses.fields(Promise)
    }:
        return None
    numbers = (math.inf if kept[name] is None else kept[name] for name in ('threshold', 'wait'))
    try:
        threshold, wait = map(float, numbers)
    except (TypeError, ValueError):
        return None
    return Promise(str(kept['place']), str(kept['verdict']), threshold, wait, str(kept['words']))


def account_of(events: Iterable[Event]) -> Account:
    """Count a record."""
    account = Account()
    for event in events:
        account.take(event)
    return account


def summarize(events: Iterable[Event]) -> Summary:
    """Sum up a record.

    The time a place went unvisited runs from start to first visit, from visit to visit, and from
    the last visit to the end. When another simulation writes to the same file, the events from
    there on count as a mission of their own and their times add up. A machine's clock that is set
    back adds nothing, and no wait ends.
    """
    account = account_of(events)
    _close_gaps(account.summary, account.last_seen, account.now)
    return account.summary


def _count(summary: Summary, event: Event, last_seen: dict[str, float]) -> None:
    if isinstance(threshold := event.fields.get('urgency_threshold'), int | float):
        summary.threshold = float(threshold)
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
    """Return where the last mission of a record stood; None: it ended as told, or never began."""
    return account_of(events).left_at


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
