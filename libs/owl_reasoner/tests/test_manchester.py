"""Manchester syntax: what is read, what is written, and where a text is wrong."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase, OntologyFileError, read_ontology
from owl_reasoner.documents.manchester import ManchesterParser, ManchesterWriter
from owl_reasoner.documents.writing import ontology_bytes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD

from .random_ontologies import RandomOntology

N = 'urn:o#'
DOCUMENT = """
Prefix: : <urn:o#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
# As Protege writes it.
Ontology: <urn:o>
Annotations: rdfs:comment "of \\"rooms\\""@en

ObjectProperty: hasDoor
    Domain: Room
    Characteristics: Irreflexive, Asymmetric
    InverseOf: doorOf
ObjectProperty: doorOf
ObjectProperty: near SubPropertyChain: hasDoor o doorOf
DataProperty: area
    Characteristics: Functional
    Range: decimal[> 0.0]
Datatype: Level EquivalentTo: {"low", "high"}
Class: Room
    Annotations: rdfs:label "room"
    SubClassOf: hasDoor min 1 Door, not Door
    HasKey: area
Class: Door
Class: DeadEnd EquivalentTo: Room and (hasDoor exactly 1)
Class: Large EquivalentTo: Room that area some decimal[>= 20.0]
Class: Room and DeadEnd SubClassOf: inverse (near) some Room
Individual: r
    Types: Room, hasDoor max 1
    Facts: hasDoor d, area 21.5, not near d
    DifferentFrom: d
Individual: d Types: Door
DisjointClasses: Room, Door
Rule: Room(?r), area(?r, ?a), greaterThan(?a, 20.0) -> Hall(?r)
"""


def test_a_document_is_read_and_reasoned_over() -> None:
    document = read_ontology(DOCUMENT.encode(), 'urn:base')
    assert (document.format, document.iri, document.unsupported) == ('manchester', 'urn:o', [])
    kb = KnowledgeBase('urn:o', document.axioms)
    assert kb.reason()
    assert kb.types(f'{N}r') == {f'{N}{name}' for name in ('Room', 'DeadEnd', 'Large', 'Hall')}
    assert ax.DataPropertyAssertion(f'{N}area', f'{N}r', Literal('21.5', XSD + 'decimal')) in set(
        document.axioms
    )
    assert ax.HasKey(f'{N}Room', (), (f'{N}area',)) in set(document.axioms)


def test_what_is_written_is_read_back() -> None:
    axioms = read_ontology(DOCUMENT.encode(), 'urn:base').axioms
    written = ontology_bytes(axioms, 'urn:o', 'manchester', {'': N})
    assert b'EquivalentClasses: :DeadEnd, (:Room and (:hasDoor exactly 1 owl:Thing))' in written
    assert set(read_ontology(written, 'urn:o').axioms) == set(axioms)


@pytest.mark.parametrize('seed', range(20))
def test_random_axioms_are_read_back(seed: int) -> None:
    axioms = list(dict.fromkeys(RandomOntology(seed).ontology(10, 10)))
    found = read_ontology(ontology_bytes(axioms, 'urn:o', 'manchester'), 'urn:o').axioms
    assert [axiom for axiom in axioms if axiom not in set(found)] == []


@pytest.mark.parametrize(
    ('text', 'line', 'expected'),
    [
        ('Ontology: <urn:o>\nClass: A SubClassOf:\n', 3, 'expected a class'),
        ('Ontology: <urn:o>\nClass: A SubClassOf: p some\n', 3, 'expected'),
        ('Ontology: <urn:o>\nClass: A Domain: B\n', 2, 'a section of this frame, not Domain:'),
        ('Ontology: <urn:o>\nClas: A\n', 2, 'a frame such as Class:'),
        ('Ontology: <urn:o>\nClass: x:A\n', 2, 'the prefix of .x:A. is not declared'),
        ('Ontology: <urn:o>\nClass: A SubClassOf: p min x\n', 2, 'a whole number'),
        ('Ontology: <urn:o>\nIndividual: i Facts: p "a\n', 2, 'expected a'),
        ('Ontology: <urn:o>\nRule: A(?x) B(?x)\n', 2, "expected '->'"),
        ('Ontology: <urn:o>\nClass: A SubClassOf: ' + 'not (' * 300 + 'B', 2, 'nest'),
    ],
)
def test_a_wrong_text_names_its_place(text: str, line: int, expected: str) -> None:
    with pytest.raises(OntologyFileError, match=expected) as error:
        read_ontology(text.encode(), 'urn:base')
    assert error.value.line == line


@pytest.mark.parametrize(
    'text',
    [
        'A and (p some (B or C)) and not D',
        'p only {a, b}',
        '(inverse (p)) min 2 A',
        'd some integer[>= 1, < 5]',
        'd max 1 xsd:string',
        'p Self',
        'd value "x"@en',
        'p exactly 3',
    ],
)
def test_an_expression_comes_back_as_it_was(text: str) -> None:
    def named(name: str) -> str:
        return name.replace('xsd:', XSD) if name.startswith('xsd:') else N + name

    def read(text: str) -> ex.ClassExpression:
        parser = ManchesterParser(text, named, [('data_property', f'{N}d')])
        found: ex.ClassExpression = parser.whole(parser.class_expression)
        return found

    first = read(text)
    written = ManchesterWriter({}).expression(first).replace('owl:Thing', 'Thing')
    again = read(written.replace('Thing', '<http://www.w3.org/2002/07/owl#Thing>'))
    assert again == first


ANNOTATED = """
Prefix: : <urn:o#>
Ontology: <urn:o>
Annotations: Annotations: rdfs:comment "of the label" rdfs:label "o", rdfs:comment "two"
ObjectProperty: p
    Characteristics: Annotations: rdfs:comment "f" Functional, Irreflexive
    Domain: Annotations: rdfs:comment "d" A
    InverseOf: Annotations: rdfs:comment "i" q
    SubPropertyChain: Annotations: rdfs:comment "ch" p o q
