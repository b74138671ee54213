"""The watching node among real and scripted peers."""

from __future__ import annotations

import json
from functools import partial
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import QoSProfile
from rclpy.task import Future
from rich.console import Console
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, UInt8

from state_machines.ros import ServiceCaller
from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import Decision, DoorStates, MissionStatus
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_operator import mission_view_node, node_graph_watch
from surveillance_operator.mission_view_node import MissionViewNode
from surveillance_runtime.conversions import cloud_from_points
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

PLACE = {
    'map.A': ['D'],
    'map.B': ['D'],
    'room_positions.A': [1.0, 1.0],
    'room_positions.B': [5.0, 1.0],
    'robot_room': 'A',
    'recharge_rooms': ['A'],
}


class Planner(PatrolNode):
    """The planner's parameters."""

    def __init__(self, **options: Any) -> None:
        super().__init__('planner_controller', **options)
        self.parameter('execution_mode', 'SIMULATED', 'Mode.')
        for table in ('doors', 'keep_out_zones', 'slow_zones'):
            self.parameters_under(table)


@pytest.fixture(autouse=True)
def _look_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_graph_watch, 'LOOK_PERIOD', 0.05)
    return


def say(graph: Any, topic: str, message: Any, qos: Any = STATE_QOS) -> Any:
    publisher = graph.node.create_publisher(type(message), topic, qos)
    publisher.publish(message)
    return publisher


def test_what_a_peer_says_commands_no_terminal(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    printed: list[str] = []
    monkeypatch.setattr(mission_view_node, 'print_lines', printed.append)
    said = MissionStatus(state='MOVE', place='\x1b[2J', heading_to='E\nlaunch | forged')
    publisher = say(graph, 'mission_status', said)
    view = graph.add(MissionViewNode)
    graph.until(lambda: view.state.task.status)
    told = r'in \x1b[2J, heading for E\nlaunch | forged'
    graph.until(lambda: any(told in line for line in printed))
    assert publisher is not None


def change_place(graph: Any, **changes: Any) -> None:
    """Have the map builder go on with another place, whose station is in B."""
    described = {
        'map': {'A': ['D'], 'B': ['D']},
        'room_positions': {'A': [1.0, 1.0], 'B': [5.0, 1.0]},
        'robot_room': 'A',
        'recharge_rooms': ['B'],
        'station': [5.0, 2.0, 0.0],
        **changes,
    }
    command = graph.node.create_client(ConsoleCommand, 'ontology_map/set_place')
    graph.until(command.service_is_ready)
    asked = command.call_async(ConsoleCommand.Request(line=json.dumps(described)))
    graph.until(asked.done)
    assert asked.result().accepted, asked.result().answer


def test_zones_and_stations_follow_a_changed_place(graph: Any) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, parameters={**PLACE, 'station': [1.0, 2.0, 0.5]})
    zone = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0]
    graph.add(Planner, parameters={'keep_out_zones.K': zone, 'slow_zones.S': [0.3, *zone]})
    view = graph.add(MissionViewNode)
    graph.until(lambda: view.state.place.stations == {'A': (1.0, 2.0, 0.5)})
    graph.until(lambda: {'K', 'S'} == set(view.state.place.zones))
    assert view.state.place.zones['S'].speed == 0.3
    change_place(graph, slow_zones={'S': [0.2, *zone]})
    graph.until(lambda: view.state.place.stations == {'B': (5.0, 2.0, 0.0)})
    assert {name: zone.speed for name, zone in view.state.place.zones.items()} == {'S': 0.2}


