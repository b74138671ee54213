"""The facts that match a pattern, followed through the server's numbered change messages.

A fact is asserted, or derived, or both; it holds until the last of the two is gone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from surveillance_ontology.armor.facts import ShortFact, parse_fact

FactChange = tuple[ShortFact, bool, bool]
"""A fact, whether it came (or went), whether it is derived (or asserted)."""


class FactSet:
    """Facts of one reference that match one pattern.

    Args:
        pattern: See `facts.parse_fact`.

    Raises:
        ValueError: The pattern cannot be read.
    """

    def __init__(self, pattern: str) -> None:
        self.pattern = parse_fact(pattern)
        self._asserted: set[ShortFact] = set()
        self._derived: set[ShortFact] = set()
        self._sequence: int | None = None

    @property
    def facts(self) -> frozenset[ShortFact]:
        """The facts that match, as far as is known."""
        return frozenset(self._asserted | self._derived)

    def follow(
        self, sequence: int, changes: Sequence[FactChange]
    ) -> list[tuple[ShortFact, bool]] | None:
        """Take in one message.

        Args:
            sequence: The message's number.
            changes: What it says.

        Returns:
            The facts of the pattern that came (True) or went (False); None when messages were
            missed: then the server must be asked, and `replace` called.
        """
        known, self._sequence = self._sequence, sequence
        if known is None or sequence != known + 1:
            return None
        matching = [change for change in changes if self.pattern.matches(change[0])]
        before = {fact for fact, _, _ in matching if self._holds(fact)}
        for fact, came, derived in matching:
            kept = self._derived if derived else self._asserted
            if came:
                kept.add(fact)
            else:
                kept.discard(fact)
        touched = dict.fromkeys(fact for fact, _, _ in matching)
        return [
            (fact, self._holds(fact)) for fact in touched if self._holds(fact) != (fact in before)
        ]

    def replace(
        self, facts: Iterable[ShortFact], asserted: Iterable[ShortFact]
    ) -> list[tuple[ShortFact, bool]]:
        """Take the facts as the server has them.

        Args:
            facts: All that match.
            asserted: Those of them that are asserted.

        Returns:
            What came (True) and went (False) by that.
        """
        before = self.facts
        self._asserted = set(asserted)
        self._derived = set(facts) - self._asserted
        gone, come = before - self.facts, self.facts - before
        return [(fact, False) for fact in sorted(gone, key=str)] + [
            (fact, True) for fact in sorted(come, key=str)
        ]

    def _holds(self, fact: ShortFact) -> bool:
        return fact in self._asserted or fact in self._derived
