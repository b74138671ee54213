"""What happened on a run: a log for each robot, to which whoever owns a fact appends its line.

The behaviour writes visits and decisions, the launcher restarts, the observer what it found, the
node `alarm` incidents and parameters. Each of them appends its own lines:

    log = EventLog(folder / RECORD)
    log.write('restart', node='observer', why='killed by SIGKILL')

A line is a JSON object. It holds ``event`` (one of :data:`KINDS`), ``time`` (seconds on the
mission's clock, which is that of a simulation where there is one), ``at`` (seconds since 1970),
``steady`` (seconds since the machine was started, which no setting of a clock changes) and the
kind's own fields::

    {"event": "visit", "time": 9.4, "at": 1767222009.4, "steady": 811.2, "place": "C1",
     "distance": 5.4}

Several processes append rather than one that hears of everything on topics: a line goes to the
operating system in one piece before its owner goes on, so that a process that is killed, the
owner's or any other, loses nothing of what was known. A lock of the file keeps lines whole: who
holds it may cut off a torn line or pack the file away. It is never waited for long. A machine that
loses power loses at most the line that it was writing.

The log of a month stays small to read: a file that has grown is packed as ``FILE.0001.gz``,
``FILE.0002.gz``, ..., and the new one begins with a ``snapshot`` of all that was counted
(`EventLog.begin_segment`). `read` takes the last file only; `read_all` gives every entry.

A disk that is full costs nothing for a long while: so much of it is taken beforehand (`RESERVE`).
After that what happens waits in memory, and the log says so in a ``gap``: where the process ends
before there is space, a reader knows from when to when something is missing (`gaps`).

A reader passes over kinds that it does not know, and counts them: they are of a later version.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import glob
import gzip
import json
import math
import os
import secrets
import shutil
import struct
import threading
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from strict_files import regular_files as files
from strict_files.files import FileError, read_file
from strict_files.regular_files import parse_json


@dataclass(frozen=True)
class Section:
    """How a report lists the entries of a kind.

    Attributes:
        title: Of the list.
        columns: The fields that it shows, the last one in words.
        is_open: Whether the list is unfolded.
    """

    title: str
    columns: tuple[str, ...]
    is_open: bool = False


@dataclass(frozen=True)
class EntryKind:
    """One kind of entry.

    Attributes:
        fields: Those that each entry has.
        numbers: Which of them are numbers, metres or seconds.
        is_of_mission: Whether the behaviour writes it, so that the mission's clock and what is
            counted of the mission follow from it.
        section: How a report lists it; None: it tells of it in another way, or not at all.
        words: The fields that say in one line what happened, the first as its subject; none: it is
            not told in the time line of a fleet.
        mark: What a replay calls it that can jump to it; empty: it cannot.
    """

    fields: tuple[str, ...]
    numbers: frozenset[str] = frozenset()
    is_of_mission: bool = True
    section: Section | None = None
    words: tuple[str, ...] = ()
    mark: str = ''


KINDS: Mapping[str, EntryKind] = {
    'start': EntryKind(('machine', 'place', 'places')),
    'map': EntryKind(('places',)),
    'exploring': EntryKind(('place', 'seconds'), frozenset({'seconds'})),
    'viewpoint': EntryKind(('place', 'point')),
    'look': EntryKind(('place', 'sides', 'left_out')),
    'sweep': EntryKind(
        ('place', 'seconds', 'distance', 'covered', 'stops', 'left_out'),
        frozenset({'seconds', 'distance'}),
        section=Section('Sweeps', ('seconds', 'distance', 'covered', 'place')),
    ),
    'verify': EntryKind(('place', 'number', 'found')),
    'recharge': EntryKind(
        ('place', 'seconds'),
        frozenset({'seconds'}),
        section=Section('Recharges', ('place', 'seconds'), is_open=True),
        words=('place', 'seconds'),
        mark='recharge',
    ),
    'failure': EntryKind(
        ('what', 'reason'),
        section=Section('Failures', ('what', 'reason'), is_open=True),
        words=('what', 'reason'),
        mark='failure',
    ),
    'decision': EntryKind(
        ('place', 'rule', 'reason'),
        section=Section('Decisions', ('place', 'rule', 'reason')),
        words=('place', 'rule', 'reason'),
        mark='decision',
    ),
    'visit': EntryKind(
        ('place', 'distance'),
        frozenset({'distance'}),
        section=Section('Visits', ('place', 'distance')),
        words=('place',),
    ),
    'idleness_bounds': EntryKind(('places',)),
    'end': EntryKind(()),
    'snapshot': EntryKind(('account',)),
    'incident': EntryKind(
        ('id', 'phase', 'node', 'kind', 'name', 'severity', 'text'),
        is_of_mission=False,
        mark='incident',
    ),
    'finding': EntryKind(
        ('number', 'kind', 'seen', 'place', 'state', 'severity'), is_of_mission=False
    ),
    'answer': EntryKind(
        ('line', 'answer'), is_of_mission=False, section=Section('Answers', ('line', 'answer'))
    ),
    'handling': EntryKind(
        ('id', 'verb', 'by', 'text'),
        is_of_mission=False,
        section=Section('What people did about alarms', ('verb', 'by', 'text')),
    ),
    'press': EntryKind(
        ('by', 'role', 'action', 'answer'),
        is_of_mission=False,
        section=Section('Pressed on the page', ('by', 'role', 'action', 'answer')),
    ),
    'restart': EntryKind(
        ('node', 'why'), is_of_mission=False, section=Section('Restarts', ('node', 'why'))
    ),
    'gap': EntryKind(('phase', 'why'), is_of_mission=False),
    'parameter': EntryKind(
        ('node', 'name', 'value'),
        is_of_mission=False,
        section=Section('Parameters changed', ('node', 'name', 'value')),
    ),
}
"""Every kind of entry. A new one is an entry here: the check of its fields, the lists of the
report, the time line of a fleet and the marks of a replay follow from it."""

RECORD, OLD_RECORD = 'events.jsonl', 'mission.jsonl'
"""The log in the folder of a robot's run, and how it was called when it was the mission's alone."""
MARKS = tuple(kind.mark for kind in KINDS.values() if kind.mark)
"""What a replay can jump to."""
SEGMENT_BYTES = 4_000_000
"""Size from which on a log's file is packed away and a new one begun."""
MOST_WAITING = 4_000_000
"""Bytes of entries that wait until the disk takes more; of more than these the newest."""
RESERVE = 131_072
"""Bytes of the disk that are taken beyond a log's end, so that it goes on when the disk is full."""
LAST_WORDS = 1000
"""Bytes of these that are left for the line that says that nothing more is written."""
LARGEST = 1_000_000_000
"""Bytes of a log's file that are read at most."""
LOCK_PATIENCE = 0.5
"""How long another process that writes is waited for, seconds; after that the entry waits."""
A_DATE = 1e9
"""From here on, in seconds, a time is a date of a machine's clock; a simulation counts from 0."""
SAME_CLOCK = 60.0
"""A mission's time is the machine's where it differs by less from it, seconds; else a simulation
counts it, whose clock no machine sets."""
LEAST_STEP = 0.5
"""A clock that differs from the steady one by less was not set, seconds: it is slewed, or the two
were read apart."""


