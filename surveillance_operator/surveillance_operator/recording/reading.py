"""Reading recordings, also those that other programs wrote: topics, messages in order, at a moment.

To find a message one needs to know where the parts of a file lie and which time each covers. A
file's summary tells that; where a killed writer left none, the heads of the file's records do. Only
that is read of a file, and only as far as it is needed: the library `mcap` parses a summary whole,
which takes seconds for a long recording.
"""

from __future__ import annotations

import bisect
import contextlib
import heapq
import mmap
import struct
import threading
from collections.abc import Collection, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import get_chunk_data_stream

from strict_files.files import FileError
from surveillance_operator.recording.bag import ENCODING, MAGIC

SUFFIX = '.mcap'
FIRST_SPANS = 20
"""So many chunks tell of the topics that a recording begins with."""
RUN_BYTES = 1_000_000
"""Messages outside of chunks are taken together up to this size."""
_HEAD, _TIMES = struct.Struct('<BQ'), struct.Struct('<QQ')
_MESSAGE, _CHUNK_INDEX = struct.Struct('<HIQQ'), struct.Struct('<QQQQ')
_SUMMARY_START = struct.Struct('<Q')
_LEAST_BYTES = {
    Opcode.MESSAGE: _MESSAGE.size,
    Opcode.CHUNK: _TIMES.size,
    Opcode.CHUNK_INDEX: _CHUNK_INDEX.size,
}
_FOOTER_BYTES = 20
"""Of the footer's fields: where the summary starts and its offsets, and a checksum."""

Stored = tuple[str, int, bytes]
"""A message: its topic, when it was received (nanoseconds since 1970), itself as serialised."""


def files_of(recording: Path) -> list[Path]:
    """Return the MCAP files of a recording: its folder's, or itself.

    Raises:
        FileError: There is none.
    """
    files = sorted(recording.glob(f'*{SUFFIX}')) if recording.is_dir() else [recording]
    if not files or files[0].suffix != SUFFIX or not files[0].is_file():
        raise FileError(
            f'{recording}: expected a file *{SUFFIX}, or a folder that holds some '
            f'(`ros2 bag convert` makes one of a *.db3)'
        )
    return files


class _Span(NamedTuple):
    """A chunk, or a run of messages outside of chunks: its times, and the file's bytes."""

    start: int
    end: int
    offset: int
    size: int


