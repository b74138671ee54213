"""One recording: a folder of MCAP segments with the metadata that rosbag2 reads.

Messages are written as they were serialised (CDR), with their definitions, so that Foxglove,
Lichtblick, `ros2 bag` and the libraries `mcap` and `rosbags` read them. Every second what came is
sealed as a chunk, so that a killed process loses no more; `repair` gives such a file its index.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BufferedWriter
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from strict_files.files import replace_text
from surveillance_runtime.run_files import RECORDING

METADATA = 'metadata.yaml'
PROFILE, ENCODING, SCHEMA_ENCODING = 'ros2', 'cdr', 'ros2msg'
QOS, TYPE_HASH = 'offered_qos_profiles', 'topic_type_hash'
"""What rosbag2 has a file say about a topic, beside its type."""
LIBRARY = 'surveillance_operator'
CHUNK_BYTES = 1_000_000
MAGIC = b'\x89MCAP0\r\n'
"""The first and the last bytes of a whole file."""
INFINITE = {'sec': 9223372036, 'nsec': 854775807}
"""rosbag2's way to write a duration without end."""


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


@dataclass(frozen=True)
class _Segment:
    """What the summary of a whole file says.

    Attributes:
        name: Of the file.
        start, end: Of its messages, nanoseconds since 1970.
        counts: Messages by topic.
        topics: Each topic's type, and what `_register` wrote about it.
    """

    name: str
    start: int
    end: int
    counts: Mapping[str, int]
    topics: Mapping[str, tuple[str, Mapping[str, str]]]

    @property
    def count(self) -> int:
        return sum(self.counts.values())


class BagWriter:
    """Writes a recording.

    Args:
        folder: Where to; made when it is missing, continued with a new segment when it exists.
        segment_bytes, segment_seconds: Limits of a segment in size and age.

    Its methods raise `OSError` with the folder's name when a file cannot be written. The next call
    tries again, with a new segment.
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
        self._closed: list[_Segment] | None = None
        self._file: BufferedWriter | None = None

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

    def seal(self) -> None:
        """Give all that came to the operating system; end the segment if it is time."""
        with self._segment_to_write() as file:
            # The library ends a chunk at its size alone; it has no public way to end one in time.
            self._writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
            file.flush()
            aged = time.monotonic() - self._opened > self._segment_seconds
            if aged or file.tell() > self._segment_bytes:
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
            self._file = self._closed = None
            raise OSError(error.errno, error.strerror, str(self.folder)) from None

    def _begin_segment(self) -> BufferedWriter:
        if self._closed is None:
            self.folder.mkdir(parents=True, exist_ok=True)
            repair(self.folder)
            self._closed = _whole_segments(self.folder)
        numbers = [int(path.stem.rsplit('_', 1)[1]) for path in segments(self.folder)]
        path = self.folder / f'{self.folder.name}_{max(numbers, default=-1) + 1}.mcap'
        file = open(path, 'wb')  # noqa: SIM115 - kept open
        # Held for as long as it is written: nobody repairs or deletes it meanwhile.
        fcntl.flock(file, fcntl.LOCK_EX)
        self._writer = _writer(file)
        self._channels: dict[str, int] = {}
        self._opened = time.monotonic()
        return file

    def _finish(self, file: BufferedWriter) -> None:
        self._writer.finish()
        file.close()
        self._file = None
        # `prune` may have taken old segments away.
        known = [each for each in self._closed or () if (self.folder / each.name).exists()]
        self._closed = [*known, *_scanned([Path(file.name)])]
        write_metadata(self.folder, self._closed)


def segments(folder: Path) -> list[Path]:
    """Return a recording's files in the order of time."""
    found = folder.glob(f'{folder.name}_*.mcap')
    numbered = [path for path in found if path.stem.rsplit('_', 1)[1].isdecimal()]
    return sorted(numbered, key=lambda path: int(path.stem.rsplit('_', 1)[1]))


def repair(folder: Path) -> list[str]:
    """Give files whose writer was killed their index, and the recording its metadata.

    Returns:
        What was repaired, and what is damaged and left, a line each; nothing for a recording that
        is whole or being written.
    """
    done: list[str] = []
    for path in segments(folder):
        with open(path, 'rb') as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                return done
            if not _is_whole(path):
                _rewrite(path)
                saved = sum(each.count for each in _scanned([path]))
                done.append(f'{path}: {saved} messages saved')
    if done or not (folder / METADATA).exists():
        write_metadata(folder, _whole_segments(folder, done))
    return done


