"""Entities, literals and facts in text form."""

from __future__ import annotations

import re
import struct
import tracemalloc
from decimal import Decimal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service.facts import ShortFact, parse_fact
from armor_service.rendering import (
    one_line,
    parse_entity,
    parse_literal,
    parse_rendered,
    render_datatype,
    render_entity,
    render_literal,
    shown,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import RDF, XSD

BASE = 'http://example.org/place'


@pytest.mark.parametrize(
    ('text', 'iri'),
    [
        ('R1', BASE + '#R1'),
        ('<http://other.org/x#R1>', 'http://other.org/x#R1'),
        ('http://other.org/x#R1', 'http://other.org/x#R1'),
        ('urn:x:y', 'urn:x:y'),
        ('owl:Thing', 'http://www.w3.org/2002/07/owl#Thing'),
        ('a:b', BASE + '#a:b'),
        ('Küche', BASE + '#Küche'),
    ],
)
def test_entities_are_read(text: str, iri: str) -> None:
    assert parse_entity(text, BASE) == iri


@pytest.mark.parametrize(
    'text', ['', 'a b', 'a\x00', 'a\n', '<>', 'a"b', '#x', '50%', '%4', '%zz', 'a' * 3000, '<a b>']
)
def test_names_that_no_iri_can_hold_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r'\S'):
        parse_entity(text, BASE)


@pytest.mark.parametrize(
    ('type_word', 'text', 'rendered'),
    [
        ('LONG', '1665579740', '"1665579740"^^xsd:long'),
        ('LONG', '"10"^^xsd:long', '"10"^^xsd:long'),
        ('LONG', f'"10"^^<{XSD}long>', '"10"^^xsd:long'),
        ('LONG', '+007', '"7"^^xsd:long'),
        ('INT', '3', '"3"^^xsd:integer'),
        ('INTEGER', '"3"^^xsd:long', '"3"^^xsd:long'),
        ('INT', '"3"', '"3"^^xsd:integer'),
        ('STRING', '"hello"', '"\\"hello\\""^^xsd:string'),
        ('STRING', '"x"@EN-us', '"x"@en-us'),
        ('BOOLEAN', '"true"^^xsd:boolean', '"true"^^xsd:boolean'),
        ('STRING', 'ab "q"', '"ab \\"q\\""^^xsd:string'),
        ('STRING', '"ab \\"q\\""^^xsd:string', '"ab \\"q\\""^^xsd:string'),
        ('STRING', '"x"@en', '"x"@en'),
        ('STRING', '"10"^^xsd:long', '"\\"10\\"^^xsd:long"^^xsd:string'),
        ('STRING', 'a\\b', '"a\\\\b"^^xsd:string'),
        ('BOOLEAN', 'True', '"true"^^xsd:boolean'),
        ('BOOL', 'no', '"false"^^xsd:boolean'),
        ('FLOAT', '5.5', '"5.5"^^xsd:float'),
        ('FLOAT', '0.1', '"0.1"^^xsd:float'),
        ('FLOAT', '1e10', '"1.0E10"^^xsd:float'),
        ('DOUBLE', '1e-5', '"1.0E-5"^^xsd:double'),
        ('DOUBLE', 'NaN', '"NaN"^^xsd:double'),
    ],
)
def test_values_are_read_bare_or_as_answers_have_them(
    type_word: str, text: str, rendered: str
) -> None:
    assert render_literal(parse_literal(type_word, text)) == rendered


@pytest.mark.parametrize(
    ('number', 'text'),
    [
        ('INF', 'INF'),
        ('+INF', 'INF'),
        ('Infinity', 'INF'),
        ('-INF', '-INF'),
        ('-Infinity', '-INF'),
        ('0', '0.0'),
        ('-0', '-0.0'),
        ('.5', '0.5'),
        ('5.', '5.0'),
        ('0.001', '0.001'),
        ('0.000999', '9.99E-4'),
        ('9999999', '9999999.0'),
        ('1e7', '1.0E7'),
        ('12345678.5', '1.23456785E7'),
        ('-2.5e-7', '-2.5E-7'),
    ],
)
def test_numbers_are_written_as_java_writes_them(number: str, text: str) -> None:
    assert parse_literal('DOUBLE', number).lexical == text


