"""Assertions, queries between two reasonings, renaming and removal of entities, the feed of
changes.
"""

from __future__ import annotations

import dataclasses

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl.axioms import (
    AnnotationAssertion,
    ClassAssertion,
    Declaration,
    DifferentIndividuals,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import THING

from .patrol_map import (
    IRI,
    NOW,
    PLACES_DIFFER,
    SEVEN_ROOMS,
    link,
    long,
    n,
    names,
    pairs,
    seven_rooms,
    value,
)


def test_adding_and_removing_say_whether_anything_changed() -> None:
    kb = KnowledgeBase(IRI)
    fact = ClassAssertion(n('ROOM'), n('R1'))
    assert kb.add(fact)
    assert not kb.add(fact)
    assert fact in kb
    assert list(kb.axioms()) == [fact]
    assert list(kb.axioms_about(n('R1'))) == [fact]
    assert kb.remove(fact)
    assert not kb.remove(fact)
    assert list(kb.axioms_about(n('R1'))) == []
    assert not kb.is_known('individual', n('R1'))


def test_no_axiom_can_be_changed_once_it_is_written() -> None:
    kinds = [
        kind
        for kind in vars(ax).values()
        if isinstance(kind, type) and issubclass(kind, ax.Axiom) and dataclasses.is_dataclass(kind)
    ]
    assert len(kinds) > 30
    for kind in kinds:
        for field in dataclasses.fields(kind):
            axiom = object.__new__(kind)
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(axiom, field.name, 'x:other')


def test_known_entities() -> None:
    kb = seven_rooms(Declaration('class', n('GARAGE')))
    assert kb.is_known('class', n('GARAGE'))
    assert kb.is_known('class', n('ROOM'))
    assert not kb.is_known('individual', n('ROOM'))
    assert kb.is_known('individual', n('D1'))
    assert kb.is_known('object_property', n('hasDoor'))
    assert kb.is_known('data_property', n('visitedAt'))
    assert not kb.is_known('data_property', n('hasDoor'))


def test_assertions_show_at_once_and_derived_facts_after_reason() -> None:
    kb = seven_rooms()
    assert not kb.stale
    kb.remove(link('isIn', 'Robot1', 'E'))
    kb.add(link('isIn', 'Robot1', 'R1'))
    assert kb.stale
    assert names(kb.object_values(n('isIn'), n('Robot1'))) == {'R1'}
    assert names(kb.object_values(n('canReach'), n('Robot1'))) == {'C1', 'C2'}
    kb.add(ClassAssertion(n('URGENT'), n('R1')))
    assert names(kb.instances(n('URGENT'))) == {'R1'}
    assert n('URGENT') in kb.types(n('R1'))
    kb.remove(ClassAssertion(n('URGENT'), n('R1')))
    assert kb.instances(n('URGENT')) == set()
    kb.reason()
    assert names(kb.object_values(n('canReach'), n('Robot1'))) == {'C1'}


def test_a_retracted_value_is_never_returned() -> None:
    kb = seven_rooms()
    kb.remove(value('now', 'Robot1', NOW))
    assert kb.data_values(n('now'), n('Robot1')) == set()
    kb.add(value('now', 'Robot1', NOW + 1))
    assert kb.data_values(n('now'), n('Robot1')) == {long(NOW + 1)}
    kb.remove(ClassAssertion(n('ROOM'), n('R1')))
    kb.add(ClassAssertion(n('SHED'), n('R1')))
    kb.reason()
    kb.remove(ClassAssertion(n('SHED'), n('R1')))
    assert kb.instances(n('SHED')) == set()
    assert n('SHED') not in kb.types(n('R1'))


def test_properties_of_an_individual() -> None:
    kb = seven_rooms()
    assert names(kb.object_properties_of(n('Robot1'))) == {'isIn', 'canReach'}
    assert names(kb.data_properties_of(n('Robot1'))) == {'now', 'urgencyThreshold'}
    assert kb.data_properties_of(n('D1')) == set()


def test_renaming_an_individual_everywhere() -> None:
    kb = seven_rooms(AnnotationAssertion(n('note'), n('R1'), Literal('north')))
    assert kb.rename('individual', n('R1'), n('Kitchen')) == 4
    kb.reason()
    assert not kb.is_known('individual', n('R1'))
    assert ('Kitchen', 'C1') in {(a.rpartition('#')[2], 'C1') for a in kb.instances(n('ROOM'))}
    assert n('Kitchen') in kb.object_values(n('connectedTo'), n('C1'))
    assert AnnotationAssertion(n('note'), n('Kitchen'), Literal('north')) in kb


def test_renaming_into_an_existing_individual_merges_them() -> None:
    kb = KnowledgeBase(IRI, [link('hasDoor', 'R1', 'D1'), link('hasDoor', 'R2', 'D2')])
    kb.rename('individual', n('R2'), n('R1'))
    assert kb.object_values(n('hasDoor'), n('R1')) == {n('D1'), n('D2')}


def test_renaming_a_class_or_property_leaves_other_kinds_alone() -> None:
    kb = seven_rooms(ClassAssertion(n('R1'), n('odd')))
    assert kb.rename('class', n('R1'), n('ODD')) == 1
    assert kb.is_known('individual', n('R1'))
    assert kb.rename('object_property', n('hasDoor'), n('opensTo')) > 10
    kb.reason()
    assert len(pairs(kb, 'connectedTo')) == 14
    assert names(kb.object_values(n('opensTo'), n('R1'))) == {'D1'}


def test_removing_an_individual_shrinks_the_difference() -> None:
    kb = seven_rooms()
    assert kb.remove_entity('individual', n('R1')) > 0
    kb.reason()
    assert not kb.is_known('individual', n('R1'))
    left = DifferentIndividuals(PLACES_DIFFER.individuals - {n('R1')})
    assert left in kb
    assert len(pairs(kb, 'connectedTo')) == 12
    assert names(kb.instances(n('LOCATION'))) == set(SEVEN_ROOMS) - {'R1'}


def test_schema_may_change_too() -> None:
    kb = seven_rooms()
    kb.add(SubClassOf(n('ROOM'), n('INDOORS')))
    assert kb.reason()
    assert names(kb.instances(n('INDOORS'))) == set(SEVEN_ROOMS)
    kb.remove(SubClassOf(n('ROOM'), n('INDOORS')))
    kb.reason()
    assert kb.instances(n('INDOORS')) == set()
    kb.add(SubClassOf(n('GARAGE'), THING))
    assert kb.reason()
    assert kb.is_known('class', n('GARAGE'))


def test_the_feed_of_changes() -> None:
    kb = seven_rooms()
    feed: list[Changes] = []
    stop = kb.subscribe(feed.append)
    kb.change([link('isIn', 'Robot1', 'C1')], [link('isIn', 'Robot1', 'E')])
    kb.reason()
    asserted, derived = feed
    assert asserted.added == ((link('isIn', 'Robot1', 'C1'), False),)
    assert asserted.removed == ((link('isIn', 'Robot1', 'E'), False),)
    assert (asserted.sequence, derived.sequence) == (1, 2)
    assert {axiom for axiom, _ in derived.added} == {
        link('canReach', 'Robot1', place) for place in ('E', 'R1', 'R2')
    }
    assert {axiom for axiom, _ in derived.removed} == {link('canReach', 'Robot1', 'C1')}
    assert all(is_derived for _, is_derived in derived.added + derived.removed)
    kb.reason()
    assert len(feed) == 2, 'nothing changed, nothing is told'
    kb.add(value('visitedAt', 'R1', 0))
    kb.reason()
    assert not feed[-1].consistent
    stop()
    kb.remove(value('visitedAt', 'R1', 0))
    kb.reason()
    assert len(feed) == 4


def test_facts_asserted_and_derived() -> None:
    kb = seven_rooms()
    asserted = set(kb.facts(derived=False))
    everything = set(kb.facts())
    assert link('hasDoor', 'R1', 'D1') in asserted
    assert link('connectedTo', 'R1', 'C1') in everything - asserted
    assert ClassAssertion(n('DOOR'), n('D1')) in everything - asserted
    # Nothing derived ever becomes an assertion.
    assert not any(isinstance(a, ClassAssertion) for a in kb.axioms())


def test_a_copy_is_independent() -> None:
    kb = seven_rooms()
    other = kb.copy()
    other.remove(link('isIn', 'Robot1', 'E'))
    assert link('isIn', 'Robot1', 'E') in kb
    assert other.stale
    other.reason()
    assert other.object_values(n('canReach'), n('Robot1')) == set()
    assert names(kb.object_values(n('canReach'), n('Robot1'))) == {'C1', 'C2'}


def test_an_individual_may_be_named_like_a_property() -> None:
    kb = seven_rooms(ObjectPropertyAssertion(n('hasDoor'), n('hasDoor'), n('D1')))
    assert kb.reason()
    assert n('hasDoor') in kb.instances(n('LOCATION'))


def test_who_turns_out_to_be_the_same_as_a_member_is_a_member() -> None:
    kb = KnowledgeBase(
        IRI, [ClassAssertion(n('ROOM'), n('R1')), ClassAssertion(n('DOOR'), n('D1'))]
    )
    kb.reason()
    assert kb.instances(n('ROOM')) == {n('R1')}
    kb.add(SameIndividual(frozenset((n('R1'), n('R0')))))
    kb.reason()
    assert kb.instances(n('ROOM')) == {n('R0'), n('R1')}
