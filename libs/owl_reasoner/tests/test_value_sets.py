"""The algebra of data ranges, against tests of single values."""

from __future__ import annotations

import math
import random

import pytest

from owl_reasoner.owl.expressions import (
    DataComplementOf,
    DataIntersectionOf,
    DataOneOf,
    DataRange,
    DatatypeRestriction,
    DataUnionOf,
    Literal,
)
from owl_reasoner.owl.vocabulary import OWL, RDF, XSD
from owl_reasoner.reasoner.datatypes import Value, lexical_of, order, value_of
from owl_reasoner.reasoner.value_sets import NONE, ValueSet, value_set

LITERALS = [
    *(Literal(str(number), XSD + 'integer') for number in range(-2, 5)),
    Literal('1.5', XSD + 'decimal'),
    Literal('1/3', OWL + 'rational'),
    *(Literal(text) for text in ('a', 'b c', '1x')),
    Literal('true', XSD + 'boolean'),
    *(Literal(text, XSD + 'float') for text in ('1.0', 'NaN', '-0', '-INF')),
    *(Literal(text, RDF + 'langString', 'en') for text in ('', 'ab')),
    *(Literal(text) for text in ('', 'ab')),
    *(Literal(text, XSD + 'hexBinary') for text in ('', '00', '0001')),
    *(
        Literal(f'2020-01-0{day}T{hour}:00:00{zone}', XSD + 'dateTime')
        for day, hour in ((1, '00'), (1, '09'), (2, '00'))
        for zone in ('Z', '+01:00', '')
    ),
]
TYPES = (
    *('integer', 'decimal', 'byte', 'string', 'boolean', 'float', 'NCName', 'token'),
    *('dateTime', 'dateTimeStamp', 'hexBinary'),
)
WITH_LENGTH = (RDF + 'PlainLiteral', XSD + 'string', XSD + 'hexBinary', XSD + 'anyURI')
FACETS = ('minInclusive', 'maxExclusive', 'maxInclusive', 'minExclusive')


def drawn(rng: random.Random, depth: int) -> DataRange:
    choice = rng.randrange(7 if depth else 3)
    if choice == 0:
        return XSD + rng.choice(TYPES)
    if choice == 1:
        return DataOneOf(tuple(rng.sample(LITERALS, rng.randrange(1, 4))))
    if choice == 2:
        bound = Literal(str(rng.randrange(-2, 4)), XSD + 'integer')
        shape = rng.random()
        if shape < 0.2:
            kinds = (
                RDF + 'PlainLiteral',
                *(XSD + name for name in ('string', 'hexBinary', 'anyURI')),
            )
            return DatatypeRestriction(
                rng.choice(kinds),
                ((XSD + rng.choice(('length', 'minLength', 'maxLength')), bound),),
            )
        if shape < 0.4:
            moments = [literal for literal in LITERALS if literal.datatype == XSD + 'dateTime']
            facet = XSD + rng.choice(FACETS)
            return DatatypeRestriction(XSD + 'dateTime', ((facet, rng.choice(moments)),))
        kind = XSD + rng.choice(('integer', 'decimal'))
        return DatatypeRestriction(kind, ((XSD + rng.choice(FACETS), bound),))
    if choice == 3:
        return DataComplementOf(drawn(rng, depth - 1))
    joined = DataUnionOf if choice == 6 else DataIntersectionOf
    return joined((drawn(rng, depth - 1), drawn(rng, depth - 1)))


def of_length(datatype: str, facet: str, length: int) -> DataRange:
    bound = Literal(str(length), XSD + 'integer')
    return DatatypeRestriction(XSD + datatype, ((XSD + facet, bound),))


def above(bound: str, datatype: str) -> DataRange:
    facet = (XSD + 'minExclusive', Literal(bound, XSD + datatype))
    return DatatypeRestriction(XSD + datatype, (facet,))


