"""What directives act on: the references, the store, files, logs, and who is told of changes.

The service hands it to the directives; it knows neither of them.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from surveillance_ontology.armor.access import SafePaths, Settings
from surveillance_ontology.armor.directive_log import DirectiveLog
from surveillance_ontology.armor.facts import FactChange
from surveillance_ontology.armor.protocol import DirectiveError, ExitCode
from surveillance_ontology.armor.reference import Reference, Registry
from surveillance_ontology.armor.rendering import one_line, short_facts
from surveillance_ontology.armor.sparql_engine import SparqlEngine
from surveillance_ontology.armor.sparql_graph import GraphChanges
from surveillance_ontology.armor.store import Store
from surveillance_ontology.knowledge_base import Changes
from surveillance_ontology.owl.axioms import Axiom

LARGE = 2000
"""Facts in one change from which on it is only counted."""
KEPT = 100
"""Changes that wait at most; older ones are dropped, which leaves a gap."""

Watcher = Callable[[str, Changes | None], None]
"""Told of a reference's name and what changed in it; None: it was loaded or dropped."""


class Session:
    """The state of one directive service.

    Args:
        settings: What is allowed.
        screen: Writes a line of LOG SCREEN.
        warn: Told in one line of what went wrong inside and of what a client should know.
        store: Makes references durable.
        clock: Seconds since the epoch.

    Attributes:
        clock: Seconds since the epoch.
        settings: What is allowed.
        paths: Which files may be read and written.
        log: The log of directives.
        sparql: Runs SPARQL queries.
        graphs: What changed in the graphs that they see.
        references: What is loaded.
        entering: Held while what was loaded gets its name.
        store: Makes references durable; None: they end with the process.
    """

    def __init__(
        self,
        settings: Settings,
        screen: Callable[[str], None],
        warn: Callable[[str], None],
        store: Store | None,
        clock: Callable[[], float],
    ) -> None:
        self.settings = settings
        self.paths = SafePaths(
            settings.writable, (*settings.directories, *settings.read_only_directories)
        )
        self.log = DirectiveLog(screen, settings.max_file_bytes)
        self.sparql = SparqlEngine()
        self.graphs = GraphChanges()
        self.references = Registry()
        self.entering = threading.Lock()
        self._saving: dict[str, threading.Lock] = {}
        self._warn = warn
        self.clock = clock
        self.store = store
        self._watchers: list[Watcher] = []

    def warn(self, text: str) -> None:
        """Write a line for the operator."""
        self._warn(one_line(text))

    def watch(self, watcher: Watcher) -> None:
        """Tell a watcher of every change of asserted and derived facts.

        It is called inside the directive that caused the change and must be quick.
        """
        self._watchers.append(watcher)

    def saving(self, path: Path) -> threading.Lock:
        """Return what is held from taking a state to its being in a file: the newest stays."""
        return self._saving.setdefault(str(path), threading.Lock())

    def register(self, ref: Reference) -> None:
        """Make a reference known under its name."""
        self.follow(ref)
        self.references.add(ref)
        self.tell(ref.name, None)

    def follow(self, ref: Reference) -> None:
        """Tell the watchers of the changes of a reference's knowledge base."""

        def on_changes(changes: Changes) -> None:
            ref.history.note(self.clock(), changes)
            self.tell(ref.name, changes)

        ref.kb.subscribe(on_changes)

    def tell(self, name: str, changes: Changes | None) -> None:
        """Tell the watchers of a change."""
        self.graphs.note(name, changes)
        for watcher in tuple(self._watchers):
            watcher(name, changes)

    def check_free(self, ref: Reference, client: str) -> None:
        """Check that no other client is mounted on a reference.

        Raises:
            DirectiveError: 102, there is one.
        """
        if self.settings.enforce_mount and not ref.is_free_for(client):
            raise DirectiveError(
                f'{client} cannot connect to {ref.name}. Another client is already mounted on it.',
                ExitCode.REFERENCE_BUSY,
            )

    def close(self) -> None:
        """End helper processes and close files."""
        self.sparql.close()
        if self.store:
            self.store.close()
        self.log.close()


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

    def facts(self) -> list[FactChange]:
        """Return the facts that went and came; other axioms are left out."""
        return [
            (fact, came, derived)
            for came, batch in ((False, self.removed), (True, self.added))
            for axiom, derived in batch
            for fact in short_facts(axiom)
        ]


class ChangeFeed:
    """Changes of facts on their way to subscribers: numbered for each reference, kept until taken.

    A subscriber that sees a gap in the numbers asks the server anew. So a change that is too large
    for a message (a whole ontology that was loaded) is only counted, and only the last changes are
    kept while nobody listens.

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
