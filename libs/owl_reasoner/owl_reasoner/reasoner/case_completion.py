"""What follows by cases (`hypertableau`), added where Horn clauses do not suffice.

What the engine does by itself, such as the patrol's map with its rules, is left alone.
"""

from __future__ import annotations

from collections.abc import Iterable

from owl_reasoner.owl.assertions import is_assertion
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, Import, Rule
from owl_reasoner.reasoner.consequence_based.classification import Classification
from owl_reasoner.reasoner.engine import Engine
from owl_reasoner.reasoner.horn_completeness import HornCompleteness, names_individual
from owl_reasoner.reasoner.hypertableau.entailment import MOST_STEPS, CaseReasoner, entails
from owl_reasoner.reasoner.hypertableau.incremental import (
    ChangeHistory,
    IncrementalCases,
    is_plain,
)

_MOST_ASSERTIONS = 20_000
_PAUSE = 20
"""Changes for which no models are kept, where those of the last change were of no use."""
_MOST_UNSERVING = 2
"""Models that were of no use for a second change, one after the other, before there are none."""
_LEAST_STEPS = 10_000
"""Steps that a model which is kept may take in any case."""

_GIVEN_UP = 'reasoning by cases took too many steps'
"""Why an axiom is not fully used where a search was given up."""


class CaseCompletion:
    """What reasoning by cases adds to one classification and its engine.

    Args:
        classification: Gets the subclasses that are missing.
        engine: Gets the facts that are missing.
        axioms: Everything that is asserted.

    Attributes:
        seconds: How long the last `run` reasoned by cases; 0 where it did not.
    """

    def __init__(
        self, classification: Classification, engine: Engine, axioms: Iterable[Axiom]
    ) -> None:
        self._classification, self._engine = classification, engine
        schema = [axiom for axiom in axioms if not is_assertion(axiom)]
        self._program = classification.program
        has_rules = any(isinstance(axiom, Rule) for axiom in schema)
        self._horn = HornCompleteness(engine, self._program, has_rules=has_rules)
        self._schema = schema
        self._native = tuple(self._program.unsupported)
        # Whether classes were compared, and whether that holds whatever is said of individuals.
        self._compared = self._stands = False
        # What the comparison that stands did not decide.
        self._class_gaps: dict[str, None] = {}
        self._classes_stopped = False
        # One sentence for each axiom that is not fully used; None where cases were not needed.
        self._left_out: tuple[str, ...] | None = None
        self.seconds = 0.0
        self._history = ChangeHistory()
        # Models that stay between changes, and whether the last change admits some.
        self._kept: IncrementalCases | None = None
        self._may_keep = False
        # Changes for which none are made; changes that the present models served; how many
        # models served none, one after the other.
        self._pause = self._served = self._unserving = 0
        # The steps of the last reasoning by cases that began from nothing.
        self._steps = 0
        # The pairs of classes that reasoning by cases last added.
        self._pairs: list[tuple[str, str]] = []
        engine.cases.release()

    @property
    def unsupported(self) -> tuple[str, ...]:
        """One sentence for each axiom that is not fully used."""
        found: Iterable[str] = [*self._program.unsupported, *self._horn.sentences()]
        if self._left_out is not None:
            found = self._left_out
        imports = (axiom.iri for axiom in self._schema if isinstance(axiom, Import))
        told = (f'owl:imports <{iri}> is not followed' for iri in imports)
        return tuple(dict.fromkeys([*found, *told]))

    def expect(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> None:
        """Take in a change of assertions before the engine does."""
        if self._kept is None and not self.seconds:
            return  # Most ontologies never take cases: their changes cost nothing here.
        added, removed = tuple(added), tuple(removed)
        self._history.note(removed)
        self._pause = max(0, self._pause - 1)
        self._may_keep = not self._pause and is_plain(added) and is_plain(removed)
        if self._kept is not None and (
            self._engine.equality.members or not self._kept.take(added, removed)
        ):
            self._give_up_kept()

    def _give_up_kept(self) -> None:
        self._unserving = 0 if self._served > 0 else self._unserving + 1
        if self._unserving == _MOST_UNSERVING:
            self._pause, self._unserving = _PAUSE, 0
        self._kept, self._served = None, 0
        self._engine.cases.release()

    def run(self, axioms: Iterable[Axiom]) -> None:
        """Add what follows from everything that is asserted now."""
        engine = self._engine
        self._left_out, self.seconds = None, 0.0
        if not engine.consistent or not self._horn.takes_cases():
            self._forget_classes()
            return
        assertions = [axiom for axiom in axioms if is_assertion(axiom)]
        # A search by cases looks at everybody in one model: on so many it would take minutes, and
        # is left out with a sentence that says so.
        if len(assertions) > _MOST_ASSERTIONS:
            self._forget_classes()
            self._left_out = (*self._native, 'the assertions: too many for reasoning by cases')
            return
        began = engine.budget.now()
        # Models of an earlier change first: most changes leave them models of what is asserted now,
        # and then nothing that they decide has to be searched.
        if not self._run_kept(assertions):
            reasoner = CaseReasoner([*self._schema, *assertions], budget=engine.budget)
            self._run_cases(reasoner)
            self._steps = reasoner.steps
        self.seconds = engine.budget.now() - began

    def _run_kept(self, assertions: list[Axiom]) -> bool:
        """Reason with models that stay between changes; False where there are none."""
        engine = self._engine
        if self._kept is None and self._may_keep and not engine.equality.members:
            self._may_keep = False
            self._history.forget()
            # What lasts may, without the rest, have models that are harder to find.
            most = min(MOST_STEPS, _LEAST_STEPS + 10 * self._steps)
            kept = IncrementalCases(self._schema, assertions, self._history, most, engine.budget)
            if not kept.build(self._is_known):
                self._pause = _PAUSE
            else:
                self._kept, self._served = kept, -1
                new = [fact for fact in kept.lasting if not self._is_known(fact)]
                engine.take_from_cases(new, lasting=True)
        if self._kept is None:
            return False
        if not engine.equality.members:
            self._run_cases(self._kept)
            if self._kept.is_usable:
                self._served += 1
                return True
        # Who is the same is split with every change; nothing that lasts may rest on it.
        self._give_up_kept()
        engine.update((), ())
        return False

    def cause(self) -> str:
        """Return an axiom by which cases are needed, as text; 'the ontology' where several are."""
        program = self._program
        if self._native:
            return self._native[0].rpartition(': ')[0]
        clauses = [
            clause for clause in program.clauses if clause.body and names_individual(clause.head)
        ]
        origins = [clause.origin for clause in clauses]
        origins += [most.origin for most in program.at_most]
        origins += [existential.origin for existential in program.existentials]
        origin = next((one for one in origins if one is not None), None)
        return 'the ontology' if origin is None else axiom_text(origin)

    def _run_cases(self, reasoner: CaseReasoner | IncrementalCases) -> None:
        engine = self._engine
        if not reasoner.consistent():
            engine.take_from_cases(None)
            self._forget_classes()
            return
        engine.take_from_cases(list(reasoner.facts(self._is_known)))
        if engine.consistent and (reasoner.names_individuals or not self._stands):
            known = self._classification
            # Where the individuals took all steps, classes are not compared at all.
            self._stands = not reasoner.names_individuals and not reasoner.stopped
            # Only the pairs that the consequence-based hierarchy does not have: what it has are
            # told subsumers here.
            pairs = list(reasoner.hierarchy(known.classes(), known.below_by_itself))
            if pairs != self._pairs or not self._compared:
                known.complete(pairs)
            self._pairs, self._compared = pairs, True
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
        return few and entails(axioms, fact, self._engine.budget) is True

    def _is_known(self, fact: Axiom) -> bool:
        if isinstance(fact, ClassAssertion) and not isinstance(fact.cls, str):
            return True
        return self._engine.holds(fact)

    def _report(self, gaps: Iterable[str], stopped: bool) -> None:
        """Name what is still left out, in the words of the classification where it has some."""
        found: list[str] = []
        for gap in gaps:
            subject = gap.rpartition(': ')[0] + ':'
            said = [sentence for sentence in self._native if sentence.startswith(subject)]
            found += said or [gap]
        if stopped:
            # Cases would have covered what the clauses do not.
            left = [sentence for sentence in self._native if sentence not in found]
            found += [f'{sentence.rpartition(": ")[0]}: {_GIVEN_UP}' for sentence in left]
            found.append(f'the ontology: {_GIVEN_UP}')
        found += self._program.unsupported[len(self._native) :]
        self._left_out = tuple(dict.fromkeys(found))
