"""Moments of xsd:dateTime, dates, times, parts of the calendar, and durations: lexical forms,
values and order (XML Schema 1.1 part 2, sections 3.3.6 to 3.3.14 and 3.4.26).

A moment is ``('dateTime', 'utc', seconds, offset)``, or ``('dateTime', 'local', seconds)`` where no
zone is given. Seconds count from 0001-01-01T00:00:00 of the proleptic Gregorian calendar; the
offset is the zone's, in seconds. Moments of one instant in different zones are different values. A
date, a time or a part of the calendar is the moment at which it begins, with its own name in front.
A duration is ``('duration', months, seconds)``.
"""

from __future__ import annotations

import datetime
import itertools
import math
import re
from fractions import Fraction
from typing import Any, TypeAlias

Moment: TypeAlias = 'tuple[Any, ...]'
Duration: TypeAlias = 'tuple[str, int, int | Fraction]'

_FORM = re.compile(
    r'(-?(?:[1-9]\d{3,}|0\d{3}))-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)(\.\d+)?(Z|[+-]\d\d:\d\d)?',
    re.ASCII,
)
DAY = 86_400
DIGITS = 30
"""Digits behind the point of a quotient; XPath asks for 18 in all at least."""
_CYCLE_YEARS, _CYCLE_DAYS = 400, 146_097
"""The calendar repeats itself; Python's dates know the years 1 to 9999 only."""
LARGEST_OFFSET = 14 * 3600
CALENDAR = {
    'date': ('', '', 'T00:00:00'),
    'time': ('', '1972-12-31T', ''),
    'gYear': ('', '', '-01-01T00:00:00'),
    'gYearMonth': ('', '', '-01T00:00:00'),
    'gMonthDay': ('--', '1972-', 'T00:00:00'),
    'gMonth': ('--', '1972-', '-01T00:00:00'),
    'gDay': ('---', '1972-12-', 'T00:00:00'),
}
"""For each datatype what its forms begin with, and what makes a dateTime of the rest: before it,
and behind it where the zone begins. Source: op:time-less-than and others of XPath, which take the
same dates for what is not said."""
DURATIONS = ('duration', 'dayTimeDuration', 'yearMonthDuration')
_DURATION = re.compile(
    r'(-?)P(?=[\dT])(?:(\d+)Y)?(?:(\d+)M)?(?:(\d+)D)?'
    r'(?:T(?=\d)(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:\.\d+)?)S)?)?',
    re.ASCII,
)
_REFERENCES = ((1696, 9), (1697, 2), (1903, 3), (1903, 7))
"""Years and months to which durations are added to compare them (XML Schema 1.1 part 2, 3.3.6.2):
months have 28 to 31 days."""
_MIDNIGHT = re.compile(r'24:00:00(?:\.0+)?(?![.\d])', re.ASCII)
_ZONE = re.compile(r'(?:Z|[+-]\d\d:\d\d)?$', re.ASCII)


def moment_of(text: str) -> Moment:
    """Return the value of a lexical form.

    Raises:
        ValueError: It is none.
    """
    found = _FORM.fullmatch(text)
    if not found:
        raise ValueError(f'{text!r} is no dateTime')
    hour, minute, second = (int(found[part]) for part in (4, 5, 6))
    fraction = Fraction('0' + found[7]) if found[7] else 0
    is_end_of_day = (hour, minute, second, fraction) == (24, 0, 0, 0)
    if (hour > 23 and not is_end_of_day) or minute > 59 or second > 59:
        raise ValueError(f'{text!r} has no such time')
    days = _days(int(found[1]), int(found[2]), int(found[3]))
    seconds = days * DAY + hour * 3600 + minute * 60 + second + fraction
    zone = found[8]
    if zone is None:
        return ('dateTime', 'local', seconds)
    offset = 0
    if zone != 'Z':
        offset = int(zone[1:3]) * 3600 + int(zone[4:6]) * 60
        if int(zone[4:6]) > 59 or offset > LARGEST_OFFSET:
            raise ValueError(f'{text!r} has no such zone')
        offset = offset if zone[0] == '+' else -offset
    return ('dateTime', 'utc', seconds - offset, offset)


def _days(year: int, month: int, day: int) -> int:
    """Return the days between 0001-01-01 and a date of any year."""
    cycles, place = divmod(year - 1, _CYCLE_YEARS)
    return datetime.date(place + 1, month, day).toordinal() - 1 + cycles * _CYCLE_DAYS


def text_of(moment: Moment) -> str:
    """Return the lexical form of a value."""
    seconds = moment[2] + (moment[3] if moment[1] == 'utc' else 0)
    year, month, day, rest = on_calendar(seconds)
    full = math.floor(rest)
    text = f'{"-" if year < 0 else ""}{abs(year):04}-{month:02}-{day:02}'
    text += f'T{full // 3600:02}:{full // 60 % 60:02}:{full % 60:02}'
    text += digits_behind(rest)
    if moment[1] == 'utc':
        minutes = abs(moment[3]) // 60
        sign = '-' if moment[3] < 0 else '+'
        text += f'{sign}{minutes // 60:02}:{minutes % 60:02}' if minutes else 'Z'
    return text


def order(first: Moment, second: Moment) -> int | None:
    """Return -1, 0 or 1 as `first` is before, at or after `second`; None: that is not known.

    A moment without a zone may be up to 14 hours earlier or later (XML Schema 1.1 part 2, D.2.1).
    """
    away = first[2] - second[2]
    if first[1] != second[1] and abs(away) <= LARGEST_OFFSET:
        return None
    return int(away > 0) - int(away < 0)


