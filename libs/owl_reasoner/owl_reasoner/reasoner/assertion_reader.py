"""Assertions as the facts of a program: predicates, representatives and values."""

from __future__ import annotations

from collections.abc import Iterable

from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    NegativeDataPropertyAssertion,
    NegativeObjectPropertyAssertion,
    ObjectPropertyAssertion,
)
from owl_reasoner.owl.expressions import ClassExpression, Literal
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.clauses import Fact, Predicate, Program
from owl_reasoner.reasoner.datatypes import Value, value_of
from owl_reasoner.reasoner.equality import Equality

LEAST_VALUES = 2_000
"""So many values of literals are remembered before those that nobody asserts are forgotten."""


def is_public(predicate: Predicate) -> bool:
    """Tell whether a predicate is a named class or property rather than internal."""
    return isinstance(predicate.expression, str)


def needs_of(
    axioms: Iterable[Axiom],
) -> tuple[list[ClassExpression], list[tuple[str, str]]]:
    """Return the complex classes and the negated properties (kind, IRI) that assertions use."""
    expressions: dict[ClassExpression, None] = {}
    negated: dict[tuple[str, str], None] = {}
    for axiom in axioms:
        if isinstance(axiom, ClassAssertion) and not isinstance(axiom.cls, str):
            expressions[axiom.cls] = None
        elif isinstance(axiom, NegativeObjectPropertyAssertion):
            negated['object', axiom.prop] = None
        elif isinstance(axiom, NegativeDataPropertyAssertion):
            negated['data', axiom.prop] = None
    return list(expressions), list(negated)


class AssertionReader:
    """Reads assertions as facts.

    Args:
        program: Whose predicates the facts have.
        equality: Under whose names they stand.

    Attributes:
        spelling: A literal for each value, as some assertion wrote it.
    """

    def __init__(self, program: Program, equality: Equality) -> None:
        self._program, self._equality = program, equality
        self.spelling: dict[Value, Literal] = {}
        self._values: dict[Literal, Value] = {}
        self._most_values = LEAST_VALUES

    def value(self, literal: Literal) -> Value:
        """Return the literal's value, remembered."""
        values = self._values
        value = values.get(literal)
        if value is None:
            value = values[literal] = value_of(literal)
            self.spelling.setdefault(value, literal)
        return value

    def forget_values(self, asserted: Iterable[Fact]) -> None:
        """Keep the values of asserted facts, where there are many: each moment of a clock is
        another one.
        """
        if len(self._values) <= self._most_values:
            return
        used = {fact[-1] for fact in asserted}
        self._values = {text: value for text, value in self._values.items() if value in used}
        self.spelling = {value: text for value, text in self.spelling.items() if value in used}
        self._most_values = max(LEAST_VALUES, 2 * len(self._values))

    def keep_values(self) -> None:
        """Take all values for asserted ones, as where nothing was ever retracted."""
        self._most_values = max(self._most_values, 2 * len(self._values))

    def fact_of(self, axiom: Axiom) -> Fact | None:
        """Return the fact an assertion states, in representatives; None for assertions of another
        kind.
        """
        names = self._equality.representative
        kind = type(axiom)
        if kind is DataPropertyAssertion:
            subject = axiom.subject  # type: ignore[attr-defined]
            value = self.value(axiom.literal)  # type: ignore[attr-defined]
            return self._program.data(axiom.prop), names.get(subject, subject), value  # type: ignore[attr-defined]
        if kind is ObjectPropertyAssertion:
            subject, target = axiom.subject, axiom.object  # type: ignore[attr-defined]
            prop = self._program.object(axiom.prop)  # type: ignore[attr-defined]
            return prop, names.get(subject, subject), names.get(target, target)
        if isinstance(axiom, ClassAssertion):
            individual = names.get(axiom.individual, axiom.individual)
            if axiom.cls == THING:
                return None
            if axiom.cls == NOTHING:
                return self._program.nothing, individual
            if isinstance(axiom.cls, str):
                return self._program.cls(axiom.cls), individual
            label = self._program.labels.get(axiom.cls)
            return None if label is None else (label, individual)
        if isinstance(axiom, NegativeObjectPropertyAssertion):
            negative = self._program.negatives[self._program.object(axiom.prop)]
            pair = names.get(axiom.subject, axiom.subject), names.get(axiom.object, axiom.object)
            return (negative, *pair)
        if isinstance(axiom, NegativeDataPropertyAssertion):
            negative = self._program.negatives[self._program.data(axiom.prop)]
            return negative, names.get(axiom.subject, axiom.subject), self.value(axiom.literal)
        if isinstance(axiom, DifferentIndividuals) and len(axiom.individuals) == 1:
            (individual,) = axiom.individuals
            return self._program.nothing, names.get(individual, individual)
        return None

    def understands(self, axiom: Axiom) -> bool:
        """Tell whether the program was made for a complex class or negated property that an
        assertion uses.
        """
        if isinstance(axiom, ClassAssertion):
            return isinstance(axiom.cls, str) or axiom.cls in self._program.labels
        if isinstance(axiom, NegativeObjectPropertyAssertion):
            return self._program.object(axiom.prop) in self._program.negatives
        if isinstance(axiom, NegativeDataPropertyAssertion):
            return self._program.data(axiom.prop) in self._program.negatives
        return True

    def takes(self, axiom: Axiom) -> bool:
        """Tell whether the program keeps an assertion apart from others: it understands it, and a
        complex class has a label that is no named class equal to it, with what it implies.
        """
        if not self.understands(axiom):
            return False
        if isinstance(axiom, ClassAssertion) and not isinstance(axiom.cls, str):
            required = axiom.cls in self._program.required
            return required and not is_public(self._program.labels[axiom.cls])
        return True

    def take_spelling(self, other: AssertionReader) -> None:
        """Write derived values as another reader did."""
        self._values.update(other._values)
        self.spelling.update(other.spelling)
