"""What the open world withholds, what closes it, and names that were probably not meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService

from .seven_rooms import IRI, asker, build_seven_rooms, iri, names

DEFINITIONS = """
Prefix(:=<http://bnc/exp-rob-lab/2022-23#>)
Ontology(<urn:d>
EquivalentClasses(:DeadEnd ObjectIntersectionOf(:LOCATION ObjectExactCardinality(1 :hasDoor)))
EquivalentClasses(:Busy ObjectIntersectionOf(:LOCATION ObjectComplementOf(:Free)))
EquivalentClasses(:Inner ObjectIntersectionOf(:LOCATION ObjectAllValuesFrom(:hasDoor :Inside)))
)"""


@pytest.fixture
def patrol(tmp_path: Path) -> ArmorService:
    """Provide the seven rooms with classes that the open world withholds."""
    from owl_reasoner.documents.reading import read_ontology

    service = ArmorService(Settings(tmp_path), lambda _: None, lambda _: None)
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    ref = service.workspace.references.find('map')
    ref.kb.change(read_ontology(DEFINITIONS.encode(), IRI).axioms)
    ref.reason()
    return service


@pytest.mark.parametrize(
    ('fact', 'sentence', 'close'),
    [
        (
            'DeadEnd(R1)',
            'nothing says that R1 has no other hasDoor: state it with `max 1`, or close hasDoor '
            'for R1',
            ('CLOSE OBJECTPROP IND', 'hasDoor', 'R1'),
        ),
        (
            'Busy(R1)',
            'nothing says that R1 is not Free: state it, or close Free',
            ('CLOSE CLASS IND', 'Free', 'R1'),
        ),
    ],
)
def test_the_definition_and_what_would_close_it_are_named(
    patrol: ArmorService, fact: str, sentence: str, close: tuple[str, ...]
) -> None:
    ask = asker(patrol)
    lines = ask('QUERY EXPLAIN ABSENCE', fact).queried_objects
    assert ' would follow from ' in lines[0]
    assert sentence in lines[0]
    words, *args = close
    assert lines[1] == f'{sentence} ({words} {" ".join(args)})'
    assert ask(words, *args).success
    ask('REASON')
    predicate = fact.partition('(')[0]
    assert names(ask('QUERY IND CLASS', predicate)) == ['R1']
    assert ask('QUERY EXPLAIN ABSENCE', fact).error_description == f'{fact} holds in map'


def test_a_fact_that_is_missing_is_told_beside_what_is_open(patrol: ArmorService) -> None:
    lines = asker(patrol)('QUERY EXPLAIN ABSENCE', 'DeadEnd(E)').queried_objects
    assert lines[1] == 'E has 2 hasDoor, at most 1 may be'
    lines = asker(patrol)('QUERY EXPLAIN ABSENCE', 'DeadEnd(Robot1)').queried_objects
    assert 'Robot1 is not known to be LOCATION' in ' '.join(lines)


def test_a_property_and_a_class_are_closed_for_all(patrol: ArmorService) -> None:
    ask = asker(patrol)
    ask('ADD IND CLASS', 'R2', 'Free')
    assert ask('CLOSE OBJECTPROP', 'hasDoor').success
    assert ask('CLOSE CLASS', 'Free').success
    assert ask('REASON').is_consistent
    assert names(ask('QUERY IND CLASS', 'DeadEnd')) == ['R1', 'R2', 'R3', 'R4']
    assert names(ask('QUERY IND CLASS', 'Busy')) == ['C1', 'C2', 'E', 'R1', 'R3', 'R4']
    assert ask('CLOSE CLASS IND', 'Free', 'R2').error_description.endswith('nothing to change')


MISTYPED = [
    (('ADD OBJECTPROP IND', 'isInn', 'Robot1', 'R1'), 'isInn', 'isIn'),
    (('ADD IND CLASS', 'R9', 'ROMM'), 'ROMM', 'ROOM'),
    (('SET DATAPROP IND', 'visitdAt', 'R1', 'LONG', '1'), 'visitdAt', 'visitedAt'),
]


@pytest.mark.parametrize(('directive', 'wrong', 'right'), MISTYPED)
def test_a_name_like_a_known_one_is_named_with_it(
    patrol: ArmorService, directive: tuple[str, ...], wrong: str, right: str
) -> None:
    answer = asker(patrol)(*directive)
    assert answer.success, "ARMOR's clients go on"
    assert f'{iri(wrong)} is new; there is {iri(right)}' in answer.error_description
    again = asker(patrol)(*directive[:-1], directive[-1] if wrong != 'ROMM' else 'ROMM')
    assert 'is new' not in again.error_description
    assert asker(patrol)('ADD IND CLASS', 'R9', 'Kitchen').error_description == ''


def test_a_property_of_one_kind_is_not_taken_for_the_other_in_silence(
    patrol: ArmorService,
) -> None:
    answer = asker(patrol)('ADD DATAPROP IND', 'isIn', 'R1', 'INT', '3')
    assert answer.success
    assert 'is used as a data property and is an object property' in answer.error_description


def test_a_strict_service_refuses_both(patrol: ArmorService, tmp_path: Path) -> None:
    strict = ArmorService(Settings(tmp_path, strict=True), lambda _: None, lambda _: None)
    ask = asker(strict)
    build_seven_rooms(ArmorClient('c', 'map', InProcessTransport(strict)), True, True)
    for directive, wrong, right in MISTYPED:
        answer = ask(*directive)
        assert (answer.success, answer.exit_code) == (False, 205)
        assert f'{iri(wrong)}; there is {iri(right)}' in answer.error_description
    assert 'forbids' in ask('ADD DATAPROP IND', 'isIn', 'R1', 'INT', '3').error_description
    assert not ask('ADD IND CLASS', 'x', 'Kitchen').success
    assert ask('ADD CLASS', 'Kitchen').success, 'a class is made by saying so'
    assert ask('ADD IND CLASS', 'x', 'Kitchen').success