def test_a_point_that_is_moved_while_it_is_asked_for_is_asked_for_again(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[Future] = []
    ask = ServiceCaller.call_async

    async def hold_first(self: ServiceCaller, request: Any, timeout: float) -> Any:
        answer = await ask(self, request, timeout)
        if not held and getattr(request, 'room_name', '') == 'B':
            held.append(Future(executor=graph.node.executor))
            await held[0]
        return answer

    monkeypatch.setattr(ServiceCaller, 'call_async', hold_first)
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, parameters={**PLACE, 'station': [1.0, 2.0, 0.5]})
    graph.add(Planner)
    view = graph.add(MissionViewNode)
    graph.until(lambda: held and view.state.place.stations)
    change_place(graph, room_positions={'A': [1.0, 1.0], 'B': [6.0, 1.0]})
    graph.until(lambda: view.state.place.stations == {'B': (5.0, 2.0, 0.0)})
    graph.node.executor.create_task(held[0].set_result, None)
    graph.until(lambda: view.state.place.positions == {'A': (1.0, 1.0), 'B': (6.0, 1.0)})


def test_another_mission_may_have_another_ontology(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(node_graph_watch, 'WHOLE_LOOK_PERIOD', 0.05)
    graph.add(ArmorServer)
    view = graph.add(MissionViewNode)
    for reference, room in (('first', 'B'), ('second', 'C')):
        place = {key.replace('B', room): value for key, value in PLACE.items()}
        parameters = {**place, 'ontology_reference': reference}
        nodes = graph.add(OntologyMapBuilder, parameters=parameters), graph.add(Planner)
        graph.until(lambda room=room: set(view.state.place.positions) == {'A', room})
        for node in nodes:
            graph.remove(node)
        graph.until(lambda: not view.state.health.nodes)


def test_it_gathers_what_topics_ontology_and_parameters_tell(graph: Any) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, parameters=PLACE)
    planner = graph.add(Planner, parameters={'doors.D': [3.0, 1.0, 0.0, 1.0]})
    view = graph.add(MissionViewNode)

    grid = OccupancyGrid(data=[0, 100, -1, 0, 0, 0])
    grid.info.width, grid.info.height, grid.info.resolution = 3, 2, 0.5
    say(graph, 'map', grid)
    say(graph, 'mission_status', MissionStatus(machine='surveillance', state='MOVE', place='A'))
    say(graph, 'decision', Decision(sequence=4, from_place='A', place='B', rule='URGENT'))
    say(graph, 'battery_level', UInt8(data=15))
    say(graph, 'battery_low', Bool(data=True))
    say(graph, 'door_states', DoorStates(closed=['D']))
    say(graph, 'obstacles', cloud_from_points(np.array([[2.0, 1.0]])))
    pose = PoseWithCovarianceStamped()
    pose.pose.pose.position.x, pose.pose.pose.orientation.w = 1.5, 1.0
    say(graph, 'amcl_pose', pose)

    graph.until(
        lambda: (
            view.state.task.mode == 'SIMULATED'
            and view.state.place.positions == {'A': (1.0, 1.0), 'B': (5.0, 1.0)}
            and view.state.place.visited_at.keys() == {'A', 'B'}
            and view.state.place.links
            and view.state.sensors.pose
            and view.state.place.doors
            and view.state.sensors.obstacles is not None
            and view.state.place.grid is not None
            and view.state.task.battery_low
            and 'planner_controller' in view.state.health.nodes
        )
    )
    seen = view.see()['']
    assert seen.task.battery == 15.0
    assert seen.task.status is not None
    assert seen.task.status.state == 'MOVE'
    assert seen.task.decision is not None
    assert (seen.task.decision_number, seen.task.decision.place) == (4, 'B')
    assert seen.place.grid is not None
    assert seen.place.grid.cells.tolist() == [[0, 100, -1], [0, 0, 0]]
    assert seen.place.doors == {'D': False}
    assert seen.place.door_lines['D'] == pytest.approx((2.5, 1.0, 3.5, 1.0))
    assert seen.sensors.obstacles is not None
    assert seen.sensors.obstacles.tolist() == [[2.0, 1.0]]
    assert seen.sensors.pose == (1.5, 0.0, 0.0)
    assert seen.sensors.trail.tolist() == [[1.5, 0.0]]
    assert seen.place.visited_at == {'A': 0.0, 'B': 0.0}  # never yet
    assert 'door D closed' in [each.text for each in seen.notices]

    graph.remove(planner)
    graph.until(lambda: view.state.health.ended == {'planner_controller'})
    assert ('planner_controller ended') in view.state.notices[-1].text


