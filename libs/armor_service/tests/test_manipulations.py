"""The directives that change an ontology: effect and exact answer."""

from __future__ import annotations

import pytest

from armor_service.service import ArmorService

from .seven_rooms import IRI, ONTOLOGY, Ask, iri, names


def test_individuals(ask: Ask) -> None:
    ask('ADD IND', 'X')
    answer = ask('QUERY IND', 'X')
    assert (answer.success, answer.exit_code, answer.queried_objects) == (False, 0, [])
    ask('ADD IND CLASS', 'X', 'DOOR')
    assert names(ask('QUERY IND', 'X')) == ['DOOR']
    assert 'X' in names(ask('QUERY IND CLASS', 'DOOR'))
    ask('REMOVE IND CLASS', 'X', 'DOOR')
    assert not ask('QUERY IND', 'X').success


def test_classes(ask: Ask) -> None:
    ask('ADD CLASS', 'KITCHEN')
    ask('ADD CLASS CLASS', 'KITCHEN', 'ROOM')
    ask('ADD IND CLASS', 'K', 'KITCHEN')
    assert names(ask('QUERY CLASS IND', 'K', 'false')) == ['KITCHEN', 'LOCATION', 'ROOM']
    assert ask('QUERY CLASS IND', 'K', 'TRUE').queried_objects == ['KITCHEN']
    assert names(ask('QUERY CLASS IND', 'K')) == ['KITCHEN', 'LOCATION', 'ROOM']
    below = ask('QUERY CLASS CLASS', 'LOCATION').queried_objects
    assert below == sorted(
        [iri('CORRIDOR'), iri('KITCHEN'), iri('ROOM'), iri('URGENT'), 'owl:Nothing']
    )
    ask('REMOVE CLASS CLASS', 'KITCHEN', 'ROOM')
    assert names(ask('QUERY IND', 'K')) == ['KITCHEN']
    ask('REMOVE CLASS', 'KITCHEN')
    assert not ask('QUERY IND', 'K').success


def test_data_properties(ask: Ask) -> None:
    def values() -> list[str]:
        return ask('QUERY DATAPROP IND', 'size', 'X').queried_objects

    ask('ADD DATAPROP IND', 'size', 'X', 'LONG', '5')
    ask('ADD DATAPROP IND', 'size', 'X', 'STRING', 'big "one"')
    assert values() == ['"5"^^xsd:long', '"big \\"one\\""^^xsd:string']
    ask('REMOVE DATAPROP IND', 'size', 'X', 'INT', '5')
    assert '"5"^^xsd:long' in values(), 'another datatype is another literal'
    ask('REMOVE DATAPROP IND', 'size', 'X', 'STRING', '"big \\"one\\""^^xsd:string')
    ask('REPLACE DATAPROP IND', 'size', 'X', 'LONG', '6', '"5"^^xsd:long')
    assert values() == ['"6"^^xsd:long']
    ask('REPLACE DATAPROP IND', 'size', 'X', 'LONG', '7', '99')
    assert values() == ['"6"^^xsd:long', '"7"^^xsd:long'], 'a wrong old value leaves both'
    assert ask('QUERY IND DATAPROP', 'X').queried_objects == [iri('size')]


def test_set_leaves_one_value_whatever_waits(ask: Ask) -> None:
    ask('LOAD FILE', ONTOLOGY, IRI, 'true', 'PELLET', 'false')  # buffers from now on
    for directive in (
        ('ADD OBJECTPROP IND', 'isIn', 'Robot1', 'A'),
        ('SET OBJECTPROP IND', 'isIn', 'Robot1', 'B'),
        ('SET OBJECTPROP IND', 'isIn', 'Robot1', 'C'),
        ('SET DATAPROP IND', 'now', 'Robot1', 'LONG', '1'),
        ('RENAME IND', 'Robot1', 'Robot2'),
        ('SET DATAPROP IND', 'now', 'Robot2', 'LONG', '2'),
    ):
        assert ask(*directive).success
    waits = ask('MAKE EQUIVALENT CLASS', 'KITCHEN').error_description
    assert waits == 'MAKE EQUIVALENT CLASS: nothing to change; 6 changes wait for APPLY'
    assert names(ask('QUERY OBJECTPROP IND', 'isIn', 'Robot1')) == []
    ask('APPLY')
    assert names(ask('QUERY OBJECTPROP IND', 'isIn', 'Robot2')) == ['C']
    assert ask('QUERY DATAPROP IND', 'now', 'Robot2').queried_objects == ['"2"^^xsd:long']


