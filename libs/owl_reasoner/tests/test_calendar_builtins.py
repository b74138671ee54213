"""SWRL's built-ins over dates, times and durations, judged by XPath as elementpath has it.

elementpath 5 counts no year 0, writes durations in microseconds, and takes the part of a second of
a negative difference the wrong way: there it is said what is right.
"""

from __future__ import annotations

import itertools
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest

from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.datatypes import value_of

from .test_builtins_by_xpath import by_xpath, here, is_same

MOMENTS = {
    'dateTime': (
        '2026-11-29T08:00:00Z 2026-11-29T08:00:00 2024-02-29T23:59:59.5+05:30 2000-01-31T00:00:00Z '
        '1999-12-31T23:00:00-11:00 0001-01-01T00:00:00Z 2026-03-31T12:00:00'
    ),
    'date': '2026-11-29 2024-02-29Z 2000-01-31+14:00 1999-12-31-05:00 2023-10-31',
    'time': '00:00:00 23:59:59.25Z 12:30:00+05:30 01:00:00-11:00',
}
LENGTHS = {
    'yearMonthDuration': 'P0M P1M -P1M P11M P1Y -P2Y5M P100Y',
    'dayTimeDuration': 'PT0S PT1S -PT1S P1D -P1D PT36H P400DT5H6M7.125S',
}


def said(kind: str, texts: str) -> list[tuple[Any, str]]:
    """Return values of a datatype, each with what constructs it in XPath."""
    return [(value_of(Literal(text, XSD + kind)), f"xs:{kind}('{text}')") for text in texts.split()]


def spelled(wanted: Any, kind: str) -> Any:
    """Return what elementpath computed as a value."""
    if isinstance(wanted, int | float | Decimal):
        return Fraction(wanted)
    return value_of(Literal(str(wanted), XSD + kind))


def agree(name: str, form: str, kind: str, *arguments: tuple[Any, str]) -> None:
    """Compare a built-in with an XPath expression of the same arguments."""
    found = here(name, *(value for value, _ in arguments))
    wanted = [spelled(one, kind) for one in by_xpath(form.format(*(text for _, text in arguments)))]
    if wanted and isinstance(wanted[0], Fraction):
        assert is_same(found[0], Decimal(float(wanted[0]))), (name, arguments, found, wanted)
    elif wanted and wanted[0][0] == 'duration':
        # elementpath writes microseconds.
        ((_, months, seconds),) = found
        assert months == wanted[0][1], (name, arguments, found, wanted)
        assert abs(seconds - wanted[0][2]) < Fraction(1, 10**6), (name, arguments, found, wanted)
    else:
        assert found == wanted, (name, arguments, found, wanted)


@pytest.mark.parametrize('kind', LENGTHS)
def test_durations_are_those_of_xpath(kind: str) -> None:
    name = kind[0].upper() + kind[1:]
    durations = said(kind, LENGTHS[kind])
    numbers = said('decimal', '0 1 2 -1.5 0.5 0.3') + said('double', '2.5 -0.25 1e2 INF NaN')
    for one, other in itertools.product(durations, durations):
        agree(f'add{name}s', '{0} + {1}', kind, one, other)
        agree(f'subtract{name}s', '{0} - {1}', kind, one, other)
        if other[0][1:] != (0, 0):
            agree(f'divide{name}s', '{0} div {1}', kind, one, other)
    for one, number in itertools.product(durations, numbers):
        if 'INF' not in number[1]:
            agree(f'multiply{name}', '{0} * {1}', kind, one, number)
        if kind == 'yearMonthDuration' or '0.3' not in number[1]:  # A rounded quotient.
            agree(f'divide{name}', '{0} div {1}', kind, one, number)


