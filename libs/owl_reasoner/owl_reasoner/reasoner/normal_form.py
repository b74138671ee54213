"""Class expressions in a normal form of few kinds.

Complements stand only before names, single individuals and `ObjectHasSelf`; an enumeration is a
union of single individuals; an exact number is an intersection. `min` is at least 2, `max` at least
1: the others are `some`, `value` and `only`. owl:Thing and owl:Nothing stand only alone.
"""

from __future__ import annotations

from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import ClassExpression, PropertyExpression
from owl_reasoner.owl.vocabulary import NOTHING, THING

_POSITIVE = (
    *(str, ex.ObjectHasValue, ex.ObjectHasSelf, ex.ObjectOneOf),
    *(ex.DataSomeValuesFrom, ex.DataMinCardinality, ex.DataHasValue),
)


def normal_form(one: ClassExpression, negate: bool = False) -> ClassExpression:
    """Return a class expression, or its complement, in the normal form."""
    if isinstance(one, str) and one in (THING, NOTHING):
        return THING if (one == THING) != negate else NOTHING
    if isinstance(one, str | ex.ObjectHasSelf):
        return ex.ObjectComplementOf(one) if negate else one
    if isinstance(one, ex.ObjectComplementOf):
        return normal_form(one.operand, not negate)
    if isinstance(one, ex.ObjectIntersectionOf | ex.ObjectUnionOf):
        parts = [normal_form(operand, negate) for operand in one.operands]
        return _joined(parts, isinstance(one, ex.ObjectUnionOf) != negate)
    if isinstance(one, ex.ObjectOneOf):
        singles = [ex.ObjectOneOf((name,)) for name in one.individuals]
        return _joined([ex.ObjectComplementOf(s) if negate else s for s in singles], not negate)
    return _restriction(one, negate)


def _joined(parts: list[ClassExpression], is_union: bool) -> ClassExpression:
    neutral, absorbing = (NOTHING, THING) if is_union else (THING, NOTHING)
    kind = ex.ObjectUnionOf if is_union else ex.ObjectIntersectionOf
    flat: dict[ClassExpression, None] = {}
    for part in parts:
        flat.update(dict.fromkeys(part.operands if isinstance(part, kind) else (part,)))
    flat.pop(neutral, None)
    if absorbing in flat:
        return absorbing
    return kind(tuple(flat)) if len(flat) > 1 else next(iter(flat), neutral)


def _restriction(one: ClassExpression, negate: bool) -> ClassExpression:
    if isinstance(one, ex.ObjectHasValue):
        return _related(1, one.prop, ex.ObjectOneOf((one.individual,)), True, negate)
    if isinstance(one, ex.ObjectSomeValuesFrom):
        return _related(1, one.prop, one.filler, True, negate)
    if isinstance(one, ex.ObjectAllValuesFrom):
        return _related(0, one.prop, ex.ObjectComplementOf(one.filler), False, negate)
    if isinstance(one, ex.ObjectMinCardinality | ex.ObjectMaxCardinality):
        at_least = isinstance(one, ex.ObjectMinCardinality)
        return _related(one.n, one.prop, one.filler, at_least, negate)
    if isinstance(one, ex.ObjectExactCardinality):
        bounds = [_related(one.n, one.prop, one.filler, low, negate) for low in (True, False)]
        return _joined(bounds, negate)
    if isinstance(one, ex.DataHasValue):
        return _valued(1, one.prop, ex.DataOneOf((one.literal,)), True, negate)
    if isinstance(one, ex.DataSomeValuesFrom):
        return _valued(1, one.prop, one.range, True, negate)
    if isinstance(one, ex.DataAllValuesFrom):
        return _valued(0, one.prop, _other_values(one.range), False, negate)
    if isinstance(one, ex.DataMinCardinality | ex.DataMaxCardinality):
        at_least = isinstance(one, ex.DataMinCardinality)
        return _valued(one.n, one.prop, one.range, at_least, negate)
    assert isinstance(one, ex.DataExactCardinality)
    counts = [_valued(one.n, one.prop, one.range, low, negate) for low in (True, False)]
    return _joined(counts, negate)


def _related(
    n: int, prop: PropertyExpression, filler: ClassExpression, at_least: bool, negate: bool
) -> ClassExpression:
    """Return a bound on the related individuals; not at least n is at most n - 1."""
    if negate:
        n, at_least = n - 1 if at_least else n + 1, not at_least
    if not at_least and n == 0:
        every = normal_form(filler, True)
        return THING if every == THING else ex.ObjectAllValuesFrom(prop, every)
    if n <= 0:
        return THING if at_least else NOTHING
    filler = normal_form(filler)
    if filler == NOTHING:
        return NOTHING if at_least else THING
    if not at_least:
        return ex.ObjectMaxCardinality(n, prop, filler)
    if n > 1:
        return ex.ObjectMinCardinality(n, prop, filler)
    if isinstance(filler, ex.ObjectOneOf):
        return ex.ObjectHasValue(prop, filler.individuals[0])
    return ex.ObjectSomeValuesFrom(prop, filler)


def _valued(
    n: int, prop: str, values: ex.DataRange, at_least: bool, negate: bool
) -> ClassExpression:
    """Return a bound on the values."""
    if negate:
        n, at_least = n - 1 if at_least else n + 1, not at_least
    if at_least:
        if n > 1:
            return ex.DataMinCardinality(n, prop, values)
        if isinstance(values, ex.DataOneOf) and len(values.literals) == 1:
            return ex.DataHasValue(prop, values.literals[0]) if n else THING
        return ex.DataSomeValuesFrom(prop, values) if n else THING
    if n > 0:
        return ex.DataMaxCardinality(n, prop, values)
    return NOTHING if n else ex.DataAllValuesFrom(prop, _other_values(values))


def _other_values(values: ex.DataRange) -> ex.DataRange:
    if isinstance(values, ex.DataComplementOf):
        return values.operand
    return ex.DataComplementOf(values)


def is_positive(one: ClassExpression) -> bool:
    """Tell whether facts that hold can show membership, so that a clause body can state it."""
    if isinstance(one, (ex.ObjectIntersectionOf, ex.ObjectUnionOf)):
        return all(map(is_positive, one.operands))
    if isinstance(one, (ex.ObjectSomeValuesFrom, ex.ObjectMinCardinality)):
        return is_positive(one.filler)
    return isinstance(one, _POSITIVE)
