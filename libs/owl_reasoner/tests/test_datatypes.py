"""Lexical forms, values and facets of XML Schema's datatypes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from owl_reasoner.owl.expressions import DatatypeRestriction, Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.datatypes import (
    Value,
    literal_of,
    order,
    schema_pattern,
    value_of,
)
from owl_reasoner.reasoner.value_sets import value_set


def value(text: str, datatype: str) -> Value:
    return value_of(Literal(text, XSD + datatype))


def passes(text: str, datatype: str, facet: str, bound: str, of: str) -> bool:
    facets = ((XSD + facet, Literal(bound, XSD + of)),)
    values = value_set(DatatypeRestriction(XSD + datatype, facets))
    assert values is not None
    return values.contains(value(text, datatype))


@pytest.mark.parametrize(
    ('text', 'canonical'),
    [
        ('1926-11-26T24:00:00Z', '1926-11-27T00:00:00Z'),
        ('0000-01-01T00:00:00Z', '0000-01-01T00:00:00Z'),
        ('-0001-12-31T24:00:00+14:00', '0000-01-01T00:00:00+14:00'),
        ('-1926-02-28T16:24:10.200', '-1926-02-28T16:24:10.2'),
        ('12345-02-28T00:00:00.125-05:30', '12345-02-28T00:00:00.125-05:30'),
        ('-99999999-01-01T00:00:00Z', '-99999999-01-01T00:00:00Z'),
        ('2000-02-29T00:00:00-00:00', '2000-02-29T00:00:00Z'),
    ],
)
def test_moments_of_any_year_are_values_and_written_again(text: str, canonical: str) -> None:
    moment = value(text, 'dateTime')
    assert literal_of(moment) == Literal(canonical, XSD + 'dateTime')
    assert value_of(literal_of(moment)) == moment


@pytest.mark.parametrize(
    ('text', 'datatype'),
    [
        ('2001-02-29T00:00:00', 'dateTime'),
        ('2000-01-01T24:00:01', 'dateTime'),
        ('2000-01-01T00:00:00+14:01', 'dateTime'),
        ('2000-01-01T00:00:60', 'dateTime'),
        ('02000-01-01T00:00:00', 'dateTime'),
        ('2000-01-01T00:00:00', 'dateTimeStamp'),
        ('0aF', 'hexBinary'),
        ('0x', 'hexBinary'),
        ('0AG', 'base64Binary'),
        ('0AG=', 'base64Binary'),  # bits that are not zero behind the last octet
        ('!!!!', 'base64Binary'),
        ('7up', 'Name'),
        ('', 'Name'),
        ('\u00a01', 'integer'),
    ],
)
def test_what_is_outside_the_lexical_space_is_in_no_datatype(text: str, datatype: str) -> None:
    literal = value(text, datatype)
    for name in ('string', datatype):
        values = value_set(XSD + name)
        assert values is not None
        assert not values.contains(literal)


@pytest.mark.parametrize(
    ('datatype', 'least', 'most'),
    [
        ('byte', -128, 127),
        ('short', -32_768, 32_767),
        ('int', -2_147_483_648, 2_147_483_647),
        ('long', -9_223_372_036_854_775_808, 9_223_372_036_854_775_807),
        ('unsignedByte', 0, 255),
        ('unsignedShort', 0, 65_535),
        ('unsignedInt', 0, 4_294_967_295),
        ('unsignedLong', 0, 18_446_744_073_709_551_615),
        ('positiveInteger', 1, None),
        ('nonNegativeInteger', 0, None),
        ('negativeInteger', None, -1),
        ('nonPositiveInteger', None, 0),
    ],
)
def test_whole_numbers_have_the_bounds_of_xml_schema(
    datatype: str, least: int | None, most: int | None
) -> None:
    """XML Schema 1.1, part 2, section 3.4."""
    values = value_set(XSD + datatype)
    assert values is not None
    for bound, step in ((least, -1), (most, 1)):
        if bound is not None:
            assert values.contains(value(str(bound), 'integer'))
            assert not values.contains(value(str(bound + step), 'integer'))


def test_a_time_stamp_without_a_zone_is_no_moment_at_all() -> None:
    moments = value_set(XSD + 'dateTime')
    assert moments is not None
    assert moments.contains(value('2000-01-01T00:00:00Z', 'dateTimeStamp'))
    assert not moments.contains(value('2000-01-01T00:00:00', 'dateTimeStamp'))


def test_binary_values_are_octets() -> None:
    assert value('0aff', 'hexBinary') == value(' 0AFF\n', 'hexBinary')
    assert value('0 A E =', 'base64Binary') == value('0AE=', 'base64Binary')
    assert value('D001', 'hexBinary') != value('0AE=', 'base64Binary')
    assert literal_of(value('0aff', 'hexBinary')).lexical == '0AFF'
    assert literal_of(value('0 A E =', 'base64Binary')).lexical == '0AE='
    assert passes('0aff', 'hexBinary', 'length', '2', 'integer')
    assert passes('0AE=', 'base64Binary', 'maxLength', '2', 'integer')
    assert not passes('0AE=', 'base64Binary', 'minLength', '3', 'integer')


def test_xml_literals_are_equal_by_their_canonical_form() -> None:
    xml = 'http://www.w3.org/1999/02/22-rdf-syntax-ns#XMLLiteral'
    assert value_of(Literal('abc<a/>', xml)) == value_of(Literal('abc<a></a>', xml))
    assert value_of(Literal('<a b="1" c="2"/>', xml)) == value_of(
        Literal("<a c='2' b='1'></a>", xml)
    )
    assert value_of(Literal('a < b', xml)) != value_of(Literal('a  < b', xml))
    assert literal_of(value_of(Literal('abc<a/>', xml))) == Literal('abc<a></a>', xml)


def test_a_moment_without_a_zone_is_ordered_beyond_fourteen_hours() -> None:
    local, far = (value(f'2000-01-{day}T12:00:00', 'dateTime') for day in ('01', '03'))
    zoned = value('2000-01-02T12:00:00Z', 'dateTime')
    assert order(local, zoned) == -1
    assert order(far, zoned) == 1
    near = value('2000-01-02T22:00:00+05:00', 'dateTime')
    assert order(value('2000-01-02T12:00:00', 'dateTime'), near) is None
    assert order(zoned, near) == -1
    same = value('2000-01-02T13:00:00+01:00', 'dateTime')
    assert order(zoned, same) == 0
    assert zoned != same
    at = '2000-01-02T12:00:00Z'
    assert passes('2000-01-03T12:00:00', 'dateTime', 'minInclusive', at, 'dateTime')
    assert not passes('2000-01-02T12:00:00', 'dateTime', 'minInclusive', at, 'dateTime')


@pytest.mark.parametrize(
    ('pattern', 'inside', 'outside'),
    [
        ('[a-z-[aeiou]]+', 'bcd', 'abc'),
        ('^a$', '^a$', 'a'),
        ('a.b', 'a-b', 'a\rb'),
        (r'\i\c*', 'x-1', '1x'),
        (r'\p{Lu}+', 'ÄÖ', 'ab'),
        ('a|b', 'b', 'ab'),
        ('a', 'a', 'a\n'),
        (r'\w+', 'a$b', 'a_b'),
        (r'\S', '\u00a0', ' '),
        (r'[\s\d]\D', '\t\u00a0', '\u00a0\t'),
        (r'a\[\d\]', 'a[٣]', 'a[]'),
        ('(a*)*b', 'a' * 40 + 'b', 'a' * 40),
    ],
)
def test_patterns_are_those_of_xml_schema(pattern: str, inside: str, outside: str) -> None:
    assert passes(inside, 'string', 'pattern', pattern, 'string')
    assert not passes(outside, 'string', 'pattern', pattern, 'string')


@pytest.mark.parametrize('pattern', ['a*?', '(?=a)', r'\bfoo', '(', '[', r'(a)\1'])
def test_what_is_no_pattern_of_xml_schema_is_named(pattern: str) -> None:
    facets = ((XSD + 'pattern', Literal(pattern, XSD + 'string')),)
    assert value_set(DatatypeRestriction(XSD + 'string', facets)) is None
    with pytest.raises(ValueError, match='no regular expression of XML Schema'):
        schema_pattern(pattern)


@given(
    year=st.integers(-20_000, 20_000).filter(bool),
    day=st.integers(1, 28),
    seconds=st.integers(0, 86_399),
    zone=st.sampled_from(['', 'Z', '+05:30', '-14:00']),
)
def test_a_moment_is_read_as_it_was_written(year: int, day: int, seconds: int, zone: str) -> None:
    clock = f'{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}'
    text = f'{"-" * (year < 0)}{abs(year):04}-02-{day:02}T{clock}{zone}'
    moment = value(text, 'dateTime')
    assert literal_of(moment).lexical == text
    next_day = value(f'{"-" * (year < 0)}{abs(year):04}-02-{day:02}T24:00:00{zone}', 'dateTime')
    assert order(moment, next_day) == -1


@pytest.mark.parametrize(
    ('datatype', 'forms'),
    [
        ('date', ('2020-01-01Z', '2020-01-01+00:00', '2020-01-01-00:00')),
        ('date', ('-0044-03-15',)),
        ('time', ('00:00:00', '24:00:00', '00:00:00.0')),
        ('time', ('00:30:00.25+01:00', '00:30:00.250+01:00')),
        ('gYear', ('-0001Z', '-0001+00:00')),
        ('gYearMonth', ('2020-12-05:30',)),
        ('gMonthDay', ('--02-29',)),
        ('gMonth', ('--05Z', '--05+00:00')),
        ('gDay', ('---31',)),
        ('duration', ('P1Y', 'P12M', 'P0Y12M')),
        ('duration', ('-P1DT2H1M1.5S', '-PT26H1M1.50S', '-PT1561M1.5S')),
        ('duration', ('PT0S', '-P0D', 'P0M')),
        ('dayTimeDuration', ('P1D', 'PT24H')),
        ('yearMonthDuration', ('P1Y', 'P12M')),
    ],
)
def test_dates_and_durations_are_values(datatype: str, forms: tuple[str, ...]) -> None:
    """XML Schema 1.1, part 2, 3.3.6 to 3.3.14: forms of one value, the first as it is written."""
    values = {value(form, datatype) for form in forms}
    assert len(values) == 1
    written = literal_of(values.pop())
    assert written.lexical == forms[0]
    assert value_of(written) == value(forms[0], datatype)
    for name in (datatype, 'anyURI'):
        found = value_set(XSD + name)
        assert found is not None
        assert found.contains(value(forms[0], datatype)) == (name == datatype)


@pytest.mark.parametrize(
    ('text', 'datatype'),
    [
        ('2020-02-30', 'date'),
        ('2020-1-1', 'date'),
        ('1:00:00', 'time'),
        ('02020', 'gYear'),
        ('--13', 'gMonth'),
        ('---32', 'gDay'),
        ('--02-30', 'gMonthDay'),
        ('P', 'duration'),
        ('PT', 'duration'),
        ('P1YT', 'duration'),
        ('P-1Y', 'duration'),
        ('P1M', 'dayTimeDuration'),
        ('P1D', 'yearMonthDuration'),
    ],
)
def test_what_is_no_date_and_no_duration_is_in_no_datatype(text: str, datatype: str) -> None:
    found = value_set(XSD + datatype)
    assert found is not None
    assert not found.contains(value(text, datatype))


def test_a_duration_is_of_the_types_that_it_suits() -> None:
    for text, kinds in (
        ('P1M', {'yearMonthDuration'}),
        ('PT1M', {'dayTimeDuration'}),
        ('P1M1D', set()),
    ):
        for name in ('duration', 'dayTimeDuration', 'yearMonthDuration'):
            found = value_set(XSD + name)
            assert found is not None
            assert found.contains(value(text, 'duration')) == (name == 'duration' or name in kinds)


@pytest.mark.parametrize(
    ('first', 'second', 'sign'),
    [
        ('P1M', 'P30D', None),
        ('P1M', 'P27D', 1),
        ('P1M', 'P28D', None),
        ('P1M', 'P31D', None),
        ('P1M', 'P32D', -1),
        ('P2M', 'P59D', None),
        ('P2M', 'P58D', 1),
        ('P2M', 'P62D', None),
        ('P2M', 'P63D', -1),
        ('P1Y', 'P364D', 1),
        ('P1Y', 'P365D', None),
        ('P100Y', 'P36525D', None),
        ('P400Y', 'P146097D', 0),
        ('-P1D', 'PT0S', -1),
    ],
)
def test_durations_are_compared_as_far_as_no_month_matters(
    first: str, second: str, sign: int | None
) -> None:
    """XML Schema 1.1, part 2, 3.3.6.2."""
    assert order(value(first, 'duration'), value(second, 'duration')) == sign


def test_a_plain_text_without_a_language_is_a_text() -> None:
    """So do the OWL API and others write rdf:PlainLiteral, whose forms end in @."""
    kind = 'http://www.w3.org/1999/02/22-rdf-syntax-ns#PlainLiteral'
    assert value_of(Literal('pc', kind)) == value_of(Literal('pc@', kind)) == 'pc'
    assert value_of(Literal('a@b@en', kind)) == ('langString', 'a@b', 'en')
