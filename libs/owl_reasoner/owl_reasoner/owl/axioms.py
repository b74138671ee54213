"""OWL 2 axioms and SWRL rules as frozen, hashable records.

The names follow the OWL 2 Structural Specification (https://www.w3.org/TR/owl2-syntax/) and the
SWRL submission (https://www.w3.org/Submission/SWRL/). An entity is its full IRI as a plain `str`; a
named class is therefore a `str` wherever a class expression is expected, a datatype is a `str`
wherever a data range is. Anonymous individuals are strings that begin with `_:`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import combinations
from typing import TypeVar

from owl_reasoner.owl.expressions import (
    Atom,
    ClassExpression,
    DataRange,
    Literal,
    PropertyExpression,
)
from owl_reasoner.owl.vocabulary import RDFS

T = TypeVar('T')
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


class Annotation(Axiom):
    """What an ontology says of its own parts; without meaning to a reasoner."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class AnnotationAssertion(Annotation):
    """`subject` is an IRI; `value` an IRI or a literal."""

    prop: str
    subject: str
    value: str | Literal


@dataclass(frozen=True, slots=True)
class AxiomAnnotation(Annotation):
    """What is said of another axiom, as pairs of property and value (an IRI or a literal)."""

    axiom: Axiom
    annotations: tuple[tuple[str, str | Literal], ...]


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


def pairs_of(members: Iterable[T]) -> Iterator[tuple[T, T]]:
    """Yield every two of what an axiom lists; what it lists twice counts once (OWL 2, section 2.1).

    What it lists twice and nothing else is a pair, as in `A owl:disjointWith A`.
    """
    listed = tuple(members)
    distinct = tuple(dict.fromkeys(listed))
    return combinations(distinct if len(distinct) > 1 else listed, 2)


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
