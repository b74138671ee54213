"""A disk that can be full, a recording of another program, a browser."""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import pytest
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_operator import fleet_subscriber, node_graph_watch
from surveillance_operator.recording import bag as recorded_bag
from surveillance_operator.recording.schemas import definition
from tests.operator.browser import Viewer
from tests.operator.foreign_bag import START, said
from tests.operator.test_timeline import record


class Disk:
    """The disk of all recordings of a test.

    Attributes:
        full: Whether it takes no more bytes.
    """

    def __init__(self) -> None:
        self.full = False

    def open(self, path: Path, mode: str = 'r', **options: Any) -> IO[Any]:
        """Open a file as `open` does."""
        if mode != 'wb':
            return open(path, mode, **options)
        return io.BufferedWriter(_File(self, path))


class _File(io.FileIO):
    def __init__(self, disk: Disk, path: Path) -> None:
        super().__init__(path, 'wb')
        self._disk = disk

    def write(self, data: Any, /) -> int:
        if self._disk.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    """Return the disk that recordings are written to."""
    made = Disk()
    monkeypatch.setattr(recorded_bag, 'open', made.open, raising=False)
    return made


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


@pytest.fixture(scope='module')
def browser() -> Iterator[Viewer]:
    viewer = Viewer('about:blank')
    yield viewer
    viewer.close()


@pytest.fixture(autouse=True)
def _look_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have nodes and robots that come and go be seen at once."""
    for module in (node_graph_watch, fleet_subscriber):
        monkeypatch.setattr(module, 'LOOK_PERIOD', 0.05)


ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    folder = tmp_path / 'runs' / '20260101-000000'
    folder.mkdir(parents=True)
    record(folder / 'timeline.jsonl')
    (folder / 'place.yaml').write_bytes((ROOT / 'config/seven_rooms.yaml').read_bytes())
    with MissionRecord(folder / 'events.jsonl') as mission:
        mission.write(
            'start',
            0.0,
            machine='surveillance',
            place='E',
            places=['R1', 'R2', 'R3', 'R4', 'E', 'C1', 'C2'],
        )
        mission.write(
            'decision', 1.0, place='C1', rule='CORRIDOR', reason='<b>C1</b> waits longest'
        )
        mission.write('visit', 11.0, place='C1', distance=5.4)
        mission.write('failure', 12.0, what='MOVE', reason='no way')
        mission.write('recharge', 20.0, place='E', seconds=5.0)
        mission.write('end', 60.0)
    return folder
