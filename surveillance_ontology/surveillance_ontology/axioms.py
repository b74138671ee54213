"""OWL 2 axioms, class expressions and SWRL rules as frozen, hashable records.

The names follow the OWL 2 Structural Specification (https://www.w3.org/TR/owl2-syntax/) and the
SWRL submission (https://www.w3.org/Submission/SWRL/). An entity is its full IRI as a plain `str`; a
named class is therefore a `str` wherever a class expression is expected, a datatype is a `str`
wherever a data range is. Anonymous individuals are strings that begin with `_:`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from surveillance_ontology.reasoner.datatypes import Value

OWL = 'http://www.w3.org/2002/07/owl#'
RDF = 'http://www.w3.org/1999/02/22-rdf-syntax-ns#'
RDFS = 'http://www.w3.org/2000/01/rdf-schema#'
XSD = 'http://www.w3.org/2001/XMLSchema#'
SWRL = 'http://www.w3.org/2003/11/swrl#'
SWRLB = 'http://www.w3.org/2003/11/swrlb#'

THING = OWL + 'Thing'
NOTHING = OWL + 'Nothing'
TOP_LITERAL = RDFS + 'Literal'

KINDS = (
    'class',
    'object_property',
    'data_property',
    'individual',
    'annotation_property',
    'datatype',
)


@dataclass(frozen=True, slots=True)
class Literal:
    """A literal as written: equal only to one with the same lexical form, datatype and language.

    Two literals that denote one value (`"5"^^xsd:int`, `"5.0"^^xsd:decimal`) have equal `value()`.
    """

    lexical: str
    datatype: str = XSD + 'string'
    language: str = ''

    def value(self) -> Value:
        """The value denoted, comparable by value space; an ill-formed literal denotes itself."""
        from surveillance_ontology.reasoner.datatypes import value_of

        return value_of(self)


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


# --- axioms ---


class Axiom:
    """What an ontology states. Subclasses are frozen records."""

    __slots__ = ()


class Assertion(Axiom):
    """An axiom about individuals (the ABox)."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Declaration(Axiom):
    """`kind` is one of `KINDS`."""

    kind: str
    iri: str


@dataclass(frozen=True, slots=True)
class Import(Axiom):
    iri: str


@dataclass(frozen=True, slots=True)
class AnnotationAssertion(Axiom):
    """`subject` is an IRI; `value` an IRI or a literal. No meaning to the reasoner."""

    prop: str
    subject: str
    value: str | Literal


@dataclass(frozen=True, slots=True)
class ClassAssertion(Assertion):
    cls: ClassExpression
    individual: str


@dataclass(frozen=True, slots=True)
class ObjectPropertyAssertion(Assertion):
    prop: str
    subject: str
    object: str


@dataclass(frozen=True, slots=True)
class NegativeObjectPropertyAssertion(Assertion):
    prop: str
    subject: str
    object: str


@dataclass(frozen=True, slots=True)
class DataPropertyAssertion(Assertion):
    prop: str
    subject: str
    literal: Literal


@dataclass(frozen=True, slots=True)
class NegativeDataPropertyAssertion(Assertion):
    prop: str
    subject: str
    literal: Literal


@dataclass(frozen=True, slots=True)
class SameIndividual(Assertion):
    individuals: frozenset[str]


@dataclass(frozen=True, slots=True)
class DifferentIndividuals(Assertion):
    individuals: frozenset[str]


@dataclass(frozen=True, slots=True)
class SubClassOf(Axiom):
    sub: ClassExpression
    sup: ClassExpression


@dataclass(frozen=True, slots=True)
class EquivalentClasses(Axiom):
    classes: tuple[ClassExpression, ...]


@dataclass(frozen=True, slots=True)
class DisjointClasses(Axiom):
    classes: tuple[ClassExpression, ...]


@dataclass(frozen=True, slots=True)
class DisjointUnion(Axiom):
    cls: str
    classes: tuple[ClassExpression, ...]


@dataclass(frozen=True, slots=True)
class SubObjectPropertyOf(Axiom):
    sub: PropertyExpression
    sup: PropertyExpression


@dataclass(frozen=True, slots=True)
class SubPropertyChainOf(Axiom):
    """`chain` composed from left to right implies `sup`."""

    chain: tuple[PropertyExpression, ...]
    sup: PropertyExpression


@dataclass(frozen=True, slots=True)
class EquivalentObjectProperties(Axiom):
    props: tuple[PropertyExpression, ...]


@dataclass(frozen=True, slots=True)
class DisjointObjectProperties(Axiom):
    props: tuple[PropertyExpression, ...]


@dataclass(frozen=True, slots=True)
class InverseObjectProperties(Axiom):
    first: PropertyExpression
    second: PropertyExpression


@dataclass(frozen=True, slots=True)
class ObjectPropertyDomain(Axiom):
    prop: PropertyExpression
    domain: ClassExpression


