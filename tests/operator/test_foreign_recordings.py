"""Replaying what another program recorded: here the library rosbags, as `ros2 bag record` would."""

from __future__ import annotations

import functools
import io
import os
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from PIL import Image
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import CompressedImage, LaserScan
from std_msgs.msg import UInt8

from strict_files.files import FileError
from surveillance_interfaces.msg import Decision, FactChange, FactChanges, MissionStatus
from surveillance_interfaces.msg import Fact as FactMessage
from surveillance_operator.mission_markers_node import markers_of
from surveillance_operator.mission_state import MissionState
from surveillance_operator.recording.reading import Messages, files_of
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.schemas import definition
from surveillance_operator.recording.stored import Conversion, RecordedSights, prefix_of
from surveillance_operator.recording.timeline import Timeline

START = 1_000_000.0
SECONDS = 20


def stamp(at: float) -> Time:
    return Time(sec=int(at), nanosec=int(at % 1 * 1e9))


def pose_at(at: float, x: float) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.stamp = stamp(at)
    message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
    return message


def scan_at(at: float) -> LaserScan:
    ranges = np.array([2.0], dtype=np.float32)
    message = LaserScan(range_max=8.0, angle_increment=0.1, ranges=ranges)
    message.header.stamp = stamp(at)
    return message


def image() -> CompressedImage:
    file = io.BytesIO()
    Image.new('RGB', (8, 6), 'red').save(file, 'JPEG')
    return CompressedImage(format='jpeg', data=file.getvalue())


def visit(place: str, at: float) -> FactChanges:
    fact = FactMessage(predicate='visitedAt', arguments=[place, f'"{at:.0f}"^^xsd:long'])
    return FactChanges(sequence=1, changes=[FactChange(fact=fact, added=True)])


def said() -> Iterator[tuple[float, str, Any]]:
    """Yield what a mission in the namespace `two` said: seconds, topic, message."""
    places = MissionState().having(
        positions={'A': (0.0, 0.0), 'B': (9.0, 0.0)}, door_lines={'D': (5.0, -1.0, 5.0, 1.0)}
    )
    yield 0.0, '/two/place_markers', markers_of(places, Time())
    for second in range(SECONDS):
        at = START + second
        yield (
            second,
            '/two/mission_status',
            MissionStatus(machine='surveillance', state=f'S{second}'),
        )
        yield second + 0.01, '/two/battery_level', UInt8(data=90 - second)
        yield second + 0.02, '/two/amcl_pose', pose_at(at, second / 2)
        yield second + 0.03, '/two/scan', scan_at(at)
        yield second + 0.04, '/two/camera/rgb/image_raw/compressed', image()
        if second == 10:
            decision = Decision(sequence=7, from_place='A', place='B', rule='URGENT')
            yield second + 0.05, '/two/decision', decision
        if second == 15:
            yield second + 0.06, '/two/fact_changes', visit('B', at)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('foreign') / 'rosbag2_2026'
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for at, topic, message in said():
            kind = f'{type(message).__module__.split(".")[0]}/msg/{type(message).__name__}'
            if topic not in connections:
                store.register({
                    name: fields
                    for name, fields in get_types_from_msg(definition(kind), kind).items()
                    if name not in store.fielddefs
                })  # fmt: skip
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], int((START + at) * 1e9), serialize_message(message))
    return folder


def converted(recording: Path, path: Path) -> Timeline:
    conversion = Conversion(recording, path)
    conversion.start()
    conversion._thread.join(60)
    assert conversion.share() == 1.0
    return Timeline(path)


def test_it_is_replayed_as_a_mission_was(bag: Path, tmp_path: Path) -> None:
    line = converted(bag, tmp_path / 'timeline.jsonl')
    assert line.times[0] == pytest.approx(START, abs=1.0)
    _, now, parts = line.at(START + 12.9)
    assert now == pytest.approx(START + 12.5, abs=1.0)
    assert parts['status']['state'] == 'S12'
    assert parts['brief'] == 'battery 78 %'
    assert parts['pose'][0] == pytest.approx(6.0)
    assert len(parts['trail']) == 13
    assert parts['decision']['number'] == 7
    assert parts['places']['B'] == {'at': [9.0, 0.0], 'visited': None, 'urgent': False}
    assert parts['doors']['D']['line'] == [5.0, -1.0, 5.0, 1.0]
    assert parts['mission']['running'] is True
    assert line.at(START + 19)[2]['places']['B']['visited'] == START + 15
    assert line.next_mark('decision', START) == pytest.approx(START + 10, abs=1.0)


