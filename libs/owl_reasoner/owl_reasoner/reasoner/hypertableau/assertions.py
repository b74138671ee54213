"""States assertions in a model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import expression_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.clauses import UnsupportedError
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.hypertableau.dl_clauses import ANYBODY, DLClauses
from owl_reasoner.reasoner.hypertableau.model import CaseModel
from owl_reasoner.reasoner.value_sets import ValueSet, point

Prepared: TypeAlias = tuple[Axiom, int | ValueSet]
"""An assertion, and the concept or value that it gives."""


class AssertionWriter:
    """States assertions in models of some rules.

    Making a concept adds rules, so all assertions are prepared before the search begins.

    Args:
        rules: Make the concepts.
        gaps: Gets one sentence for each class that is not covered.
    """

    def __init__(self, rules: DLClauses, gaps: dict[str, None]) -> None:
        self._rules, self._gaps = rules, gaps
        self._names: tuple[str, ...] = ()

    def prepare(self, axioms: Iterable[Axiom]) -> list[Prepared]:
        """Return the assertions among axioms, prepared, and the declarations of individuals."""
        found = [
            self.prepared(axiom)
            for axiom in axioms
            if isinstance(axiom, ax.Assertion)
            or (isinstance(axiom, ax.Declaration) and axiom.kind == 'individual')
        ]
        declared = [axiom.iri for axiom, _ in found if isinstance(axiom, ax.Declaration)]
        # Every model begins alike: with the same individuals under the same numbers.
        self._names = (*declared, *self._rules.nominal_of)
        return found

    def begin(self, model: CaseModel, axioms: Sequence[Prepared]) -> None:
        """State all assertions in a model in which nothing is stated."""
        for name in self._names:
            model.individual(name)
        if not axioms:
            model.somebody()
        for assertion in axioms:
            self.state(model, *assertion)

    def prepared(self, axiom: Axiom) -> Prepared:
        """Return an assertion, a negative one as that of a class, and what it gives."""
        if isinstance(axiom, ax.DataPropertyAssertion):
            return axiom, point(value_of(axiom.literal))
        if isinstance(axiom, ax.NegativeObjectPropertyAssertion):
            other = ex.ObjectComplementOf(ex.ObjectOneOf((axiom.object,)))
            axiom = ax.ClassAssertion(ex.ObjectAllValuesFrom(axiom.prop, other), axiom.subject)
        elif isinstance(axiom, ax.NegativeDataPropertyAssertion):
            having = ex.DataHasValue(axiom.prop, axiom.literal)
            axiom = ax.ClassAssertion(ex.ObjectComplementOf(having), axiom.subject)
        if not isinstance(axiom, ax.ClassAssertion):
            return axiom, ANYBODY
        try:
            return axiom, self._rules.positive(axiom.cls)
        except UnsupportedError as reason:
            self._gaps[f'assertions of {expression_text(axiom.cls)}: {reason}'] = None
            return axiom, ANYBODY

    def state(self, model: CaseModel, axiom: Axiom, given: int | ValueSet) -> None:
        """State an assertion, whose concept is made.

        It rests on the choices by which its individuals are the same as others.
        """
        self._rules.budget.tick()
        if isinstance(axiom, ax.ClassAssertion):
            x, choices = model.individual(axiom.individual)
            assert isinstance(given, int)
            model.concept(x, given, choices)
        elif isinstance(axiom, ax.ObjectPropertyAssertion):
            x, choices = model.individual(axiom.subject)
            y, more = model.individual(axiom.object)
            model.relate(x, self._rules.roles.number(axiom.prop), y, choices | more)
        elif isinstance(axiom, ax.DataPropertyAssertion):
            x, choices = model.individual(axiom.subject)
            assert isinstance(given, ValueSet)
            model.value(x, axiom.prop, given, choices)
        elif isinstance(axiom, ax.SameIndividual):
            first, *others = sorted(axiom.individuals)
            x, choices = model.individual(first)
            for other in others:
                y, more = model.individual(other)
                model.same(x, y, choices | more)
        elif isinstance(axiom, ax.DifferentIndividuals):
            found = [model.individual(name) for name in sorted(axiom.individuals)]
            choices = 0
            for _, more in found:
                choices |= more
            model.differ([x for x, _ in found], choices)
