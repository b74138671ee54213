"""What follows through individuals and values that must exist but are not known."""
# ruff: noqa: E501 - tables of cases, one line each

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    AsymmetricObjectProperty,
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DataPropertyRange,
    Declaration,
    DifferentIndividuals,
    DisjointClasses,
    DisjointDataProperties,
    EquivalentClasses,
    FunctionalDataProperty,
    FunctionalObjectProperty,
    InverseFunctionalObjectProperty,
    InverseObjectProperties,
    IrreflexiveObjectProperty,
    NegativeObjectPropertyAssertion,
    ObjectPropertyAssertion,
    ObjectPropertyDomain,
    ReflexiveObjectProperty,
    Rule,
    SameIndividual,
    SubClassOf,
    SubObjectPropertyOf,
    SubPropertyChainOf,
    TransitiveObjectProperty,
)
from owl_reasoner.owl.expressions import (
    ClassExpression,
    DataAllValuesFrom,
    DataComplementOf,
    DataHasValue,
    DataMaxCardinality,
    DataMinCardinality,
    DataOneOf,
    DataSomeValuesFrom,
    DatatypeRestriction,
    Literal,
    ObjectAllValuesFrom,
    ObjectComplementOf,
    ObjectExactCardinality,
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
    Variable,
)
from owl_reasoner.owl.vocabulary import NOTHING, THING, TOP_LITERAL, XSD
from owl_reasoner.reasoner.consequence_based.classification import Classification

A, B, C, D, E = (f'x:{name}' for name in 'ABCDE')
P, Q, R, S, T = (f'x:{name}' for name in 'pqrst')
i, j, k, m, o = (f'x:{name}' for name in 'ijkmo')


def whole(number: int) -> Literal:
    return Literal(str(number), XSD + 'integer')


def between(low: int | None = None, high: int | None = None) -> DatatypeRestriction:
    facets = []
    if low is not None:
        facets.append((XSD + 'minInclusive', whole(low)))
    if high is not None:
        facets.append((XSD + 'maxExclusive', whole(high)))
    return DatatypeRestriction(XSD + 'integer', tuple(facets))


def reasoned(*axioms: Axiom, consistent: bool = True) -> KnowledgeBase:
    named = [Declaration('class', name) for name in (A, B, C, D, E)]
    kb = KnowledgeBase('x:', [*named, *axioms])
    assert kb.reason() is consistent
    return kb


def some(prop: str, filler: ClassExpression = THING) -> ObjectSomeValuesFrom:
    return ObjectSomeValuesFrom(prop, filler)


def nested(depth: int, inner: ClassExpression) -> ClassExpression:
    expression = inner
    for _ in range(depth):
        expression = some(P, expression)
    return expression


@pytest.mark.parametrize(
    'required',
    [
        some(P, ObjectUnionOf((B, C))),
        some(P, ObjectOneOf((i, j))),
        ObjectMinCardinality(2, P, ObjectUnionOf((B, C))),
        ObjectExactCardinality(2, P, ObjectOneOf((i, j))),
        some(P, some(Q, ObjectIntersectionOf((B, C)))),
        some(P, some(Q, ObjectAllValuesFrom(P, ObjectUnionOf((B, some(Q, C)))))),
    ],
)
def test_no_nested_class_ends_reasoning(required: ClassExpression) -> None:
    kb = reasoned(SubClassOf(A, required), ObjectPropertyDomain(R, required), ClassAssertion(A, i))
    assert not kb.unsupported


