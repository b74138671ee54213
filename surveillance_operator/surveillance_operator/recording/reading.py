"""Reading recordings, also those that other programs wrote: files, topics, messages at a moment."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import yaml
from mcap.exceptions import McapError
from mcap.reader import SeekingReader, make_reader
from mcap.records import Channel, Message, Schema

from surveillance_operator.recording.bag import METADATA, RecordingError

SUFFIX = '.mcap'


def files_of(recording: Path) -> list[Path]:
    """Return the MCAP files of a recording in the order of time: its folder's, or itself.

    Raises:
        RecordingError: There is none.
    """
    if recording.is_file():
        files = [recording] if recording.suffix == SUFFIX else []
    else:
        files = _listed(recording) or sorted(recording.glob(f'*{SUFFIX}'), key=_number)
    if not files:
        raise RecordingError(f'{recording}: expected a file *{SUFFIX}, or a folder that holds some')
    return files


def _metadata(folder: Path) -> dict[str, Any]:
    """Return what rosbag2's metadata says of a folder, nothing where there is none."""
    try:
        text = (folder / METADATA).read_text(encoding='utf-8')
        loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
        content = yaml.load(text, loader)['rosbag2_bagfile_information']
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError):
        return {}
    return content if isinstance(content, dict) else {}


def _listed(folder: Path) -> list[Path]:
    """Return the files that the folder's metadata names, those of them that there are."""
    names = _metadata(folder).get('relative_file_paths') or []
    paths = [folder / str(name) for name in names]
    # The file that is being written is not listed yet.
    listed = [path for path in paths if path.suffix == SUFFIX and path.is_file()]
    newer = set(folder.glob(f'*{SUFFIX}')) - set(listed)
    return [*listed, *sorted(newer, key=_number)]


def _number(path: Path) -> tuple[int, str]:
    numbers = re.findall(r'\d+', path.stem)
    return (int(numbers[-1]) if numbers else 0, path.stem)


def messages(
    recording: Path, topics: Sequence[str] | None = None, start: int | None = None
) -> Iterator[tuple[Schema, Channel, Message]]:
    """Yield the messages of a recording in the order in which they were received.

    Args:
        recording: Its folder, or its only file.
        topics: Only these; None for all.
        start: From this time on, nanoseconds since 1970.

    Raises:
        RecordingError: There is no file, or one cannot be read.
    """
    for path in files_of(recording):
        try:
            with open(path, 'rb') as file:
                for schema, channel, message in make_reader(file).iter_messages(
                    topics, starting_at=start
                ):
                    if schema is not None:
                        yield schema, channel, message
        except (OSError, McapError) as error:
            raise RecordingError(f'{path}: cannot be read: {error}') from None


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes:
        topics: Their types by name.
        start, end: Of its messages, seconds since 1970.
        starts: Of each file's messages, nanoseconds since 1970.
    """

    topics: dict[str, str]
    start: float
    end: float
    starts: dict[Path, int]

    @classmethod
    def of(cls, recording: Path) -> Contents:
        """Read the summaries of a recording's files.

        Raises:
            RecordingError: A file cannot be read, or has no summary.
        """
        topics: dict[str, str] = {}
        starts: dict[Path, int] = {}
        end = 0
        for path in files_of(recording):
            try:
                with open(path, 'rb') as file:
                    summary = make_reader(file).get_summary()
            except (OSError, McapError) as error:
                raise RecordingError(f'{path}: cannot be read: {error}') from None
            if summary is None or summary.statistics is None:
                raise RecordingError(f'{path}: has no index; `mcap recover` gives it one')
            for channel in summary.channels.values():
                schema = summary.schemas.get(channel.schema_id)
                topics[channel.topic] = schema.name if schema is not None else ''
            if summary.statistics.message_count:
                starts[path] = summary.statistics.message_start_time
                end = max(end, summary.statistics.message_end_time)
        if not starts:
            raise RecordingError(f'{recording}: holds no messages')
        return cls(topics, min(starts.values()) / 1e9, end / 1e9, starts)


class LastMessages:
    """Finds the last messages of a topic before a moment; safe from any thread.

    Args:
        recording: Its folder, or its only file.

    Attributes:
        topics: Types by the names of the recording's topics.

    Raises:
        RecordingError: There is no file, or it cannot be read.
    """

    def __init__(self, recording: Path) -> None:
        self._files = files_of(recording)
        self._lock = threading.Lock()
        self._open: dict[Path, tuple[IO[bytes], SeekingReader]] = {}
        # A file's own summary takes long to read: the metadata says when which file begins.
        known = _metadata(recording) if recording.is_dir() else {}
        try:
            self.topics = {
                str(each['topic_metadata']['name']): str(each['topic_metadata']['type'])
                for each in known['topics_with_message_count']
            }
            self._starts = {
                recording / str(each['path']): int(each['starting_time']['nanoseconds_since_epoch'])
                for each in known['files']
            }
        except (KeyError, TypeError, ValueError):
            contents = Contents.of(recording)
            self.topics, self._starts = contents.topics, contents.starts

    def before(
        self, topics: Sequence[str], at: float, within: float, most: int = 10
    ) -> list[tuple[str, bytes]]:
        """Return topics and messages, the newest first.

        Args:
            topics: Of these.
            at: Not later than this, seconds since 1970.
            within: And not more than this earlier, seconds.
            most: How many at most.
        """
        start, end = int((at - within) * 1e9), int(at * 1e9) + 1
        found: list[tuple[str, bytes]] = []
        with self._lock:
            for path in reversed(self._files):
                if self._starts.get(path, 0) >= end:
                    continue
                # A file that is torn or being written shows nothing.
                with contextlib.suppress(OSError, McapError):
                    reader = self._reader(path)
                    summary = reader.get_summary()
                    if summary is None or summary.statistics is None:
                        continue
                    if summary.statistics.message_start_time >= end:
                        continue
                    for _, channel, message in reader.iter_messages(
                        topics, starting_at=start, ending_before=end, reverse=True
                    ):
                        found.append((channel.topic, message.data))
                        if len(found) == most:
                            return found
                    if summary.statistics.message_start_time <= start:
                        return found
        return found

    def close(self) -> None:
        """Close the files."""
        with self._lock:
            for file, _ in self._open.values():
                file.close()
            self._open.clear()

    def _reader(self, path: Path) -> SeekingReader:
        if path not in self._open:
            file = open(path, 'rb')  # noqa: SIM115 - kept open
            self._open[path] = file, SeekingReader(file)
        return self._open[path][1]
