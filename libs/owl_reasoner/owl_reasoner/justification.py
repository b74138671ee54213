"""Why something follows: the fewest axioms to which it is owed, and the steps from them.

The engine's proof says how a fact was derived, but not that no axiom of it could be left out; and
what cases or unnamed individuals prove has no steps at all. So the axioms are found first, by
asking what follows without some of them (justifications; Horridge, Parsia and Sattler, "Laconic and
precise justifications in OWL", ISWC 2008), among those that can matter (`locality`). The steps are
then those of an ontology of these alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

from owl_reasoner.derivation import Derivation
from owl_reasoner.owl.assertions import Assertions
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Annotation,
    Axiom,
    Declaration,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of, names_anonymous
from owl_reasoner.owl.locality import locality_module
from owl_reasoner.reasoner.answers import Unknown
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.engine import BY_CASES
from owl_reasoner.reasoner.explanation import Explanation, Reasons
from owl_reasoner.reasoner.hypertableau.entailment import entails


def justify(
    axioms: Iterable[Axiom],
    goal: Axiom | None,
    likely: Iterable[Axiom],
    schema: Iterable[Axiom],
    assumed: tuple[Axiom, ...] = (),
    until: float = math.inf,
    budget: Budget | None = None,
) -> tuple[Axiom, ...]:
    """Return a smallest set of axioms from which a goal follows (Junker, "QuickXplain", AAAI 2004).

    Args:
        axioms: Where to look.
        goal: A fact; None for a contradiction.
        likely: Axioms that a proof uses; with the schema they are tried first.
        schema: The axioms that are not about individuals.
        assumed: Axioms that are there in any case.
        until: Time by the budget's clock after which axioms that are not needed may be left in.
        budget: What all reasoning for it may use.

    Raises:
        ReasoningBudgetError: A limit of the budget was passed.
    """
    fixed, budget = list(assumed), budget or Budget()

    def enough(chosen: Iterable[Axiom]) -> bool:
        return follows((*fixed, *chosen), goal, budget)

    declared = [axiom for axiom in schema if isinstance(axiom, Declaration)]
    used = list(dict.fromkeys(axiom for axiom in likely if axiom not in fixed))
    fixed += declared
    choices = (used, list(dict.fromkeys([*used, *schema])), list(dict.fromkeys(axioms)))
    for choice in choices:
        candidates = [a for a in choice if not isinstance(a, Declaration | Annotation)]
        if goal is not None and choice is not used:
            candidates = locality_module(candidates, (goal, *assumed))
        if enough(candidates):
            fixed = list(assumed)
            if not enough(candidates):
                candidates = [*declared, *candidates]
            return tuple(_fewest(candidates, enough, lambda: budget.now() > until))
    return ()


def follows(axioms: Iterable[Axiom], goal: Axiom | None, budget: Budget | None = None) -> bool:
    """Tell whether a fact, or with None a contradiction, follows from axioms.

    Raises:
        ReasoningBudgetError: A limit of the budget was passed.
    """
    axioms = list(axioms)
    # An anonymous individual stands for somebody in OWL's entailment, and the goal is about the one
    # that the axioms have: what is derived of him.
    if goal is None or not names_anonymous(goal):
        found = entails(axioms, goal, budget)
        if not isinstance(found, Unknown):
            return found
    # What follows for everything follows for an individual that no axiom names.
    asked = () if goal is None else entities_of(goal)
    derived = _derived_from(
        [*axioms, *(Declaration(kind, name) for kind, name in asked)], budget or Budget()
    )._derived
    consistent = derived.consistent
    return not consistent if goal is None else consistent and derived.holds(goal)


def _derived_from(axioms: Iterable[Axiom], budget: Budget) -> Justifications:
    """Return the justifications of an ontology that holds some axioms alone."""
    told = Assertions()
    for axiom in axioms:
        told.insert(axiom)
    derived = Derivation(told, budget)
    derived.bring_up_to_date()
    return Justifications(told, derived)


def _fewest(
    candidates: list[Axiom],
    follows: Callable[[Iterable[Axiom]], bool],
    is_late: Callable[[], bool],
) -> list[Axiom]:
    """Return the candidates without those that are not needed, as far as the time allows."""

    def narrow(known: list[Axiom], changed: bool, rest: list[Axiom]) -> list[Axiom]:
        if changed and follows(known):
            return []
        if len(rest) == 1 or is_late():
            return rest
        middle = len(rest) // 2
        first, second = rest[:middle], rest[middle:]
        later = narrow([*known, *first], bool(first), second)
        earlier = narrow([*known, *later], bool(later), first)
        return [*earlier, *later]

    return narrow([], True, candidates) if candidates else []


class Justifications:
    """Explains what was derived from the assertions of an ontology.

    Args:
        told: The assertions.
        derived: What follows from them.
    """

    def __init__(self, told: Assertions, derived: Derivation) -> None:
        self._told, self._derived = told, derived

    def explained(self, goal: Axiom | None, until: float) -> Explanation:
        """Return an explanation that rests on no more axioms than it needs, and on all of them.

        Args:
            goal: A fact; None for a contradiction.
            until: Time by the budget's clock after which axioms that are not needed may be left in.
        """
        text = 'the ontology is inconsistent' if goal is None else axiom_text(goal)
        proof = self._proof(goal, self._schema_axioms)
        needed, fewest = self._justified(goal, proof, until)
        if proof is not None and not set(proof.sources()) <= set(needed):
            # The engine's own proof takes a longer way: over the needed axioms alone it cannot.
            alone = _derived_from(needed, self._derived.budget)
            proof = alone._proof(goal, alone._schema_axioms)
        if proof is None or proof.because == BY_CASES:
            return self._listed(text, needed, fewest)
        sources = proof.sources()
        return replace(proof, background=tuple(a for a in needed if a not in sources))

    def fewest(self, goal: Axiom | None, until: float) -> tuple[Axiom, ...]:
        """Return the axioms to which a fact is owed; goal and time are those of `explained`."""
        return self._justified(goal, self._proof(goal, lambda *_: ()), until)[0]

    def _proof(
        self, goal: Axiom | None, schema_axioms: Callable[..., tuple[Axiom, ...]]
    ) -> Explanation | None:
        """Return the steps by which the engine derived a fact; with None a contradiction."""
        assert self._derived.engine is not None
        if isinstance(goal, SubClassOf):
            return None
        reasons = Reasons(self._derived.engine, schema_axioms)
        return reasons.of_inconsistency() if goal is None else reasons.of_fact(goal)

    def _justified(
        self, goal: Axiom | None, proof: Explanation | None, until: float
    ) -> tuple[tuple[Axiom, ...], bool]:
        """Return the axioms to which a fact is owed, and whether they are the fewest."""
        told, budget = self._told, self._derived.budget
        likely = proof.sources() if proof else ()
        needed = justify(told.axioms, goal, likely, told.schema, (), until, budget)
        return needed, budget.now() <= until

    def _schema_axioms(self, assumed: tuple[Axiom, ...], goal: Axiom | None) -> tuple[Axiom, ...]:
        """Return the axioms about classes and properties by which assumptions imply something."""
        schema = self._told.schema
        found = justify([*schema, *assumed], goal, (), schema, assumed, budget=self._derived.budget)
        return tuple(axiom for axiom in found if axiom not in assumed)

    def _listed(self, text: str, axioms: tuple[Axiom, ...], fewest: bool) -> Explanation:
        because = 'these axioms together' + ('' if fewest else ', perhaps not all of them')
        parts = tuple(Explanation(axiom_text(a), 'asserted', axioms=(a,)) for a in axioms)
        return Explanation(text, 'axiom', because, parts, axioms=axioms)
