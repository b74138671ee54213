"""Axioms, rules and class expressions by directive, in Manchester syntax."""

from __future__ import annotations

from pathlib import Path

import pytest

from armor_service.client import ArmorClient, InProcessTransport
from armor_service.directives import TABLE
from armor_service.service import ArmorService
from owl_reasoner.knowledge_base import KnowledgeBase

from .seven_rooms import IRI, Ask, asker, build_seven_rooms, names


@pytest.fixture
def rooms(service: ArmorService) -> Ask:
    """Provide the seven rooms."""
    build_seven_rooms(ArmorClient('c', 'map', InProcessTransport(service)), False, False)
    return asker(service)


def test_axioms_come_and_go(rooms: Ask) -> None:
    axiom = 'Class: Crossing EquivalentTo: LOCATION and (hasDoor min 3 DOOR)'
    assert rooms('ADD AXIOM', axiom).success
    assert names(rooms('QUERY IND CLASS', 'Crossing')) == ['C1', 'C2']
    (shown,) = rooms('QUERY AXIOMS', 'Crossing').queried_objects[-1:]
    assert 'Crossing' in shown
    assert rooms('REMOVE AXIOM', axiom).error_description == ''
    assert names(rooms('QUERY IND CLASS', 'Crossing')) == []
    assert rooms('ADD AXIOM', 'Individual: R1 Types: hasDoor max 1').success
    for written in rooms('QUERY AXIOMS', 'R1').queried_objects:
        assert rooms('REMOVE AXIOM', written).error_description == '', written
    assert rooms('QUERY AXIOMS', 'R1').queried_objects == []


@pytest.mark.parametrize(
    'axiom',
    [
        'Individual: R1 Annotations: rdfs:comment "opens at :30 (:45 on Sundays)"',
        'Individual: R1 Types: <http://bnc/exp-rob-lab/2022-23#some>',
        'Individual: R1 Facts: <http://bnc/exp-rob-lab/2022-23#value> R2',
    ],
)
def test_what_is_shown_is_taken_back_as_it_stands(rooms: Ask, axiom: str) -> None:
    before = rooms('QUERY AXIOMS', 'R1').queried_objects
    assert rooms('ADD AXIOM', axiom).error_description == ''
    (shown,) = set(rooms('QUERY AXIOMS', 'R1').queried_objects) - set(before)
    assert shown == axiom
    assert rooms('REMOVE AXIOM', shown).error_description == ''
    assert rooms('QUERY AXIOMS', 'R1').queried_objects == before


def test_an_axiom_comes_and_goes_with_what_is_said_of_it(rooms: Ask) -> None:
    axiom = 'Class: Hall SubClassOf: Annotations: rdfs:comment "large" ROOM'
    assert rooms('ADD AXIOM', axiom).error_description == ''
    assert rooms('QUERY AXIOMS', 'Hall').queried_objects == ['Class: Hall', axiom]
    assert rooms('REMOVE AXIOM', axiom).error_description == ''
    assert rooms('QUERY AXIOMS', 'Hall').queried_objects == ['Class: Hall']


def test_a_frame_declares_what_is_new_and_nothing_else(rooms: Ask) -> None:
    before = rooms('QUERY AXIOMS', 'R1').queried_objects
    assert rooms('ADD AXIOM', 'Individual: R1 Types: Kitchen').success
    (more,) = set(rooms('QUERY AXIOMS', 'R1').queried_objects) - set(before)
    assert 'Kitchen' in more
    for _ in range(2):
        answer = rooms('ADD AXIOM', 'Class: Cellar')
        assert (answer.success, answer.error_description) == (True, '')
    assert rooms('QUERY AXIOMS', 'Cellar').queried_objects
    assert rooms('REMOVE AXIOM', 'Class: Cellar').success
    assert rooms('QUERY AXIOMS', 'Cellar').queried_objects == []


