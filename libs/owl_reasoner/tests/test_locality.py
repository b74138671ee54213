"""Which axioms can matter: nothing that follows is lost, and little is left."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, SubClassOf
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.locality import locality_module

from .random_ontologies import CLASSES, RandomOntology

A, B, C, D = (f'urn:o#{name}' for name in 'ABCD')
P, Q, V = 'urn:o#p', 'urn:o#q', 'urn:o#v'


def follows(axioms: list[Axiom], goal: Axiom) -> bool:
    declared = [ax.Declaration(kind, name) for kind, name in entities_of(goal)]
    kb = KnowledgeBase('urn:o', [*axioms, *declared])
    return kb.reason() and kb.holds(goal)


@pytest.mark.parametrize('seed', range(25))
def test_what_follows_follows_from_the_module(seed: int) -> None:
    axioms = list(dict.fromkeys(RandomOntology(seed).ontology(6, 6)))
    kb = KnowledgeBase('urn:o', axioms)
    if not kb.reason():
        return
    goals: list[Axiom] = []
    goals += list(kb.derived_facts())[:4]
    goals += [SubClassOf(c, d) for c in CLASSES for d in sorted(kb.superclasses(c))][:4]
    for goal in goals:
        module = locality_module(axioms, (goal,))
        assert set(module) <= set(axioms)
        assert follows(module, goal), (goal, module)


@pytest.mark.parametrize(
    ('axiom', 'goal'),
    [
        (SubClassOf(C, A), SubClassOf(A, B)),
        (SubClassOf(ex.ObjectIntersectionOf((A, C)), B), SubClassOf(A, B)),
        (SubClassOf(ex.ObjectSomeValuesFrom(P, A), B), SubClassOf(A, B)),
        (SubClassOf(ex.ObjectMinCardinality(2, P, A), B), SubClassOf(A, B)),
        (SubClassOf(ex.DataHasValue(V, ex.Literal('x')), B), SubClassOf(A, B)),
        (SubClassOf(A, ex.ObjectAllValuesFrom(P, B)), SubClassOf(A, B)),
        (SubClassOf(A, ex.ObjectMaxCardinality(1, P)), SubClassOf(A, B)),
        (SubClassOf(A, ex.ObjectComplementOf(C)), SubClassOf(A, B)),
        (SubClassOf(A, ex.ObjectExactCardinality(0, P)), SubClassOf(A, B)),
        (SubClassOf(A, ex.DataExactCardinality(0, V)), SubClassOf(A, B)),
        (SubClassOf(A, ex.DataMinCardinality(0, V)), SubClassOf(A, B)),
        (ax.EquivalentClasses((C, ex.ObjectSomeValuesFrom(P, A))), SubClassOf(A, B)),
        (ax.DisjointClasses((A, C, D)), SubClassOf(A, B)),
        (ax.DisjointUnion(C, (D, 'urn:o#E')), SubClassOf(A, B)),
        (ax.ObjectPropertyDomain(P, A), SubClassOf(A, B)),
        (ax.SubObjectPropertyOf(P, Q), SubClassOf(A, B)),
        (ax.SubPropertyChainOf((P, Q), P), SubClassOf(A, B)),
        (ax.TransitiveObjectProperty(P), SubClassOf(A, B)),
        (ax.InverseObjectProperties(P, Q), SubClassOf(A, B)),
    ],
)
def test_what_says_nothing_of_the_goal_is_left_out(axiom: Axiom, goal: Axiom) -> None:
    assert locality_module([axiom], (goal,)) == []


@pytest.mark.parametrize(
    'axiom',
    [
        SubClassOf(A, C),
        SubClassOf(ex.ObjectComplementOf(C), B),
        SubClassOf(ex.ObjectAllValuesFrom(P, C), B),
        SubClassOf(A, ex.ObjectSomeValuesFrom(P, C)),
        SubClassOf(A, ex.ObjectMinCardinality(1, P)),
        SubClassOf(A, ex.DataExactCardinality(1, V)),
        SubClassOf(ex.ObjectExactCardinality(0, P, C), B),
        SubClassOf(ex.ObjectUnionOf((A, C)), D),
        ax.EquivalentClasses((A, C)),
        ax.DisjointClasses((A, B)),
        ax.DisjointClasses((A, A)),
        ax.DisjointUnion(A, (C, D)),
        ax.ReflexiveObjectProperty(P),
        ax.SameIndividual(frozenset((C, D))),
        ax.HasKey(C, (P,), ()),
        ax.Rule((ex.ClassAtom(C, ex.Variable('x')),), (ex.ClassAtom(D, ex.Variable('x')),)),
        ax.DatatypeDefinition('urn:o#T', ex.DataOneOf((ex.Literal('x'),))),
        ax.ObjectPropertyAssertion(P, 'urn:i', 'urn:j'),
    ],
)
def test_what_can_matter_stays(axiom: Axiom) -> None:
    assert locality_module([axiom], (SubClassOf(A, B),)) == [axiom]


def test_a_subclass_of_a_large_ontology_is_explained_from_its_own_part() -> None:
    """SOMA, of 5,000 axioms, took more than a minute."""
    axioms: list[Axiom] = []
    for number in range(200):
        top, left, right, low = (f'urn:o#{name}{number}' for name in 'TLRX')
        axioms += [
            SubClassOf(low, ex.ObjectUnionOf((left, right))),
            SubClassOf(left, top),
            SubClassOf(right, top),
        ]
    kb = KnowledgeBase('urn:o', axioms)
    kb.reason()
    goal = SubClassOf('urn:o#X7', 'urn:o#T7')
    explanation = kb.explain(goal, steps=1_000)
    assert explanation is not None
    assert set(explanation.sources()) == set(axioms[21:24])