class _RecordedFile:
    """One file: where its messages lie, found out as far as somebody needs it.

    Args:
        path: The file, whole or torn.

    Attributes:
        size: Its bytes.
        spans: What is known so far, in the file's order.
        types: Of the topics that are known so far; only of those with messages as ROS 2 has them.
        is_known: Whether that is all.

    Raises:
        FileError: It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        try:
            with open(path, 'rb') as file:
                self._bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise FileError(f'{path}: cannot be read: {error}') from None
        if self._bytes[: len(MAGIC)] != MAGIC:
            raise FileError(f'{path}: cannot be read: this is no MCAP file')
        self.size = len(self._bytes)
        self.spans: list[_Span] = []
        self.types: dict[str, str] = {}
        self.is_known = False
        self._ends: list[int] = []
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, str] = {}
        self._walk = self._find()

    def find_next(self) -> bool:
        """Find the next span; tell whether there is one."""
        self.is_known = next(self._walk, None) is None
        return not self.is_known

    def between(self, start: int, end: int) -> list[_Span]:
        """Return the spans with messages from a time on, before another one."""
        while not self.is_known and (not self.spans or self.spans[-1].start < end):
            self.find_next()
        first = bisect.bisect_left(self._ends, start)
        return [each for each in self.spans[first:] if each.start < end and each.end >= start]

    def messages(self, span: _Span, topics: Collection[str] | None) -> list[Stored]:
        """Return what a span holds of some topics, or of all; nothing of one that is damaged."""
        data = self._content(span)
        found = []
        for opcode, start, end in _records(data, 0):
            self._learn(opcode, data, start, end)
            if opcode == Opcode.MESSAGE:
                channel, _, at, _ = _MESSAGE.unpack_from(data, start)
                topic = self._channels.get(channel, '')
                if topics is None or topic in topics:
                    found.append((topic, at, bytes(data[start + _MESSAGE.size : end])))
        return found

    def close(self) -> None:
        """Close the file."""
        self._bytes.close()

    def _find(self) -> Iterator[_Span]:
        tail = self.size - len(MAGIC)
        if self._bytes[tail:] == MAGIC and tail > len(MAGIC) + _FOOTER_BYTES:
            (summary,) = _SUMMARY_START.unpack_from(self._bytes, tail - _FOOTER_BYTES)
            for opcode, start, end in _records(self._bytes, summary or tail):
                self._learn(opcode, self._bytes, start, end)
                if opcode == Opcode.CHUNK_INDEX:
                    yield self._add(_Span(*_CHUNK_INDEX.unpack_from(self._bytes, start)))
        if not self.spans:
            yield from self._find_without_summary()

    def _find_without_summary(self) -> Iterator[_Span]:
        run: _Span | None = None
        chunk: _Span | None = None
        for opcode, start, end in _records(self._bytes, len(MAGIC)):
            head = start - _HEAD.size
            # A chunk may hold topics that no later one names: it is unpacked for that, unless an
            # index says that all of it is known.
            if chunk is not None and not (
                opcode == Opcode.MESSAGE_INDEX
                and int.from_bytes(self._bytes[start : start + 2], 'little') in self._channels
            ):
                self.messages(chunk, ())
            self._learn(opcode, self._bytes, start, end)
            if opcode == Opcode.MESSAGE:
                _, _, at, _ = _MESSAGE.unpack_from(self._bytes, start)
                first, last, offset, _ = run or (at, at, head, 0)
                run = _Span(min(first, at), max(last, at), offset, end - offset)
            if run is not None and (opcode != Opcode.MESSAGE or run.size > RUN_BYTES):
                yield self._add(run)
                run = None
            if opcode == Opcode.CHUNK:
                first, last = _TIMES.unpack_from(self._bytes, start)
                chunk = _Span(first, last, head, end - head)
                yield self._add(chunk)
            elif opcode != Opcode.MESSAGE_INDEX:
                chunk = None
        if run is not None:
            yield self._add(run)

    def _add(self, span: _Span) -> _Span:
        self.spans.append(span)
        self._ends.append(max(span.end, self._ends[-1] if self._ends else 0))
        return span

    def _learn(self, opcode: int, data: Any, start: int, end: int) -> None:
        """Take note of a topic; of none where the record is damaged."""
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            return
        content = ReadDataStream(BytesIO(data[start:end]))
        with contextlib.suppress(McapError, ValueError, struct.error):
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(content)
                self._schemas[schema.id] = schema.name
                return
            channel = Channel.read(content)
            self._channels[channel.id] = channel.topic
            if channel.message_encoding == ENCODING:
                self.types[channel.topic] = self._schemas.get(channel.schema_id, '')

    def _content(self, span: _Span) -> bytes:
        data = self._bytes[span.offset : span.offset + span.size]
        if not data or data[0] != Opcode.CHUNK:
            return data
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(data[_HEAD.size :])))
            stream, size = get_chunk_data_stream(chunk)
            return stream.read(size)
        except Exception:  # whatever the compression finds: the bytes may be anything
            return b''


def _records(data: Any, at: int) -> Iterator[tuple[int, int, int]]:
    """Yield the opcode of each record and where its content starts and ends; not of a torn one."""
    while at + _HEAD.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        start, at = at + _HEAD.size, at + _HEAD.size + length
        if at > len(data) or opcode == Opcode.FOOTER:
            return
        if length >= _LEAST_BYTES.get(opcode, 0):
            yield opcode, start, at


class Messages:
    """The messages of a recording; safe from any thread.

    Args:
        recording: Its folder, or its only file.

    Raises:
        FileError: There is no file, or one cannot be read.
    """

    def __init__(self, recording: Path) -> None:
        files = [_RecordedFile(path) for path in files_of(recording)]
        self._files = sorted(
            (file for file in files if file.find_next()), key=lambda file: file.spans[0].start
        )
        for file in self._files[:1]:
            while len(file.spans) < FIRST_SPANS and file.find_next():
                pass
        self._size = sum(file.size for file in self._files) or 1
        self._lock = threading.Lock()
        self._passed = 0

    @property
    def types(self) -> dict[str, str]:
        """The types of the topics that are known so far, by name."""
        with self._lock:
            return {name: kind for file in self._files for name, kind in file.types.items()}

    @property
    def progress(self) -> float:
        """How much of the recording `in_order` has passed, 0 to 1."""
        return self._passed / self._size

    def in_order(self, topics: Collection[str] | None = None) -> Iterator[Stored]:
        """Yield the messages of some topics, or of all, in the order of their receipt."""
        before = 0
        for file in self._files:
            waiting: list[tuple[int, int, Stored]] = []
            number = count = 0
            while True:
                with self._lock:
                    if number == len(file.spans) and (file.is_known or not file.find_next()):
                        break
                    span = file.spans[number]
                    found = file.messages(span, topics)
                while waiting and waiting[0][0] < span.start:
                    yield heapq.heappop(waiting)[2]
                for each in found:
                    heapq.heappush(waiting, (each[1], count, each))
                    count += 1
                number += 1
                self._passed = before + span.offset
            while waiting:
                yield heapq.heappop(waiting)[2]
            before += file.size
            self._passed = before

    def before(
        self, topics: Sequence[str], at: float, within: float, most: int = 10
    ) -> list[Stored]:
        """Return messages, the newest first.

        Args:
            topics: Of these.
            at: Not later than this, seconds since 1970.
            within: And not more than this earlier, seconds.
            most: How many at most.
        """
        start, end = int((at - within) * 1e9), int(at * 1e9) + 1
        found: list[Stored] = []
        with self._lock:
            for file in reversed(self._files):
                for span in reversed(file.between(start, end)):
                    if len(found) >= most and span.end < found[most - 1][1]:
                        break
                    found += [m for m in file.messages(span, topics) if start <= m[1] < end]
                    found.sort(key=lambda message: -message[1])
                if file.spans[0].start <= start:
                    break  # What lies in earlier files is older.
        return found[:most]

    def close(self) -> None:
        """Close the files."""
        with self._lock:
            for file in self._files:
                file.close()