def test_a_number_that_no_float_holds_is_infinite() -> None:
    assert parse_literal('FLOAT', '1e39').lexical == 'INF'
    assert parse_literal('FLOAT', '-1e39').lexical == '-INF'
    assert parse_literal('FLOAT', '1e-60').lexical == '0.0'
    assert parse_literal('DOUBLE', '1e39').lexical == '1.0E39'


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_double_is_written_so_that_it_reads_back(number: float) -> None:
    text = parse_literal('DOUBLE', repr(number)).lexical
    assert float(text) == number
    mantissa, _, exponent = text.partition('E')
    assert re.fullmatch(r'-?[0-9]+\.[0-9]+', mantissa)
    if number == 0.0 or 1e-3 <= abs(number) < 1e7:
        assert not exponent
    else:
        assert re.fullmatch('-?[0-9]+', exponent)
        assert 1.0 <= abs(float(mantissa)) < 10.0


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float_is_written_with_the_fewest_digits_that_read_back(number: float) -> None:
    text = parse_literal('FLOAT', repr(number)).lexical
    assert struct.pack('f', float(text)) == struct.pack('f', number)
    digits = len(Decimal(text).normalize().as_tuple().digits)
    for fewer in range(1, digits):
        assert struct.pack('f', float(f'{number:.{fewer}g}')) != struct.pack('f', number)


@pytest.mark.parametrize(('word', 'bits'), [('INT', 31), ('INTEGER', 31), ('LONG', 63)])
def test_whole_numbers_keep_to_their_range(word: str, bits: int) -> None:
    for number in (-(2**bits), 2**bits - 1):
        assert parse_literal(word, str(number)).lexical == str(number)
    for number in (-(2**bits) - 1, 2**bits):
        with pytest.raises(ValueError, match=f'is out of range, {word} has {bits + 1} bits'):
            parse_literal(word, str(number))
    assert parse_literal('INT', '0' * 3999 + '7').lexical == '7'
    with pytest.raises(ValueError, match='is not a whole number'):
        parse_literal('INT', '0' * 4000 + '7')


def test_what_an_answer_showed_is_read_whatever_its_type() -> None:
    shown_value = '"x"^^<http://example.org/t>'
    for word in ('INT', 'FLOAT', 'BOOLEAN', 'STRING'):
        literal = parse_literal(word, shown_value, stored=True)
        assert literal == Literal('x', 'http://example.org/t')
    with pytest.raises(ValueError, match='is not a value of INT'):
        parse_literal('INT', shown_value)
    assert parse_literal('STRING', shown_value).datatype == XSD + 'string'
    for text in ('"5"^^xsd', '"5"^^foo:bar', 'x', '"5'):
        with pytest.raises(ValueError, match='is not a literal, expected "text"'):
            parse_rendered(text)
    assert parse_rendered('"5"') == Literal('5', XSD + 'string')
    assert parse_rendered('"5"^^http://example.org/t').datatype == 'http://example.org/t'


def test_datatypes_of_the_built_in_vocabularies_are_short() -> None:
    assert render_datatype(XSD + 'long') == 'xsd:long'
    assert render_datatype(RDF + 'PlainLiteral') == 'rdf:PlainLiteral'
    assert render_datatype('http://www.w3.org/2002/07/owl#real') == 'owl:real'
    assert render_datatype('http://example.org/t') == '<http://example.org/t>'


