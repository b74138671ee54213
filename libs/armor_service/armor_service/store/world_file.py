"""One reference's file: an owlready2 World, and beside its quads what the service remembers.

A batch and what is remembered of it are one transaction, in write-ahead mode: SIGKILL loses nothing
that was committed, and readers see whole batches only. Tables and triggers of the service begin
with ``armor_``. Triggers note what other programs change; that is taken in before the next batch is
written, or as soon as it is noticed.

owlready2 is in a transaction from the moment it opens a file until it saves, which keeps everybody
else from writing. What cannot be written meanwhile goes into a `Spill` and is merged later: first
what the others wrote, then each batch again, so that a value that was set is the only one.
"""

from __future__ import annotations

import json
import os
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

from armor_service.changes import AddAxiom, Change, RemoveAxiom, SetAssertion, apply_all
from armor_service.protocol import StoreError
from armor_service.quarantine import Quarantine, Told, TooHardError
from armor_service.reference import Buffering, Effort, Origin, Reference, knowledge_base
from armor_service.store.assigned_numbers import assigned_numbers
from armor_service.store.lock_holder import lock_holder
from armor_service.store.records import TO_JSON, decode, encode, told_as_json, told_of
from armor_service.store.salvage import salvage
from armor_service.store.spill import Spill
from armor_service.store.world_ontology import AxiomsRead, Quad, WorldNames, WorldOntology
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of, renamed

INFERRED = 'http://inferrences/'
"""owlready2's ontology of what a reasoner found (spelled so)."""
ANONYMOUS = 'http://anonymous/'
"""owlready2's ontology for what was made without naming one."""
ENDING = '.sqlite3'
DAMAGED, REPLACED = 'damaged-', 'replaced-'
"""How the names of files begin that were put aside."""
VERSION = 12
"""owlready2's version of the tables of a World."""
BUSY = 0.05
"""Seconds for which a batch waits for another program's transaction."""
TOLD_AFTER = 5.0
"""Seconds for which another program may hold a file until somebody is told."""
LARGE = 10_000
"""Axioms from which on derived facts of before are compared while no directive waits for it."""
LARGE_LOG = 8 << 20
"""Bytes of the write-ahead log from which on it is written into the file."""
FILE = 'file'
"""The client of what other programs wrote into a file."""
_KINDS = (
    *('class', 'object_property', 'data_property', 'annotation_property', 'individual'),
    *('datatype', 'annotated'),
)
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


