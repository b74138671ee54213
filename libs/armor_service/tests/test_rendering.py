"""Entities, literals and facts in text form."""

from __future__ import annotations

import tracemalloc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armor_service.facts import ShortFact, parse_fact
from armor_service.rendering import (
    parse_entity,
    parse_literal,
    parse_rendered,
    render_entity,
    render_literal,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD

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
