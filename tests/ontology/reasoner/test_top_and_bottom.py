"""The properties that OWL itself defines, and classes that are everything."""

from __future__ import annotations

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.vocabulary import NOTHING, OWL, THING
from tests.ontology.reasoner.small_ontologies import A, B, C, P, base, i, is_a, j, rel

TOP, BOTTOM = OWL + 'topObjectProperty', OWL + 'bottomObjectProperty'


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
