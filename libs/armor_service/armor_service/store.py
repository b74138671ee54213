"""What the service has to remember over its own death: references, their axioms, buffers, mounts.

Every change goes into a `Journal` before it is answered. What is written are the axioms that come
and go, not the directives, so that recovery gives the same ontology whatever the reasoner says by
then. Now and then a snapshot takes the place of the records before it. While the journal cannot be
written, as on a full disk, changes wait in memory and are answered all the same.

A journal is a directory with numbered segments, ``journal-<n>.log``, and at most one snapshot in
use, ``snapshot-<n>.log``, which stands for everything before segment n. Each record is a line,
``<crc32> <length> <text>``, with a ``+`` behind the length where the next line belongs to the same
batch; it is on the disk when `Journal.append` returns. A batch that was cut off by a crash is the
last of the last segment; it was never answered for, and is removed when the journal is opened. What
is damaged in any other way is put aside, into ``damaged-<time>-<name>``, and what is whole is kept.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import threading
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

from armor_service.changes import Change, apply_all
from armor_service.protocol import StoreError
from armor_service.quarantine import WHOLE, Quarantine, Told
from armor_service.reference import Buffering, Effort, Origin, Reference, knowledge_base
from owl_reasoner.owl import axioms, expressions
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import Literal

Record = list[Any]
"""``[what, reference name, ...]``."""
CHUNK = 100
"""Axioms in one record of a snapshot."""
COMPACT_FROM = 1 << 20
"""Bytes of journal from which on a snapshot is written, if the last one is not larger."""
MOST_UNTESTED = 100
"""A snapshot waits while at most so many directives are not reasoned over yet. If reasoning over
them ends the process, the journal tells which one to leave out; a snapshot could not."""
CLOSING = 1.0
"""Seconds that closing a store waits for a snapshot in writing."""
RETRY_SECONDS = 1.0
"""Seconds between two attempts to write what waits."""
MOST_WAITING = 200_000
"""Records that wait at most, some 120 MB; further changes are refused."""
_NAME = re.compile(r'(journal|snapshot)-(\d+)\.log\Z')


class Journal:
    """Records on disk.

    Args:
        directory: Where they are; made if it is not there. One process at a time may have it open.

    Raises:
        StoreError: In use by another process, or not readable.

    Attributes:
        notes: One line for each part that was found damaged or missing.
        size: Bytes of the segments since the snapshot.
        snapshot_size: Bytes of the snapshot.
        is_incomplete: Somebody cut the last segment; only a snapshot makes up for it.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.notes: list[str] = []
        try:
            directory.mkdir(parents=True, exist_ok=True)
            self._lock = (directory / 'lock').open('w')
        except OSError as error:
            raise StoreError(f'{directory}: {error.strerror}') from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise StoreError(f'{directory}: in use by another process') from None
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
        missing = [n for n in range(start, segments[-1]) if n not in segments]
        self.notes += [f'{self._path("journal", n)}: is missing' for n in missing]
        parts = [self._path('snapshot', start)] if start else []
        parts += [self._path('journal', number) for number in segments]
        self._found: list[Any] = []
        for path in parts:
            self._found += self._mended(path, last=path == parts[-1])
        self.snapshot_size = self._path('snapshot', start).stat().st_size if start else 0
        sizes = [path.stat().st_size for path in parts if path.exists()]
        self.size = sum(sizes) - self.snapshot_size
        self._begin(segments[-1])
        self._remove_before(start)

    def records(self) -> list[Any]:
        """Hand out what was found when the journal was opened, oldest first; once."""
        found, self._found = self._found, []
        return found

    def append(self, records: Iterable[Any]) -> None:
        """Write records as one: after a crash all of them are there or none.

        Raises:
            StoreError: They could not be written; none of them is there.
        """
        self.check_open()
        size = self._size_in_place()
        *first, last = records
        lines = b''.join([*(_line(record, more=True) for record in first), _line(last)])
        try:
            if size != self._end:
                self._cut()
            rest = memoryview(lines)
            while rest:
                # A disk that is almost full takes a part without an error.
                rest = rest[self._file.write(rest) :]
            os.fdatasync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):
                self._cut()
            raise StoreError(f'{self._directory}: {error.strerror}') from None
        self._end += len(lines)
        self.size += len(lines)

    def begin_snapshot(self) -> int:
        """Start a new segment; a snapshot of the state as it is now may then be written.

        Returns:
            What `finish_snapshot` is to be called with.
        """
        self.check_open()
        self._size_in_place()
        before = self._file
        try:
            self._begin(self._number + 1)
        except OSError as error:
            raise StoreError(f'{self._directory}: {error.strerror}') from None
        before.close()
        self.size = 0
        return self._number

    def finish_snapshot(self, number: int, records: Iterable[Any]) -> None:
        """Write the snapshot and remove what it stands for; records may be appended meanwhile.

        Raises:
            StoreError: It could not be written; the journal goes on without it.
        """
        path = self._path('snapshot', number)
        try:
            temporary = _written(path, records)
            # Another store in this place would lose what is removed below.
            self._size_in_place()
            self.snapshot_size = temporary.stat().st_size
            temporary.rename(path)
            self._sync_directory()
            self._remove_before(number)
        except (OSError, StoreError) as error:
            # It may hold the last space that there was.
            path.with_suffix('.tmp').unlink(missing_ok=True)
            reason = error.strerror if isinstance(error, OSError) else error
            raise StoreError(f'{self._directory}: {reason}') from None

    def close(self) -> None:
        """Let another process open the journal."""
        self._file.close()
        if not self._lock.closed:
            # A process that another thread is just starting holds the lock, too, until it runs.
            fcntl.flock(self._lock, fcntl.LOCK_UN)
            self._lock.close()

    def check_open(self) -> None:
        """Check that records can be appended.

        Raises:
            StoreError: The journal was closed.
        """
        if self._file.closed:
            raise StoreError(f'{self._directory}: closed')

    def _size_in_place(self) -> int:
        """Return how large the segment is that is found where it belongs.

        A file that was removed takes all that is written, in silence.

        Raises:
            StoreError: The folder was removed or renamed, or its disk is no longer there.
        """
        try:
            found = os.stat(self._place)
        except OSError:
            found = None
        if found is None or (found.st_dev, found.st_ino) != self._file_id:
            raise StoreError(f'{self._place}: is no longer there')
        return found.st_size

    def _cut(self) -> None:
        """Remove what a write that failed may have left behind the records.

        Where somebody cut the file, what follows begins a line of its own, and a snapshot is due.
        """
        descriptor = self._file.fileno()
        if os.fstat(descriptor).st_size >= self._end:
            os.ftruncate(descriptor, self._end)
            return
        self.is_incomplete = True
        os.ftruncate(descriptor, self._end - 1)
        self._file.write(b'\n')

    def _path(self, kind: str, number: int) -> Path:
        return self._directory / f'{kind}-{number}.log'

    def _begin(self, number: int) -> None:
        """Append to a segment from now on; raises OSError, and nothing has changed."""
        path = self._path('journal', number)
        file = path.open('ab', buffering=0)
        self._sync_directory()
        found = os.fstat(file.fileno())
        self._file, self._number, self._place = file, number, str(path)
        self._file_id, self._end = (found.st_dev, found.st_ino), found.st_size
        self.is_incomplete = False

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

    def _mended(self, path: Path, *, last: bool) -> list[Any]:
        """Read a part; afterwards it holds whole records only."""
        try:
            contents = _Contents(path.read_bytes(), last=last)
        except FileNotFoundError:
            return []
        except OSError as error:
            raise StoreError(f'{path}: {error.strerror}') from None
        if contents.damage:
            first, count = contents.damage[0], len(contents.damage)
            place = f'{path}: {count} damaged entr{"y" if count == 1 else "ies"}, from byte {first}'
            kept = f'{len(contents.records)} whole ones are kept'
            stamp = time.strftime('%Y%m%d-%H%M%S')
            aside = self._directory / f'damaged-{stamp}-{path.name}'
            try:
                shutil.copyfile(path, aside)
                _written(path, contents.records).rename(path)
                self._sync_directory()
            except OSError as error:
                self.notes.append(f'{place}; {kept}; not put aside: {error.strerror}')
            else:
                self.notes.append(f'{place}, put aside in {aside.name}; {kept}')
        elif contents.end is not None:
            os.truncate(path, contents.end)
        elif contents.unended:
            with path.open('ab') as file:
                file.write(b'\n')
        return contents.records


