"""Recordings read in parts, whole or torn, whoever wrote them."""

from __future__ import annotations

import functools
import threading
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rclpy.serialization import serialize_message

from surveillance_operator.recording.reading import Messages
from surveillance_operator.recording.schemas import definition
from surveillance_operator.recording.stored import RecordedSights
from tests.operator.foreign_bag import START, said


def test_messages_before_a_moment_come_newest_first(bag: Path) -> None:
    last = Messages(bag)
    topics = ['/two/battery_level']
    found = [data[4] for _, _, data in last.before(topics, START + 5.5, 3.0)]
    assert found == [90 - 5, 90 - 4, 90 - 3]
    assert len(last.before(topics, START + 5.5, 3.0, 1)) == 1
    threads = [threading.Thread(target=last.before, args=(topics, START + 5, 5.0)) for _ in 'abcd']
    for each in threads:
        each.start()
    for each in threads:
        each.join(60.0)
    last.close()


@functools.cache
def serialised() -> list[tuple[int, str, Any, bytes]]:
    """Return what is recorded with its bytes: time in ns, topic, message, bytes."""
    return [
        (int((START + at) * 1e9), topic, message, serialize_message(message))
        for at, topic, message in said()
    ]


def mission_file(path: Path, **options: Any) -> bytes:
    """Write what a mission said with the library mcap; return the file."""
    with open(path, 'wb') as file:
        writer = McapWriter(file, chunk_size=2000, **options)
        writer.start(profile='ros2', library='another')
        channels: dict[str, int] = {}
        for at, topic, message, data in serialised():
            kind = f'{type(message).__module__.split(".")[0]}/msg/{type(message).__name__}'
            if topic not in channels:
                schema = writer.register_schema(kind, 'ros2msg', definition(kind).encode())
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            writer.add_message(channels[topic], at, data, at)
        writer.finish()
    return path.read_bytes()


@pytest.mark.parametrize(
    'options',
    [
        {},
        {'compression': CompressionType.LZ4, 'index_types': IndexType.NONE},
        {'compression': CompressionType.NONE, 'index_types': IndexType.CHUNK},
        {'use_chunking': False},
        {'use_chunking': False, 'use_statistics': False, 'use_summary_offsets': False},
    ],
)
def test_what_other_programs_write_is_read_whole_or_torn(
    options: dict[str, Any], tmp_path: Path
) -> None:
    path = tmp_path / 'other.mcap'
    content = mission_file(path, **options)
    every = list(Messages(path).in_order())
    assert every == [(topic, at, data) for at, topic, _, data in serialised()]
    # As a writer leaves it that was killed: no index, and the last record is torn.
    path.write_bytes(content[: int(len(content) * 0.6)])
    torn = Messages(path)
    saved = list(torn.in_order())
    assert len(saved) > 40
    assert saved == every[: len(saved)]
    assert torn.progress == 1.0
    assert torn.types['/two/battery_level'] == 'std_msgs/msg/UInt8'
    sights = RecordedSights(path)
    assert sights.scan(START + 4.5) == [[4.0, 0.0]]
    assert sights.jpeg(START + 4.5) is not None
    sights.close()


def test_no_damaged_byte_ends_the_reader(tmp_path: Path) -> None:
    path = tmp_path / 'damaged.mcap'
    content = mission_file(path)
    for place in range(8, len(content), len(content) // 60):
        path.write_bytes(content[:place] + b'\xff' * 8 + content[place + 8 :])
        messages = Messages(path)
        assert len(list(messages.in_order())) <= len(serialised())
        messages.close()
