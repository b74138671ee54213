"""A robot of a fleet is spoken for by the nodes of its own namespace alone."""

from __future__ import annotations

from typing import Any

from surveillance_interfaces.msg import FleetRobot
from surveillance_runtime.fleet_messages import (
    FLEET_QOS,
    FLEET_TOPIC,
    PATIENCE,
    SPEAKER_CAUSE,
    SPEAKS_FOR,
    OwnVoices,
    RobotSpeakers,
    hear_fleet,
)
from surveillance_runtime.node import PatrolNode

GRAPH = {b'1': '/site/anna/robot_behavior', b'2': '/site/bert/robot_behavior', b'3': '/stranger'}


def test_whoever_is_not_in_a_robots_namespace_does_not_speak_for_it() -> None:
    speakers = RobotSpeakers(lambda: GRAPH, '/site')
    assert speakers.stranger('anna', b'1', 0.0) is None
    assert speakers.stranger('bert', b'1', 0.0) == '/site/anna/robot_behavior'
    assert speakers.stranger('bert', b'3', 0.0) == '/stranger'
    assert speakers.stranger('', b'3', 0.0) == '/stranger'


def test_a_publisher_without_a_name_is_believed_until_the_robot_itself_is_known() -> None:
    graph = {b'9': ''}
    speakers = RobotSpeakers(lambda: graph, '')
    assert speakers.stranger('anna', b'9', 0.0) is None
    graph |= {b'1': '/anna/robot_behavior'}
    assert speakers.stranger('anna', b'9', 2 * PATIENCE) == 'a node without a name'
    assert speakers.stranger('anna', b'1', 2 * PATIENCE) is None


def test_the_graph_is_not_asked_for_each_message_of_an_unknown_publisher() -> None:
    looks: list[int] = []

    def graph() -> dict[bytes, str]:
        looks.append(1)
        return {}

    speakers = RobotSpeakers(graph, '')
    for step in range(100):
        speakers.stranger('anna', b'9', 0.001 * step)
    assert len(looks) == 1


def test_a_stranger_that_speaks_for_a_robot_is_named_and_not_heard(graph: Any) -> None:
    taken: list[FleetRobot] = []
    lines = graph.said()
    hear_fleet(graph.add(PatrolNode, name='reader', namespace='anna'), taken.append)
    topic = f'/anna/{FLEET_TOPIC}'
    stranger = graph.add(PatrolNode, name='stranger', namespace='other')
    false = stranger.create_publisher(FleetRobot, topic, FLEET_QOS)
    bert = graph.add(PatrolNode, name='robot_behavior', namespace='bert')
    true = bert.create_publisher(FleetRobot, topic, FLEET_QOS)

    def said() -> list[str]:
        false.publish(FleetRobot(robot='bert', place='R9'))
        true.publish(FleetRobot(robot='bert', place='R1'))
        return [text for text in lines if 'speaks for' in text]

    graph.until(lambda: said() and taken)
    assert {each.place for each in taken} == {'R1'}
    assert said() == [
        "fleet_robots: /other/stranger speaks for 'bert', which is not believed: "
        'expected a node in the namespace of that robot'
    ]


def test_a_robot_names_who_has_taken_its_name(graph: Any) -> None:
    """The fleet believes a node of the right full name; the robot hears that it is not itself."""
    bert = graph.add(PatrolNode, name='robot_behavior', namespace='bert')
    topic = f'/bert/{FLEET_TOPIC}'
    taken: list[FleetRobot] = []
    hear_fleet(bert, taken.append, own='bert')
    own = bert.create_publisher(FleetRobot, topic, FLEET_QOS)

    def speaks(*publishers: Any) -> bool:
        for each in publishers:
            each.publish(FleetRobot(robot='bert', place='R1'))
        return bool(taken)

    graph.until(lambda: speaks(own))
    assert not bert.incidents.open()
    false = graph.add(PatrolNode, name='robot_behavior', namespace='bert')
    second = false.create_publisher(FleetRobot, topic, FLEET_QOS)
    graph.until(lambda: speaks(own, second) and bool(bert.incidents.open()))
    (told,) = bert.incidents.updates()
    assert told.cause == SPEAKER_CAUSE
    assert told.text.startswith('2 nodes speak as bert on fleet_robots: ')
    assert told.text.count('/bert/robot_behavior (participant ') == 2


def test_a_voice_that_is_silent_counts_no_more() -> None:
    voices = OwnVoices()
    assert voices.hear(b'old', 0.0) == (b'old',)
    assert set(voices.hear(b'new', 1.0)) == {b'old', b'new'}
    assert voices.hear(b'new', 1.0 + SPEAKS_FOR) == (b'new',)