def test_where_nobody_estimates_the_pose_the_feedback_of_the_drive_tells_it(graph: Any) -> None:
    view = graph.add(MissionViewNode)
    kind = FollowPath.Impl.FeedbackMessage
    drive = graph.node.create_publisher(kind, 'follow_path/_action/feedback', 1)
    graph.until(drive.get_subscription_count)
    for x in (1.0, 2.0):
        message = kind()
        message.feedback.position.x = message.feedback.position.y = x
        drive.publish(message)
        graph.until(lambda x=x: view.state.sensors.pose and view.state.sensors.pose[0] == x)
    assert view.state.sensors.pose == pytest.approx((2.0, 2.0, np.pi / 4))


def test_why_a_topic_cannot_be_used_is_known(graph: Any) -> None:
    view = graph.add(MissionViewNode)
    say(graph, 'battery_level', UInt8(data=50), QoSProfile(depth=1))
    say(graph, 'map', OccupancyGrid(data=[0, 0]))
    graph.until(lambda: {'battery_level', 'map'} <= view.state.health.silent.keys())
    assert 'another DURABILITY' in view.state.health.silent['battery_level']
    assert 'a map of 2 cells' in view.state.health.silent['map']


def test_the_next_mission_begins_with_an_empty_picture(graph: Any) -> None:
    view = graph.add(MissionViewNode, namespace='alone')
    status = say(graph, '/alone/mission_status', MissionStatus(state='FIRST'))
    battery = say(graph, '/alone/battery_level', UInt8(data=50))
    clock = say(graph, '/clock', Clock(clock=Time(sec=100)))
    graph.until(lambda: view.state.task.battery == 50 and view.state.health.nodes)
    graph.until(lambda: view.see()[''].now == 100.0)
    for publisher in (status, battery, clock):
        graph.node.destroy_publisher(publisher)
    graph.until(lambda: not view.state.health.nodes)
    frozen = view.see()['']
    assert frozen.task.status is not None
    assert frozen.task.status.state == 'FIRST'
    assert view.see()[''].now == frozen.now
    reports = say(graph, '/diagnostics', DiagnosticArray(status=[DiagnosticStatus(name='x')]), 10)

    def reported() -> bool:  # an observer of the mission, which goes on
        reports.publish(DiagnosticArray(status=[DiagnosticStatus(name='x')]))
        return 'x' in view.state.health.reports

    graph.until(reported)
    assert view.see()[''].task.status == frozen.task.status
    assert view.see()[''].now == 100.0  # no wait grows by the time of day

    say(graph, '/alone/mission_status', MissionStatus(state='SECOND'))
    graph.until(lambda: view.state.task.status and view.state.task.status.state == 'SECOND')
    assert view.state.task.battery is None
    assert view.state.history.battery == ()
    assert view.see()[''].now > 1e9
    assert any('waiting for the next mission' in each.text for each in view.state.notices)


def test_that_the_observers_of_an_ended_mission_are_gone_is_no_fault(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = graph.add(MissionViewNode)
    status = say(graph, 'mission_status', MissionStatus(state='MOVE'))
    graph.until(lambda: view.state.health.nodes)
    names = ('mission_recorder', 'arm_controller')
    reports = DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names])
    say(graph, '/diagnostics', reports, 10)
    graph.until(lambda: view.state.health.reports.keys() == set(names))
    monkeypatch.setattr(node_graph_watch, 'STALE_AFTER', 0.0)
    graph.until(lambda: [each.level for each in view.state.health.reports.values()] == [3, 3])
    graph.node.destroy_publisher(status)
    graph.until(lambda: view.state.health.reports.keys() == {'arm_controller'})


def test_a_terminal_that_cannot_draw_gets_lines(
    graph: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    dumb = partial(Console, force_terminal=True, _environ={'TERM': 'dumb'})
    monkeypatch.setattr(mission_view_node, 'Console', dumb)
    graph.add(MissionViewNode)
    assert capsys.readouterr().out.startswith('watching ROS domain')
