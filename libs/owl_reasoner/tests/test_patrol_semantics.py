"""What follows on the patrol map, case by case: open world, no unique names."""

from __future__ import annotations

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    ClassAssertion,
    EquivalentClasses,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.expressions import (
    DataExactCardinality,
    DataMaxCardinality,
    Literal,
    ObjectComplementOf,
    ObjectExactCardinality,
    ObjectMaxCardinality,
    ObjectMinCardinality,
)
from owl_reasoner.owl.vocabulary import OWL, XSD

from .patrol_map import (
    DOOR_FACTS,
    DOORS,
    DOORS_DIFFER,
    IRI,
    NOW,
    PLACES_DIFFER,
    SCHEMA,
    SEVEN_ROOMS,
    VISITS,
    different,
    link,
    n,
    names,
    pairs,
    seven_rooms,
    value,
)

CORRIDORS = {'E', 'C1', 'C2'}
CONNECTIONS = {
    (one, other)
    for one, doors in SEVEN_ROOMS.items()
    for other, others in SEVEN_ROOMS.items()
    if one != other and set(doors) & set(others)
}


def test_everything_different() -> None:
    kb = seven_rooms()
    assert kb.consistent
    assert kb.unsupported == ()
    assert names(kb.instances(n('DOOR'))) == set(DOORS)
    assert names(kb.instances(n('LOCATION'))) == set(SEVEN_ROOMS)
    assert names(kb.instances(n('ROOM'))) == set(SEVEN_ROOMS)
    assert names(kb.instances(n('CORRIDOR'))) == CORRIDORS
    assert names(kb.instances(n('ROBOT'))) == {'Robot1'}
    assert kb.instances(n('URGENT')) == set()
    assert len(CONNECTIONS) == 14
    assert pairs(kb, 'connectedTo') == CONNECTIONS
    assert pairs(kb, 'canReach') == {('Robot1', 'C1'), ('Robot1', 'C2')}
    assert kb.types(n('C1')) == {n('CORRIDOR'), n('ROOM'), n('LOCATION')}


def test_class_hierarchy() -> None:
    kb = seven_rooms()
    assert names(kb.subclasses(n('LOCATION'))) == {'ROOM', 'CORRIDOR', 'URGENT'}
    assert names(kb.superclasses(n('CORRIDOR'))) == {'ROOM', 'LOCATION'}
    assert kb.subclasses(n('DOOR')) == set()


@pytest.mark.parametrize(('age', 'urgent'), [(8, True), (7, False), (-5, False)])
def test_urgent_is_strictly_beyond_the_threshold(age: int, urgent: bool) -> None:
    old = value('visitedAt', 'R3', NOW - list(SEVEN_ROOMS).index('R3'))
    kb = seven_rooms(value('visitedAt', 'R3', NOW - age), without=[old])
    assert kb.consistent
    assert (n('R3') in kb.instances(n('URGENT'))) is urgent


def test_places_different_doors_not() -> None:
    kb = seven_rooms(without=[DOORS_DIFFER])
    assert kb.consistent
    assert kb.instances(n('CORRIDOR')) == set()
    assert pairs(kb, 'connectedTo') == CONNECTIONS


def test_doors_different_places_not() -> None:
    kb = seven_rooms(without=[PLACES_DIFFER, *VISITS])
    assert names(kb.instances(n('CORRIDOR'))) == CORRIDORS
    assert pairs(kb, 'connectedTo') == set()


def test_connections_only_where_difference_is_entailed() -> None:
    kb = seven_rooms(different(['R1', 'C1']), without=[PLACES_DIFFER, *VISITS])
    assert pairs(kb, 'connectedTo') == {('R1', 'C1'), ('C1', 'R1')}


def test_distinct_visits_make_places_different() -> None:
    kb = seven_rooms(without=[PLACES_DIFFER, DOORS_DIFFER])
    assert pairs(kb, 'connectedTo') == CONNECTIONS
    assert kb.instances(n('CORRIDOR')) == set()


