"""One small ontology for each construct of the fragment."""
# ruff: noqa: E501 - tables of cases, one line each

from __future__ import annotations

import pytest

from surveillance_ontology.knowledge_base import KnowledgeBase
from surveillance_ontology.owl.axioms import (
    AsymmetricObjectProperty,
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DataPropertyRange,
    DatatypeDefinition,
    Declaration,
    DifferentIndividuals,
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
    ObjectPropertyAssertion,
    ObjectPropertyDomain,
    ObjectPropertyRange,
    ReflexiveObjectProperty,
    Rule,
    SameIndividual,
    SubClassOf,
    SubDataPropertyOf,
    SubObjectPropertyOf,
    SubPropertyChainOf,
    SymmetricObjectProperty,
    TransitiveObjectProperty,
)
from surveillance_ontology.owl.expressions import (
    BuiltinAtom,
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
    SameIndividualAtom,
    Variable,
)
from surveillance_ontology.owl.vocabulary import NOTHING, SWRLB, THING, XSD
from surveillance_ontology.reasoner.datatypes import value_of

A, B, C, D = 'x:A', 'x:B', 'x:C', 'x:D'
P, Q, R, S, T = 'x:p', 'x:q', 'x:r', 'x:s', 'x:t'
i, j, k, m = 'x:i', 'x:j', 'x:k', 'x:m'
X, Y, Z, V, W, U = (Variable(name) for name in 'xyzvwu')


def num(value: object, datatype: str = 'integer') -> Literal:
    return Literal(str(value), XSD + datatype)


def base(*axioms: Axiom, consistent: bool = True) -> KnowledgeBase:
    kb = KnowledgeBase('x:', axioms)
    assert kb.reason() is consistent
    assert kb.unsupported == ()
    return kb


def is_a(cls: ClassExpression, individual: str) -> Axiom:
    return ClassAssertion(cls, individual)


def rel(prop: str, one: str, other: str) -> Axiom:
    return ObjectPropertyAssertion(prop, one, other)


def has(prop: str, one: str, value: object) -> Axiom:
    return DataPropertyAssertion(prop, one, value if isinstance(value, Literal) else num(value))


def differ(*individuals: str) -> Axiom:
    return DifferentIndividuals(frozenset(individuals))


def same(*individuals: str) -> SameIndividual:
    return SameIndividual(frozenset(individuals))


# --- classes ---


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


def test_a_class_that_can_have_no_member_is_below_all() -> None:
    kb = base(
        *(Declaration('class', name) for name in (A, B, C)),
        SubClassOf(A, B),
        SubClassOf(A, C),
        DisjointClasses((B, C)),
    )
    assert kb.superclasses(A) == {B, C}
    assert kb.subclasses(B) == {A}


# --- properties ---


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


# --- difference ---


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


# --- rules ---


def computed(name: str, *arguments: object) -> BuiltinAtom:
    terms = [
        a if isinstance(a, (Variable, Literal)) else Literal(a) if isinstance(a, str) else num(a)
        for a in arguments
    ]
    return BuiltinAtom(SWRLB + name, tuple(terms))


TRUE, FALSE = Literal('true', XSD + 'boolean'), Literal('false', XSD + 'boolean')


