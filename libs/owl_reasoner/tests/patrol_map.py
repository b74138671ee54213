"""The patrol vocabulary and small maps in it, as axioms."""

from __future__ import annotations

from collections.abc import Iterable

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    Axiom,
    DataPropertyAssertion,
    DataPropertyDomain,
    DataPropertyRange,
    DifferentIndividuals,
    DisjointClasses,
    EquivalentClasses,
    FunctionalObjectProperty,
    ObjectPropertyAssertion,
    ObjectPropertyDomain,
    ObjectPropertyRange,
    Rule,
    SubClassOf,
)
from owl_reasoner.owl.expressions import (
    BuiltinAtom,
    ClassAtom,
    DataExactCardinality,
    DataPropertyAtom,
    DifferentIndividualsAtom,
    Literal,
    ObjectExactCardinality,
    ObjectIntersectionOf,
    ObjectMinCardinality,
    ObjectPropertyAtom,
    ObjectSomeValuesFrom,
    Variable,
)
from owl_reasoner.owl.vocabulary import SWRLB, XSD, local_name

IRI = 'http://bnc/exp-rob-lab/2022-23'
NOW = 1665579740
SEVEN_ROOMS = {
    'E': ['D6', 'D7'],
    'C1': ['D1', 'D2', 'D5', 'D6'],
    'C2': ['D3', 'D4', 'D5', 'D7'],
    'R1': ['D1'],
    'R2': ['D2'],
    'R3': ['D3'],
    'R4': ['D4'],
}
DOORS = [f'D{number}' for number in range(1, 8)]


def n(name: str) -> str:
    """Return the IRI of a name of the map."""
    return f'{IRI}#{name}'


def long(value: object) -> Literal:
    return Literal(str(value), XSD + 'long')


def names(iris: Iterable[str]) -> set[str]:
    return {local_name(iri) for iri in iris}


def value(prop: str, subject: str, literal: object) -> DataPropertyAssertion:
    """Return a data assertion; a number is taken as xsd:long."""
    return DataPropertyAssertion(
        n(prop), n(subject), literal if isinstance(literal, Literal) else long(literal)
    )


def link(prop: str, subject: str, target: str) -> ObjectPropertyAssertion:
    return ObjectPropertyAssertion(n(prop), n(subject), n(target))


def different(individuals: Iterable[str]) -> DifferentIndividuals:
    return DifferentIndividuals(frozenset(map(n, individuals)))


_D, _L, _L1, _L2, _R, _T, _V, _H = (
    Variable(f'urn:swrl:var#{name}') for name in ('d', 'l', 'l1', 'l2', 'r', 't', 'v', 'h')
)

RULES: list[Axiom] = [
    Rule(
        (
            ClassAtom(n('DOOR'), _D),
            ClassAtom(n('LOCATION'), _L1),
            ClassAtom(n('LOCATION'), _L2),
            ObjectPropertyAtom(n('hasDoor'), _L2, _D),
            ObjectPropertyAtom(n('hasDoor'), _L1, _D),
            DifferentIndividualsAtom(_L1, _L2),
        ),
        (ObjectPropertyAtom(n('connectedTo'), _L1, _L2),),
        (('http://www.w3.org/2000/01/rdf-schema#label', Literal('Connectability')),),
    ),
    Rule(
        (
            ClassAtom(n('ROBOT'), _R),
            DataPropertyAtom(n('now'), _R, _T),
            ClassAtom(n('LOCATION'), _L),
            DataPropertyAtom(n('visitedAt'), _L, _V),
            BuiltinAtom(SWRLB + 'subtract', (_D, _T, _V)),
            DataPropertyAtom(n('urgencyThreshold'), _R, _H),
            BuiltinAtom(SWRLB + 'greaterThan', (_D, _H)),
        ),
        (ClassAtom(n('URGENT'), _L),),
        (('http://www.w3.org/2000/01/rdf-schema#label', Literal('Urgency')),),
    ),
    Rule(
        (
            ClassAtom(n('LOCATION'), _L1),
            ClassAtom(n('LOCATION'), _L2),
            DifferentIndividualsAtom(_L1, _L2),
            ClassAtom(n('ROBOT'), _R),
            ObjectPropertyAtom(n('isIn'), _R, _L1),
            ObjectPropertyAtom(n('connectedTo'), _L1, _L2),
        ),
        (ObjectPropertyAtom(n('canReach'), _R, _L2),),
        (('http://www.w3.org/2000/01/rdf-schema#label', Literal('Reachability')),),
    ),
]

