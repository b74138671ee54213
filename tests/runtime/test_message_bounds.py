"""Messages that are too long for a callback: refused in one line, others taken."""

from __future__ import annotations

from typing import Any

import pytest
from rcl_interfaces.srv import ListParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import DoorStates, OntologyMap, OntologyPlace
from surveillance_runtime.conversions import trajectory_from
from surveillance_runtime.message_bounds import (
    MOST_BYTES,
    MOST_ELEMENTS,
    MOST_VALUES,
    check_bytes,
    check_length,
    lists_of,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription


def test_arrays_of_messages_and_texts_are_found() -> None:
    assert lists_of(OntologyMap) == ('places',)
    assert 'data' not in lists_of(PointCloud2)


@pytest.mark.parametrize('kind', [OntologyMap, DoorStates])
def test_what_is_too_long_is_said(kind: Any) -> None:
    name = lists_of(kind)[0]
    element = OntologyPlace() if kind is OntologyMap else 'D1'
    message = kind(**{name: [element] * MOST_ELEMENTS})
    check_length(message)
    setattr(message, name, [element] * (MOST_ELEMENTS + 1))
    with pytest.raises(ValueError, match=f'{name} has {MOST_ELEMENTS + 1} elements: expected at'):
        check_length(message)


def test_bytes_count_where_nothing_but_messages_and_texts_is_long() -> None:
    check_bytes(bytes(MOST_BYTES + 1), PointCloud2)
    check_bytes(bytes(MOST_BYTES), OntologyMap)
    with pytest.raises(ValueError, match='expected at most'):
        check_bytes(bytes(MOST_BYTES + 1), OntologyMap)
    cloud = PointCloud2(fields=[PointField()] * 3, data=bytes(2 * MOST_BYTES))
    check_bytes(serialize_message(cloud), PointCloud2)


@pytest.mark.parametrize('owned', [True, False])
def test_a_node_refuses_a_long_message_and_takes_the_next(graph: Any, owned: bool) -> None:
    graph.may_fail = True
    node, heard = graph.add(PatrolNode, name='node'), []
    if owned:
        StateSubscription(node, DoorStates, 'doors', heard.append)
    else:
        node.create_subscription(DoorStates, 'doors', heard.append, 10)
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = graph.node.create_publisher(DoorStates, 'doors', latched)
    graph.until(publisher.get_subscription_count)
    publisher.publish(DoorStates(open=['x' * 100] * 10_000))
    publisher.publish(DoorStates(open=['D1']))
    graph.until(lambda: heard)
    assert [each.open for each in heard] == [['D1']]


def test_a_long_request_for_parameters_is_refused_with_an_answer(graph: Any) -> None:
    graph.add(PatrolNode, name='node')
    lister = ServiceCaller(graph.node, ListParameters, 'node/list_parameters')
    assert not lister.call(ListParameters.Request(prefixes=['x'] * 5000), 60.0).result.names
    assert lister.call(ListParameters.Request(), 60.0).result.names
    setter = ServiceCaller(graph.node, SetParameters, 'node/set_parameters')
    request = SetParameters.Request()
    answer = setter.call(request, 60.0)
    assert len(answer.results) == 0


def test_a_request_that_sets_long_values_is_refused_with_an_answer(graph: Any) -> None:
    node = graph.add(PatrolNode, name='node')
    node.declare_parameter('numbers', [1])
    setter = ServiceCaller(graph.node, SetParameters, 'node/set_parameters')
    for count, is_taken in ((MOST_VALUES, True), (MOST_VALUES + 1, False)):
        wish = Parameter('numbers', value=[5] * count).to_parameter_msg()
        (result,) = setter.call(SetParameters.Request(parameters=[wish]), 60.0).results
        assert result.successful is is_taken, result.reason
    assert f'{MOST_VALUES + 1} elements: expected at most {MOST_VALUES}' in result.reason
    assert len(node.get_parameter('numbers').value) == MOST_VALUES


def test_a_trajectory_has_no_more_values_than_joints() -> None:
    point = JointTrajectoryPoint(positions=[0.0] * 3)
    assert trajectory_from(JointTrajectory(joint_names=['a', 'b', 'c'], points=[point]))
    with pytest.raises(ValueError, match='more values than its 2 joints'):
        trajectory_from(JointTrajectory(joint_names=['a', 'b'], points=[point]))
    with pytest.raises(ValueError, match='expected at most 100'):
        trajectory_from(JointTrajectory(joint_names=['a'] * 101))
