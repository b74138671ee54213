"""Moments of xsd:dateTime: lexical forms, values and order (XML Schema 1.1 part 2, 3.3.7), and the
order of dates, times, parts of the calendar, and durations.

A value is ``('dateTime', 'utc', seconds, offset)``, or ``('dateTime', 'local', seconds)`` where no
zone is given. Seconds count from 0001-01-01T00:00:00 of the proleptic Gregorian calendar; the
offset is the zone's, in seconds. Moments of one instant in different zones are different values.
"""

from __future__ import annotations

import datetime
import itertools
import math
import re
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

Moment: TypeAlias = 'tuple[Any, ...]'
Named: TypeAlias = 'tuple[str, str]'

_FORM = re.compile(
    r'(-?(?:[1-9]\d{3,}|0\d{3}))-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)(\.\d+)?(Z|[+-]\d\d:\d\d)?',
    re.ASCII,
)
_DAY = 86_400
_CYCLE_YEARS, _CYCLE_DAYS = 400, 146_097
"""The calendar repeats itself; Python's dates know the years 1 to 9999 only."""
LARGEST_OFFSET = 14 * 3600
_CALENDAR = {
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
_DURATIONS = frozenset(('duration', 'dayTimeDuration', 'yearMonthDuration'))
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
    cycles, year = divmod(int(found[1]) - 1, _CYCLE_YEARS)
    days = datetime.date(year + 1, int(found[2]), int(found[3])).toordinal() - 1
    days += cycles * _CYCLE_DAYS
    seconds = days * _DAY + hour * 3600 + minute * 60 + second + fraction
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


def text_of(moment: Moment) -> str:
    """Return the lexical form of a value."""
    seconds = moment[2] + (moment[3] if moment[1] == 'utc' else 0)
    days, rest = divmod(seconds, _DAY)
    cycles, day = divmod(int(days), _CYCLE_DAYS)
    date = datetime.date.fromordinal(day + 1)
    year = date.year + cycles * _CYCLE_YEARS
    whole = math.floor(rest)
    text = f'{"-" if year < 0 else ""}{abs(year):04}-{date.month:02}-{date.day:02}'
    text += f'T{whole // 3600:02}:{whole // 60 % 60:02}:{whole % 60:02}'
    if fraction := rest - whole:
        places = next(n for n in itertools.count(1) if 10**n % fraction.denominator == 0)
        text += f'.{int(fraction * 10**places):0{places}}'
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


@cache
def calendar_order(first: Named, second: Named) -> int | None:
    """Return the order of two dates, times, parts of the calendar or durations.

    Args:
        first, second: The local name of the datatype, and the lexical form.

    Returns:
        As `order`; None, too, of any other datatypes and where a form is not well-formed.
    """
    try:
        if first[0] == second[0] and first[0] in _CALENDAR:
            return order(_calendar_moment(*first), _calendar_moment(*second))
        if not _DURATIONS.issuperset((first[0], second[0])):
            return None
        from elementpath.datatypes import Duration  # 70 ms, and few ontologies have one.

        one, other = Duration.fromstring(first[1]), Duration.fromstring(second[1])
    except (ValueError, OverflowError):
        return None
    return 0 if one == other else -1 if one < other else 1 if one > other else None


def _calendar_moment(datatype: str, text: str) -> Moment:
    mark, before, behind = _CALENDAR[datatype]
    text = text.strip()
    if not text.startswith(mark):
        raise ValueError(f'{text!r} is no {datatype}')
    if datatype == 'time' and text.startswith('24:00:00'):
        text = '00' + text[2:]
    return moment_of(before + _ZONE.sub(lambda zone: behind + zone[0], text[len(mark) :], count=1))
