"""Each reason for which two individuals are different, while it lasts."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axioms import (
    AsymmetricObjectProperty,
    Axiom,
    DisjointClasses,
    DisjointDataProperties,
    DisjointObjectProperties,
    FunctionalDataProperty,
    FunctionalObjectProperty,
    InverseFunctionalObjectProperty,
    IrreflexiveObjectProperty,
    NegativeDataPropertyAssertion,
    NegativeObjectPropertyAssertion,
    Rule,
    SubClassOf,
    SymmetricObjectProperty,
    TransitiveObjectProperty,
)
from owl_reasoner.owl.expressions import (
    ClassAtom,
    DifferentIndividualsAtom,
    ObjectComplementOf,
    ObjectIntersectionOf,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectPropertyAtom,
)
from owl_reasoner.owl.vocabulary import NOTHING
from owl_reasoner.reasoner.join_network import transitive
from owl_reasoner.reasoner.translation import Translation

from .small_ontologies import (
    A,
    B,
    C,
    D,
    P,
    Q,
    S,
    T,
    X,
    Y,
    Z,
    differ,
    has,
    i,
    is_a,
    j,
    k,
    m,
    num,
    rel,
    same,
)

BACK = ObjectInverseOf(P)
APART = Rule(
    (ClassAtom(D, X), ClassAtom(D, Y), DifferentIndividualsAtom(X, Y)),
    (ObjectPropertyAtom('x:apart', X, Y),),
)
"""So that somebody asks who is different, and facts rest on it."""


@pytest.mark.parametrize('with_rule', [False, True])
@pytest.mark.parametrize(
    ('schema', 'facts'),
    [
        ([], [differ(i, j)]),
        ([], [differ(i, j, k)]),
        ([], [differ(i, k), same(j, k)]),
        ([DisjointClasses((A, B))], [is_a(A, i), is_a(B, j)]),
        ([DisjointClasses((A, B)), SubClassOf(C, B)], [is_a(A, i), is_a(C, j)]),
        ([SubClassOf(ObjectIntersectionOf((A, B)), NOTHING)], [is_a(A, i), is_a(B, j)]),
        ([], [is_a(ObjectComplementOf(A), i), is_a(A, j)]),
        ([IrreflexiveObjectProperty(P)], [rel(P, i, j)]),
        ([IrreflexiveObjectProperty(P)], [rel(P, j, i)]),
        ([AsymmetricObjectProperty(P)], [rel(P, i, k), rel(P, k, j)]),
        ([AsymmetricObjectProperty(P)], [rel(P, k, i), rel(P, j, k)]),
        ([AsymmetricObjectProperty(P)], [rel(P, i, j)]),
        ([DisjointObjectProperties((P, Q))], [rel(P, i, k), rel(Q, j, k)]),
        ([DisjointObjectProperties((P, Q))], [rel(P, k, i), rel(Q, k, j)]),
        ([DisjointObjectProperties((BACK, Q))], [rel(P, k, i), rel(Q, j, k)]),
        ([DisjointObjectProperties((BACK, Q))], [rel(P, i, k), rel(Q, k, j)]),
        ([], [NegativeObjectPropertyAssertion(P, i, k), rel(P, j, k)]),
        ([], [NegativeObjectPropertyAssertion(P, k, i), rel(P, k, j)]),
        ([FunctionalObjectProperty(P)], [rel(P, i, k), rel(P, j, m), differ(k, m)]),
        ([InverseFunctionalObjectProperty(P)], [rel(P, k, i), rel(P, m, j), differ(k, m)]),
        (
            [SubClassOf(A, ObjectMaxCardinality(1, P, B))],
            [is_a(A, i), rel(P, i, k), rel(P, j, m), is_a(B, k), is_a(B, m), differ(k, m)],
        ),
        ([FunctionalDataProperty(S)], [has(S, i, 1), has(S, j, 2)]),
        ([], [NegativeDataPropertyAssertion(S, i, num(1)), has(S, j, 1)]),
        ([DisjointDataProperties((S, T))], [has(S, i, 1), has(T, j, 1)]),
    ],
)
def test_two_are_different_as_long_as_each_fact_says_so(
    schema: list[Axiom], facts: list[Axiom], with_rule: bool
) -> None:
    rule: list[Axiom] = [APART, is_a(D, i), is_a(D, j)] if with_rule else []
    kb = KnowledgeBase('x:', [*schema, *rule, *facts])

    def look(expected: bool) -> None:
        assert kb.reason()
        assert kb.holds(differ(i, j)) is expected
        if with_rule:
            assert kb.holds(rel('x:apart', i, j)) is expected
            assert kb.holds(rel('x:apart', j, i)) is expected
        explanation = kb.explain(differ(i, j))
        assert (explanation is not None) is expected
        if explanation is not None:
            assert {*facts} <= {*explanation.sources()} <= {*facts, *schema}

    look(True)
    for fact in facts:
        kb.remove(fact)
        look(False)
        kb.add(fact)
        look(True)
    if same(j, k) not in facts and differ(i, j, k) not in facts:
        together = same(i, j)
        kb.add(together)
        assert not kb.reason()
        kb.change([], [facts[0]])
        assert kb.reason()
        assert kb.holds(together)
        kb.change([facts[0]])
        assert not kb.reason()
        kb.remove(together)
        look(True)


@pytest.mark.parametrize(
    ('axiom', 'is_transitive'),
    [
        (TransitiveObjectProperty(P), True),
        (TransitiveObjectProperty(BACK), True),
        (SymmetricObjectProperty(P), False),
        (
            Rule(
                (ObjectPropertyAtom(P, X, Y), ObjectPropertyAtom(P, Y, Z)),
                (ObjectPropertyAtom(P, X, Z),),
            ),
            False,
        ),
        (AsymmetricObjectProperty(P), False),
        (DisjointObjectProperties((P, Q)), False),
    ],
)
def test_the_clause_of_a_transitive_property_is_known(axiom: Axiom, is_transitive: bool) -> None:
    clauses = [clause for clause in Translation([axiom]).program.clauses if clause.origin]
    found = [transitive(clause) for clause in clauses]
    assert [prop.name for prop in found if prop is not None] == [P] * is_transitive