@dataclass(frozen=True)
class RecordEntry:
    """One line of a log.

    Attributes:
        name: One of :data:`KINDS`.
        time: Seconds on the mission's clock.
        fields: The entry's own fields.
        at: Seconds since 1970; None: an old log does not say.
        steady: Seconds since the machine was started; None: not known.
        boot: Which start of the machine that is; empty: that of the line before.
    """

    name: str
    time: float
    fields: Mapping[str, object]
    at: float | None = None
    steady: float | None = None
    boot: str = ''

    @property
    def kind(self) -> EntryKind:
        """What is known of entries like this."""
        return KINDS[self.name]

    def text(self, key: str) -> str:
        """Return the field ``key`` as text."""
        return str(self.fields[key])

    def number(self, key: str) -> float:
        """Return the field ``key`` as a number."""
        return float(str(self.fields[key]))

    def names(self, key: str) -> tuple[str, ...]:
        """Return the field ``key`` as a sequence of names."""
        value = self.fields[key]
        return tuple(str(name) for name in value) if isinstance(value, list) else ()


# --- writing ---


def steady_now() -> float:
    """Return the seconds since the machine was started, those that it slept included."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class Clocks(NamedTuple):
    """What tells the time of an entry.

    Attributes:
        wall: Returns the seconds since 1970.
        steady: Returns the seconds since the machine was started.
    """

    wall: Callable[[], float] = time.time
    steady: Callable[[], float] = steady_now


CLOCKS = Clocks()


class EventLog:
    """Appends entries to a log that other processes append to as well; safe from any thread.

    Args:
        path: The file; made with its folder when missing, continued when it exists.
        clocks: Those of the machine.

    Attributes:
        path: The file.

    Raises:
        FileError: The file cannot be opened for writing.
    """

    def __init__(self, path: str | Path, clocks: Clocks = CLOCKS) -> None:
        self.path = Path(path)
        self._clocks = clocks
        self._lock = threading.Lock()
        self._waiting, self._lost = b'', ''
        self._next = self.path.with_name(self.path.name + '.next')
        self._descriptor = -1
        self._boot = _boot()
        self._can_reserve = True
        self._has_told_of_gap = False
        # Others append to the same file: whose gap it is.
        self._writer = secrets.token_hex(4)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            files.file_to_write(self.path)
            if self._next.exists() and not self.path.exists():
                # A writer was killed between the two steps of a change of files.
                os.replace(self._next, self.path)
            with self._locked():
                pass
        except OSError as error:
            # What passes, another process that holds the file or a full disk, is no reason to end:
            # the entries wait.
            if error.errno not in (errno.EAGAIN, errno.ENOSPC, errno.EDQUOT):
                problem = f'cannot write the mission record {path}: {error.strerror}'
                raise FileError(problem) from None

    def write(self, name: str, time: float | None = None, /, **fields: object) -> RecordEntry:
        """Append one entry, after those that the disk did not take before.

        Args:
            name: One of :data:`KINDS`.
            time: Seconds on the mission's clock; None: who writes has none, and a reader takes that
                of the line before.
            fields: The entry's own fields; those of :data:`KINDS` are required.

        Returns:
            The entry, as it is read back.

        Raises:
            FileError: Unknown kind, a required field is missing, or the file takes no more: then
                the entry waits for the next one.
        """
        entry = self.entry(name, time, **fields)
        self.append(entry)
        return entry

    def entry(self, name: str, at: float | None = None, /, **fields: object) -> RecordEntry:
        """Return an entry of now, which is not written; see `write`."""
        check(name, fields, f'{self.path}')
        stamp = math.nan if at is None else round(at, 3)
        plain = json.loads(json.dumps(fields))
        at, steady = self._clocks.wall(), self._clocks.steady()
        return RecordEntry(name, stamp, plain, round(at, 3), round(steady, 3))

    def append(self, entry: RecordEntry) -> int:
        """Append an entry as it is; return the size of the file.

        Raises:
            FileError: The file takes no more; the entry waits for the next one.
        """
        with self._lock:
            if self._boot:
                entry, self._boot = replace(entry, boot=self._boot), ''
            # A process that holds the file still is not waited for anew with each entry.
            patience = 0.0 if self._waiting else LOCK_PATIENCE
            self._waiting += line_of(entry)
            return self._write_waiting(patience)

    def _write_waiting(self, patience: float) -> int:
        lines = self._waiting
        if self._has_told_of_gap:
            why = 'some of what waited is lost' if self._lost else 'what waited is written'
            end = self.entry(
                'gap', phase='end', why=why, lost=bool(self._lost), writer=self._writer
            )
            lines += line_of(end)
        try:
            size = self._append(lines, patience)
        except OSError as error:
            if len(self._waiting) > MOST_WAITING:
                self._waiting = self._waiting[-MOST_WAITING:].partition(b'\n')[2]
                self._lost = '; the oldest events that waited for it are lost'
            raise FileError(
                f'cannot write the mission record {self.path}: {error.strerror}{self._lost}'
            ) from None
        self._waiting, self._lost, self._has_told_of_gap = b'', '', False
        return size

    def _append(self, lines: bytes, patience: float) -> int:
        with self._locked(patience) as descriptor:
            if not self._reserve(descriptor):
                self._expect_room(descriptor, len(lines))
            written = os.write(descriptor, lines)
            size = os.fstat(descriptor).st_size
            if written != len(lines):
                # Nobody has written behind it: the lock is held.
                os.ftruncate(descriptor, size - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return size

    def _reserve(self, descriptor: int) -> bool:
        """Take more of the disk beyond the log's end; return whether that is possible, or useless.

        Where it is not, there is still what was taken before.
        """
        # Looked at each time: the file is another one now, or somebody has cut it short.
        status = os.fstat(descriptor)
        if not self._can_reserve or 512 * status.st_blocks - status.st_size >= RESERVE / 2:
            return True
        try:
            allocate(descriptor, status.st_size, RESERVE)
        except OSError as error:
            if error.errno in (errno.ENOSPC, errno.EDQUOT):
                return False
            self._can_reserve = False  # no such thing on this file system
        return True

    def _expect_room(self, descriptor: int, wanted: int) -> None:
        """Make sure that a full disk has room for what is to be written, and for the last words.

        Raises:
            OSError: It has not; the log says so, where it can.
        """
        status = os.fstat(descriptor)
        left = 512 * status.st_blocks - status.st_size
        if left >= wanted + LAST_WORDS:
            return
        full = os.strerror(errno.ENOSPC)
        if not self._has_told_of_gap:
            begin = self.entry('gap', phase='begin', why=full, writer=self._writer)
            line = line_of(begin)
            with contextlib.suppress(OSError):
                if left >= len(line) and os.write(descriptor, line) == len(line):
                    self._has_told_of_gap = True
        raise OSError(errno.ENOSPC, full)

    @contextmanager
    def _locked(self, patience: float = LOCK_PATIENCE) -> Iterator[int]:
        """Give the file, which nobody else changes meanwhile and which ends with a whole line.

        Args:
            patience: How long another process that holds it is waited for, seconds.

        Raises:
            OSError: It cannot be opened, or another process holds it for too long.
        """
        until = time.monotonic() + patience
        while True:
            if self._descriptor < 0:
                flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
                self._descriptor = os.open(self.path, flags, 0o644)
            descriptor = self._descriptor
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() >= until:
                    raise
                time.sleep(0.001)
                continue
            if self._is_current(descriptor):
                break
            self._close_file()  # it was packed away meanwhile
        try:
            _end_whole(descriptor)
            yield descriptor
        finally:
            fcntl.flock(descriptor, fcntl.LOCK_UN)

    def _is_current(self, descriptor: int) -> bool:
        try:
            there = os.stat(self.path)
        except FileNotFoundError:
            return False
        return os.path.samestat(there, os.fstat(descriptor))

    def begin_segment(self, first: RecordEntry) -> None:
        """Pack the file away and begin a new one; if that cannot be done now, it is done later.

        Args:
            first: What the new file begins with: a snapshot of all that was counted.
        """
        number = 1 + len(segments(self.path))
        packed = self.path.with_name(f'{self.path.name}.{number:04}.gz')
        with self._lock:
            try:
                with self._locked():
                    with open(self.path, 'rb') as old, gzip.open(packed, 'wb', 6) as new:
                        shutil.copyfileobj(old, new)
                    boot = replace(first, boot=_boot())
                    self._next.write_bytes(line_of(boot))
                    os.replace(self._next, self.path)
            except OSError:
                packed.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file, with what still waits for it where it takes that now."""
        with self._lock:
            if self._waiting:
                with contextlib.suppress(FileError):
                    self._write_waiting(LOCK_PATIENCE)
            self._close_file()

    def _close_file(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def __enter__(self) -> EventLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def allocate(descriptor: int, begin: int, length: int) -> None:
    """Take so many bytes of the disk for a file, whose size stays (fallocate(2)).

    Raises:
        OSError: The disk is full, or the file system has no such thing.
    """
    if _LIBC.fallocate(descriptor, _KEEP_SIZE, begin, length):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


_KEEP_SIZE = 1
_LIBC = ctypes.CDLL(None, use_errno=True)
_LIBC.fallocate.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]