ObjectProperty: q
DataProperty: d
    Characteristics: Annotations: rdfs:comment "df" Functional
    Range: Annotations: rdfs:comment "dr" xsd:int
    SubPropertyOf: Annotations: rdfs:comment "ds" e
DataProperty: e
Datatype: T EquivalentTo: Annotations: rdfs:comment "t" {"low"}
Class: A
    Annotations: Annotations: rdfs:comment "n" rdfs:label "a"@en, rdfs:seeAlso <urn:x>
    SubClassOf: Annotations: rdfs:comment "one", rdfs:label "two" p some B, B
    EquivalentTo: Annotations: rdfs:comment "e" (p only B)
    HasKey: Annotations: rdfs:comment "k" p d
    DisjointUnionOf: Annotations: rdfs:comment "u" B, C
Class: B
Class: C
Individual: a
    Types: Annotations: rdfs:comment "ty" A, B
    Facts: Annotations: rdfs:comment "p" p b, d 5, Annotations: rdfs:comment "n" not q b
    SameAs: Annotations: rdfs:comment "s" c
Individual: b
DisjointClasses: Annotations: rdfs:comment "dc" A, B, C
DifferentIndividuals: Annotations: rdfs:comment "di" a, b
Rule: Annotations: rdfs:label "R" A(?x) -> B(?x)
"""


def test_what_is_said_of_axioms_is_read_and_written() -> None:
    document = read_ontology(ANNOTATED.encode(), 'urn:base')
    assert document.unsupported == []
    notes = {a.axiom: a.annotations for a in document.axioms if isinstance(a, ax.AxiomAnnotation)}
    assert len(notes) == 20
    comment, label = (f'http://www.w3.org/2000/01/rdf-schema#{n}' for n in ('comment', 'label'))
    some = ax.SubClassOf(f'{N}A', ex.ObjectSomeValuesFrom(f'{N}p', f'{N}B'))
    assert notes[some] == ((comment, Literal('one')), (label, Literal('two')))
    assert ax.SubClassOf(f'{N}A', f'{N}B') not in notes
    rule = next(axiom for axiom in document.axioms if isinstance(axiom, ax.Rule))
    assert rule.label == 'R'
    for form in ('manchester', 'rdfxml'):
        written = ontology_bytes(document.axioms, 'urn:o', form, {'': N})
        again = read_ontology(written, 'urn:base')
        assert (again.unsupported, set(again.axioms)) == ([], set(document.axioms))
        assert next(axiom for axiom in again.axioms if isinstance(axiom, ax.Rule)).label == 'R'


@pytest.mark.parametrize(
    ('frame', 'report'),
    [
        (
            'Class: A SubClassOf:\n Annotations: Annotations: rdfs:label "x" rdfs:label "y" B',
            'line 3: an annotation on an annotation is not kept',
        ),
        (
            'Class: A and B\n Annotations: rdfs:label "x"',
            'line 3: annotations of what has no name are not kept',
        ),
    ],
)
def test_what_no_axiom_holds_is_reported(frame: str, report: str) -> None:
    document = read_ontology(f'Ontology: <urn:o>\n{frame}'.encode(), 'urn:base')
    assert document.unsupported == [report]


def test_annotations_nest_no_deeper_than_expressions() -> None:
    text = 'Ontology: <urn:o> Class: A ' + 'Annotations: ' * 5000 + 'rdfs:label "x"'
    with pytest.raises(OntologyFileError, match='nest no deeper'):
        read_ontology(text.encode(), 'urn:base')


def test_a_declaration_is_annotated_in_other_formats_only() -> None:
    declared = ax.Declaration('class', f'{N}A')
    said = ax.AxiomAnnotation(declared, ((f'{N}n', Literal('x')),))
    with pytest.raises(OntologyFileError, match='annotate the declaration of <urn:o#A>; save it'):
        ontology_bytes([declared, said], 'urn:o', 'manchester')


def test_what_nobody_declared_keeps_its_kind() -> None:
    """The functional syntax needs no declarations; a reader of Manchester syntax does."""
    text = 'Ontology(<urn:o> SubClassOf(<urn:A> DataSomeValuesFrom(<urn:d> <urn:T>)))'
    axioms = read_ontology(text.encode(), 'urn:base').axioms
    again = read_ontology(ontology_bytes(axioms, 'urn:o', 'manchester'), 'urn:base')
    assert [axiom for axiom in axioms if axiom not in again.axioms] == []
