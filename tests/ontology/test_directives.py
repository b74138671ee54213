"""Every directive: its effect, its exact answer, its exit codes."""

from __future__ import annotations

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from surveillance_ontology.armor.protocol import DirectiveRequest
from surveillance_ontology.armor.service import ArmorService
from surveillance_ontology.armor.settings import DATA, Settings
from surveillance_ontology.armor.table import TABLE

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker, names


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
    assert ask('QUERY FACT', '?(Robot1, ?)', 'true').queried_objects == [
        'isIn(Robot1, R3)',
        'now(Robot1, "1665579740"^^xsd:long)',
        'urgencyThreshold(Robot1, "7"^^xsd:long)',
    ]


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


# --- references, mounting, files ---


def test_loading_again_keeps_the_reference_but_takes_the_first_flag(ask: Ask) -> None:
    ask('ADD IND CLASS', 'X', 'DOOR')
    again = ask('LOAD FILE', ONTOLOGY, IRI, 'true', 'PELLET', 'false')
    assert again.success
    assert 'loaded already' in again.error_description
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X']
    ask('ADD IND CLASS', 'Y', 'DOOR')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X'], 'buffered now'
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']


def test_several_references_do_not_mix(ask: Ask) -> None:
    assert ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference='other').success
    ask('ADD IND CLASS', 'X', 'DOOR', reference='other')
    assert names(ask('QUERY IND CLASS', 'DOOR')) == []
    assert ask('GET ALL REFS').queried_objects == ['map', 'other']
    assert ask('DROP', reference='other').success
    assert ask('DROP', reference='other').success
    assert ask('GET ALL REFS').queried_objects == ['map']


def test_only_the_mounted_client_changes_anything(ask: Ask) -> None:
    assert ask('MOUNT', client='a').success
    assert ask('MOUNT', client='a').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    refused = ask('MOUNT', client='b')
    assert (refused.success, refused.exit_code) == (False, 203)
    assert refused.error_description == (
        'b cannot be mounted on map. Another client is already mounted on it.'
    )
    for words, args in (('ADD IND', ('X',)), ('APPLY', ()), ('REASON', ())):
        busy = ask(words, *args, client='b')
        assert (busy.success, busy.exit_code) == (False, 102)
        assert busy.error_description == (
            'b cannot connect to map. Another client is already mounted on it.'
        )
    assert ask('QUERY IND CLASS', 'DOOR', client='b').success
    assert ask('ADD IND CLASS', 'X', 'DOOR', client='a').success
    assert ask('UNMOUNT', client='b').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    assert ask('UNMOUNT', client='a').success
    assert ask('GET REF CLIENT', 'map').queried_objects == ['none']
    assert ask('ADD IND', 'Y', client='b').success


def test_mounting_what_is_not_there(ask: Ask) -> None:
    assert ask('MOUNT', reference='other').exit_code == 203
    assert ask('GET REF CLIENT', 'other').exit_code == 205


def test_load_mounted(ask: Ask) -> None:
    args = (ONTOLOGY, IRI, 'false', 'PELLET', 'false')
    assert ask('LOAD FILE MOUNTED', *args, client='a', reference='other').success
    assert ask('GET REF CLIENT', 'other').queried_objects == ['a']
    refused = ask('LOAD FILE MOUNTED', *args, client='b', reference='other')
    assert (refused.success, refused.exit_code) == (False, 203)


def test_a_client_called_none_is_not_mounted(ask: Ask) -> None:
    ask('MOUNT', client='none')
    assert ask('ADD IND', 'X', client='b').success


def test_mounting_can_be_left_unenforced(tmp_path: Path) -> None:
    service = ArmorService(Settings(directories=(tmp_path,), enforce_mount=False))
    ask = loaded(service, 'false', 'false')
    ask('MOUNT', client='a')
    assert ask('ADD IND CLASS', 'X', 'DOOR', client='b').success
    service.close()


@pytest.mark.parametrize(
    ('reasoner', 'note'),
    [('', ''), ('pellet', ''), ('NATIVE', ''), ('FACT', "'FACT'"), ('SNOROCKET', "'SNOROCKET'")],
)
def test_reasoner_names(service: ArmorService, reasoner: str, note: str) -> None:
    answer = asker(service)('LOAD FILE', ONTOLOGY, IRI, 'false', reasoner, 'false')
    assert answer.success
    assert note in answer.error_description
    assert bool(answer.error_description) == bool(note)