def _end_whole(descriptor: int) -> None:
    """Cut off a torn last line, which a machine that lost power left."""
    size = os.fstat(descriptor).st_size
    if not size or os.pread(descriptor, 1, size - 1) == b'\n':
        return
    end = size
    while end > 0:
        begin = max(0, end - 65536)
        found = os.pread(descriptor, end - begin, begin).rfind(b'\n')
        if found >= 0:
            os.ftruncate(descriptor, begin + found + 1)
            return
        end = begin
    os.ftruncate(descriptor, 0)


def line_of(entry: RecordEntry) -> bytes:
    """Return an entry as a line of a log."""
    values: dict[str, object] = {'event': entry.name}
    if not math.isnan(entry.time):
        values['time'] = entry.time
    if entry.at is not None:
        values['at'] = entry.at
    if entry.steady is not None:
        values['steady'] = entry.steady
    if entry.boot:
        values['boot'] = entry.boot
    return (json.dumps({**values, **entry.fields}) + '\n').encode()


def _boot() -> str:
    """Return which start of the machine this is; what is steady is so until the next one."""
    try:
        return Path('/proc/sys/kernel/random/boot_id').read_text('ascii').strip()[:8]
    except OSError:
        return 'unknown'


# --- reading ---


def record_in(folder: Path) -> Path:
    """Return the log of a robot's run; a run of an earlier version goes on with the one it has."""
    old = folder / OLD_RECORD
    return old if old.is_file() and not (folder / RECORD).exists() else folder / RECORD


