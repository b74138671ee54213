"""Answers that take reasoning by cases: what holds in every model (`search`).

One model shows what may follow: a fact that it lacks does not. What holds in it without a choice
follows; the rest is asked for one by one, by looking for a model without it. Every model that is
found on the way rules out further candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import names_anonymous
from owl_reasoner.reasoner.answers import Unknown
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import StoppedError
from owl_reasoner.reasoner.hypertableau.assertions import AssertionWriter
from owl_reasoner.reasoner.hypertableau.class_comparison import ClassComparison
from owl_reasoner.reasoner.hypertableau.denials import Denial, denials
from owl_reasoner.reasoner.hypertableau.dl_clauses import DLClauses
from owl_reasoner.reasoner.hypertableau.fact_questions import FactQuestions
from owl_reasoner.reasoner.hypertableau.model_facts import ModelFacts
from owl_reasoner.reasoner.hypertableau.search import CaseSearch

MOST_STEPS = 1_000_000
"""Facts that may be added in all searches for one answer; some ten seconds."""
_QUESTION_STEPS = 200_000
"""The same for one axiom."""
_OTHER_MODELS = 4
"""Models that are asked for what they choose otherwise, before facts are asked for one by one."""


class CaseReasoner:
    """Reasons by cases over axioms that stay as they are.

    Args:
        axioms: Everything that is asserted.
        most_steps: When to give up, in facts added.
        budget: What the whole reasoning may use.

    Attributes:
        gaps: One sentence for each axiom that is not fully used, or for what was not decided.
        class_gaps: What `hierarchy` did not decide.
        stopped: Whether a search was given up.
        names_individuals: Whether the axioms about classes name individuals.
    """

    def __init__(
        self,
        axioms: Iterable[Axiom],
        most_steps: int = MOST_STEPS,
        budget: Budget | None = None,
    ) -> None:
        axioms = list(axioms)
        self._budget = budget or Budget()
        self._budget.stage = 'reasoning by cases'
        self._rules = DLClauses(axioms, self._budget)
        self.gaps = dict(self._rules.gaps)
        self.class_gaps: dict[str, None] = {}
        self.stopped = False
        self._most_steps = most_steps
        self.names_individuals = bool(self._rules.nominals)
        self._writer = AssertionWriter(self._rules, self.gaps)
        self._axioms = self._writer.prepare(axioms)
        self._search = CaseSearch(self._rules, most_steps)
        self._facts = ModelFacts(self._rules, self._search)
        self._questions = FactQuestions(
            self._search, self._facts, self._writer, self.gaps, self._budget
        )
        self._base = self._search.mark()
        self._consistent: bool | None = None
        # Whether the search has the model that `consistent` found, and the steps it took.
        self._has_model, self._cost = False, 0

    @property
    def steps(self) -> int:
        """How many facts were added so far."""
        return self._search.model.steps

    # --- questions ---

    def consistent(self) -> bool:
        """Tell whether there is a model; True where that was not found out."""
        if self._consistent is None:
            try:
                found = (
                    self._search.attempt(
                        partial(self._writer.begin, self._search.model, self._axioms)
                    )
                    and self._search.settle()
                )
            except StoppedError:
                self.stopped = self._consistent = True
                return True
            self._base = self._search.mark()
            before = self._search.model.steps
            self._consistent = self._has_model = found and self._is_possible()
            self._cost = self._search.model.steps - before
        return self._consistent

    def _is_possible(self) -> bool:
        found = self._questions.is_possible()
        self.stopped |= self._questions.stopped
        return found

    # --- everything that follows about individuals ---

    def facts(self, known: Callable[[Axiom], bool]) -> Iterator[Axiom]:
        """Return every fact about named individuals that follows and is not known."""
        search = self._search
        if not self.consistent():
            return
        if not self._has_model and not self._is_possible():
            return
        self._has_model = False
        if self.stopped:
            return
        candidates: dict[Axiom, None] = {}
        for fact, choices in self._facts.all():
            if known(fact):
                continue
            if choices:
                candidates[fact] = None
            else:
                yield fact
        candidates = self._held_by_others(candidates, 1000 + 3 * self._cost)
        search.undo(self._base)
        yield from self._questions.following(candidates)
        self._base = search.mark()
        self.stopped |= self._questions.stopped

    def _held_by_others(self, candidates: dict[Axiom, None], most: int) -> dict[Axiom, None]:
        """Return those facts of the present model that models with other choices have as well.

        One such model often decides all that each fact would take a model for. It may be hard to
        find: then it is not looked for any longer.

        Args:
            candidates: Facts of the model.
            most: Steps for one model.
        """
        search = self._search
        try:
            for _ in range(_OTHER_MODELS):
                if not candidates:
                    break
                search.differ_from_model()
                search.undo(self._base)
                with search.model.at_most(most):
                    if not search.solve():
                        break
                self.gaps.update(search.gaps)
                held = {other for other, _ in self._facts.all()}
                left = {other: None for other in candidates if other in held}
                is_of_use = len(left) < len(candidates)
                candidates = left
                if not is_of_use:
                    break
        except StoppedError:
            pass
        search.forget_models()
        return candidates

    # --- the class hierarchy ---

    def hierarchy(
        self, classes: Iterable[str], known: Callable[[str, str], bool]
    ) -> Iterator[tuple[str, str]]:
        """Yield the pairs of named classes, one below the other, that follow and are not known.

        A class that can have no members is below owl:Nothing.
        """
        if not self.consistent() or self.stopped:
            return
        search, base = self._search, self._base
        if not self.names_individuals:
            # Whoever there is changes nothing: classes are compared without individuals.
            search = CaseSearch(self._rules, self._most_steps - search.model.steps)
            base = search.mark()
        self.class_gaps = search.gaps
        comparison = ClassComparison(
            self._rules, search, partial(search.undo, base), keeps=not self.names_individuals
        )
        yield from comparison.pairs(classes, known)
        self._has_model = False
        self.stopped |= comparison.stopped


def entails(
    axioms: Iterable[Axiom], goal: Axiom | None, budget: Budget | None = None
) -> bool | Unknown:
    """Tell whether an axiom (None: a contradiction) follows: its denial contradicts the others.

    Returns:
        Unknown where some axioms are not covered, or the search was given up, and no contradiction
        was found; and of individuals without a name, who are somebody, but nobody knows who.

    Raises:
        UnsupportedError: The goal is a key, a rule, a datatype definition, or compares data
            properties.
    """
    if goal is not None and names_anonymous(goal):
        return Unknown((f'{axiom_text(goal)}: whether somebody without a name is such',))
    axioms = list(axioms)
    against: list[Denial] = [()] if goal is None else list(denials(goal))
    because: dict[str, None] = {}
    for denial in against:
        reasoner = CaseReasoner([*axioms, *denial], _QUESTION_STEPS, budget)
        if reasoner.consistent():
            if not reasoner.gaps and not reasoner.stopped:
                return False
            because.update(reasoner.gaps)
            if reasoner.stopped:
                because['reasoning by cases took too many steps'] = None
    return Unknown((*because,)) if because else True
