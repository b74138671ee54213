"""Class expressions in negation normal form, and which of them a Horn clause can hold."""

from __future__ import annotations

from surveillance_ontology import axioms as ax
from surveillance_ontology.axioms import NOTHING, THING, ClassExpression

_POSITIVE = (
    ax.ObjectSomeValuesFrom,
    ax.ObjectMinCardinality,
    ax.ObjectHasValue,
    ax.ObjectHasSelf,
    ax.ObjectOneOf,
    ax.DataSomeValuesFrom,
    ax.DataMinCardinality,
    ax.DataHasValue,
)


def negated(expression: ClassExpression) -> ClassExpression:
    """The complement, with negation pushed inwards."""
    if isinstance(expression, str):
        if expression == THING:
            return NOTHING
        return THING if expression == NOTHING else ax.ObjectComplementOf(expression)
    if isinstance(expression, ax.ObjectComplementOf):
        return normal(expression.operand)
    if isinstance(expression, ax.ObjectIntersectionOf):
        return ax.ObjectUnionOf(tuple(map(negated, expression.operands)))
    if isinstance(expression, ax.ObjectUnionOf):
        return ax.ObjectIntersectionOf(tuple(map(negated, expression.operands)))
    if isinstance(expression, ax.ObjectSomeValuesFrom):
        return ax.ObjectAllValuesFrom(expression.prop, negated(expression.filler))
    if isinstance(expression, ax.ObjectAllValuesFrom):
        return ax.ObjectSomeValuesFrom(expression.prop, negated(expression.filler))
    if isinstance(expression, ax.ObjectMinCardinality):
        if expression.n == 0:
            return NOTHING
        return ax.ObjectMaxCardinality(expression.n - 1, expression.prop, expression.filler)
    if isinstance(expression, ax.ObjectMaxCardinality):
        return ax.ObjectMinCardinality(expression.n + 1, expression.prop, expression.filler)
    if isinstance(expression, ax.DataSomeValuesFrom):
        return ax.DataMaxCardinality(0, expression.prop, expression.range)
    if isinstance(expression, ax.DataAllValuesFrom):
        return ax.DataSomeValuesFrom(expression.prop, ax.DataComplementOf(expression.range))
    if isinstance(expression, ax.DataMinCardinality):
        if expression.n == 0:
            return NOTHING
        return ax.DataMaxCardinality(expression.n - 1, expression.prop, expression.range)
    if isinstance(expression, ax.DataMaxCardinality):
        return ax.DataMinCardinality(expression.n + 1, expression.prop, expression.range)
    if isinstance(expression, ax.ObjectExactCardinality):
        few = ax.ObjectMinCardinality(expression.n + 1, expression.prop, expression.filler)
        if expression.n == 0:
            return few
        less = ax.ObjectMaxCardinality(expression.n - 1, expression.prop, expression.filler)
        return ax.ObjectUnionOf((few, less))
    if isinstance(expression, ax.DataExactCardinality):
        more = ax.DataMinCardinality(expression.n + 1, expression.prop, expression.range)
        if expression.n == 0:
            return more
        fewer = ax.DataMaxCardinality(expression.n - 1, expression.prop, expression.range)
        return ax.ObjectUnionOf((more, fewer))
    return ax.ObjectComplementOf(expression)


def normal(expression: ClassExpression) -> ClassExpression:
    """The expression with complements pushed inwards and no nested intersections or unions."""
    if isinstance(expression, ax.ObjectComplementOf):
        pushed = negated(expression.operand)
        return pushed if pushed == expression else normal(pushed)
    if isinstance(expression, (ax.ObjectIntersectionOf, ax.ObjectUnionOf)):
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
    if isinstance(expression, (ax.ObjectIntersectionOf, ax.ObjectUnionOf)):
        return all(map(is_positive, expression.operands))
    if isinstance(expression, (ax.ObjectSomeValuesFrom, ax.ObjectMinCardinality)):
        return is_positive(normal(expression.filler))
    return isinstance(expression, _POSITIVE)
