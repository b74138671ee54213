"""What directives act on: the references, the store, files, logs, and who is told of changes.

The service hands it to the directives; it knows neither of them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from surveillance_ontology.armor.access import SafePaths, Settings
from surveillance_ontology.armor.directive_log import DirectiveLog
from surveillance_ontology.armor.protocol import DirectiveError, ExitCode
from surveillance_ontology.armor.reference import Reference, Registry
from surveillance_ontology.armor.rendering import one_line
from surveillance_ontology.armor.sparql_engine import SparqlEngine
from surveillance_ontology.armor.sparql_graph import GraphChanges
from surveillance_ontology.armor.store import Store
from surveillance_ontology.knowledge_base import Changes

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
        loading: Held while an ontology is loaded.
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
        self.loading = threading.Lock()
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
