"""Weekly hours in which a place must, may or must not be visited.

Written as ``mon-fri 08:00-18:00``: within these hours the place is visited like any other, outside
it is not entered. Several stretches are separated by ``;``, several times of a day by commas. A
word before a stretch says what it means:

- ``must`` (the default): the place is patrolled, and is URGENT after its threshold;
- ``may``: it may be entered where that is convenient, and is never URGENT;
- ``not``: it is not entered.

What no stretch covers is ``not``; if all stretches are ``not`` or ``may``, it is ``must``. Of
stretches that overlap the later one counts. ``daily`` stands for all days; times are those of the
clock on the wall, and an end before its begin is on the next day.

**Summer time.** The hours follow the clock on the wall (`zoneinfo`). When it is set forward from
02:00 to 03:00, times between do not exist that day: a stretch within them is left out, one that
begins there begins at 03:00. When it is set back from 03:00 to 02:00, times between are passed
twice, and a stretch within them is in force both times.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, tzinfo

from strict_files.suggestions import nearest

MUST, MAY, NOT = 'must', 'may', 'not'
DAYS = ('mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun')
DAY = 24 * 60
"""Minutes."""
WEEK = 7 * DAY


@dataclass(frozen=True)
class WeeklyHours:
    """What holds at each time of the week.

    Attributes:
        text: As it was written.
        stretches: First and last minute of the week (from Monday 00:00, the last one excluded) and
            what holds then; later ones come before earlier ones.
        rest: What holds otherwise.
    """

    text: str
    stretches: tuple[tuple[int, int, str], ...]
    rest: str

    @classmethod
    def parse(cls, text: str) -> WeeklyHours:
        """Read hours.

        Raises:
            ValueError: They cannot be read; the message says what was expected.
        """
        stretches: list[tuple[int, int, str]] = []
        for part in filter(None, (each.strip() for each in text.lower().split(';'))):
            kind, days, times = _parts_of(part)
            for first, last in times:
                length = (last - first) % DAY or DAY
                for day in days:
                    begin = day * DAY + first
                    stretches.append((begin, min(begin + length, WEEK), kind))
                    if begin + length > WEEK:
                        stretches.append((0, begin + length - WEEK, kind))
        if not stretches:
            raise ValueError("no hours, expected such as 'mon-fri 08:00-18:00'")
        rest = NOT if any(kind == MUST for _, _, kind in stretches) else MUST
        return cls(text, tuple(stretches), rest)

    def at(self, moment: datetime) -> str:
        """Return what holds at a time of the clock on the wall: ``must``, ``may`` or ``not``."""
        return self._at_minute(moment.weekday() * DAY + moment.hour * 60 + moment.minute)

    def _at_minute(self, minute: int) -> str:
        for begin, end, kind in reversed(self.stretches):
            if begin <= minute < end:
                return kind
        return self.rest

    def until(self, moment: datetime, kinds: frozenset[str], most: timedelta) -> timedelta:
        """Return how long none of some kinds holds from a moment on, ``most`` at most.

        Args:
            moment: With its time zone.
            kinds: Of ``must``, ``may``, ``not``.
            most: How far is looked ahead.
        """
        begin = moment.timestamp()
        for start, _, kind in self.schedule(begin, begin + most.total_seconds(), moment.tzinfo):
            if kind in kinds:
                return timedelta(seconds=max(0.0, start - begin))
        return most

    def schedule(
        self, begin: float, end: float, zone: tzinfo | None
    ) -> tuple[tuple[float, float, str], ...]:
        """Return what holds from a moment to another one: begin, end and kind of each stretch.

        Args:
            begin: Seconds since 1970.
            end: The same.
            zone: Of the clock on the wall; None: that of the machine.
        """
        # Time is counted in UTC, so that a clock that is set in between is passed as it comes.
        found: list[tuple[float, float, str]] = []
        for start in (begin, *self._changes(begin, end)):
            moment = datetime.fromtimestamp(start, zone)
            kind = self.at(moment)
            if not found or found[-1][2] != kind:
                if found:
                    found[-1] = (found[-1][0], start, found[-1][2])
                found.append((start, end, kind))
        return tuple(found)

    def _changes(self, begin: float, end: float) -> list[float]:
        """Return when something may change between two moments, seconds since 1970.

        Beside the ends of the stretches each full hour counts: a clock is set at one. Time zones
        differ from UTC by quarters of an hour.
        """
        ends = {minute for first, last, _ in self.stretches for minute in (first, last)} | {0}
        edges = {(minute + shift) % 60 for minute in ends for shift in (0, 15, 30, 45)}
        hour = begin - begin % 3600.0
        found = []
        while hour <= end:
            found += [second for edge in edges if begin < (second := hour + 60.0 * edge) <= end]
            hour += 3600.0
        return sorted(found)


def _parts_of(part: str) -> tuple[str, list[int], list[tuple[int, int]]]:
    """Return kind, days and times of one stretch as it is written."""
    words = part.split()
    kind = MUST
    if words[0] in (MUST, MAY, NOT):
        kind = words.pop(0)
    if not words:
        raise ValueError(f"{part!r} has no days, expected such as 'mon-fri 08:00-18:00'")
    days = _days(words.pop(0))
    times = [_times(each) for each in ' '.join(words).replace(' ', '').split(',') if each]
    return kind, days, times or [(0, 0)]


def _days(text: str) -> list[int]:
    found: list[int] = []
    for part in text.split(','):
        if part == 'daily':
            return list(range(7))
        first, _, last = part.partition('-')
        for name in filter(None, (first, last)):
            if name not in DAYS:
                known = nearest(name, (*DAYS, 'daily'))
                raise ValueError(f'{name!r} is no day, expected {known}')
        begin, end = DAYS.index(first), DAYS.index(last or first)
        found += [(begin + step) % 7 for step in range((end - begin) % 7 + 1)]
    return found


def _times(text: str) -> tuple[int, int]:
    match = re.fullmatch(r'(\d\d?):(\d\d)-(\d\d?):(\d\d)', text)
    if match is None:
        raise ValueError(f"{text!r} are no times, expected such as '08:00-18:00'")
    hour, minute, end_hour, end_minute = map(int, match.groups())
    begin, end = 60 * hour + minute, 60 * end_hour + end_minute
    if begin >= DAY or end > DAY or minute > 59 or end_minute > 59:
        raise ValueError(f'{text!r} are no times, expected 00:00 to 24:00')
    return begin, end % DAY


KNOWN_AHEAD, KNOWN_BACK = 8 * 86_400.0, 86_400.0
"""So far ahead and back it is worked out when places are open, seconds."""
LOOK_AHEAD = 86_400.0
"""How far is looked for the time at which a place must be left, seconds."""


@dataclass(frozen=True)
class Openings:
    """What the hours come to at one moment.

    Attributes:
        closed: Why each place may not be entered, by place.
        optional: The places that may be entered and are not URGENT.
        closes_in: Seconds until each open place must be left; those that close within a day.
        quiet_for: Seconds for which the robot has to stay at its station; 0: it has not.
        opens_in: Seconds until each closed place opens; those that do within a week.
        windows: From when to when places with hours are open and the robot may go there, seconds
            since 1970, from a day ago up to a week ahead.
        has_quiet: Whether there are quiet hours at all.
        zone: The time zone of the clock on the wall; None: that of the machine.
    """

    closed: Mapping[str, str]
    optional: frozenset[str]
    closes_in: Mapping[str, float]
    quiet_for: float = 0.0
    opens_in: Mapping[str, float] = field(default_factory=dict)
    windows: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    has_quiet: bool = False
    zone: tzinfo | None = None


@dataclass(frozen=True)
class Calendar:
    """The hours of all places.

    Attributes:
        hours: By place.
        quiet: When the robot stays at its station; None: never.
        keep_out: Places that are never entered.
        zone: The time zone of the clock on the wall; None: that of the machine.
    """

    hours: Mapping[str, WeeklyHours]
    quiet: WeeklyHours | None = None
    keep_out: frozenset[str] = frozenset()
    zone: tzinfo | None = None
    _known: dict[WeeklyHours, _WorkedOut] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def in_words(self) -> dict[str, str]:
        """Return the hours of each place that has some, as they were written."""
        never = dict.fromkeys(self.keep_out, 'never: a keep-out place')
        return {place: hours.text for place, hours in self.hours.items()} | never

    def at(self, now: float) -> Openings:
        """Return what holds now.

        Args:
            now: Seconds since 1970.
        """
        closed = dict.fromkeys(self.keep_out, 'it is a keep-out place')
        optional, closes_in, opens_in = set(), {}, {}
        windows: dict[str, tuple[tuple[float, float], ...]] = {}
        for place, hours in self.hours.items():
            if place in self.keep_out:
                continue
            known = self._known_of(hours, now)
            windows[place] = known.windows
            kind = known.kind_at(now)
            if kind == NOT:
                begin = next((begin for begin, _ in known.open if begin > now), None)
                when = ''
                if begin is not None:
                    opens_in[place] = begin - now
                    when = f'until {datetime.fromtimestamp(begin, self.zone):%a %H:%M} '
                closed[place] = f'it is closed {when or "now "}({hours.text})'
                continue
            if kind == MAY:
                optional.add(place)
            left = next((end for begin, end in known.open if begin <= now < end)) - now
            if left < LOOK_AHEAD:
                closes_in[place] = left
        quiet_for = 0.0
        if self.quiet is not None:
            known = self._known_of(self.quiet, now)
            if known.kind_at(now) == MUST:
                ends = (end for begin, end, _ in known.stretches if begin <= now < end)
                quiet_for = min(next(ends) - now, LOOK_AHEAD)
        return Openings(
            closed,
            frozenset(optional),
            closes_in,
            quiet_for,
            opens_in,
            windows,
            self.quiet is not None,
            self.zone,
        )

    def _known_of(self, hours: WeeklyHours, now: float) -> _WorkedOut:
        """Return what is worked out of some hours; anew once a day, and when the clock is set."""
        known = self._known.get(hours)
        if known is None or not known.begin + KNOWN_BACK <= now < known.begin + 2.0 * KNOWN_BACK:
            # By whole hours, so that it is the same wherever in the day it is asked for.
            begin = now - now % 3600.0 - KNOWN_BACK
            end = begin + KNOWN_BACK + KNOWN_AHEAD
            stretches = hours.schedule(begin, end, self.zone)
            free = _joined((b, e) for b, e, kind in stretches if kind != NOT)
            quiet: list[tuple[float, float]] = []
            if self.quiet is not None and hours is not self.quiet:
                all_quiet = self.quiet.schedule(begin, end, self.zone)
                quiet = [(b, e) for b, e, kind in all_quiet if kind == MUST]
            windows = tuple(_without(free, quiet))
            known = self._known[hours] = _WorkedOut(begin, stretches, free, windows)
        return known


@dataclass(frozen=True)
class _WorkedOut:
    """What some hours come to in a stretch of time, seconds since 1970.

    Attributes:
        begin: From when on it is known.
        stretches: Begin, end and what holds.
        open: Begin and end of what is open.
        windows: The same without the quiet hours.
    """

    begin: float
    stretches: tuple[tuple[float, float, str], ...]
    open: tuple[tuple[float, float], ...]
    windows: tuple[tuple[float, float], ...]

    def kind_at(self, now: float) -> str:
        return next(kind for begin, end, kind in self.stretches if begin <= now < end)


def _joined(stretches: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return stretches in order, those that touch as one."""
    found: list[tuple[float, float]] = []
    for begin, end in stretches:
        if found and found[-1][1] >= begin:
            found[-1] = (found[-1][0], end)
        else:
            found.append((begin, end))
    return tuple(found)


def _without(
    stretches: Iterable[tuple[float, float]], gone: Sequence[tuple[float, float]]
) -> Iterator[tuple[float, float]]:
    """Yield what is left of stretches without others, which are in order."""
    for begin, end in stretches:
        for first, last in gone:
            if first < end and last > begin:
                if first > begin:
                    yield begin, first
                begin = max(begin, last)
        if begin < end:
            yield begin, end


NO_CALENDAR = Calendar({})
ALWAYS_OPEN = Openings({}, frozenset(), {})
