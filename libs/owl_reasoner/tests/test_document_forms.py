"""Functional syntax and OWL/XML: the forms besides axioms, and each error with its place."""
# ruff: noqa: E501 - documents and tables of cases

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from owl_reasoner import OntologyFileError, read_ontology
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import RDF, RDFS, XSD
from strict_files.regular_files import replace_file

COMMENT = RDFS + 'comment'
OWL_XML = (
    '<Ontology xmlns="http://www.w3.org/2002/07/owl#" xml:base="http://b/#" {}>\n{}</Ontology>'
)


def refuse(text: str, message: str, line: int, column: int | None) -> None:
    """Check that a document is refused with what its message starts with, and where."""
    with pytest.raises(OntologyFileError) as error:
        read_ontology(text.encode(), 'urn:base')
    assert error.value.message.startswith(message)
    assert error.value.line == line
    assert column is None or error.value.column == column


def literals(axioms: list[Axiom]) -> list[Literal]:
    return [axiom.literal for axiom in axioms if isinstance(axiom, ax.DataPropertyAssertion)]


@pytest.mark.parametrize(
    ('text', 'message', 'line', 'column'),
    [
        ('Prefix(:=<x:>)\nOther(<x>)', "expected Prefix( or Ontology(, got 'Other'", 2, 1),
        ('Ontology(<urn:x>)\nOntology(<urn:y>)', 'Ontology after the end of the ontology', 2, 1),
        ('Ontology(<urn:x>)\nPrefix(a:=<x:>)', 'Prefix after the end of the ontology', 2, 1),
        ('Prefix(a:<x:>)\nOntology(<urn:x>)', "expected '=', got 'x:'", 1, 10),
        ('Prefix(a:=<x:>\nOntology(<urn:x>)', "expected ')', got 'Ontology'", 2, 1),
        ('Prefix(:=<x:>)\nOntology <urn:x>', "expected '(', got 'urn:x'", 2, 10),
        ('Ontology(<urn:x>\n"text")', "expected an axiom, got Literal(lexical='text'", 2, 1),
        ('Ontology(<urn:x>\n <urn:y> <urn:z>)', "expected an axiom, got 'urn:z'", 2, 10),
        ('Ontology(<urn:x>\n(<urn:y>))', "expected an axiom, got ('urn:y',)", 2, 1),
        ('Ontology(<urn:x>\n=)', "unexpected '='", 2, 1),
        ('Ontology(<urn:x>', 'the document ends inside a construct', 1, 17),
        (
            'Ontology(<urn:x> SubClassOf(<urn:A> ObjectMinCardinality(1234567890123456789 <urn:p>)))',
            'a number of 19 digits',
            1,
            58,
        ),
        ('Ontology(<urn:x> ClassAssertion(<urn:A> _:))', '', 1, 41),
        (
            'Ontology(<urn:x> ClassAssertion(a:A <urn:i>))',
            "the prefix of 'a:A' is not declared",
            1,
            33,
        ),
        ('Ontology(<urn:x> ' + 'A(' * 300, 'constructs nest deeper than ', 1, None),
    ],
)
def test_each_error_of_functional_syntax(
    text: str, message: str, line: int, column: int | None
) -> None:
    refuse(text, message, line, column)


def test_each_form_of_a_value_in_functional_syntax() -> None:
    text = r"""
    Prefix(xsd:=<http://www.w3.org/2001/XMLSchema#>) Prefix(=<urn:e#>)
    # A note.
    Ontology(<urn:o> <urn:o/1>
      DataPropertyAssertion(<urn:d> <urn:i> "a\"b\\c")
      DataPropertyAssertion(<urn:d> <urn:i> "a"@EN-gb)
      DataPropertyAssertion(<urn:d> <urn:i> "5"^^xsd:int)
      DataPropertyAssertion(<urn:d> <urn:i> "5"^^<urn:t>)
      ClassAssertion(:C _:x)
    )"""
    document = read_ontology(text.encode(), 'urn:base')
    assert document.iri == 'urn:o'
    assert literals(document.axioms) == [
        Literal('a"b\\c'),
        Literal('a', RDF + 'langString', 'en-gb'),
        Literal('5', XSD + 'int'),
        Literal('5', 'urn:t'),
    ]
    (unnamed,) = (axiom for axiom in document.axioms if isinstance(axiom, ax.ClassAssertion))
    assert unnamed.cls == 'urn:e#C'
    assert unnamed.individual.startswith('_:')


