"""Every directive: its effect, its exact answer, its exit codes."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_ontology.armor.directives.table import TABLE
from surveillance_ontology.armor.service import ArmorService

from .seven_rooms import IRI, ONTOLOGY, Ask, asker, names


def iri(name: str) -> str:
    return f'<{IRI}#{name}>'


# --- dispatch and exit codes ---


def test_commands_are_known_in_any_letter_case(ask: Ask) -> None:
    assert ask('add Ind class', 'X', 'ROOM').success
    assert ask('query IND', 'X').queried_objects == [iri('LOCATION'), iri('ROOM')]


def test_no_reference_name_is_201_whatever_the_command(ask: Ask) -> None:
    for words in ('GET ALL REFS', 'LOG SCREEN ON', 'QUERY IND', '', 'NO SUCH THING'):
        answer = ask(words, reference='')
        assert (answer.success, answer.exit_code) == (False, 201)
        assert answer.error_description == 'Invalid request. No reference name specified.'
        assert not answer.is_consistent


def test_no_command_is_202(ask: Ask) -> None:
    answer = ask('')
    assert (answer.success, answer.exit_code) == (False, 202)
    assert answer.error_description == 'Invalid request. No command specified.'


@pytest.mark.parametrize(
    'words',
    [
        'CREATE',
        'SWRL',
        'ADD DATAPROP',
        'ADD OBJECTPROP',
        'ADD DATAPROP DATAPROP',
        'QUERY DATAPROP CLASS',
    ],
)
def test_unknown_combinations_are_205(ask: Ask, words: str) -> None:
    answer = ask(words, 'a', 'b')
    assert (answer.success, answer.exit_code) == (False, 205)
    assert answer.error_description.startswith(
        'Malformed command. No Command/Specs combination match found. '
        'Please check your service requests and retry.'
    )


def test_invalid_command_is_there_for_tests_of_clients(ask: Ask) -> None:
    answer = ask('INVALID COMMAND')
    assert (answer.exit_code, answer.error_description) == (205, 'Invalid command.')


def test_an_unknown_reference_is_named_with_those_there_are(ask: Ask) -> None:
    for words in ('QUERY IND', 'ADD IND', 'REASON', 'SAVE', 'UNMOUNT', 'QUERY SPARQL'):
        answer = ask(words, 'x', reference='other')
        assert (answer.success, answer.exit_code) == (False, 205)
        assert answer.error_description == "unknown reference 'other'; loaded: 'map'"


@pytest.mark.parametrize('directive', TABLE.values(), ids=lambda d: d.words)
def test_too_few_arguments_are_counted_and_named(ask: Ask, directive: object) -> None:
    required = directive.required  # type: ignore[attr-defined]
    if required == 0:
        return
    words = f'{directive.command} {directive.primary} {directive.secondary}'  # type: ignore[attr-defined]
    answer = ask(words, *['x'] * (required - 1))
    assert (answer.success, answer.exit_code) == (False, 205)
    assert f'got {required - 1}' in answer.error_description
    assert directive.signature in answer.error_description  # type: ignore[attr-defined]


def test_wrong_arguments_are_named_with_what_was_expected(ask: Ask) -> None:
    cases = [
        (('ADD DATAPROP IND', 'p', 'i', 'LONG', 'x'), "argument value 'x' is not a whole number"),
        (
            ('ADD CARDINALITY MIN', 'A', 'p', 'two', 'B'),
            "argument cardinality 'two' is not a number",
        ),
        (('ADD IND', 'a b'), "argument individual 'a b' has the character ' '"),
        (('QUERY IND CLASS', ''), 'argument class is empty'),
        (('QUERY SPARQL', 'SELECT * {?a ?b ?c}', 'soon'), "argument timeout 'soon'"),
        (('QUERY EXPLAIN', 'URGENT'), 'argument fact'),
    ]
    for (words, *args), expected in cases:
        answer = ask(words, *args)
        assert (answer.success, answer.exit_code) == (False, 205)
        assert expected in answer.error_description


def test_unsupported_types_are_101(ask: Ask) -> None:
    added = ask('ADD DATAPROP IND', 'p', 'i', 'DATE', 'x')
    assert (added.success, added.exit_code) == (True, 101)
    assert added.error_description == 'Value type DATE not supported. pnot added to i.'
    removed = ask('REMOVE DATAPROP IND', 'p', 'i', 'DATE', 'x')
    assert (removed.success, removed.exit_code) == (True, 101)
    assert removed.error_description == 'Value type DATE not supported. pnot removed from i.'
    replaced = ask('REPLACE DATAPROP IND', 'p', 'i', 'DATE', 'x', 'y')
    assert (replaced.success, replaced.exit_code) == (False, 101)
    assert replaced.error_description == 'Value type DATE not supported. pnot replaced from i.'
    torn = ask('ADD DATAPROP IND', 'p', 'i', 'A\nB', 'x')
    assert torn.error_description == "Value type 'A\\nB' not supported. pnot added to i."
    assert ask('QUERY DATAPROP IND', 'p', 'i').queried_objects == []


# --- manipulations ---


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


# --- queries ---


def test_restrictions_have_armors_form(ask: Ask) -> None:
    assert ask('QUERY CLASS RESTRICTIONS', 'CORRIDOR').queried_objects == [
        '[C-DEFINITION_CLASS : CORRIDOR -> (LOCATION), '
        'C-DEFINITION_MIN_OBJECT : CORRIDOR -> hasDoor 2(DOOR), '
        'C-DEFINITION_CLASS : CORRIDOR -> (DOOR)]'
    ]
    assert (
        'C-DEFINITION_SOME_OBJECT : ROOM -> hasDoor(DOOR)'
        in (ask('QUERY CLASS RESTRICTIONS', 'ROOM').queried_objects[0])
    )
    assert ask('QUERY CLASS RESTRICTIONS', 'LOCATION').queried_objects == [
        '[C-DEFINITION_EXACT_DATA : LOCATION -> visitedAt 1(long)]'
    ]


def test_an_empty_answer_says_what_is_unknown(ask: Ask) -> None:
    known = ask('QUERY IND CLASS', 'URGENT')
    assert (known.success, known.queried_objects, known.error_description) == (True, [], '')
    for words, args, unknown in (
        ('QUERY IND CLASS', ('URGENTLY',), f'class {iri("URGENTLY")}'),
        ('QUERY OBJECTPROP IND', ('isInn', 'Robot1'), f'object property {iri("isInn")}'),
        ('QUERY DATAPROP IND', ('now', 'Robot2'), f'individual {iri("Robot2")}'),
        ('QUERY IND OBJECTPROP', ('Robot2',), f'individual {iri("Robot2")}'),
    ):
        answer = ask(words, *args)
        assert (answer.success, answer.exit_code, answer.queried_objects) == (True, 0, [])
        assert answer.error_description == f'map has no {unknown}'


def test_explanations(ask: Ask) -> None:
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579720')
    sentence, tree = ask('QUERY EXPLAIN', 'URGENT(R3)').queried_objects
    assert sentence.startswith('R3 is URGENT because')
    assert '1665579740' in sentence
    assert '1665579720' in sentence
    assert 'asserted' in tree
    refused = ask('QUERY EXPLAIN', 'URGENT(R4)')
    assert (refused.success, refused.exit_code) == (False, 0)
    assert ask('QUERY EXPLAIN INCONSISTENCY').queried_objects == []
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '5')
    sentence, tree = ask('QUERY EXPLAIN INCONSISTENCY').queried_objects
    assert 'R3' in sentence
    assert tree


def test_facts_by_pattern(ask: Ask) -> None:
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579720')
    ask('ADD OBJECTPROP IND', 'isIn', 'Robot1', 'R3')
    assert ask('QUERY FACT', 'URGENT(?)').queried_objects == ['URGENT(R3)']
    assert ask('QUERY FACT', 'isIn(Robot1, ?)').queried_objects == ['isIn(Robot1, R3)']
    assert ask('QUERY FACT', 'isIn(?, R3)').queried_objects == ['isIn(Robot1, R3)']
    assert ask('QUERY FACT', 'visitedAt(?, ?)').queried_objects == [
        'visitedAt(R3, "1665579720"^^xsd:long)'
    ]
    assert ask('QUERY FACT', 'ROBOT(Robot1)').queried_objects == ['ROBOT(Robot1)']
    assert ask('QUERY FACT', 'URGENT(R4)').queried_objects == []
    assert ask('QUERY FACT', 'URGENT(?)', 'true').queried_objects == []
    assert ask('QUERY FACT', f'isIn(<{IRI}#Robot1>, ?)').queried_objects == ['isIn(Robot1, R3)']
    assert ask('QUERY FACT', f'<{IRI}#isIn>(?, {IRI}#R3)').queried_objects == ['isIn(Robot1, R3)']
    for pattern in ('owl:Thing(R3)', 'owl:Thing(?)'):
        assert 'owl:Thing(R3)' in ask('QUERY FACT', pattern).queried_objects
    wrong = ask('QUERY FACT', 'ROOM(a#b)')
    assert (wrong.success, wrong.exit_code) == (False, 205)
    assert wrong.error_description.startswith(
        "QUERY FACT: argument pattern 'a#b' has the character"
    )
    assert ask('QUERY FACT', '?(Robot1, ?)', 'true').queried_objects == [
        'isIn(Robot1, R3)',
        'now(Robot1, "1665579740"^^xsd:long)',
        'urgencyThreshold(Robot1, "7"^^xsd:long)',
    ]


def test_names_that_a_fact_could_be_misread_by_stand_in_brackets(ask: Ask) -> None:
    for name in ('A,B', 'C(1)'):
        ask('ADD IND CLASS', name, 'KIND')
    found = ask('QUERY FACT', 'KIND(?)').queried_objects
    assert found == ['KIND(<A,B>)', 'KIND(<C(1)>)']
    for fact in found:
        assert ask('QUERY FACT', fact).queried_objects == [fact]
        assert ask('QUERY EXPLAIN', fact).success


# --- buffering and consistency ---


def loaded(service: ArmorService, buffered: str, lazy: str) -> Ask:
    ask = asker(service)
    assert ask('LOAD FILE', ONTOLOGY, IRI, buffered, 'PELLET', lazy).success
    return ask


def test_buffered_changes_show_after_apply(service: ArmorService) -> None:
    ask = loaded(service, 'True', 'false')
    ask('ADD IND CLASS', 'X', 'DOOR')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == []
    ask('APPLY')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X']


def test_reason_applies_what_waits(service: ArmorService) -> None:
    ask = loaded(service, 'true', 'true')
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    ask('REASON')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R3']


def test_with_a_buffered_reasoner_only_derived_facts_wait(service: ArmorService) -> None:
    ask = loaded(service, 'false', 'TRUE')
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    assert ask('QUERY DATAPROP IND', 'visitedAt', 'R3').queried_objects == ['"1"^^xsd:long']
    assert names(ask('QUERY IND CLASS', 'URGENT')) == []
    ask('REASON')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R3']
    ask('REPLACE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579740', '1')
    values = ask('QUERY DATAPROP IND', 'visitedAt', 'R3').queried_objects
    assert values == ['"1665579740"^^xsd:long'], 'a retracted value never comes back'


@pytest.mark.parametrize(
    ('buffered', 'lazy'), [('false', 'false'), ('true', 'false'), ('true', 'true')]
)
def test_an_inconsistency_ends_with_its_cause(
    service: ArmorService, buffered: str, lazy: str
) -> None:
    ask = loaded(service, buffered, lazy)
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579740')
    ask('REASON')
    ask('REPLACE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '6', '4')
    answer = ask('REASON')
    assert (answer.success, answer.is_consistent) == (True, False)
    query = ask('QUERY DATAPROP IND', 'visitedAt', 'R3')
    assert (query.success, query.is_consistent, len(query.queried_objects)) == (True, False, 2)
    ask('REMOVE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '6')
    answer = ask('REASON')
    assert (answer.success, answer.is_consistent) == (True, True)


def test_a_class_of_which_nothing_else_is_known_is_below_owl_thing_at_once(ask: Ask) -> None:
    before = names(ask('QUERY CLASS CLASS', 'owl:Thing'))
    ask('ADD CLASS', 'KITCHEN')
    below = names(ask('QUERY CLASS CLASS', 'owl:Thing'))
    assert sorted({*below} - {*before}) == ['KITCHEN']
    ask('REMOVE CLASS', 'KITCHEN')
    assert names(ask('QUERY CLASS CLASS', 'owl:Thing')) == before


def test_an_ill_formed_value_can_be_retracted_but_not_added(
    service: ArmorService, tmp_path: Path
) -> None:
    """Files of others hold such values; a client removes what an answer shows."""
    (tmp_path / 'x.ttl').write_text(
        f'@prefix : <{IRI}#> . @prefix xsd: <http://www.w3.org/2001/XMLSchema#> .\n'
        ':p a <http://www.w3.org/2002/07/owl#DatatypeProperty> .\n:R1 :p "abc"^^xsd:integer .\n'
    )
    ask = asker(service)
    assert ask('LOAD FILE', 'x.ttl', IRI, 'false', '', 'false').success
    shown = ask('QUERY DATAPROP IND', 'p', 'R1').queried_objects
    assert shown == ['"abc"^^xsd:integer']
    assert ask('ADD DATAPROP IND', 'p', 'R1', 'INT', shown[0]).exit_code == 205
    assert ask('REMOVE DATAPROP IND', 'p', 'R1', 'INT', shown[0]).success
    assert ask('QUERY DATAPROP IND', 'p', 'R1').queried_objects == []


def test_names_and_languages_survive_saving_and_loading(ask: Ask) -> None:
    ask('ADD DATAPROP IND', 'label', 'R1', 'STRING', '"Raum"@DE-at')
    ask('ADD DATAPROP IND', 'label', 'R%25', 'STRING', '"quoted"')
    before = [ask('QUERY DATAPROP IND', 'label', name).queried_objects for name in ('R1', 'R%25')]
    assert before == [['"Raum"@de-at'], ['"\\"quoted\\""^^xsd:string']]
    assert ask('SAVE', 'map.owl').success
    assert ask('LOAD FILE', 'map.owl', IRI, 'false', '', 'false', reference='again').success
    assert before == [
        ask('QUERY DATAPROP IND', 'label', name, reference='again').queried_objects
        for name in ('R1', 'R%25')
    ]
    assert ask('REMOVE DATAPROP IND', 'label', 'R1', 'STRING', '"Raum"@DE-AT').success
    assert ask('QUERY DATAPROP IND', 'label', 'R1').queried_objects == []
