"""Which numbers of another program take the place of one that is there."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from armor_service.store.assigned_numbers import assigned_numbers
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, DataPropertyAssertion
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD

CLS, PROP, ONE = 'x:Room', 'x:at', 'x:r'
EXACTLY = ex.DataExactCardinality(1, PROP, XSD + 'long')
ALLOWS_ONE: list[Axiom] = [
    ax.FunctionalDataProperty(PROP),
    ax.SubClassOf(CLS, ex.DataMaxCardinality(1, PROP, XSD + 'long')),
    ax.EquivalentClasses((CLS, ex.ObjectIntersectionOf(('x:Place', EXACTLY)))),
]
ALLOWS_MORE: list[Axiom] = [
    ax.SubClassOf(CLS, ex.DataMaxCardinality(2, PROP, XSD + 'long')),
    ax.SubClassOf(EXACTLY, CLS),
    ax.FunctionalDataProperty('x:other'),
]


def said(text: str, kind: str = 'integer') -> DataPropertyAssertion:
    return DataPropertyAssertion(PROP, ONE, Literal(text, XSD + kind))


def assigned(
    axiom: Axiom, old: Sequence[Axiom], come: Sequence[Axiom], gone: Sequence[Axiom]
) -> list[Axiom]:
    """Return what numbers that came are to be."""
    kb = KnowledgeBase('x:', [axiom, ax.ClassAssertion(CLS, ONE), *old])
    kb.reason()
    return [typed for _, typed in assigned_numbers(kb, come, gone)]


@pytest.mark.parametrize('axiom', ALLOWS_ONE)
def test_where_one_value_is_allowed_the_new_one_takes_its_place_and_type(axiom: Axiom) -> None:
    assert assigned(axiom, [said('7', 'long')], [said('8')], []) == [said('8', 'long')]
    new: list[Axiom] = [said('0.5', 'decimal')]
    assert assigned(axiom, [said('7', 'double')], new, []) == [said('0.5', 'double')]


@pytest.mark.parametrize('axiom', ALLOWS_MORE)
def test_where_more_are_allowed_both_are_values(axiom: Axiom) -> None:
    assert assigned(axiom, [said('7', 'long')], [said('8')], []) == []


def test_what_is_no_such_assignment_is_left_as_it_is() -> None:
    (one, *_), seven = ALLOWS_ONE, said('7', 'long')
    assert assigned(one, [seven], [said('8')], [seven]) == [], 'the old one was removed'
    assert assigned(one, [seven], [said('8'), said('9')], []) == [], 'two came'
    assert assigned(one, [seven], [said('8', 'decimal')], []) == [], 'not as owlready2 writes it'
    assert assigned(one, [said('7')], [said('8')], []) == [], 'owlready2 removes these'
    assert assigned(one, [], [said('8')], []) == []