def test_what_cannot_be_loaded_leaves_no_reference(service: ArmorService, tmp_path: Path) -> None:
    ask = asker(service)
    broken = tmp_path / 'broken.owl'
    broken.write_text('<?xml version="1.0"?>\n<rdf:RDF>\n  <oops\n')
    entities = tmp_path / 'entities.owl'
    entities.write_text('<!DOCTYPE x [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>\n<x>&b;</x>')
    for path, words in (
        (str(broken), 'broken.owl:'),
        (str(entities), 'entities.owl'),
        (str(tmp_path / 'none.owl'), 'does not exist'),
        (str(tmp_path), 'is not a file'),
        ('/etc/passwd', 'may not be read'),
        (f'{tmp_path}/../../../etc/passwd', 'may not be read'),
        ('', 'path is empty'),
        ('a\nb', 'is not a path'),
    ):
        answer = ask('LOAD FILE', path, IRI, 'false', 'PELLET', 'false')
        assert (answer.success, answer.exit_code) == (False, 205), path
        assert words in answer.error_description
        assert '\n' not in answer.error_description
        assert ask('GET ALL REFS').queried_objects == []
    assert ask('LOAD FILE', ONTOLOGY, 'no iri', 'false', '', 'false').exit_code == 205
    assert ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false').success, 'the name is not poisoned'


def test_links_out_of_the_allowed_directories_are_seen_through(
    service: ArmorService, tmp_path: Path
) -> None:
    (tmp_path / 'link.owl').symlink_to('/etc/passwd')
    (tmp_path / 'out').symlink_to('/tmp')
    ask = asker(service)
    assert (
        'may not be read'
        in ask('LOAD FILE', str(tmp_path / 'link.owl'), IRI, 'false', '', 'false').error_description
    )
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    for path in (str(tmp_path / 'out' / 'x.owl'), str(tmp_path / 'link.owl'), '/tmp/x.owl'):
        assert 'may not be written' in ask('SAVE', path).error_description


def test_the_packaged_ontology_is_never_overwritten(ask: Ask) -> None:
    before = Path(ONTOLOGY).read_bytes()
    answer = ask('SAVE', '')
    assert not answer.success
    assert 'may not be written' in answer.error_description
    assert Path(ONTOLOGY).read_bytes() == before


def test_the_web_is_closed(ask: Ask) -> None:
    answer = ask('LOAD WEB', 'http://example.org/x.owl', IRI, 'false', '', 'false', reference='web')
    assert (answer.success, answer.exit_code) == (False, 205)
    assert 'allow_web' in answer.error_description


def test_saving_and_loading_again(ask: Ask, tmp_path: Path) -> None:
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1')
    ask('ADD OBJECTPROP IND', 'hasDoor', 'R3', 'D1')
    assert ask('SAVE', 'plain.owl').success
    assert ask('SAVE INFERENCE', str(tmp_path / 'derived.owl')).success
    assert '#URGENT' in (tmp_path / 'derived.owl').read_text()
    ask('REPLACE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579740', '1')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == [], 'saving asserted nothing'
    for name, urgent in (('plain', []), ('derived', ['R3'])):
        path = str(tmp_path / f'{name}.owl')
        assert ask('LOAD FILE', path, IRI, 'false', '', 'false', reference=name).success
        assert names(ask('QUERY IND CLASS', 'ROOM', reference=name)) == ['R3']
        ask('REMOVE DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1', reference=name)
        assert names(ask('QUERY IND CLASS', 'URGENT', reference=name)) == urgent
        assert ask('SAVE', '', reference=name).success, 'an empty path is the file it came from'


def test_logging_to_a_file_and_the_console(service: ArmorService, ask: Ask, tmp_path: Path) -> None:
    assert ask('LOG FILE ON', 'armor.log').success
    ask('QUERY IND CLASS', 'DOOR')
    assert ask('LOG FILE OFF').success
    ask('QUERY IND CLASS', 'ROOM')
    text = (tmp_path / 'armor.log').read_text()
    assert "'tester' on 'map': QUERY IND CLASS [DOOR] -> ok" in text
    assert 'ROOM' not in text
    assert ask('LOG FILE ON', '/etc/armor.log').exit_code == 205
    shown: list[str] = []
    noisy = ArmorService(Settings(), screen=shown.append)
    asker(noisy)('LOG SCREEN ON')
    asker(noisy)('QUERY IND', 'x')
    asker(noisy)('LOG SCREEN OFF')
    assert any('exit code 205' in line for line in shown)
    noisy.close()


