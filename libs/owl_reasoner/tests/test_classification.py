"""What the classification of an ontology's classes and properties says, by small ontologies."""

from __future__ import annotations

import pytest

from owl_reasoner.owl.axioms import (
    AsymmetricObjectProperty,
    Axiom,
    DisjointClasses,
    DisjointDataProperties,
    DisjointObjectProperties,
    FunctionalDataProperty,
    IrreflexiveObjectProperty,
    ObjectPropertyDomain,
    ObjectPropertyRange,
    SubClassOf,
    SubDataPropertyOf,
    SubObjectPropertyOf,
)
from owl_reasoner.owl.expressions import (
    ClassExpression,
    DataHasValue,
    DataMaxCardinality,
    DataMinCardinality,
    DataOneOf,
    DataSomeValuesFrom,
    DatatypeRestriction,
    ObjectAllValuesFrom,
    ObjectHasValue,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectOneOf,
    ObjectSomeValuesFrom,
)
from owl_reasoner.owl.vocabulary import NOTHING, OWL, THING, TOP_LITERAL, XSD
from owl_reasoner.reasoner.clauses import PredicateAtom
from owl_reasoner.reasoner.consequence_based.classification import Classification

from .small_ontologies import A, B, C, D, P, Q, R, S, T, base, has, i, is_a, j, k, num, rel

E = 'x:E'


def exclusions(*axioms: Axiom) -> tuple[set[str], set[tuple[str, str, bool]]]:
    """Return what is irreflexive, and which pairs exclude each other, the second turned or not."""
    program = Classification(axioms).program
    names = {prop.name for prop in program.irreflexive}
    pairs = {
        (one.name, other.name, backwards != turned)
        for one, turned, other, backwards in program.disjoint_properties
    }
    return (
        {name for name in names if not name.startswith(OWL)},
        {(*sorted(pair[:2]), pair[2]) for pair in pairs if not pair[1].startswith(OWL)},
    )


@pytest.mark.parametrize(
    ('axioms', 'irreflexive', 'disjoint'),
    [
        (
            [
                IrreflexiveObjectProperty(Q),
                SubObjectPropertyOf(P, Q),
                SubObjectPropertyOf(ObjectInverseOf(R), Q),
                SubObjectPropertyOf(S, T),
            ],
            {P, Q, R},
            set(),
        ),
        (
            [AsymmetricObjectProperty(Q), SubObjectPropertyOf(P, Q), SubObjectPropertyOf(Q, T)],
            {P, Q},
            {(P, P, True), (P, Q, True), (Q, Q, True)},
        ),
        (
            [
                DisjointObjectProperties((P, Q)),
                SubObjectPropertyOf(R, Q),
                SubObjectPropertyOf(ObjectInverseOf(S), Q),
            ],
            set(),
            {(P, Q, False), (P, R, False), (P, S, True)},
        ),
        (
            [
                ObjectPropertyDomain(P, A),
                ObjectPropertyRange(P, B),
                DisjointClasses((A, B)),
                IrreflexiveObjectProperty(Q),
            ],
            {P, Q},
            set(),
        ),
        ([SubObjectPropertyOf(P, Q)], set(), set()),
    ],
)
def test_properties_that_exclude_each_other(
    axioms: list[Axiom], irreflexive: set[str], disjoint: set[tuple[str, str, bool]]
) -> None:
    assert exclusions(*axioms) == (irreflexive, disjoint)


def test_the_hierarchy_and_what_cases_add_to_it() -> None:
    found = Classification(
        [
            SubClassOf(A, ObjectOneOf((i,))),
            SubClassOf(B, ObjectHasValue(P, j)),
            SubClassOf(C, A),
            SubClassOf(D, NOTHING),
        ]
    )
    assert found.classes() == (THING, A, B, C, D)
    assert found.within == {A: frozenset({i}), C: frozenset({i})}
    assert [found.superclasses(one) for one in (A, C, D, E)] == [set(), {A}, {A, B, C}, set()]
    assert [found.subclasses(one) for one in (A, C, D, E)] == [{C, D}, {D}, set(), {D}]
    assert [found.is_impossible(one) for one in (A, C, D)] == [False, False, True]
    for sub, sup, below in (
        *((C, A, True), (A, C, False), (A, A, True), (A, THING, True), (A, NOTHING, False)),
        *((D, A, True), (D, NOTHING, True), (E, A, False), (E, THING, True)),
    ):
        assert found.below_by_itself(sub, sup) is below
    found.complete([(A, B), (C, NOTHING)])
    assert [found.superclasses(one) for one in (A, C, D)] == [{B}, {A, B, D}, {A, B, C}]
    assert [found.is_impossible(one) for one in (A, C, D)] == [False, True, True]
    assert found.subclasses(B) == {A, C, D}
    assert not found.below_by_itself(A, B)
    found.complete([])
    assert [found.superclasses(one) for one in (A, C, D)] == [set(), {A}, {A, B, C}]
    assert [found.is_impossible(one) for one in (A, C, D)] == [False, False, True]


SOME = SubClassOf(A, ObjectSomeValuesFrom(P, B))
ONLY = SubClassOf(C, ObjectAllValuesFrom(P, D))


@pytest.mark.parametrize(
    ('axioms', 'interacting'),
    [
        ([], False),
        ([ONLY], False),
        ([ONLY, SubClassOf(ObjectSomeValuesFrom(P, D), E)], True),
        ([ONLY, SubClassOf(ObjectSomeValuesFrom(Q, D), E)], False),
        ([ONLY, DisjointClasses((B, D))], True),
        ([SubClassOf(ObjectSomeValuesFrom(P, B), E)], False),
    ],
)
def test_classes_that_mean_more_together_are_told(axioms: list[Axiom], interacting: bool) -> None:
    assert Classification([SOME, *axioms]).program.interacting is interacting


