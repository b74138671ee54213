"""Class expressions in the normal form."""

from __future__ import annotations

import pytest

from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import ClassExpression
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.normal_form import normal_form

from .wide_ontologies import WideOntology

A, P = 'x:A', 'x:p'
NOT_A = ex.ObjectComplementOf(A)


@pytest.mark.parametrize(
    ('expression', 'expected'),
    [
        (ex.ObjectComplementOf(ex.ObjectSomeValuesFrom(P, A)), ex.ObjectAllValuesFrom(P, NOT_A)),
        (ex.ObjectMaxCardinality(0, P, NOT_A), ex.ObjectAllValuesFrom(P, A)),
        (ex.ObjectMinCardinality(1, P, ex.ObjectOneOf(('x:i',))), ex.ObjectHasValue(P, 'x:i')),
        (ex.ObjectMinCardinality(0, P, A), THING),
        (ex.ObjectMinCardinality(2, P, NOTHING), NOTHING),
        (ex.ObjectUnionOf((A, ex.ObjectUnionOf((NOTHING, A)))), A),
        (ex.ObjectIntersectionOf((A, ex.ObjectComplementOf(THING))), NOTHING),
        (
            ex.ObjectExactCardinality(1, P, A),
            ex.ObjectIntersectionOf(
                (ex.ObjectSomeValuesFrom(P, A), ex.ObjectMaxCardinality(1, P, A))
            ),
        ),
    ],
)
def test_one_form_for_what_is_said_in_many(
    expression: ClassExpression, expected: ClassExpression
) -> None:
    assert normal_form(expression) == expected


def test_normal_twice_or_negated_twice_is_the_same() -> None:
    drawn = WideOntology(7)
    for _ in range(200):
        expression = drawn.expression()
        form = normal_form(expression)
        assert normal_form(form) == form
        assert normal_form(normal_form(form, True), True) == form
