"""Backward search: from a fact to the assertions it follows from.

A proof is a finite tree whose leaves are asserted, so a fact with a proof holds whatever else is
being taken away. The search deepens step by step, so the first proof found is a shallowest one.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from owl_reasoner.reasoner.clauses import Fact, Premises


@dataclass(frozen=True)
class Proof:
    """A fact and the proofs of its premises; `origin` is the axiom or rule applied, None for an
    assertion.
    """

    fact: Fact
    origin: object = None
    premises: tuple[Proof, ...] = ()
    asserted: bool = False


class ProofSearch:
    """Searches proofs while the assertions stay as they are; `reset` when they change.

    Args:
        asserted: The asserted facts.
    """

    def __init__(self, asserted: Container[Fact]) -> None:
        self._asserted = asserted
        # By which step each fact was proved, and to which depth others were searched in vain.
        self._proved: dict[Fact, tuple[object, Premises]] = {}
        self._failed: dict[Fact, int] = {}
        self._budget = 0

    def reset(self) -> None:
        """Forget what was found: the assertions (or who is the same as whom) changed."""
        self._proved.clear()
        self._failed.clear()

    def proves(self, fact: Fact, depth: int = 4, budget: int = 48) -> bool:
        """Tell whether a proof of at most this depth was found within `budget` rule
        applications.
        """
        self._budget = budget
        return self._prove(fact, depth)

    def find(self, fact: Fact, deepest: int = 64, budget: int = 100_000) -> Proof | None:
        """Return a shallowest proof; None where there is none within the bounds."""
        self.reset()
        self._budget = budget
        for depth in range(deepest + 1):
            if self._prove(fact, depth):
                return self._proof(fact, {})
            if self._budget <= 0:
                return None
        return None

    def _prove(self, fact: Fact, depth: int) -> bool:
        if fact in self._asserted or fact in self._proved:
            return True
        # Iterative deepening (Korf, "Depth-first iterative-deepening", 1985): cyclic derivations
        # need no marks of what is being searched, as each step leaves one less to go.
        if depth <= 0 or self._failed.get(fact, -1) >= depth:
            return False
        arguments = fact[1:]
        for support, origin in fact[0].supports:
            for premises in support(*arguments):
                self._budget -= 1
                for premise in premises:
                    if not self._prove(premise, depth - 1):
                        break
                else:
                    self._proved[fact] = origin, premises
                    return True
                if self._budget <= 0:
                    return False
        # A failure holds for no greater depth. One for want of budget is not kept: it says nothing.
        self._failed[fact] = depth
        return False

    def _proof(self, fact: Fact, made: dict[Fact, Proof]) -> Proof:
        if fact in self._asserted:
            return Proof(fact, asserted=True)
        if fact not in made:
            origin, premises = self._proved[fact]
            parts = tuple(self._proof(premise, made) for premise in premises)
            made[fact] = Proof(fact, origin, parts)
        return made[fact]
