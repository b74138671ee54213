"""One reference's file: an owlready2 World, and beside its quads what the service remembers.

A batch and what is remembered of it are one transaction, in write-ahead mode: SIGKILL loses nothing
that was committed, and readers see whole batches only. What other programs change is taken in
before the next batch is written, or as soon as it is noticed.

owlready2 is in a transaction from the moment it opens a file until it saves, which keeps everybody
else from writing. What cannot be written meanwhile goes into a `Spill` and is merged later: first
what the others wrote, then each batch again, so that a value that was set is the only one.
"""

from __future__ import annotations

import json
import os
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

from armor_service.changes import apply_all
from armor_service.protocol import StoreError
from armor_service.quarantine import Quarantine, Submission, TooHardError
from armor_service.reference import Buffering, Effort, Origin, Reference, knowledge_base
from armor_service.store.foreign_writes import ForeignWrites
from armor_service.store.lock_holder import lock_holder
from armor_service.store.records import submission_of
from armor_service.store.spill import Spill
from armor_service.store.unwritten import Remembered, Unwritten
from armor_service.store.world_connection import (
    ANONYMOUS,
    BUSY,
    INFERRED,
    ForeignRows,
    WorldConnection,
)
from armor_service.store.write_failure import WriteFailure
from owl_reasoner.owl.axioms import Axiom

ENDING = '.sqlite3'
DAMAGED, REPLACED = 'damaged-', 'replaced-'
"""How the names of files begin that were put aside."""
LARGE = 10_000
"""Axioms from which on derived facts of before are compared while no directive waits for it."""