def check(name: str, fields: Mapping[str, object], where: str) -> None:
    """Make sure that an entry has what its kind requires.

    Raises:
        FileError: One line that says what is wrong.
    """
    kind = KINDS.get(name)
    if kind is None:
        raise FileError(f'{where}: unknown event {name!r}, expected one of {", ".join(KINDS)}')
    missing = [key for key in kind.fields if key not in fields]
    if missing:
        raise FileError(f'{where}: event {name!r} lacks {", ".join(missing)}')
    for key in kind.numbers:
        try:
            found = math.isfinite(float(str(fields[key])))
        except ValueError:
            found = False
        if not found:
            shown = str(fields[key])[:40]
            raise FileError(f'{where}: event {name!r}: {key} is {shown!r}, expected a number')


@dataclass
class UnreadLines:
    """What of a log was not read.

    Attributes:
        unknown: How many lines of which kind are of a later version.
        damaged: One line about each finished line that is no entry, and each file that cannot be
            unpacked, with its name.
    """

    unknown: Counter[str] = field(default_factory=Counter)
    damaged: list[str] = field(default_factory=list)

    def words(self) -> str:
        """Return it in one line; empty: nothing was left out."""
        parts = []
        if self.damaged:
            more = f' and {len(self.damaged) - 1} more' if len(self.damaged) > 1 else ''
            parts.append(f'{self.damaged[0]}{more}: left out')
        if self.unknown:
            kinds = ', '.join(f'{name} {count}' for name, count in sorted(self.unknown.items()))
            total = sum(self.unknown.values())
            lines = '1 line' if total == 1 else f'{total} lines'
            parts.append(
                f'{lines} of the record passed over, which this version does not know: {kinds}'
            )
        return '; '.join(parts)