@pytest.mark.parametrize('same_time', [True, False])
def test_equal_or_absent_visits_do_not(same_time: bool) -> None:
    visits = [value('visitedAt', place, NOW) for place in SEVEN_ROOMS] if same_time else []
    kb = seven_rooms(*visits, without=[PLACES_DIFFER, *VISITS])
    assert kb.consistent
    assert pairs(kb, 'connectedTo') == set()


def test_two_visits_of_a_place_contradict() -> None:
    kb = seven_rooms(value('visitedAt', 'R1', 5))
    assert not kb.consistent
    # An inconsistent ontology still answers from its assertions.
    assert names(kb.object_values(n('hasDoor'), n('R1'))) == {'D1'}
    assert kb.object_values(n('connectedTo'), n('R1')) == set()
    kb.remove(value('visitedAt', 'R1', 5))
    assert kb.reason()
    assert pairs(kb, 'connectedTo') == CONNECTIONS


def test_one_value_in_two_datatypes_is_one_value() -> None:
    age = list(SEVEN_ROOMS).index('R1')
    kb = seven_rooms(value('visitedAt', 'R1', Literal(str(NOW - age), XSD + 'integer')))
    assert kb.consistent
    assert len(kb.data_values(n('visitedAt'), n('R1'))) == 2


def test_no_visit_is_consistent_and_never_urgent() -> None:
    old = value('visitedAt', 'R1', NOW - list(SEVEN_ROOMS).index('R1'))
    kb = seven_rooms(without=[old])
    kb.change([value('now', 'Robot1', NOW + 100)], [value('now', 'Robot1', NOW)])
    assert kb.reason()
    assert names(kb.instances(n('URGENT'))) == set(SEVEN_ROOMS) - {'R1'}


def test_two_different_places_at_once_contradict() -> None:
    assert not seven_rooms(link('isIn', 'Robot1', 'C1')).consistent
    assert not seven_rooms(link('isIn', 'Robot1', 'C1'), without=[PLACES_DIFFER]).consistent


def test_two_places_not_known_different_are_one() -> None:
    kb = seven_rooms(link('isIn', 'Robot1', 'C1'), without=[PLACES_DIFFER, *VISITS])
    assert kb.consistent
    same = SameIndividual(frozenset((n('E'), n('C1'))))
    assert same in set(kb.facts())
    assert names(kb.object_values(n('hasDoor'), n('E'))) == {'D1', 'D2', 'D5', 'D6', 'D7'}
    assert names(kb.object_values(n('isIn'), n('Robot1'))) == {'E', 'C1'}
    kb.remove(link('isIn', 'Robot1', 'C1'))
    kb.reason()
    assert same not in set(kb.facts())
    assert names(kb.object_values(n('hasDoor'), n('E'))) == {'D6', 'D7'}


@pytest.mark.parametrize(
    ('literal', 'accepted'),
    [
        (Literal('5', XSD + 'integer'), True),
        (Literal('5', XSD + 'int'), True),
        (Literal('5.0', XSD + 'decimal'), True),
        (Literal('5.5', XSD + 'decimal'), False),
        (Literal('5', XSD + 'string'), False),
        (Literal('5', XSD + 'float'), False),
        (Literal('5', XSD + 'double'), False),
        (Literal('9223372036854775808', XSD + 'integer'), False),
        (Literal('five', XSD + 'long'), False),
    ],
)
def test_visits_are_accepted_by_value(literal: Literal, accepted: bool) -> None:
    old = value('visitedAt', 'R1', NOW - list(SEVEN_ROOMS).index('R1'))
    kb = seven_rooms(value('visitedAt', 'R1', literal), without=[old])
    assert kb.consistent is accepted


@pytest.mark.parametrize('prop', ['now', 'urgencyThreshold'])
def test_urgent_if_any_pair_of_values_satisfies(prop: str) -> None:
    calm = value(prop, 'Robot1', NOW - 50 if prop == 'now' else 500)
    alarming = value(prop, 'Robot1', NOW + 100 if prop == 'now' else -100)
    assert names(seven_rooms(calm).instances(n('URGENT'))) == set()
    kb = seven_rooms(alarming)
    assert kb.consistent
    assert names(kb.instances(n('URGENT'))) == set(SEVEN_ROOMS)
    kb.remove(alarming)
    kb.reason()
    assert kb.instances(n('URGENT')) == set()


