"""One recording: a folder of MCAP segments with the metadata that rosbag2 reads.

Messages are written as they were serialised (CDR), with their definitions, so that Foxglove,
Lichtblick, `ros2 bag` and the libraries `mcap` and `rosbags` read them. Every second what came is
sealed as a chunk, so that a killed process loses no more; `repair` gives such a file its index.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from io import BufferedWriter
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

NAME = 'recording'
"""The folder of a run that holds its recording, and the start of its segments' names."""
METADATA = 'metadata.yaml'
PROFILE, ENCODING, SCHEMA_ENCODING = 'ros2', 'cdr', 'ros2msg'
LIBRARY = 'surveillance_operator'
CHUNK_BYTES = 1_000_000
INFINITE = {'sec': 9223372036, 'nsec': 854775807}
"""rosbag2's way to write a duration without end."""


class RecordingError(ValueError):
    """A recording cannot be written or read, or there is none; one line that says which."""


class DiskFullError(RecordingError):
    """A recording cannot be written until there is space again."""


@dataclass(frozen=True)
class TopicType:
    """What a topic carries.

    Attributes:
        name: The topic with its namespace.
        type: E.g. `std_msgs/msg/Bool`.
        definition: The type's definition with those it uses, as ros2msg.
        reliable, latched, depth: What its publisher offers.
        type_hash: The type's hash (RIHS01), empty where unknown.
    """

    name: str
    type: str
    definition: str
    reliable: bool = True
    latched: bool = False
    depth: int = 10
    type_hash: str = ''


@dataclass
class _Segment:
    """What the metadata says of one file."""

    path: str
    start: int = 0
    end: int = 0
    counts: dict[str, int] = field(default_factory=dict)

    @property
    def count(self) -> int:
        return sum(self.counts.values())

    def add(self, topic: str, at: int) -> None:
        self.start = min(self.start, at) if self.counts else at
        self.end = max(self.end, at)
        self.counts[topic] = self.counts.get(topic, 0) + 1


class BagWriter:
    """Writes a recording.

    Args:
        folder: Where to; made when it is missing, continued with a new segment when it exists.
        segment_bytes, segment_seconds: Limits of a segment in size and age.

    Its methods raise `RecordingError` when a file cannot be written, `DiskFullError` for want of
    space. The next call tries again, with a new segment.
    """

    def __init__(
        self,
        folder: Path,
        *,
        segment_bytes: int = 128_000_000,
        segment_seconds: float = 3600.0,
    ) -> None:
        self.folder = folder
        self._segment_bytes, self._segment_seconds = segment_bytes, segment_seconds
        self._topics: dict[str, TopicType] = {}
        self._closed: list[_Segment] = []
        self._file: BufferedWriter | None = None
        self._knows_folder = False

    def add_topic(self, topic: TopicType) -> None:
        """Announce a topic before its first message."""
        self._topics[topic.name] = topic

    def write(self, topic: str, data: bytes, received: int, published: int) -> None:
        """Add a message.

        Args:
            topic: As announced.
            data: Serialised.
            received, published: Nanoseconds since 1970.
        """
        with self._segment_to_write():
            channel = self._channels.get(topic)
            if channel is None:
                channel = self._channels[topic] = _register(self._writer, self._topics[topic])
            self._writer.add_message(channel, received, data, published)
            self._segment.add(topic, received)

    def seal(self) -> None:
        """Give all that came to the operating system; end the segment if it is time."""
        with self._segment_to_write() as file:
            # The library ends a chunk at its size alone; it has no public way to end one in time.
            self._writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
            file.flush()
            aged = time.monotonic() - self._opened > self._segment_seconds
            if self._segment.counts and (aged or file.tell() > self._segment_bytes):
                self._finish(file)

    def close(self) -> None:
        """End the segment and write the metadata."""
        if self._file is not None:
            with self._segment_to_write() as file:
                self._finish(file)

    @contextlib.contextmanager
    def _segment_to_write(self) -> Iterator[BufferedWriter]:
        """Give the file of the present segment; let go of it when it takes no more."""
        try:
            if self._file is None:
                self._file = self._begin_segment()
            yield self._file
        except OSError as error:
            if self._file is not None:
                with contextlib.suppress(OSError):
                    self._file.close()
            self._file, self._knows_folder = None, False
            full = error.errno in (errno.ENOSPC, errno.EDQUOT)
            kind = DiskFullError if full else RecordingError
            raise kind(f'{self.folder}: cannot be written: {error.strerror}') from None

    def _begin_segment(self) -> BufferedWriter:
        if not self._knows_folder:
            self.folder.mkdir(parents=True, exist_ok=True)
            _, self._closed, topics = _take_up(self.folder)
            self._topics = {**topics, **self._topics}
            self._knows_folder = True
        numbers = [int(path.stem.rsplit('_', 1)[1]) for path in segments(self.folder)]
        self._segment = _Segment(f'{self.folder.name}_{max(numbers, default=-1) + 1}.mcap')
        file = open(self.folder / self._segment.path, 'wb')  # noqa: SIM115 - kept open
        # Held for as long as it is written: nobody repairs or deletes it meanwhile.
        fcntl.flock(file, fcntl.LOCK_EX)
        self._writer = _writer(file)
        self._channels: dict[str, int] = {}
        self._opened = time.monotonic()
        return file

    def _finish(self, file: BufferedWriter) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]
        file.close()
        self._file = None
        if self._segment.counts:
            self._closed.append(self._segment)
        else:
            (self.folder / self._segment.path).unlink()
        # `prune` may have taken old segments away.
        self._closed = [each for each in self._closed if (self.folder / each.path).exists()]
        write_metadata(self.folder, self._closed, self._topics)


