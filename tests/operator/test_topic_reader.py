"""What came on the topics of a mission, taken when it is asked for."""

from __future__ import annotations

from typing import Any

from std_msgs.msg import UInt8

from surveillance_interfaces.msg import FleetRobot, MissionStatus
from surveillance_operator.topic_reader import TopicReader
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS


def taken(graph: Any, reader: TopicReader, topic: str) -> list[Any]:
    """Return the messages of a topic, once there are some."""
    came: list[Any] = []

    def some() -> bool:
        came.extend(message for each, message in reader.take() if each.name == topic)
        return bool(came)

    graph.until(some)
    return came


def test_a_message_is_taken_once(graph: Any) -> None:
    reader = TopicReader(graph.add(PatrolNode, name='watcher'))
    publisher = graph.node.create_publisher(UInt8, 'battery_level', STATE_QOS)
    publisher.publish(UInt8(data=50))
    assert [each.data for each in taken(graph, reader, 'battery_level')] == [50]
    assert not any(topic.name == 'battery_level' for topic, _ in reader.take())


def test_a_repeated_state_is_read_once_and_anew_for_the_next_mission(graph: Any) -> None:
    reader = TopicReader(graph.add(PatrolNode, name='watcher'))
    states = graph.node.create_publisher(UInt8, 'battery_level', STATE_QOS)
    ends = graph.node.create_publisher(MissionStatus, 'mission_status', STATE_QOS)

    def levels_until(state: str) -> list[int]:
        ends.publish(MissionStatus(state=state))
        came: list[tuple[str, Any]] = []

        def some() -> bool:
            came.extend((topic.name, message) for topic, message in reader.take())
            return any(name == 'mission_status' and told.state == state for name, told in came)

        graph.until(some)
        return [told.data for name, told in came if name == 'battery_level']

    states.publish(UInt8(data=50))
    assert [each.data for each in taken(graph, reader, 'battery_level')] == [50]
    for state in 'abc':
        states.publish(UInt8(data=50))
        assert levels_until(state) == []
    reader.forget()
    states.publish(UInt8(data=50))
    assert [each.data for each in taken(graph, reader, 'battery_level')] == [50]
    # What is no message at all ends nothing.
    states.publish(b'')
    states.publish(UInt8(data=49))
    assert [each.data for each in taken(graph, reader, 'battery_level')] == [49]


def test_what_all_robots_say_on_one_topic_goes_to_the_one_that_it_concerns(graph: Any) -> None:
    node = graph.add(PatrolNode, name='watcher')
    place = TopicReader(node)
    place.robots = {name: TopicReader(node, name) for name in ('anna', 'bert')}
    assert all(topic.whose is None for topic, _ in place.robots['anna']), 'it hears none of them'
    publisher = graph.node.create_publisher(FleetRobot, 'fleet_robots', 10)
    graph.until(publisher.get_subscription_count)
    publisher.publish(FleetRobot(robot='anna', stop='A'))
    taken(graph, place, 'fleet_robots')
    (mine,) = place.robots['anna'].take()
    assert mine[1].stop == 'A'
    assert place.robots['bert'].take() == []
