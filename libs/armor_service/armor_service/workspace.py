"""What directives act on: the loaded references, where they are kept, and what is allowed.

The directives see this alone. `armor_service.service` chooses the directive and holds the locks.
"""

from __future__ import annotations

import contextlib
import itertools
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from armor_service.access import SafePaths, Settings
from armor_service.changes import Change
from armor_service.directive_log import DirectiveLog
from armor_service.protocol import DirectiveError, ExitCode, StoreError
from armor_service.reference import Limits, Reference
from armor_service.registry import Registry
from armor_service.rendering import one_line
from armor_service.sparql import SparqlEngine
from armor_service.store.store import Store
from owl_reasoner import gc_control
from owl_reasoner.notifier import Changes

Watcher: TypeAlias = Callable[[str, Changes | None], None]
"""Told of a reference's name and what changed in it; None: it was loaded or dropped."""


class Workspace:
    """The loaded references with their files, store and watchers.

    Args:
        settings: What is allowed.
        screen: Writes a line of LOG SCREEN.
        warn: Told in one line of what went wrong inside and of what a client should know.
        store: Makes references durable; those it holds are there at once.

    Raises:
        StoreError: What is in the store cannot be read.

    Attributes:
        settings: What is allowed.
        paths: Which files may be read and written.
        log: The log of directives.
        sparql: Runs SPARQL queries.
        references: What is loaded.
        entering: Held while what was loaded gets its name.
        store: Makes references durable; None: they end with the process.
        states: Numbers the states that are taken to be saved.
        saved: The newest state that each file holds.
        limits: What reasoning over changes may use.
    """

    def __init__(
        self,
        settings: Settings,
        screen: Callable[[str], None],
        warn: Callable[[str], None],
        store: Store | None,
    ) -> None:
        self.settings = settings
        readable = (*self.settings.directories, *self.settings.read_only_directories)
        self.paths = SafePaths(self.settings.writable, readable)
        self.log = DirectiveLog(screen, self.settings.max_file_bytes)
        self.sparql = SparqlEngine(self.settings)
        self.references = Registry()
        self.entering = threading.Lock()
        self.store = store
        self.states = itertools.count(1)
        self.saved: dict[Path, int] = {}
        self._saving: dict[Path, threading.Lock] = {}
        self._warn = warn
        memory_limit = self.settings.reasoning_memory * 2**20
        self.limits = Limits(self.settings.reasoning_timeout, memory_limit)
        self._watchers: list[Watcher] = [self.sparql.note]
        if store:
            store.warn = self.warn
            with gc_control.uncollected():
                recovered = store.recover()
                for ref in recovered:
                    self.register(ref)
                    gc_control.settle(len(ref.kb))
            for note in store.notes:
                warn(note)
            threading.Thread(
                target=self._open_all, args=(recovered,), name='opener', daemon=True
            ).start()

    def warn(self, text: str) -> None:
        """Write a line for the operator."""
        # The line may go to a file on the disk that is full.
        with contextlib.suppress(OSError):
            self._warn(one_line(text))

    def watch(self, watcher: Watcher) -> None:
        """Tell a watcher of every change of asserted and derived facts.

        It is called inside the directive that caused the change and must be quick.
        """
        self._watchers.append(watcher)
        for name in self.references.names():
            # What was opened before him is told to nobody again.
            if (ref := self.references.get(name)) is not None and not ref.kb.consistent:
                watcher(name, Changes(0, (), (), consistent=False))

    def tell(self, name: str, changes: Changes | None) -> None:
        """Tell the watchers of a change."""
        for watcher in self._watchers:
            watcher(name, changes)

    def register(self, ref: Reference) -> None:
        """Make a reference known under its name, and its changes to the watchers."""

        def on_changes(changes: Changes) -> None:
            # Whoever still works on one that was dropped changes no other of that name.
            if not ref.dropped:
                self.tell(ref.name, changes)

        rolled_back = ref.on_rolled_back

        def on_rolled_back(lines: list[str], undo: list[Change]) -> None:
            rolled_back(lines, undo)
            for line in lines:
                self.warn(f'{ref.name}: taken back: {line}')

        ref.effort.limits, ref.on_rolled_back = self.limits, on_rolled_back
        ref.kb.subscribe(on_changes)
        self.references.add(ref)
        self.tell(ref.name, None)

    def _open_all(self, references: Sequence[Reference]) -> None:
        """Reason over what was there before this process, one reference after the other.

        Whoever asks for one does not wait for the others.
        """
        for ref in references:
            with ref.lock, gc_control.uncollected(), contextlib.suppress(StoreError):
                if not ref.dropped:
                    ref.open()
                    self.commit(ref)

    def commit(self, ref: Reference) -> None:
        """Keep what changed in a reference; call it under its lock.

        Raises:
            StoreError: The store is closed.
        """
        if self.store:
            self.store.commit(ref)

    def saving(self, path: Path) -> threading.Lock:
        """Return what is held while a state is written to a file."""
        return self._saving.setdefault(path, threading.Lock())

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
        for name in self.references.names():
            if (ref := self.references.get(name)) is not None:
                ref.cancel.set()
        if self.store:
            self.store.close()
        self.log.close()
