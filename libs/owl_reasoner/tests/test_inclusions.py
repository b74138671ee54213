"""An axiom about classes or a property's ends says what the inclusions that it stands for say."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.inclusions import (
    PropertyHierarchy,
    class_inclusions,
    property_inclusions,
)

from .small_ontologies import A, B, C, P

Q, V = 'x:q', 'x:v'


@pytest.mark.parametrize(
    'axiom',
    [
        ax.EquivalentClasses((A, B)),
        ax.DisjointClasses((A, B, C)),
        ax.DisjointUnion(A, (B, C)),
        ax.ObjectPropertyDomain(P, A),
        ax.ObjectPropertyRange(ex.ObjectInverseOf(P), A),
        ax.DataPropertyDomain(V, A),
        ax.DataPropertyRange(V, XSD + 'integer'),
        ax.FunctionalObjectProperty(P),
        ax.InverseFunctionalObjectProperty(P),
        ax.FunctionalDataProperty(V),
        ax.ReflexiveObjectProperty(P),
        ax.IrreflexiveObjectProperty(P),
    ],
    ids=lambda axiom: type(axiom).__name__,
)
def test_an_axiom_and_its_inclusions_follow_from_each_other(axiom: Axiom) -> None:
    included = [ax.SubClassOf(*pair) for pair in class_inclusions(axiom)]
    assert KnowledgeBase('x:', included).entails(axiom) is True
    kb = KnowledgeBase('x:', [axiom])
    assert [kb.entails(inclusion) for inclusion in included] == [True] * len(included)
    assert KnowledgeBase('x:', [ax.Declaration('class', A)]).entails(axiom) is False


def test_an_axiom_that_is_no_inclusion_of_classes_has_none() -> None:
    assert not list(class_inclusions(ax.AsymmetricObjectProperty(P)))
    assert not list(property_inclusions(ax.SubClassOf(A, B)))


def test_a_property_is_as_functional_as_one_above_it() -> None:
    back = ex.ObjectInverseOf(P)
    known = PropertyHierarchy([ax.SubObjectPropertyOf(P, Q), ax.InverseFunctionalObjectProperty(Q)])
    assert known.is_functional(back)
    assert not known.is_functional(P)
    assert known.above(back) == {(P, True), (Q, True)}
