"""What a mission's entries of the log add up to: its summary, and where it was cut off.

The behaviour writes them (`MissionRecord`), in the form that `surveillance_runtime.event_log`
describes. Some of their fields::

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
looked at a picture of it. ``idleness_bounds`` says what can be kept of each place:
``place``, ``verdict``, ``words``, and ``threshold`` and ``wait`` in seconds, null where they have
no end.

A file that has grown is packed away, and the next one begins with a ``snapshot`` of the `Account`.

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
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from patrol_policy.decision import RECHARGE
from patrol_policy.idleness_bounds import IdlenessBound
from strict_files.files import FileError
from surveillance_runtime.event_log import (
    A_DATE,
    CLOCKS,
    SEGMENT_BYTES,
    Clocks,
    EventLog,
    RecordEntry,
    UnreadLines,
    clock_step,
    of_mission,
    read,
    read_all,
)


class MissionRecord:
    """Writes what happens on a mission, and knows what it adds up to.

    Args:
        path: The log; made with its folder when missing, continued when it exists.
        segment_bytes: Size from which on its file is packed away and a new one begun.
        clocks: Those of the machine.

    Attributes:
        path: The log.
        problem: Why nothing is known of what the log holds already; empty: it is known.
        left_out: What of it is damaged, or of a later version.

    Raises:
        FileError: The log cannot be opened for writing.
    """

    def __init__(
        self,
        path: str | Path,
        segment_bytes: int = SEGMENT_BYTES,
        clocks: Clocks = CLOCKS,
    ) -> None:
        self._log = EventLog(path, clocks)
        self.path = self._log.path
        self._segment_bytes = segment_bytes
        self._account = Account()
        self.problem = ''
        self.left_out = UnreadLines()
        try:
            self._account = account_in(self.path, self.left_out)
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
    def looked(self) -> InspectionLog:
        """What was looked at in each place."""
        return self._account.looked

    def write(self, name: str, time: float, /, **fields: object) -> None:
        """Append one entry, after those that the disk did not take before.

        Args:
            name: One of `event_log.KINDS`.
            time: Seconds on the mission's clock.
            fields: The entry's own fields.

        Raises:
            FileError: Unknown kind, a required field is missing, or the file takes no more: then
                the entry waits for the next one.
        """
        entry = self._log.entry(name, time, **fields)
        self._account.take(entry)
        if self._log.append(entry) >= self._segment_bytes:
            account = self._account.to_json()
            self._log.begin_segment(self._log.entry('snapshot', time, account=account))

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        self._log.close()

    def __enter__(self) -> MissionRecord:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


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


class InspectionLog:
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


def _looked_at(event: RecordEntry) -> list[str]:
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
    """What is counted and known of a mission while its entries are taken one by one.

    Attributes:
        summary: Counts, without the waits that go on.
        last_seen: Since when each place waits, seconds.
        last: The last entry; None: there was none.
        left_at: Where the mission stands; None: it ended as told, or never began.
        visits: When the robot was in each place last, seconds on the present clock.
        looked: What was looked at in each place.
    """

    summary: Summary = field(default_factory=Summary)
    last_seen: dict[str, float] = field(default_factory=dict)
    last: RecordEntry | None = None
    left_at: CutOff | None = None
    visits: dict[str, float] = field(default_factory=dict)
    looked: InspectionLog = field(default_factory=InspectionLog)

    def take(self, event: RecordEntry) -> None:
        """Count one event.

        Raises:
            FileError: A snapshot does not hold what it should.
        """
        if event.name == 'snapshot':
            self._restore(event.fields['account'])
            self.last = event
            return
        summary, last = self.summary, event if self.last is None else self.last
        before, self.last = last.time, event
        step = clock_step(last, event)
        if is_other_simulation(before, event.time):
            _close_gaps(summary, self.last_seen, before)
            self.last_seen = dict.fromkeys(summary.visits, event.time)
            self.left_at = None
        else:
            summary.seconds += max(0.0, event.time - before - step)
            self.last_seen = on_present_clock(self.last_seen, before, event.time, step)
        self.visits = on_present_clock(self.visits, before, event.time, step)
        _count(summary, event, self.last_seen)
        if event.name == 'visit':
            self.visits[event.text('place')] = event.time
        if event.name in ('exploring', 'viewpoint'):
            self.looked.note(event.text('place'), *_looked_at(event))
        self.left_at = _after(self.left_at, event)
        if self.left_at is not None:
            self.left_at = replace(self.left_at, time=event.time)

    @property
    def now(self) -> float | None:
        """Time of the last entry; None: there was none."""
        return None if self.last is None else self.last.time

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
            self.looked = InspectionLog(kept.get('looked', {}))
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise FileError(f'a snapshot of the mission record is damaged: {error}') from None


def _times(kept: Mapping[str, float]) -> dict[str, float]:
    return {place: float(at) for place, at in kept.items()}


def is_other_simulation(before: float, now: float) -> bool:
    """Tell whether a clock went back because another simulation counts it, not as it was set."""
    return now < min(before, A_DATE)


def on_present_clock(
    times: Mapping[str, float], before: float, now: float, step: float | None = None
) -> dict[str, float]:
    """Return times by a clock that has gone from one time to another.

    A machine's clock that was set takes them with it. Of what was on the clock of another
    simulation, nothing is known.

    Args:
        times: By the clock as it was.
        before, now: Two times of it, seconds.
        step: By how much it was set in between, seconds, see `event_log.clock_step`;
            None: nobody knows, and one that has gone back was set by that much.
    """
    if is_other_simulation(before, now):
        return {name: at for name, at in times.items() if at <= now}
    by = min(0.0, now - before) if step is None else step
    return {name: at + by for name, at in times.items()}


def last_idleness_bounds(events: Iterable[RecordEntry]) -> tuple[IdlenessBound, ...]:
    """Return what was said last of what can be kept; may be empty."""
    found: tuple[IdlenessBound, ...] = ()
    for event in events:
        if event.name == 'idleness_bounds' and isinstance(places := event.fields['places'], list):
            found = tuple(filter(None, map(_idleness_bound, places)))
    return found


def _idleness_bound(kept: Any) -> IdlenessBound | None:
    """Return an idleness bound as the record keeps it, without bounds as null; None: it is none."""
    if not isinstance(kept, dict) or not kept.keys() >= {
        each.name for each in dataclasses.fields(IdlenessBound)
    }:
        return None
    numbers = (math.inf if kept[name] is None else kept[name] for name in ('threshold', 'wait'))
    try:
        threshold, wait = map(float, numbers)
    except (TypeError, ValueError):
        return None
    return IdlenessBound(
        str(kept['place']), str(kept['verdict']), threshold, wait, str(kept['words'])
    )


def account_in(path: str | Path, left_out: UnreadLines | None = None) -> Account:
    """Count the record in a log.

    Args:
        path: The log.
        left_out: Gets what of it is damaged, or of a later version.

    Raises:
        FileError: It cannot be read.
    """
    try:
        return account_of(read(path, left_out))
    except FileError as error:
        if left_out is not None:
            left_out.damaged.append(f'{path}: {error}')
        # What a snapshot counted is not what it should be: all is counted again.
        return account_of(read_all(path, left_out))


def account_of(events: Iterable[RecordEntry]) -> Account:
    """Count a record."""
    account = Account()
    for event in of_mission(events):
        account.take(event)
    return account


def summarize(events: Iterable[RecordEntry]) -> Summary:
    """Sum up a record.

    The time a place went unvisited runs from start to first visit, from visit to visit, and from
    the last visit to the end. When another simulation writes to the same file, the events from
    there on count as a mission of their own and their times add up. A machine's clock that is set
    changes neither what it took nor how long a place waited.
    """
    return _summary_of(account_of(events))


def summary_in(path: str | Path, left_out: UnreadLines | None = None) -> Summary:
    """Sum up the record in a log, see `account_in` and `summarize`.

    Raises:
        FileError: It cannot be read.
    """
    return _summary_of(account_in(path, left_out))


def _summary_of(account: Account) -> Summary:
    _close_gaps(account.summary, account.last_seen, account.now)
    return account.summary


def _count(summary: Summary, event: RecordEntry, last_seen: dict[str, float]) -> None:
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
        case 'sweep':
            summary.distance += event.number('distance')
        case 'recharge':
            summary.recharges += 1
            summary.charging_seconds += event.number('seconds')
        case 'decision':
            summary.rules[event.text('rule')] += 1
        case 'failure':
            summary.failures[event.text('what')] += 1


def _count_places(
    summary: Summary, places: set[str], event: RecordEntry, last_seen: dict[str, float]
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


def cut_off(events: Iterable[RecordEntry]) -> CutOff | None:
    """Return where the last mission of a record stood; None: it ended as told, or never began."""
    return account_of(events).left_at


def _after(known: CutOff | None, event: RecordEntry) -> CutOff | None:
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
