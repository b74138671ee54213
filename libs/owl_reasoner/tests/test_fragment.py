"""One small ontology for each construct of the fragment."""
# ruff: noqa: E501 - tables of cases, one line each

from __future__ import annotations

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    AsymmetricObjectProperty,
    Axiom,
    DataPropertyRange,
    DatatypeDefinition,
    Declaration,
    DisjointClasses,
    DisjointObjectProperties,
    DisjointUnion,
    EquivalentClasses,
    EquivalentObjectProperties,
    FunctionalDataProperty,
    FunctionalObjectProperty,
    HasKey,
    InverseFunctionalObjectProperty,
    InverseObjectProperties,
    IrreflexiveObjectProperty,
    NegativeDataPropertyAssertion,
    NegativeObjectPropertyAssertion,
    ObjectPropertyDomain,
    ObjectPropertyRange,
    ReflexiveObjectProperty,
    Rule,
    SubClassOf,
    SubDataPropertyOf,
    SubObjectPropertyOf,
    SubPropertyChainOf,
    SymmetricObjectProperty,
    TransitiveObjectProperty,
)
from owl_reasoner.owl.expressions import (
    ClassAtom,
    ClassExpression,
    DataAllValuesFrom,
    DataHasValue,
    DataMinCardinality,
    DataOneOf,
    DataPropertyAtom,
    DataSomeValuesFrom,
    DatatypeRestriction,
    DifferentIndividualsAtom,
    Literal,
    ObjectAllValuesFrom,
    ObjectComplementOf,
    ObjectHasSelf,
    ObjectHasValue,
    ObjectIntersectionOf,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectMinCardinality,
    ObjectOneOf,
    ObjectPropertyAtom,
    ObjectSomeValuesFrom,
    ObjectUnionOf,
)
from owl_reasoner.owl.vocabulary import NOTHING, THING, XSD