def between(first: str, last: str) -> DataRange:
    bounds = (('minInclusive', first), ('maxInclusive', last))
    facets = tuple((XSD + facet, Literal(text, XSD + 'dateTime')) for facet, text in bounds)
    return DatatypeRestriction(XSD + 'dateTime', facets)


def values_of(data_range: DataRange) -> ValueSet:
    found = value_set(data_range)
    assert found is not None
    return found


def is_in(value: Value, data_range: DataRange) -> bool:
    """Tell, without the algebra, whether a value is in a range."""
    if isinstance(data_range, str):
        return values_of(data_range).contains(value)
    if isinstance(data_range, DataOneOf):
        return value in map(value_of, data_range.literals)
    if isinstance(data_range, DataComplementOf):
        return not is_in(value, data_range.operand)
    if isinstance(data_range, DatatypeRestriction):
        fits = all(passes(value, *facet) for facet in data_range.facets)
        return fits and is_in(value, data_range.datatype)
    parts = [is_in(value, operand) for operand in data_range.operands]
    return any(parts) if isinstance(data_range, DataUnionOf) else all(parts)


def passes(value: Value, facet: str, bound: Literal) -> bool:
    name, limit = facet.removeprefix(XSD), value_of(bound)
    is_binary = isinstance(value, tuple) and value[0] in ('hexBinary', 'base64Binary')
    octets_or_text = value[1] if is_binary else lexical_of(value)  # type: ignore[index]
    if name.lower().endswith('length'):
        length = len(octets_or_text)
        assert isinstance(limit, int)
        return {
            'length': length == limit,
            'minLength': length >= limit,
            'maxLength': length <= limit,
        }[name]
    compared = order(value, limit)
    orders = {
        'minInclusive': (0, 1),
        'maxInclusive': (0, -1),
        'minExclusive': (1,),
        'maxExclusive': (-1,),
    }
    return compared in orders[name]


@pytest.mark.parametrize(
    ('seed', 'count'), [(5, 200), pytest.param(6, 10_000, marks=pytest.mark.long)]
)
def test_sets_agree_with_single_values(seed: int, count: int) -> None:
    rng = random.Random(seed)
    values = [value_of(literal) for literal in LITERALS]
    for _ in range(count):
        one, other = drawn(rng, 3), drawn(rng, 3)
        first, second = values_of(one), values_of(other)
        mine = {value for value in values if is_in(value, one)}
        theirs = {value for value in values if is_in(value, other)}
        assert mine == {value for value in values if first.contains(value)}
        assert first.size >= len(mine)
        if first.size < 300:
            assert all(is_in(value, one) for value in first.members())
            assert len(set(first.members())) == first.size
        assert not (first.within(second) and mine - theirs)


@pytest.mark.parametrize('space', ['float', 'double'])
@pytest.mark.parametrize(
    ('bound', 'of'), [('2', 'integer'), ('1.1', 'decimal'), ('-0.3', 'decimal'), ('0.1', 'double')]
)
def test_a_bound_of_another_type_of_numbers_is_compared_by_value(
    space: str, bound: str, of: str
) -> None:
    limit = Literal(bound, XSD + of)
    near = Literal(bound, XSD + space)
    values = {
        facet: values_of(DatatypeRestriction(XSD + space, ((XSD + facet, limit),)))
        for facet in ('minInclusive', 'minExclusive', 'maxInclusive', 'maxExclusive')
    }
    for text in (bound, '-INF', '-2', '0', '1', '3', 'INF', 'NaN'):
        value = value_of(Literal(text, XSD + space))
        for facet, found in values.items():
            assert found.contains(value) == passes(value, facet, limit)
    is_exact = order(value_of(near), value_of(limit)) == 0
    at_bound = values['minInclusive'] & values['maxInclusive']
    assert list(at_bound.members()) == ([value_of(near)] if is_exact else [])
    assert (values['minExclusive'] & values['maxExclusive']).is_empty
    assert ~values['minExclusive'] & values_of(XSD + space) != NONE
    assert values['minInclusive'].within(values['minExclusive']) != is_exact