class WorldFile:
    """The file of one reference; whoever calls it holds the reference's lock, unless it says so.

    Large because a transaction, the spill and what others wrote all work on one record of what the
    file lacks, which only changes together.

    Args:
        path: The file.
        warn: Told in one line when it cannot be written, when it can be again, and what others
            wrote that is no OWL.
        synced: Keep answered changes over a loss of power as well: `sync` waits for the disk.

    Attributes:
        path: The file.
        ref: The reference; there after `recover` or `follow`.
    """

    def __init__(self, path: Path, warn: Callable[[str], None], *, synced: bool = False) -> None:
        self.path = path
        self.ref: Reference
        self._warn, self._synced = warn, synced
        self._spill = Spill(path.with_suffix('.spill'), synced=synced)
        self._lock = threading.RLock()
        self._db: sqlite3.Connection | None = None
        self._id: tuple[int, int] = (0, 0)
        self._version = -1
        self._written: dict[str, str] = {}
        self._waiting_written: list[Told] = []
        # What the file lacks: axioms that came (1) and went (-1), the directives that did that, and
        # for those that nobody reasoned over yet what each of them changed.
        self._net: dict[Axiom, int] = {}
        self._derived: dict[Axiom, int] = {}
        self._told: list[Told] = []
        self._delta: dict[Axiom, int] = {}
        self._groups: list[tuple[list[Told], dict[Axiom, int]]] = []
        self._groups_written = False
        self._whole = False
        self._quiet = False
        self._derived_known = True
        # The directives that are in the spill already, and its last record.
        self._spilled = 0
        self._spilled_last: object = None
        self._record = 0
        self._origin: tuple[Origin | None, str] = (None, '')
        self._failure = ''
        self._failed_at = self._failed_since = 0.0
        self._told_failure = False
        self._others: set[int] = set()
        self._commits = self._commits_synced = 0
        self._sync_lock = threading.Lock()

    # --- the file ---

    def _opened(self) -> sqlite3.Connection:
        """Return the open file, which is opened or made where it is not there."""
        if self._db is not None:
            if self._is_in_place():
                return self._db
            self.close_file()
            self._whole = True
            self._warn(f'{self.path}: is no longer there; all that is known is written again')
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if not self.path.exists() or not self.path.stat().st_size:
            self._make()
            self._whole = True
        db = sqlite3.connect(self.path, timeout=BUSY, isolation_level=None, check_same_thread=False)
        try:
            self._set_up(db)
        except BaseException:
            db.close()
            raise
        self._db = db
        found = self.path.stat()
        self._id = found.st_dev, found.st_ino
        return db

    def _is_in_place(self) -> bool:
        try:
            found = os.stat(self.path)
        except OSError:
            return False
        return (found.st_dev, found.st_ino) == self._id

    def _make(self) -> None:
        """Make an empty World."""
        import owlready2

        for ending in ('-wal', '-shm'):
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
            _sync_directory(self.path.parent)

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
        names = 'SELECT name FROM sqlite_master'
        present = {name for (name,) in db.execute(names)}
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
        self._names = WorldNames(db)
        self._ontology: WorldOntology | None = None
        self._inferred: WorldOntology | None = None

    def _ontologies(self, iri: str) -> tuple[WorldOntology, WorldOntology]:
        """Return what is asserted and what is derived; in a transaction where they are new."""
        if self._inferred is None:
            assert self._db is not None
            self._inferred = WorldOntology(self._db, INFERRED, self._names, declare=False)
        return self._asserted(iri), self._inferred

    def _asserted(self, iri: str) -> WorldOntology:
        if self._ontology is None:
            assert self._db is not None
            self._ontology = WorldOntology(self._db, iri, self._names)
        return self._ontology

    def close_file(self) -> None:
        """Let go of the file; what is not committed is not in it."""
        if self._db is not None:
            self._db.close()
            self._db = None

    # --- what was there before ---

    def recover(self, notes: list[str]) -> Reference | None:
        """Make the reference as it was answered for; what follows is derived by its `open`.

        Args:
            notes: Gets one line for each thing that is damaged.

        Returns:
            None where the file is no reference.

        Raises:
            StoreError: Somebody has the file for himself, or it is not of this version.
        """
        try:
            return self._recovered(notes)
        except sqlite3.OperationalError as error:
            if 'locked' in str(error):
                holder = lock_holder(self.path) or 'another program'
                raise StoreError(f'{self.path}: {holder} has it for itself') from None
            if 'no such table' in str(error) and not self._is_world():
                notes.append(f'{self.path}: is left alone: is no World of owlready2')
                self.close_file()
                return None
            if 'malformed' not in str(error) and 'no such table' not in str(error):
                raise StoreError(f'{self.path}: {error}') from None
            return self._salvaged(error, notes)
        except sqlite3.DatabaseError as error:
            return self._salvaged(error, notes)

    def _is_world(self) -> bool:
        """Tell whether a database has one of the tables of a World."""
        query = "SELECT count(*) FROM sqlite_master WHERE name IN ('store', 'objs', 'resources')"
        with closing(sqlite3.connect(_read_only(self.path), uri=True)) as db:
            return bool(db.execute(query).fetchone()[0])

    def _recovered(self, notes: list[str]) -> Reference | None:
        db = self._opened()
        state = dict(db.execute('SELECT key, value FROM armor_state'))
        if 'name' not in state:
            iri = self._only_ontology(db, notes)
            if not iri:
                self.close_file()
                return None
            state = {'name': self.path.stem, 'iri': iri}
        # Others may be about to write: nothing is, until they are done.
        db.execute('BEGIN')
        try:
            found = self._asserted(state['iri']).read()
            rows = db.execute('SELECT waits, told, come, gone FROM armor_told ORDER BY id')
            groups = [(waits, *map(json.loads, texts)) for waits, *texts in rows]
        finally:
            db.execute('ROLLBACK')
        ref = self._reference(state, found.added)
        notes += (f'{self.path}: {problem}' for problem in found.problems)
        undone = list(dict.fromkeys(found.added)) if any(not g[0] for g in groups) else []
        origin = dict.fromkeys(undone)
        for waits, _, come, gone in reversed(groups):
            if not waits:
                for axiom in come:
                    origin.pop(decode(axiom), None)
                origin.update(dict.fromkeys(map(decode, gone)))
        for waits, told, _, _ in groups:
            (ref.buffering.waiting if waits else ref.quarantine.untested).extend(
                told_of(*one) for one in told
            )
        if undone:
            ref.quarantine.origin = tuple(origin)
            self._groups_written = True
        self._waiting_written = list(ref.buffering.waiting)
        self._written = state
        self._derived_known = False
        ref.opened = False
        self.follow(ref)
        self._read_spill(int(state.get('record', 0)), notes)
        return ref

    def _only_ontology(self, db: sqlite3.Connection, notes: list[str]) -> str:
        """Return the IRI of the ontology of a World that no service made; '': it is unclear."""
        query = 'SELECT iri FROM ontologies WHERE iri NOT IN (?, ?)'
        found = [iri for (iri,) in db.execute(query, (INFERRED, ANONYMOUS))]
        if len(found) != 1:
            named = ', '.join(found[:3]) or 'none'
            notes.append(f'{self.path}: is left alone: expected one ontology, found {named}')
            return ''
        return str(found[0]).rstrip('#')

    def _reference(self, state: dict[str, str], axioms: list[Axiom]) -> Reference:
        return Reference(
            state['name'],
            knowledge_base(state['iri'], axioms),
            Origin(*json.loads(state.get('origin', '["", "rdfxml", {}]'))),
            Buffering(*json.loads(state.get('buffering', '[false, true]'))),
            state.get('mounted', 'none'),
            Quarantine(lines=json.loads(state.get('quarantine', '[]'))),
            Effort(base=float(state.get('base', 0.0))),
        )

    def _read_spill(self, merged: int, notes: list[str]) -> None:
        """Do again what was answered while the file could not be written."""
        records, damaged = self._spill.read()
        if damaged:
            notes.append(f'{self.path.with_suffix(".spill")}: {damaged} damaged lines are left out')
        self._record = merged
        ref = self.ref
        for record in records:
            number, told, state, waiting = record
            self._record = max(self._record, number)
            if number <= merged:
                continue
            applied = [told_of(*one) for one in told]
            quarantine = ref.quarantine
            if applied:
                quarantine.origin = quarantine.origin or tuple(ref.kb.axioms())
                for one in applied:
                    apply_all(ref.kb, one.changes)
                quarantine.untested += applied
                self._on_applied(applied)
            ref.buffering = Buffering(*json.loads(state['buffering']))
            ref.buffering.waiting = [told_of(*one) for one in waiting]
            ref.mounted = state['mounted']
            quarantine.lines = json.loads(state['quarantine'])
        # What is in the spill already is not written there again.
        self._spilled = len(self._told)

    def _salvaged(self, error: Exception, notes: list[str]) -> Reference | None:
        """Put a damaged file aside, and go on with what can be read of it."""
        self.close_file()
        aside = put_aside(self.path, DAMAGED)
        self._make()
        quads, lost = 0, 1
        with closing(sqlite3.connect(self.path, isolation_level=None)) as db:
            self._set_up(db)
            db.execute('BEGIN IMMEDIATE')
            db.execute('UPDATE armor_own SET own=1')
            with suppress(sqlite3.DatabaseError):
                quads, lost = salvage(aside, db)
            db.execute('UPDATE armor_own SET own=0')
            db.execute('COMMIT')
        told = f'{self.path}: {error}; put aside in {aside.name}; '
        if not quads:
            notes.append(f'{told}nothing of it can be read')
            self.remove()
            return None
        notes.append(f'{told}{quads} statements were saved; {_lost(lost)}')
        self._whole = False
        return self._recovered(notes)

    # --- following a reference ---

    def follow(self, ref: Reference) -> None:
        """Take note of what changes in a reference from now on."""
        self.ref = ref
        ref.kb.subscribe(self._note)
        ref.on_applied = self._on_applied
        ref.on_taken_back = self._on_taken_back

    def _note(self, changes: Changes) -> None:
        for step, batch in ((-1, changes.removed), (1, changes.added)):
            for axiom, derived in batch:
                if derived:
                    if self._derived_known:
                        _count(self._derived, axiom, step)
                elif not self._quiet:
                    _count(self._net, axiom, step)
                    _count(self._delta, axiom, step)

    def _on_applied(self, told: list[Told]) -> None:
        self._told += told
        self._groups.append((told, self._delta))
        self._delta = {}

    def _on_taken_back(self, lines: list[str], undo: list[Change]) -> None:
        self._told.append(Told('', 0.0, tuple(undo)))
        self._delta = {}

    # --- writing ---

    @property
    def is_behind(self) -> bool:
        """Whether the file lacks something; asked without a lock."""
        return bool(self._failure) or self._whole

    @property
    def waiting(self) -> int:
        """How many changes wait to be written; asked without a lock."""
        return len(self._net) if self._failure else 0

    def create(self) -> None:
        """Write a new reference."""
        self._whole = True
        if self.path.exists():
            # No reference's: somebody put it there, or it was left alone.
            with suppress(OSError):
                aside = put_aside(self.path, REPLACED)
                self._warn(f'{self.path}: what was there is put aside in {aside.name}')
        with suppress(OSError):
            self._spill.clear()
        self.commit()
        if len(self.ref.kb) > LARGE and self._db is not None and not self._failure:
            # Indices that were filled in any order take twice the room. It may wait for others.
            with suppress(sqlite3.Error):
                self._db.execute('VACUUM')

    def commit(self) -> None:
        """Write what changed, as one transaction; into the spill where that cannot be."""
        if self.ref.dropped:
            return
        with self._lock:
            if not self._has_news():
                return
            if self._failure:
                # Whoever attends to the file tries again; nobody waits for that.
                self._keep_aside()
            else:
                self._commit_or_spill()

    def _commit_or_spill(self) -> bool:
        """Write what changed; tell whether that could be done."""
        try:
            while self._committed() is not None:
                # What others wrote is reasoned over as any change, and what follows is written.
                with suppress(TooHardError):
                    self.ref.reason_at_once()
        except (sqlite3.Error, OSError) as error:
            self._failed(error)
            self._keep_aside()
            return False
        self._succeeded()
        return True

    def _has_news(self) -> bool:
        return bool(
            self._net
            or self._derived
            or self._told
            or self._whole
            or self._failure
            or (self._groups_written and not self.ref.quarantine.untested)
            or (not self._derived_known and self.ref.opened and len(self.ref.kb) < LARGE)
            or not _same(self._waiting_written, self.ref.buffering.waiting)
            or self._state() != self._written
        )

    def _state(self) -> dict[str, str]:
        ref = self.ref
        origin, buffering = ref.origin, ref.buffering
        dump = TO_JSON.encode
        return {
            'name': ref.name,
            'iri': ref.kb.iri,
            'origin': self._origin_text(origin),
            'buffering': dump([buffering.manipulation, buffering.reasoner]),
            'mounted': ref.mounted,
            'base': repr(ref.effort.base),
            'quarantine': dump(ref.quarantine.lines),
            'record': str(self._record),
        }

    def _origin_text(self, origin: Origin) -> str:
        if self._origin[0] is not origin:
            parts = [origin.path, origin.format, dict(origin.prefixes)]
            self._origin = origin, TO_JSON.encode(parts)
        return self._origin[1]

    def _committed(self) -> Told | None:
        """Write what changed; return what others changed, which is taken in before."""
        db = self._opened()
        told: Told | None = None
        db.execute('BEGIN IMMEDIATE')
        try:
            db.execute('UPDATE armor_own SET own=1')
            ontology, inferred = self._ontologies(self.ref.kb.iri)
            if self._whole:
                self._write_all(db, ontology, inferred)
            else:
                told = self._take_foreign(db, ontology, inferred)
                self._write_changes(ontology, inferred)
            self._write_told(db)
            ontology.write_labels()
            state = self._state()
            changed = [pair for pair in state.items() if self._written.get(pair[0]) != pair[1]]
            db.executemany('INSERT OR REPLACE INTO armor_state VALUES (?, ?)', changed)
            db.execute('UPDATE armor_own SET own=0')
            db.execute('COMMIT')
        except BaseException:
            with suppress(sqlite3.Error):
                db.execute('ROLLBACK')
            self._names.rolled_back()
            if self._ontology is not None:
                self._ontology.rolled_back()
            # It may have been new.
            self._inferred = None
            if self._whole:
                self._ontology = None
            raise
        for part in (self._names, ontology, inferred):
            part.committed()
        self._commits += 1
        self._written = state
        self._waiting_written = list(self.ref.buffering.waiting)
        self._groups_written = bool(self.ref.quarantine.untested)
        self._net.clear()
        self._derived.clear()
        self._told, self._groups, self._spilled = [], [], 0
        self._whole = False
        return told

    def _write_all(
        self, db: sqlite3.Connection, ontology: WorldOntology, inferred: WorldOntology
    ) -> None:
        for table in ('armor_told', 'armor_changes', 'armor_state'):
            db.execute(f'DELETE FROM {table}')
        for table in ('objs', 'datas'):
            contexts = ontology.context, inferred.context
            db.execute(f'DELETE FROM {table} WHERE c IN (?, ?)', contexts)
        self._written, self._waiting_written, self._groups_written = {}, [], False
        self._version = db.execute('PRAGMA data_version').fetchone()[0]
        ontology.write_header()
        ontology.add_all(self.ref.kb.axioms())
        inferred.become(self.ref.kb.derived_facts() if self.ref.opened else ())
        self._derived_known = self.ref.opened

    def _write_changes(self, ontology: WorldOntology, inferred: WorldOntology) -> None:
        gone = [axiom for axiom, step in self._net.items() if step < 0]
        for axiom in gone:
            ontology.remove(axiom)
        for axiom, step in self._net.items():
            if step > 0:
                ontology.add(axiom)
        is_known = self.ref.kb.is_known
        for entity in dict.fromkeys(entity for axiom in gone for entity in entities_of(axiom)):
            if not is_known(*entity):
                ontology.forget(*entity)
        for axiom, step in self._derived.items():
            if step < 0:
                inferred.remove(axiom)
            else:
                inferred.add(axiom)
        if not self._derived_known and self.ref.opened:
            inferred.become(self.ref.kb.derived_facts())
            self._derived_known = True

    def _write_told(self, db: sqlite3.Connection) -> None:
        """Write which directives wait, and over which nobody reasoned yet."""
        waiting = self.ref.buffering.waiting
        start = len(self._waiting_written)
        if not _same(self._waiting_written, waiting[:start]):
            db.execute('DELETE FROM armor_told WHERE waits')
            start = 0
        rows: list[tuple[object, ...]] = [
            (1, TO_JSON.encode([told_as_json(one)]), '[]', '[]') for one in waiting[start:]
        ]
        if not self.ref.quarantine.untested:
            if self._groups_written:
                db.execute('DELETE FROM armor_told WHERE NOT waits')
        else:
            for told, delta in self._groups:
                parts = [
                    [encode(a) for a, step in delta.items() if step == sign] for sign in (1, -1)
                ]
                texts = map(TO_JSON.encode, ([told_as_json(one) for one in told], *parts))
                rows.append((0, *texts))
        db.executemany('INSERT INTO armor_told VALUES (NULL, ?, ?, ?, ?)', rows)

    def _failed(self, error: Exception) -> None:
        now = time.monotonic()
        if isinstance(error, sqlite3.DatabaseError) and not isinstance(
            error, sqlite3.OperationalError
        ):
            # Damaged while it is in use: all that is known is written into another one.
            self.close_file()
            aside = None
            with suppress(OSError):
                aside = put_aside(self.path, DAMAGED)
            self._whole = True
            where = f'put aside in {aside.name} and ' if aside else ''
            self._warn(f'{self.path}: {error}; {where}written anew')
        if not self._failure:
            self._failed_since = now
        self._failure, self._failed_at = str(error), now
        if self._db is not None:
            self._db.execute('PRAGMA busy_timeout = 0')

    def _tell_failure(self, what: str) -> None:
        if not self._told_failure:
            self._told_failure = True
            self._warn(f'{self.path}: {what}')

    def _succeeded(self) -> None:
        if self._failure:
            self._failure, self._spilled_last = '', None
            if self._db is not None:
                self._db.execute(f'PRAGMA busy_timeout = {int(BUSY * 1000)}')
            if self._told_failure:
                self._told_failure = False
                self._warn(f'{self.path}: can be written again, every change is kept')
        # What stays there is known by its number to be in the file.
        with suppress(OSError):
            self._spill.clear()

    def _keep_aside(self) -> None:
        """Append what was answered to the spill; it waits in memory where that cannot be, too."""
        told = self._told[self._spilled :]
        waiting = self.ref.buffering.waiting
        state = {**self._state(), 'record': ''}
        last = state, list(map(id, waiting))
        if not self._whole and (told or last != self._spilled_last):
            parts = [[told_as_json(one) for one in each] for each in (told, waiting)]
            try:
                self._spill.append([self._record + 1, parts[0], state, parts[1]])
            except OSError:
                pass
            else:
                self._record += 1
                self._spilled, self._spilled_last = len(self._told), last
        if self._whole or self._spilled < len(self._told):
            self._tell_failure(
                f'{self._failure}: until it can be written, changes are lost at a restart'
            )
        elif 'locked' not in self._failure:
            where = f'changes are kept in {self._spill_name}'
            if not os.access(self.path.parent, os.W_OK):
                where = 'until it can be written, changes are lost at a restart'
            self._tell_failure(f'{self._failure}: {where}')

    @property
    def _spill_name(self) -> str:
        return self.path.with_suffix('.spill').name

    # --- what others wrote ---

    def has_foreign(self) -> bool:
        """Tell whether another program committed something; asked without the reference's lock."""
        if self._db is None or not self._lock.acquire(blocking=False):
            return False
        try:
            if self._db is None:
                return False
            found = self._db.execute('PRAGMA data_version').fetchone()[0]
            return bool(found != self._version)
        except sqlite3.Error:
            return False
        finally:
            self._lock.release()

    def attend(self) -> None:
        """Take in what others wrote, and write what waits."""
        with self._lock:
            if self.ref.dropped:
                return
            if self._commit_or_spill() or self._told_failure:
                return
            if time.monotonic() - self._failed_since >= TOLD_AFTER:
                holder = lock_holder(self.path) or 'another program'
                self._tell_failure(
                    f'{holder} keeps it locked; changes are kept in {self._spill_name} until it '
                    'lets go'
                )

    def wants_attention(self) -> bool:
        """Tell whether `attend` has something to do; asked without the reference's lock."""
        if self._failure:
            return time.monotonic() - self._failed_at >= BUSY
        if self._whole or self._db is None:
            return False  # It is being made.
        late = not self._derived_known and self.ref.opened
        return late or self.has_foreign()

    def _take_foreign(
        self, db: sqlite3.Connection, ontology: WorldOntology, inferred: WorldOntology
    ) -> Told | None:
        """Take in what others changed, and do what waits to be written once more on top of it."""
        rows = db.execute('SELECT event, c, s, p, o, d FROM armor_changes ORDER BY id').fetchall()
        self._version = db.execute('PRAGMA data_version').fetchone()[0]
        if not rows:
            return None
        db.execute('DELETE FROM armor_changes')
        net: dict[Quad, int] = {}
        names: list[tuple[int, str]] = []
        forgotten: list[int] = []
        others: set[int] = set()
        for event, c, s, p, o, d in rows:
            if event == _RENAMED:
                self._names.forget(s)
                names.append((s, str(o)))
            elif event == _FORGOTTEN:
                # What went is read by the name that it had.
                self._names.remember(s, str(o))
                forgotten.append(s)
            elif c == ontology.context:
                _count(net, (s, p, o) if d is None else (s, p, o, d), 1 if event == _COME else -1)
            elif c == inferred.context:
                self._derived_known = False
            else:
                others.add(c)
        self._tell_others(db, others)
        changes = self._renamed(ontology, names)
        come = [quad for quad, step in net.items() if step > 0]
        gone = [quad for quad, step in net.items() if step < 0]
        db.execute('SAVEPOINT foreign_changes')
        found = ontology.read_changes(come, gone)
        if found.problems:
            db.execute('ROLLBACK TO foreign_changes')
            self._refuse(ontology, come, gone, found.problems)
            self._forget_refused(found)
        db.execute('RELEASE foreign_changes')
        for number in forgotten:
            self._names.forget(number)
        replacing = self._replacing(found)
        changes += [RemoveAxiom(axiom) for axiom in found.removed if axiom in self.ref.kb]
        changes += [AddAxiom(axiom) for axiom in found.added if axiom not in self.ref.kb]
        if not changes and not replacing:
            return None
        return self._merge(ontology, Told(FILE, time.time(), tuple(changes)), replacing)

    def _tell_others(self, db: sqlite3.Connection, contexts: set[int]) -> None:
        """Say once of each other ontology of the file that it is not the reference's."""
        for context in sorted(contexts - self._others):
            self._others.add(context)
            row = db.execute('SELECT iri FROM ontologies WHERE c=?', (context,)).fetchone()
            if row is not None and row[0] != ANONYMOUS:
                self._warn(
                    f'{self.path}: what another program wrote in the ontology <{row[0]}> is kept '
                    f'and left alone: the reference is <{self.ref.kb.iri}>'
                )

    def _replacing(self, found: AxiomsRead) -> list[SetAssertion]:
        """Take the numbers out of what was read that take the place of others."""
        replacing: list[SetAssertion] = []
        for axiom, typed in list(assigned_numbers(self.ref.kb, found.added, found.removed)):
            replacing.append(SetAssertion(typed))
            found.added.remove(axiom)
            self._net[axiom] = -1
        return replacing

    def _renamed(self, ontology: WorldOntology, names: list[tuple[int, str]]) -> list[Change]:
        changes: list[Change] = []
        for number, old in names:
            new = self._names.name(number)
            after: dict[Axiom, Axiom] = {}
            for axiom in self.ref.kb.axioms_about(old):
                changed = axiom
                for kind in _KINDS:
                    changed = renamed(changed, kind, old, new)
                after[axiom] = changed
            ontology.renamed(after, old, new)
            changes += [RemoveAxiom(axiom) for axiom in after]
            changes += [AddAxiom(axiom) for axiom in after.values()]
        return changes

    def _refuse(
        self,
        ontology: WorldOntology,
        come: Sequence[Quad],
        gone: Sequence[Quad],
        problems: Sequence[str],
    ) -> None:
        """Undo what is no OWL, and keep it in a file."""
        aside = _free_name(self.path.with_suffix('.txt'), 'refused-')
        lines = [
            f'{sign} {" ".join(ontology.text(quad))} .\n'
            for sign, quads in (('+', come), ('-', gone))
            for quad in quads
        ]
        with suppress(OSError), aside.open('a') as file:
            file.writelines(lines)
        ontology.rolled_back()
        ontology.apply(gone, come)
        more = f' and {len(problems) - 1} more' if len(problems) > 1 else ''
        self._warn(
            f'{self.path}: what another program wrote is no OWL and undone: {problems[0]}{more}; '
            f'it is kept in {aside.name}'
        )

    def _forget_refused(self, found: AxiomsRead) -> None:
        """Take back what was read of it when the file was opened."""
        kb = self.ref.kb
        known = [axiom for axiom in found.added if axiom in kb and self._net.get(axiom) != 1]
        gone = [axiom for axiom in found.removed if axiom not in kb and self._net.get(axiom) != -1]
        self._quiet = True
        try:
            kb.change(gone, known)
        finally:
            self._quiet = False
        found.added, found.removed = [], []

    def _merge(self, ontology: WorldOntology, told: Told, replacing: list[SetAssertion]) -> Told:
        """Take in a change of others before those that wait to be written."""
        kb = self.ref.kb
        self._quiet = True
        delta: dict[Axiom, int] = {}
        try:
            for change in told.changes:
                step = 1 if isinstance(change, AddAxiom) else -1
                _count(delta, change.axiom, step)  # type: ignore[union-attr]
            apply_all(kb, told.changes)
        finally:
            self._quiet = False
        self._delta = delta
        apply_all(kb, replacing)
        delta = self._delta
        for one in self._told:
            apply_all(kb, one.changes)
        self._net = {a: step for a, step in self._net.items() if (a in kb) == (step > 0)}
        for change in told.changes:
            if isinstance(change, AddAxiom):
                ontology.declare(change.axiom)
        self._delta = {}
        told = Told(FILE, told.time, (*told.changes, *replacing))
        self.ref.quarantine.untested.append(told)
        self._groups.insert(0, ([told], delta))
        self.ref.revision += 1
        return told

    # --- the rest ---

    def sync(self) -> None:
        """Wait until what was committed is on the disk for certain; without the reference's lock.

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

    def backup(self, target: Path) -> str:
        """Write a copy of the file as it is now; without a lock.

        Returns:
            What the copy lacks; empty: nothing.

        Raises:
            OSError: It cannot be written.
            sqlite3.Error: Likewise.
        """
        new = target.with_name(f'.{target.name}.new')
        new.unlink(missing_ok=True)
        try:
            with (
                closing(sqlite3.connect(_read_only(self.path), uri=True)) as source,
                closing(sqlite3.connect(new)) as copy,
            ):
                source.backup(copy)
            new.rename(target)
        finally:
            new.unlink(missing_ok=True)
        if not self._failure:
            return ''
        return f'the copy lacks {self.waiting} changes that wait to be written: {self._failure}'

    def remove(self) -> None:
        """Remove the file and what is beside it."""
        with self._lock:
            self.close_file()
            self._spill.clear()
            for ending in ('', '-wal', '-shm'):
                self.path.with_name(self.path.name + ending).unlink(missing_ok=True)

    def close(self) -> None:
        """Write what waits, if that can be, and let go of the file."""
        with self._lock:
            if not self.ref.dropped and (self._failure or self._whole):
                self._commit_or_spill()
                lost = len(self.ref.kb) if self._whole else len(self._told) - self._spilled
                if lost:
                    self._warn(f'{self.path}: {self._failure}: {lost} changes are not kept')
            self.close_file()
            self._spill.close()


def put_aside(path: Path, word: str) -> Path:
    """Give a World's file another name, with what SQLite keeps beside it, and return that."""
    aside = _free_name(path, word)
    for ending in ('', '-wal', '-shm'):
        with suppress(FileNotFoundError):
            path.with_name(path.name + ending).rename(aside.with_name(aside.name + ending))
    return aside


def _free_name(path: Path, word: str) -> Path:
    stamp = time.strftime('%Y%m%d-%H%M%S')
    names = (f'{word}{stamp}{f"-{n}" if n > 1 else ""}-{path.name}' for n in count(1))
    return next(found for name in names if not (found := path.with_name(name)).exists())


def _lost(tables: int) -> str:
    return f'of {tables} tables some may be lost' if tables else 'nothing is lost'


def _read_only(path: Path) -> str:
    return f'file:{quote(str(path))}?mode=ro'


def _count(net: dict[Any, int], what: Any, step: int) -> None:
    if net.get(what) == -step:
        del net[what]
    else:
        net[what] = step


def _same(first: list[Told], second: list[Told]) -> bool:
    """Tell whether two lists hold the same directives, by the last ones."""
    return len(first) == len(second) and (not first or first[-1] is second[-1])


def _sync_directory(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