class _Contents:
    """What a part of a journal holds.

    Args:
        data: The part.
        last: A crash may have cut off its end.

    Attributes:
        records: The whole ones.
        damage: Where each entry that cannot be read begins, bytes.
        end: Where a batch begins that was cut off; None: there is none.
        unended: All that is lacking is the last line's end.
    """

    def __init__(self, data: bytes, *, last: bool) -> None:
        self.records: list[Any] = []
        self.damage: list[int] = []
        self.end: int | None = None
        self.unended = False
        batch: list[Any] = []
        start = begin = 0
        while start < len(data):
            entry = _entry(data, start)
            if entry is not None:
                found, more, start = entry
                batch.append(found)
                if not more:
                    self.records += batch
                    batch, begin = [], start
                continue
            newline = data.find(b'\n', start)
            if newline < 0 and last and _CUT_OFF.fullmatch(data, start):
                self.end = begin
                return
            self.damage.append(start)
            start = newline + 1 if newline >= 0 else len(data)
        self.unended = start > len(data)
        if batch and last and not self.damage:
            self.end = begin
        else:
            self.records += batch


_TO_JSON = json.JSONEncoder(separators=(',', ':'))
_HEAD = re.compile(rb'([0-9a-f]{8}) (\d{1,10})(\+?) ')
_CUT_OFF = re.compile(rb'[0-9a-f]{1,8}|[0-9a-f]{8} (\d{0,10}\+?|\d+\+? [ -~]*)')


