"""Reading and writing documents: exact datatypes, located errors, bounded expansion, nothing
half-written.
"""

from __future__ import annotations

import os
import re
import tracemalloc
from pathlib import Path

import pytest

from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.documents.writing import (
    FORMATS,
    ontology_bytes,
    write_ontology,
)
from owl_reasoner.documents.xml_reading import XML, OntologyFileError
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    AnnotationAssertion,
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    Import,
    ObjectPropertyAssertion,
    Rule,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal, ObjectSomeValuesFrom, ObjectUnionOf
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, THING, XSD

from .patrol_map import (
    IRI,
    SCHEMA,
    VISITS,
    link,
    n,
    names,
    seven_rooms,
    value,
)
from .random_ontologies import RandomOntology
from .wide_ontologies import WideOntology

DATA = Path(__file__).parent / 'data'
HEAD = (
    f'<rdf:RDF xmlns="{IRI}#" xml:base="{IRI}" xmlns:owl="{OWL}" xmlns:rdf="{RDF}"'
    ' xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#">\n'
)


def document(body: str) -> bytes:
    return f'{HEAD}{body}\n</rdf:RDF>'.encode()


def test_a_map_written_by_another_tool() -> None:
    read = read_ontology(DATA / 'two_rooms.owl', IRI)
    assert (read.format, read.iri, read.unsupported) == ('rdfxml', IRI, [])
    rules = [axiom for axiom in read.axioms if isinstance(axiom, Rule)]
    assert [rule.label for rule in rules] == ['Urgency']
    kb = KnowledgeBase(IRI, read.axioms)
    assert kb.reason()
    assert kb.unsupported == ()
    assert kb.types(n('C1')) == {n('CORRIDOR'), n('LOCATION')}
    assert names(kb.instances(n('URGENT'))) == {'R1'}
    # Both spellings of the members of owl:AllDifferent are read.
    sets = {
        names(a.individuals) == {'D1', 'D2'}
        for a in read.axioms
        if isinstance(a, DifferentIndividuals)
    }
    assert sets == {True, False}


def test_datatypes_are_kept_exactly() -> None:
    body = f"""<owl:NamedIndividual rdf:about="#x">
      <a rdf:datatype="{XSD}int">007</a><b xml:lang="EN">hi</b><c>plain</c><d rdf:datatype="http://u/t">?</d>
    </owl:NamedIndividual>"""
    found = {
        a for a in read_ontology(document(body), IRI).axioms if isinstance(a, DataPropertyAssertion)
    }
    assert found == {
        DataPropertyAssertion(n('a'), n('x'), Literal('007', XSD + 'int')),
        DataPropertyAssertion(n('b'), n('x'), Literal('hi', RDF + 'langString', 'en')),
        DataPropertyAssertion(n('c'), n('x'), Literal('plain')),
        DataPropertyAssertion(n('d'), n('x'), Literal('?', 'http://u/t')),
    }


@pytest.mark.parametrize(
    ('text', 'line', 'words'),
    [
        (b'', 1, 'empty'),
        (b'<rdf:RDF', 1, 'not well-formed'),
        (b'<?xml version="1.0" encoding="UTF-99"?><a/>', 1, 'unknown encoding: UTF-99'),
        (b'<?xml version="1.0" encoding="rot13"?><a/>', 1, 'encoding cannot be read'),
        (document('<owl:Class xml:base="http://[x" rdf:about="b"/>'), 2, 'Invalid IPv6 URL'),
        (
            b'hello world',
            1,
            'expected RDF/XML, OWL/XML, Turtle, N-Triples, N-Quads, JSON-LD, OWL func',
        ),
        (b'<a:b> <a:c> <a:d> .\n<a:b> <a:c> .', 2, 'N-Triples'),
        (document('<owl:Class rdf:about="#A">\n<owl:Class>'), 4, 'mismatched tag'),
        (document('<owl:Class rdf:about="#A">\nstray</owl:Class>'), 3, "text 'stray'"),
        (document('<owl:Class rdf:ID="A"/>\n<owl:Class rdf:ID="A"/>'), 3, 'stands twice'),
    ],
)
def test_errors_name_line_and_column(text: bytes, line: int, words: str) -> None:
    with pytest.raises(OntologyFileError) as caught:
        read_ontology(text, IRI)
    error = caught.value
    assert error.line == line
    assert error.column >= 1
    assert words in error.message
    assert '\n' not in str(error)


