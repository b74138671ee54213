"""Stored facts as the axioms a user knows, every individual under each of its names."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from surveillance_ontology.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SameIndividual,
)
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.reasoner.clauses import Fact, Predicate
from surveillance_ontology.reasoner.datatypes import Value, literal_of
from surveillance_ontology.reasoner.engine import Engine

Classes = Mapping[str, Iterable[str]]


def is_public(predicate: Predicate) -> bool:
    """Whether a predicate is a named class or property rather than internal."""
    return isinstance(predicate.expression, str)


class FactView:
    """Reads an engine's facts."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def literal(self, value: Value) -> Literal:
        """A literal for a value: as some assertion writes it, else in its most general datatype."""
        return self._engine.spelling.get(value) or literal_of(value)

    def public(self, fact: Fact, classes: Classes) -> Iterator[Axiom]:
        """A stored fact as assertions, one for each combination of names."""
        predicate = fact[0]
        name = predicate.expression
        subjects = classes.get(fact[1]) or (fact[1],)
        if predicate.kind == 'class':
            for subject in subjects:
                yield ClassAssertion(name, subject)
        elif predicate.kind == 'data':
            for subject in subjects:
                yield DataPropertyAssertion(name, subject, self.literal(fact[2]))
        else:
            for subject in subjects:
                for target in classes.get(fact[2]) or (fact[2],):
                    yield ObjectPropertyAssertion(name, subject, target)

    def stored(self) -> Iterator[Fact]:
        """Every stored fact of a named class or property."""
        program = self._engine.program
        for table in (program.classes, program.objects, program.datas):
            for predicate in table.values():
                yield from predicate.facts()

    def derived(self) -> Iterator[Axiom]:
        """Every fact that holds and is not asserted, equality of individuals included."""
        engine = self._engine
        classes = engine.equality.members
        if not classes:
            asserted = engine.asserted
            for fact in self.stored():
                if fact not in asserted:
                    yield from self.public(fact, classes)
            return
        for fact in self.stored():
            if fact[0].kind == 'data':
                yield from self._derived_values(fact)
                continue
            for axiom in self.public(fact, classes):
                if not engine.states(axiom):
                    yield axiom
        for members in classes.values():
            same = SameIndividual(frozenset(members))
            if not engine.states(same):
                yield same

    def _derived_values(self, fact: Fact) -> Iterator[Axiom]:
        """Assertions of a value for the names under which no assertion gives it."""
        engine = self._engine
        predicate, representative, value = fact
        for subject in engine.equality.same(representative):
            for axiom in engine.about(subject):
                if (
                    isinstance(axiom, DataPropertyAssertion)
                    and axiom.prop == predicate.expression
                    and axiom.subject == subject
                    and engine.value(axiom.literal) == value
                ):
                    break
            else:
                yield DataPropertyAssertion(predicate.expression, subject, self.literal(value))