@pytest.mark.parametrize(
    ('inside', 'message', 'line', 'column'),
    [
        ('<x xmlns="urn:"/>', "element 'urn:x' is not of OWL/XML", 2, 1),
        ('text <SubClassOf/>', "text 'text' where an element is expected", 2, 6),
        ('<SubClassOf><Class/></SubClassOf>', 'Class lacks its attribute IRI', 2, 21),
        ('<Prefix name="a"/>', 'Prefix lacks its attribute IRI', 2, 19),
        ('<Prefix IRI="urn:a"/>', 'Prefix lacks its attribute name', 2, 22),
        (
            '<SubClassOf><Class abbreviatedIRI="a:b"/></SubClassOf>',
            "the prefix of 'a:b' is not declared",
            2,
            42,
        ),
        (
            '<SubClassOf>\n<ObjectMinCardinality cardinality="-1"/></SubClassOf>',
            "expected a whole number as cardinality, got '-1'",
            3,
            41,
        ),
        (
            '<SubClassOf><ObjectMinCardinality cardinality="1234567890123456789"/></SubClassOf>',
            "expected a whole number as cardinality, got '1234567890123456789'",
            2,
            70,
        ),
        (
            '<ClassAssertion><AnonymousIndividual/></ClassAssertion>',
            'AnonymousIndividual lacks its attribute nodeID',
            2,
            39,
        ),
        ('<A>' * 250 + '</A>' * 250, 'constructs nest deeper than ', 2, None),
    ],
)
def test_each_error_of_owl_xml(inside: str, message: str, line: int, column: int | None) -> None:
    refuse(OWL_XML.format('', inside), message, line, column)


def test_each_form_of_a_name_and_a_value_in_owl_xml() -> None:
    inside = """
    <Prefix name="" IRI="urn:e#"/><Prefix name="xsd" IRI="http://www.w3.org/2001/XMLSchema#"/>
    <ClassAssertion><Class abbreviatedIRI=":C"/><NamedIndividual IRI="i"/></ClassAssertion>
    <ClassAssertion xml:base="urn:f#"><Class IRI="C"/><NamedIndividual IRI="urn:g"/></ClassAssertion>
    <ClassAssertion>
      <ObjectMaxCardinality cardinality="2"><ObjectProperty IRI="p"/></ObjectMaxCardinality>
      <NamedIndividual IRI="i"/>
    </ClassAssertion>
    <DataPropertyAssertion xml:lang="en"><DataProperty IRI="d"/><NamedIndividual IRI="i"/>
      <Literal> a </Literal></DataPropertyAssertion>
    <DataPropertyAssertion><DataProperty IRI="d"/><NamedIndividual IRI="i"/>
      <Literal datatypeIRI="http://www.w3.org/2001/XMLSchema#int">5</Literal></DataPropertyAssertion>
    <DataPropertyAssertion><DataProperty IRI="d"/><NamedIndividual IRI="i"/>
      <Literal xml:lang="de"
        datatypeIRI="http://www.w3.org/1999/02/22-rdf-syntax-ns#PlainLiteral">b</Literal>
    </DataPropertyAssertion>
    <DataPropertyAssertion><DataProperty IRI="d"/><NamedIndividual IRI="i"/>
      <Literal/></DataPropertyAssertion>
    <DataPropertyRange><DataProperty IRI="d"/><DatatypeRestriction>
      <Datatype abbreviatedIRI="xsd:int"/>
      <FacetRestriction facet="http://www.w3.org/2001/XMLSchema#minInclusive">
        <Literal datatypeIRI="http://www.w3.org/2001/XMLSchema#int">1</Literal></FacetRestriction>
      <FacetRestriction facet="http://www.w3.org/2001/XMLSchema#maxInclusive">
        <Literal datatypeIRI="http://www.w3.org/2001/XMLSchema#int">2</Literal></FacetRestriction>
    </DatatypeRestriction></DataPropertyRange>
    <HasKey><Annotation><AnnotationProperty abbreviatedIRI=":n"/><IRI>x</IRI></Annotation>
      <Class IRI="C"/><ObjectProperty IRI="p"/><DataProperty IRI="d"/>
      <ObjectInverseOf><ObjectProperty IRI="q"/></ObjectInverseOf></HasKey>
    <AnnotationAssertion><AnnotationProperty IRI="n"/><AbbreviatedIRI>:s</AbbreviatedIRI>
      <IRI>http://b/#v</IRI></AnnotationAssertion>
    """
    document = read_ontology(
        OWL_XML.format('ontologyIRI="http://b/o"', inside).encode(), 'urn:base'
    )
    assert (document.iri, document.unsupported) == ('http://b/o', [])
    b, one, number = 'http://b/#', 'http://b/#i', XSD + 'int'
    key = ax.HasKey(f'{b}C', (f'{b}p', ex.ObjectInverseOf(f'{b}q')), (f'{b}d',))
    facets = (
        (XSD + 'minInclusive', Literal('1', number)),
        (XSD + 'maxInclusive', Literal('2', number)),
    )
    assert document.axioms == [
        ax.ClassAssertion('urn:e#C', one),
        ax.ClassAssertion('urn:f#C', 'urn:g'),
        ax.ClassAssertion(ex.ObjectMaxCardinality(2, f'{b}p'), one),
        *(
            ax.DataPropertyAssertion(f'{b}d', one, literal)
            for literal in (
                Literal(' a ', RDF + 'langString', 'en'),
                Literal('5', number),
                Literal('b', RDF + 'langString', 'de'),
                Literal(''),
            )
        ),
        ax.DataPropertyRange(f'{b}d', ex.DatatypeRestriction(number, facets)),
        key,
        ax.AxiomAnnotation(key, (('urn:e#n', f'{b}x'),)),
        ax.AnnotationAssertion(f'{b}n', 'urn:e#s', f'{b}v'),
    ]