@pytest.mark.parametrize(
    ('text', 'line', 'words'),
    [
        (
            document(
                '<owl:Class rdf:about="#A"><rdfs:subClassOf>\n<owl:Restriction>'
                '<owl:onProperty rdf:resource="#p"/>\n<owl:minCardinality>two</owl:minCardinality>'
                '</owl:Restriction></rdfs:subClassOf></owl:Class>'
            ),
            3,
            "whole number as minCardinality, got 'two'",
        ),
        (
            document('\n<owl:Thing rdf:about="#a"><owl:sameAs>b</owl:sameAs></owl:Thing>'),
            3,
            "sameAs of a has the literal 'b', expected a resource",
        ),
        (
            document(
                '<owl:ObjectProperty rdf:about="#p"><owl:inverseOf>q</owl:inverseOf>\n'
                '</owl:ObjectProperty>'
            ),
            2,
            "inverseOf of p has the literal 'q', expected a resource",
        ),
        (
            document('<owl:Class rdf:about="#A"><owl:unionOf rdf:nodeID="x"/></owl:Class>'),
            2,
            'rdf:first',
        ),
        (
            document(
                '<owl:Class rdf:about="#A"><owl:equivalentClass><owl:Class><owl:oneOf>\n<rdf:List>'
                f'<rdf:first>v</rdf:first><rdf:rest rdf:resource="{RDF}nil"/></rdf:List>'
                '</owl:oneOf></owl:Class></owl:equivalentClass></owl:Class>'
            ),
            3,
            "expected resources in a list, got the literal 'v'",
        ),
        (
            document(
                '<owl:ObjectProperty rdf:about="#p"/>\n'
                '<owl:Thing rdf:about="#a"><p>b</p></owl:Thing>'
            ),
            3,
            "object property p of a has the literal 'b'",
        ),
        (
            document(
                '<owl:DatatypeProperty rdf:about="#p"/>\n'
                '<owl:Thing rdf:about="#a"><p rdf:resource="#b"/></owl:Thing>'
            ),
            3,
            'data property p of a has the resource',
        ),
        (
            document(
                '<rdf:Description rdf:about="#p"><rdfs:range>\n<rdfs:Datatype rdf:nodeID="r">'
                '<owl:datatypeComplementOf rdf:nodeID="r"/></rdfs:Datatype></rdfs:range>'
                '</rdf:Description>'
            ),
            3,
            'p is left out: an expression contains itself',
        ),
    ],
)
def test_an_ill_formed_statement_is_left_out_alone(text: bytes, line: int, words: str) -> None:
    text = text.replace(b'</rdf:RDF>', b'<owl:Thing rdf:about="#kept"/></rdf:RDF>')
    found = read_ontology(text, IRI)
    assert ClassAssertion(OWL + 'Thing', f'{IRI}#kept') in found.axioms
    (report,) = found.unsupported
    assert report.startswith(f'line {line}: a statement about ')
    assert words in report


def test_a_missing_or_large_file(tmp_path: Path) -> None:
    with pytest.raises(OntologyFileError, match='No such file'):
        read_ontology(tmp_path / 'none.owl', IRI)
    big = tmp_path / 'big.owl'
    big.write_bytes(document('<!-- ' + 'x' * 5000 + ' -->'))
    with pytest.raises(OntologyFileError, match='limit of 1000 bytes'):
        read_ontology(big, IRI, size_limit=1000)


