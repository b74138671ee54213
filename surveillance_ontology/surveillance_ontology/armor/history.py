"""What was asserted when: the present, and the last changes to go back by."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from surveillance_ontology.knowledge_base import Changes
from surveillance_ontology.owl.axioms import Axiom


@dataclass(frozen=True, slots=True)
class PastChange:
    """One change of what is asserted.

    Attributes:
        time: When, seconds since the epoch by the server's clock.
        added: Axioms that came.
        removed: Axioms that went.
    """

    time: float
    added: tuple[Axiom, ...]
    removed: tuple[Axiom, ...]


class History:
    """The changes of one ontology, as many as fit.

    Args:
        since: From when on all changes are known, seconds since the epoch.
        most: Axioms that are kept, all changes together; the oldest changes go first.

    Attributes:
        since: From when on all changes are known.
        changes: The changes, oldest first.
    """

    def __init__(self, since: float = 0.0, most: int = 20_000) -> None:
        self.since = since
        self.changes: deque[PastChange] = deque()
        self._most = most
        self._count = 0

    def note(self, time: float, changes: Changes) -> None:
        """Take in what a knowledge base tells; derived facts follow from the asserted ones."""
        added = tuple(axiom for axiom, derived in changes.added if not derived)
        removed = tuple(axiom for axiom, derived in changes.removed if not derived)
        if added or removed:
            self.append(PastChange(time, added, removed))

    def append(self, change: PastChange) -> None:
        """Take in a change, later than those that are there."""
        self.changes.append(change)
        self._count += len(change.added) + len(change.removed)
        while self._count > self._most:
            oldest = self.changes.popleft()
            self._count -= len(oldest.added) + len(oldest.removed)
            self.since = oldest.time

    def at(self, time: float, now: Iterable[Axiom]) -> list[Axiom]:
        """Return what was asserted at a time, given what is asserted now.

        Raises:
            ValueError: The time is before `since`, or no number.
        """
        if not time >= self.since:
            raise ValueError(f'{time:.3f} is before {self.since:.3f}, since when changes are kept')
        axioms = dict.fromkeys(now)
        for change in reversed(self.changes):
            if change.time <= time:
                break
            for axiom in change.added:
                axioms.pop(axiom, None)
            axioms.update(dict.fromkeys(change.removed))
        return list(axioms)