# --- bounds ---


def test_size_is_bounded(service: ArmorService) -> None:
    small = Settings(max_arguments=10, max_characters=100, max_batch=3)
    bounded = ArmorService(small)
    ask = asker(bounded)
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    assert '11 arguments, at most 10' in ask('DISJOINT IND', *'abcdefghijk').error_description
    assert 'at most 100' in ask('ADD IND', 'x' * 101).error_description
    answer = bounded.execute_list([DirectiveRequest('c', 'map', 'REASON')] * 4)
    assert not answer.success
    assert 'at most 3' in answer.responses[0].error_description
    bounded.close()


def test_names_of_references_are_bounded(ask: Ask) -> None:
    for name in ('a\x00b', 'x' * 300, 'a\nb'):
        answer = ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference=name)
        assert (answer.success, answer.exit_code) == (False, 205)


# --- batches ---


def request(words: str, *args: str, client: str = 'c', reference: str = 'map') -> DirectiveRequest:
    command, primary, secondary, *_ = (*words.split(), '', '', '')
    return DirectiveRequest(client, reference, command, primary, secondary, args)


def test_a_batch_runs_in_order_with_one_answer_each(service: ArmorService, ask: Ask) -> None:
    answer = service.execute_list(
        [
            request('ADD IND CLASS', 'X', 'DOOR'),
            request('QUERY IND CLASS', 'DOOR'),
            request('NO SUCH COMMAND'),
            request('ADD IND CLASS', 'Y', 'DOOR'),
            request('REASON'),
        ]
    )
    assert [row.success for row in answer.responses] == [True, True, False, True, True]
    assert answer.responses[1].queried_objects == [iri('X')]
    assert not answer.success
    assert answer.is_consistent
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']
    assert service.execute_list([request('REASON')]).success
    assert service.execute_list([]).success


# --- acceptance: other people's scripts ---


def test_the_python_clients_own_test_script(service: ArmorService) -> None:
    base = 'http://example.org/four'
    ask = asker(service)
    path = str(FIXTURES / 'four_classes.owl')
    assert ask('LOAD FILE', path, base, 'True', 'PELLET', 'True').success
    ask('MOUNT')
    for ind in '123':
        ask('ADD IND CLASS', f'ind_{ind}', f'Class_{ind}')
    ask('ADD OBJECTPROP IND', 'OProperty_1', 'ind_1', 'ind_3')
    ask('ADD OBJECTPROP IND', 'OProperty_2', 'ind_1', 'ind_2')
    ask('ADD DATAPROP IND', 'DProperty_1', 'ind_1', 'INTEGER', '1')
    ask('REPLACE DATAPROP IND', 'DProperty_1', 'ind_1', 'INTEGER', '3', '1')
    ask('APPLY')
    ask('REASON')
    types = {ind: ask('QUERY IND', ind).queried_objects for ind in ('ind_1', 'ind_2', 'ind_3')}
    assert types == {
        'ind_1': [f'<{base}#Class_1>', f'<{base}#Class_4>'],
        'ind_2': [f'<{base}#Class_1>', f'<{base}#Class_2>'],
        'ind_3': [f'<{base}#Class_3>'],
    }
    assert ask('QUERY DATAPROP IND', 'DProperty_1', 'ind_1').queried_objects == ['"3"^^xsd:integer']


def test_the_tutorials_calls(ask: Ask) -> None:
    assert ask('QUERY DATAPROP IND', 'now', 'Robot1').queried_objects == ['"1665579740"^^xsd:long']
    ask('ADD OBJECTPROP IND', 'hasDoor', 'R1', 'D1')
    ask('ADD OBJECTPROP IND', 'isIn', 'Robot1', 'R1')
    ask('ADD DATAPROP IND', 'visitedAt', 'R1', 'LONG', '1665579710')
    assert names(ask('QUERY IND CLASS', 'ROOM')) == ['R1']
    assert names(ask('QUERY OBJECTPROP IND', 'isIn', 'Robot1')) == ['R1']
    ask('REPLACE DATAPROP IND', 'now', 'Robot1', 'LONG', '1665579750', '1665579740')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R1']