@pytest.mark.parametrize(
    'entity',
    [
        '<!ENTITY a "x"><!ENTITY b "&a;&a;&a;">',
        '<!ENTITY a SYSTEM "file:///etc/hostname">',
        '<!ENTITY % a "x">',
        f'<!ENTITY a "{"x" * 600}">',
    ],
)
def test_entities_that_expand_are_refused(entity: str) -> None:
    with pytest.raises(OntologyFileError, match='refused'):
        read_ontology(f'<!DOCTYPE r [{entity}]>'.encode() + document('<owl:Class/>'), IRI)


def test_entities_for_namespaces_are_read() -> None:
    text = f'<!DOCTYPE r [<!ENTITY m "{IRI}#">]>'.encode()
    text += document('<owl:Class rdf:about="&m;A"/>')
    (axiom,) = read_ontology(text, 'http://other').axioms
    assert n('A') in repr(axiom)


def test_what_is_not_understood_is_reported_with_its_line() -> None:
    read = read_ontology(
        document(
            '<owl:Ontology rdf:about=""><owl:imports\n rdf:resource="http://x/y"/></owl:Ontology>'
        ),
        IRI,
    )
    assert Import('http://x/y') in read.axioms
    (sentence,) = read.unsupported
    assert sentence.startswith('owl:imports <http://x/y> is not followed')


ANNOTATED = """
<owl:AnnotationProperty rdf:about="#why">
  <rdfs:domain rdf:resource="#ROOM"/></owl:AnnotationProperty>
<owl:AnnotationProperty rdf:about="#source">
  <rdfs:subPropertyOf rdf:resource="#why"/></owl:AnnotationProperty>
<owl:Class rdf:about="#ROOM"><rdfs:subClassOf rdf:resource="#LOCATION"/>
  <rdfs:subClassOf rdf:nodeID="two"/></owl:Class>
<owl:Restriction rdf:nodeID="two"><owl:onProperty rdf:resource="#hasDoor"/>
  <owl:minCardinality rdf:datatype="http://www.w3.org/2001/XMLSchema#nonNegativeInteger"
  >1</owl:minCardinality></owl:Restriction>
<ROOM rdf:about="#R1"><hasDoor rdf:resource="#D1"/><size>9</size></ROOM>
<owl:Axiom><owl:annotatedSource rdf:resource="#ROOM"/>
  <owl:annotatedProperty rdf:resource="http://www.w3.org/2000/01/rdf-schema#subClassOf"/>
  <owl:annotatedTarget rdf:resource="#LOCATION"/>
  <rdfs:comment>one</rdfs:comment><source rdf:resource="#plan"/></owl:Axiom>
<owl:Axiom><owl:annotatedSource rdf:resource="#ROOM"/>
  <owl:annotatedProperty rdf:resource="http://www.w3.org/2000/01/rdf-schema#subClassOf"/>
  <owl:annotatedTarget rdf:nodeID="two"/><rdfs:comment>two</rdfs:comment></owl:Axiom>
<owl:Axiom><owl:annotatedSource rdf:resource="#R1"/>
  <owl:annotatedProperty rdf:resource="#size"/><owl:annotatedTarget>9</owl:annotatedTarget>
  <rdfs:comment>three</rdfs:comment></owl:Axiom>
<owl:Axiom><owl:annotatedSource rdf:resource="#R1"/>
  <owl:annotatedProperty rdf:resource="http://www.w3.org/1999/02/22-rdf-syntax-ns#type"/>
  <owl:annotatedTarget rdf:resource="#ROOM"/><rdfs:comment>four</rdfs:comment></owl:Axiom>
<owl:AllDifferent><rdfs:comment>five</rdfs:comment><owl:members rdf:parseType="Collection">
  <rdf:Description rdf:about="#D1"/><rdf:Description rdf:about="#D2"/>
  <rdf:Description rdf:about="#D3"/></owl:members></owl:AllDifferent>
"""


