"""The open file of an owlready2 World: its tables and triggers, its transactions and its copies.

Tables and triggers of the service begin with ``armor_``. Triggers note what other programs change.
"""

from __future__ import annotations

import os
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

from armor_service.protocol import StoreError
from armor_service.store.salvage import salvage
from armor_service.store.world_ontology import Quad, WorldNames, WorldOntology
from strict_files.regular_files import sync_folder

INFERRED = 'http://inferrences/'
"""owlready2's ontology of what a reasoner found (spelled so)."""
ANONYMOUS = 'http://anonymous/'
"""owlready2's ontology for what was made without naming one."""
VERSION = 12
"""owlready2's version of the tables of a World."""
BUSY = 0.05
"""Seconds for which a batch waits for another program's transaction."""
LARGE_LOG = 8 << 20
"""Bytes of the write-ahead log from which on it is written into the file."""
_BESIDE = ('', '-wal', '-shm')
_TABLES = """
CREATE TABLE IF NOT EXISTS armor_state (key TEXT PRIMARY KEY, value TEXT);
CREATE TABLE IF NOT EXISTS armor_told
    (id INTEGER PRIMARY KEY, waits INTEGER, told TEXT, come TEXT, gone TEXT);
CREATE TABLE IF NOT EXISTS armor_declared (kind TEXT, name TEXT, PRIMARY KEY (kind, name));
CREATE TABLE IF NOT EXISTS armor_nodes (label TEXT PRIMARY KEY, node INTEGER);
CREATE TABLE IF NOT EXISTS armor_own (own INTEGER);
CREATE TABLE IF NOT EXISTS armor_changes
    (id INTEGER PRIMARY KEY, event INTEGER, c INTEGER, s INTEGER, p INTEGER, o BLOB, d BLOB);
INSERT INTO armor_own SELECT 0 WHERE NOT EXISTS (SELECT 1 FROM armor_own);
"""
_GONE, _COME, _RENAMED, _FORGOTTEN = range(4)
"""Events of `armor_changes`."""


def _triggers() -> Iterator[tuple[str, str]]:
    for table, datatype in (('objs', 'NULL'), ('datas', '{}.d')):
        for event, rows in (
            ('INSERT', (('NEW', _COME),)),
            ('DELETE', (('OLD', _GONE),)),
            ('UPDATE', (('OLD', _GONE), ('NEW', _COME))),
        ):
            notes = ' '.join(
                f'INSERT INTO armor_changes VALUES (NULL, {kind}, {row}.c, {row}.s, {row}.p, '
                f'{row}.o, {datatype.format(row)});'
                for row, kind in rows
            )
            yield f'armor_{table}_{event} AFTER {event} ON {table}', notes
    for event, kind in (('UPDATE', _RENAMED), ('DELETE', _FORGOTTEN)):
        values = f'NULL, {kind}, NULL, OLD.storid, NULL, OLD.iri, NULL'
        notes = f'INSERT INTO armor_changes VALUES ({values});'
        yield f'armor_resources_{event} AFTER {event} ON resources', notes


@dataclass(slots=True)
class ForeignRows:
    """What other programs changed.

    Attributes:
        come, gone: Quads of the asserted ontology.
        renamed: Numbers of names, each with the name that it had.
        forgotten: Numbers whose names went.
        derived: Whether something in the ontology of derived facts changed.
        others: Numbers of further ontologies in which something changed.
    """

    come: list[Quad] = field(default_factory=list)
    gone: list[Quad] = field(default_factory=list)
    renamed: list[tuple[int, str]] = field(default_factory=list)
    forgotten: list[int] = field(default_factory=list)
    derived: bool = False
    others: set[int] = field(default_factory=set)


