"""Class expressions in negation normal form, and which of them a Horn clause can hold."""

from __future__ import annotations

from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.expressions import ClassExpression
from surveillance_ontology.owl.vocabulary import NOTHING, THING

_POSITIVE = (
    ex.ObjectSomeValuesFrom,
    ex.ObjectMinCardinality,
    ex.ObjectHasValue,
    ex.ObjectHasSelf,
    ex.ObjectOneOf,
    ex.DataSomeValuesFrom,
    ex.DataMinCardinality,
    ex.DataHasValue,
)


def negated(expression: ClassExpression) -> ClassExpression:
    """The complement, with negation pushed inwards."""
    if isinstance(expression, str):
        if expression == THING:
            return NOTHING
        return THING if expression == NOTHING else ex.ObjectComplementOf(expression)
    if isinstance(expression, ex.ObjectComplementOf):
        return normal(expression.operand)
    if isinstance(expression, ex.ObjectIntersectionOf):
        return ex.ObjectUnionOf(tuple(map(negated, expression.operands)))
    if isinstance(expression, ex.ObjectUnionOf):
        return ex.ObjectIntersectionOf(tuple(map(negated, expression.operands)))
    if isinstance(expression, ex.ObjectSomeValuesFrom):
        return ex.ObjectAllValuesFrom(expression.prop, negated(expression.filler))
    if isinstance(expression, ex.ObjectAllValuesFrom):
        return ex.ObjectSomeValuesFrom(expression.prop, negated(expression.filler))
    if isinstance(expression, ex.ObjectMinCardinality):
        if expression.n == 0:
            return NOTHING
        return ex.ObjectMaxCardinality(expression.n - 1, expression.prop, expression.filler)
    if isinstance(expression, ex.ObjectMaxCardinality):
        return ex.ObjectMinCardinality(expression.n + 1, expression.prop, expression.filler)
    if isinstance(expression, ex.DataSomeValuesFrom):
        return ex.DataMaxCardinality(0, expression.prop, expression.range)
    if isinstance(expression, ex.DataAllValuesFrom):
        return ex.DataSomeValuesFrom(expression.prop, ex.DataComplementOf(expression.range))
    if isinstance(expression, ex.DataMinCardinality):
        if expression.n == 0:
            return NOTHING
        return ex.DataMaxCardinality(expression.n - 1, expression.prop, expression.range)
    if isinstance(expression, ex.DataMaxCardinality):
        return ex.DataMinCardinality(expression.n + 1, expression.prop, expression.range)
    if isinstance(expression, ex.ObjectExactCardinality):
        few = ex.ObjectMinCardinality(expression.n + 1, expression.prop, expression.filler)
        if expression.n == 0:
            return few
        less = ex.ObjectMaxCardinality(expression.n - 1, expression.prop, expression.filler)
        return ex.ObjectUnionOf((few, less))
    if isinstance(expression, ex.DataExactCardinality):
        more = ex.DataMinCardinality(expression.n + 1, expression.prop, expression.range)
        if expression.n == 0:
            return more
        fewer = ex.DataMaxCardinality(expression.n - 1, expression.prop, expression.range)
        return ex.ObjectUnionOf((more, fewer))
    return ex.ObjectComplementOf(expression)


def normal(expression: ClassExpression) -> ClassExpression:
    """The expression with complements pushed inwards and no nested intersections or unions."""
    if isinstance(expression, ex.ObjectComplementOf):
        pushed = negated(expression.operand)
        return pushed if pushed == expression else normal(pushed)
    if isinstance(expression, (ex.ObjectIntersectionOf, ex.ObjectUnionOf)):
        kind = type(expression)
        flat: list[ClassExpression] = []
        for operand in map(normal, expression.operands):
            flat += operand.operands if isinstance(operand, kind) else (operand,)
        flat = list(dict.fromkeys(flat))
        return flat[0] if len(flat) == 1 else kind(tuple(flat))
    return expression


def is_positive(expression: ClassExpression) -> bool:
    """Whether facts that hold can show membership, so that a clause body can state it."""
    if isinstance(expression, str):
        return True
    if isinstance(expression, (ex.ObjectIntersectionOf, ex.ObjectUnionOf)):
        return all(map(is_positive, expression.operands))
    if isinstance(expression, (ex.ObjectSomeValuesFrom, ex.ObjectMinCardinality)):
        return is_positive(normal(expression.filler))
    return isinstance(expression, _POSITIVE)