@pytest.mark.parametrize('form', ['rdfxml', 'ntriples'])
def test_what_is_said_of_axioms_is_kept(form: str) -> None:
    read = read_ontology(document(ANNOTATED), IRI)
    assert read.unsupported == []
    notes = {a.axiom: a.annotations for a in read.axioms if isinstance(a, AxiomAnnotation)}
    comment = 'http://www.w3.org/2000/01/rdf-schema#comment'
    below = SubClassOf(n('ROOM'), n('LOCATION'))
    size = DataPropertyAssertion(n('size'), n('R1'), Literal('9'))
    assert notes[below] == ((comment, Literal('one')), (n('source'), n('plan')))
    assert notes[size] == ((comment, Literal('three')),)
    assert notes[ClassAssertion(n('ROOM'), n('R1'))] == ((comment, Literal('four')),)
    assert len(notes) == 5
    again = read_ontology(ontology_bytes(read.axioms, IRI, form), IRI)
    assert set(again.axioms) >= set(read.axioms)
    assert again.unsupported == []
    twice = ontology_bytes([*read.axioms, *read.axioms], IRI, form)
    assert twice == ontology_bytes(read.axioms, IRI, form), 'each axiom is written once'
    kb = KnowledgeBase(IRI, read.axioms)
    assert kb.reason()
    assert kb.unsupported == ()
    assert kb.rename('individual', n('R1'), n('R2'))
    renamed = DataPropertyAssertion(n('size'), n('R2'), Literal('9'))
    assert AxiomAnnotation(renamed, notes[size]) in kb
    kb.remove(renamed)
    assert not any(isinstance(a, AxiomAnnotation) and a.axiom == renamed for a in kb.axioms())
    assert kb.reason()


@pytest.mark.parametrize('form', ['rdfxml', 'ntriples'])
def test_round_trip_of_the_patrol_map(form: str, tmp_path: Path) -> None:
    axioms = list(seven_rooms().axioms())
    path = tmp_path / 'map.owl'
    write_ontology(axioms, IRI, path, form)
    read = read_ontology(path, IRI)
    assert read.format == form
    assert read.unsupported == []
    # What was used without a declaration comes back declared; all else comes back equal.
    more = set(read.axioms) - set(axioms)
    assert set(axioms) <= set(read.axioms)
    assert all(isinstance(axiom, Declaration) for axiom in more)


@pytest.mark.parametrize('seed', range(25))
def test_round_trip_of_random_ontologies(seed: int) -> None:
    axioms = RandomOntology(seed).ontology(12, 12)
    for form in ('rdfxml', 'ntriples'):
        read = read_ontology(ontology_bytes(axioms, 'http://example.org/random', form), 'x:')
        assert read.unsupported == []
        assert set(read.axioms) == set(axioms)


@pytest.mark.parametrize('form', FORMATS)
@pytest.mark.parametrize('seed', range(6))
def test_any_construct_comes_back_from_any_format(form: str, seed: int) -> None:
    axioms = WideOntology(seed).ontology(14, 8)
    read = read_ontology(ontology_bytes(axioms, 'http://example.org/wide', form), 'x:')
    assert read.unsupported == []
    assert set(read.axioms) == set(axioms)


@pytest.mark.parametrize('text', ['a<b & "c"', ' two\nlines\r\n\ttab ', 'ünïcode \U0001f916', ''])
@pytest.mark.parametrize('form', ['rdfxml', 'ntriples'])
def test_any_text_survives(text: str, form: str) -> None:
    axiom = DataPropertyAssertion(n('note'), n('x'), Literal(text))
    declared: list[Axiom] = [axiom]
    assert axiom in read_ontology(ontology_bytes(declared, IRI, form), IRI).axioms


