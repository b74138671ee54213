"""What the service has to remember over its own death: references, their axioms, buffers, mounts.

Every change goes into a `Journal` before it is answered. What is written are the axioms that come
and go, not the directives, so that recovery gives the same ontology whatever the reasoner says by
then. Now and then a snapshot takes the place of the records before it.

A journal is a directory with numbered segments, ``journal-<n>.log``, and at most one snapshot in
use, ``snapshot-<n>.log``, which stands for everything before segment n. Each line is ``<crc32>
<text>`` with a list of records, and is on the disk when `Journal.append` returns. A line that was
cut off by a crash is the last of the last segment; it was never answered for, and is removed when
the journal is opened.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, BinaryIO

from surveillance_ontology.armor.reference import (
    AddAxiom,
    Change,
    Origin,
    Reference,
    RemoveAxiom,
    RemoveEntity,
    RenameEntity,
    apply_all,
    knowledge_base,
)
from surveillance_ontology.owl import axioms, expressions
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.reasoner.java_reasoning import JavaReasonerError

Record = list[Any]
"""``[what, reference name, ...]``."""
COMPACT_FROM = 1 << 20
"""Bytes of journal from which on a snapshot is written, if the last one is not larger."""
_NAME = re.compile(r'(journal|snapshot)-(\d+)\.log\Z')


class JournalError(Exception):
    """A journal that cannot be opened or written: one line with file and place."""


class Journal:
    """Records on disk.

    Args:
        directory: Where they are; made if it is not there. One process at a time may have it open.

    Raises:
        JournalError: In use by another process, not readable, or damaged other than by a crash.

    Attributes:
        size: Bytes of the segments since the snapshot.
        snapshot_size: Bytes of the snapshot.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._parts_lock = threading.Lock()
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._lock = (directory / 'lock').open('w')
        except OSError as error:
            raise JournalError(f'{directory}: {error.strerror}') from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise JournalError(f'{directory}: in use by another process') from None
        try:
            self._open()
        except BaseException:
            self._lock.close()
            raise

    def _open(self) -> None:
        numbers: dict[str, list[int]] = {'journal': [], 'snapshot': []}
        for path in self._directory.iterdir():
            if match := _NAME.match(path.name):
                numbers[match[1]].append(int(match[2]))
        start = max(numbers['snapshot'], default=0)
        segments = sorted(n for n in numbers['journal'] if n >= start) or [start]
        for number in range(start, segments[-1]):
            if number not in segments:
                raise JournalError(f'{self._path("journal", number)}: is missing')
        self._parts = [self._path('snapshot', start)] if start else []
        self._parts += [self._path('journal', number) for number in segments]
        for _ in self.records():
            pass
        self.snapshot_size = self._path('snapshot', start).stat().st_size if start else 0
        sizes = [path.stat().st_size for path in self._parts if path.exists()]
        self.size = sum(sizes) - self.snapshot_size
        self._number = segments[-1]
        self._file = self._segment(self._number)
        self._end = self._file.tell()
        self._remove_before(start)

    def records(self) -> Iterator[Any]:
        """Give the records, oldest first.

        Raises:
            JournalError: Not readable, or damaged.
        """
        with self._parts_lock:
            for path in self._parts:
                yield from self._read(path, last=path == self._parts[-1])

    def append(self, records: Iterable[Any]) -> None:
        """Write records as one: after a crash all of them are there or none.

        Raises:
            JournalError: They could not be written; none of them is there.
        """
        if self._file.closed:
            raise JournalError(f'{self._directory}: closed')
        line = _line(list(records))
        try:
            self._cut()
            rest = memoryview(line)
            while rest:
                # A disk that is almost full takes a part without an error.
                rest = rest[self._file.write(rest) :]
            os.fdatasync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._cut()
            raise JournalError(f'{self._directory}: {error.strerror}') from None
        self._end += len(line)
        self.size += len(line)

    def begin_snapshot(self) -> int:
        """Start a new segment; a snapshot of the state as it is now may then be written.

        Returns:
            What `finish_snapshot` is to be called with.
        """
        number = self._number + 1
        try:
            file = self._segment(number)
        except OSError as error:
            raise JournalError(f'{self._directory}: {error.strerror}') from None
        self._file.close()
        self._file, self._number, self.size, self._end = file, number, 0, 0
        self._parts.append(self._path('journal', number))
        return number

    def finish_snapshot(self, number: int, records: Iterable[Any]) -> None:
        """Write the snapshot and remove what it stands for; records may be appended meanwhile.

        Raises:
            JournalError: It could not be written; the journal goes on without it.
        """
        path = self._path('snapshot', number)
        temporary = path.with_suffix('.tmp')
        try:
            with temporary.open('wb') as file:
                for record in records:
                    file.write(_line([record]))
                file.flush()
                os.fsync(file.fileno())
                self.snapshot_size = file.tell()
            with self._parts_lock:
                temporary.rename(path)
                self._sync_directory()
                current = self._parts.index(self._path('journal', number))
                self._parts = [path, *self._parts[current:]]
                self._remove_before(number)
        except OSError as error:
            raise JournalError(f'{self._directory}: {error.strerror}') from None

    def close(self) -> None:
        """Let another process open the journal."""
        self._file.close()
        self._lock.close()

    def _cut(self) -> None:
        """Remove what a write that failed may have left behind the records."""
        os.ftruncate(self._file.fileno(), self._end)

    def _path(self, kind: str, number: int) -> Path:
        return self._directory / f'{kind}-{number}.log'

    def _segment(self, number: int) -> BinaryIO:
        file = self._path('journal', number).open('ab', buffering=0)
        self._sync_directory()
        return file

    def _sync_directory(self) -> None:
        descriptor = os.open(self._directory, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _remove_before(self, number: int) -> None:
        for path in self._directory.iterdir():
            match = _NAME.match(path.name)
            if path.suffix == '.tmp' or (match and int(match[2]) < number):
                path.unlink(missing_ok=True)

    def _read(self, path: Path, *, last: bool) -> Iterator[Any]:
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            if last:
                return
            raise JournalError(f'{path}: is missing') from None
        except OSError as error:
            raise JournalError(f'{path}: {error.strerror}') from None
        start = 0
        while start < len(data):
            end = data.find(b'\n', start)
            records = _parsed(data[start:end]) if end >= 0 else None
            if records is None:
                if last and (end < 0 or end == len(data) - 1):
                    os.truncate(path, start)
                    return
                raise JournalError(f'{path}: damaged at byte {start}')
            yield from records
            start = end + 1


def _line(records: list[Any]) -> bytes:
    text = json.dumps(records, separators=(',', ':')).encode()
    return b'%08x %s\n' % (zlib.crc32(text), text)


def _parsed(line: bytes) -> list[Any] | None:
    text = line[9:]
    if line[8:9] != b' ' or line[:8] != b'%08x' % zlib.crc32(text):
        return None
    records: list[Any] = json.loads(text)
    return records


_RECORDS: dict[str, type] = {
    name: member
    for module in (axioms, expressions)
    for name, member in vars(module).items()
    if isinstance(member, type) and is_dataclass(member) and member is not Literal
} | {change.__name__: change for change in (AddAxiom, RemoveAxiom, RenameEntity, RemoveEntity)}
_FIELDS = {name: tuple(f.name for f in fields(record)) for name, record in _RECORDS.items()}


def encode(value: Any) -> Any:
    """Turn an axiom or a change into lists, strings and numbers that JSON holds.

    A record becomes ``[class name, field, ...]``, a tuple ``["t", ...]``, a set ``["s", ...]``, a
    literal ``["l", lexical, datatype, language]``.
    """
    if isinstance(value, str | int):
        return value
    if isinstance(value, Literal):
        return ['l', value.lexical, value.datatype, value.language]
    if isinstance(value, tuple):
        return ['t', *map(encode, value)]
    if isinstance(value, frozenset):
        return ['s', *map(encode, sorted(value))]
    name = type(value).__name__
    return [name, *[encode(getattr(value, field)) for field in _FIELDS[name]]]


def decode(value: Any) -> Any:
    """Undo `encode`.

    Raises:
        ValueError: Not something `encode` wrote.
    """
    if not isinstance(value, list):
        return value
    if not value or not isinstance(value[0], str):
        raise ValueError(f'no record: {value!r:.80}')
    tag, *parts = value
    if tag == 'l':
        return Literal(*parts)
    decoded = [decode(part) for part in parts]
    if tag == 't':
        return tuple(decoded)
    if tag == 's':
        return frozenset(decoded)
    if tag not in _RECORDS:
        raise ValueError(f'unknown record {tag!r}')
    return _RECORDS[tag](*decoded)


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