def read(path: str | Path, left_out: UnreadLines | None = None) -> list[RecordEntry]:
    """Read the last file of a log, without an unfinished last line.

    A line that is damaged costs none of the others: a mission goes on with what is left.

    Args:
        path: The file.
        left_out: Gets what is not read.

    Raises:
        FileError: The file cannot be read.
    """
    found = _last_file(path, left_out)
    packed = segments(Path(path))
    if packed and not any(entry.name == 'snapshot' for entry in found[:1]):
        # What was counted until then is damaged: it is counted again.
        found = [*_unpacked(packed, left_out), *found]
    return found


def _last_file(path: str | Path, left_out: UnreadLines | None) -> list[RecordEntry]:
    try:
        content = read_file(Path(path), LARGEST)
    except FileError as error:
        raise FileError(f'cannot read the mission record {error}') from None
    return list(entries_of(content, f'{path}', left_out))


def read_all(path: str | Path, left_out: UnreadLines | None = None) -> Iterator[RecordEntry]:
    """Give every entry of a log, those that were packed away too, one file at a time.

    Raises:
        FileError: Its last file cannot be read.
    """
    yield from _unpacked(segments(Path(path)), left_out)
    yield from (each for each in _last_file(path, left_out) if each.name != 'snapshot')


def read_newest(path: str | Path, packed: int | None = None) -> Iterator[RecordEntry]:
    """Give the newest entries of a log, nothing where its last file cannot be read.

    Args:
        path: The file.
        packed: How many of the files that were packed away are read as well; None: all.
    """
    older = segments(Path(path))
    yield from _unpacked(older if packed is None else older[max(0, len(older) - packed) :], None)
    with contextlib.suppress(FileError):
        yield from (each for each in _last_file(path, None) if each.name != 'snapshot')