def test_rdf_xml_says_what_it_cannot_hold() -> None:
    with pytest.raises(OntologyFileError, match='save it as N-Triples'):
        ontology_bytes([value('now', 'x', Literal('\x01'))], IRI)
    for name in ('42', 'speed²'):
        with pytest.raises(OntologyFileError, match='cannot name'):
            ontology_bytes([link(name, 'x', 'y')], IRI)
    assert ontology_bytes([value('now', 'x', Literal('\x01'))], IRI, 'ntriples')


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / 'map.owl'
    write_ontology(SCHEMA, IRI, path)
    old = path.read_bytes()
    with pytest.raises(OntologyFileError):
        write_ontology([value('now', 'x', Literal('\x01'))], IRI, path)
    assert path.read_bytes() == old
    assert [entry.name for entry in tmp_path.iterdir()] == ['map.owl']
    with pytest.raises(OntologyFileError, match='No such file'):
        write_ontology(VISITS, IRI, tmp_path / 'no' / 'map.owl')


ON = f'a <{OWL}Restriction>; <{OWL}onProperty> <x:p>; <{OWL}allValuesFrom>'


@pytest.mark.parametrize('form', ['rdfxml', 'ntriples'])
@pytest.mark.parametrize(
    'text',
    [
        '<x:i> <x:²µm> <x:j> .',
        '_:1 a <x:C> . _:a.b a <x:C> . _:w1 a <x:C> . <x:i> <x:p> _:w2 .'
        f' <x:A> <{RDFS}subClassOf> [ {ON} <x:B> ], [ {ON} <x:C> ] .',
        f'<x:i> <{OWL}differentFrom> <x:i> ; <{OWL}sameAs> <x:i> .',
        '<x:i> <x:d> "v"@en-US-x-1 .',
    ],
)
def test_whatever_was_read_is_read_again(text: str, form: str) -> None:
    read = read_ontology(text.encode(), IRI)
    again = read_ontology(ontology_bytes(read.axioms, IRI, form, read.prefixes), IRI)
    assert again.unsupported == []

    def told(axiom: Axiom) -> str:
        return re.sub(r"'_:[^']*'", '_:', repr(axiom))

    assert {told(axiom) for axiom in read.axioms} <= {told(axiom) for axiom in again.axioms}


@pytest.mark.parametrize(
    'prefixes',
    [
        {'rdf': 'x:other#', 'r': RDF, 'owl': 'x:o#'},
        {'2x': 'x:two#', 'a/b': 'x:b#', 'xmlnot': 'x:x#', 'q': XML},
        {'ns7': 'x:seven#'},
    ],
)
def test_any_prefixes_leave_a_document_that_is_read(prefixes: dict[str, str]) -> None:
    axioms = [
        ClassAssertion('x:other#C', 'x:i'),
        DataPropertyAssertion('x:q#p', 'x:i', Literal('')),
    ]
    read = read_ontology(ontology_bytes(axioms, IRI, prefixes=prefixes), IRI)
    assert set(axioms) <= set(read.axioms)


@pytest.mark.parametrize('levels', [100, 101, 10_000])
@pytest.mark.parametrize('inner', ['class', 'range'])
def test_expressions_nest_to_a_bound(levels: int, inner: str) -> None:
    if inner == 'class':
        text = f'<x:B> <{RDFS}subClassOf> {f"[ {ON} " * levels} <x:A> {"]" * levels} .'
    else:
        begin = f'[ a <{RDFS}Datatype>; <{OWL}datatypeComplementOf> ' * levels
        text = f'<x:d> a <{OWL}DatatypeProperty>; <{RDFS}range> {begin} <{XSD}int> {"]" * levels} .'
    read = read_ontology(text.encode(), IRI)
    if levels > 100:
        (report,) = read.unsupported
        assert report.endswith('is left out: expressions nest deeper than 100')
    else:
        assert read.unsupported == []
        kb = KnowledgeBase(IRI, read.axioms)
        assert kb.reason()
        assert read_ontology(ontology_bytes(read.axioms, IRI), IRI).unsupported == []


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        (b'Ontology(' + b'(' * 10_000, '1:111: constructs nest deeper than 100'),
        (b'Ontology(ClassAssertion(<x:C> _:a;b))', "'_:a;b' is no label"),
    ],
)
def test_what_no_document_could_hold_is_refused(text: bytes, complaint: str) -> None:
    with pytest.raises(OntologyFileError) as caught:
        read_ontology(text, IRI)
    assert complaint in str(caught.value)


