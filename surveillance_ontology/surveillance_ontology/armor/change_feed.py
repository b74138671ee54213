"""Changes of facts on their way to subscribers: numbered for each reference, kept until taken.

A subscriber that sees a gap in the numbers asks the server anew. So a change that is too large for
a message (a whole ontology that was loaded) is only counted, and only the last changes are kept
while nobody listens.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from surveillance_ontology.armor.session import Session
from surveillance_ontology.knowledge_base import Changes
from surveillance_ontology.owl.axioms import Axiom

LARGE = 2000
"""Facts in one change from which on it is only counted."""
KEPT = 100
"""Changes that wait at most; older ones are dropped, which leaves a gap."""


class NumberedChange(NamedTuple):
    """What one manipulation or reasoning changed.

    Attributes:
        reference_name: Where.
        sequence: Counts from 1 for each reference; 0 says that it was loaded or dropped.
        added: Axioms that came, each with whether it is derived.
        removed: Axioms that went, likewise.
        is_consistent: As of the last reasoning.
    """

    reference_name: str
    sequence: int
    added: Sequence[tuple[Axiom, bool]]
    removed: Sequence[tuple[Axiom, bool]]
    is_consistent: bool


class ChangeFeed:
    """Collects the changes of a service's references.

    Args:
        session: What the changes are made in.
        announce: Called, in any thread, when there is something to take and was nothing before.
    """

    def __init__(self, session: Session, announce: Callable[[], None]) -> None:
        self._announce = announce
        self._lock = threading.Lock()
        self._waiting: deque[NumberedChange] = deque(maxlen=KEPT)
        self._sequences: dict[str, int] = {}
        session.watch(self._on_changes)

    def take(self) -> list[NumberedChange]:
        """Take what waits, oldest first."""
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
        return taken

    def _on_changes(self, name: str, changes: Changes | None) -> None:
        with self._lock:
            first = not self._waiting
            if changes is None:
                self._sequences[name] = 0
                self._waiting.append(NumberedChange(name, 0, (), (), False))
            else:
                large = len(changes.added) + len(changes.removed) > LARGE
                number = self._sequences.get(name, 0) + (2 if large else 1)
                self._sequences[name] = number
                added = () if large else changes.added
                removed = () if large else changes.removed
                self._waiting.append(
                    NumberedChange(name, number, added, removed, changes.consistent)
                )
        if first:
            self._announce()
