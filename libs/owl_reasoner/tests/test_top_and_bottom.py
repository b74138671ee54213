"""The properties that OWL itself defines, and classes that are everything."""

from __future__ import annotations

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import (
    BOTTOM,
    BOTTOM_DATA,
    NOTHING,
    THING,
    TOP,
    TOP_DATA,
    TOP_LITERAL,
)

from .small_ontologies import A, B, C, P, base, i, is_a, j, rel


def test_everybody_is_related_to_everybody_by_the_top_property() -> None:
    other = ax.Declaration('individual', j)
    everybody = ax.SubClassOf(A, ex.ObjectAllValuesFrom(TOP, B))
    assert base(everybody, is_a(A, i), other).instances(B) == {i, j}
    where = ax.SubClassOf(ex.ObjectSomeValuesFrom(TOP, A), C)
    kb = base(where, is_a(A, i), other)
    assert kb.instances(C) == {i, j}
    assert kb.entails(rel(TOP, i, j))


def test_what_includes_the_top_property_relates_everybody() -> None:
    kb = base(ax.SubObjectPropertyOf(TOP, P), is_a(A, i), is_a(A, j))
    assert kb.object_values(P, i) == {i, j}


def test_nobody_is_related_by_the_bottom_property() -> None:
    inside = ax.SubObjectPropertyOf(P, BOTTOM)
    base(inside, rel(P, i, j), consistent=False)
    some = ax.SubClassOf(A, ex.ObjectSomeValuesFrom(P, THING))
    assert base(inside, some, is_a(B, i)).holds(ax.SubClassOf(A, NOTHING))


def test_an_assertion_with_a_bottom_property_contradicts() -> None:
    kb = base(is_a(A, i))
    value = Literal('y')
    for wrong in (rel(BOTTOM, i, j), ax.DataPropertyAssertion(BOTTOM_DATA, i, value)):
        kb.add(wrong)
        assert not kb.reason()
        kb.remove(wrong)
        assert kb.reason()


def test_the_top_properties_relate_everybody_to_itself_and_to_every_value() -> None:
    value = Literal('y')
    kb = base(is_a(A, i))
    assert kb.entails(ax.ReflexiveObjectProperty(TOP))
    assert kb.entails(ax.DataPropertyAssertion(TOP_DATA, i, value))
    assert kb.entails(ax.SubClassOf(A, ex.DataMinCardinality(9, TOP_DATA, TOP_LITERAL)))
    assert not kb.entails(ax.FunctionalDataProperty(TOP_DATA))
    denied = ax.NegativeDataPropertyAssertion(TOP_DATA, i, value)
    for wrong in (denied, ax.FunctionalDataProperty(TOP_DATA)):
        assert not KnowledgeBase('x:', [wrong]).reason()
    below = KnowledgeBase('x:', [ax.SubDataPropertyOf(TOP_DATA, P), is_a(A, i)])
    assert below.reason()
    assert any('topDataProperty' in sentence for sentence in below.unsupported)


def test_a_class_of_everybody_has_everything_below() -> None:
    kb = base(ax.SubClassOf(THING, A), ax.SubClassOf(B, C))
    assert kb.subclasses(A) == {THING, B, C}
    union = ex.ObjectUnionOf((B, ex.ObjectComplementOf(B)))
    assert base(ax.EquivalentClasses((A, union))).subclasses(A) == {THING, B}
    assert base(ax.SubClassOf(B, C)).subclasses(C) == {B}


def test_what_an_axiom_lists_twice_counts_once() -> None:
    assert base(ax.DisjointUnion(A, (B, C, B)), is_a(B, i)).types(i) == {A, B}
    assert base(ax.DisjointClasses((A, B, A)), is_a(A, i)).types(i) == {A}
    base(ax.DisjointClasses((A, A)), is_a(A, i), consistent=False)


def test_a_class_that_an_assertion_empties_is_possible_again_without_it() -> None:
    nobody_is_b = ax.ClassAssertion(ex.ObjectAllValuesFrom(TOP, ex.ObjectComplementOf(B)), i)
    kb = base(ax.SubClassOf(A, ex.ObjectUnionOf((B, C))), is_a(C, j), nobody_is_b)
    assert B in kb.subclasses(NOTHING)
    assert kb.superclasses(A) == {C}
    kb.remove(nobody_is_b)
    assert kb.reason()
    assert B not in kb.subclasses(NOTHING)
    assert kb.superclasses(A) == set()