class WorldConnection:
    """The file of a World, opened to write beside other programs.

    Args:
        path: The file.
        synced: Keep what is committed over a loss of power as well: `sync` waits for the disk.

    Attributes:
        path: The file.
        db: SQLite's connection; None: it is not open.
        names: Numbers and names of the open file.
    """

    def __init__(self, path: Path, *, synced: bool = False) -> None:
        self.path = path
        self.db: sqlite3.Connection | None = None
        self.names: WorldNames
        self._synced = synced
        self._id: tuple[int, int] = (0, 0)
        self._version = -1
        self._ontology: WorldOntology | None = None
        self._inferred: WorldOntology | None = None
        self._commits = self._commits_synced = 0
        self._sync_lock = threading.Lock()

    # --- opening ---

    def is_lost(self) -> bool:
        """Tell whether what is open is no longer what stands at the path."""
        if self.db is None:
            return False
        try:
            found = os.stat(self.path)
        except OSError:
            return True
        return (found.st_dev, found.st_ino) != self._id

    def is_empty(self) -> bool:
        """Tell whether nothing is open, and there is nothing to open."""
        return self.db is None and not (self.path.exists() and self.path.stat().st_size)

    def make(self) -> None:
        """Make an empty World.

        Raises:
            OSError: It cannot be written.
            sqlite3.Error: Likewise.
        """
        import owlready2

        self.path.parent.mkdir(parents=True, exist_ok=True)
        for ending in _BESIDE[1:]:
            self.path.with_name(self.path.name + ending).unlink(missing_ok=True)
        new = self.path.with_suffix('.new')
        new.unlink(missing_ok=True)
        connection = sqlite3.connect(new, check_same_thread=False)
        # A commit writes whole pages; owlready2's are of 32 KiB, unless the file begins with this.
        connection.execute('PRAGMA page_size = 4096')
        connection.execute('PRAGMA journal_mode = WAL')
        world = owlready2.World(filename='')
        world.set_backend(filename=':memory:', connection=connection, exclusive=False)
        # Who opens it to read alone cannot make it.
        WorldOntology(connection, ANONYMOUS, WorldNames(connection)).write_header()
        world.graph.commit()
        world.close()
        new.rename(self.path)
        if self._synced:
            sync_folder(self.path.parent)

    def open(self) -> sqlite3.Connection:
        """Return the open file, with the service's tables and triggers.

        Raises:
            StoreError: It is of another version of owlready2.
            sqlite3.Error: It cannot be used.
        """
        if self.db is not None:
            return self.db
        db = sqlite3.connect(self.path, timeout=BUSY, isolation_level=None, check_same_thread=False)
        try:
            self._set_up(db)
        except BaseException:
            db.close()
            raise
        self.db, self.names = db, WorldNames(db)
        self._ontology = self._inferred = None
        found = self.path.stat()
        self._id = found.st_dev, found.st_ino
        return db

    def _set_up(self, db: sqlite3.Connection) -> None:
        version = db.execute('SELECT version FROM store').fetchone()[0]
        if version != VERSION:
            raise StoreError(
                f'{self.path}: is a World of version {version} of owlready2, expected {VERSION}'
            )
        db.execute('PRAGMA journal_mode = WAL')
        db.execute('PRAGMA synchronous = NORMAL')
        db.execute('PRAGMA wal_autocheckpoint = 0')
        db.execute('PRAGMA cache_size = -16000')
        present = {name for (name,) in db.execute('SELECT name FROM sqlite_master')}
        wanted = dict(_triggers())
        missing = [head for head in wanted if head.split()[0] not in present]
        if missing or 'armor_own' not in present:
            db.execute('BEGIN IMMEDIATE')
            for statement in _TABLES.split(';\n'):
                db.execute(statement)
            for head in missing:
                db.execute(
                    f'CREATE TRIGGER {head} WHEN (SELECT own FROM armor_own) = 0 '
                    f'BEGIN {wanted[head]} END'
                )
            db.execute('COMMIT')

    def close(self) -> None:
        """Let go of the file; what is not committed is not in it."""
        if self.db is not None:
            self.db.close()
            self.db = None

    def wait_for_others(self, seconds: float) -> None:
        """Wait so long for another program's transaction from now on."""
        if self.db is not None:
            self.db.execute(f'PRAGMA busy_timeout = {int(seconds * 1000)}')

    # --- reading and writing ---

    def asserted(self, iri: str) -> WorldOntology:
        """Return what is asserted; in a transaction where it is new."""
        if self._ontology is None:
            self._ontology = WorldOntology(self.open(), iri, self.names)
        return self._ontology

    @contextmanager
    def transaction(self, iri: str) -> Iterator[tuple[WorldOntology, WorldOntology]]:
        """Write as the service: what is asserted and what is derived; all of it or nothing.

        Args:
            iri: The IRI of what is asserted.

        Raises:
            sqlite3.Error: It cannot be written, and nothing was.
        """
        db = self.open()
        was_there = self._ontology is not None
        db.execute('BEGIN IMMEDIATE')
        try:
            db.execute('UPDATE armor_own SET own=1')
            if self._inferred is None:
                self._inferred = WorldOntology(db, INFERRED, self.names, declare=False)
            ontology, inferred = self.asserted(iri), self._inferred
            yield ontology, inferred
            ontology.write_labels()
            db.execute('UPDATE armor_own SET own=0')
            db.execute('COMMIT')
        except BaseException:
            with suppress(sqlite3.Error):
                db.execute('ROLLBACK')
            self.names.rolled_back()
            if self._ontology is not None:
                self._ontology.rolled_back()
            # They may have been new.
            self._inferred = None
            if not was_there:
                self._ontology = None
            raise
        for part in (self.names, ontology, inferred):
            part.committed()
        self._commits += 1

    def has_foreign(self) -> bool:
        """Tell whether another program committed something since it was last looked at."""
        return self.db is not None and self._data_version(self.db) != self._version

    def _data_version(self, db: sqlite3.Connection) -> int:
        return int(db.execute('PRAGMA data_version').fetchone()[0])

    def take_foreign(self, asserted: int, inferred: int) -> ForeignRows | None:
        """Return what other programs changed since the last call, in a transaction; None: nothing.

        Args:
            asserted, inferred: The numbers of the two ontologies.
        """
        found = self.foreign(asserted, inferred)
        if found is not None:
            db = self.open()
            db.execute('DELETE FROM armor_changes')
            self._version = self._data_version(db)
        return found

    def foreign(self, asserted: int, inferred: int = 0) -> ForeignRows | None:
        """Return what `take_foreign` would, and leave it there."""
        db = self.open()
        rows = db.execute('SELECT event, c, s, p, o, d FROM armor_changes ORDER BY id').fetchall()
        if not rows:
            self._version = self._data_version(db)
            return None
        found = ForeignRows()
        net: dict[Quad, int] = {}
        for event, c, s, p, o, d in rows:
            if event == _RENAMED:
                self.names.forget(s)
                found.renamed.append((s, str(o)))
            elif event == _FORGOTTEN:
                # What went is read by the name that it had.
                self.names.remember(s, str(o))
                found.forgotten.append(s)
            elif c == asserted:
                count_step(
                    net, (s, p, o) if d is None else (s, p, o, d), 1 if event == _COME else -1
                )
            elif c == inferred:
                found.derived = True
            else:
                found.others.add(c)
        found.come = [quad for quad, step in net.items() if step > 0]
        found.gone = [quad for quad, step in net.items() if step < 0]
        return found

    def empty(self, contexts: Sequence[int]) -> None:
        """Take away what two ontologies hold and the service remembers, in a transaction."""
        db = self.open()
        for table in ('armor_told', 'armor_changes', 'armor_state'):
            db.execute(f'DELETE FROM {table}')
        for table in ('objs', 'datas'):
            db.execute(f'DELETE FROM {table} WHERE c IN (?, ?)', contexts)
        self._version = self._data_version(db)

    # --- the file as a whole ---

    def sync(self) -> None:
        """Wait until what was committed is on the disk for certain; without a lock.

        Those who wait at the same time wait for one and the same.
        """
        if not self._synced:
            return
        wanted = self._commits
        with self._sync_lock:
            if self._commits_synced >= wanted:
                return
            reached = self._commits
            with suppress(FileNotFoundError):
                descriptor = os.open(f'{self.path}-wal', os.O_RDONLY)
                try:
                    os.fdatasync(descriptor)
                finally:
                    os.close(descriptor)
            self._commits_synced = reached

    def write_log_back(self) -> None:
        """Write a long write-ahead log into the file; without a lock."""
        with suppress(OSError, sqlite3.Error):
            if os.stat(f'{self.path}-wal').st_size > LARGE_LOG:
                with closing(sqlite3.connect(self.path, timeout=0.0)) as db:
                    db.execute('PRAGMA wal_checkpoint(PASSIVE)')

    def backup(self, target: Path) -> None:
        """Write a copy of the file as it is now; without a lock.

        Raises:
            OSError: It cannot be written.
            sqlite3.Error: Likewise.
        """
        new = target.with_name(f'.{target.name}.new')
        new.unlink(missing_ok=True)
        try:
            with closing(self.reader()) as source, closing(sqlite3.connect(new)) as copy:
                source.backup(copy)
            new.rename(target)
        finally:
            new.unlink(missing_ok=True)

    def reader(self) -> sqlite3.Connection:
        """Return another connection to the file, which cannot write."""
        return sqlite3.connect(f'file:{quote(str(self.path))}?mode=ro', uri=True)

    def quarantine(self, word: str) -> Path:
        """Close the file and give it another name, with what SQLite keeps beside it.

        Args:
            word: What the name begins with.

        Returns:
            The file under its new name.
        """
        self.close()
        aside = free_name(self.path, word)
        for ending in _BESIDE:
            with suppress(FileNotFoundError):
                self.path.with_name(self.path.name + ending).rename(
                    aside.with_name(aside.name + ending)
                )
        return aside

    def salvage(self, damaged: Path) -> tuple[int, int]:
        """Make the file anew from what can be read of a damaged one.

        Returns:
            How many quads were saved, and how many tables could not be read to their end.
        """
        quads, lost = 0, 1
        self.make()
        db = self.open()
        db.execute('BEGIN IMMEDIATE')
        db.execute('UPDATE armor_own SET own=1')
        with suppress(sqlite3.DatabaseError):
            quads, lost = salvage(damaged, db)
        db.execute('UPDATE armor_own SET own=0')
        db.execute('COMMIT')
        # As any other: what was copied is not known here yet.
        self.close()
        return quads, lost

    def remove(self) -> None:
        """Remove the file and what SQLite keeps beside it."""
        self.close()
        for ending in _BESIDE:
            self.path.with_name(self.path.name + ending).unlink(missing_ok=True)


def free_name(path: Path, word: str) -> Path:
    """Return a path that nothing has, beside another one, with a word and the time before it."""
    stamp = time.strftime('%Y%m%d-%H%M%S')
    names = (f'{word}{stamp}{f"-{n}" if n > 1 else ""}-{path.name}' for n in count(1))
    return next(found for name in names if not (found := path.with_name(name)).exists())


def count_step(net: dict[Any, int], what: Any, step: int) -> None:
    """Count that something came (1) or went (-1); both in turn are nothing."""
    if net.get(what) == -step:
        del net[what]
    else:
        net[what] = step
