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
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo

from patrol_policy.suggestions import closest_name

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
        # Time is counted in UTC, so that a clock that is set in between is passed as it comes.
        zone, begin = moment.tzinfo, moment.timestamp()
        if self.at(moment) in kinds:
            return timedelta(0)
        for second in self._changes(moment, most):
            if self.at(datetime.fromtimestamp(second, zone)) in kinds:
                return timedelta(seconds=second - begin)
        return most

    def _changes(self, moment: datetime, most: timedelta) -> list[float]:
        """Return when something may change from a moment on, seconds since 1970.

        Beside the ends of the stretches each full hour counts: a clock is set at one.
        """
        begin = moment.timestamp()
        end = begin + most.total_seconds()
        edges = {minute % 60 for first, last, _ in self.stretches for minute in (first, last)} | {0}
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
                known = closest_name(name, (*DAYS, 'daily'))
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


LOOK_AHEAD = timedelta(days=1)
"""How far is looked for the time at which a place must be left."""


@dataclass(frozen=True)
class Openings:
    """What the hours come to at one moment.

    Attributes:
        closed: Why each place may not be entered, by place.
        optional: The places that may be entered and are not URGENT.
        closes_in: Seconds until each open place must be left; those that close within a day.
        quiet_for: Seconds for which the robot has to stay at its station; 0: it has not.
    """

    closed: Mapping[str, str]
    optional: frozenset[str]
    closes_in: Mapping[str, float]
    quiet_for: float = 0.0


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

    def in_words(self) -> dict[str, str]:
        """Return the hours of each place that has some, as they were written."""
        never = dict.fromkeys(self.keep_out, 'never: a keep-out place')
        return {place: hours.text for place, hours in self.hours.items()} | never

    def at(self, now: float) -> Openings:
        """Return what holds now.

        Args:
            now: Seconds since 1970.
        """
        moment = datetime.fromtimestamp(now, self.zone).astimezone(self.zone)
        closed = dict.fromkeys(self.keep_out, 'it is a keep-out place')
        optional, closes_in = set(), {}
        for place, hours in self.hours.items():
            kind = hours.at(moment)
            if kind == NOT:
                closed.setdefault(place, f'it is closed now ({hours.text})')
                continue
            if kind == MAY:
                optional.add(place)
            left = hours.until(moment, frozenset({NOT}), LOOK_AHEAD)
            if left < LOOK_AHEAD:
                closes_in[place] = left.total_seconds()
        quiet_for = 0.0
        if self.quiet is not None and self.quiet.at(moment) == MUST:
            left = self.quiet.until(moment, frozenset({MAY, NOT}), LOOK_AHEAD)
            quiet_for = left.total_seconds()
        return Openings(closed, frozenset(optional), closes_in, quiet_for)


NO_CALENDAR = Calendar({})
ALWAYS_OPEN = Openings({}, frozenset(), {})