@pytest.mark.parametrize(
    ('most', 'counted', 'told'), [(1, P, False), (2, P, True), (2, R, False), (3, P, True)]
)
def test_that_who_must_exist_may_be_one_of_several_is_told(
    most: int, counted: str, told: bool
) -> None:
    # It must exist by a property below the one that is counted.
    some = SubClassOf(A, ObjectSomeValuesFrom(Q, B))
    few = SubClassOf(A, ObjectMaxCardinality(most, counted))
    found = Classification([few, SubObjectPropertyOf(Q, P), some]).program.unsupported
    sentence = f'{A} SubClassOf {counted} max {most} Thing: together with what must exist, '
    assert [text.startswith(sentence) for text in found] == [True] * told


def test_the_only_neighbour_in_a_class_is_who_must_exist() -> None:
    few = SubClassOf(A, ObjectMaxCardinality(1, P, C))
    below = SubObjectPropertyOf(Q, P)
    facts = [is_a(A, i), rel(P, i, j), rel(P, i, k), is_a(C, j)]
    for inside, follows in ((SubClassOf(B, C), True), (SubClassOf(C, B), False)):
        kb = base(few, below, SubClassOf(A, ObjectSomeValuesFrom(Q, B)), inside, *facts)
        assert kb.holds(rel(Q, i, j)) is follows
        assert not kb.holds(rel(Q, i, k))
        assert not kb.holds(is_a(B, k))
        assert kb.holds(is_a(B, j))  # as the one in Q, or as a member of C
    backwards = SubObjectPropertyOf(ObjectInverseOf(Q), P)
    needed = SubClassOf(A, ObjectSomeValuesFrom(ObjectInverseOf(Q), C))
    kb = base(few, backwards, needed, *facts)
    assert kb.holds(rel(Q, j, i))
    assert not kb.holds(rel(Q, i, j))


@pytest.mark.parametrize(('most', 'known'), [(1, True), (2, False)])
def test_the_only_neighbour_is_known_without_cases(most: int, known: bool) -> None:
    few = SubClassOf(A, ObjectMaxCardinality(most, P))
    some = SubClassOf(A, ObjectSomeValuesFrom(Q, B))
    program = Classification([few, SubObjectPropertyOf(Q, P), some]).program
    heads = [each.head for each in program.clauses if len(each.body) > 1]
    names = {head.predicate.name for head in heads if isinstance(head, PredicateAtom)}
    assert ({Q, B} <= names) is known
    assert (Q in names) is known


def between(low: int, high: int) -> DatatypeRestriction:
    facets = ((XSD + 'minInclusive', num(low)), (XSD + 'maxInclusive', num(high)))
    return DatatypeRestriction(XSD + 'integer', facets)


@pytest.mark.parametrize(
    ('counted', 'value', 'consistent', 'follows'),
    [
        (None, 2, True, True),
        (None, 5, False, False),
        (between(0, 10), 2, True, True),
        (between(0, 10), 5, False, False),
        (between(0, 10), 20, True, False),
        (between(2, 10), 2, True, False),
    ],
)
def test_the_only_value_that_counts_is_the_one_that_must_exist(
    counted: DatatypeRestriction | None, value: int, consistent: bool, follows: bool
) -> None:
    most: Axiom = FunctionalDataProperty(T)
    if counted is not None:
        most = SubClassOf(A, DataMaxCardinality(1, T, counted))
    some = SubClassOf(A, DataSomeValuesFrom(S, between(1, 3)))
    facts = [is_a(A, i), has(T, i, value)]
    kb = base(most, SubDataPropertyOf(S, T), some, *facts, consistent=consistent)
    if consistent:
        assert kb.holds(has(S, i, value)) is follows


def one_of(*numbers: int) -> DataOneOf:
    return DataOneOf(tuple(map(num, numbers)))


@pytest.mark.parametrize(
    'said',
    [
        [DataSomeValuesFrom(S, one_of(*some)) for some in ((1,), (2,), (1, 2, 3))],
        [DataMinCardinality(2, S, one_of(1, 2, 3))],
        [DataMinCardinality(2, S, one_of(1, 2)), DataSomeValuesFrom(S, one_of(2, 3))],
    ],
)
def test_values_that_differ_are_counted(said: list[ClassExpression]) -> None:
    two = SubClassOf(DataMinCardinality(2, S, TOP_LITERAL), B)
    found = Classification([two, *(SubClassOf(A, one) for one in said)])
    assert found.superclasses(A) == {B}
    assert found.program.unsupported == []
    if len(said) > 1:
        single = Classification([two, SubClassOf(A, said[-1])])
        assert single.superclasses(A) == set()


def test_a_value_that_a_disjoint_property_has_is_not_the_one() -> None:
    axioms = [
        DisjointDataProperties((S, T)),
        SubClassOf(A, DataHasValue(T, num(1))),
        SubClassOf(A, DataSomeValuesFrom(S, one_of(1, 2))),
        SubClassOf(C, DataSomeValuesFrom(S, one_of(1, 2))),
        SubClassOf(DataHasValue(S, num(2)), B),
    ]
    found = Classification(axioms)
    assert found.superclasses(A) == {B}
    assert found.superclasses(C) == set()