def calendar_value(datatype: str, text: str) -> Moment:
    """Return the value of a date, a time or a part of the calendar.

    Args:
        datatype: Its local name, one of `CALENDAR`.
        text: The lexical form.

    Raises:
        ValueError: It is none.
    """
    mark, before, behind = CALENDAR[datatype]
    if not text.startswith(mark):
        raise ValueError(f'{text!r} is no {datatype}')
    if datatype == 'time' and _MIDNIGHT.match(text):
        text = '00' + text[2:]
    moment = _ZONE.sub(lambda zone: behind + zone[0], text[len(mark) :], count=1)
    return (datatype, *moment_of(before + moment)[1:])


def calendar_text(value: Moment) -> str:
    """Return the lexical form of a date, a time or a part of the calendar."""
    mark, before, behind = CALENDAR[value[0]]
    text = text_of(value)
    place = _ZONE.search(text, len(text) - 6)
    zone = place[0] if place else ''
    return mark + text.removesuffix(zone).removeprefix(before).removesuffix(behind) + zone


def duration_of(datatype: str, text: str) -> Duration:
    """Return the value of a duration.

    Args:
        datatype: Its local name, one of `DURATIONS`.
        text: The lexical form.

    Raises:
        ValueError: It is none.
    """
    found = _DURATION.fullmatch(text)
    if not found:
        raise ValueError(f'{text!r} is no {datatype}')
    years, months, days, hours, minutes = (int(found[part] or 0) for part in range(2, 7))
    seconds = Fraction(found[7] or 0) + 60 * (minutes + 60 * (hours + 24 * days))
    sign = -1 if found[1] else 1
    value = ('duration', sign * (12 * years + months), sign * whole(seconds))
    has = 'T' in text or 'D' in text, found[2] or found[3]
    if (datatype == 'dayTimeDuration' and has[1]) or (datatype == 'yearMonthDuration' and has[0]):
        raise ValueError(f'{text!r} is no {datatype}')
    return value


def is_duration(value: Duration, datatype: str) -> bool:
    """Tell whether a duration is one of a datatype of durations."""
    _, months, seconds = value
    return not {'dayTimeDuration': months, 'yearMonthDuration': seconds}.get(datatype, 0)


def duration_text(value: Duration) -> str:
    """Return the lexical form of a duration as an xsd:duration."""
    _, months, seconds = value
    sign = '-' if months < 0 or seconds < 0 else ''
    years, months = divmod(abs(months), 12)
    length = abs(Fraction(seconds))
    hours, minutes = divmod(math.floor(length / 60), 60)
    rest = length - 60 * (minutes + 60 * hours)
    days, hours = divmod(hours, 24)
    date = ''.join(f'{n}{unit}' for n, unit in ((years, 'Y'), (months, 'M'), (days, 'D')) if n)
    time = ''.join(f'{n}{unit}' for n, unit in ((hours, 'H'), (minutes, 'M')) if n)
    if rest:
        time += f'{math.floor(rest)}{digits_behind(rest)}S'
    if not date and not time:
        return 'PT0S'
    return f'{sign}P{date}' + (f'T{time}' if time else '')


def duration_order(first: Duration, second: Duration) -> int | None:
    """Return -1, 0 or 1 as `first` is shorter than, as long as or longer than `second`; None where
    that depends on the month in which they begin.
    """
    signs = set()
    for reference in _REFERENCES:
        one, other = (_end(reference, duration) for duration in (first, second))
        signs.add(int(one > other) - int(one < other))
    return signs.pop() if len(signs) == 1 else None


def _end(reference: tuple[int, int], duration: Duration) -> int | Fraction:
    """Return when a duration that begins with a month ends, in seconds since 0001-01-01."""
    year, month = divmod(reference[0] * 12 + reference[1] - 1 + duration[1], 12)
    return _days(year, month + 1, 1) * DAY + duration[2]


def on_calendar(seconds: int | Fraction) -> tuple[int, int, int, int | Fraction]:
    """Return year, month, day and the seconds of the day, of seconds since 0001-01-01."""
    days, rest = divmod(seconds, DAY)
    cycles, day = divmod(int(days), _CYCLE_DAYS)
    date = datetime.date.fromordinal(day + 1)
    return date.year + cycles * _CYCLE_YEARS, date.month, date.day, rest


def days_of_month(year: int, month: int) -> tuple[int, int]:
    """Return the days between 0001-01-01 and the first of a month, and how many days it has."""
    first = _days(year, month, 1)
    return first, _days(year + month // 12, month % 12 + 1, 1) - first


def decimal(number: Fraction) -> int | Fraction:
    """Return a number as a decimal has it: with 30 digits behind the point where it needs more."""
    rest = number.denominator
    for factor in (2, 5):
        while rest % factor == 0:
            rest //= factor
    return whole(number if rest == 1 else round(number, DIGITS))


def whole(number: Fraction) -> int | Fraction:
    """Return a number as an integer where it is one."""
    return number.numerator if number.denominator == 1 else number


def digits_behind(number: int | Fraction) -> str:
    """Return the digits of a decimal behind its whole part, with the point; '' without any."""
    fraction = number - math.floor(number)
    if not fraction:
        return ''
    places = next(n for n in itertools.count(1) if 10**n % fraction.denominator == 0)
    return f'.{int(fraction * 10**places):0{places}}'