def test_what_lidar_and_camera_saw_is_found(bag: Path) -> None:
    sights = RecordedSights(bag)
    assert sights.scan(START + 8.5) == [[6.0, 0.0]]
    assert sights.scan(START - 5) == []
    picture = sights.jpeg(START + 8.5)
    assert picture is not None
    assert Image.open(io.BytesIO(picture)).size == (8, 6)
    assert sights.jpeg(START + 100) is None
    sights.close()


def test_a_bag_and_its_file_are_found_by_name(bag: Path, tmp_path: Path) -> None:
    (file,) = bag.glob('*.mcap')
    for name in (bag, file):
        found = find_recordings(str(name), tmp_path)['']
        assert (found.is_whole, found.messages) == (False, name)
    with pytest.raises(FileError, match='expected'):
        find_recordings(str(tmp_path / 'nothing.mcap'), tmp_path)['']


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


def test_a_file_alone_and_a_folder_without_metadata_show_the_same(
    bag: Path, tmp_path: Path
) -> None:
    (file,) = bag.glob('*.mcap')
    bare = tmp_path / 'bare'
    bare.mkdir()
    (bare / 'part_0.mcap').write_bytes(file.read_bytes())
    (bare / 'metadata.yaml').write_text('[no metadata')
    for recording in (file, bare):
        sights = RecordedSights(recording)
        assert sights.scan(START + 8.5) == [[6.0, 0.0]]
        sights.close()


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
    assert torn.share == 1.0
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


def test_the_time_line_is_kept_for_the_next_time(bag: Path, tmp_path: Path) -> None:
    recording = tmp_path / 'rosbag2'
    shutil.copytree(bag, recording)
    first = find_recordings(str(recording), tmp_path)['']
    assert not first.is_whole
    conversion = Conversion(recording, tmp_path / 'made.jsonl', keep=first.timeline)
    conversion.start()
    conversion._thread.join(60)
    again = find_recordings(str(recording), tmp_path)['']
    assert again.is_whole
    assert Timeline(again.timeline).at(START + 12.9)[2]['status']['state'] == 'S12'
    (file,) = recording.glob('*.mcap')
    os.utime(file, (time.time() + 10, time.time() + 10))  # it was written on
    assert not find_recordings(str(recording), tmp_path)[''].is_whole


def test_a_recording_of_something_else_is_refused(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    folder = tmp_path / 'other'
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/words', 'std_msgs/msg/UInt8', typestore=store)
        writer.write(connection, 5, serialize_message(UInt8(data=1)))
    with pytest.raises(FileError, match='no topic of a mission'):
        Conversion(folder, tmp_path / 'timeline.jsonl')
    (file,) = folder.glob('*.mcap')
    file.write_bytes(b'no such file')
    with pytest.raises(FileError, match='no MCAP file'):
        Conversion(folder, tmp_path / 'timeline.jsonl')


def test_the_namespace_is_that_of_most_topics() -> None:
    assert prefix_of(['/decision', '/plan', '/robot/plan']) == '/'
    assert prefix_of(['/a/b/decision', '/a/b/plan', '/tf']) == '/a/b/'


@pytest.mark.parametrize('name', ['empty', 'notes.txt', 'recording_0.db3', 'gone.mcap'])
def test_what_holds_no_recording_is_named_and_what_is_expected(name: str, tmp_path: Path) -> None:
    (tmp_path / 'empty').mkdir()
    (tmp_path / 'notes.txt').touch()
    (tmp_path / 'recording_0.db3').touch()
    with pytest.raises(FileError, match=rf'{name}: expected a file \*\.mcap, or a folder'):
        files_of(tmp_path / name)
    (tmp_path / 'recording_0.mcap').touch()
    (tmp_path / 'recording_1.mcap').touch()
    assert [each.name for each in files_of(tmp_path)] == ['recording_0.mcap', 'recording_1.mcap']
