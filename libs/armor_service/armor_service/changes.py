"""Changes of an ontology: what is to change, and who is told of it.

A change that a directive asks for is a value: it waits in a buffer, is applied, and goes into the
journal. What it changed is told by the knowledge base; `ChangeFeed` keeps that until it is sent to
subscribers.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from armor_service.facts import FactChange
from armor_service.rendering import render_entity, short_facts
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Axiom,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
)

LARGE = 2000
"""Facts in one change from which on it is only counted."""
KEPT = 100
"""Changes that wait for subscribers at most; older ones are dropped, which leaves a gap."""


@dataclass(frozen=True, slots=True)
class AddAxiom:
    """Assert an axiom; nothing happens when it is asserted already."""

    axiom: Axiom


@dataclass(frozen=True, slots=True)
class RemoveAxiom:
    """Retract an axiom; nothing happens when it is not asserted."""

    axiom: Axiom


@dataclass(frozen=True, slots=True)
class SetAssertion:
    """Assert a value as the only one that the individual has for the property."""

    axiom: ObjectPropertyAssertion | DataPropertyAssertion

    def others(self, kb: KnowledgeBase) -> list[Axiom]:
        """Return the assertions of other values."""
        axiom = self.axiom
        found = kb.axioms_about(axiom.subject)
        return [
            other
            for other in found
            if type(other) is type(axiom)
            and (other.prop, other.subject) == (axiom.prop, axiom.subject)
            and other != axiom
        ]


@dataclass(frozen=True, slots=True)
class RenameEntity:
    """Give an entity another IRI everywhere; merges with an entity that has it already."""

    kind: str
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class RemoveEntity:
    """Retract whatever is asserted of an entity."""

    kind: str
    iri: str


Change = AddAxiom | RemoveAxiom | SetAssertion | RenameEntity | RemoveEntity


def change_text(change: Change) -> str:
    """Return a change as people write it."""
    if isinstance(change, RenameEntity):
        return f'rename {render_entity(change.old)} to {render_entity(change.new)}'
    if isinstance(change, RemoveEntity):
        return f'remove {render_entity(change.iri)}'
    word = {AddAxiom: 'add', RemoveAxiom: 'remove', SetAssertion: 'set'}[type(change)]
    return f'{word} {axiom_text(change.axiom)}'


def apply_all(kb: KnowledgeBase, changes: Iterable[Change]) -> None:
    """Carry out changes in order; retractions and the assertions behind them are one batch."""
    removed: list[Axiom] = []
    added: list[Axiom] = []
    for change in changes:
        if isinstance(change, AddAxiom):
            added.append(change.axiom)
            continue
        if added or not isinstance(change, RemoveAxiom):
            kb.change(added, removed)
            added, removed = [], []
        if isinstance(change, RemoveAxiom):
            removed.append(change.axiom)
        elif isinstance(change, SetAssertion):
            added, removed = [change.axiom], change.others(kb)
        elif isinstance(change, RenameEntity):
            kb.rename(change.kind, change.old, change.new)
        else:
            kb.remove_entity(change.kind, change.iri)
    kb.change(added, removed)


class NumberedChange(NamedTuple):
    """What one manipulation or reasoning changed.

    Attributes:
        reference_name: Where.
        sequence: Counts up over all references; 0 says that this one was loaded or dropped.
        added: Axioms that came, each with whether it is derived.
        removed: Axioms that went, likewise.
        is_consistent: As of the last reasoning.
    """

    reference_name: str
    sequence: int
    added: Sequence[tuple[Axiom, bool]]
    removed: Sequence[tuple[Axiom, bool]]
    is_consistent: bool

    def facts(self) -> list[FactChange]:
        """Return the facts that went and came; other axioms are left out."""
        return [
            (fact, came, derived)
            for came, batch in ((False, self.removed), (True, self.added))
            for axiom, derived in batch
            for fact in short_facts(axiom)
        ]


class ChangeFeed:
    """Changes of facts on their way to subscribers: numbered, kept until taken.

    A subscriber that sees a gap in the numbers asks the server anew. They are those of all
    references: what is missed of one is noticed with the next of any. So a change that is too large
    for a message (a whole ontology that was loaded) is only counted, and only the last changes are
    kept while nobody listens.

    Args:
        announce: Called, in any thread, when there is something to take and was nothing before.
    """

    def __init__(self, announce: Callable[[], None]) -> None:
        self._announce = announce
        self._lock = threading.Lock()
        self._waiting: deque[NumberedChange] = deque(maxlen=KEPT)
        self._sequence = 0

    def take(self) -> list[NumberedChange]:
        """Take what waits, oldest first."""
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
        return taken

    def note(self, name: str, changes: Changes | None) -> None:
        """Take in a change of a reference; None: it was loaded or dropped."""
        with self._lock:
            first = not self._waiting
            self._sequence += 1
            if changes is None:
                # It counts on: who misses this message sees a gap before the next one.
                self._waiting.append(NumberedChange(name, 0, (), (), False))
            else:
                large = len(changes.added) + len(changes.removed) > LARGE
                self._sequence += large
                added = () if large else changes.added
                removed = () if large else changes.removed
                self._waiting.append(
                    NumberedChange(name, self._sequence, added, removed, changes.consistent)
                )
        if first:
            self._announce()