@pytest.mark.parametrize(
    ('axioms', 'above'),
    [
        ([SubClassOf(A, nested(9, B)), SubClassOf(nested(9, B), C)], {C}),
        ([SubClassOf(A, some(P, A)), SubClassOf(A, some(P, B)), SubClassOf(nested(20, B), C)], {C}),
        ([SubClassOf(A, ObjectMinCardinality(40, P, B)), SubClassOf(ObjectMinCardinality(30, P), C)], {C}),
        ([SubClassOf(A, some(P, B)), SubClassOf(B, ObjectAllValuesFrom(ObjectInverseOf(P), C))], {C}),
        ([SubClassOf(A, some(P, B)), SubClassOf(A, ObjectAllValuesFrom(P, C)), SubClassOf(some(P, ObjectIntersectionOf((B, C))), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(A, some(P, C)), FunctionalObjectProperty(P), SubClassOf(some(P, ObjectIntersectionOf((B, C))), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(A, some(P, C)), DisjointClasses((B, C)), SubClassOf(ObjectMinCardinality(2, P), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(B, some(Q, C)), SubPropertyChainOf((P, Q), R), SubClassOf(some(R, C), D)], {D}),
        ([SubClassOf(A, C), ReflexiveObjectProperty(P), SubPropertyChainOf((P, P), R), SubClassOf(some(R, C), D)], {C, D}),
        ([SubClassOf(A, ObjectHasValue(P, 'x:i')), SubClassOf(ObjectOneOf(('x:i',)), ObjectIntersectionOf((ObjectHasSelf(Q), C))), SubPropertyChainOf((P, Q), R), SubClassOf(some(R, C), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(B, some(P, C)), TransitiveObjectProperty(P), SubClassOf(some(P, C), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(B, some(P, C)), TransitiveObjectProperty(P), SubClassOf(A, ObjectAllValuesFrom(P, E)), SubClassOf(some(P, some(P, E)), D)], {D}),
        ([SubClassOf(A, some(P, B)), SubClassOf(B, some(Q, C)), InverseObjectProperties(P, Q), InverseFunctionalObjectProperty(P)], {C}),
        ([ReflexiveObjectProperty(P), SubClassOf(some(P, A), C)], {C}),
        ([SubClassOf(A, ObjectHasSelf(P)), SubObjectPropertyOf(P, Q), SubClassOf(some(Q, A), C)], {C}),
        ([SubClassOf(A, ObjectHasValue(P, i)), SubClassOf(ObjectHasValue(P, i), C)], {C}),
        ([EquivalentClasses((A, ObjectOneOf((i,)))), ClassAssertion(C, i)], {C}),
        ([SubClassOf(THING, C)], {C, B, D, E} - {B, D, E}),
        ([SubClassOf(ObjectMinCardinality(0, P), C)], {C}),
        ([SubClassOf(A, DataSomeValuesFrom(T, between(high=10))), SubClassOf(DataSomeValuesFrom(T, between(high=20)), C)], {C}),
        ([SubClassOf(A, DataSomeValuesFrom(T, XSD + 'byte')), SubClassOf(DataSomeValuesFrom(T, between(-200)), C)], {C}),
        ([SubClassOf(A, DataMinCardinality(3, T, XSD + 'boolean'))], {B, C, D, E}),
        ([SubClassOf(A, DataSomeValuesFrom(T, between(5, 5)))], {B, C, D, E}),
        ([SubClassOf(A, DataMinCardinality(257, T)), DataPropertyRange(T, XSD + 'byte')], {B, C, D, E}),
        ([SubClassOf(A, DataSomeValuesFrom(T, between(high=10))), SubClassOf(A, DataSomeValuesFrom(T, between(20))), FunctionalDataProperty(T)], {B, C, D, E}),
        ([SubClassOf(A, DataSomeValuesFrom(T, between(high=10))), SubClassOf(A, DataSomeValuesFrom(T, between(20))), SubClassOf(DataMinCardinality(2, T), C)], {C}),
        ([SubClassOf(A, DataAllValuesFrom(T, DataOneOf((whole(1), whole(2))))), SubClassOf(A, DataSomeValuesFrom(T, DataComplementOf(DataOneOf((whole(1),))))), SubClassOf(DataSomeValuesFrom(T, DataOneOf((whole(2),))), C)], {C}),
        ([SubClassOf(A, ObjectIntersectionOf((some(P, B), ObjectMaxCardinality(1, P), some(Q, C)))), SubObjectPropertyOf(Q, P), SubClassOf(some(Q, B), D)], {D}),
    ],
)  # fmt: skip
def test_superclasses_through_what_must_exist(axioms: list[Axiom], above: set[str]) -> None:
    kb = reasoned(*axioms)
    assert kb.superclasses(A) == above
    assert kb.unsupported == ()
    if above != {B, C, D, E}:
        kb.add(ClassAssertion(A, j))
        kb.reason()
        assert kb.types(j) >= above
        kb.remove(ClassAssertion(A, j))
        kb.reason()
        assert not kb.types(j) & above or THING in repr(axioms) or 'ality(n=0' in repr(axioms)


def test_individuals_get_what_their_classes_imply_together() -> None:
    kb = reasoned(
        SubClassOf(A, some(P, D)),
        SubClassOf(B, ObjectAllValuesFrom(P, E)),
        SubClassOf(some(P, ObjectIntersectionOf((D, E))), C),
        ClassAssertion(A, i),
    )
    assert kb.instances(C) == set()
    kb.add(ClassAssertion(B, i))
    kb.reason()
    assert kb.instances(C) == {i}
    explanation = kb.explain(ClassAssertion(C, i))
    assert explanation is not None
    kb.remove(ClassAssertion(A, i))
    kb.reason()
    assert kb.instances(C) == set()


def test_a_value_that_must_be_one_is_known() -> None:
    kb = reasoned(
        SubClassOf(A, DataSomeValuesFrom(T, DataOneOf((whole(2),)))), ClassAssertion(A, i)
    )
    assert kb.data_values(T, i) == {whole(2)}


def test_an_unknown_value_is_not_outside_a_range() -> None:
    kb = reasoned(
        DataPropertyRange(T, between(0, 101)),
        EquivalentClasses((A, DataSomeValuesFrom(T, between(high=20)))),
        ClassAssertion(A, i),
    )
    assert kb.superclasses(A) == set()
    kb.add(DataPropertyAssertion(T, i, whole(101)))
    assert not kb.reason()


@pytest.mark.parametrize(
    'required',
    [
        (DataHasValue(T, whole(1)), DataHasValue(S, Literal('01', XSD + 'int'))),
        (DataMinCardinality(2, T, XSD + 'boolean'), DataSomeValuesFrom(S, XSD + 'boolean')),
    ],
)
def test_what_has_the_same_value_by_disjoint_properties_is_impossible(
    required: tuple[ClassExpression, ...],
) -> None:
    disjoint = DisjointDataProperties((S, T))
    kb = reasoned(disjoint, SubClassOf(A, some(P, B)), *(SubClassOf(B, one) for one in required))
    assert kb.holds(SubClassOf(A, NOTHING))


def test_the_one_neighbour_is_what_must_exist() -> None:
    kb = reasoned(
        SubClassOf(A, some(Q, B)),
        SubObjectPropertyOf(Q, P),
        FunctionalObjectProperty(P),
        ClassAssertion(A, i),
        ObjectPropertyAssertion(P, i, j),
    )
    assert kb.object_values(Q, i) == {j}
    assert kb.types(j) == {B}


def test_different_toppings_are_counted_however_many_individuals_there_are() -> None:
    # The pizza ontology's InterestingPizza, beside more assertions than cases are tried for.
    toppings = [some(P, topping) for topping in (C, D, E)]
    kb = reasoned(
        EquivalentClasses((A, ObjectMinCardinality(3, P))),
        *(SubClassOf(B, topping) for topping in toppings),
        DisjointClasses((C, D, E)),
        ClassAssertion(B, i),
        *(ClassAssertion(C, f'x:topping{number}') for number in range(20_001)),
    )
    assert B in kb.subclasses(A)
    assert A in kb.types(i)
    assert kb.unsupported == ()


def test_chains_run_over_known_and_unknown_individuals() -> None:
    kb = reasoned(
        TransitiveObjectProperty(P),
        SubClassOf(some(P, B), C),
        SubClassOf(A, some(P, B)),
        ObjectPropertyAssertion(P, i, j),
        ClassAssertion(A, j),
    )
    assert kb.instances(C) == {i, j}


def test_chains_lead_to_an_individual_that_a_class_names() -> None:
    kb = reasoned(
        SubPropertyChainOf((P, Q), R),
        SubClassOf(ObjectHasValue(R, k), C),
        SubClassOf(A, some(P, ObjectHasValue(Q, k))),
        ClassAssertion(A, i),
        ObjectPropertyAssertion(P, j, m),
        ObjectPropertyAssertion(Q, m, k),
    )
    assert kb.superclasses(A) == {C}
    assert kb.instances(C) == {i, j}
    assert kb.object_values(R, i) == {k}


def test_a_chain_of_what_relates_to_itself_leads_back() -> None:
    kb = reasoned(
        SubPropertyChainOf((P, Q), R),
        SubClassOf(A, ObjectIntersectionOf((ObjectHasSelf(P), ObjectHasSelf(Q)))),
        EquivalentClasses((B, ObjectHasSelf(R))),
    )
    assert kb.superclasses(A) == {B}
    kb.add(IrreflexiveObjectProperty(R))
    kb.reason()
    assert kb.holds(SubClassOf(A, NOTHING))


def test_a_count_of_unnamed_individuals_that_chains_lead_to_is_named() -> None:
    counted = EquivalentClasses((D, ObjectMinCardinality(2, R)))
    kb = KnowledgeBase(
        'x:',
        [
            SubPropertyChainOf((P, Q), R),
            *(SubClassOf(A, some(P, some(Q, one))) for one in (B, C)),
            DisjointClasses((B, C)),
            counted,
        ],
    )
    kb.reason()
    assert kb.unsupported == (f'{axiom_text(counted)}: a property with chains is counted',)


def test_chains_of_a_hierarchy_of_properties_cost_what_each_costs() -> None:
    """As in RiC-O, where each of 400 properties has a domain and many have chains."""

    def clauses_for(count: int) -> int:
        axioms: list[Axiom] = [SubClassOf(A, some('x:p0', B)), TransitiveObjectProperty('x:p0')]
        for n in range(count):
            axioms += [
                SubObjectPropertyOf(f'x:p{n}', f'x:p{n + 1}'),
                SubPropertyChainOf((f'x:s{n}', f'x:t{n}'), f'x:p{n}'),
                ObjectPropertyDomain(f'x:p{n}', f'x:D{n}'),
            ]
        known = Classification(axioms)
        assert known.superclasses(A) == {f'x:D{n}' for n in range(count)}
        return len(known.program.clauses)

    assert clauses_for(40) < 2.2 * clauses_for(20)


def test_there_is_always_some_individual() -> None:
    reasoned(EquivalentClasses((THING, NOTHING)), consistent=False)
    reasoned(SubClassOf(THING, A), SubClassOf(A, ObjectComplementOf(A)), consistent=False)


def test_a_sameness_ends_with_the_assertion_that_made_it() -> None:
    kb = reasoned(
        SubClassOf(A, ObjectOneOf((k,))),
        ClassAssertion(A, i),
        ClassAssertion(A, m),
        ObjectPropertyAssertion(P, i, o),
    )
    kb.add(NegativeObjectPropertyAssertion(P, m, o))
    assert not kb.reason()
    kb.remove(ClassAssertion(A, i))
    assert kb.reason()
    assert not kb.explain_inconsistency()


def test_an_individual_different_from_itself_is_a_contradiction() -> None:
    reasoned(DifferentIndividuals(frozenset((i,))), consistent=False)


@pytest.mark.parametrize('length', [10, 25, 60])
def test_long_rules(length: int) -> None:
    names = [Variable(f'v{place}') for place in range(length + 1)]
    body = tuple(ObjectPropertyAtom(P, *names[place : place + 2]) for place in range(length))
    links = [ObjectPropertyAssertion(P, f'x:n{n}', f'x:n{n + 1}') for n in range(length)]
    kb = reasoned(Rule(body, (ObjectPropertyAtom(Q, names[0], names[-1]),)), *links)
    assert kb.object_values(Q, 'x:n0') == {f'x:n{length}'}
    kb.remove(links[3])
    kb.reason()
    assert kb.object_values(Q, 'x:n0') == set()


@pytest.mark.parametrize(
    'axioms',
    [
        [SubClassOf(ObjectMaxCardinality(1, P), A)],
        [SubClassOf(ObjectAllValuesFrom(P, B), A)],
        [SubClassOf(ObjectComplementOf(B), A)],
        [SubClassOf(A, ObjectMaxCardinality(2, P)), *(ClassAssertion(A, one) for one in (i, o)), *(ObjectPropertyAssertion(P, i, one) for one in (j, k, m))],
        [SubClassOf(ObjectMinCardinality(2, P), A), *(ObjectPropertyAssertion(P, i, one) for one in (j, k))],
        [SubClassOf(A, some(P, ObjectHasValue(Q, i))), SubClassOf(some(P, some(Q, B)), C), ClassAssertion(A, j)],
    ],
)  # fmt: skip
def test_what_takes_cases_is_not_lost(axioms: list[Axiom]) -> None:
    kb = reasoned(*axioms, AsymmetricObjectProperty(R))
    assert kb.unsupported == ()


def test_values_that_classes_require_go_by_the_name_of_who_is_the_same() -> None:
    # The guide's wine ontology does so: its sugars and those of its food are the same.
    kb = reasoned(
        EquivalentClasses((A, ObjectIntersectionOf((B, ObjectHasValue(P, k))))),
        SubClassOf(A, some(Q, ObjectHasValue(P, j))),
        SubClassOf(B, some(Q, some(Q, C))),
        FunctionalObjectProperty(P),
        DifferentIndividuals(frozenset((k, j))),
        DifferentIndividuals(frozenset((m, j))),
        ClassAssertion(B, i),
        ObjectPropertyAssertion(P, i, m),
    )
    same = SameIndividual(frozenset((k, m)))
    for _ in range(2):
        kb.add(same)
        assert kb.reason()
        assert kb.types(i) == {A, B}
        assert kb.object_values(P, i) == {k, m}
        kb.remove(same)
        assert kb.reason()
        assert kb.types(i) == {B}
        assert kb.object_values(P, i) == {m}


@pytest.mark.parametrize(('parent', 'joined'), [([], set()), ([SubClassOf(A, D)], {C, D})])
def test_only_a_parent_that_counts_is_the_one_neighbour(
    parent: list[Axiom], joined: set[str]
) -> None:
    # B needs a C before it, and has room for one D: the A before it is that one if it is a D.
    kb = reasoned(
        SubClassOf(A, some(P, B)),
        SubClassOf(B, ObjectSomeValuesFrom(ObjectInverseOf(P), C)),
        SubClassOf(B, ObjectMaxCardinality(1, ObjectInverseOf(P), D)),
        SubClassOf(C, D),
        *parent,
    )
    assert kb.superclasses(A) == joined


@pytest.mark.parametrize(
    ('second', 'most', 'possible'),
    [((5, 9), 3, False), ((5, 9), 4, True), ((4, 9), 3, True), ((4, 9), 1, True)],
)
def test_values_of_ranges_that_share_none_are_counted_together(
    second: tuple[int, int], most: int, possible: bool
) -> None:
    least = (1, 5), second
    number = 2 if most > 1 else 1
    kb = reasoned(
        *(SubClassOf(A, DataMinCardinality(number, T, between(*bounds))) for bounds in least),
        SubClassOf(A, DataMaxCardinality(most, T, TOP_LITERAL)),
        ClassAssertion(A, i),
        consistent=possible,
    )
    # A class that can have no member is below every other.
    assert kb.superclasses(A) == (set() if possible else {B, C, D, E})