@pytest.mark.parametrize(('space', 'step'), [('float', 2.0**-23), ('double', 2.0**-52)])
@pytest.mark.parametrize('sign', [1, -1])
def test_floats_of_either_sign_are_counted_and_listed(space: str, step: float, sign: int) -> None:
    near = [sign * (1 + count * step) for count in range(4)]
    low, high = sorted((near[0], near[-1]))
    facets = tuple(
        (XSD + facet, Literal(repr(bound), XSD + space))
        for facet, bound in (('minInclusive', low), ('maxExclusive', high))
    )
    found = values_of(DatatypeRestriction(XSD + space, facets))
    assert found.size == 3
    assert [value[1] for value in found.members()] == sorted(near)[:3]  # type: ignore[index]


def test_facets_that_are_not_supported_are_named() -> None:
    facet = (RDF + 'langRange', Literal('en'))
    assert value_set(DatatypeRestriction(RDF + 'PlainLiteral', (facet,))) is None


def test_truth_values_with_a_facet_are_named() -> None:
    facet = (XSD + 'pattern', Literal('true'))
    assert value_set(DatatypeRestriction(XSD + 'boolean', (facet,))) is None


@pytest.mark.parametrize(
    ('data_range', 'size'),
    [
        (XSD + 'byte', 256),
        (XSD + 'boolean', 2),
        (DataComplementOf(DataComplementOf(XSD + 'boolean')), 2),
        (DataOneOf((Literal('1', XSD + 'int'), Literal('1.0', XSD + 'decimal'))), 1),
        (DataIntersectionOf((XSD + 'integer', XSD + 'string')), 0),
        (DataIntersectionOf((XSD + 'integer', DataComplementOf(XSD + 'decimal'))), 0),
        (DataIntersectionOf((XSD + 'NCName', DataComplementOf(XSD + 'token'))), 0),
        (of_length('string', 'maxLength', 0), 1),
        (of_length('string', 'length', 1), math.inf),
        (of_length('hexBinary', 'maxLength', 1), 257),
        (DataIntersectionOf((XSD + 'double', DataComplementOf(above('-INF', 'double')))), 2),
        (above('INF', 'double'), 0),
        (
            DataIntersectionOf(
                (of_length('string', 'minLength', 3), of_length('string', 'length', 2))
            ),
            0,
        ),
        (between('2020-01-01T00:00:00', '2020-01-01T00:00:00'), 1),
        (between('2020-01-01T00:00:00Z', '2020-01-01T00:00:00Z'), 28 * 60 + 1),
        (between('2020-01-01T00:00:00Z', '2020-01-01T00:00:01Z'), math.inf),
        (between('2020-01-01T00:00:00', '2020-01-01T00:00:00-14:00'), 0),
        (between('2020-01-01T00:00:00', '2020-01-01T00:00:00.001-14:00'), math.inf),
        (DataIntersectionOf((XSD + 'dateTimeStamp', DataComplementOf(XSD + 'dateTime'))), 0),
    ],
)
def test_sizes(data_range: DataRange, size: float) -> None:
    assert values_of(data_range).size == size


def test_the_only_value_of_a_set_in_several_pieces() -> None:
    """Between 0.2 and 0.4 lies no whole number, between 0.5 and 1.5 there is one."""
    spans = tuple(
        DatatypeRestriction(
            XSD + 'decimal',
            (
                (XSD + 'minExclusive', Literal(low, XSD + 'decimal')),
                (XSD + 'maxExclusive', Literal(high, XSD + 'decimal')),
            ),
        )
        for low, high in (('0.2', '0.4'), ('0.5', '1.5'))
    )
    found = value_set(DataIntersectionOf((XSD + 'integer', DataUnionOf(spans))))
    assert found is not None
    assert found.only == 1