def prune(runs: Path, keep_bytes: float) -> list[Path]:
    """Delete the oldest recordings, segment by segment, until the rest is small enough.

    Files that are being written stay, and those that may not be deleted. What a run leaves beside
    its recording stays, too. Another recorder may do the same at the same time.

    Returns:
        The deleted files.
    """
    files = []
    for path in (path for folder in runs.glob(f'*/{RECORDING}') for path in segments(folder)):
        with contextlib.suppress(OSError):
            status = path.stat()
            files.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in files)
    deleted = []
    for _, size, path in sorted(files):
        if total <= keep_bytes:
            break
        try:
            with open(path, 'rb') as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
        except OSError:
            if not path.exists():  # by the other recorder
                total -= size
            continue
        deleted.append(path)
        total -= size
    for folder in {path.parent for path in deleted}:
        with contextlib.suppress(OSError):
            if segments(folder):
                write_metadata(folder, _whole_segments(folder))
            else:
                shutil.rmtree(folder, ignore_errors=True)
    return deleted


def write_metadata(folder: Path, closed: Sequence[_Segment]) -> None:
    """Write `metadata.yaml` as rosbag2 of Jazzy does (version 9); none without a message."""
    if not closed:
        return
    start, end = min(each.start for each in closed), max(each.end for each in closed)
    topics = {name: topic for each in closed for name, topic in each.topics.items()}
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
                        'type': kind,
                        'serialization_format': ENCODING,
                        'offered_qos_profiles': yaml.safe_load(more.get(QOS, '[]')),
                        'type_description_hash': more.get(TYPE_HASH, ''),
                    },
                    'message_count': counts[name],
                }
                for name, (kind, more) in sorted(topics.items())
            ],
            'compression_format': '',
            'compression_mode': '',
            'relative_file_paths': [each.name for each in closed],
            'files': [
                {
                    'path': each.name,
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
    replace_text(folder / METADATA, yaml.safe_dump(content, sort_keys=False))


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
    qos = yaml.safe_dump([_qos(topic)], sort_keys=False)
    metadata = {QOS: qos, TYPE_HASH: topic.type_hash}
    return writer.register_channel(topic.name, ENCODING, schema, metadata)


def _whole_segments(folder: Path, damaged: list[str] | None = None) -> list[_Segment]:
    """Return what the summaries of a recording's files say, without those that are not whole."""
    return _scanned((path for path in segments(folder) if _is_whole(path)), damaged)


def _scanned(paths: Iterable[Path], damaged: list[str] | None = None) -> list[_Segment]:
    """Return what the summaries of files say; a file without messages is deleted.

    Args:
        paths: The files.
        damaged: Gets a line about each file whose summary cannot be used; it is left as it is.
    """
    found = []
    for path in paths:
        try:
            segment = _scan(path)
        except (McapError, OSError):
            continue
        except Exception as error:
            # Of changed bytes the readers make any error, also MemoryError.
            if damaged is not None:
                why = f'{type(error).__name__}: {error!s:.80}'
                damaged.append(f'{path}: its summary is damaged ({why}); it is left as it is')
            continue
        if segment is not None:
            found.append(segment)
    return found


def _scan(path: Path) -> _Segment | None:
    """Return what the summary of a file says; None: it has none, or no message."""
    with open(path, 'rb') as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        return None
    said = summary.statistics
    if not said.message_count:
        path.unlink()
        return None
    counts, topics = {}, {}
    for number, count in said.channel_message_counts.items():
        channel = summary.channels[number]
        counts[channel.topic] = count
        topics[channel.topic] = summary.schemas[channel.schema_id].name, channel.metadata
        yaml.safe_load(channel.metadata.get(QOS, '[]'))  # what the metadata are made of
    times = said.message_start_time, said.message_end_time
    return _Segment(path.name, *times, counts, topics)


def _is_whole(path: Path) -> bool:
    """Tell whether a file ends as a finished one does."""
    with open(path, 'rb') as file:
        size = file.seek(0, os.SEEK_END)
        if size < 2 * len(MAGIC):
            return False
        file.seek(-len(MAGIC), os.SEEK_END)
        return file.read() == MAGIC


def _rewrite(path: Path) -> None:
    """Write what can be read of a torn file anew, in its place."""
    temporary = path.with_suffix('.tmp')
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    with open(path, 'rb') as file, open(temporary, 'wb') as output:
        writer = _writer(output)
        try:
            for record in StreamReader(file, record_size_limit=path.stat().st_size).records:
                if isinstance(record, Schema):
                    schemas[record.id] = writer.register_schema(
                        record.name, record.encoding, record.data
                    )
                elif isinstance(record, Channel):
                    channels[record.id] = writer.register_channel(
                        record.topic,
                        record.message_encoding,
                        schemas[record.schema_id],
                        record.metadata,
                    )
                elif isinstance(record, Message):
                    number = channels[record.channel_id]
                    writer.add_message(
                        number, record.log_time, record.data, record.publish_time, record.sequence
                    )
        except OSError:  # the disk is full: the torn file stays
            temporary.unlink()
            raise
        except Exception:  # where it is torn, any of the readers' errors may come
            pass
        writer.finish()
    temporary.replace(path)