def _line(record: Any, *, more: bool = False) -> bytes:
    text = _TO_JSON.encode(record).encode()
    body = b'%d%s %s' % (len(text), b'+' if more else b'', text)
    return b'%08x %s\n' % (zlib.crc32(body), body)


def _written(path: Path, records: Iterable[Any]) -> Path:
    """Write what a part is to hold beside it; renamed, it takes the part's place as a whole."""
    temporary = path.with_suffix('.tmp')
    with temporary.open('wb') as file:
        for record in records:
            file.write(_line(record))
        file.flush()
        os.fsync(file.fileno())
    return temporary


def _entry(data: bytes, start: int) -> tuple[Any, bool, int] | None:
    """Return the record of a line, whether the batch goes on, and where the next line begins."""
    head = _HEAD.match(data, start)
    if head is not None:
        end = head.end() + int(head[2])
        if end <= len(data) and b'%08x' % zlib.crc32(data[start + 9 : end]) == head[1]:
            # Not looked for: the line's end may be what is damaged.
            return json.loads(data[head.end() : end]), bool(head[3]), end + 1
    return None


_RECORDS: dict[str, type] = {
    name: member
    for module in (axioms, expressions)
    for name, member in vars(module).items()
    if isinstance(member, type) and is_dataclass(member) and member is not Literal
} | {change.__name__: change for change in get_args(Change)}
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
        StoreError: The directory cannot be used.

    Attributes:
        directory: Where the journal is.
        notes: One line for each thing that was found damaged.
        warn: Told in one line when something cannot be written, and when it is; set by its user.
    """

    def __init__(self, directory: Path, compact_from: int = COMPACT_FROM) -> None:
        self.directory = directory
        self.warn: Callable[[str], None] = print
        self._journal = Journal(directory)
        self._reasoning = _Reasoning(directory / 'reasoning')
        self.notes = list(self._journal.notes)
        self._compact_from = compact_from
        self._lock = threading.Lock()
        self._batch = threading.local()
        self._snapshot: threading.Thread | None = None
        self._beginning = threading.Lock()
        self._names: set[str] = set()
        self._waiting: list[Record] = []
        self._closed = threading.Event()

    def recover(self) -> list[Reference]:
        """Make the references as they were answered for; what follows is derived by their `open`.

        Raises:
            StoreError: A record that this version does not know.
        """
        recovery = _Recovery()
        for record in self._journal.records():
            try:
                recovery.take(record)
            except (IndexError, TypeError, ValueError) as error:
                raise StoreError(f'record {record!r:.80} cannot be read: {error}') from None
        self._names = set(recovery.references)
        if recovery.orphans:
            self.notes.append(
                f'{self.directory}: {recovery.orphans} changes of references that are not there '
                'were left out'
            )
        for ref in recovery.references.values():
            ref.opened = False
            ref.quarantine.deaths, ref.quarantine.died_at = self._reasoning.left(ref.name)
            self.follow(ref)
        return list(recovery.references.values())

    def follow(self, ref: Reference) -> None:
        """Remember what a reference takes back, and over what it reasons."""

        def on_reasoning(place: int | None) -> None:
            self._reasoning.note(ref.name, place)

        def on_taken_back(lines: list[str], undo: list[Change]) -> None:
            if not ref.dropped:
                self._write(['taken back', ref.name, lines, [encode(change) for change in undo]])

        ref.on_reasoning, ref.on_taken_back = on_reasoning, on_taken_back
        ref.on_completed = partial(self._reasoning.completed, ref.name)

    def loaded(self, ref: Reference) -> None:
        """Remember a new reference."""
        self._write(*_records(*_state(ref)))
        self.follow(ref)

    def dropped(self, name: str) -> None:
        """Forget a reference."""
        self._write(['drop', name])

    def mounted(self, name: str, client: str) -> None:
        """Remember who is mounted."""
        self._write(['mount', name, client])

    def buffered(self, name: str, on: bool) -> None:
        """Remember that buffered manipulation was switched."""
        self._write(['buffer', name, on])

    def changed(self, name: str, told: Told) -> None:
        """Remember changes, applied or queued as the reference is set up."""
        changes = [encode(change) for change in told.changes]
        self._write(['change', name, changes, told.time, told.client])

    def flushed(self, name: str) -> None:
        """Remember that the queue was applied."""
        self._write(['flush', name])

    @contextmanager
    def batch(self) -> Iterator[None]:
        """Make what is written inside durable at the end, all of it or nothing.

        Raises:
            StoreError: At the end: the store was closed meanwhile.
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
        self, hold_all: Callable[[], AbstractContextManager[list[Reference]]]
    ) -> None:
        """Write a snapshot on a thread of its own if the journal has grown.

        Args:
            hold_all: Context manager under which no reference that it gives changes; where it does
                not give all of them, the next change tries again.
        """
        journal = self._journal
        is_small = journal.size < max(self._compact_from, journal.snapshot_size)
        if self._waiting or (is_small and not journal.is_incomplete):
            return

        def write() -> None:
            try:
                with hold_all() as references, self._lock:
                    kept = [ref for ref in references if not ref.dropped]
                    if self._waiting or {ref.name for ref in kept} != self._names:
                        # What waits is in the references already. Or one of them came or went
                        # meanwhile, or is in use. The next change tries again.
                        return
                    if any(0 < len(ref.quarantine.untested) <= MOST_UNTESTED for ref in kept):
                        return
                    if journal.is_incomplete:
                        self.warn(
                            f'{self.directory}: the journal was cut; '
                            'all that is known is written again'
                        )
                    number = journal.begin_snapshot()
                    states = [_state(ref) for ref in kept]
                records = (record for state in states for record in _records(*state))
                journal.finish_snapshot(number, records)
            except StoreError as error:
                self.warn(str(error))

        with self._beginning:
            if self._snapshot is not None and self._snapshot.is_alive():
                return
            self._snapshot = threading.Thread(target=write, name='snapshot', daemon=True)
            self._snapshot.start()

    def close(self) -> None:
        """Let another process open the store.

        A snapshot that is being written has `CLOSING` seconds to end; after that the store stays
        this process's until that dies, and its journal says all.
        """
        self._closed.set()
        if self._snapshot is not None:
            self._snapshot.join(CLOSING)
            if self._snapshot.is_alive():
                return
        with self._lock:
            if not self._written_at_last():
                self.warn(f'{self.directory}: {len(self._waiting)} changes are not kept')
            self._journal.close()
            self._reasoning.close()

    def _write(self, *records: Record) -> None:
        """Make records durable, now or with the batch.

        Raises:
            StoreError: The store was closed, or too much waits to be written.
        """
        self._journal.check_open()
        if len(self._waiting) > MOST_WAITING:
            raise StoreError(f'{self.directory}: {len(self._waiting)} changes wait to be written')
        pending: list[Record] | None = getattr(self._batch, 'records', None)
        if pending is not None:
            pending += records
            return
        self._append(records)

    def _append(self, records: Sequence[Record]) -> None:
        with self._lock:
            self._journal.check_open()
            for what, name, *_ in records:
                if what == 'load':
                    self._names.add(name)
                elif what == 'drop':
                    self._names.discard(name)
            if self._waiting:
                self._waiting += records
                return
            try:
                self._journal.append(records)
            except StoreError as error:
                self._waiting += records
                self.warn(f'{error}: until it can be written, changes are lost at a restart')
                threading.Thread(target=self._catch_up, name='store', daemon=True).start()

    def _catch_up(self) -> None:
        """Write what waits as soon as that is possible."""
        while not self._closed.wait(RETRY_SECONDS):
            with self._lock:
                if self._written_at_last():
                    self.warn(f'{self.directory}: can be written again, every change is kept')
                    return

    def _written_at_last(self) -> bool:
        """Write what waits, as one; tell whether nothing waits any more."""
        if self._waiting:
            try:
                self._journal.append(self._waiting)
            except StoreError:
                return False
            self._waiting = []
        return True


