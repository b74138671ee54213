"""The directives that ask: exact answers."""

from __future__ import annotations

from pathlib import Path

from armor_service.service import ArmorService

from .seven_rooms import IRI, Ask, asker, iri


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
        assert answer.error_description.startswith(f'map has no {unknown}')


def test_explanations(ask: Ask) -> None:
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '1665579720')
    sentence, tree = ask('QUERY EXPLAIN', 'URGENT(R3)').queried_objects
    assert sentence.startswith('R3 is URGENT because')
    assert '1665579740' in sentence
    assert '1665579720' in sentence
    assert 'asserted' in tree
    refused = ask('QUERY EXPLAIN', 'URGENT(R4)')
    assert (refused.success, refused.exit_code) == (False, 0)
    mistyped = ask('QUERY EXPLAIN', 'URGENTT(Rr)').error_description
    assert 'no class' in mistyped
    assert 'URGENT>)' in mistyped
    assert 'no individual' in mistyped
    sentence, *missing = ask('QUERY EXPLAIN ABSENCE', 'URGENT(R4)').queried_objects
    assert sentence.startswith('R4 is URGENT would follow from the rule')
    assert missing
    assert all(text in sentence for text in missing)
    assert ask('QUERY EXPLAIN ABSENCE', 'URGENT(R3)').queried_objects == []
    assert ask('QUERY EXPLAIN INCONSISTENCY').queried_objects == []
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '5')
    sentence, tree = ask('QUERY EXPLAIN INCONSISTENCY').queried_objects
    assert 'R3' in sentence
    assert tree


def test_nothing_is_said_to_hold_that_does_not(ask: Ask) -> None:
    ask('ADD IND CLASS', 'R3', 'ROOM')
    for fact in ('owl:sameAs(R3, Robot1)', 'owl:Thing(R9)'):
        assert not ask('QUERY EXPLAIN', fact).success
        absence = ask('QUERY EXPLAIN ABSENCE', fact)
        assert (absence.success, absence.exit_code, absence.queried_objects) == (False, 0, [])
        unknown = '' if 'R3' in fact else f': map has no individual {iri("R9")}'
        assert absence.error_description == f'{fact} does not hold in map{unknown}'
    mistyped = ask('QUERY EXPLAIN ABSENCE', 'URGENTT(Rr)')
    assert mistyped.queried_objects
    assert mistyped.error_description.startswith(f'map has no class {iri("URGENTT")}')
    value = ask('QUERY EXPLAIN', 'now(Robot1, 5)')
    assert value.error_description == 'now(Robot1, 5) is neither asserted nor derived in map'
    wrong = ask('QUERY EXPLAIN ABSENCE', 'URGENT')
    assert wrong.error_description.startswith('QUERY EXPLAIN ABSENCE: argument fact')
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '4')
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '5')
    absence = ask('QUERY EXPLAIN ABSENCE', 'URGENT(Robot1)')
    assert (absence.success, absence.is_consistent) == (False, False)
    assert absence.error_description == 'map is inconsistent'


def test_the_words_of_owl_are_known(ask: Ask) -> None:
    for words in ('QUERY CLASS CLASS', 'QUERY IND CLASS'):
        for name in ('owl:Thing', 'owl:Nothing'):
            assert ask(words, name).error_description == ''


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


def test_individuals_without_a_name(service: ArmorService, tmp_path: Path) -> None:
    """Clients of ARMOR look for ``#name>`` in each answer; reasoners answer with names alone."""
    path = tmp_path / 'blank.ttl'
    path.write_text(
        '@prefix : <urn:o#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .'
        ' :p a owl:ObjectProperty . :i :p _:b , :j . _:b a :A . :j a :A . :A a owl:Class .'
    )
    ask = asker(service, 'blank')
    assert ask('LOAD FILE', str(path), 'urn:o', 'false', '', 'false').success
    for answer in (ask('QUERY IND CLASS', 'A'), ask('QUERY OBJECTPROP IND', 'p', 'i')):
        assert answer.queried_objects == ['<urn:o#j>']
        assert answer.error_description == '1 without a name left out; QUERY FACT shows them'
    assert 'A(_:b)' in ask('QUERY FACT', 'A(?)').queried_objects
    assert ask('QUERY IND', '_:b').queried_objects == ['<urn:o#A>']
    assert ask('QUERY EXPLAIN', 'A(_:b)').queried_objects[0] == '_:b is A because it is asserted'
    refused = ask('ADD IND CLASS', '_:b', 'A').error_description
    assert 'is an individual without a name: only queries take it' in refused
    assert not ask('QUERY IND CLASS', '_:b').success