@pytest.mark.parametrize('is_large', [False, True])
def test_what_names_stand_for_is_known_of_a_large_ontology_too(
    rooms: Ask, monkeypatch: pytest.MonkeyPatch, is_large: bool
) -> None:
    """What no axiom but a declaration names, and of a large one the declarations alone."""
    for frame in ('DataProperty: width', 'ObjectProperty: sees', 'Datatype: Size'):
        assert rooms('ADD AXIOM', frame).error_description == ''
    if is_large:
        monkeypatch.setattr(KnowledgeBase, 'schema_names', lambda *_: [])
    for axiom, shown in (
        ('Class: Wide SubClassOf: width min 1', 'width min 1 rdfs:Literal'),
        ('Class: Open SubClassOf: sees min 1', 'sees min 1 owl:Thing'),
        ('Class: Sized SubClassOf: width some Size', 'width some Size'),
    ):
        assert rooms('ADD AXIOM', axiom).error_description == ''
        name = axiom.split()[1]
        (found,) = (a for a in rooms('QUERY AXIOMS', name).queried_objects if 'SubClassOf' in a)
        assert shown in found


def test_what_is_said_of_a_class_is_shown_of_a_class(rooms: Ask) -> None:
    axiom = 'Class: ROOM Annotations: rdfs:comment "a place"'
    assert rooms('ADD AXIOM', axiom).error_description == ''
    assert axiom in rooms('QUERY AXIOMS', 'ROOM').queried_objects
    assert names(rooms('QUERY IND', 'R1')) == ['LOCATION', 'ROOM']


def test_no_axiom_is_about_somebody_without_a_name(rooms: Ask) -> None:
    answer = rooms('ADD AXIOM', 'Individual: _:b Types: ROOM')
    assert not answer.success
    assert 'it is an individual without a name' in answer.error_description


def test_a_name_whose_prefix_nobody_declared_is_an_iri(rooms: Ask) -> None:
    assert rooms('ADD AXIOM', 'Individual: urn:hall Types: ROOM').error_description == ''
    assert '<urn:hall>' in rooms('QUERY IND CLASS', 'ROOM').queried_objects


def test_rules_come_and_go(rooms: Ask) -> None:
    rule = 'ROOM(?r), visitedAt(?r, ?t), greaterThan(?t, 5) -> Visited(?r)'
    before = rooms('QUERY RULES').queried_objects
    assert len(before) == 3
    assert rooms('ADD RULE', rule).success
    assert names(rooms('QUERY IND CLASS', 'Visited')) == ['C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4']
    (new,) = set(rooms('QUERY RULES').queried_objects) - set(before)
    assert rooms('REMOVE RULE', new).error_description == ''
    assert names(rooms('QUERY IND CLASS', 'Visited')) == []
    for written in before:
        assert rooms('REMOVE RULE', written).error_description == '', written
    assert rooms('QUERY RULES').queried_objects == []


def test_the_individuals_of_an_expression(rooms: Ask) -> None:
    assert names(rooms('QUERY IND EXPRESSION', 'hasDoor value D7')) == ['C2', 'E']
    assert names(rooms('QUERY IND EXPRESSION', 'CORRIDOR and not (hasDoor min 3)')) == []
    assert names(rooms('QUERY IND EXPRESSION', 'CORRIDOR and (hasDoor min 3)')) == ['C1', 'C2']


@pytest.mark.parametrize(
    ('directive', 'problem'),
    [
        (('ADD AXIOM', 'Class: A SubClassOf'), 'ADD AXIOM: argument axiom: 1:10: expected'),
        (('ADD RULE', 'ROOM(?r)'), "argument rule: 1:9: expected '->'"),
        (('QUERY IND EXPRESSION', 'ROOM and'), 'argument class expression: 1:9: expected a'),
        (('ADD AXIOM', 'Prefix: x: <urn:x>'), 'expected'),
        (
            (
                'ADD AXIOM',
                'Class: A SubClassOf: Annotations: Annotations: n "x" n "y" B',
            ),
            'ADD AXIOM: argument axiom: line 1: an annotation on an annotation is not kept',
        ),
    ],
)
def test_a_wrong_text_is_refused_with_its_place(
    rooms: Ask, directive: tuple[str, ...], problem: str
) -> None:
    answer = rooms(*directive)
    assert (answer.success, answer.exit_code) == (False, 205)
    assert problem in answer.error_description


