"""Dispatch of directives, exit codes, buffering and consistency."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.directives.table import TABLE
from armor_service.service import ArmorService

from .seven_rooms import IRI, ONTOLOGY, Ask, asker, iri, names


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


def test_unknown_names_and_commands_are_answered_with_the_nearest(ask: Ask) -> None:
    for words, args, there in (
        ('QUERY IND CLASS', ('ROM',), 'ROOM'),
        ('QUERY OBJECTPROP IND', ('hasdoor', 'R1'), 'hasDoor'),
        ('QUERY DATAPROP IND', ('visitdAt', 'R1'), 'visitedAt'),
        ('QUERY CLASS CLASS', ('LOCATIONS',), 'LOCATION'),
    ):
        answer = ask(words, *args)
        assert answer.success
        assert f'(there is <{IRI}#{there}>)' in answer.error_description
    assert ask('QUERRY IND CLASS', 'ROOM').error_description.endswith("expected 'QUERY'.")
    wrong = ask('QUERY CLASS RESTRICTION', 'ROOM').error_description
    assert wrong.endswith("expected 'QUERY CLASS RESTRICTIONS'.")


def test_a_subclass_shows_before_the_next_reasoning(service: ArmorService) -> None:
    ask = loaded(service, 'false', 'true')
    ask('ADD CLASS CLASS', 'GARAGE', 'ROOM')
    ask('ADD CLASS', 'CELLAR')
    assert 'GARAGE' in names(ask('QUERY CLASS CLASS', 'LOCATION'))
    assert {'GARAGE', 'CELLAR'} <= {*names(ask('QUERY CLASS CLASS', 'owl:Thing'))}


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


def test_a_manipulation_that_has_nothing_to_change_says_so(ask: Ask) -> None:
    for words, args in (
        ('DISJOINT IND', ('R1',)),
        ('DISJOINT CLASS', ('A', 'A')),
        ('DISJOINT IND CLASS', ('NOTHING_IN_IT',)),
        ('MAKE EQUIVALENT CLASS', ('UNKNOWN',)),
    ):
        answer = ask(words, *args)
        assert (answer.success, answer.error_description) == (True, f'{words}: nothing to change')
    assert ask('DISJOINT IND', 'R1', 'R2').error_description == ''
