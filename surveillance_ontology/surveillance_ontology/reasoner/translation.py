"""Assertions as stored facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from surveillance_ontology.owl.axioms import (
    Assertion,
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    NegativeDataPropertyAssertion,
    NegativeObjectPropertyAssertion,
    ObjectPropertyAssertion,
    SameIndividual,
)
from surveillance_ontology.owl.entities import entities_of
from surveillance_ontology.owl.expressions import ClassExpression, Literal
from surveillance_ontology.owl.vocabulary import NOTHING, THING
from surveillance_ontology.reasoner.clauses import Fact, Program
from surveillance_ontology.reasoner.datatypes import Value, value_of
from surveillance_ontology.reasoner.equality import Equality


class Translation:
    """Turns assertions into facts of a program, each individual under its representative's name.

    Args:
        program: Whose predicates the facts are of.
        about: Gives the assertions that mention an individual, as of now.

    Attributes:
        equality: Who stands for whom.
        spelling: A literal for each value, as some assertion wrote it.
    """

    def __init__(self, program: Program, about: Callable[[str], Iterable[Axiom]]) -> None:
        self.program = program
        self.about = about
        self.equality = Equality()
        self.spelling: dict[Value, Literal] = {}
        self._values: dict[Literal, Value] = {}

    def value(self, literal: Literal) -> Value:
        """The literal's value, remembered."""
        values = self._values
        value = values.get(literal)
        if value is None:
            if len(values) > 200_000:
                values.clear()
                self.spelling.clear()
            value = values[literal] = value_of(literal)
            self.spelling.setdefault(value, literal)
        return value

    def fact_of(self, axiom: Axiom) -> Fact | None:
        """The fact an assertion states, in representatives; None for assertions of another kind."""
        names = self.equality.representative
        kind = type(axiom)
        if kind is DataPropertyAssertion:
            subject = axiom.subject  # type: ignore[attr-defined]
            value = self.value(axiom.literal)  # type: ignore[attr-defined]
            return self.program.data(axiom.prop), names.get(subject, subject), value  # type: ignore[attr-defined]
        if kind is ObjectPropertyAssertion:
            subject, target = axiom.subject, axiom.object  # type: ignore[attr-defined]
            prop = self.program.object(axiom.prop)  # type: ignore[attr-defined]
            return prop, names.get(subject, subject), names.get(target, target)
        if isinstance(axiom, ClassAssertion):
            individual = names.get(axiom.individual, axiom.individual)
            if axiom.cls == THING:
                return None
            if axiom.cls == NOTHING:
                return self.program.nothing, individual
            if isinstance(axiom.cls, str):
                return self.program.cls(axiom.cls), individual
            label = self.program.labels.get(axiom.cls)
            return None if label is None else (label, individual)
        if isinstance(axiom, NegativeObjectPropertyAssertion):
            negative = self.program.negatives[self.program.object(axiom.prop)]
            pair = names.get(axiom.subject, axiom.subject), names.get(axiom.object, axiom.object)
            return (negative, *pair)
        if isinstance(axiom, NegativeDataPropertyAssertion):
            negative = self.program.negatives[self.program.data(axiom.prop)]
            return negative, names.get(axiom.subject, axiom.subject), self.value(axiom.literal)
        return None

    def current(self, fact: Fact) -> Fact:
        """The fact with every individual under its representative's name."""
        names = self.equality.representative
        if not names:
            return fact
        if len(fact) == 2:
            return fact[0], names.get(fact[1], fact[1])
        predicate, x, y = fact
        return predicate, names.get(x, x), y if predicate.kind == 'data' else names.get(y, y)

    def states(self, axiom: Axiom) -> bool:
        """Whether an assertion is among those that were made."""
        individuals = axiom.individuals if isinstance(axiom, SameIndividual) else None
        name = next(iter(individuals)) if individuals else next(iter(individuals_of(axiom)))
        return axiom in self.about(name)

    @staticmethod
    def needs_of(
        axioms: Iterable[Axiom],
    ) -> tuple[list[ClassExpression], list[tuple[str, str]]]:
        """The complex classes and the negated properties (kind, IRI) that assertions use."""
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

    def understands(self, axiom: Axiom) -> bool:
        """Whether the program was made for a complex class or negated property that an assertion
        uses.
        """
        if isinstance(axiom, ClassAssertion):
            return isinstance(axiom.cls, str) or axiom.cls in self.program.labels
        if isinstance(axiom, NegativeObjectPropertyAssertion):
            return self.program.object(axiom.prop) in self.program.negatives
        if isinstance(axiom, NegativeDataPropertyAssertion):
            return self.program.data(axiom.prop) in self.program.negatives
        return True

    def take_spelling(self, other: Translation) -> None:
        """Writes derived values as another engine did."""
        self._values.update(other._values)
        self.spelling.update(other.spelling)


def individuals_of(axiom: Axiom) -> set[str]:
    """The individuals that an axiom mentions."""
    return {name for kind, name in entities_of(axiom) if kind == 'individual'}


def is_about_individuals(axiom: Axiom) -> bool:
    """Whether an axiom is an assertion; the declaration of an individual is one."""
    return isinstance(axiom, Assertion) or (
        isinstance(axiom, Declaration) and axiom.kind == 'individual'
    )