def test_an_ontology_is_saved_and_loaded_in_it(rooms: Ask, tmp_path: Path) -> None:
    assert rooms('SAVE', str(tmp_path / 'map.omn')).success
    assert (tmp_path / 'map.omn').read_text().startswith('Prefix: ')
    path = str(tmp_path / 'map.omn')
    assert rooms('LOAD FILE', path, IRI, 'false', '', 'false', reference='again').success
    again = names(rooms('QUERY OBJECTPROP IND', 'canReach', 'Robot1', reference='again'))
    assert again == names(rooms('QUERY OBJECTPROP IND', 'canReach', 'Robot1'))


def test_the_client_has_methods_for_them(service: ArmorService) -> None:
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, False)
    change, ask = client.manipulation, client.query
    assert change.add_axiom('Class: DeadEnd EquivalentTo: LOCATION and (hasDoor exactly 1)')
    assert change.close_objectprop('hasDoor', 'R1')
    assert ask.ind_b2_class('DeadEnd') == ['R1'] == ask.ind_b2_expression('DeadEnd')
    assert change.close_objectprop('hasDoor')
    assert ask.ind_b2_class('DeadEnd') == ['R1', 'R2', 'R3', 'R4']
    assert change.add_rule('DeadEnd(?r) -> Quiet(?r)')
    assert change.remove_rule(next(rule for rule in ask.rules() if 'Quiet' in rule))
    assert ask.ind_b2_class('Quiet') == []
    assert change.close_class('URGENT', 'Robot1')
    assert any('not' in axiom for axiom in ask.axioms('Robot1'))
    assert change.remove_axiom('Individual: Robot1 Types: not URGENT')
    assert ask.rolled_back() == []
    client.utils.cancel()
    assert client.utils.reason_within(60.0)


def test_what_armor_does_not_know_is_said_to_be_an_addition() -> None:
    written = [d for d in TABLE.values() if d.run.__module__.endswith('.manchester')]
    assert {'REMOVE RULE', 'QUERY AXIOMS'} <= {directive.words for directive in written}
    assert not [directive.words for directive in written if directive.native]


def test_a_rule_that_counts_without_an_end_is_told_when_it_is_added(rooms: Ask) -> None:
    for prop in 'nabcdef':
        assert rooms('ADD AXIOM', f'DataProperty: {prop}').success
    endless = 'N(?i), n(?i, ?v), swrlb:add(?w, ?v, 1) -> n(?i, ?w)'
    said = rooms('ADD RULE', endless)
    assert said.success
    assert 'computes new values without an end: from n to n' in said.error_description
    assert 'n(?i, ?v)' in said.error_description
    assert 'without an end' not in rooms('ADD IND CLASS', 'x', 'DOOR').error_description
    # Over two rules; and none where the value is compared, or not its own.
    assert rooms('ADD RULE', 'a(?i, ?v) -> b(?i, ?v)').error_description == ''
    said = rooms('ADD RULE', 'b(?i, ?v), swrlb:multiply(?w, ?v, 2) -> a(?i, ?w)')
    assert 'from b to a to b' in said.error_description
    for fine in (
        'c(?i, ?v), swrlb:lessThan(?v, 9), swrlb:add(?w, ?v, 1) -> c(?i, ?w)',
        'd(?i, ?v), swrlb:add(?w, ?v, 1) -> e(?i, ?w)',
        'f(?i, ?v) -> f(?i, ?v)',
    ):
        assert 'without an end' not in rooms('ADD RULE', fine).error_description