_State = tuple[str, dict[str, Any], list[Axiom], list[Told]]


def _state(ref: Reference) -> _State:
    settings = {
        'iri': ref.kb.iri,
        'path': ref.origin.path,
        'format': ref.origin.format,
        'prefixes': dict(ref.origin.prefixes),
        'buffered_manipulation': ref.buffering.manipulation,
        'buffered_reasoner': ref.buffering.reasoner,
        'mounted': ref.mounted,
        'base': ref.effort.base,
        'quarantine': list(ref.quarantine.lines),
    }
    return ref.name, settings, list(ref.kb.axioms()), list(ref.buffering.waiting)


def _records(
    name: str,
    settings: dict[str, Any],
    axioms: list[Axiom],
    waiting: list[Told],
) -> Iterator[Record]:
    """Return the records of a reference: short ones, since damage costs a whole record."""
    queue = [[[encode(change) for change in t.changes], t.time, t.client] for t in waiting]
    yield ['load', name, settings, [], queue]
    for start in range(0, len(axioms), CHUNK):
        yield ['axioms', name, [encode(axiom) for axiom in axioms[start : start + CHUNK]]]
    # Once more, should damage have hit the first.
    yield ['loaded', name, settings]


_KINDS = frozenset({'axioms', 'mount', 'change', 'flush', 'buffer', 'taken back', 'past'})
"""Kinds of records; 'past' is of stores of before, and says nothing of what is asserted now."""