@pytest.mark.parametrize('moment', MOMENTS)
def test_moments_and_durations_are_those_of_xpath(moment: str) -> None:
    word = moment[0].upper() + moment[1:]
    moments = said(moment, MOMENTS[moment])
    for kind, texts in LENGTHS.items():
        name = kind[0].upper() + kind[1:]
        if (moment, kind) == ('time', 'yearMonthDuration'):
            continue
        for one, length in itertools.product(moments, said(kind, texts)):
            early = '0001' in one[1] and not length[1].endswith(("'PT0S')", "'P0M')"))
            if not early:  # elementpath counts no year 0.
                agree(f'add{name}To{word}', '{0} + {1}', moment, one, length)
                agree(f'subtract{name}From{word}', '{0} - {1}', moment, one, length)
    difference = {
        'dateTime': 'subtractDateTimesYieldingDayTimeDuration',
        'date': 'subtractDates',
        'time': 'subtractTimes',
    }[moment]
    for one, other in itertools.product(moments, moments):
        if one[0][1] == other[0][1]:
            (back,) = here(difference, other[0], one[0])
            if back[2] > 0 and isinstance(back[2], Fraction):
                # elementpath takes the part of a second of a negative difference the wrong way.
                assert here(difference, one[0], other[0]) == [('duration', 0, -back[2])]
                continue
            agree(difference, '{0} - {1}', 'dayTimeDuration', one, other)
        else:
            assert here(difference, one[0], other[0]) == [], 'the zone of one is not known'


def test_moments_and_durations_are_made_of_their_parts() -> None:
    half = Fraction(3, 2)
    (zone,) = here('dayTimeDuration', 0, -5, -30, 0)
    for name, parts, kind, text in (
        ('dateTime', (2026, 2, 3, 4, 5, half, 'Z'), 'dateTime', '2026-02-03T04:05:01.5Z'),
        ('dateTime', (2026, 2, 3, 4, 5, 6, zone), 'dateTime', '2026-02-03T04:05:06-05:30'),
        ('dateTime', (-44, 3, 15, 12, 0, 0), 'dateTime', '-0044-03-15T12:00:00'),
        ('date', (2024, 2, 29, '+01:00'), 'date', '2024-02-29+01:00'),
        ('date', (2024, 2, 29), 'date', '2024-02-29'),
        ('time', (0, 0, 59, 'Z'), 'time', '00:00:59Z'),
        ('yearMonthDuration', (1, 14), 'duration', 'P2Y2M'),
        ('yearMonthDuration', (-1, 2), 'duration', '-P10M'),
        ('dayTimeDuration', (1, 2, 3, half), 'duration', 'P1DT2H3M1.5S'),
    ):
        assert here(name, *parts) == [value_of(Literal(text, XSD + kind))], (name, parts)
    for name, wrong in (
        ('date', (2023, 2, 29)),
        ('date', (2023, 13, 1)),
        ('time', (25, 0, 0, 'Z')),
        ('time', (1, 0, 60)),
        ('dateTime', (2026, 2, 3, 4, 5, 6, 'CET')),
        ('dateTime', (2026, 2, half, 4, 5, 6)),
        ('yearMonthDuration', (half, 1)),
        ('dayTimeDuration', ('1', 0, 0, 0)),
    ):
        assert here(name, *wrong) == [], (name, wrong)


@pytest.mark.parametrize(
    ('late', 'early', 'months'),
    [
        ('2026-03-31T00:00:00Z', '2026-02-28T00:00:00Z', 'P1M'),
        ('2026-03-30T00:00:00Z', '2026-01-31T00:00:00Z', 'P1M'),
        ('2026-02-28T00:00:00Z', '2026-01-31T00:00:00Z', 'P1M'),
        ('2026-02-27T23:59:59Z', '2026-01-31T00:00:00Z', 'P0M'),
        ('2027-02-01T00:00:00Z', '2026-01-31T23:00:00-01:00', 'P1Y'),
        ('2026-01-31T00:00:00Z', '2026-03-31T00:00:00Z', '-P2M'),
    ],
)
def test_whole_months_between_two_moments(late: str, early: str, months: str) -> None:
    values = [value_of(Literal(text, XSD + 'dateTime')) for text in (late, early)]
    wanted = value_of(Literal(months, XSD + 'duration'))
    assert here('subtractDateTimesYieldingYearMonthDuration', *values) == [wanted]
