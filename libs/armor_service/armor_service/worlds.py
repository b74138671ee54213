"""Each loaded ontology as a World of owlready2, in a file beside the journal.

    world = owlready2.World(filename='<store>/worlds/map.sqlite3', exclusive=False, read_only=True)
    world['http://bnc/exp-rob-lab/2022-23#URGENT'].instances()

The file holds what is asserted, in the ontology with the reference's IRI, and what is derived, in
`INFERRED`, where owlready2's own reasoners put it. It follows the changes of each `PAUSE` as one
transaction, in write-ahead mode, so that readers see whole changes only and keep nobody waiting.

It is written on a thread of its own, after the journal, and made anew where it is behind: what the
service answers for must not hang on a file that others open. owlready2 begins a transaction when it
opens a file (`Graph.analyze`), which locks everybody else out until it saves, and by default it
locks the file for itself; then the changes wait here, and the file catches up. While nothing
changes, the service does not have the file open.
"""

from __future__ import annotations

import hashlib
import queue
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from armor_service.reference import Reference
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of

INFERRED = 'http://inferrences/'
"""owlready2's ontology of what a reasoner found (spelled so)."""
ENDING = '.sqlite3'
OPEN_FOR = 0.5
"""Seconds without a change after which a file is closed, so that others may lock it."""
PAUSE = 0.05
"""Seconds between a change and its writing."""
RETRY_SECONDS = 1.0
"""Seconds between two attempts to write a file that somebody has locked, or on a full disk."""
MOST_WAITING = 10_000
"""Axioms that wait for one file; beyond, it is written anew."""
IN_USE = 0.05
"""Seconds for which one reference is waited for."""
CLOSING = 1.0
"""Seconds for which `Worlds.close` waits for what is being written."""
_BUSY = ('locked', 'busy')
_FULL = ('full', 'disk I/O', 'unable to open', 'readonly')


class InUseError(Exception):
    """The reference is in use for long."""


@dataclass(frozen=True, slots=True)
class _Change:
    """What one batch changed, with what no axiom names any more."""

    changes: Changes
    gone: tuple[tuple[str, str], ...]


@dataclass(slots=True)
class _Waiting:
    """What a file lacks.

    Attributes:
        ref: The reference.
        changes: Those since the file was written.
        count: Axioms in them.
        whole: All is to be written anew.
    """

    ref: Reference
    changes: deque[_Change] = field(default_factory=deque)
    count: int = 0
    whole: bool = True


