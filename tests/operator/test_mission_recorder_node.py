"""The recording node among real publishers."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid
from PIL import Image as PictureFile
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import CompressedImage, Image, LaserScan
from std_msgs.msg import String

from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import Decision
from surveillance_operator import mission_recorder_node
from surveillance_operator.mission_recorder_node import MissionRecorder
from surveillance_operator.recording.reading import Messages
from surveillance_operator.recording.timeline import Timeline
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from tests.operator.conftest import Disk


def test_every_message_comes_back_as_it_was_published(graph: Any, tmp_path: Path) -> None:
    feedback = FollowPath.Impl.FeedbackMessage()
    feedback.feedback.position.x = 2.5
    grid = OccupancyGrid(data=[0, 100, -1, 0])
    grid.info.width = grid.info.height = 2
    grid.info.resolution = 0.5
    published = {
        '/decision': (Decision(sequence=3, place='R3', candidates=['R3'], scores=[0.5]), STATE_QOS),
        '/map': (grid, STATE_QOS),
        '/scan': (LaserScan(ranges=np.linspace(0, 1, 50, dtype=np.float32)), SENSOR_QOS),
        '/follow_path/_action/feedback': (feedback, 10),
        '/words': (String(data='ü → ∞'), 10),
    }
    publishers = {
        topic: graph.node.create_publisher(type(message), topic, qos)
        for topic, (message, qos) in published.items()
    }
    images = graph.node.create_publisher(Image, '/image', 1)
    folder = tmp_path / '20260101-000000' / 'recording'
    recorder = graph.add(MissionRecorder, parameters={'folder': str(folder)})
    graph.until(lambda: all(p.get_subscription_count() for p in publishers.values()))
    for topic, (message, _) in published.items():
        publishers[topic].publish(message)
    timeline = folder.parent / 'timeline.jsonl'
    graph.until(lambda: b'R3' in timeline.read_bytes())
    assert images.get_subscription_count() == 0
    graph.remove(recorder)

    found = {topic: data for topic, _, data in Messages(folder).in_order() if topic in published}
    assert found.keys() == published.keys()
    for topic, data in found.items():
        message = published[topic][0]
        assert deserialize_message(data, type(message)) == message
    with AnyReader([folder]) as reader:
        for connection, _, data in reader.messages():
            read: Any = reader.deserialize(data, connection.msgtype)
            if connection.topic == '/decision':
                assert (read.sequence, read.place) == (3, 'R3')
            if connection.topic == '/follow_path/_action/feedback':
                assert read.feedback.position.x == 2.5
    assert Timeline(timeline).at(1e12)[2]['decision']['place'] == 'R3'


def test_what_the_base_hears_is_recorded_where_its_topic_has_the_name_of_what_is_wanted(
    graph: Any, tmp_path: Path
) -> None:
    folder = tmp_path / 'recording'
    base = graph.node.create_publisher(TwistStamped, 'cmd_vel', 1)
    wanted = graph.node.create_publisher(Twist, 'cmd_vel_wanted', 1)
    renamed = ['-r', 'cmd_vel:=cmd_vel_wanted', '-r', 'cmd_vel_monitored:=cmd_vel']
    recorder = graph.add(
        MissionRecorder,
        parameters={'folder': str(folder)},
        cli_args=['--ros-args', *renamed],
    )
    graph.until(lambda: base.get_subscription_count() and wanted.get_subscription_count())
    assert recorder._bag._topics.keys() >= {'/cmd_vel', '/cmd_vel_wanted'}


def test_a_full_disk_is_waited_for(
    graph: Any, disk: Disk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mission_recorder_node, 'RETRY_PERIOD', 0.05)
    folder = tmp_path / 'recording'
    words = graph.node.create_publisher(String, '/words', STATE_QOS)
    said = graph.said()
    disk.full = True
    recorder = graph.add(MissionRecorder, parameters={'folder': str(folder)})
    graph.until(lambda: any('nothing is recorded' in line for line in said))
    disk.full = False
    graph.until(lambda: any('continues' in line for line in said))
    graph.until(words.get_subscription_count)
    words.publish(String(data='after'))
    disk.full = True
    graph.until(lambda: sum('nothing is recorded' in line for line in said) == 2)
    disk.full = False
    graph.until(lambda: sum('continues' in line for line in said) == 2)
    graph.remove(recorder)
    assert recorder.failure is None
    complaint = f'nothing is recorded at present: {folder}: No space left on device'
    assert complaint in said
    assert len([line for line in said if 'record' in line]) <= 5
    assert [topic for topic, _, _ in Messages(folder).in_order()].count('/words') <= 1


def test_an_image_a_second_is_kept_where_somebody_looks(graph: Any, tmp_path: Path) -> None:
    folder = tmp_path / 'recording'
    seen, unseen = (graph.node.create_publisher(Image, name, 1) for name in ('/seen', '/unseen'))
    looks = graph.listen(Image, '/seen')
    parameters = {'folder': str(folder), 'image_period': 0.1}
    recorder = graph.add(MissionRecorder, parameters=parameters)
    picture = Image(width=4, height=2, step=12, encoding='rgb8', data=bytes(24))
    picture.header.frame_id = 'camera'
    graph.until(lambda: seen.get_subscription_count() == 2)

    def recorded() -> bool:
        seen.publish(picture)
        return bool(looks) and '/seen/compressed' in recorder._bag._topics

    graph.until(recorded)
    assert unseen.get_subscription_count() == 0
    graph.remove(recorder)
    kept = [
        deserialize_message(data, CompressedImage)
        for topic, _, data in Messages(folder).in_order()
        if topic == '/seen/compressed'
    ]
    assert kept[0].header.frame_id == 'camera'
    assert PictureFile.open(io.BytesIO(bytes(kept[0].data))).size == (4, 2)
    assert not [t for t, _, _ in Messages(folder).in_order() if t in ('/seen', '/unseen')]


@pytest.mark.usefixtures('incidents_at_once')
def test_two_types_on_one_name_are_told_with_both_owners(graph: Any, tmp_path: Path) -> None:
    # The middleware refuses a second type to one participant: the other node is of its own.
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=graph.context.get_domain_id())
    planner = rclpy.create_node('planner_server', context=context)
    try:
        theirs = planner.create_publisher(String, '/follow_path/_action/feedback', STATE_QOS)
        ours = graph.node.create_publisher(
            FollowPath.Impl.FeedbackMessage, '/follow_path/_action/feedback', STATE_QOS
        )
        theirs.publish(String(data='not ours'))
        folder = tmp_path / '20260101-000000' / 'recording'
        recorder = graph.add(MissionRecorder, parameters={'folder': str(folder)})

        def told() -> list[str]:
            return [each.text for each in recorder.incidents.updates()]

        graph.until(lambda: any('String of /planner_server' in text for text in told()))
        (text,) = told()
        assert 'FollowPath_FeedbackMessage of /test' in text
        # What comes of the known type is recorded still.
        words = graph.node.create_publisher(String, '/words', STATE_QOS)
        words.publish(String(data='recorded'))
        graph.until(words.get_subscription_count)
        planner.destroy_publisher(theirs)
        graph.until(lambda: not told())
        assert ours is not None
    finally:
        planner.destroy_node()
        rclpy.shutdown(context=context)


def test_a_type_that_is_not_installed_costs_its_topic(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = mission_recorder_node.message_class

    def lacking(kind: str) -> Any:
        if kind.endswith('LaserScan'):
            raise ModuleNotFoundError("No module named 'bond'")
        return known(kind)

    monkeypatch.setattr(mission_recorder_node, 'message_class', lacking)
    said = graph.said()
    lacked = graph.node.create_publisher(LaserScan, '/bond', 1)
    words = graph.node.create_publisher(String, '/words', STATE_QOS)
    folder = tmp_path / '20260101-000000' / 'recording'
    graph.add(MissionRecorder, parameters={'folder': str(folder)})
    graph.until(words.get_subscription_count)
    graph.until(lambda: any("/bond is not recorded: No module named 'bond'" in e for e in said))
    assert lacked.get_subscription_count() == 0
