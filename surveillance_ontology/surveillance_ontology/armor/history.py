"""What was asserted when: the present, and the last changes to go back by."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

from surveillance_ontology.knowledge_base import Changes
from surveillance_ontology.owl.axioms import Axiom

AHEAD = 1.0
"""Seconds by which the clock of who asks may be ahead of the server's."""


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
        """Take in a change; what is there was before it, whatever the clock said."""
        self.tell_time(change.time)
        self.changes.append(change)
        self._count += len(change.added) + len(change.removed)
        while self._count > self._most:
            oldest = self.changes.popleft()
            self._count -= len(oldest.added) + len(oldest.removed)
            self.since = oldest.time

    def tell_time(self, now: float) -> None:
        """Take what is kept with a clock that was set back: it is as long ago as it was."""
        ahead = (self.changes[-1].time if self.changes else self.since) - now
        if ahead > 0.0:
            self.since -= ahead
            moved = [replace(change, time=change.time - ahead) for change in self.changes]
            self.changes = deque(moved)

    def at(self, time: float, present: Iterable[Axiom], now: float) -> list[Axiom]:
        """Return what was asserted at a time.

        Args:
            time: When, seconds since the epoch by the server's clock.
            present: What is asserted now.
            now: The server's clock.

        Raises:
            ValueError: The time is before `since`, lies ahead, or is no number.
        """
        self.tell_time(now)
        if time > now + AHEAD:
            raise ValueError(f'{time:.3f} lies ahead of the server, whose clock says {now:.3f}')
        if not time >= self.since:
            raise ValueError(f'{time:.3f} is before {self.since:.3f}, since when changes are kept')
        axioms = dict.fromkeys(present)
        for change in reversed(self.changes):
            if change.time <= time:
                break
            for axiom in change.added:
                axioms.pop(axiom, None)
            axioms.update(dict.fromkeys(change.removed))
        return list(axioms)