from .small_ontologies import (
    A,
    B,
    C,
    D,
    P,
    Q,
    R,
    S,
    T,
    V,
    W,
    X,
    Y,
    base,
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


@pytest.mark.parametrize(
    ('definition', 'facts'),
    [
        (ObjectIntersectionOf((B, C)), [is_a(B, i), is_a(C, i)]),
        (ObjectUnionOf((B, C)), [is_a(C, i)]),
        (ObjectSomeValuesFrom(P, B), [rel(P, i, j), is_a(B, j)]),
        (ObjectSomeValuesFrom(ObjectInverseOf(P), THING), [rel(P, j, i)]),
        (ObjectMinCardinality(1, P, B), [rel(P, i, j), is_a(B, j)]),
        (ObjectMinCardinality(2, P), [rel(P, i, j), rel(P, i, k), differ(j, k)]),
        (
            ObjectMinCardinality(3, P, B),
            [*(rel(P, i, x) for x in (j, k, m)), differ(j, k, m), *(is_a(B, x) for x in (j, k, m))],
        ),
        (ObjectMinCardinality(0, P), [is_a(B, i)]),
        (ObjectHasValue(P, j), [rel(P, i, j)]),
        (ObjectHasSelf(P), [rel(P, i, i)]),
        (ObjectOneOf((i, j)), [is_a(B, i)]),
        (DataHasValue(S, num(5)), [has(S, i, Literal('5.0', XSD + 'decimal'))]),
        (DataSomeValuesFrom(S, XSD + 'long'), [has(S, i, 5)]),
        (DataMinCardinality(2, S), [has(S, i, 5), has(S, i, 6)]),
        (
            DataSomeValuesFrom(
                S, DatatypeRestriction(XSD + 'integer', ((XSD + 'minInclusive', num(5)),))
            ),
            [has(S, i, 5)],
        ),
        (DataSomeValuesFrom(S, DataOneOf((num(4), num(5)))), [has(S, i, 5)]),
        (
            ObjectSomeValuesFrom(P, ObjectSomeValuesFrom(P, B)),
            [rel(P, i, j), rel(P, j, k), is_a(B, k)],
        ),
        (
            ObjectMinCardinality(2, P, ObjectUnionOf((B, C))),
            [rel(P, i, j), rel(P, i, k), differ(j, k), is_a(B, j), is_a(C, k)],
        ),
    ],
)
def test_definitions_recognise_members(definition: ClassExpression, facts: list[Axiom]) -> None:
    kb = base(SubClassOf(definition, A), *facts)
    assert i in kb.instances(A)
    for fact in facts:
        kb.remove(fact)
        kb.reason()
        asserted_otherwise = isinstance(definition, ObjectOneOf) or fact == is_a(B, i)
        if not asserted_otherwise:
            assert i not in kb.instances(A)
        kb.add(fact)
    kb.reason()
    assert i in kb.instances(A)


@pytest.mark.parametrize(
    ('facts', 'clash'),
    [
        ([SubClassOf(A, ObjectAllValuesFrom(P, B)), is_a(A, i), rel(P, i, j), DisjointClasses((B, C)), is_a(C, j)], True),
        ([SubClassOf(A, ObjectMaxCardinality(1, P)), is_a(A, i), rel(P, i, j), rel(P, i, k), differ(j, k)], True),
        ([SubClassOf(A, ObjectMaxCardinality(1, P, B)), is_a(A, i), rel(P, i, j), rel(P, i, k), differ(j, k), is_a(B, j)], False),
        ([SubClassOf(A, ObjectMaxCardinality(0, P, B)), is_a(A, i), rel(P, i, j), is_a(B, j)], True),
        ([SubClassOf(A, NOTHING), is_a(A, i)], True),
        ([SubClassOf(A, ObjectComplementOf(B)), is_a(A, i), is_a(B, i)], True),
        ([DisjointUnion(A, (B,)), is_a(A, i), is_a(C, i), DisjointClasses((B, C))], True),
        ([SubClassOf(A, DataAllValuesFrom(S, XSD + 'integer')), is_a(A, i), has(S, i, Literal('x'))], True),
        ([SubClassOf(A, ObjectHasSelf(P)), IrreflexiveObjectProperty(P), is_a(A, i)], True),
        ([AsymmetricObjectProperty(P), rel(P, i, j), rel(P, j, i)], True),
        ([DisjointObjectProperties((P, Q)), rel(P, i, j), rel(Q, i, j)], True),
        ([FunctionalDataProperty(S), has(S, i, 1), has(S, i, 2)], True),
        ([FunctionalDataProperty(S), has(S, i, 1), has(S, i, num(1, 'long'))], False),
        ([NegativeObjectPropertyAssertion(P, i, j), rel(P, i, j)], True),
        ([NegativeDataPropertyAssertion(S, i, num(1)), has(S, i, num(1, 'long'))], True),
        ([same(i, j), differ(i, j)], True),
        ([SubClassOf(A, ObjectSomeValuesFrom(P, NOTHING)), is_a(A, i)], True),
        ([SubClassOf(A, ObjectMinCardinality(2, P)), FunctionalObjectProperty(P), is_a(A, i)], True),
        ([SubClassOf(A, ObjectSomeValuesFrom(P, B)), SubClassOf(A, ObjectAllValuesFrom(P, C)), DisjointClasses((B, C)), is_a(A, i)], True),
        ([DatatypeDefinition('x:small', DatatypeRestriction(XSD + 'integer', ((XSD + 'maxExclusive', num(10)),))), DataPropertyRange(S, 'x:small'), has(S, i, 10)], True),
    ],
)  # fmt: skip
def test_contradictions(facts: list[Axiom], clash: bool) -> None:
    kb = base(*facts, consistent=not clash)
    if clash:
        explanation = kb.explain_inconsistency()
        assert explanation is not None
        assert explanation.sentence().startswith('the ontology is inconsistent because ')


def test_existential_knowledge_reaches_the_class_hierarchy() -> None:
    kb = base(
        *(Declaration('class', name) for name in (A, B, C, D)),
        SubClassOf(A, ObjectSomeValuesFrom(P, B)),
        SubClassOf(ObjectSomeValuesFrom(P, C), D),
        SubClassOf(B, C),
        is_a(A, i),
    )
    assert kb.superclasses(A) == {D}
    assert kb.types(i) == {A, D}
    assert kb.superclasses(B) == {C}
    assert kb.subclasses(THING) == {A, B, C, D}


def test_a_class_that_only_an_assertion_names_is_below_thing() -> None:
    kb = base(is_a(A, i), is_a(ObjectUnionOf((B, C)), i), is_a(ObjectComplementOf(NOTHING), i))
    assert kb.subclasses(THING) == {A, B, C}
    kb.add(is_a(D, i))
    assert kb.subclasses(THING) == {A, B, C, D}
    kb.remove(is_a(A, i))
    kb.reason()
    assert kb.subclasses(THING) == {B, C, D}


@pytest.mark.parametrize(
    'everybody', [SubClassOf(THING, A), SubClassOf(ObjectComplementOf(C), A), None]
)
def test_a_class_that_only_an_assertion_names_is_below_what_everybody_is(
    everybody: Axiom | None,
) -> None:
    kb = base(*([everybody] if everybody else []), SubClassOf(C, A), is_a(B, i), is_a(D, i))
    assert kb.superclasses(B) == ({A} if everybody else set())
    assert kb.subclasses(A) - {THING} == ({B, C, D} if everybody else {C})
    assert kb.subclasses(B) == set()


def test_a_class_that_can_have_no_member_is_below_one_that_only_an_assertion_names() -> None:
    kb = base(SubClassOf(A, NOTHING), is_a(B, i))
    assert kb.superclasses(A) == {B}
    assert kb.subclasses(B) == {A}
    for sup, holds in ((B, True), (NOTHING, True), (C, True)):
        assert kb.holds(SubClassOf(A, sup)) is holds
    assert not kb.holds(SubClassOf(B, A))
    assert not kb.holds(SubClassOf(B, NOTHING))


def test_a_class_that_can_have_no_member_is_below_all() -> None:
    kb = base(
        *(Declaration('class', name) for name in (A, B, C)),
        SubClassOf(A, B),
        SubClassOf(A, C),
        DisjointClasses((B, C)),
    )
    assert kb.superclasses(A) == {B, C}
    assert kb.subclasses(B) == {A}


@pytest.mark.parametrize(
    ('axioms', 'follows'),
    [
        ([SubObjectPropertyOf(P, Q), rel(P, i, j)], rel(Q, i, j)),
        ([SubObjectPropertyOf(ObjectInverseOf(P), Q), rel(P, i, j)], rel(Q, j, i)),
        ([EquivalentObjectProperties((P, Q)), rel(Q, i, j)], rel(P, i, j)),
        ([InverseObjectProperties(P, Q), rel(P, i, j)], rel(Q, j, i)),
        ([SymmetricObjectProperty(P), rel(P, i, j)], rel(P, j, i)),
        ([TransitiveObjectProperty(P), rel(P, i, j), rel(P, j, k)], rel(P, i, k)),
        ([SubPropertyChainOf((P, Q, R), T), rel(P, i, j), rel(Q, j, k), rel(R, k, m)], rel(T, i, m)),
        ([ReflexiveObjectProperty(P), is_a(A, i)], rel(P, i, i)),
        ([ObjectPropertyDomain(P, A), rel(P, i, j)], is_a(A, i)),
        ([ObjectPropertyRange(P, ObjectIntersectionOf((A, B))), rel(P, i, j)], is_a(B, j)),
        ([FunctionalObjectProperty(P), rel(P, i, j), rel(P, i, k)], same(j, k)),
        ([InverseFunctionalObjectProperty(P), rel(P, i, k), rel(P, j, k)], same(i, j)),
        ([HasKey(A, (), (S,)), is_a(A, i), is_a(A, j), has(S, i, 1), has(S, j, 1)], same(i, j)),
        ([SubClassOf(A, ObjectOneOf((j,))), is_a(A, i)], same(i, j)),
        ([same(i, j), rel(P, i, k)], rel(P, j, k)),
        ([SubDataPropertyOf(S, T), has(S, i, 1)], has(T, i, 1)),
        ([SubClassOf(A, ObjectMaxCardinality(2, P)), is_a(A, i), *(rel(P, i, x) for x in (j, k, m)), differ(j, k), differ(j, m)], same(k, m)),
        ([SubClassOf(A, ObjectSomeValuesFrom(P, B)), FunctionalObjectProperty(P), is_a(A, i), rel(P, i, j)], is_a(B, j)),
    ],
)  # fmt: skip
def test_property_axioms(axioms: list[Axiom], follows: Axiom) -> None:
    kb = base(*axioms)
    assert follows in set(kb.facts())
    explanation = kb.explain(follows)
    assert explanation is not None
    assert explanation.kind != 'asserted'
    changing = [a for a in axioms if a in (axioms[-1], rel(P, i, j)) and 'Assertion' in repr(a)]
    for axiom in changing:
        kb.remove(axiom)
        kb.reason()
        assert follows not in set(kb.facts())
        kb.add(axiom)
        kb.reason()
        assert follows in set(kb.facts())


@pytest.mark.parametrize(
    'evidence',
    [
        [DisjointClasses((A, B)), is_a(A, i), is_a(B, j)],
        [FunctionalDataProperty(S), has(S, i, 1), has(S, j, 2)],
        [FunctionalObjectProperty(P), rel(P, i, k), rel(P, j, m), differ(k, m)],
        [InverseFunctionalObjectProperty(P), rel(P, k, i), rel(P, m, j), differ(k, m)],
        [IrreflexiveObjectProperty(P), rel(P, i, j)],
        [AsymmetricObjectProperty(P), rel(P, i, j)],
        [AsymmetricObjectProperty(P), rel(P, i, k), rel(P, k, j)],
        [DisjointObjectProperties((P, Q)), rel(P, k, i), rel(Q, k, j)],
        [NegativeObjectPropertyAssertion(P, i, k), rel(P, j, k)],
        [is_a(ObjectComplementOf(A), i), is_a(A, j)],
        [Rule((ObjectPropertyAtom(P, X, Y),), (DifferentIndividualsAtom(X, Y),)), rel(P, j, i)],
    ],
)
def test_entailed_difference(evidence: list[Axiom]) -> None:
    counted = EquivalentClasses((C, ObjectMinCardinality(2, R)))
    kb = base(counted, rel(R, m, i), rel(R, m, j), *evidence)
    assert m in kb.instances(C)
    assert kb.explain(differ(i, j)) is not None
    for axiom in [a for a in evidence if not isinstance(a, (DisjointClasses, Rule))][-1:]:
        kb.remove(axiom)
        kb.reason()
        assert m not in kb.instances(C)
        kb.add(axiom)
        kb.reason()
        assert m in kb.instances(C)


@pytest.mark.parametrize(
    ('axiom', 'words'),
    [
        (Rule((DataPropertyAtom(S, X, V), computed('date', W, V)), (ClassAtom(A, X),)), 'date'),
        (Rule((ClassAtom(A, X), computed('lessThan', V, 3)), (ClassAtom(B, X),)), 'lessThan'),
        (Rule((ClassAtom(A, X),), (ObjectPropertyAtom(P, X, Y),)), 'head'),
        (DataPropertyRange(S, 'x:unknownType'), 'unknownType'),
    ],
)
def test_what_is_not_supported_is_reported(axiom: Axiom, words: str) -> None:
    kb = KnowledgeBase('x:', [axiom, is_a(B, i)])
    assert kb.reason()
    assert len(kb.unsupported) == 1
    assert words in kb.unsupported[0]


@pytest.mark.parametrize(
    'further',
    [
        SubClassOf(ObjectHasSelf(R), A),
        SubClassOf(ObjectHasValue(R, k), A),
        Rule((ObjectPropertyAtom(R, X, Y),), (ClassAtom(A, X),)),
        ObjectPropertyDomain(Q, A),
        ObjectPropertyRange(R, A),
    ],
)
def test_what_follows_still_follows_with_a_further_axiom(further: Axiom) -> None:
    # Of whom no axiom says what they are related to: only cases find them.
    defined = ObjectIntersectionOf((ObjectAllValuesFrom(P, D), ObjectSomeValuesFrom(R, THING)))
    none = ObjectMaxCardinality(0, P, THING)
    facts = [is_a(none, i), is_a(ObjectSomeValuesFrom(R, THING), i)]
    assert base(SubClassOf(defined, A), *facts).instances(A) == {i}
    assert i in base(SubClassOf(defined, A), further, *facts).instances(A)
