"""The facts that match a pattern, followed through the server's numbered change messages.

A fact may be asserted and derived at once; it holds while either does.
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
        self._facts: set[ShortFact] = set()
        self._sequence: int | None = None

    @property
    def facts(self) -> frozenset[ShortFact]:
        """The facts that match, as far as is known."""
        return frozenset(self._facts)

    def follow(
        self, sequence: int, changes: Sequence[FactChange]
    ) -> list[tuple[ShortFact, bool]] | None:
        """Take in one message.

        Args:
            sequence: The message's number.
            changes: What it says.

        Returns:
            The facts of the pattern that came (True) or went (False); None when messages were
            missed or a fact is in doubt: then the server must be asked, and `replace` called.
        """
        known, self._sequence = self._sequence, sequence
        if known is None or sequence != known + 1:
            return None
        told: list[tuple[ShortFact, bool]] = []
        for fact, came, _ in changes:
            if not self.pattern.matches(fact):
                continue
            if not came:
                # It may still hold in the other way, asserted or derived.
                return None
            if fact not in self._facts:
                self._facts.add(fact)
                told.append((fact, True))
        return told

    def replace(self, facts: Iterable[ShortFact]) -> list[tuple[ShortFact, bool]]:
        """Take the facts as the server has them; returns what came and went by that."""
        found = set(facts)
        gone, come = self._facts - found, found - self._facts
        self._facts = found
        return [(fact, False) for fact in sorted(gone, key=str)] + [
            (fact, True) for fact in sorted(come, key=str)
        ]
