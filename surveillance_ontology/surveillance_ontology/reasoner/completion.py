"""Adds to an engine what its Horn clauses cannot derive, by reasoning by cases (`cases`).

It leaves alone what the engine does by itself, such as the patrol's map with its rules.
"""

from __future__ import annotations

from collections.abc import Iterable

from surveillance_ontology.owl.assertions import is_assertion
from surveillance_ontology.owl.axioms import Axiom, ClassAssertion, Rule
from surveillance_ontology.reasoner.cases import CaseReasoner, entails
from surveillance_ontology.reasoner.classification import Classification
from surveillance_ontology.reasoner.clauses import (
    BodyAtom,
    Clause,
    Constant,
    Predicate,
    PredicateAtom,
    Program,
    closure,
)
from surveillance_ontology.reasoner.engine import Engine
from surveillance_ontology.reasoner.normal_form import is_positive
from surveillance_ontology.reasoner.open_cases import values_may_split
from surveillance_ontology.reasoner.property_chains import chains_take_cases

_MOST_ASSERTIONS = 20_000


class Completion:
    """What reasoning by cases adds to one classification and its engine.

    Args:
        classification: Gets the subclasses that are missing.
        engine: Gets the facts that are missing.
        axioms: Everything that is asserted.

    Attributes:
        unsupported: One sentence for each axiom that is not fully used; None where reasoning by
            cases was not needed.
    """

    def __init__(
        self, classification: Classification, engine: Engine, axioms: Iterable[Axiom]
    ) -> None:
        self._classification, self._engine = classification, engine
        schema = [axiom for axiom in axioms if not is_assertion(axiom)]
        self._has_rules = any(isinstance(axiom, Rule) for axiom in schema)
        self._program = classification.program
        self._wanted = self._may_lack(self._program)
        self._schema = schema
        self._native = tuple(self._program.unsupported)
        # Whether classes were compared, and whether that holds whatever is said of individuals.
        self._compared = self._stands = False
        # What the comparison that stands did not decide.
        self._class_gaps: dict[str, None] = {}
        self._classes_stopped = False
        self.unsupported: tuple[str, ...] | None = None

    def run(self, axioms: Iterable[Axiom]) -> None:
        """Add what follows from everything that is asserted now."""
        engine = self._engine
        self.unsupported = None
        if not engine.consistent or not self._is_wanted():
            self._forget_classes()
            return
        assertions = [axiom for axiom in axioms if is_assertion(axiom)]
        if len(assertions) > _MOST_ASSERTIONS:
            self._forget_classes()
            self.unsupported = (*self._native, 'the assertions: too many for reasoning by cases')
            return
        reasoner = CaseReasoner([*self._schema, *assertions])
        if not reasoner.consistent():
            engine.take_from_cases(None)
            self._forget_classes()
            return
        engine.take_from_cases(list(reasoner.facts(self._is_known)))
        if engine.consistent and (reasoner.names_individuals or not self._stands):
            known = self._classification
            # Where the individuals took all steps, classes are not compared at all.
            self._stands = not reasoner.names_individuals and not reasoner.stopped
            found = reasoner.hierarchy(known.classes(), known.below_by_itself)
            known.complete(list(found))
            self._compared = True
            self._class_gaps, self._classes_stopped = reasoner.class_gaps, reasoner.stopped
        self._report(
            {**reasoner.gaps, **self._class_gaps}, reasoner.stopped or self._classes_stopped
        )

    def _forget_classes(self) -> None:
        if self._compared:
            self._compared = self._stands = self._classes_stopped = False
            self._class_gaps = {}
            self._classification.complete(())

    def entails(self, axioms: Iterable[Axiom], fact: Axiom) -> bool:
        """Tell whether a fact that was not derived follows all the same."""
        axioms = list(axioms)
        few = len(axioms) - len(self._schema) <= _MOST_ASSERTIONS
        return few and bool(entails(axioms, fact))

    def _may_lack(self, program: Program) -> bool:
        """Tell whether the clauses may leave something out without saying so.

        They do not where nothing unnamed must exist and no class requires something of a certain
        individual that matters, nor where each class that requires somebody says all by itself, no
        chain takes cases, and nothing is counted or excluded. Nor where there
        are rules, and no value that must exist is one of several that matter.
        """
        if program.unsupported or program.interacting:
            return True
        clauses = [clause for clause in program.clauses if not clause.named_only]
        named = [clause.head for clause in clauses if clause.body and _names(clause.head)]
        if named and not _change_nothing(named, program, clauses):
            return True  # Whether the class can have members depends on the individual.
        if not program.existentials:
            return False
        if any(_names(atom) for clause in clauses for atom in clause.body):
            return True
        if chains_take_cases(program):
            return True
        if self._has_rules:
            return values_may_split(program)
        values = any(existential.prop.kind == 'data' for existential in program.existentials)
        # The states of chains stand among the labels as tuples.
        classes = (label for label in program.labels if not isinstance(label, tuple))
        return values or bool(program.at_most) or not all(map(is_positive, classes))

    def _is_wanted(self) -> bool:
        """Tell whether the clauses may leave something out as things stand.

        Where there are rules, that may take too long where it is but open who is the same.
        """
        if self._wanted or self._engine.unknowns_matter():
            return True
        return not self._has_rules and next(self._engine.open_cases(), None) is not None

    def _is_known(self, fact: Axiom) -> bool:
        if isinstance(fact, ClassAssertion) and not isinstance(fact.cls, str):
            return True
        return self._engine.holds(fact)

    def _report(self, gaps: Iterable[str], stopped: bool) -> None:
        """Name what is still left out, in the words of the classification where it has some."""
        found = list(self._native) if stopped else []
        for gap in gaps:
            subject = gap.rpartition(': ')[0] + ':'
            said = [sentence for sentence in self._native if sentence.startswith(subject)]
            found += said or [gap]
        if stopped:
            found.append('the ontology: reasoning by cases took too many steps')
        found += self._program.unsupported[len(self._native) :]
        self.unsupported = tuple(dict.fromkeys(found))


def _change_nothing(heads: Iterable[BodyAtom], program: Program, clauses: list[Clause]) -> bool:
    """Tell whether nothing follows from these heads but that one is related: no clause, count or
    key asks for the properties.
    """
    start: dict[Predicate, None] = {}
    for head in heads:
        if not isinstance(head, PredicateAtom) or head.predicate.kind != 'object':
            return False
        start[head.predicate] = None
    above: dict[Predicate, list[Predicate]] = {}
    asked = {least.prop for least in program.at_least}
    asked.update(most.prop for most in program.at_most)
    asked.update(prop for key in program.keys for prop, _ in key.props)
    for clause in clauses:
        asking = [atom.predicate for atom in clause.body if isinstance(atom, PredicateAtom)]
        sup = clause.head.predicate if isinstance(clause.head, PredicateAtom) else None
        alone = len(clause.body) == len(asking) == 1 and asking[0].kind == 'object'
        if alone and sup is not None and sup.kind == 'object':
            above.setdefault(asking[0], []).append(sup)
        else:
            asked.update(asking)
    return asked.isdisjoint(
        prop for one in start for prop in closure(one, lambda sub: above.get(sub, ()))
    )


def _names(atom: BodyAtom) -> bool:
    """Tell whether an atom is about a certain individual."""
    return any(isinstance(term, Constant) and not term.is_value for term in atom.terms)
