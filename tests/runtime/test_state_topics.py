"""State topics have one owner, whose word wins."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool, Header, UInt8

from surveillance_interfaces.msg import RobotPlace
from surveillance_runtime import state_topics
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription


def reader(graph: Any, kind: Any, topic: str, **options: Any) -> list[Any]:
    taken: list[Any] = []

    def take(message: Any) -> None:
        taken.append(message)
        graph.touch()

    StateSubscription(graph.add(PatrolNode, name='reader'), kind, topic, take, **options)
    return taken


def test_a_foreign_message_changes_nothing_and_is_answered(graph: Any) -> None:
    owner = graph.add(PatrolNode, name='owner')
    level = OwnedTopic(owner, UInt8, 'level')
    for percent in (100, 99, 98):
        level.publish(UInt8(data=percent))
    levels = reader(graph, UInt8, 'level')
    heard = graph.listen(UInt8, 'level', STATE_QOS)
    graph.until(lambda: levels and heard)
    stranger = graph.add(PatrolNode, name='stranger')
    stranger.create_publisher(UInt8, 'level', STATE_QOS).publish(UInt8(data=0))
    graph.until(lambda: any(each.data == 0 for each in heard))
    graph.until(lambda: heard[-1].data == 98)
    graph.until(lambda: ('topic', 'level') in owner.incidents.open())
    (_, told), *_ = [each for each in owner.health.findings() if 'level' in each[1]]
    assert told == 'level is published by /stranger, too: expected only owner'
    graph.drop(stranger)
    level.publish(UInt8(data=97))
    graph.until(lambda: levels[-1].data == 97)
    assert [each.data for each in levels] == [98, 97]


def test_an_owner_repeats_itself_and_its_reader_takes_each_state_once(graph: Any) -> None:
    owner = graph.add(PatrolNode, name='owner')
    topic = OwnedTopic(owner, UInt8, 'level', repeat=0.05)
    levels = reader(graph, UInt8, 'level')
    heard = graph.listen(UInt8, 'level', STATE_QOS)
    topic.publish(UInt8(data=5))
    graph.until(lambda: len(heard) >= 3)
    assert [each.data for each in levels] == [5]


def test_a_topic_of_changes_is_not_repeated_by_an_equal_foreign_value(graph: Any) -> None:
    owner = graph.add(PatrolNode, name='owner')
    low = OwnedTopic(owner, Bool, 'low', repeat=None)
    heard = graph.listen(Bool, 'low', STATE_QOS)
    low.publish(Bool(data=True))
    graph.until(lambda: len(heard) == 1)
    publisher = graph.node.create_publisher(Bool, 'low', STATE_QOS)
    publisher.publish(Bool(data=True))
    graph.until(lambda: len(heard) == 2)
    publisher.publish(Bool(data=False))
    graph.until(lambda: len(heard) == 4)
    # Two publishers are heard in any order.
    assert sorted(each.data for each in heard) == [False, True, True, True]


def test_a_long_foreign_value_is_answered_without_being_read(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = graph.add(PatrolNode, name='owner')
    plan = OwnedTopic(owner, Path, 'plan', repeat=None)
    heard = graph.listen(Path, 'plan', STATE_QOS)
    short, long = (Path(poses=[PoseStamped()] * count) for count in (200, 1000))
    # What is between the fields is undefined: the same value has the same bytes here.
    as_sent = serialize_message(long)
    monkeypatch.setattr(
        state_topics, 'serialize_message', lambda m: as_sent if m is long else serialize_message(m)
    )
    plan.publish(long)
    graph.until(lambda: len(heard) == 1)
    monkeypatch.setattr(state_topics, 'deserialize_message', lambda *_: pytest.fail('it is read'))
    publisher = graph.node.create_publisher(Path, 'plan', STATE_QOS)
    publisher.publish(as_sent)
    graph.until(lambda: len(heard) == 2)
    publisher.publish(short)
    graph.until(lambda: len(heard) == 4)
    plan.publish(short)
    graph.until(lambda: len(heard) == 5)
    publisher.publish(long)
    graph.until(lambda: len(heard) == 7)
    # Two publishers are heard in any order.
    said = sorted(len(each.poses) for each in heard)
    assert said == [200, 200, 200, 1000, 1000, 1000, 1000], 'an equal one is not answered'


def test_an_owner_that_was_started_again_is_heard(graph: Any) -> None:
    first = graph.add(PatrolNode, name='owner')
    topic = OwnedTopic(first, UInt8, 'level')
    for percent in range(10, 20):
        topic.publish(UInt8(data=percent))
    levels = reader(graph, UInt8, 'level')
    graph.until(lambda: levels)
    graph.drop(first)
    again = OwnedTopic(graph.add(PatrolNode, name='owner'), UInt8, 'level')
    again.publish(UInt8(data=50))
    graph.until(lambda: levels[-1].data == 50)


def test_a_stamp_ahead_of_the_clock_is_refused(graph: Any) -> None:
    places = reader(
        graph, RobotPlace, 'robot_place', stamp=lambda told: seconds_of(told.header.stamp)
    )
    said = graph.said()
    publisher = graph.node.create_publisher(RobotPlace, 'robot_place', STATE_QOS)

    def tell(place: str, ahead: float) -> None:
        stamp = graph.node.get_clock().now().to_msg()
        stamp.sec += int(ahead)
        publisher.publish(RobotPlace(header=Header(stamp=stamp), place=place))

    graph.until(lambda: publisher.get_subscription_count())
    for number in range(5):
        tell(f'R{number}', 3600.0)
    graph.until(lambda: any('ahead of this clock' in line for line in said))
    tell('R2', 0.0)
    graph.until(lambda: places)
    assert sum('ahead of this clock' in line for line in said) == 1
    assert [each.place for each in places] == ['R2']


def test_more_than_one_second_publisher_is_named_once_each(graph: Any) -> None:
    owner = graph.add(PatrolNode, name='owner')
    topic = OwnedTopic(owner, UInt8, 'level')
    topic.publish(UInt8(data=1))
    said = graph.said()
    for name, value in itertools.product(('one', 'two'), (7, 8)):
        node = graph.node if name == 'one' else owner
        node.create_publisher(UInt8, 'level', STATE_QOS).publish(UInt8(data=value))
    graph.until(lambda: any('incident [topic level, warning]' in line for line in said))


def test_the_first_of_two_other_programs_is_believed_and_the_second_named(graph: Any) -> None:
    """Neither repeats nor answers, as map_server, which was started first."""
    server = graph.add(PatrolNode, name='map_server').create_publisher(UInt8, 'map', STATE_QOS)
    server.publish(UInt8(data=1))
    maps: list[Any] = []
    node = graph.add(PatrolNode, name='reader')
    StateSubscription(node, UInt8, 'map', maps.append)
    graph.until(lambda: maps)
    stranger = graph.add(PatrolNode, name='stranger')
    publisher = stranger.create_publisher(UInt8, 'map', STATE_QOS)
    for number in (7, 8, 9):  # also one that goes on speaking
        publisher.publish(UInt8(data=number))
        publisher.wait_for_all_acked()
    graph.until(lambda: ('topic', 'map') in node.incidents.open())
    (_, told), *_ = [each for each in node.health.findings() if 'map' in each[1]]
    assert told == 'map is published by /stranger, too: /map_server is believed'
    server.publish(UInt8(data=2))
    graph.until(lambda: maps[-1].data == 2)
    graph.drop(stranger)
    graph.until(lambda: ('topic', 'map') not in node.incidents.open())
    assert [each.data for each in maps] == [1, 2]


def test_the_states_of_a_node_are_repeated_by_one_timer(graph: Any) -> None:
    owner = graph.add(PatrolNode, name='owner')
    before = len(list(owner.timers))
    heard = []
    for name in ('level', 'other'):
        OwnedTopic(owner, UInt8, name, repeat=0.05).publish(UInt8(data=5))
        heard.append(graph.listen(UInt8, name, STATE_QOS))
    assert len(list(owner.timers)) == before + 1
    graph.until(lambda: all(len(each) >= 3 for each in heard))
