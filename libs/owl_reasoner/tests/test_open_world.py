"""Why an individual is not in a class although nothing speaks against it."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.open_world import Gap, OpenDefinition, open_definition
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, EquivalentClasses, SubClassOf
from owl_reasoner.owl.expressions import (
    ClassExpression,
    ObjectAllValuesFrom,
    ObjectComplementOf,
    ObjectExactCardinality,
    ObjectIntersectionOf,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectMinCardinality,
    ObjectSomeValuesFrom,
    ObjectUnionOf,
)
from owl_reasoner.owl.vocabulary import THING

from .small_ontologies import A, B, C, D, P, differ, i, is_a, j, k, rel

E, F = 'x:E', 'x:F'


def opened(*axioms: Axiom, cls: str = A) -> OpenDefinition | None:
    kb = KnowledgeBase('x:', axioms)
    kb.reason()
    return open_definition(kb, ClassAssertion(cls, i))


def gaps(definition: ClassExpression, *facts: Axiom) -> tuple[Gap, ...]:
    found = opened(EquivalentClasses((A, definition)), *facts)
    return () if found is None else found.gaps


@pytest.mark.parametrize(
    ('definition', 'facts', 'missing'),
    [
        (B, [], ['x:i is not known to be x:B']),
        (THING, [], []),
        (
            ObjectIntersectionOf((B, C, D)),
            [is_a(C, i)],
            ['x:i is not known to be x:B', 'x:i is not known to be x:D'],
        ),
        (
            ObjectUnionOf((ObjectIntersectionOf((B, C)), D)),
            [],
            ['x:i is not known to be x:D'],
        ),
        (ObjectComplementOf(C), [is_a(C, i)], ['x:i is x:C']),
        (
            ObjectComplementOf(ObjectSomeValuesFrom(P, C)),
            [],
            ['nothing says that x:i does not meet the rest of it'],
        ),
        (ObjectSomeValuesFrom(P, THING), [], ['x:i has 0 x:p of the 1 that it needs']),
        (
            ObjectSomeValuesFrom(P, C),
            [rel(P, i, j)],
            ['x:i has 0 x:p in x:C of the 1 that it needs'],
        ),
        (
            ObjectSomeValuesFrom(ObjectInverseOf(P), C),
            [rel(P, j, i), rel(P, i, k), is_a(C, k)],
            ['x:i has 0 inverse x:p in x:C of the 1 that it needs'],
        ),
        (
            ObjectMinCardinality(2, P, C),
            [is_a(C, j), rel(P, i, j), rel(P, i, k)],
            ['x:i has 1 x:p in x:C of the 2 that it needs'],
        ),
        (
            ObjectExactCardinality(2, P, THING),
            [rel(P, i, j)],
            [
                'x:i has 1 x:p of the 2 that it needs',
                'nothing says that x:i has no other x:p: state it with `max 2`,'
                ' or close x:p for x:i',
            ],
        ),
        (
            ObjectMaxCardinality(1, P, THING),
            [rel(P, i, j), rel(P, i, k), differ(j, k)],
            ['x:i has 2 x:p, at most 1 may be'],
        ),
        (
            ObjectAllValuesFrom(P, C),
            [rel(P, i, j), rel(P, i, k), is_a(C, j)],
            ['x:i x:p x:k, not known to be x:C'],
        ),
        (
            ObjectAllValuesFrom(P, C),
            [rel(P, i, f'x:n{number}') for number in range(5)],
            ['x:i x:p x:n0, x:n1, x:n2, not known to be x:C'],
        ),
        # Who has some inverse relation cannot be closed by a property, so nothing is offered.
        (ObjectMaxCardinality(1, ObjectInverseOf(P), THING), [rel(P, j, i)], []),
    ],
)
def test_what_a_definition_lacks(
    definition: ClassExpression, facts: list[Axiom], missing: list[str]
) -> None:
    assert [gap.text for gap in gaps(definition, *facts)] == missing


@pytest.mark.parametrize(
    ('definition', 'facts', 'closing'),
    [
        (ObjectMaxCardinality(1, P, C), [rel(P, i, j)], ('property', P)),
        (ObjectMaxCardinality(1, P, THING), [rel(P, i, j)], ('property', P)),
        (ObjectExactCardinality(1, P, THING), [rel(P, i, j)], ('property', P)),
        (ObjectAllValuesFrom(P, C), [rel(P, i, j), is_a(C, j)], ('property', P)),
        (ObjectAllValuesFrom(P, C), [], ('property', P)),
        (ObjectComplementOf(C), [], ('class', C)),
    ],
)
def test_with_the_statement_that_closes_a_gap_the_fact_holds(
    definition: ClassExpression, facts: list[Axiom], closing: tuple[str, str]
) -> None:
    (gap,) = gaps(definition, *facts)
    assert gap.closing == closing
    assert gap.axiom is not None
    kb = KnowledgeBase('x:', [EquivalentClasses((A, definition)), *facts, gap.axiom])
    assert kb.reason()
    assert kb.holds(is_a(A, i))
    assert gaps(definition, *facts, gap.axiom) == ()


def test_a_defined_class_within_a_definition_is_looked_into_where_closing_helps() -> None:
    outer = EquivalentClasses((A, ObjectIntersectionOf((B, C))))
    found = opened(outer, EquivalentClasses((C, ObjectComplementOf(D))), is_a(B, i))
    assert found is not None
    assert [gap.closing for gap in found.gaps] == [('class', D)]
    found = opened(outer, EquivalentClasses((C, ObjectIntersectionOf((D, E)))), is_a(B, i))
    assert found is not None
    assert [gap.text for gap in found.gaps] == ['x:i is not known to be x:C']


def test_the_definition_that_closing_helps_goes_first_and_then_the_nearest() -> None:
    far = EquivalentClasses((A, ObjectIntersectionOf((B, C))))
    near = SubClassOf(D, A)
    closed = EquivalentClasses((A, ObjectIntersectionOf((E, F, ObjectComplementOf(B)))))
    found = opened(far, near)
    assert found is not None
    assert (found.definition, found.individual, found.can_be_closed) == (near, i, False)
    assert found.sentence('x:i is x:A') == (
        'x:i is x:A would follow from x:D SubClassOf x:A, but x:i is not known to be x:D'
    )
    found = opened(far, near, closed)
    assert found is not None
    assert (found.definition, found.can_be_closed) == (closed, True)
    assert found.sentence('it').endswith(
        'but x:i is not known to be x:E and x:i is not known to be x:F and'
        ' nothing says that x:i is not x:B: state it, or close x:B'
    )


def test_a_class_without_a_definition_and_another_fact_have_none() -> None:
    kb = KnowledgeBase('x:', [SubClassOf(B, C), is_a(B, i)])
    kb.reason()
    assert open_definition(kb, is_a(B, j)) is None
    assert open_definition(kb, is_a(ObjectComplementOf(B), j)) is None
    assert open_definition(kb, rel(P, i, j)) is None


def test_definitions_that_name_each_other_come_to_an_end() -> None:
    found = opened(
        EquivalentClasses((A, ObjectIntersectionOf((B, C)))),
        EquivalentClasses((B, ObjectIntersectionOf((A, D)))),
    )
    assert found is not None
    assert [gap.text for gap in found.gaps] == [
        'x:i is not known to be x:B',
        'x:i is not known to be x:C',
    ]