def test_an_ontology_with_the_older_form_of_all_different(
    service: ArmorService, tmp_path: Path
) -> None:
    vocabulary = Path(ONTOLOGY).read_text().rpartition('</rdf:RDF>')[0]
    individuals = (FIXTURES / 'three_places.owl').read_text().partition('rdf-syntax-ns#">')[2]
    (tmp_path / 'abox.owl').write_text(vocabulary + individuals)
    ask = asker(service)
    assert ask('LOAD FILE', 'abox.owl', IRI, 'false', 'PELLET', 'false').success
    assert names(ask('QUERY IND', 'C1')) == ['CORRIDOR', 'LOCATION', 'ROOM']
    assert 'URGENT' in names(ask('QUERY IND', 'R1'))
    assert names(ask('QUERY OBJECTPROP IND', 'canReach', 'Robot1')) == ['R1', 'R2']


def test_the_service_is_told_of_its_data() -> None:
    assert (DATA / 'surveillance.owl').is_file()


def test_disjointness_of_very_many_classes_is_refused(ask: Ask) -> None:
    answer = ask('DISJOINT CLASS', *(f'K{number}' for number in range(501)))
    assert (answer.success, answer.exit_code) == (False, 205)
    assert answer.error_description == 'DISJOINT CLASS: 501 arguments, at most 500'


def test_what_may_take_long_is_not_done_at_once(service: ArmorService, ask: Ask) -> None:
    assert service.execute_at_once(request('QUERY IND CLASS', 'ROOM')) is not None
    for slow in (
        request('QUERY SPARQL', 'SELECT * { ?a ?b ?c }'),
        request('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference='other'),
        request('ADD CLASS CLASS', 'A', 'B'),
        request('DISJOINT IND', *(f'X{number}' for number in range(2000))),
    ):
        assert service.execute_at_once(slow) is None
    assert ask('GET ALL REFS').queried_objects == ['map'], 'nothing was done'
    ask('LOAD FILE', ONTOLOGY, IRI, 'true', '', 'true')
    assert service.execute_at_once(request('REASON')) is not None
    ask('ADD CLASS CLASS', 'A', 'B')
    assert service.execute_at_once(request('REASON')) is None, 'classes changed'


UNSUPPORTED = """<?xml version="1.0"?>
<rdf:RDF xmlns="http://example.org/u#" xml:base="http://example.org/u"
     xmlns:owl="http://www.w3.org/2002/07/owl#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"
     xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <owl:Class rdf:about="#A">
    <rdfs:subClassOf>
      <owl:Class>
        <owl:unionOf rdf:parseType="Collection">
          <owl:Class rdf:about="#B"/>
          <owl:Class rdf:about="#C"/>
        </owl:unionOf>
      </owl:Class>
    </rdfs:subClassOf>
  </owl:Class>
</rdf:RDF>
"""


def test_what_the_reasoner_does_not_support_is_reported_at_load(
    service: ArmorService, tmp_path: Path
) -> None:
    (tmp_path / 'u.owl').write_text(UNSUPPORTED)
    ask = asker(service)
    answer = ask('LOAD FILE', 'u.owl', 'http://example.org/u', 'false', '', 'false')
    assert answer.success
    assert 'not supported by the reasoner' in answer.error_description
    listed = ask('QUERY UNSUPPORTED').queried_objects
    assert listed
    assert listed[0] in answer.error_description


def test_the_web_when_it_is_allowed(tmp_path: Path) -> None:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = partial(Quiet, directory=str(DATA))
    with ThreadingHTTPServer(('127.0.0.1', 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        base = f'http://127.0.0.1:{server.server_address[1]}'
        service = ArmorService(Settings(directories=(tmp_path,), allow_web=True))
        ask = asker(service)
        good = ask('LOAD WEB MOUNTED', f'{base}/surveillance.owl', IRI, 'false', '', 'false')
        assert good.success
        assert ask('GET REF CLIENT', 'map').queried_objects == ['tester']
        assert 'expected a path' in ask('SAVE', '').error_description
        for url, words in (
            (f'{base}/none.owl', 'not found'),
            ('file:///etc/passwd', 'not an http address'),
            ('http://127.0.0.1:1/x', 'refused'),
        ):
            bad = ask('LOAD WEB', url, IRI, 'false', '', 'false', reference='bad')
            assert (bad.success, bad.exit_code) == (False, 205)
            assert words in bad.error_description
        server.shutdown()
        service.close()
