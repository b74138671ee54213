"""What axioms are made of: literals, data ranges, property and class expressions, SWRL atoms.

Names follow the OWL 2 Structural Specification (https://www.w3.org/TR/owl2-syntax/) and the SWRL
submission (https://www.w3.org/Submission/SWRL/). All are frozen, hashable records.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

from owl_reasoner.owl.vocabulary import THING, TOP_LITERAL, XSD


@dataclass(frozen=True, slots=True)
class Literal:
    """A literal as written: equal only to one with the same lexical form, datatype and language.

    What it denotes is the matter of `reasoner.datatypes.value_of`: `"5"^^xsd:int` and
    `"5.0"^^xsd:decimal` are two literals of one value.
    """

    lexical: str
    datatype: str = XSD + 'string'
    language: str = ''


_TAG = re.compile('[a-z]+(-[a-z0-9]+)*')


@lru_cache(maxsize=256)
def language_tag(text: str) -> str:
    """Return a language tag as literals have it: in lower case, en_US as en-us.

    Raises:
        ValueError: Not a tag (BCP 47), and not empty.
    """
    tag = text.lower().replace('_', '-')
    if tag and not _TAG.fullmatch(tag):
        raise ValueError(f'{text[:40]!r} is no language tag')
    return tag


@dataclass(frozen=True, slots=True)
class Variable:
    """A SWRL variable, local to its rule."""

    name: str


# --- property expressions ---


@dataclass(frozen=True, slots=True)
class ObjectInverseOf:
    prop: str


PropertyExpression: TypeAlias = str | ObjectInverseOf


# --- data ranges ---


@dataclass(frozen=True, slots=True)
class DatatypeRestriction:
    """A datatype narrowed by facets, each the pair (facet IRI, bound)."""

    datatype: str
    facets: tuple[tuple[str, Literal], ...]


@dataclass(frozen=True, slots=True)
class DataOneOf:
    literals: tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class DataIntersectionOf:
    operands: tuple[DataRange, ...]


@dataclass(frozen=True, slots=True)
class DataUnionOf:
    operands: tuple[DataRange, ...]


@dataclass(frozen=True, slots=True)
class DataComplementOf:
    operand: DataRange


DataRange: TypeAlias = (
    str | DatatypeRestriction | DataOneOf | DataIntersectionOf | DataUnionOf | DataComplementOf
)


# --- class expressions ---


@dataclass(frozen=True, slots=True)
class ObjectIntersectionOf:
    operands: tuple[ClassExpression, ...]


@dataclass(frozen=True, slots=True)
class ObjectUnionOf:
    operands: tuple[ClassExpression, ...]


@dataclass(frozen=True, slots=True)
class ObjectComplementOf:
    operand: ClassExpression


@dataclass(frozen=True, slots=True)
class ObjectOneOf:
    individuals: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ObjectSomeValuesFrom:
    prop: PropertyExpression
    filler: ClassExpression


@dataclass(frozen=True, slots=True)
class ObjectAllValuesFrom:
    prop: PropertyExpression
    filler: ClassExpression


@dataclass(frozen=True, slots=True)
class ObjectHasValue:
    prop: PropertyExpression
    individual: str


@dataclass(frozen=True, slots=True)
class ObjectHasSelf:
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class ObjectMinCardinality:
    n: int
    prop: PropertyExpression
    filler: ClassExpression = THING


@dataclass(frozen=True, slots=True)
class ObjectMaxCardinality:
    n: int
    prop: PropertyExpression
    filler: ClassExpression = THING


@dataclass(frozen=True, slots=True)
class ObjectExactCardinality:
    n: int
    prop: PropertyExpression
    filler: ClassExpression = THING


@dataclass(frozen=True, slots=True)
class DataSomeValuesFrom:
    prop: str
    range: DataRange


@dataclass(frozen=True, slots=True)
class DataAllValuesFrom:
    prop: str
    range: DataRange


@dataclass(frozen=True, slots=True)
class DataHasValue:
    prop: str
    literal: Literal


@dataclass(frozen=True, slots=True)
class DataMinCardinality:
    n: int
    prop: str
    range: DataRange = TOP_LITERAL


@dataclass(frozen=True, slots=True)
class DataMaxCardinality:
    n: int
    prop: str
    range: DataRange = TOP_LITERAL


@dataclass(frozen=True, slots=True)
class DataExactCardinality:
    n: int
    prop: str
    range: DataRange = TOP_LITERAL


ClassExpression: TypeAlias = (
    str
    | ObjectIntersectionOf
    | ObjectUnionOf
    | ObjectComplementOf
    | ObjectOneOf
    | ObjectSomeValuesFrom
    | ObjectAllValuesFrom
    | ObjectHasValue
    | ObjectHasSelf
    | ObjectMinCardinality
    | ObjectMaxCardinality
    | ObjectExactCardinality
    | DataSomeValuesFrom
    | DataAllValuesFrom
    | DataHasValue
    | DataMinCardinality
    | DataMaxCardinality
    | DataExactCardinality
)


# --- SWRL atoms ---

IndividualArgument: TypeAlias = str | Variable
DataArgument: TypeAlias = Literal | Variable


@dataclass(frozen=True, slots=True)
class ClassAtom:
    cls: ClassExpression
    argument: IndividualArgument


@dataclass(frozen=True, slots=True)
class DataRangeAtom:
    range: DataRange
    argument: DataArgument


@dataclass(frozen=True, slots=True)
class ObjectPropertyAtom:
    prop: PropertyExpression
    first: IndividualArgument
    second: IndividualArgument


@dataclass(frozen=True, slots=True)
class DataPropertyAtom:
    prop: str
    first: IndividualArgument
    second: DataArgument


@dataclass(frozen=True, slots=True)
class SameIndividualAtom:
    first: IndividualArgument
    second: IndividualArgument


@dataclass(frozen=True, slots=True)
class DifferentIndividualsAtom:
    first: IndividualArgument
    second: IndividualArgument


@dataclass(frozen=True, slots=True)
class BuiltinAtom:
    """`builtin` is the built-in's full IRI (swrlb)."""

    builtin: str
    arguments: tuple[DataArgument, ...]


Atom: TypeAlias = (
    ClassAtom
    | DataRangeAtom
    | ObjectPropertyAtom
    | DataPropertyAtom
    | SameIndividualAtom
    | DifferentIndividualsAtom
    | BuiltinAtom
)