@pytest.mark.parametrize(
    ('given', 'atoms', 'result'),
    [
        (7, [computed('add', W, V, 2, 1)], num(10)),
        (7, [computed('subtract', W, V, 9)], num(-2)),
        (7, [computed('multiply', W, V, V)], num(49)),
        (7, [computed('divide', W, V, 2)], num('3.5', 'decimal')),
        (7, [computed('integerDivide', W, V, 2)], num(3)),
        (-7, [computed('mod', W, V, 2)], num(-1)),
        (7, [computed('pow', W, V, 2)], num(49)),
        (7, [computed('unaryMinus', W, V)], num(-7)),
        (-7, [computed('abs', W, V)], num(7)),
        (num('2.5', 'decimal'), [computed('round', W, V)], num(3)),
        (num('2.5', 'decimal'), [computed('roundHalfToEven', W, V)], num(2)),
        (num('2.5', 'decimal'), [computed('ceiling', W, V)], num(3)),
        (num('2.5', 'decimal'), [computed('floor', W, V)], num(2)),
        (num('2.5', 'double'), [computed('add', W, V, 1)], num('3.5', 'double')),
        (7, [computed('subtract', U, V, 2), computed('multiply', W, U, U)], num(25)),
        (TRUE, [computed('booleanNot', W, V)], FALSE),
        (Literal('ab'), [computed('stringConcat', W, V, 'c')], Literal('abc')),
        (Literal('hello'), [computed('substring', W, V, 2, 3)], Literal('ell')),
        (Literal('hello'), [computed('stringLength', W, V)], num(5)),
        (Literal(' a  b '), [computed('normalizeSpace', W, V)], Literal('a b')),
        (Literal('Ab'), [computed('upperCase', W, V)], Literal('AB')),
        (Literal('Ab'), [computed('lowerCase', W, V)], Literal('ab')),
        (Literal('bar'), [computed('translate', W, V, 'abc', 'AB')], Literal('BAr')),
        (Literal('a=b'), [computed('substringBefore', W, V, '=')], Literal('a')),
        (Literal('a=b'), [computed('substringAfter', W, V, '=')], Literal('b')),
        (Literal('aab'), [computed('replace', W, V, 'a', 'x')], Literal('xxb')),
        (Literal('a,b'), [computed('tokenize', W, V, ','), computed('startsWith', W, 'b')], Literal('b')),
        (7, [computed('equal', W, V), computed('greaterThan', V, 6)], num(7)),
        (7, [computed('equal', W, V), computed('greaterThan', V, 7)], None),
        (7, [computed('equal', W, V), computed('greaterThanOrEqual', V, 7)], num(7)),
        (7, [computed('equal', W, V), computed('lessThan', V, 8)], num(7)),
        (7, [computed('equal', W, V), computed('lessThanOrEqual', V, 6)], None),
        (7, [computed('equal', W, V), computed('notEqual', V, 7)], None),
        (7, [computed('divide', W, V, 0)], None),
        (Literal('7'), [computed('add', W, V, 1)], None),
        (Literal('AbC'), [computed('equal', W, V), computed('stringEqualIgnoreCase', V, 'aBc')], Literal('AbC')),
        (Literal('abc'), [computed('equal', W, V), computed('contains', V, 'bc')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('containsIgnoreCase', V, 'BC')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('endsWith', V, 'bc')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('matches', V, '^a.c$')], Literal('abc')),
    ],
)  # fmt: skip
def test_builtins(given: object, atoms: list[BuiltinAtom], result: Literal | None) -> None:
    rule = Rule((DataPropertyAtom(S, X, V), *atoms), (DataPropertyAtom(T, X, W),))
    kb = base(rule, has(S, i, given))
    found = {value_of(literal) for literal in kb.data_values(T, i)}
    assert found == (set() if result is None else {value_of(result)})
    kb.remove(has(S, i, given))
    kb.reason()
    assert kb.data_values(T, i) == set()


def test_rules_speak_of_named_individuals_only() -> None:
    rule = Rule((ObjectPropertyAtom(P, X, Y), ClassAtom(B, Y)), (ClassAtom(C, X),))
    kb = base(SubClassOf(A, ObjectSomeValuesFrom(P, B)), rule, is_a(A, i))
    assert kb.instances(C) == set()


def test_rules_with_same_and_different_atoms() -> None:
    twins = Rule((ObjectPropertyAtom(P, X, Y), ClassAtom(A, X)), (SameIndividualAtom(X, Y),))
    apart = Rule(
        (ObjectPropertyAtom(Q, Z, X), ObjectPropertyAtom(Q, Z, Y), DifferentIndividualsAtom(X, Y)),
        (ObjectPropertyAtom(R, X, Y),),
    )
    kb = base(twins, apart, rel(P, i, j), is_a(A, i), rel(Q, k, i), rel(Q, k, m), differ(j, m))
    assert same(i, j) in set(kb.facts())
    assert kb.object_values(R, i) == {m}
    kb.remove(is_a(A, i))
    kb.reason()
    assert same(i, j) not in set(kb.facts())
    assert kb.object_values(R, i) == set()


# --- outside the fragment ---


@pytest.mark.parametrize(
    ('axiom', 'words'),
    [
        (SubClassOf(A, ObjectUnionOf((B, C))), 'cases'),
        (SubClassOf(A, ObjectOneOf((i, j))), 'cases'),
        (Rule((DataPropertyAtom(S, X, V), computed('date', W, V)), (ClassAtom(A, X),)), 'date'),
        (Rule((ClassAtom(A, X), computed('lessThan', V, 3)), (ClassAtom(B, X),)), 'lessThan'),
        (Rule((ClassAtom(A, X),), (ObjectPropertyAtom(P, X, Y),)), 'head'),
        (DataPropertyRange(S, 'x:unknownType'), 'unknownType'),
        (EquivalentClasses((A, ObjectUnionOf((B, C)))), 'cases'),
    ],
)
def test_what_is_not_supported_is_reported(axiom: Axiom, words: str) -> None:
    kb = KnowledgeBase('x:', [axiom, is_a(B, i)])
    assert kb.reason()
    assert len(kb.unsupported) == 1
    assert words in kb.unsupported[0]
    if isinstance(axiom, EquivalentClasses):
        assert i in kb.instances(A), 'the direction that is supported still counts'


def test_a_rule_that_makes_values_without_end_is_stopped_and_reported() -> None:
    counting = Rule(
        (DataPropertyAtom(S, X, V), computed('add', W, V, 1)), (DataPropertyAtom(S, X, W),)
    )
    kb = KnowledgeBase('x:', [counting, has(S, i, 1)])
    assert kb.reason()
    assert 'without end' in kb.unsupported[0]
    assert num(2) in kb.data_values(S, i)