@dataclass(frozen=True, slots=True)
class ObjectPropertyRange(Axiom):
    prop: PropertyExpression
    range: ClassExpression


@dataclass(frozen=True, slots=True)
class FunctionalObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class InverseFunctionalObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class ReflexiveObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class IrreflexiveObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class SymmetricObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class AsymmetricObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class TransitiveObjectProperty(Axiom):
    prop: PropertyExpression


@dataclass(frozen=True, slots=True)
class SubDataPropertyOf(Axiom):
    sub: str
    sup: str


@dataclass(frozen=True, slots=True)
class EquivalentDataProperties(Axiom):
    props: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class DisjointDataProperties(Axiom):
    props: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class DataPropertyDomain(Axiom):
    prop: str
    domain: ClassExpression


@dataclass(frozen=True, slots=True)
class DataPropertyRange(Axiom):
    prop: str
    range: DataRange


@dataclass(frozen=True, slots=True)
class FunctionalDataProperty(Axiom):
    prop: str


@dataclass(frozen=True, slots=True)
class DatatypeDefinition(Axiom):
    datatype: str
    range: DataRange


@dataclass(frozen=True, slots=True)
class HasKey(Axiom):
    cls: ClassExpression
    object_props: tuple[PropertyExpression, ...]
    data_props: tuple[str, ...]


# --- SWRL ---

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


@dataclass(frozen=True, slots=True)
class Rule(Axiom):
    """A SWRL rule. `annotations` (pairs of property and value) play no part in equality."""

    body: tuple[Atom, ...]
    head: tuple[Atom, ...]
    annotations: tuple[tuple[str, str | Literal], ...] = field(default=(), compare=False)

    @property
    def label(self) -> str:
        """The text of its rdfs:label, '' without one."""
        for prop, value in self.annotations:
            if prop == RDFS + 'label':
                return value.lexical if isinstance(value, Literal) else value
        return ''


# --- what an axiom mentions ---

# The kind of entity a string field stands for, by field name; fields of class expressions, property
# expressions and data ranges recurse. 'individual' wins over the rest in assertions.
_ROLE_OF_FIELD = {
    'cls': 'class',
    'classes': 'class',
    'sub': 'class',
    'sup': 'class',
    'filler': 'class',
    'operand': 'class',
    'operands': 'class',
    'domain': 'class',
    'individual': 'individual',
    'individuals': 'individual',
    'subject': 'individual',
    'object': 'individual',
    'argument': 'individual',
    'datatype': 'datatype',
}
_OBJECT, _DATA = 'object_property', 'data_property'


@cache
def roles_of(record: type) -> tuple[tuple[str, str], ...]:
    """For each field of a record type, the entity kind a bare `str` in it stands for ('' for none)."""
    name = record.__name__
    data = name.startswith('Data') or 'Data' in name
    pairs = []
    for entry in fields(record):
        role = _ROLE_OF_FIELD.get(entry.name, '')
        if entry.name in ('prop', 'props', 'chain'):
            role = 'annotation_property' if name == 'AnnotationAssertion' else ''
            role = role or (_DATA if data else _OBJECT)
        elif entry.name in ('sub', 'sup') and 'Property' in name:
            role = _DATA if data else _OBJECT
        elif entry.name in ('first', 'second'):
            role = _OBJECT if name == 'InverseObjectProperties' else 'individual'
        elif entry.name == 'object_props':
            role = _OBJECT
        elif entry.name == 'data_props':
            role = _DATA
        elif entry.name == 'range':
            role = 'class' if name == 'ObjectPropertyRange' else 'datatype'
        elif data and entry.name in ('operand', 'operands'):
            role = 'datatype'
        elif entry.name == 'subject' and name == 'AnnotationAssertion':
            role = 'annotated'
        elif entry.name == 'value':
            role = 'annotated'
        pairs.append((entry.name, role))
    return tuple(pairs)


def entities_of(record: object) -> Iterator[tuple[str, str]]:
    """Every entity a record mentions, as pairs (kind, IRI), with repeats.

    `kind` is one of `KINDS`, or 'annotated' for the IRIs of an annotation.
    """
    if isinstance(record, Declaration):
        yield record.kind, record.iri
        return
    if isinstance(record, (Literal, Variable, Import, str)):
        return
    for name, role in roles_of(type(record)):
        value = getattr(record, name)
        if name in ('annotations', 'facets'):
            continue
        parts = value if isinstance(value, (tuple, frozenset)) else (value,)
        for part in parts:
            if isinstance(part, str):
                if role:
                    yield role, part
            elif not isinstance(part, (int, Literal, Variable)):
                yield from entities_of(part)


def local_name(iri: str) -> str:
    """What follows the last `#`, else the last `/`, else the whole."""
    for mark in ('#', '/'):
        _, found, name = iri.rpartition(mark)
        if found and name:
            return name
    return iri