def _unpacked(files: Sequence[Path], left_out: UnreadLines | None) -> Iterator[RecordEntry]:
    for packed in files:
        try:
            with gzip.open(packed) as file:
                content = file.read(LARGEST)
        except (OSError, EOFError, zlib.error, struct.error) as error:
            if left_out is not None:
                left_out.damaged.append(f'{packed}: cannot be unpacked: {error}')
            continue
        for entry in entries_of(content, f'{packed}', left_out):
            if entry.name != 'snapshot':
                yield entry


def segments(path: Path) -> list[Path]:
    """Return the files of a log that were packed away, the oldest first."""
    return sorted(path.parent.glob(glob.escape(path.name) + '.[0-9][0-9][0-9][0-9]*.gz'))


def entries_of(
    content: bytes, where: str, left_out: UnreadLines | None = None
) -> Iterator[RecordEntry]:
    """Give the entries of a file's content, see `read`.

    Args:
        content: Of the file.
        where: How the file is called.
        left_out: See `read`.
    """
    before, boot = 0.0, ''
    for number, line in enumerate(content.split(b'\n')[:-1], start=1):
        if not line.strip():
            continue
        try:
            entry = _entry_of(line, f'{where}:{number}', before, left_out)
        except FileError as error:
            if left_out is not None:
                left_out.damaged.append(str(error))
            continue
        if entry is not None:
            before, boot = entry.time, entry.boot or boot
            yield replace(entry, boot=boot) if boot else entry


def _entry_of(
    line: bytes, where: str, before: float, left_out: UnreadLines | None
) -> RecordEntry | None:
    try:
        values = parse_json(line)
        name = values.pop('event')
        if not isinstance(name, str):
            raise ValueError
        time = _seconds(values.pop('time', before))
        at, steady = values.pop('at', None), values.pop('steady', None)
        at, steady = (None if each is None else _seconds(each) for each in (at, steady))
        boot = str(values.pop('boot', ''))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError):
        shown = line.decode(errors='replace')[:60]
        raise FileError(
            f'{where}: expected a JSON object with event and time, got {shown!r}'
        ) from None
    kind = KINDS.get(name)
    try:
        if kind is not None:
            check(name, values, where)
    except FileError:
        # A later version may have other fields; what the mission is gone on with has these.
        if kind is None or kind.is_of_mission:
            raise
        kind = None
    if kind is None:
        if left_out is not None:
            left_out.unknown[name] += 1
        return None
    return RecordEntry(name, time, values, at, steady, boot)