class Worlds:
    """Writes the Worlds of a service's references.

    Args:
        directory: Where the files are; made when one is written.
        warn: Told in one line when one cannot be written, and when it can be again.
    """

    def __init__(self, directory: Path, warn: Callable[[str], None]) -> None:
        self.directory = directory
        self._warn = warn
        self._lock = threading.Lock()
        self._waiting: dict[str, _Waiting] = {}
        self._due: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._queued: set[str] = set()
        self._files: dict[str, _WorldFile] = {}
        self._thread = threading.Thread(target=self._run, name='worlds', daemon=True)
        self._thread.start()

    def path(self, name: str) -> Path:
        """Return where the World of a reference is."""
        return self.directory / (file_stem(name) + ENDING)

    def follow(self, ref: Reference) -> None:
        """Write the World of a reference, now and after each change; call it under its lock."""
        with self._lock:
            waiting = self._waiting[ref.name] = _Waiting(ref)

        def on_changes(changes: Changes) -> None:
            self._note(waiting, changes)

        ref.kb.subscribe(on_changes)
        self._want(ref.name)

    def keep_only(self, names: Iterable[str]) -> None:
        """Remove the Worlds of references that are not there any more."""
        kept = {self.path(name) for name in names}
        for path in self.directory.glob(f'*{ENDING}'):
            if path not in kept and not path.name.startswith('damaged-'):
                _unlink(path)

    def drop(self, ref: Reference) -> None:
        """Remove the World of a reference."""
        with self._lock:
            waiting = self._waiting.get(ref.name)
            if waiting is None or waiting.ref is not ref:
                return
            del self._waiting[ref.name]
        self._want(ref.name)

    def flush(self, timeout: float = 60.0) -> bool:
        """Wait until all that was told is written; False when it is not in time."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            with self._lock:
                if not self._queued:
                    return True
            time.sleep(0.002)
        return False

    def close(self) -> None:
        """Write what waits, if that does not take long, and end."""
        self._due.put(None)
        self._thread.join(CLOSING)

    def _note(self, waiting: _Waiting, changes: Changes) -> None:
        kb = waiting.ref.kb
        removed = [axiom for axiom, derived in changes.removed if not derived]
        named = {entity for axiom in removed for entity in entities_of(axiom)}
        gone = tuple(entity for entity in named if not kb.is_known(*entity))
        with self._lock:
            if self._waiting.get(waiting.ref.name) is not waiting or waiting.whole:
                return
            waiting.count += len(changes.added) + len(changes.removed)
            if waiting.count > MOST_WAITING:
                waiting.whole = True
                waiting.changes.clear()
            else:
                waiting.changes.append(_Change(changes, gone))
        self._want(waiting.ref.name)

    def _want(self, name: str) -> None:
        with self._lock:
            if name in self._queued:
                return
            self._queued.add(name)
        self._due.put(name)

    def _run(self) -> None:
        while True:
            try:
                name = self._due.get(timeout=OPEN_FOR if self._files else None)
            except queue.Empty:
                self._close_files()
                continue
            if name is None:
                break
            # What changes often is written together, and the client that changes it goes first.
            time.sleep(PAUSE)
            self._see_to(name)
        self._close_files()

    def _see_to(self, name: str) -> None:
        with self._lock:
            waiting = self._waiting.get(name)
        try:
            if waiting is None:
                self._removed(name)
            else:
                self._write(name, waiting)
        except InUseError:
            self._again(name)
            return
        except (OSError, sqlite3.Error) as error:
            self._later(name, waiting, error)
            return
        with self._lock:
            more = waiting is not None and (waiting.whole or bool(waiting.changes))
            if not more:
                self._queued.discard(name)
        if more:
            self._due.put(name)

    def _later(self, name: str, waiting: _Waiting | None, error: Exception) -> None:
        """Try again later to write what could not be written."""
        if (file := self._files.get(name)) is not None:
            file.close()
            if not file.failed:
                file.failed = True
                self._warn(
                    f'{self.path(name)}: {error}: it lags behind the reference until it can be '
                    'written; no change is lost by that'
                )
        with self._lock:
            if waiting is not None:
                waiting.whole = True
                waiting.changes.clear()
                waiting.count = 0
        self._again(name)

    def _again(self, name: str) -> None:
        again = threading.Timer(RETRY_SECONDS, self._due.put, (name,))
        again.daemon = True
        again.start()

    def _write(self, name: str, waiting: _Waiting) -> None:
        file = self._files.get(name)
        if file is None:
            file = self._files[name] = _WorldFile(self.path(name), self._warn)
        ref = waiting.ref
        file.open(f'{ref.kb.iri}#')
        with self._lock:
            whole = waiting.whole or not file.is_current
            changes, waiting.changes, waiting.count = waiting.changes, deque(), 0
        if not whole and file.follow(changes):
            return
        if not ref.lock.acquire(timeout=IN_USE):
            # Somebody reasons; others are not to wait for that.
            with self._lock:
                waiting.whole = True
            raise InUseError
        try:
            asserted, derived = list(ref.kb.axioms()), list(ref.kb.derived_facts())
            with self._lock:
                # What came meanwhile is in them.
                waiting.whole = False
                waiting.changes, waiting.count = deque(), 0
        finally:
            ref.lock.release()
        file.replace(asserted, derived)

    def _removed(self, name: str) -> None:
        if (file := self._files.pop(name, None)) is not None:
            file.close()
        _unlink(self.path(name))

    def _close_files(self) -> None:
        for file in self._files.values():
            file.close()


class _WorldFile:
    """One file, open while it changes.

    Attributes:
        is_current: It held all that was told when it was written last.
        failed: The last attempt failed, and somebody was told.
    """

    def __init__(self, path: Path, warn: Callable[[str], None]) -> None:
        self.is_current = False
        self.failed = False
        self._path = path
        self._warn = warn
        self._world: Any = None
        self._writers: tuple[Any, Any] | None = None

    def open(self, iri: str) -> None:
        """Open the file, and make it where it is not there.

        Raises:
            OSError: The folder cannot be used.
            sqlite3.Error: Somebody has locked it.
        """
        if self._world is not None:
            return
        import owlready2

        from owl_reasoner.owlready.quads import OntologyWriter

        self._path.parent.mkdir(parents=True, exist_ok=True)
        self.is_current &= self._path.exists()
        try:
            self._world = self._opened(owlready2)
        except sqlite3.DatabaseError as error:
            if any(word in str(error) for word in (*_BUSY, *_FULL)):
                raise
            self._put_aside(error)
            self._world = self._opened(owlready2)
        if self._writers is None:
            self._writers = (
                OntologyWriter(self._world.get_ontology(iri)),
                OntologyWriter(self._world.get_ontology(INFERRED), declare=False),
            )
        else:
            for writer, name in zip(self._writers, (iri, INFERRED), strict=True):
                writer.reopen(self._world.get_ontology(name))

    def _opened(self, owlready2: Any) -> Any:
        world = owlready2.World(filename=str(self._path), exclusive=False, journal_mode='WAL')
        world.graph.db.execute('PRAGMA busy_timeout = 100')
        # The journal is what is on the disk for certain.
        world.graph.commit()
        world.graph.db.execute('PRAGMA synchronous = NORMAL')
        return world

    def _put_aside(self, error: Exception) -> None:
        stamp = time.strftime('%Y%m%d-%H%M%S')
        aside = self._path.with_name(f'damaged-{stamp}-{self._path.name}')
        self._path.rename(aside)
        for ending in ('-wal', '-shm'):
            self._path.with_name(self._path.name + ending).unlink(missing_ok=True)
        self.is_current = False
        self._warn(f'{self._path}: {error}; put aside in {aside.name} and written anew')

    def follow(self, changes: deque[_Change]) -> bool:
        """Write changes as one transaction; False where all has to be written anew."""
        from owl_reasoner.owlready.quads import UnknownQuadsError

        assert self._writers is not None
        try:
            for change in changes:
                for axiom, derived in change.changes.removed:
                    self._writers[derived].remove(axiom)
                for axiom, derived in change.changes.added:
                    self._writers[derived].add(axiom)
                for kind, name in change.gone:
                    self._writers[0].forget(kind, name)
        except UnknownQuadsError:
            return False
        self._commit()
        return True

    def replace(self, asserted: Sequence[Axiom], derived: Sequence[Axiom]) -> None:
        """Write all anew, as one transaction."""
        assert self._writers is not None
        for writer, axioms in zip(self._writers, (asserted, derived), strict=True):
            writer.replace_all(axioms)
        self._commit()
        self.is_current = True

    def _commit(self) -> None:
        self._world.graph.commit()
        if self.failed:
            self.failed = False
            self._warn(f'{self._path}: can be written again')

    def close(self) -> None:
        """Close the file; what is not committed is not in it."""
        if self._world is None:
            return
        with suppress(sqlite3.Error):
            self._world.graph.db.rollback()
        self._world.close()
        self._world = None


def _unlink(path: Path) -> None:
    for ending in ('', '-wal', '-shm'):
        path.with_name(path.name + ending).unlink(missing_ok=True)


def file_stem(name: str) -> str:
    """Return a reference's name as that of a file; a long one by what it is hashed to."""
    stem = quote(name, safe=' -_()+,=@')
    if len(stem) > 200 or stem.startswith(('.', ' ')):
        return hashlib.sha256(name.encode()).hexdigest()[:32]
    return stem