class WorldFile:
    """The file of one reference; whoever calls it holds the reference's lock, unless it says so.

    Args:
        path: The file.
        warn: Told in one line when it cannot be written, when it can be again, and what others
            wrote that is no OWL.
        synced: Keep answered changes over a loss of power as well: `sync` waits for the disk.

    Attributes:
        path: The file.
        connection: The open file; to wait for the disk, to shorten its log.
        ref: The reference; there after `recover` or `follow`.
    """

    def __init__(self, path: Path, warn: Callable[[str], None], *, synced: bool = False) -> None:
        self.path = path
        self.ref: Reference
        self._warn = warn
        self._lock = threading.RLock()
        self.connection = WorldConnection(path, synced=synced)
        self._spill = Spill(path.with_suffix('.spill'), synced=synced)
        self._lacking = Unwritten()
        self._remembered = Remembered()
        self._failure = WriteFailure(self._tell)
        self._foreign = ForeignWrites(self.connection, self._lacking, self._tell)

    def _tell(self, what: str) -> None:
        self._warn(f'{self.path}: {what}')

    def _opened(self) -> sqlite3.Connection:
        """Return the open file, which is opened or made where it is not there."""
        if self.connection.is_lost():
            self.connection.close()
            self._lacking.whole = True
            self._tell('is no longer there; all that is known is written again')
        if self.connection.is_empty():
            self.connection.make()
            self._lacking.whole = True
        return self.connection.open()

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
                raise StoreError(f'{self.path}: {self._holder()} has it for itself') from None
            if 'no such table' in str(error) and not self._is_world():
                notes.append(f'{self.path}: is left alone: is no World of owlready2')
                self.connection.close()
                return None
            if 'malformed' not in str(error) and 'no such table' not in str(error):
                raise StoreError(f'{self.path}: {error}') from None
            return self._salvaged(error, notes)
        except sqlite3.DatabaseError as error:
            return self._salvaged(error, notes)

    def _holder(self) -> str:
        return lock_holder(self.path) or 'another program'

    def _is_world(self) -> bool:
        """Tell whether a database has one of the tables of a World."""
        query = "SELECT count(*) FROM sqlite_master WHERE name IN ('store', 'objs', 'resources')"
        with closing(self.connection.reader()) as db:
            return bool(db.execute(query).fetchone()[0])

    def _recovered(self, notes: list[str]) -> Reference | None:
        db = self._opened()
        state = dict(db.execute('SELECT key, value FROM armor_state'))
        if 'name' not in state:
            iri = self._only_ontology(db, notes)
            if not iri:
                self.connection.close()
                return None
            state = {'name': self.path.stem, 'iri': iri}
        # Others may be about to write: nothing is, until they are done.
        db.execute('BEGIN')
        try:
            ontology = self.connection.asserted(state['iri'])
            # What others wrote meanwhile is a change of what was there before.
            others = self.connection.foreign(ontology.context) or ForeignRows()
            found = ontology.read(others.come, others.gone, others.renamed)
            ref = self._reference(state, found.added)
            self._remembered.read(db, ref, state)
        finally:
            db.execute('ROLLBACK')
        notes += (f'{self.path}: {problem}' for problem in found.problems)
        self._lacking.derived_known = False
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
        ref, quarantine = self.ref, self.ref.quarantine
        for told, state, waiting in self._spill.read(merged, notes):
            applied = [submission_of(*one) for one in told]
            if applied:
                quarantine.origin = quarantine.origin or tuple(ref.kb.axioms())
                for one in applied:
                    apply_all(ref.kb, one.changes)
                quarantine.untested += applied
                self._lacking.applied(applied)
            ref.buffering = Buffering(*json.loads(state['buffering']))
            ref.buffering.waiting = [submission_of(*one) for one in waiting]
            ref.mounted = state['mounted']
            quarantine.lines = json.loads(state['quarantine'])
        # What is in the spill already is not written there again.
        self._spill.kept = len(self._lacking.told)

    def _salvaged(self, error: Exception, notes: list[str]) -> Reference | None:
        """Put a damaged file aside, and go on with what can be read of it."""
        aside = self.connection.quarantine(DAMAGED)
        quads, lost = self.connection.salvage(aside)
        told = f'{self.path}: {error}; put aside in {aside.name}; '
        if not quads:
            notes.append(f'{told}nothing of it can be read')
            self.remove()
            return None
        some = f'of {lost} tables some may be lost' if lost else 'nothing is lost'
        notes.append(f'{told}{quads} statements were saved; {some}')
        self._lacking.whole = False
        return self._recovered(notes)

    def follow(self, ref: Reference) -> None:
        """Take note of what changes in a reference from now on."""
        self.ref = ref
        self._lacking.follow(ref)

    # --- writing ---

    @property
    def is_behind(self) -> bool:
        """Whether the file lacks something; asked without a lock."""
        return bool(self._failure.text) or self._lacking.whole

    @property
    def waiting(self) -> int:
        """How many changes wait to be written; asked without a lock."""
        return len(self._lacking.net) if self._failure.text else 0

    def create(self) -> None:
        """Write a new reference."""
        self._lacking.whole = True
        if self.path.exists():
            # No reference's: somebody put it there, or it was left alone.
            with suppress(OSError):
                aside = self.connection.quarantine(REPLACED)
                self._tell(f'what was there is put aside in {aside.name}')
        with suppress(OSError):
            self._spill.clear()
        self.commit()
        if len(self.ref.kb) > LARGE and self.connection.db is not None and not self._failure.text:
            # Indices that were filled in any order take twice the room. It may wait for others.
            with suppress(sqlite3.Error):
                self.connection.db.execute('VACUUM')

    def commit(self) -> None:
        """Write what changed, as one transaction; into the spill where that cannot be."""
        if self.ref.dropped:
            return
        with self._lock:
            if self._failure.text:
                # Whoever attends to the file tries again; nobody waits for that.
                self._quarantine()
            elif self._has_news():
                self._commit_or_spill()

    def _has_news(self) -> bool:
        ref, lacking = self.ref, self._lacking
        return (
            bool(lacking)
            or (not lacking.derived_known and ref.opened and len(ref.kb) < LARGE)
            or self._remembered.differs(ref, self._spill.number)
        )

    def _commit_or_spill(self) -> bool:
        """Write what changed; tell whether that could be done."""
        try:
            while self._committed() is not None:
                # What others wrote is reasoned over as any change, and what follows is written.
                with suppress(TooHardError):
                    self.ref.reason_at_once()
        except (sqlite3.Error, OSError) as error:
            self._failed(error)
            self._quarantine()
            return False
        if self._failure.text:
            self.connection.wait_for_others(BUSY)
            self._failure.over()
        # What stays there is known by its number to be in the file.
        with suppress(OSError):
            self._spill.clear()
        return True

    def _committed(self) -> Submission | None:
        """Write what changed; return what others changed, which is taken in before."""
        db = self._opened()
        ref, lacking, remembered = self.ref, self._lacking, self._remembered
        told: Submission | None = None
        with self.connection.transaction(ref.kb.iri) as (ontology, inferred):
            if lacking.whole:
                self.connection.empty((ontology.context, inferred.context))
                remembered.forget()
            else:
                told = self._foreign.take(ref, ontology, inferred)
            lacking.write(ref, ontology, inferred)
            remembered.write(db, ref, lacking, self._spill.number)
        remembered.written(ref)
        lacking.written(ref)
        self._spill.merged()
        return told

    def _failed(self, error: Exception) -> None:
        if isinstance(error, sqlite3.DatabaseError) and not isinstance(
            error, sqlite3.OperationalError
        ):
            # Damaged while it is in use: all that is known is written into another one.
            where = ''
            with suppress(OSError):
                where = f'put aside in {self.connection.quarantine(DAMAGED).name} and '
            self._lacking.whole = True
            self._tell(f'{error}; {where}written anew')
        self._failure.met(error)
        self.connection.wait_for_others(0.0)

    def _quarantine(self) -> None:
        """Append what was answered to the spill; it waits in memory where that cannot be, too."""
        told, whole = self._lacking.told, self._lacking.whole
        if not whole:
            state = self._remembered.state(self.ref, '')
            self._spill.keep(told, state, self.ref.buffering.waiting)
        is_kept = not whole and self._spill.kept == len(told)
        if is_kept and 'locked' in self._failure.text:
            return  # Whoever has it is named where it lasts.
        where = f'changes are kept in {self._spill.path.name}'
        if not is_kept or not os.access(self.path.parent, os.W_OK):
            where = 'until it can be written, changes are lost at a restart'
        self._failure.tell(f'{self._failure.text}: {where}')

    # --- what others wrote ---

    def has_foreign(self) -> bool:
        """Tell whether another program committed something; asked without the reference's lock."""
        if self.connection.db is None or not self._lock.acquire(blocking=False):
            return False
        try:
            return self.connection.has_foreign()
        except sqlite3.Error:
            return False
        finally:
            self._lock.release()

    def attend(self) -> None:
        """Take in what others wrote, and write what waits."""
        with self._lock:
            if not self.ref.dropped and not self._commit_or_spill() and self._failure.is_to_be_told:
                self._failure.tell(
                    f'{self._holder()} keeps it locked; changes are kept in '
                    f'{self._spill.path.name} until it lets go'
                )

    def wants_attention(self) -> bool:
        """Tell whether `attend` has something to do; asked without the reference's lock."""
        if self._failure.text:
            return self._failure.may_be_tried
        if self._lacking.whole or self.connection.db is None or not self.ref.opened:
            return False  # It is being made, or its `open` attends to it.
        return not self._lacking.derived_known or self.has_foreign()

    # --- the rest ---

    def backup(self, target: Path) -> str:
        """Write a copy of the file as it is now; without a lock.

        Returns:
            What the copy lacks; empty: nothing.

        Raises:
            OSError: It cannot be written.
            sqlite3.Error: Likewise.
        """
        self.connection.backup(target)
        failure = self._failure.text
        if not failure:
            return ''
        return f'the copy lacks {self.waiting} changes that wait to be written: {failure}'

    def remove(self) -> None:
        """Remove the file and what is beside it."""
        with self._lock:
            self.connection.close()
            self._spill.clear()
            self.connection.remove()

    def close(self) -> None:
        """Write what waits, if that can be, and let go of the file."""
        with self._lock:
            if not self.ref.dropped and self.is_behind:
                self._commit_or_spill()
                lacking = self._lacking
                lost = len(self.ref.kb) if lacking.whole else len(lacking.told) - self._spill.kept
                if lost:
                    self._tell(f'{self._failure.text}: {lost} changes are not kept')
            self.connection.close()
            self._spill.close()