def segments(folder: Path) -> list[Path]:
    """Return a recording's files in the order of time."""
    found = folder.glob(f'{folder.name}_*.mcap')
    numbered = [path for path in found if path.stem.rsplit('_', 1)[1].isdecimal()]
    return sorted(numbered, key=lambda path: int(path.stem.rsplit('_', 1)[1]))


def repair(folder: Path) -> list[str]:
    """Give files whose writer was killed their index, and the recording its metadata.

    Returns:
        What was repaired, a line each; nothing for a recording that is whole or being written.
    """
    return _take_up(folder)[0]


def _take_up(folder: Path) -> tuple[list[str], list[_Segment], dict[str, TopicType]]:
    """Repair a recording; return what was repaired, its segments, and its topics by name."""
    done: list[str] = []
    found: list[_Segment] = []
    topics: dict[str, TopicType] = {}
    for path in segments(folder):
        with open(path, 'rb+') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                return done, found, topics
            if not _is_whole(path):
                segment = _rewritten(path)
                done.append(f'{path}: {segment.count} messages saved')
        try:
            segment, known = _scan(path)
        except (McapError, OSError):
            continue
        if segment.counts:
            found.append(segment)
            topics.update(known)
        else:
            path.unlink()
    if found and (done or not (folder / METADATA).exists()):
        write_metadata(folder, found, topics)
    return done, found, topics


def prune(runs: Path, keep_bytes: float) -> list[Path]:
    """Delete the oldest recordings, segment by segment, until the rest is small enough.

    Files that are being written stay. What a run leaves beside its recording stays, too.

    Returns:
        The deleted files.
    """
    files = [path for folder in runs.glob(f'*/{NAME}') for path in segments(folder)]
    files.sort(key=lambda path: path.stat().st_mtime)
    total = sum(path.stat().st_size for path in files)
    deleted = []
    for path in files:
        if total <= keep_bytes:
            break
        size = path.stat().st_size
        with open(path, 'rb') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            path.unlink()
        deleted.append(path)
        total -= size
    for folder in {path.parent for path in deleted}:
        if segments(folder):
            scanned = [_scan(path) for path in segments(folder) if _is_whole(path)]
            known = {name: topic for _, topics in scanned for name, topic in topics.items()}
            write_metadata(folder, [segment for segment, _ in scanned], known)
        else:
            shutil.rmtree(folder, ignore_errors=True)
    return deleted


