"""Replaying what another program recorded: here the library rosbags, as `ros2 bag record` would."""

from __future__ import annotations

import io
import os
import shutil
import time
from pathlib import Path

import pytest
from PIL import Image
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import UInt8

from strict_files.files import FileError
from surveillance_operator.recording.runs import find_recordings
from surveillance_operator.recording.stored import Conversion, RecordedSights, prefix_of
from surveillance_operator.recording.timeline import Timeline
from tests.operator.foreign_bag import START


def converted(recording: Path, path: Path) -> Timeline:
    conversion = Conversion(recording, path)
    conversion.start()
    conversion._thread.join(60)
    assert conversion.progress() == 1.0
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
