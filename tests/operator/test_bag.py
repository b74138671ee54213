"""Recordings, read back by the libraries of others."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String

from surveillance_interfaces.msg import FactChange, FactChanges
from surveillance_operator.recording import bag
from surveillance_operator.recording.bag import (
    BagWriter,
    TopicType,
    prune,
    repair,
    segments,
)
from surveillance_operator.recording.schemas import definition, message_class
from surveillance_runtime.run_files import RECORDING
from tests.operator.conftest import Disk

TYPE = 'std_msgs/msg/String'
TOPIC = TopicType('/words', TYPE, definition(TYPE), latched=True, depth=1)


def write(folder: Path, words: list[str], **limits: Any) -> BagWriter:
    writer = BagWriter(folder, **limits)
    writer.add_topic(TOPIC)
    for number, word in enumerate(words):
        data = serialize_message(String(data=word))
        writer.write('/words', data, 10**18 + number, 10**18 + number)
        writer.seal()
    return writer


def read(folder: Path) -> list[str]:
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        return [reader.deserialize(data, c.msgtype).data for c, _, data in reader.messages()]  # type: ignore[attr-defined]


def test_rosbags_and_mcap_read_what_was_written(tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    write(folder, ['one', 'two', 'three']).close()
    assert read(folder) == ['one', 'two', 'three']
    with open(folder / 'recording_0.mcap', 'rb') as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 3
        (schema,) = summary.schemas.values()
        assert (schema.encoding, schema.name) == ('ros2msg', TYPE)
    with Reader(folder) as reader:
        assert reader.message_count == 3
        (connection,) = reader.connections
        assert connection.topic == '/words'
        qos = connection.ext.offered_qos_profiles[0]
        assert qos.durability.name == 'TRANSIENT_LOCAL'


def test_a_large_recording_has_several_files_in_order(tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    words = [f'{number} ' * 200 for number in range(20)]
    write(folder, words, segment_bytes=500).close()
    assert len(segments(folder)) > 3
    assert read(folder) == words
    with Reader(folder) as reader:
        assert reader.message_count == 20


def test_a_recording_is_continued(tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    write(folder, ['one']).close()
    write(folder, ['two']).close()
    assert read(folder) == ['one', 'two']


def test_a_killed_writer_loses_nothing_that_was_sealed(tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    code = (
        'import sys; from pathlib import Path; from tests.operator.test_bag import write\n'
        'writer = write(Path(sys.argv[1]), [str(n) for n in range(50)])\n'
        "writer._file.write(b'torn'); writer._file.flush(); print('ready', flush=True)\n"
        'sys.stdin.read()'
    )
    process = subprocess.Popen(
        [sys.executable, '-c', code, str(folder)],
        stdout=subprocess.PIPE,
        stdin=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
        env={**os.environ, 'PYTHONPATH': '.'},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b'ready\n'
    assert repair(folder) == []  # it is being written
    process.send_signal(signal.SIGKILL)
    process.communicate()
    (line,) = repair(folder)
    assert '50 messages saved' in line
    assert read(folder) == [str(n) for n in range(50)]
    with Reader(folder) as reader:
        (qos,) = reader.connections[0].ext.offered_qos_profiles
        assert (qos.depth, qos.durability.name) == (1, 'TRANSIENT_LOCAL')
    assert repair(folder) == []


def test_a_recorder_that_was_killed_goes_on_in_the_same_folder(tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    killed = write(folder, ['one', 'two'])
    killed._file.write(b'torn')
    killed._file.close()  # as the kernel does; nobody writes an index
    write(folder, ['three']).close()
    assert read(folder) == ['one', 'two', 'three']


def test_the_oldest_files_are_deleted_first(tmp_path: Path) -> None:
    for run in ('1', '2'):
        write(tmp_path / run / RECORDING, ['word ' * 100] * 4, segment_bytes=10).close()
        for number, path in enumerate(segments(tmp_path / run / RECORDING)):
            os.utime(path, (int(run) * 100 + number,) * 2)
    files = [path for run in ('1', '2') for path in segments(tmp_path / run / RECORDING)]
    size = sum(path.stat().st_size for path in files)
    gone = prune(tmp_path, size * 0.4)
    assert gone == files[: len(gone)]
    assert len(gone) >= 4
    assert not (tmp_path / '1' / RECORDING).exists()
    assert read(tmp_path / '2' / RECORDING)


def test_a_file_that_another_recorder_just_deleted_keeps_no_other_from_being_deleted(
    tmp_path: Path,
) -> None:
    write(tmp_path / '1' / RECORDING, ['word ' * 100] * 4, segment_bytes=10).close()
    files = segments(tmp_path / '1' / RECORDING)
    (tmp_path / '0' / RECORDING).mkdir(parents=True)
    (tmp_path / '0' / RECORDING / f'{RECORDING}_0.mcap').symlink_to(tmp_path / 'gone')
    assert prune(tmp_path, 0) == files


def test_what_another_recorder_deletes_meanwhile_is_not_deleted_again_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / '1' / RECORDING, ['word ' * 100] * 4, segment_bytes=10).close()
    files = segments(tmp_path / '1' / RECORDING)
    for number, path in enumerate(files):
        os.utime(path, (number, number))
    size = sum(path.stat().st_size for path in files)

    def opened(path: Path, mode: str) -> Any:
        files[0].unlink(missing_ok=True)
        return open(path, mode)

    monkeypatch.setattr(bag, 'open', opened, raising=False)
    assert prune(tmp_path, size - 1) == []


def test_definitions_name_all_that_a_type_uses() -> None:
    text = definition('surveillance_interfaces/msg/FactChanges')
    for name in ('FactChange', 'Fact'):
        assert f'MSG: surveillance_interfaces/{name}\n' in text
    assert 'MSG: builtin_interfaces/Time\n' in text
    feedback = definition('surveillance_interfaces/action/FollowPath_FeedbackMessage')
    assert 'MSG: geometry_msgs/Point\n' in feedback
    assert 'uint8[16] uuid' in feedback
    with pytest.raises(match='no_msgs/msg/None is not installed'):
        message_class('no_msgs/msg/None')


def test_a_full_disk_costs_what_comes_while_it_is_full(disk: Disk, tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    writer = write(folder, ['before'])
    disk.full = True
    writer.write('/words', serialize_message(String(data='lost')), 1, 1)
    for _ in range(2):
        with pytest.raises(OSError, match='No space left'):
            writer.seal()
    disk.full = False
    writer.write('/words', serialize_message(String(data='after')), 2 * 10**18, 2 * 10**18)
    writer.seal()
    writer.close()
    assert read(folder) == ['before', 'after']
    assert sorted(path.name for path in folder.iterdir()) == [
        'metadata.yaml',
        'recording_0.mcap',
        'recording_1.mcap',
    ]


def test_own_types_are_read_with_the_definitions_in_the_file(tmp_path: Path) -> None:
    kind = 'surveillance_interfaces/msg/FactChanges'
    writer = BagWriter(tmp_path / 'recording')
    writer.add_topic(TopicType('/fact_changes', kind, definition(kind)))
    change = FactChange(added=True)
    change.fact.predicate, change.fact.arguments = 'URGENT', ['R3']
    message = FactChanges(reference_name='map', sequence=7, changes=[change])
    writer.write('/fact_changes', serialize_message(message), 1, 1)
    writer.close()
    with AnyReader([tmp_path / 'recording']) as reader:
        ((connection, _, data),) = reader.messages()
        found: Any = reader.deserialize(data, connection.msgtype)
    assert (found.reference_name, found.sequence) == ('map', 7)
    assert found.changes[0].fact.arguments == ['R3']


def test_changed_bytes_of_an_earlier_recording_stop_no_later_one(tmp_path: Path) -> None:
    """One byte in a summary once stopped the recorder of every later mission."""
    old, new = tmp_path / 'old' / RECORDING, tmp_path / 'new' / RECORDING
    write(old, ['one', 'two']).close()
    path, metadata = old / f'{RECORDING}_0.mcap', old / 'metadata.yaml'
    whole = path.read_bytes()
    named = 0
    for where in range(len(whole) - 400, len(whole) - 8, 3):
        for value in (0xFF, whole[where] ^ 1):
            changed = bytearray(whole)
            changed[where] = value
            path.write_bytes(changed)
            metadata.unlink(missing_ok=True)
            named += any('damaged' in line for line in repair(old))
            prune(tmp_path, 1e9)
    assert named > 10
    write(new, ['here']).close()
    assert read(new) == ['here']
