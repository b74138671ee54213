"""Read an OWL file, reason over it, change a fact, and ask why something holds. No ROS, no Java."""

from __future__ import annotations

from pathlib import Path

from owl_reasoner import KnowledgeBase, read_ontology
from owl_reasoner.owl.axioms import (
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    ObjectPropertyAssertion,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD, local_name

IRI = 'http://bnc/exp-rob-lab/2022-23'


def named(name: str) -> str:
    return f'{IRI}#{name}'


def main() -> None:
    """Build a corridor with two rooms on top of the patrol's classes and rules."""
    path = Path(__file__).with_name('patrol.owl')
    document = read_ontology(path, IRI)
    kb = KnowledgeBase(IRI, document.axioms)
    print(f'{len(kb)} axioms from {path.name}; not understood: {document.unsupported or "nothing"}')

    for place, door in (('Hall', 'D1'), ('Hall', 'D2'), ('Kitchen', 'D1'), ('Office', 'D2')):
        kb.add(ObjectPropertyAssertion(named('hasDoor'), named(place), named(door)))
    places = ('Hall', 'Kitchen', 'Office')
    kb.add(DifferentIndividuals(frozenset(map(named, places))))
    kb.add(DifferentIndividuals(frozenset((named('D1'), named('D2')))))
    for place, visit in zip(places, (100, 90, 10), strict=True):
        literal = Literal(str(visit), XSD + 'long')
        kb.add(DataPropertyAssertion(named('visitedAt'), named(place), literal))
    robot = named('Robot1')
    kb.add(ObjectPropertyAssertion(named('isIn'), robot, named('Hall')))
    for prop, value in (('now', 100), ('urgencyThreshold', 30)):
        for old in kb.asserted_values(named(prop), robot):
            kb.remove(DataPropertyAssertion(named(prop), robot, old))
        kb.add(DataPropertyAssertion(named(prop), robot, Literal(str(value), XSD + 'long')))

    print('consistent:', kb.reason())
    print('corridors: ', sorted(map(local_name, kb.instances(named('CORRIDOR')))))
    print('urgent:    ', sorted(map(local_name, kb.instances(named('URGENT')))))
    print('reachable: ', sorted(map(local_name, kb.object_values(named('canReach'), robot))))
    why = kb.explain(ClassAssertion(named('URGENT'), named('Office')))
    assert why is not None
    print(why.sentence())
    print(why.tree())

    kb.add(ObjectPropertyAssertion(named('isIn'), robot, named('Kitchen')))
    print('consistent in two places:', kb.reason())
    clash = kb.explain_inconsistency()
    assert clash is not None
    print(clash.sentence())


if __name__ == '__main__':
    main()