def write_metadata(folder: Path, closed: Sequence[_Segment], topics: dict[str, TopicType]) -> None:
    """Write `metadata.yaml` as rosbag2 of Jazzy does (version 9)."""
    start = min((each.start for each in closed), default=0)
    end = max((each.end for each in closed), default=start)
    counts = {name: sum(each.counts.get(name, 0) for each in closed) for name in topics}
    content = {
        'rosbag2_bagfile_information': {
            'version': 9,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': end - start},
            'starting_time': {'nanoseconds_since_epoch': start},
            'message_count': sum(counts.values()),
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': name,
                        'type': topic.type,
                        'serialization_format': ENCODING,
                        'offered_qos_profiles': [_qos(topic)],
                        'type_description_hash': topic.type_hash,
                    },
                    'message_count': counts[name],
                }
                for name, topic in sorted(topics.items())
                if counts[name]
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [each.path for each in closed],
            'files': [
                {
                    'path': each.path,
                    'starting_time': {'nanoseconds_since_epoch': each.start},
                    'duration': {'nanoseconds': each.end - each.start},
                    'message_count': each.count,
                }
                for each in closed
            ],
            'custom_data': None,
            'ros_distro': 'jazzy',
        }
    }
    temporary = folder / (METADATA + '.tmp')
    temporary.write_text(yaml.safe_dump(content, sort_keys=False), encoding='utf-8')
    temporary.replace(folder / METADATA)


def _qos(topic: TopicType) -> dict[str, Any]:
    return {
        'history': 'keep_last',
        'depth': topic.depth,
        'reliability': 'reliable' if topic.reliable else 'best_effort',
        'durability': 'transient_local' if topic.latched else 'volatile',
        'deadline': INFINITE,
        'lifespan': INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': INFINITE,
        'avoid_ros_namespace_conventions': False,
    }


def _writer(file: Any) -> Writer:
    writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
    writer.start(profile=PROFILE, library=LIBRARY)
    return writer


def _register(writer: Writer, topic: TopicType) -> int:
    schema = writer.register_schema(topic.type, SCHEMA_ENCODING, topic.definition.encode())
    metadata = {
        'offered_qos_profiles': yaml.safe_dump([_qos(topic)], sort_keys=False),
        'topic_type_hash': topic.type_hash,
        'topic': json.dumps(asdict(topic)),
    }
    return writer.register_channel(topic.name, ENCODING, schema, metadata)


def _topic_of(schema: Schema, channel: Channel) -> TopicType:
    try:
        return TopicType(**json.loads(channel.metadata['topic']))
    except (KeyError, TypeError, ValueError):
        return TopicType(channel.topic, schema.name, schema.data.decode(errors='replace'))


def _scan(path: Path) -> tuple[_Segment, dict[str, TopicType]]:
    """Return what the summary of a whole file says."""
    segment, topics = _Segment(path.name), {}
    with open(path, 'rb') as file:
        summary = make_reader(file).get_summary()
    if summary is not None and summary.statistics is not None:
        segment.start = summary.statistics.message_start_time
        segment.end = summary.statistics.message_end_time
        for number, count in summary.statistics.channel_message_counts.items():
            channel = summary.channels[number]
            segment.counts[channel.topic] = count
            topics[channel.topic] = _topic_of(summary.schemas[channel.schema_id], channel)
    return segment, topics


def _is_whole(path: Path) -> bool:
    """Tell whether a file ends as a finished one does."""
    magic = b'\x89MCAP0\r\n'
    with open(path, 'rb') as file:
        size = file.seek(0, os.SEEK_END)
        if size < 2 * len(magic):
            return False
        file.seek(-len(magic), os.SEEK_END)
        return file.read() == magic


def _rewritten(path: Path) -> _Segment:
    """Write what can be read of a torn file anew, in its place."""
    temporary = path.with_suffix('.tmp')
    segment = _Segment(path.name)
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[str, int]] = {}
    with open(path, 'rb') as file, open(temporary, 'wb') as output:
        writer = _writer(output)
        try:
            for record in StreamReader(file, record_size_limit=path.stat().st_size).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    topic = _topic_of(schemas[record.schema_id], record)
                    channels[record.id] = topic.name, _register(writer, topic)
                elif isinstance(record, Message):
                    name, number = channels[record.channel_id]
                    writer.add_message(
                        number, record.log_time, record.data, record.publish_time, record.sequence
                    )
                    segment.add(name, record.log_time)
        except OSError:  # the disk is full: the torn file stays
            temporary.unlink()
            raise
        except Exception:  # where it is torn, any of the readers' errors may come
            pass
        writer.finish()  # type: ignore[no-untyped-call]
    temporary.replace(path)
    return segment
