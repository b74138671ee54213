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