SCHEMA: list[Axiom] = [
    EquivalentClasses((n('LOCATION'), DataExactCardinality(1, n('visitedAt'), XSD + 'long'))),
    EquivalentClasses((n('ROBOT'), ObjectExactCardinality(1, n('isIn'), n('LOCATION')))),
    EquivalentClasses(
        (
            n('ROOM'),
            ObjectIntersectionOf((n('LOCATION'), ObjectSomeValuesFrom(n('hasDoor'), n('DOOR')))),
        )
    ),
    EquivalentClasses(
        (
            n('CORRIDOR'),
            ObjectIntersectionOf((n('LOCATION'), ObjectMinCardinality(2, n('hasDoor'), n('DOOR')))),
        )
    ),
    SubClassOf(n('URGENT'), n('LOCATION')),
    DisjointClasses((n('DOOR'), n('LOCATION'), n('ROBOT'))),
    FunctionalObjectProperty(n('isIn')),
    *(
        axiom
        for prop, domain, target in (
            ('hasDoor', 'LOCATION', 'DOOR'),
            ('isIn', 'ROBOT', 'LOCATION'),
            ('connectedTo', 'LOCATION', 'LOCATION'),
            ('canReach', 'ROBOT', 'LOCATION'),
        )
        for axiom in (
            ObjectPropertyDomain(n(prop), n(domain)),
            ObjectPropertyRange(n(prop), n(target)),
        )
    ),
    *(
        axiom
        for prop, domain in (
            ('visitedAt', 'LOCATION'),
            ('now', 'ROBOT'),
            ('urgencyThreshold', 'ROBOT'),
        )
        for axiom in (
            DataPropertyDomain(n(prop), n(domain)),
            DataPropertyRange(n(prop), XSD + 'long'),
        )
    ),
    *RULES,
]

DOOR_FACTS: list[Axiom] = [
    link('hasDoor', place, door) for place, doors in SEVEN_ROOMS.items() for door in doors
]
ROBOT_FACTS: list[Axiom] = [
    link('isIn', 'Robot1', 'E'),
    value('now', 'Robot1', NOW),
    value('urgencyThreshold', 'Robot1', 7),
]
VISITS: list[Axiom] = [
    value('visitedAt', place, NOW - place_number) for place_number, place in enumerate(SEVEN_ROOMS)
]
PLACES_DIFFER, DOORS_DIFFER = different(SEVEN_ROOMS), different(DOORS)


def seven_rooms(*more: Axiom, without: Iterable[Axiom] = ()) -> KnowledgeBase:
    """Return the seven-room map, everything different and visited within the threshold, reasoned
    over.
    """
    axioms = [*SCHEMA, *DOOR_FACTS, *ROBOT_FACTS, *VISITS, PLACES_DIFFER, DOORS_DIFFER]
    left = set(without)
    assert left <= set(axioms)
    kb = KnowledgeBase(IRI, [axiom for axiom in axioms if axiom not in left] + list(more))
    kb.reason()
    return kb


def pairs(kb: KnowledgeBase, prop: str) -> set[tuple[str, str]]:
    """Return all facts of an object property, by local names."""
    places = [*SEVEN_ROOMS, 'Robot1', *DOORS]
    return {
        (place, local_name(target))
        for place in places
        for target in kb.object_values(n(prop), n(place))
    }