@pytest.mark.parametrize(
    'wrong',
    [
        value('visitedAt', 'D1', NOW),
        link('isIn', 'Robot1', 'D1'),
        link('hasDoor', 'R1', 'C2'),
    ],
)
def test_disjoint_classes_contradict(wrong: object) -> None:
    assert not seven_rooms(wrong).consistent  # type: ignore[arg-type]


def test_a_subclass_of_min_classifies_nothing() -> None:
    hub = SubClassOf(n('HUB'), ObjectMinCardinality(2, n('hasDoor'), n('DOOR')))
    assert seven_rooms(hub).instances(n('HUB')) == set()
    defined = EquivalentClasses((n('HUB'), ObjectMinCardinality(2, n('hasDoor'), n('DOOR'))))
    assert names(seven_rooms(defined).instances(n('HUB'))) == CORRIDORS


@pytest.mark.parametrize(
    'definition',
    [
        ObjectMaxCardinality(4, n('hasDoor'), n('DOOR')),
        ObjectExactCardinality(1, n('hasDoor'), n('DOOR')),
        DataExactCardinality(1, n('seenAt'), XSD + 'long'),
        ObjectComplementOf(n('CORRIDOR')),
    ],
)
def test_max_exact_and_complement_define_no_members(definition: object) -> None:
    kb = seven_rooms(
        EquivalentClasses((n('ODD'), definition)),  # type: ignore[arg-type]
        value('seenAt', 'R1', 3),
    )
    assert kb.consistent
    # Doors and robots have no doors and are no corridors: that they are ODD is no guess.
    assert not kb.instances(n('ODD')) & set(map(n, SEVEN_ROOMS))


@pytest.mark.parametrize(
    ('consequence', 'member'),
    [
        (ObjectMaxCardinality(3, n('hasDoor'), n('DOOR')), 'C1'),
        (ObjectExactCardinality(1, n('hasDoor'), n('DOOR')), 'C1'),
        (DataMaxCardinality(0, n('visitedAt'), XSD + 'long'), 'R1'),
        (ObjectComplementOf(n('CORRIDOR')), 'C1'),
    ],
)
def test_max_exact_and_complement_contradict(consequence: object, member: str) -> None:
    odd = SubClassOf(n('ODD'), consequence)  # type: ignore[arg-type]
    assert not seven_rooms(odd, ClassAssertion(n('ODD'), n(member))).consistent
    if member == 'C1':
        assert seven_rooms(odd, ClassAssertion(n('ODD'), n('R1'))).consistent


def test_an_asserted_corridor_with_one_door() -> None:
    kb = seven_rooms(ClassAssertion(n('CORRIDOR'), n('R1')))
    assert kb.consistent
    assert kb.types(n('R1')) == {n('CORRIDOR'), n('ROOM'), n('LOCATION')}


def test_an_asserted_corridor_without_any_door_is_a_room() -> None:
    kb = KnowledgeBase(IRI, [*SCHEMA, ClassAssertion(n('CORRIDOR'), n('X'))])
    assert kb.reason()
    assert kb.types(n('X')) == {n('CORRIDOR'), n('ROOM'), n('LOCATION')}


def test_a_door_lost_and_regained() -> None:
    kb = seven_rooms()
    (fact,) = [axiom for axiom in DOOR_FACTS if axiom == link('hasDoor', 'E', 'D6')]
    kb.remove(fact)
    kb.reason()
    assert names(kb.instances(n('CORRIDOR'))) == {'C1', 'C2'}
    assert pairs(kb, 'connectedTo') == CONNECTIONS - {('E', 'C1'), ('C1', 'E')}
    assert pairs(kb, 'canReach') == {('Robot1', 'C2')}
    kb.add(fact)
    kb.reason()
    assert names(kb.instances(n('CORRIDOR'))) == CORRIDORS
    assert pairs(kb, 'connectedTo') == CONNECTIONS


def test_nothing_is_a_named_class_like_any_other() -> None:
    kb = seven_rooms(SubClassOf(n('VOID'), OWL + 'Nothing'))
    assert kb.consistent
    kb.add(ClassAssertion(n('VOID'), n('R1')))
    assert not kb.reason()