class _Recovery:
    """Makes references from records.

    Attributes:
        references: Those that there are, by name.
        orphans: Records of references that are not there.
    """

    def __init__(self) -> None:
        self.references: dict[str, Reference] = {}
        self.orphans = 0
        self._early: dict[str, list[Axiom]] = {}

    def take(self, record: Record) -> None:
        what, name, *rest = record
        if what == 'load':
            settings, axioms, queue = rest
            self._load(name, settings, [decode(axiom) for axiom in axioms])
            self.references[name].buffering.waiting = [_told(*parts) for parts in queue]
            return
        if what == 'loaded':
            if name not in self.references:
                self._load(name, rest[0], self._early.pop(name, []))
            return
        if what == 'drop':
            self.references.pop(name, None)
            return
        ref = self.references.get(name)
        if what not in _KINDS:
            raise ValueError(f'unknown kind {what!r}')
        if what == 'axioms':
            added = [decode(axiom) for axiom in rest[0]]
            if ref is None:
                self._early.setdefault(name, []).extend(added)
            else:
                ref.kb.change(added)
        elif ref is None:
            self.orphans += 1
        elif what == 'mount':
            ref.mounted = rest[0]
        elif what == 'change':
            told = _told(*rest)
            if ref.buffering.manipulation:
                ref.buffering.waiting.append(told)
            else:
                self._apply(ref, [told])
        elif what == 'taken back':
            ref.quarantine.lines += rest[0]
            apply_all(ref.kb, [decode(change) for change in rest[1]])
            # What is left was reasoned over.
            ref.quarantine.untested.clear()
            ref.quarantine.origin = tuple(ref.kb.axioms())
        elif what == 'flush':
            self._flush(ref)
        elif what == 'buffer':
            ref.buffering.manipulation = rest[0]
            if not rest[0]:
                self._flush(ref)

    def _load(self, name: str, settings: dict[str, Any], axioms: list[Axiom]) -> None:
        try:
            self.references[name] = Reference(
                name,
                knowledge_base(settings['iri'], axioms),
                Origin(
                    settings['path'],
                    settings['format'],
                    settings['prefixes'],
                ),
                Buffering(settings['buffered_manipulation'], settings['buffered_reasoner']),
                settings['mounted'],
                Quarantine(lines=list(settings.get('quarantine', ()))),
                Effort(base=settings.get('base', 0.0)),
            )
        except KeyError as error:
            raise ValueError(f'no setting {error}') from None

    def _flush(self, ref: Reference) -> None:
        waiting, ref.buffering.waiting = ref.buffering.waiting, []
        self._apply(ref, waiting)

    def _apply(self, ref: Reference, told: list[Told]) -> None:
        if not ref.quarantine.untested:
            ref.quarantine.origin = tuple(ref.kb.axioms())
        ref.quarantine.untested += told
        for one in told:
            apply_all(ref.kb, one.changes)


