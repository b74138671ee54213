"""What is left open beside rules is named with its axiom and somebody, and nothing else is."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axioms import Axiom, HasKey, Rule, SubClassOf
from owl_reasoner.owl.expressions import (
    Atom,
    ClassAtom,
    DataPropertyAtom,
    DataSomeValuesFrom,
    DatatypeRestriction,
    DifferentIndividualsAtom,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectMinCardinality,
    ObjectPropertyAtom,
    ObjectSomeValuesFrom,
    SameIndividualAtom,
)
from owl_reasoner.owl.vocabulary import THING, XSD

from .small_ontologies import (
    A,
    B,
    C,
    D,
    P,
    Q,
    S,
    T,
    V,
    W,
    X,
    Y,
    Z,
    computed,
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

ANY_RULE = Rule((ClassAtom(D, X),), (ClassAtom('x:E', X),))
TWO = SubClassOf(ObjectMinCardinality(2, P, B), A)
FEW = SubClassOf(A, ObjectMaxCardinality(2, P))
SOME = SubClassOf(C, ObjectSomeValuesFrom(P, B))
LINKS = [rel(P, i, j), rel(P, i, k), is_a(B, j), is_a(B, k)]
THREE = [rel(P, i, j), rel(P, i, k), rel(P, i, m), is_a(A, i)]
BOTH: tuple[Atom, ...] = (
    ObjectPropertyAtom(P, X, Y),
    ObjectPropertyAtom(P, X, Z),
    DifferentIndividualsAtom(Y, Z),
)
APART = Rule(BOTH, (ClassAtom(A, X),))
SAME = Rule(BOTH, (SameIndividualAtom(X, Y),))
TEXT_TWO = 'x:p min 2 x:B SubClassOf x:A'
TEXT_FEW = 'x:A SubClassOf x:p max 2 Thing'
TEXT_BOTH = 'x:p(?x, ?y), x:p(?x, ?z), differentFrom(?y, ?z)'


def left_open(*axioms: Axiom) -> list[tuple[str, str]]:
    """Return the axioms that are named, as text, with who they are open for."""
    kb = KnowledgeBase('x:', axioms)
    assert kb.reason()
    kind = 'which individuals are the same'
    found = []
    for sentence in kb.unsupported:
        text, _, rest = sentence.partition(': for ')
        name, _, what = rest.partition(' it depends on ')
        assert what in (
            f'{kind}, which would need reasoning by cases',
            'a value of x:s that is not known, which would need reasoning by cases',
        )
        found.append((text, name))
    return found


@pytest.mark.parametrize(
    ('axioms', 'expected'),
    [
        ([TWO, *LINKS, ANY_RULE], [(TEXT_TWO, i)]),
        ([TWO, *LINKS], []),  # Without rules it is found by cases.
        ([TWO, *LINKS, differ(j, k), ANY_RULE], []),
        ([TWO, *LINKS, same(j, k), ANY_RULE], []),
        ([TWO, *LINKS[:3], ANY_RULE], []),
        ([SubClassOf(ObjectMinCardinality(3, P, B), A), *LINKS, ANY_RULE], []),
        ([FEW, *THREE, ANY_RULE], [(TEXT_FEW, i)]),
        ([FEW, *THREE], []),
        ([FEW, *THREE[1:], ANY_RULE], []),
        ([FEW, *THREE[:3], ANY_RULE], []),
        ([FEW, *THREE, same(j, k), ANY_RULE], []),
        ([FEW, *THREE, differ(j, k), differ(k, m), ANY_RULE], []),
        ([FEW, *THREE, differ(j, k), ANY_RULE], [(TEXT_FEW, i)]),
        (
            [SubClassOf(THING, ObjectMaxCardinality(2, P)), *THREE, ANY_RULE],
            [('Thing SubClassOf x:p max 2 Thing', i)],
        ),
        ([SubClassOf(A, ObjectMaxCardinality(2, P, B)), *THREE, ANY_RULE], []),
        ([SOME, TWO, is_a(C, i), rel(P, i, j), ANY_RULE], [(TEXT_TWO, i)]),
        ([SOME, TWO, is_a(C, i), rel(P, i, j)], []),
        ([SOME, TWO, is_a(C, i), ANY_RULE], []),
        ([SOME, TWO, is_a(C, i), rel(P, i, j), is_a(B, j), ANY_RULE], []),
        ([SOME, TWO, is_a(C, i), rel(Q, i, j), ANY_RULE], []),
        (
            [
                SOME,
                SubClassOf(ObjectMinCardinality(3, P, B), A),
                is_a(C, i),
                rel(P, i, j),
                ANY_RULE,
            ],
            [],
        ),
        (
            [
                SubClassOf(C, ObjectSomeValuesFrom(ObjectInverseOf(P), B)),
                SubClassOf(ObjectMinCardinality(2, ObjectInverseOf(P), B), A),
                *(is_a(C, i), rel(P, j, i), ANY_RULE),
            ],
            [('inverse x:p min 2 x:B SubClassOf x:A', i)],
        ),
        ([*LINKS, APART], [(f'{TEXT_BOTH} -> x:A(?x)', j)]),
        ([*LINKS, differ(j, k), APART], []),
        ([*LINKS, is_a(A, i), APART], []),
        ([LINKS[0], APART], []),
        ([*LINKS, SAME], [(f'{TEXT_BOTH} -> sameAs(?x, ?y)', j)]),
        (
            [
                rel(P, i, i),
                rel(P, i, k),
                Rule((*BOTH, ClassAtom(B, Z)), (SameIndividualAtom(X, Y),)),
                is_a(B, k),
            ],
            [],
        ),
    ],
)
def test_who_is_the_same_is_open_for_somebody(
    axioms: list[Axiom], expected: list[tuple[str, str]]
) -> None:
    assert left_open(*axioms) == expected


def between(low: int, high: int) -> DatatypeRestriction:
    facets = ((XSD + 'minInclusive', num(low)), (XSD + 'maxInclusive', num(high)))
    return DatatypeRestriction(XSD + 'integer', facets)


VALUE = DataPropertyAtom(S, X, V)
MORE = (VALUE, computed('add', W, V, 1), computed('greaterThan', W, 3))
MANY = SubClassOf(A, DataSomeValuesFrom(S, between(1, 9_999_999)))
ADDING = 'x:s(?x, ?v), add(?w, ?v, 1), greaterThan(?w, 3)'
OF_CLASS: dict[Atom, str] = {ClassAtom(C, X): ', x:C(?x)', ClassAtom(C, Y): ', x:C(?y)'}


@pytest.mark.parametrize(
    ('axioms', 'body', 'is_open', 'follows'),
    [
        ([MANY, is_a(A, i)], MORE, True, False),
        ([MANY], MORE, False, False),
        ([MANY, is_a(A, i), is_a(B, i)], MORE, False, True),
        ([MANY, is_a(A, i), has(S, i, 2)], MORE, False, False),
        ([MANY, is_a(A, i), has(S, i, 3)], MORE, False, True),
        ([MANY, is_a(A, i), has(S, i, -3)], MORE, True, False),
        ([MANY, is_a(A, i)], (*MORE, ClassAtom(C, X)), False, False),
        ([MANY, is_a(A, i), is_a(C, i)], (*MORE, ClassAtom(C, X)), True, False),
        ([MANY, is_a(A, i), is_a(C, j)], (*MORE, ClassAtom(C, Y)), True, False),
        ([MANY, is_a(A, i)], (*MORE, ClassAtom(C, Y)), False, False),
        ([MANY, is_a(A, i)], (VALUE, computed('greaterThan', V, 0)), False, True),
        ([MANY, is_a(A, i)], (VALUE, computed('greaterThan', V, 3)), False, False),
        ([SubClassOf(A, DataSomeValuesFrom(S, between(3, 5))), is_a(A, i)], MORE, False, True),
        ([SubClassOf(A, DataSomeValuesFrom(S, between(2, 5))), is_a(A, i)], MORE, False, False),
    ],
)
def test_a_value_that_must_exist_is_open_for_somebody(
    axioms: list[Axiom], body: tuple[Atom, ...], is_open: bool, follows: bool
) -> None:
    rule = Rule(body, (ClassAtom(B, X),))
    text = ADDING + OF_CLASS.get(body[-1], '')
    assert left_open(*axioms, rule) == ([(f'{text} -> x:B(?x)', i)] if is_open else [])
    kb = KnowledgeBase('x:', [*axioms, rule])
    kb.reason()
    assert kb.holds(is_a(B, i)) is follows


@pytest.mark.parametrize(
    ('low', 'high', 'value', 'are_same'), [(1, 1, 1, True), (1, 2, 1, False), (1, 1, 2, False)]
)
def test_a_key_with_a_value_that_must_exist(
    low: int, high: int, value: int, are_same: bool
) -> None:
    required = SubClassOf(A, DataSomeValuesFrom(S, between(low, high)))
    kb = KnowledgeBase(
        'x:', [HasKey(THING, (), (S,)), required, is_a(A, i), has(S, j, value), has(T, j, 1)]
    )
    assert kb.reason()
    assert kb.holds(same(i, j)) is are_same
    assert kb.unsupported == ()


def test_of_one_too_many_the_only_pair_that_may_be_the_same_is() -> None:
    apart = [differ(j, k), differ(k, m)]
    for rules in ([], [ANY_RULE]):
        kb = KnowledgeBase('x:', [FEW, *THREE, *apart, is_a(B, j), *rules])
        assert kb.reason()
        assert kb.unsupported == ()
        assert kb.holds(same(j, m))
        assert kb.holds(is_a(B, m))
        kb.remove(apart[0])
        kb.reason()
        assert not kb.holds(same(j, m))
        kb.change([apart[0], differ(j, m)])
        assert not kb.reason()