def test_a_file_is_replaced_in_one_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target, link = tmp_path / 'file', tmp_path / 'link'
    link.symlink_to(target)
    replace_file(link, b'one')
    assert target.read_bytes() == b'one'
    target.chmod(0o604)
    replace_file(link, b'two', durable=True)
    assert (target.read_bytes(), target.stat().st_mode & 0o777) == (b'two', 0o604)
    assert link.is_symlink()
    asked: list[tuple[object, ...]] = []

    def access(path: object, mode: int, **options: bool) -> bool:
        asked.append((path, mode, options))
        return False

    monkeypatch.setattr(os, 'access', access)
    with pytest.raises(OSError, match='Permission denied') as refused:
        replace_file(link, b'three')
    assert (refused.value.errno, refused.value.filename) == (errno.EACCES, str(link))
    assert asked == [(target, os.W_OK, {'effective_ids': True})]
    replace_file(tmp_path / 'new', b'four')  # Where nothing is yet, nobody need ask.
    monkeypatch.undo()
    for no_file in (tmp_path, os.devnull):
        with pytest.raises(OSError, match='expected a file, got') as refused:
            replace_file(no_file, b'five')
        assert (refused.value.errno, refused.value.filename) == (errno.EINVAL, str(no_file))
    monkeypatch.setattr(
        os, 'replace', lambda *_: (_ for _ in ()).throw(OSError(errno.ENOSPC, 'full'))
    )
    with pytest.raises(OSError, match='full') as refused:
        replace_file(target, b'six')
    assert (refused.value.errno, refused.value.filename) == (errno.ENOSPC, str(target))
    assert target.read_bytes() == b'two'
    assert sorted(each.name for each in tmp_path.iterdir()) == ['file', 'link', 'new']


@pytest.mark.parametrize('durable', [False, True])
def test_only_a_durable_file_waits_for_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    synced: list[str] = []
    monkeypatch.setattr(
        os, 'fsync', lambda handle: synced.append(os.readlink(f'/proc/self/fd/{handle}'))
    )
    replace_file(tmp_path / 'file', b'one', durable=durable)
    names = [name.removeprefix(str(tmp_path)) for name in synced]
    assert [name.endswith('.draft') for name in names] == ([True, False] if durable else [])
    assert names[1:] == ([''] if durable else [])