@pytest.mark.parametrize(
    'text',
    [
        document('<owl:Thing rdf:about="x:a b"/><owl:Thing rdf:about="x:a b"/>'),
        b'<Ontology xmlns="%b" ontologyIRI="x:o"><Prefix name="p" IRI="x:a "/><ClassAssertion>'
        b'<Class IRI="%bThing"/><NamedIndividual abbreviatedIRI="p:b"/></ClassAssertion></Ontology>'
        % (OWL.encode(), OWL.encode()),
        f'@base <x:> . <x:a b> a <{THING}>, <{THING}> .'.encode(),
        f'<x:c> <{RDF}type> <{THING}> .\n<x:a b> <{RDF}type> <{THING}> .\n'.encode(),
        f'[{{"@id": "x:a b", "@type": "{THING}"}}]'.encode(),
        f'Prefix(p:=<x:a >)Ontology(<x:o> ClassAssertion(<{THING}> p:b))'.encode(),
    ],
    ids=['rdfxml', 'owlxml', 'turtle', 'ntriples', 'jsonld', 'functional'],
)
def test_what_no_iri_may_hold_is_percent_encoded_and_reported(text: bytes) -> None:
    read = read_ontology(text, IRI)
    assert ClassAssertion(THING, 'x:a%20b') in read.axioms
    assert read.unsupported == ["IRI 'x:a b' contains ' ', it is read as <x:a%20b>"]
    again = read_ontology(ontology_bytes(read.axioms, IRI, prefixes=read.prefixes), IRI)
    assert (again.axioms, again.unsupported) == (read.axioms, [])


def test_a_namespace_that_is_no_iri_is_percent_encoded_and_reported() -> None:
    named = 'xmlns="x:{a} #" xmlns:q="x:{a} #" rdf:about="x:i"'
    read = read_ontology(document(f'<C {named} q:p="1"><p>2</p></C>'), IRI)
    odd = 'x:%7Ba%7D%20#'
    assert ClassAssertion(odd + 'C', 'x:i') in read.axioms
    for text in '12':
        assert DataPropertyAssertion(odd + 'p', 'x:i', Literal(text)) in read.axioms
    assert read.unsupported == [f"IRI 'x:{{a}} #' contains '{{', it is read as <{odd}>"]
    again = read_ontology(ontology_bytes(read.axioms, IRI, prefixes=read.prefixes), IRI)
    assert set(read.axioms) <= set(again.axioms)
    assert again.unsupported == []


@pytest.mark.parametrize(
    'text',
    [
        document(
            '<owl:Ontology rdf:about="x:o"><owl:versionIRI rdf:resource="x:1"/></owl:Ontology>'
        ),
        f'<Ontology xmlns="{OWL}" ontologyIRI="x:o" versionIRI="x:1"></Ontology>'.encode(),
        b'Ontology(<x:o> <x:1>)',
    ],
    ids=['rdfxml', 'owlxml', 'functional'],
)
def test_the_version_of_an_ontology_is_kept(text: bytes) -> None:
    read = read_ontology(text, IRI)
    version = AnnotationAssertion(OWL + 'versionIRI', 'x:o', 'x:1')
    assert (list(read.axioms), read.iri) == ([version], 'x:o')
    assert version in read_ontology(ontology_bytes(read.axioms, 'x:o'), IRI).axioms


@pytest.mark.parametrize('name', ['a', 'a?', 'a#', 'a?b', 'a?b#', '?', '#', '?#', ''])
def test_a_relative_name_keeps_an_empty_query_or_fragment(name: str) -> None:
    text = document(f'<owl:Thing xml:base="http://x/y" rdf:about="{name}"/>')
    expected = 'http://x/' + name if name[:1] == 'a' else 'http://x/y' + name
    assert ClassAssertion(THING, expected) in read_ontology(text, IRI).axioms