def test_texts_for_a_log_are_one_line_of_a_bounded_length() -> None:
    assert one_line('a\nb\x1b') == r'a\nb\x1b'
    assert one_line('x' * 20, 20) == 'x' * 20
    assert one_line('x' * 21, 20) == 'x' * 17 + '...'
    assert shown('x' * 80) == repr('x' * 80)
    assert shown('x' * 81) == repr('x' * 77) + '...'
    assert shown('abcdef', 5) == "'ab'..."


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'is empty, expected a name'),
        ('a' * 2049, 'has 2049 characters, expected at most 2048'),
        ('50%', "has a bare '%', in an IRI written %25"),
        ('a b', "has the character ' ', not allowed in an IRI"),
        ('<abc>', 'is not a full IRI'),
        ('urn:', 'is not a full IRI'),
        ('://x', 'is not a full IRI'),
        ('a#b', "has the character '#', expected a local name or <iri>"),
    ],
)
def test_what_is_wrong_with_a_name_is_said(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        parse_entity(text, BASE)
    assert parse_entity('a' * 2048, BASE) == f'{BASE}#{"a" * 2048}'
    assert parse_entity('owl:', BASE) == f'{BASE}#owl:'
    assert parse_entity('a%20b', BASE) == f'{BASE}#a%20b'


def test_doubles_are_narrowed_when_asked_for() -> None:
    wide = parse_literal('DOUBLE', '0.123456789012')
    narrow = parse_literal('DOUBLE', '0.123456789012', narrow_doubles=True)
    assert render_literal(wide) == '"0.123456789012"^^xsd:double'
    assert render_literal(narrow) == '"0.12345679"^^xsd:float'


@pytest.mark.parametrize(
    ('type_word', 'text', 'words'),
    [
        ('INT', 'x', "'x' is not a whole number, expected INT"),
        ('INT', '2147483648', 'out of range'),
        ('LONG', '9223372036854775808', 'out of range'),
        ('LONG', '1.5', 'not a whole number'),
        ('LONG', '', 'not a whole number'),
        ('FLOAT', '1,5', 'not a number'),
        ('INT', '"abc"^^xsd:integer', 'is not a value of INT'),
        ('INT', '"5"^^xsd:string', 'is not a value of INT'),
        ('INT', '"x"@en', 'is not a value of INT'),
        ('FLOAT', '"true"^^xsd:boolean', 'is not a value of FLOAT'),
        ('BOOLEAN', '"5"^^xsd:integer', 'is not a value of BOOLEAN'),
        ('INT', '"abc"', 'not a whole number'),
        ('DOUBLE', '0x10', 'not a number'),
        ('STRING', 'a\x01', 'which XML cannot hold'),
        ('STRING', '\ud800', 'which XML cannot hold'),
    ],
)
def test_wrong_values_are_named(type_word: str, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_literal(type_word, text)


@settings(max_examples=100)
@given(st.text(), st.sampled_from([XSD + 'string', XSD + 'long', 'http://example.org/t']))
def test_rendered_literals_read_back(text: str, datatype: str) -> None:
    literal = Literal(text, datatype)
    assert parse_rendered(render_literal(literal)) == literal


def test_entities_read_back() -> None:
    for iri in (BASE + '#R1', 'http://www.w3.org/2002/07/owl#Nothing'):
        assert parse_entity(render_entity(iri), BASE) == iri


def test_facts_and_patterns() -> None:
    fact = parse_fact('visitedAt( R3 , "5, (six) \\"x\\""^^xsd:string )')
    assert fact == ShortFact('visitedAt', ('R3', '"5, (six) \\"x\\""^^xsd:string'))
    assert parse_fact(str(fact)) == fact
    assert parse_fact('visitedAt(?, ?)').matches(fact)
    assert parse_fact('visitedAt(R3, ?)').matches(fact)
    assert not parse_fact('visitedAt(R4, ?)').matches(fact)
    assert not parse_fact('visitedAt(?)').matches(fact)
    assert parse_fact(f'<{BASE}#visitedAt>({BASE}#R3, ?)').matches(fact)
    for names in (('A,B', 'C(1)'), ('?x', 'y')):
        odd = ShortFact('near', names)
        assert parse_fact(str(odd)) == odd


@pytest.mark.parametrize('text', ['', 'URGENT', 'URGENT()', 'a(b', 'a(b,)', 'a(b,c,d)', 'a(b c)'])
def test_what_is_no_fact_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match='expected CLASS'):
        parse_fact(text)


def test_a_long_value_costs_no_more_than_its_length() -> None:
    size = 200_000
    for text in ('"' + 'x' * size + '"', '"' + '\\\\' * (size // 2) + '"'):
        tracemalloc.start()
        parse_literal('STRING', text)
        assert tracemalloc.get_traced_memory()[1] < 12 * size
        tracemalloc.stop()


def test_a_fact_of_a_million_arguments_is_refused_at_its_third() -> None:
    with pytest.raises(ValueError, match='expected CLASS'):
        parse_fact('P(' + 'a, ' * 1_000_000 + 'a)')


def test_what_only_looks_like_a_language_is_text() -> None:
    assert parse_literal('STRING', '"x"@1') == Literal('"x"@1')
    assert parse_literal('STRING', '"x"@en-1').language == 'en-1'
