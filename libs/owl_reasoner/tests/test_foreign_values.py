"""Values of XML Schema's types, beside those of elementpath, which was written by others."""

from __future__ import annotations

import itertools
import random
import re

import pytest
from elementpath import datatypes as foreign

from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.datatypes import digits_of, integer_of, literal_of, order, value_of

ZONES = ['', 'Z', '+14:00', '-14:00', '+14:01', '+00:00', '-00:30', '+05:60', '+5:00', 'z']
YEARS = ['1999', '2000', '0001', '9999', '1900', '-0004', '02000', '200', '+2000', '12345']
MONTHS = ['01', '02', '06', '12', '13', '00', '2']
DAYS = ['01', '28', '29', '30', '31', '32', '00']
CLOCKS = ['00:00:00', '23:59:59.999', '24:00:00', '24:00:00.1', '12:60:00', '12:00:60', '7:00:00']

KINDS = {
    'dateTime': (foreign.DateTime, ('Y', '-', 'M', '-', 'D', 'T', 'C', 'Z')),
    'date': (foreign.Date, ('Y', '-', 'M', '-', 'D', 'Z')),
    'time': (foreign.Time, ('C', 'Z')),
    'gYear': (foreign.GregorianYear, ('Y', 'Z')),
    'gYearMonth': (foreign.GregorianYearMonth, ('Y', '-', 'M', 'Z')),
    'gMonthDay': (foreign.GregorianMonthDay, ('--', 'M', '-', 'D', 'Z')),
    'gMonth': (foreign.GregorianMonth, ('--', 'M', 'Z')),
    'gDay': (foreign.GregorianDay, ('---', 'D', 'Z')),
}
PARTS = {'Y': YEARS, 'M': MONTHS, 'D': DAYS, 'C': CLOCKS, 'Z': ZONES}


def ours(text, datatype):
    found = value_of(Literal(text, XSD + datatype))
    return None if isinstance(found, tuple) and found[0] == 'ill-formed' else found


def theirs(text, kind):
    try:
        return kind.fromstring(text)
    except (ValueError, OverflowError):
        return None


def forms(parts, generator, count):
    return [
        ''.join(generator.choice(PARTS[part]) if part in PARTS else part for part in parts)
        for _ in range(count)
    ]


@pytest.mark.parametrize('datatype', KINDS)
def test_forms_of_the_calendar_are_those_of_elementpath(datatype):
    kind, parts = KINDS[datatype]
    for text in forms(parts, random.Random(datatype), 400):
        assert (ours(text, datatype) is None) == (theirs(text, kind) is None), text


@pytest.mark.parametrize('datatype', ['dateTime', 'date', 'time', 'gYear', 'gYearMonth'])
def test_moments_are_ordered_as_by_elementpath(datatype):
    kind, parts = KINDS[datatype]
    generator = random.Random(datatype)
    good = [each for each in forms(parts, generator, 1500) if ours(each, datatype) is not None]
    zoned = [each for each in good if re.search(r'T?(Z|[+-]\d\d:\d\d)$', each)]
    compared = 0
    for first, second in zip(zoned[::2], zoned[1::2], strict=False):
        one, other = theirs(first, kind), theirs(second, kind)
        if first.startswith('-') or second.startswith('-') or one is None or other is None:
            continue  # other libraries know few years
        expected = (one > other) - (one < other)
        assert order(ours(first, datatype), ours(second, datatype)) == expected, (first, second)
        compared += 1
    assert compared > 20


def test_durations_are_those_of_elementpath():
    generator = random.Random(1)

    def form():
        parts = [f'{generator.choice([0, 1, 11, 13, 100])}{unit}' for unit in 'YMDHMS']
        chosen = [generator.random() < 0.5 for _ in parts]
        date = ''.join(p for p, c in zip(parts[:3], chosen[:3], strict=True) if c)
        time = ''.join(p for p, c in zip(parts[3:], chosen[3:], strict=True) if c)
        if chosen[5] and generator.random() < 0.5:
            time = time[:-1] + generator.choice(['.5S', '.125S', '.S'])
        sign = generator.choice(['', '', '-', '+'])
        return f'{sign}P{date}' + (f'T{time}' if time or generator.random() < 0.1 else '')

    good = []
    for text in (form() for _ in range(600)):
        one = theirs(text, foreign.Duration)
        assert (ours(text, 'duration') is None) == (one is None), text
        if one is not None:
            good.append((text, one))
    for (text, one), (other_text, other) in itertools.pairwise(good):
        first, second = ours(text, 'duration'), ours(other_text, 'duration')
        assert first == ('duration', one.months, one.seconds)
        assert (order(first, second) == -1) == (one < other), (text, other_text)
        assert (order(first, second) == 1) == (one > other), (text, other_text)
        written = literal_of(first)
        assert value_of(written) == first
        assert str(theirs(written.lexical, foreign.Duration)) == str(one)


@pytest.mark.parametrize('digits', [1, 3999, 4000, 4001, 9000, 20_001])
def test_whole_numbers_of_any_length_are_read_and_written(digits):
    text = ''.join(random.Random(digits).choices('123456789', k=digits))
    number = 0
    for start in range(0, digits, 1000):
        part = text[start : start + 1000]
        number = number * 10 ** len(part) + int(part)
    for sign, factor in (('', 1), ('-', -1), ('+', 1)):
        assert integer_of(sign + text) == factor * number
        assert ours(f' {sign}{text}\n', 'integer') == factor * number
    assert digits_of(number) == text
    assert digits_of(-number) == f'-{text}'
    assert digits_of(10**digits) == '1' + '0' * digits


@pytest.mark.parametrize(
    ('text', 'decimal'),
    [
        ('0.50', '0.5'),
        ('-.125', '-0.125'),
        ('+7.', '7'),
        ('100.00', '100'),
        ('-0.001', '-0.001'),
        ('12.0' + '0' * 5000, '12'),
        ('-' + '9' * 4500 + '.5', '-' + '9' * 4500 + '.5'),
        ('0.' + '0' * 4500 + '2', '0.' + '0' * 4500 + '2'),
    ],
)
def test_decimals_are_written_as_short_as_they_can_be(text, decimal):
    found = literal_of(ours(text, 'decimal'))
    kind = 'decimal' if '.' in decimal else 'integer'
    assert found == Literal(decimal, XSD + kind)


@pytest.mark.parametrize('text', ['', '.', '+', '1e3', '1,5', '0x1', '--1', '1.2.3', '١'])
def test_what_is_no_decimal(text):
    assert ours(text, 'decimal') is None
