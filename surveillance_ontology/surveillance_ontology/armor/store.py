"""What the service has to remember over its own death: references, their axioms, buffers, mounts.

Every change goes into a `Journal` before it is answered. What is written are the axioms that come
and go, not the directives, so that recovery gives the same ontology whatever the reasoner says by
then. Now and then a snapshot takes the place of the records before it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

from surveillance_ontology.armor.changes import Change, apply_all, decode, encode
from surveillance_ontology.armor.journal import Journal, JournalError
from surveillance_ontology.armor.loading import knowledge_base
from surveillance_ontology.armor.reference import Origin, Reference
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.java_reasoning import JavaReasonerError

Record = list[Any]
"""``[what, reference name, ...]``."""
COMPACT_FROM = 1 << 20
"""Bytes of journal from which on a snapshot is written, if the last one is not larger."""


class Store:
    """Durable references.

    Args:
        directory: Where the journal is.
        compact_from: See `COMPACT_FROM`.

    Raises:
        JournalError: The directory cannot be used.
    """

    def __init__(self, directory: Path, compact_from: int = COMPACT_FROM) -> None:
        self._journal = Journal(directory)
        self._compact_from = compact_from
        self._lock = threading.Lock()
        self._batch = threading.local()
        self._snapshot: threading.Thread | None = None
        self._beginning = threading.Lock()
        self._names: set[str] = set()

    def recover(self) -> list[Reference]:
        """Make the references as they were answered for; their derived facts are up to date.

        Raises:
            JournalError: A record that this version does not know.
        """
        recovery = _Recovery()
        with self._lock:
            for record in self._journal.records():
                try:
                    recovery.take(record)
                except (KeyError, IndexError, TypeError, ValueError) as error:
                    raise JournalError(f'record {record!r:.80} cannot be read: {error}') from None
            self._names = set(recovery.references)
        for ref in recovery.references.values():
            with suppress(JavaReasonerError):
                ref.kb.reason()
        return list(recovery.references.values())

    def loaded(self, ref: Reference) -> None:
        """Remember a new reference."""
        self._write(_load_record(ref))

    def dropped(self, name: str) -> None:
        """Forget a reference."""
        self._write(['drop', name])

    def mounted(self, name: str, client: str) -> None:
        """Remember who is mounted."""
        self._write(['mount', name, client])

    def buffered(self, name: str, on: bool) -> None:
        """Remember that buffered manipulation was switched."""
        self._write(['buffer', name, on])

    def changed(self, name: str, changes: Iterable[Change]) -> None:
        """Remember changes, applied or queued as the reference is set up."""
        self._write(['change', name, [encode(change) for change in changes]])

    def flushed(self, name: str) -> None:
        """Remember that the queue was applied."""
        self._write(['flush', name])

    @contextmanager
    def batch(self) -> Iterator[None]:
        """Make what is written inside durable at the end, all of it or nothing.

        Raises:
            JournalError: At the end: nothing of it could be written.
        """
        records: list[Record] = []
        self._batch.records = records
        try:
            yield
        finally:
            self._batch.records = None
            if records:
                self._append(records)

    def compact_if_large(
        self,
        hold_all: Callable[[], AbstractContextManager[list[Reference]]],
        failed: Callable[[str], None],
    ) -> None:
        """Write a snapshot on a thread of its own if the journal has grown.

        Args:
            hold_all: Context manager under which no reference changes; gives all of them.
            failed: Told in one line when it could not be written.
        """
        journal = self._journal
        if journal.size < max(self._compact_from, journal.snapshot_size):
            return

        def write() -> None:
            try:
                with hold_all() as references, self._lock:
                    kept = [ref for ref in references if not ref.dropped]
                    if {ref.name for ref in kept} != self._names:
                        return  # One came or went meanwhile; the next change tries again.
                    number = journal.begin_snapshot()
                    states = [_state(ref) for ref in kept]
                journal.finish_snapshot(number, (_record(*state) for state in states))
            except JournalError as error:
                failed(str(error))

        with self._beginning:
            if self._snapshot is not None and self._snapshot.is_alive():
                return
            self._snapshot = threading.Thread(target=write, name='snapshot', daemon=True)
            self._snapshot.start()

    def close(self) -> None:
        """Finish a snapshot that is being written, and let another process open the store."""
        if self._snapshot is not None:
            self._snapshot.join()
        self._journal.close()

    def _write(self, record: Record) -> None:
        pending: list[Record] | None = getattr(self._batch, 'records', None)
        if pending is not None:
            pending.append(record)
            return
        self._append([record])

    def _append(self, records: list[Record]) -> None:
        with self._lock:
            self._journal.append(records)
            for what, name, *_ in records:
                if what == 'load':
                    self._names.add(name)
                elif what == 'drop':
                    self._names.discard(name)


_State = tuple[str, dict[str, Any], list[Axiom], list[Change]]


def _state(ref: Reference) -> _State:
    settings = {
        'iri': ref.kb.iri,
        'path': ref.origin.path,
        'format': ref.origin.format,
        'prefixes': dict(ref.origin.prefixes),
        'reasoner': ref.origin.reasoner,
        'buffered_manipulation': ref.buffered_manipulation,
        'buffered_reasoner': ref.buffered_reasoner,
        'mounted': ref.mounted,
    }
    return ref.name, settings, list(ref.kb.axioms()), list(ref.queue)


def _record(
    name: str, settings: dict[str, Any], axioms: list[Axiom], queue: list[Change]
) -> Record:
    return ['load', name, settings, [encode(a) for a in axioms], [encode(c) for c in queue]]


def _load_record(ref: Reference) -> Record:
    return _record(*_state(ref))


class _Recovery:
    def __init__(self) -> None:
        self.references: dict[str, Reference] = {}

    def take(self, record: Record) -> None:
        what, name, *rest = record
        if what == 'load':
            settings, axioms, queue = rest
            self.references[name] = Reference(
                name,
                knowledge_base(
                    settings['iri'], [decode(axiom) for axiom in axioms], settings['reasoner']
                ),
                Origin(
                    settings['path'],
                    settings['format'],
                    settings['prefixes'],
                    settings['reasoner'],
                ),
                settings['buffered_manipulation'],
                settings['buffered_reasoner'],
                settings['mounted'],
                [decode(change) for change in queue],
            )
            return
        if what == 'drop':
            self.references.pop(name, None)
            return
        ref = self.references[name]
        if what == 'mount':
            ref.mounted = rest[0]
        elif what == 'change':
            changes = [decode(change) for change in rest[0]]
            if ref.buffered_manipulation:
                ref.queue += changes
            else:
                apply_all(ref.kb, changes)
        elif what == 'flush':
            self._flush(ref)
        elif what == 'buffer':
            ref.buffered_manipulation = rest[0]
            if not rest[0]:
                self._flush(ref)
        else:
            raise ValueError(f'unknown kind {what!r}')

    def _flush(self, ref: Reference) -> None:
        queue, ref.queue = ref.queue, []
        apply_all(ref.kb, queue)
