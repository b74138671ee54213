"""An append-only log of JSON records that survives being killed at any moment.

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
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

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