def test_json_ld_leaves_out_no_statement_in_silence() -> None:
    text = b"""{"@id": "x:i", "unmapped": "1", "x:p": [
        {"@value": "v", "@language": "a b"}, {"@value": "w", "@type": "x:{t}"}]}"""
    read = read_ontology(text, IRI)
    assert read.axioms == [
        DataPropertyAssertion('x:p', 'x:i', Literal('v')),
        DataPropertyAssertion('x:p', 'x:i', Literal('w', 'x:%7Bt%7D')),
    ]
    assert read.unsupported == [
        "a statement about x:i is left out: its property 'unmapped' is no IRI",
        "'a b' is no language tag",
        "IRI 'x:{t}' contains '{', it is read as <x:%7Bt%7D>",
    ]


def test_languages_with_underscores_are_read() -> None:
    text = document('<rdf:Description rdf:about="#i"><d xml:lang="en_US">v</d></rdf:Description>')
    spoken = Literal('v', RDF + 'langString', 'en-us')
    assert DataPropertyAssertion(n('d'), n('i'), spoken) in read_ontology(text, IRI).axioms


@pytest.mark.parametrize(
    ('text', 'report'),
    [
        (
            document('<rdf:Description rdf:about="#i"><d xml:lang="a b">v</d></rdf:Description>'),
            "line 2: xml:lang 'a b' is no language tag",
        ),
        (
            b'<Ontology xmlns="http://www.w3.org/2002/07/owl#"><DataPropertyAssertion>'
            b'<DataProperty IRI="%(ns)sd"/><NamedIndividual IRI="%(ns)si"/>'
            b'<Literal xml:lang="1">v</Literal></DataPropertyAssertion></Ontology>'
            % {b'ns': n('').encode()},
            "line 1: xml:lang '1' is no language tag",
        ),
        (
            f'Ontology(DataPropertyAssertion(<{n("d")}> <{n("i")}> "v"@1))'.encode(),
            "line 1: '1' is no language tag",
        ),
    ],
)
def test_a_text_whose_language_is_none_is_read_and_reported(text: bytes, report: str) -> None:
    read = read_ontology(text, IRI)
    assert DataPropertyAssertion(n('d'), n('i'), Literal('v')) in read.axioms
    assert read.unsupported == [report]


def test_a_relative_iri_of_functional_syntax_is_completed() -> None:
    text = b'Ontology(<http://example.org/o> ClassAssertion(<#C> <b>))'
    assert read_ontology(text, IRI).axioms == [
        ClassAssertion('http://example.org/o#C', 'http://example.org/b')
    ]


