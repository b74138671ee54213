"""SWRL's built-ins that compute with dates, times and durations (SWRL, section 8.5).

What they compute is what XPath's operators of the same names do (XPath functions, sections 8 to
10); the four that XPath gave up are named where they stand. A moment with a zone and one without
have no difference: XPath would take the zone of the machine, which no rule may depend on. Each
function raises `ValueError`, or an `ArithmeticError`, for arguments outside of its domain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import partial
from typing import Any

from owl_reasoner.reasoner.datetimes import (
    DAY,
    LARGEST_OFFSET,
    Duration,
    Moment,
    calendar_value,
    days_of_month,
    decimal,
    digits_behind,
    is_duration,
    moment_of,
    on_calendar,
    whole,
)

_MONTHS, _SECONDS = 'yearMonthDuration', 'dayTimeDuration'
_FARTHEST = 12 * 10**6
"""Months that a moment is moved by at most; XML Schema asks for years of four digits."""
_Compute = Callable[..., Any]


# --- made of parts ---


def _duration(kind: str, *parts: Any) -> Duration:
    if not all(isinstance(part, int | Fraction) for part in parts):
        raise ValueError(parts)
    if kind == _MONTHS:
        years, months = map(_whole_number, parts)
        return 'duration', 12 * years + months, 0
    days, hours, minutes, seconds = parts
    return 'duration', 0, whole(Fraction(seconds) + 60 * (minutes + 60 * (hours + 24 * days)))


def _moment(kind: str, *parts: Any) -> Moment:
    """Return a dateTime, date or time of the numbers that it is written with, and a zone."""
    count = {'dateTime': 6, 'date': 3, 'time': 3}[kind]
    numbers, zone = parts[:count], _zone(*parts[count:])
    date = '' if kind == 'time' else _date_text(*map(_whole_number, numbers[:3]))
    time = '' if kind == 'date' else _time_text(*numbers[-3:])
    text = f'{date}T{time}{zone}' if kind == 'dateTime' else f'{date}{time}{zone}'
    return moment_of(text) if kind == 'dateTime' else calendar_value(kind, text)


def _date_text(year: int, month: int, day: int) -> str:
    return f'{"-" if year < 0 else ""}{abs(year):04}-{month:02}-{day:02}'


def _time_text(hour: Any, minute: Any, second: Any) -> str:
    if not isinstance(second, int | Fraction) or not 0 <= second < 60:
        raise ValueError(second)
    hours, minutes = _whole_number(hour), _whole_number(minute)
    return f'{hours:02}:{minutes:02}:{math.floor(second):02}{digits_behind(second)}'


def _zone(given: Any = '') -> str:
    """Return a zone as it is written, from that or from a dayTimeDuration."""
    if isinstance(given, str):
        return given
    offset = Fraction(_length(_SECONDS, given))
    if offset % 60 or abs(offset) > LARGEST_OFFSET:
        raise ValueError(given)
    minutes = abs(offset) // 60
    return f'{"-" if offset < 0 else "+"}{minutes // 60:02}:{minutes % 60:02}'


def _whole_number(value: Any) -> int:
    if not isinstance(value, int):
        raise ValueError(value)
    return value


# --- arithmetic ---


def _of_kind(kind: str, value: Any) -> Duration:
    if not (isinstance(value, tuple) and value[0] == 'duration' and is_duration(value, kind)):
        raise ValueError(value)
    return value


def _length(kind: str, value: Any) -> int | Fraction:
    """Return a duration in months, or in seconds."""
    _, months, seconds = _of_kind(kind, value)
    found: int | Fraction = months if kind == _MONTHS else seconds
    return found


def _lasting(kind: str, length: int | Fraction) -> Duration:
    if kind == _MONTHS:
        # To the nearest whole month, a half upwards, as XPath's `round` does.
        return 'duration', math.floor(length + Fraction(1, 2)), 0
    return 'duration', 0, decimal(Fraction(length))


def _sum(kind: str, *durations: Any) -> Duration:
    return _lasting(kind, sum(_length(kind, one) for one in durations))


def _difference(kind: str, first: Any, second: Any) -> Duration:
    return _lasting(kind, _length(kind, first) - _length(kind, second))


def _number(value: Any) -> Fraction:
    if isinstance(value, tuple) and value[0] in ('float', 'double') and value[1] != 'NaN':
        return Fraction(value[1])
    if not isinstance(value, int | Fraction):
        raise ValueError(value)
    return Fraction(value)


def _product(kind: str, duration: Any, factor: Any) -> Duration:
    return _lasting(kind, _length(kind, duration) * _number(factor))


def _quotient(kind: str, duration: Any, divisor: Any) -> Duration | int | Fraction:
    length = Fraction(_length(kind, duration))
    if isinstance(divisor, tuple) and divisor[0] == 'duration':
        return decimal(length / _length(kind, divisor))
    if isinstance(divisor, tuple) and divisor[1] in (math.inf, -math.inf):
        return _lasting(kind, 0)
    return _lasting(kind, length / _number(divisor))


def _shifted(moment: str, kind: str, sign: int, value: Any, duration: Any) -> Moment:
    """Return a moment that is later by a duration, or earlier (XML Schema 1.1 part 2, E.3.3)."""
    if not isinstance(value, tuple) or value[0] != moment:
        raise ValueError(value)
    length = sign * Fraction(_length(kind, duration))
    if abs(length) > _FARTHEST * (1 if kind == _MONTHS else 31 * DAY):
        raise ValueError(duration)
    # On the clock of its own zone.
    zone = value[3] if value[1] == 'utc' else 0
    local = value[2] + zone
    if kind == _MONTHS:
        year, month, day, time = on_calendar(local)
        years, place = divmod(12 * year + month - 1 + int(length), 12)
        first, count = days_of_month(years, place + 1)
        local = (first + min(day, count) - 1) * DAY + time
    elif moment == 'time':
        local = local // DAY * DAY + (local + length) % DAY
    else:
        local += length
        if moment == 'date':
            local = local // DAY * DAY
    return (moment, value[1], whole(Fraction(local - zone)), *value[3:])


def _between(moment: str, first: Any, second: Any) -> Duration:
    for one in (first, second):
        if not isinstance(one, tuple) or one[0] != moment:
            raise ValueError(one)
    if first[1] != second[1]:
        raise ValueError((first, second))
    return 'duration', 0, whole(Fraction(first[2] - second[2]))


def _months_between(first: Any, second: Any) -> Duration:
    """Return the whole months that lie between two moments; XPath gave the function up."""
    later = _between('dateTime', first, second)[2] >= 0
    sign, start, end = (1, second, first) if later else (-1, first, second)
    zone = start[3] if start[1] == 'utc' else 0
    (year, month, *_), (to_year, to_month, *_) = (
        on_calendar(one[2] + zone) for one in (start, end)
    )
    count = 12 * (to_year - year) + to_month - month
    if _shifted('dateTime', _MONTHS, 1, start, ('duration', count, 0))[2] > end[2]:
        count -= 1
    return 'duration', sign * count, 0


def _built_ins() -> dict[str, tuple[int, int, _Compute]]:
    found: dict[str, tuple[int, int, _Compute]] = {
        'yearMonthDuration': (3, 3, partial(_duration, _MONTHS)),
        'dayTimeDuration': (5, 5, partial(_duration, _SECONDS)),
        'dateTime': (7, 8, partial(_moment, 'dateTime')),
        'date': (4, 5, partial(_moment, 'date')),
        'time': (4, 5, partial(_moment, 'time')),
        'subtractDates': (3, 3, partial(_between, 'date')),
        'subtractTimes': (3, 3, partial(_between, 'time')),
        'subtractDateTimesYieldingYearMonthDuration': (3, 3, _months_between),
        'subtractDateTimesYieldingDayTimeDuration': (3, 3, partial(_between, 'dateTime')),
    }
    for kind, name in ((_MONTHS, 'YearMonthDuration'), (_SECONDS, 'DayTimeDuration')):
        found[f'add{name}s'] = (3, 99, partial(_sum, kind))
        found[f'subtract{name}s'] = (3, 3, partial(_difference, kind))
        # SWRL has an `s` behind one of the two of either kind, and not the same.
        found |= dict.fromkeys(
            (f'multiply{name}', f'multiply{name}s'), (3, 3, partial(_product, kind))
        )
        found |= dict.fromkeys(
            (f'divide{name}', f'divide{name}s'), (3, 3, partial(_quotient, kind))
        )
        for moment, word in (('dateTime', 'DateTime'), ('date', 'Date'), ('time', 'Time')):
            if (moment, kind) != ('time', _MONTHS):
                found[f'add{name}To{word}'] = (3, 3, partial(_shifted, moment, kind, 1))
                found[f'subtract{name}From{word}'] = (3, 3, partial(_shifted, moment, kind, -1))
    return found


CALENDAR_BUILTINS = _built_ins()
"""By name: the fewest and most arguments, and what the first argument is, given the others."""
