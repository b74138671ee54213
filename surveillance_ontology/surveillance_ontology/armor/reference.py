"""A loaded ontology under its reference name: buffers, who is mounted on it, and its lock."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from surveillance_ontology.armor.changes import Change, apply_all
from surveillance_ontology.knowledge_base import KnowledgeBase

LONG_BACKLOG = 500
"""Changes since the last reasoning from which on the next counts as slow."""
NOBODY = 'none'
"""How ARMOR says that no client is mounted; a client of this name counts as none."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where an ontology came from.

    Attributes:
        path: File or URL that was loaded; the target of SAVE without a path. Empty: none.
        format: Format of that file, in which SAVE writes.
        prefixes: Namespace prefixes of that file, which SAVE uses.
        reasoner: The Java reasoner that was asked for, empty for the native one.
    """

    path: str
    format: str
    prefixes: Mapping[str, str] = field(default_factory=dict)
    reasoner: str = ''

    @property
    def file(self) -> Path | None:
        """The file that SAVE without a path writes to, None when it came from the web."""
        return Path(self.path) if self.path and '://' not in self.path else None


@dataclass(slots=True)
class Reference:
    """One ontology that directives name.

    Whoever reads or changes it holds `lock`. Changes go in through `submit`, `flush` and `reason`.

    Attributes:
        name: Reference name.
        kb: Axioms and derived facts; ``kb.iri`` is what local names are completed with.
        origin: Where it was loaded from.
        buffered_manipulation: Changes wait in `queue` until `flush`.
        buffered_reasoner: Derived facts follow at `reason` only, not after each change.
        mounted: The client that may change it, `NOBODY` for all.
        queue: Changes that wait.
        backlog: Changes since the last reasoning, queued ones included; a measure of its cost.
        heavy: Classes or properties changed since the last reasoning; the next takes longer.
        revision: Counts what may have changed an answer, so that copies know when they are old.
        serial: Tells this reference from any other of the same name.
        dropped: The name does not stand for it any more.
    """

    name: str
    kb: KnowledgeBase
    origin: Origin
    buffered_manipulation: bool = False
    buffered_reasoner: bool = False
    mounted: str = NOBODY
    queue: list[Change] = field(default_factory=list)
    backlog: int = 0
    heavy: bool = False
    revision: int = 0
    dropped: bool = False
    serial: int = field(default_factory=itertools.count().__next__)
    lock: threading.RLock = field(default_factory=threading.RLock)

    def submit(self, changes: list[Change]) -> None:
        """Take changes in, at once or into the queue, as the reference is set up."""
        self.backlog += len(changes)
        if self.buffered_manipulation:
            self.queue += changes
        else:
            self._apply(changes)

    def flush(self) -> None:
        """Apply the queued changes."""
        if self.queue:
            queued, self.queue = self.queue, []
            self._apply(queued)

    def buffer(self, on: bool) -> None:
        """Switch buffered manipulation; switching it off applies what waits."""
        self.buffered_manipulation = on
        if not on:
            self.flush()

    def reason(self) -> bool:
        """Apply the queued changes and bring the derived facts up to date.

        Returns:
            Whether the ontology is consistent.
        """
        if self.queue:
            queued, self.queue = self.queue, []
            apply_all(self.kb, queued)
        if self.kb.stale:
            self.revision += 1
        self.backlog, self.heavy = 0, False
        return self.kb.reason()

    def restore(self, other: Reference) -> None:
        """Take over the state of another reference of the same name."""
        self.kb, self.queue, self.mounted = other.kb, other.queue, other.mounted
        self.buffered_manipulation = other.buffered_manipulation
        self.backlog = len(other.queue)
        self.revision += 1

    @property
    def is_slow(self) -> bool:
        """Whether the next reasoning may take long."""
        return self.heavy or self.backlog > LONG_BACKLOG or bool(self.origin.reasoner)

    def is_free_for(self, client: str) -> bool:
        """Tell whether a client may change the reference or mount on it."""
        return self.mounted in (NOBODY, client)

    def _apply(self, changes: list[Change]) -> None:
        apply_all(self.kb, changes)
        self.revision += 1
        if not self.buffered_reasoner:
            self.kb.reason()
            self.backlog, self.heavy = 0, False