def _told(changes: list[Any], time: float = 0.0, client: str = '') -> Told:
    return Told(client, time, tuple(decode(change) for change in changes))


class _Reasoning:
    """A file that says over what the process reasons, so that the next one knows what ended it.

    It is not synced: it outlives the process, not the machine.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._running: dict[str, list[int]] = {}
        self._left: dict[str, list[int]] = {}
        with suppress(OSError, ValueError):
            found = json.loads(path.read_bytes())
            self._left = {str(name): [int(n) for n in value] for name, value in found.items()}
        self._file = path.open('wb', buffering=0)
        self._write()

    def left(self, name: str) -> tuple[int, int]:
        """Return how often processes ended while they reasoned over a reference, and where."""
        deaths, place = self._left.get(name, (0, WHOLE))
        return deaths, place

    def note(self, name: str, place: int | None) -> None:
        """Note over what is reasoned; None: no more."""
        with self._lock:
            deaths = self._left.get(name, (0,))[0]
            if place is None:
                self._running.pop(name, None)
            else:
                self._running[name] = [deaths + 1, place]
            self._write()

    def completed(self, name: str) -> None:
        """Forget the ends of before."""
        self._left.pop(name, None)

    def close(self) -> None:
        """Leave an empty file."""
        with self._lock:
            self._running, self._left = {}, {}
            self._write()
            self._file.close()

    def _write(self) -> None:
        # Those that were not opened yet are to be known to the next process as well.
        text = _TO_JSON.encode({**self._left, **self._running}).encode()
        with suppress(OSError, ValueError):
            # Full, or closed while one still reasons.
            os.pwrite(self._file.fileno(), text, 0)
            os.ftruncate(self._file.fileno(), len(text))