def test_a_long_text_costs_no_more_than_its_length() -> None:
    size = 400_000
    text = f'Ontology(DataPropertyAssertion(<x:d> <x:i> "{"x" * size}"))'.encode()
    notes = b'#\n' * (size // 8) + text
    for data in (text, notes):
        tracemalloc.start()
        read_ontology(data, IRI)
        assert tracemalloc.get_traced_memory()[1] < 12 * len(data)
        tracemalloc.stop()


def test_labels_that_cannot_be_written_cost_no_more_than_their_number() -> None:
    # Each went through all axioms, for minutes.
    text = ''.join(f'_:{number} <x:d> {number} .\n' for number in range(20_000)).encode()
    read = read_ontology(text, IRI)
    again = read_ontology(ontology_bytes(read.axioms, IRI), IRI).axioms
    subjects = {axiom.subject for axiom in again if isinstance(axiom, DataPropertyAssertion)}
    assert len(subjects) == 20_000


def test_a_file_gets_the_usual_rights_and_leaves_those_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = os.umask(0o027)
    try:
        # It is the whole process's: another thread's files would get all rights meanwhile.
        monkeypatch.setattr(os, 'umask', lambda _: pytest.fail('changes the rights of all threads'))
        write_ontology([], IRI, tmp_path / 'map.nt', 'ntriples')
    finally:
        monkeypatch.undo()
        os.umask(old)
    assert (tmp_path / 'map.nt').stat().st_mode & 0o777 == 0o640


def test_a_rule_is_saved_without_what_has_no_name() -> None:
    text = (
        f'_:r a <{SWRL}Imp>; <{RDFS}seeAlso> _:1; <{SWRL}body> (); <{SWRL}head> () . _:1 a <x:C> .'
    )
    read = read_ontology(text.encode(), IRI)
    assert read.unsupported == ['an annotation on a rule is not kept']
    assert read_ontology(ontology_bytes(read.axioms, IRI), IRI).unsupported == []


WRITTEN = f"""<?xml version="1.0" encoding="utf-8"?>
<rdf:RDF
     xmlns="http://o/o#"
     xmlns:e="x:"
     xmlns:ns1="http://y/a#"
     xmlns:ns2="http://z/"
     xmlns:owl="{OWL}"
     xmlns:rdf="{RDF}"
     xmlns:rdfs="{RDFS}"
     xmlns:swrl="{SWRL}"
     xmlns:xsd="{XSD}"
     xml:base="http://o/o#">

    <owl:Ontology rdf:about="http://o/o#"/>

    <owl:Class rdf:about="x:A">
        <rdfs:subClassOf>
            <owl:Class>
                <owl:unionOf rdf:parseType="Collection">
                    <rdf:Description rdf:about="x:B"/>
                    <owl:Restriction>
                        <owl:onProperty rdf:resource="x:p"/>
                        <owl:someValuesFrom rdf:resource="x:C"/>
                    </owl:Restriction>
                </owl:unionOf>
            </owl:Class>
        </rdfs:subClassOf>
    </owl:Class>

    <e:B rdf:about="x:i">
        <rdf:type rdf:resource="x:4"/>
        <e:p rdf:nodeID="shared"/>
        <ns1:d rdf:datatype="{XSD}integer">5</ns1:d>
        <ns2:e xml:lang="en">t&lt;</ns2:e>
    </e:B>

    <rdf:Description rdf:about="x:j">
        <e:p rdf:nodeID="shared"/>
        <e:p>
            <e:C/>
        </e:p>
    </rdf:Description>

    <rdf:Description rdf:nodeID="one">
        <e:p rdf:nodeID="other"/>
    </rdf:Description>

    <rdf:Description rdf:nodeID="other">
        <e:p rdf:nodeID="one"/>
    </rdf:Description>

    <owl:Class rdf:about="x:B"/>

    <owl:ObjectProperty rdf:about="x:p"/>

    <owl:Class rdf:about="x:C"/>

    <owl:Class rdf:about="x:4"/>

    <owl:DatatypeProperty rdf:about="http://y/a#d"/>

    <owl:DatatypeProperty rdf:about="http://z/e"/>

</rdf:RDF>
"""


def test_rdf_xml_nests_what_is_used_once_and_names_what_is_shared() -> None:
    either = ObjectUnionOf(('x:B', ObjectSomeValuesFrom('x:p', 'x:C')))
    axioms: list[Axiom] = [
        Declaration('class', 'x:A'),
        SubClassOf('x:A', either),
        ClassAssertion('x:4', 'x:i'),
        ClassAssertion('x:B', 'x:i'),
        ObjectPropertyAssertion('x:p', 'x:i', '_:shared'),
        ObjectPropertyAssertion('x:p', 'x:j', '_:shared'),
        ObjectPropertyAssertion('x:p', 'x:j', '_:once'),
        ClassAssertion('x:C', '_:once'),
        ObjectPropertyAssertion('x:p', '_:one', '_:other'),
        ObjectPropertyAssertion('x:p', '_:other', '_:one'),
        DataPropertyAssertion('http://y/a#d', 'x:i', Literal('5', XSD + 'integer')),
        DataPropertyAssertion('http://z/e', 'x:i', Literal('t<', RDF + 'langString', 'en')),
    ]
    prefixes = {'e': 'x:', '9': 'http://y/a#', 'xmlq': 'http://z/'}
    assert ontology_bytes(axioms, 'http://o/o#', prefixes=prefixes).decode() == WRITTEN
