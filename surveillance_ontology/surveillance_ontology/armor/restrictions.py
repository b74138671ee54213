"""The text form in which ARMOR's QUERY CLASS RESTRICTIONS gives a class definition.

``[C-DEFINITION_CLASS : ROOM -> (LOCATION), C-DEFINITION_SOME_OBJECT : ROOM -> hasDoor(DOOR)]``;
named classes that stand inside a restriction are listed once more by themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from surveillance_ontology.owl.expressions import (
    ClassExpression,
    DataAllValuesFrom,
    DataExactCardinality,
    DataHasValue,
    DataMaxCardinality,
    DataMinCardinality,
    DataRange,
    DataSomeValuesFrom,
    ObjectAllValuesFrom,
    ObjectComplementOf,
    ObjectExactCardinality,
    ObjectHasValue,
    ObjectIntersectionOf,
    ObjectInverseOf,
    ObjectMaxCardinality,
    ObjectMinCardinality,
    ObjectSomeValuesFrom,
    ObjectUnionOf,
    PropertyExpression,
)
from surveillance_ontology.owl.vocabulary import local_name

_VALUES = {
    ObjectSomeValuesFrom: 'SOME_OBJECT',
    ObjectAllValuesFrom: 'ALL_OBJECT',
    DataSomeValuesFrom: 'SOME_DATA',
    DataAllValuesFrom: 'ALL_DATA',
}
_CARDINALITIES = {
    ObjectMinCardinality: 'MIN_OBJECT',
    ObjectMaxCardinality: 'MAX_OBJECT',
    ObjectExactCardinality: 'EXACT_OBJECT',
    DataMinCardinality: 'MIN_DATA',
    DataMaxCardinality: 'MAX_DATA',
    DataExactCardinality: 'EXACT_DATA',
}


def describe(cls: str, definition: ClassExpression) -> str:
    """Write one definition of a class; empty when it has no part that ARMOR has a form for."""
    atoms = list(dict.fromkeys(_atoms(local_name(cls), definition)))
    return f'[{", ".join(atoms)}]' if atoms else ''


def _atoms(name: str, part: Any) -> Iterator[str]:
    head = f'C-DEFINITION_{{}} : {name} -> '
    if isinstance(part, str):
        yield f'{head.format("CLASS")}({local_name(part)})'
    elif isinstance(part, ObjectIntersectionOf | ObjectUnionOf):
        for operand in part.operands:
            yield from _atoms(name, operand)
    elif isinstance(part, ObjectComplementOf):
        yield from _atoms(name, part.operand)
    elif isinstance(part, ObjectHasValue):
        yield f'{head.format("SOME_OBJECT")}{_prop(part.prop)}({local_name(part.individual)})'
    elif isinstance(part, DataHasValue):
        yield f'{head.format("SOME_DATA")}{_prop(part.prop)}({part.literal.lexical})'
    elif kind := _CARDINALITIES.get(type(part)):
        filler = _filler(part)
        yield f'{head.format(kind)}{_prop(part.prop)} {part.n}({_filler_text(filler)})'
        yield from _nested(name, filler)
    elif kind := _VALUES.get(type(part)):
        filler = _filler(part)
        yield f'{head.format(kind)}{_prop(part.prop)}({_filler_text(filler)})'
        yield from _nested(name, filler)


def _filler(part: object) -> ClassExpression | DataRange:
    found: ClassExpression | DataRange = getattr(part, 'filler', None) or part.range  # type: ignore[attr-defined]
    return found


def _filler_text(filler: ClassExpression | DataRange) -> str:
    if isinstance(filler, str):
        return local_name(filler)
    if isinstance(filler, ObjectIntersectionOf | ObjectUnionOf):
        word = ' and ' if isinstance(filler, ObjectIntersectionOf) else ' or '
        return word.join(_filler_text(operand) for operand in filler.operands)
    return type(filler).__name__


def _nested(name: str, filler: ClassExpression | DataRange) -> Iterator[str]:
    if not type(filler).__name__.startswith('Data') and not _is_datatype(filler):
        yield from _atoms(name, filler)


def _is_datatype(filler: ClassExpression | DataRange) -> bool:
    return isinstance(filler, str) and filler.startswith(
        ('http://www.w3.org/2001/XMLSchema#', 'http://www.w3.org/2000/01/rdf-schema#Literal')
    )


def _prop(prop: PropertyExpression) -> str:
    if isinstance(prop, ObjectInverseOf):
        return f'inverse({local_name(prop.prop)})'
    return local_name(prop)
