"""Asks for facts one by one: a fact follows where no model lacks it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import StoppedError
from owl_reasoner.reasoner.hypertableau.assertions import AssertionWriter, Prepared
from owl_reasoner.reasoner.hypertableau.denials import denials
from owl_reasoner.reasoner.hypertableau.model_facts import ModelFacts
from owl_reasoner.reasoner.hypertableau.search import CaseSearch


class FactQuestions:
    """Asks a search for models.

    Args:
        search: Has everything that is asserted.
        facts: Reads its models.
        writer: States the denials.
        gaps: Gets what was not decided.
        budget: Is told what is asked for.

    Attributes:
        stopped: Whether a search was given up.
    """

    def __init__(
        self,
        search: CaseSearch,
        facts: ModelFacts,
        writer: AssertionWriter,
        gaps: dict[str, None],
        budget: Budget,
    ) -> None:
        self._search, self._facts, self._writer = search, facts, writer
        self._gaps, self._budget = gaps, budget
        self.stopped = False

    def is_possible(self, denial: Prepared | None = None) -> bool:
        """Tell whether an assertion holds in some model, which is left in the tables."""
        search = self._search
        try:
            if denial is not None:
                state = partial(self._writer.state, search.model, *denial)
                if not search.attempt(state):
                    return False
            found = search.solve()
        except StoppedError:
            self.stopped = True
            return True
        self._gaps.update(search.gaps)
        return found

    def following(self, candidates: dict[Axiom, None]) -> Iterator[Axiom]:
        """Yield those facts that follow; they are stated, so that later searches begin with them.

        The search is left where everything is asserted and nothing was chosen, as it must be found.
        """
        search = self._search
        base = search.mark()
        while candidates and not self.stopped:
            fact = next(iter(candidates))
            del candidates[fact]
            self._budget.at_work = partial(axiom_text, fact)
            ((denial,),) = denials(fact)
            if self.is_possible(self._writer.prepared(denial)):
                # Whatever this model lacks does not follow either.
                held = {other for other, _ in self._facts.all()}
                candidates = {other: None for other in candidates if other in held}
                search.undo(base)
            else:
                yield fact
                search.undo(base)
                self._keep(fact)
                base = search.mark()

    def _keep(self, fact: Axiom) -> None:
        stated = partial(self._writer.state, self._search.model, *self._writer.prepared(fact))
        try:
            self._search.attempt(stated)
            self._search.settle()
        except StoppedError:
            self.stopped = True
