"""Axioms as quads of a World's file: they come back as they were, and go without a trace."""

from __future__ import annotations

import random
from collections.abc import Iterable
from pathlib import Path

import owlready2
import pytest

from armor_service.store.world_connection import WorldConnection
from armor_service.store.world_ontology import WorldNames, WorldOntology
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.owl.axioms import (
    AnnotationAssertion,
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal, ObjectSomeValuesFrom
from owl_reasoner.owl.vocabulary import RDF, RDFS, XSD

from .seven_rooms import ONTOLOGY

IRI = 'http://example.org/o'
DOCUMENTS = [
    *(Path(owlready2.__file__).parent / 'ontos').glob('*.owl'),
    Path(ONTOLOGY),
    *Path(__file__).parent.glob('fixtures/*.owl'),
]


class File:
    """A World's file with one ontology, which can be opened again."""

    def __init__(self, folder: Path) -> None:
        self._file = WorldConnection(folder / 'o.sqlite3')
        self._file.make()
        self.open()
        with self.db:
            self.db.execute('BEGIN')
            self.ontology.write_header()

    def open(self) -> None:
        self.db = self._file.open()
        self.ontology = WorldOntology(self.db, IRI, WorldNames(self.db))
        self.known = [a for a in self.ontology.read().added if not isinstance(a, Declaration)]

    def reopen(self) -> list[Axiom]:
        self._file.close()
        self.open()
        return self.known

    def change(self, added: Iterable[Axiom] = (), removed: Iterable[Axiom] = ()) -> None:
        self.db.execute('BEGIN IMMEDIATE')
        for axiom in removed:
            self.ontology.remove(axiom)
        for axiom in added:
            self.ontology.add(axiom)
        self.ontology.write_labels()
        self.db.execute('COMMIT')
        self.ontology.committed()

    def left(self) -> list[tuple[object, ...]]:
        """Return the quads that neither declare nor begin an ontology."""
        rows = self.db.execute('SELECT s, p, o FROM objs WHERE p != 6 OR o > 300 OR s < 0')
        return [*rows, *self.db.execute('SELECT s, p, o, d FROM datas')]


@pytest.fixture
def file(tmp_path: Path) -> File:
    return File(tmp_path)


def plainly(axioms: Iterable[Axiom]) -> set[Axiom]:
    return {axiom for axiom in axioms if not isinstance(axiom, Declaration)}


ODD = {
    'integer': ['7', '007', '+5', '-0', '-7', str(2**63), str(-(2**63) - 1), '1_0', '٣', '', ' 7'],
    'long': ['1665579740', '007', '+1', '00', '-01', str(2**63 - 1)],
    'int': ['0', '-0', '+0', '010'],
    'short': ['5', '05'],
    'byte': ['-128', '0127'],
    'unsignedByte': ['255', '0255'],
    'nonNegativeInteger': ['3', '+3', '003'],
    'positiveInteger': ['1', '01'],
    'negativeInteger': ['-1', '-01'],
    'nonPositiveInteger': ['0', '-3', '-03'],
    'decimal': [
        *('1.5', '1.50', '1', '1.0', '01.5', '+1.5', '.5', '5.', '-0.0', '0.1234567890123456789'),
        *('123456789012345678901234567890.5', '0.00000012', '-12000000000000000000000'),
    ],
    'double': [
        *('1.5', '1.50', '1e3', '1E3', '1.0E3', '1000.0', 'INF', '-INF', 'NaN', '-0', '0.1'),
        *('1e400', '1e-400', '0.30000000000000004', '5', '1e+3', '1e16', '1e22'),
    ],
    'float': ['3.4028235e38', '1e10', '0.1', '16777217', '1.40e-45', 'INF', '+INF'],
    'boolean': ['true', 'false', '1', '0', 'True', ' true '],
    'string': [
        '',
        ' ',
        'a',
        '7',
        '007',
        'true',
        'ä€😀',
        'a\nb',
        '"q"',
        "it's",
        '\\',
        'x' * 2000,
        'a\x00b',
    ],
    'normalizedString': ['a b', ' a '],
    'token': ['a', 'a  b'],
    'anyURI': ['http://x.org/a b', 'a', ''],
    'dateTime': ['2024-02-29T23:59:59Z', '2024-02-29T24:00:00', '2024-01-01T00:00:00.000+14:00'],
    'date': ['2024-02-29', '2024-02-30', '-0001-01-01', '2024-01-01Z'],
    'time': ['23:59:59', '24:00:00', '12:00:00.10'],
    'duration': ['P1Y', 'PT0S', '-P1DT2H', 'P0Y0M'],
    'dayTimeDuration': ['PT90M', 'P1D'],
    'yearMonthDuration': ['P13M'],
    'gYear': ['2024', '-0044'],
    'gMonthDay': ['--02-29'],
    'hexBinary': ['0fb8', '0FB8', ''],
    'base64Binary': ['YQ==', ''],
    'language': ['en', 'EN-us'],
    'Name': ['a:b'],
    'NCName': ['a'],
    'NMTOKEN': ['1a'],
}
LITERALS = [
    *(Literal(text, XSD + name) for name, texts in ODD.items() for text in texts),
    *(Literal(text, RDF + 'langString', tag) for text in ('a', '', '7') for tag in ('en', 'de-at')),
    *(Literal(text, RDFS + 'Literal') for text in ('a', '1')),
    *(Literal(text, RDF + 'PlainLiteral') for text in ('a@en', 'b')),
    *(Literal(text, RDF + 'XMLLiteral') for text in ('<a/>', '<b x="1">c</b>')),
    *(Literal(text, f'{IRI}#own') for text in ('1', '01', 'x')),
    *(Literal(text, 'http://www.w3.org/2002/07/owl#real') for text in ('1.0', '1', '1e3')),
    *(Literal(text, 'http://www.w3.org/2002/07/owl#rational') for text in ('1/2', '2/4')),
    *(Literal(f'{number:03}', XSD + 'integer') for number in range(60)),
    *(Literal(f'{number / 7:.3f}', XSD + 'decimal') for number in range(10)),
]


def test_two_hundred_odd_literals_come_back_as_they_were_written(file: File) -> None:
    assert len(LITERALS) > 200
    facts = [
        DataPropertyAssertion(f'{IRI}#d', f'{IRI}#i{number}', literal)
        for number, literal in enumerate(LITERALS)
    ]
    file.change(facts)
    found = {axiom.subject: axiom for axiom in file.reopen()}  # type: ignore[attr-defined]
    assert [fact for fact in facts if found.get(fact.subject) != fact] == []
    file.change(removed=facts)
    assert file.left() == []


def test_owlready2_reads_an_odd_number_as_a_number(tmp_path: Path, file: File) -> None:
    for name, text in (('a', '007'), ('b', '+5')):
        file.change(
            [DataPropertyAssertion(f'{IRI}#d', f'{IRI}#{name}', Literal(text, XSD + 'long'))]
        )
    file._file.close()
    world = owlready2.World(filename=str(tmp_path / 'o.sqlite3'))
    assert (world[f'{IRI}#a'].d, world[f'{IRI}#b'].d) == ([7], [5])
    world.close()


@pytest.mark.parametrize('path', DOCUMENTS, ids=lambda path: path.stem)
def test_a_document_goes_through_a_file_and_leaves_nothing_behind(path: Path, file: File) -> None:
    axioms = read_ontology(path, IRI).axioms
    file.change(axioms)
    first = file.reopen()
    lost = plainly(axioms) - set(first)
    assert len(lost) <= sum(len(getattr(axiom, 'classes', ())) > 2 for axiom in lost), lost
    # What comes of that stays as it is.
    second = file.reopen()
    assert set(first) == set(second)
    draw = random.Random(1)
    left = list(dict.fromkeys(second))
    draw.shuffle(left)
    while left:
        part, left = left[: len(left) // 3 + 1], left[len(left) // 3 + 1 :]
        file.change(removed=part)
        assert set(file.reopen()) == set(left)
    assert file.left() == []


def test_an_axiom_of_a_large_file_is_removed_by_its_quads(file: File) -> None:
    rooms = [f'{IRI}#R{number}' for number in range(2000)]
    each = ObjectSomeValuesFrom(f'{IRI}#hasDoor', f'{IRI}#DOOR')
    apart = DifferentIndividuals(frozenset(rooms))
    below = SubClassOf(f'{IRI}#ROOM', each)
    file.change([*(ClassAssertion(f'{IRI}#ROOM', room) for room in rooms), apart, below])
    file.reopen()
    changed = file.db.total_changes
    file.change(removed=[below])
    assert file.db.total_changes - changed < 10
    file.change(removed=[apart])
    assert plainly(file.reopen()) == {ClassAssertion(f'{IRI}#ROOM', room) for room in rooms}


def test_what_is_said_of_an_axiom_goes_before_and_after_it(file: File) -> None:
    label = f'{RDFS}comment'
    room, door, hall = (f'{IRI}#{name}' for name in ('ROOM', 'DOOR', 'Hall'))
    for base in (
        SubClassOf(room, ObjectSomeValuesFrom(f'{IRI}#p', door)),
        SubClassOf(room, door),
        ClassAssertion(room, hall),
        DifferentIndividuals(frozenset((hall, room, door))),
    ):
        note = AxiomAnnotation(base, ((label, Literal('why')),))
        for first, second in ((base, note), (note, base)):
            file.change([base, note])
            assert set(file.reopen()) == {base, note}
            file.change(removed=[first])
            file.change(removed=[second])
            assert file.left() == [], (base, first)


def test_an_individual_without_a_name_keeps_its_label(file: File) -> None:
    facts = [
        ClassAssertion(f'{IRI}#ROOM', '_:somebody'),
        ClassAssertion(f'{IRI}#ROOM', '_:b1'),
        AnnotationAssertion(f'{RDFS}label', '_:somebody', Literal('x')),
        SubClassOf(f'{IRI}#ROOM', ObjectSomeValuesFrom(f'{IRI}#p', f'{IRI}#DOOR')),
    ]
    file.change(facts)
    assert set(file.reopen()) == set(facts)
    file.change(removed=facts[:2])
    assert set(file.reopen()) == set(facts[2:])


def test_nothing_is_known_of_what_was_rolled_back(file: File) -> None:
    axiom = SubClassOf(f'{IRI}#ROOM', ObjectSomeValuesFrom(f'{IRI}#p', f'{IRI}#DOOR'))
    names = file.ontology._names
    file.db.execute('BEGIN')
    file.ontology.add(axiom)
    file.db.execute('ROLLBACK')
    for part in (file.ontology, names):
        part.rolled_back()
    assert file.left() == []
    file.change([axiom])
    assert file.reopen() == [axiom]
    file.db.execute('BEGIN')
    file.ontology.remove(axiom)
    file.db.execute('ROLLBACK')
    file.ontology.rolled_back()
    file.change(removed=[axiom])
    assert file.left() == []