def test_a_value_is_retracted_however_it_is_written(ask: Ask) -> None:
    """Files write 0.50 and 1 where directives write 0.5 and true; the type has to be the same."""
    for kind, written, value in (
        ('FLOAT', '"0.50"^^xsd:float', '0.5'),
        ('BOOL', '"1"^^xsd:boolean', 'true'),
        ('LONG', '"+7"^^xsd:long', '7'),
    ):
        ask('ADD DATAPROP IND', 'p', 'X', kind, written)
        assert ask('QUERY DATAPROP IND', 'p', 'X').queried_objects == [written]
        ask('REMOVE DATAPROP IND', 'p', 'X', kind, value)
        assert ask('QUERY DATAPROP IND', 'p', 'X').queried_objects == []
    ask('ADD DATAPROP IND', 'p', 'X', 'LONG', '"+7"^^xsd:long')
    ask('REMOVE DATAPROP IND', 'p', 'X', 'INTEGER', '7')
    ask('REPLACE DATAPROP IND', 'p', 'X', 'LONG', '8', '7')
    assert ask('QUERY DATAPROP IND', 'p', 'X').queried_objects == ['"8"^^xsd:long']


def test_object_properties(ask: Ask) -> None:
    ask('ADD OBJECTPROP IND', 'near', 'A', 'B')
    ask('ADD OBJECTPROP IND', 'near', 'A', iri('C'))
    assert ask('QUERY OBJECTPROP IND', 'near', 'A').queried_objects == [iri('B'), iri('C')]
    ask('REPLACE OBJECTPROP IND', 'near', 'A', 'D', 'B')
    assert names(ask('QUERY OBJECTPROP IND', 'near', 'A')) == ['C', 'D']
    ask('REMOVE OBJECTPROP IND', 'near', 'A', 'C')
    ask('REMOVE OBJECTPROP IND', 'near', 'A', 'never')
    assert names(ask('QUERY OBJECTPROP IND', 'near', 'A')) == ['D']
    assert ask('QUERY IND OBJECTPROP', 'A').queried_objects == [iri('near')]


def test_set_leaves_one_value_whatever_was_there(ask: Ask) -> None:
    for other in ('A', 'B'):
        ask('ADD OBJECTPROP IND', 'near', 'X', other)
        ask('ADD DATAPROP IND', 'p', 'X', 'LONG', '1' if other == 'A' else '2')
    assert ask('SET OBJECTPROP IND', 'near', 'X', 'C').success
    assert ask('SET OBJECTPROP IND', 'near', 'X', 'C').success
    assert names(ask('QUERY OBJECTPROP IND', 'near', 'X')) == ['C']
    assert ask('SET DATAPROP IND', 'p', 'X', 'LONG', '2').success
    assert ask('QUERY DATAPROP IND', 'p', 'X').queried_objects == ['"2"^^xsd:long']
    refused = ask('SET DATAPROP IND', 'p', 'X', 'QUATERNION', '2')
    assert (refused.success, refused.exit_code) == (False, 101)


def test_renaming_changes_the_name_everywhere_and_merges(ask: Ask) -> None:
    ask('ADD IND CLASS', 'A', 'KIND')
    ask('ADD OBJECTPROP IND', 'near', 'A', 'B')
    ask('ADD DATAPROP IND', 'size', 'A', 'LONG', '1')
    ask('ADD DATAPROP IND', 'size', 'Z', 'LONG', '2')
    ask('RENAME IND', 'A', 'Z')
    ask('RENAME CLASS', 'KIND', 'SORT')
    ask('RENAME OBJECTPROP', 'near', 'close')
    ask('RENAME DATAPROP', 'size', 'extent')
    assert names(ask('QUERY IND', 'Z')) == ['SORT']
    assert names(ask('QUERY OBJECTPROP IND', 'close', 'Z')) == ['B']
    assert ask('QUERY DATAPROP IND', 'extent', 'Z').queried_objects == [
        '"1"^^xsd:long',
        '"2"^^xsd:long',
    ]
    assert ask('QUERY DATAPROP IND', 'size', 'A').queried_objects == []


def test_removing_an_individual_keeps_the_others_apart(ask: Ask) -> None:
    for door in ('D1', 'D2', 'D3'):
        ask('ADD OBJECTPROP IND', 'hasDoor', 'C', door)
    ask('ADD DATAPROP IND', 'visitedAt', 'C', 'LONG', '1')
    ask('DISJOINT IND', 'D1', 'D2', 'D3')
    ask('REMOVE IND', 'D3')
    assert names(ask('QUERY IND CLASS', 'CORRIDOR')) == ['C'], 'D1 and D2 are still two doors'


