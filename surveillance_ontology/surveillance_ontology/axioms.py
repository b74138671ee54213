"""OWL 2 axioms and SWRL rules as frozen, hashable records.

The names follow the OWL 2 Structural Specification (https://www.w3.org/TR/owl2-syntax/) and the
SWRL submission (https://www.w3.org/Submission/SWRL/). An entity is its full IRI as a plain `str`; a
named class is therefore a `str` wherever a class expression is expected, a datatype is a `str`
wherever a data range is. Anonymous individuals are strings that begin with `_:`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

from surveillance_ontology.expressions import (
    NOTHING as NOTHING,
)
from surveillance_ontology.expressions import (
    OWL as OWL,
)
from surveillance_ontology.expressions import (
    RDF as RDF,
)
from surveillance_ontology.expressions import (
    RDFS as RDFS,
)
from surveillance_ontology.expressions import (
    SWRL as SWRL,
)
from surveillance_ontology.expressions import (
    SWRLB as SWRLB,
)
from surveillance_ontology.expressions import (
    THING as THING,
)
from surveillance_ontology.expressions import (
    TOP_LITERAL as TOP_LITERAL,
)
from surveillance_ontology.expressions import (
    XSD as XSD,
)
from surveillance_ontology.expressions import (
    Atom as Atom,
)
from surveillance_ontology.expressions import (
    BuiltinAtom as BuiltinAtom,
)
from surveillance_ontology.expressions import (
    ClassAtom as ClassAtom,
)
from surveillance_ontology.expressions import (
    ClassExpression as ClassExpression,
)
from surveillance_ontology.expressions import (
    DataAllValuesFrom as DataAllValuesFrom,
)
from surveillance_ontology.expressions import (
    DataArgument as DataArgument,
)
from surveillance_ontology.expressions import (
    DataComplementOf as DataComplementOf,
)
from surveillance_ontology.expressions import (
    DataExactCardinality as DataExactCardinality,
)
from surveillance_ontology.expressions import (
    DataHasValue as DataHasValue,
)
from surveillance_ontology.expressions import (
    DataIntersectionOf as DataIntersectionOf,
)
from surveillance_ontology.expressions import (
    DataMaxCardinality as DataMaxCardinality,
)
from surveillance_ontology.expressions import (
    DataMinCardinality as DataMinCardinality,
)
from surveillance_ontology.expressions import (
    DataOneOf as DataOneOf,
)
from surveillance_ontology.expressions import (
    DataPropertyAtom as DataPropertyAtom,
)
from surveillance_ontology.expressions import (
    DataRange as DataRange,
)
from surveillance_ontology.expressions import (
    DataRangeAtom as DataRangeAtom,
)
from surveillance_ontology.expressions import (
    DataSomeValuesFrom as DataSomeValuesFrom,
)
from surveillance_ontology.expressions import (
    DatatypeRestriction as DatatypeRestriction,
)
from surveillance_ontology.expressions import (
    DataUnionOf as DataUnionOf,
)
from surveillance_ontology.expressions import (
    DifferentIndividualsAtom as DifferentIndividualsAtom,
)
from surveillance_ontology.expressions import (
    IndividualArgument as IndividualArgument,
)
from surveillance_ontology.expressions import (
    Literal as Literal,
)
from surveillance_ontology.expressions import (
    ObjectAllValuesFrom as ObjectAllValuesFrom,
)
from surveillance_ontology.expressions import (
    ObjectComplementOf as ObjectComplementOf,
)
from surveillance_ontology.expressions import (
    ObjectExactCardinality as ObjectExactCardinality,
)
from surveillance_ontology.expressions import (
    ObjectHasSelf as ObjectHasSelf,
)
from surveillance_ontology.expressions import (
    ObjectHasValue as ObjectHasValue,
)
from surveillance_ontology.expressions import (
    ObjectIntersectionOf as ObjectIntersectionOf,
)
from surveillance_ontology.expressions import (
    ObjectInverseOf as ObjectInverseOf,
)
from surveillance_ontology.expressions import (
    ObjectMaxCardinality as ObjectMaxCardinality,
)
from surveillance_ontology.expressions import (
    ObjectMinCardinality as ObjectMinCardinality,
)
from surveillance_ontology.expressions import (
    ObjectOneOf as ObjectOneOf,
)
from surveillance_ontology.expressions import (
    ObjectPropertyAtom as ObjectPropertyAtom,
)
from surveillance_ontology.expressions import (
    ObjectSomeValuesFrom as ObjectSomeValuesFrom,
)
from surveillance_ontology.expressions import (
    ObjectUnionOf as ObjectUnionOf,
)
from surveillance_ontology.expressions import (
    PropertyExpression as PropertyExpression,
)
from surveillance_ontology.expressions import (
    SameIndividualAtom as SameIndividualAtom,
)
from surveillance_ontology.expressions import (
    Variable as Variable,
)

KINDS = (
    'class',
    'object_property',
    'data_property',
    'individual',
    'annotation_property',
    'datatype',
)


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


_ROLES: dict[type, tuple[tuple[str, str], ...]] = {}


def roles_of(record: type) -> tuple[tuple[str, str], ...]:
    """For each field of a record type, the entity kind a bare `str` in it stands for, or ''."""
    roles = _ROLES.get(record)
    if roles is None:
        roles = _ROLES[record] = _roles_of(record)
    return roles


def _roles_of(record: type[Any]) -> tuple[tuple[str, str], ...]:
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
        elif (entry.name == 'subject' and name == 'AnnotationAssertion') or entry.name == 'value':
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
