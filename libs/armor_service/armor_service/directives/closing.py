"""The directives that say that no more is true than is known: of a property, of a class.

An ontology leaves open what it does not say: that a room is known to have one door does not say
that it has no other. What a definition like `exactly 1` or `not` needs is stated by these.
"""

from __future__ import annotations

from armor_service.changes import AddAxiom, Change
from armor_service.directives.table import CLS, IND, OBJ, manipulation
from armor_service.protocol import DirectiveError
from armor_service.reference import Reference
from owl_reasoner.owl.axioms import ClassAssertion, ObjectPropertyAssertion
from owl_reasoner.owl.expressions import ObjectComplementOf, ObjectMaxCardinality
from owl_reasoner.owl.vocabulary import THING

MOST_CLOSED = 10_000
"""Individuals that one directive closes a property or class for."""


@manipulation(
    'CLOSE OBJECTPROP IND',
    *(OBJ, IND),
    native=False,
    summary='States that an individual is related by a property to nothing but what is known: to '
    'so many at most. Reason before it.',
)
def _close_for(ref: Reference, prop: str, ind: str) -> list[Change]:
    return [_at_most(ref, prop, ind)]


@manipulation(
    'CLOSE OBJECTPROP',
    OBJ,
    native=False,
    summary='CLOSE OBJECTPROP IND for each individual that is related to any by the property.',
)
def _close_property(ref: Reference, prop: str) -> list[Change]:
    facts = (axiom for axiom in ref.kb.facts() if isinstance(axiom, ObjectPropertyAssertion))
    subjects = sorted({axiom.subject for axiom in facts if axiom.prop == prop})
    _check('CLOSE OBJECTPROP', len(subjects))
    return [_at_most(ref, prop, ind) for ind in subjects]


def _at_most(ref: Reference, prop: str, ind: str) -> AddAxiom:
    count = len(ref.kb.object_values(prop, ind))
    return AddAxiom(ClassAssertion(ObjectMaxCardinality(count, prop, THING), ind))


@manipulation(
    'CLOSE CLASS IND',
    *(CLS, IND),
    native=False,
    summary='States that an individual is not of a class; nothing happens where it is known to be.',
)
def _close_class_for(ref: Reference, cls: str, ind: str) -> list[Change]:
    if cls in ref.kb.types(ind):
        return []
    return [AddAxiom(ClassAssertion(ObjectComplementOf(cls), ind))]


@manipulation(
    'CLOSE CLASS',
    CLS,
    native=False,
    summary='States of each known individual that is not known to be of a class that it is not. '
    'Reason before it; individuals that come later stay open.',
)
def _close_class(ref: Reference, cls: str) -> list[Change]:
    others = sorted(ref.kb.instances(THING) - ref.kb.instances(cls))
    _check('CLOSE CLASS', len(others))
    return [AddAxiom(ClassAssertion(ObjectComplementOf(cls), ind)) for ind in others]


def _check(words: str, count: int) -> None:
    if count > MOST_CLOSED:
        raise DirectiveError(f'{words}: {count} individuals, at most {MOST_CLOSED}')