def _seconds(value: object) -> float:
    seconds = float(value)  # type: ignore[arg-type]  # whatever it is: a TypeError is caught
    if not math.isfinite(seconds):
        raise ValueError
    return seconds


def of_mission(entries: Iterable[RecordEntry]) -> Iterator[RecordEntry]:
    """Give the entries that the behaviour wrote."""
    return (entry for entry in entries if entry.kind.is_of_mission)


class MissingTime(NamedTuple):
    """A time of which something is missing in a log.

    Attributes:
        begin, end: Of the entries around it, seconds on the mission's clock.
    """

    begin: float
    end: float


def gaps(entries: Iterable[RecordEntry]) -> list[MissingTime]:
    """Return the times of which something is missing, since the disk was full."""
    found: list[MissingTime] = []
    # Of each writer that has not ended its own: where it began, and the start of a mission since.
    open_ones: dict[str, tuple[float, float | None]] = {}
    last = 0.0
    for entry in entries:
        last = entry.time
        if entry.name == 'start':
            open_ones = {
                writer: (begin, entry.time if end is None else end)
                for writer, (begin, end) in open_ones.items()
            }
        if entry.name != 'gap':
            continue
        writer = str(entry.fields.get('writer', ''))
        if entry.text('phase') != 'end':
            open_ones.setdefault(writer, (entry.time, None))
        elif writer in open_ones:
            begin, _ = open_ones.pop(writer)
            if entry.fields.get('lost'):
                found.append(MissingTime(begin, entry.time))
    # Whoever wrote these ended before there was space.
    found += [MissingTime(begin, last if end is None else end) for begin, end in open_ones.values()]
    return sorted(found)


# --- clocks ---


def age(entry: RecordEntry, clocks: Clocks = CLOCKS) -> float:
    """Return how long ago an entry was written, seconds; 0 where that is not known."""
    if entry.steady is not None and entry.boot == _boot():
        return max(0.0, clocks.steady() - entry.steady)
    return max(0.0, clocks.wall() - entry.at) if entry.at is not None else 0.0


def clock_step(before: RecordEntry, after: RecordEntry) -> float:
    """Return by how much the mission's clock was set between two entries, seconds; 0: it was not.

    Of a machine's clock the steady one says by how much, as long as the machine was not started
    anew in between. Without it, a clock that has gone back was set by that much.
    """
    passed = after.time - before.time
    if min(before.time, after.time) < A_DATE:
        return 0.0
    if before.boot != after.boot or not _is_of_machine(before) or not _is_of_machine(after):
        return min(0.0, passed)
    assert before.steady is not None
    assert after.steady is not None
    step = passed - max(0.0, after.steady - before.steady)
    return step if abs(step) >= LEAST_STEP else 0.0


def _is_of_machine(entry: RecordEntry) -> bool:
    """Tell whether an entry's time is that of the machine, and its steady one is known."""
    if entry.steady is None or entry.at is None:
        return False
    return abs(entry.time - entry.at) < SAME_CLOCK


def on_one_clock(entries: Iterable[RecordEntry]) -> list[RecordEntry]:
    """Return entries with their times as if the mission's clock had never been set.

    So that what lies between two of them is how long it took. All are on the clock of the last one.
    """
    found = list(entries)
    steps, before, total = [], None, 0.0
    for entry in found:
        if entry.kind.is_of_mission:
            total += 0.0 if before is None else clock_step(before, entry)
            before = entry
        steps.append(total)
    return [
        replace(entry, time=entry.time + total - step) if total != step else entry
        for entry, step in zip(found, steps, strict=True)
    ]
