"""The robots of a fleet, as whoever watches keeps them."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import String
from std_srvs.srv import SetBool

from surveillance_interfaces.msg import DoorStates
from surveillance_operator.fleet_actions import WORDS, FleetActions
from surveillance_operator.fleet_subscriber import FleetSubscriber
from surveillance_operator.mission_state import (
    FleetReport,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from tests.operator.peers import Robot


def test_robots_are_found_and_told_apart_and_share_the_place(graph: Any) -> None:
    watcher = graph.add(PatrolNode, name='mission_page')
    heard: list[tuple[str, str]] = []
    subscriber = FleetSubscriber(
        watcher, 0.02, lambda name, _new, told: heard.extend((name, each.text) for each in told)
    )
    assert subscriber.robots == ('',), 'one that is alone has no name'
    robots = {name: Robot(graph, name) for name in ('anna', 'bertha')}
    doors = graph.node.create_publisher(DoorStates, 'door_states', STATE_QOS)
    doors.publish(DoorStates(closed=['D']))
    reports = graph.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    graph.until(lambda: subscriber.robots == ('anna', 'bertha'))

    def known() -> bool:
        names = ('anna/motion_controller', 'bertha/motion_controller', 'armor_server')
        reports.publish(DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names]))
        seen = [subscriber.state(name) for name in robots]
        return all(
            each.task.status
            and each.sensors.pose
            and each.task.battery
            and each.task.fleet_report
            and each.place.doors
            and each.health.reports
            for each in seen
        )

    graph.until(known)
    anna, bertha = (subscriber.state(name) for name in robots)
    assert anna.task.status is not None
    assert bertha.task.status is not None
    assert (anna.task.status.place, bertha.task.status.place) == (
        'place_of_anna',
        'place_of_bertha',
    )
    assert (anna.task.battery, bertha.task.battery) == (40.0, 60.0)
    assert anna.task.fleet_report == FleetReport(('A', 'anna'), 'anna', runs_until=9.0)
    assert anna.place.doors == bertha.place.doors == {'D': False}
    assert anna.health.reports.keys() == {'anna/motion_controller', 'armor_server'}
    assert list(subscriber.see()) == ['anna', 'bertha', ''], 'what they share is last'
    topics = ('/diagnostics', watcher.resolve_topic_name('fleet_robots'), '/clock')
    heard_by = [len(watcher.get_subscriptions_info_by_topic(topic)) for topic in topics]
    assert heard_by == [1, 1, 1], 'who watches many robots hears each of them once'
    graph.until(lambda: 'robot_behavior' in subscriber.state('anna').health.nodes)
    # A program of one that ends is not one of the other.
    graph.remove(robots['anna'].node)
    graph.until(lambda: 'robot_behavior' in subscriber.state('anna').health.ended)
    assert 'robot_behavior' in subscriber.state('bertha').health.nodes
    assert ('anna', 'every node has ended: waiting for the next mission') in heard
    assert 'anna' in subscriber.robots, 'a robot that is gone is missed'


def test_a_robot_whose_behaviour_is_down_is_found_and_stopped_with_the_others(graph: Any) -> None:
    subscriber = FleetSubscriber(graph.add(PatrolNode, name='hands'), 0.02)
    Robot(graph, 'anna')
    monitor = graph.add(PatrolNode, name='collision_monitor', namespace='/bert')
    monitor.create_subscription(String, '/place', lambda _: None, STATE_QOS)
    stopped: list[bool] = []

    def stop(request: Any, response: Any) -> Any:
        stopped.append(request.data)
        response.success = True
        return response

    monitor.create_service(SetBool, 'stop', stop)
    graph.until(lambda: subscriber.robots == ('anna', 'bert'))
    FleetActions(graph.add(PatrolNode, name='keys'), lambda: subscriber.robots, 60.0).carry_out(
        'all', WORDS['stop'][1]
    )
    assert stopped == [True]