def test_disjoint_classes(ask: Ask) -> None:
    ask('DISJOINT CLASS', 'RED', 'GREEN', 'BLUE')
    ask('ADD IND CLASS', 'X', 'RED')
    assert ask('REASON').is_consistent
    assert not ask('ADD IND CLASS', 'X', 'BLUE').is_consistent
    ask('REMOVE IND CLASS', 'X', 'BLUE')
    for kind in ('CAT', 'DOG'):
        ask('ADD CLASS CLASS', kind, 'ANIMAL')
    ask('DISJOINT CLASS CLASS', 'ANIMAL')
    ask('ADD IND CLASS', 'Y', 'CAT')
    assert not ask('ADD IND CLASS', 'Y', 'DOG').is_consistent


def test_make_equivalent_turns_what_is_above_into_a_definition(ask: Ask) -> None:
    ask('ADD CLASS CLASS', 'HALL', 'LOCATION')
    for words in ('ADD CARDINALITY MIN', 'ADD MIN CARDINALITY'):
        assert ask(words, 'HALL', 'hasDoor', '3', 'DOOR').success
    doors = ('D1', 'D2', 'D3')
    for door in doors:
        ask('ADD OBJECTPROP IND', 'hasDoor', 'X', door)
    ask('ADD DATAPROP IND', 'visitedAt', 'X', 'LONG', '1')
    ask('DISJOINT IND', *doors)
    assert names(ask('QUERY IND CLASS', 'HALL')) == []
    ask('MAKE EQUIVALENT CLASS', 'HALL')
    assert names(ask('QUERY IND CLASS', 'HALL')) == ['X']
    (definition,) = ask('QUERY CLASS RESTRICTIONS', 'HALL').queried_objects
    assert 'C-DEFINITION_MIN_OBJECT : HALL -> hasDoor 3(DOOR)' in definition


def test_what_is_not_there_to_be_taken_away_is_named(ask: Ask) -> None:
    ask('ADD DATAPROP IND', 'size', 'X', 'INT', '1')
    for words, args, remark in (
        ('REMOVE DATAPROP IND', ('size', 'X', 'INT', '2'), 'was not asserted'),
        ('REPLACE DATAPROP IND', ('size', 'X', 'INT', '3', '2'), 'was not asserted'),
        ('REMOVE OBJECTPROP IND', ('near', 'X', 'Y'), 'was not asserted'),
        ('REMOVE IND', ('NOBODY',), f'map has no individual {iri("NOBODY")}'),
        ('RENAME CLASS', ('ROOMS', 'HALL'), f'map has no class {iri("ROOMS")}'),
    ):
        answer = ask(words, *args)
        assert (answer.success, answer.exit_code) == (True, 0), 'as ARMOR does'
        assert remark in answer.error_description
    assert ask('REMOVE DATAPROP IND', 'size', 'X', 'INT', '1').error_description == ''


@pytest.mark.parametrize(
    ('words', 'args', 'argument'),
    [
        ('ADD DATAPROP IND', ('rdfs:label', 'R1', 'STRING', 'x'), 'property'),
        ('SET OBJECTPROP IND', ('owl:Thing', 'R1', 'R2'), 'property'),
        ('ADD IND CLASS', ('R1', 'xsd:long'), 'class'),
        ('DISJOINT IND', ('R1', '<http://www.w3.org/2002/07/owl#Nothing>'), 'individual'),
        ('RENAME CLASS', ('ROOM', 'owl:Class'), 'new name'),
    ],
)
def test_words_of_owl_itself_are_no_names(
    ask: Ask, words: str, args: tuple[str, ...], argument: str
) -> None:
    answer = ask(words, *args)
    assert (answer.success, answer.exit_code) == (False, 205)
    assert f'argument {argument} ' in answer.error_description
    assert 'is a word of OWL itself' in answer.error_description


def test_the_classes_and_properties_that_owl_has_can_be_named(ask: Ask) -> None:
    assert ask('ADD IND CLASS', 'R1', 'owl:Thing').success
    assert ask('ADD CLASS CLASS', 'K', 'owl:Nothing').success
    assert ask('ADD OBJECTPROP IND', 'owl:topObjectProperty', 'R1', 'R2').success
    assert ask('REMOVE DATAPROP IND', 'rdfs:label', 'R1', 'STRING', 'x').success


def test_fewer_than_two_are_not_stated_to_be_apart(service: ArmorService, ask: Ask) -> None:
    kb = service.workspace.references.find('map').kb
    before = list(kb.axioms())
    for directive in (
        ('DISJOINT CLASS CLASS', 'DOOR'),
        ('DISJOINT CLASS', 'DOOR', 'DOOR'),
        ('DISJOINT IND CLASS', 'DOOR'),
        ('DISJOINT IND', 'D1', 'D1'),
    ):
        assert ask(*directive).success
        assert list(kb.axioms()) == before, directive
    assert ask('DISJOINT CLASS CLASS', 'LOCATION').success
    assert len(list(kb.axioms())) == len(before) + 1
