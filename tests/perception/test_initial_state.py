"""The node `initial_state` with a scripted arm and a scripted detector."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from std_msgs.msg import Int32
from std_srvs.srv import Empty

from state_machines.ros import GoalServer
from surveillance_behaviour.initial_state_node import InitialState
from surveillance_behaviour.map_from_markers import scan_peers
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.msg import MarkerDetectionArray, OntologyMap
from surveillance_interfaces.srv import MarkerRoutine, ReferenceName
from surveillance_perception.marker_server_node import MarkerServer
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import STATE_QOS

CONFIGURED = {
    'map_source': 'configuration',
    'map.A': ['D'],
    'map.B': ['D'],
    'room_positions.A': [1.0, 2.0],
    'room_positions.B': [3.0, 4.0],
    'robot_room': 'A',
}


class Robot:
    """An arm that is wherever it is told to be, and a detector that sees given ids at each pose."""

    def __init__(self, graph: Any, by_pose: dict[int, list[int]]) -> None:
        self.graph = graph
        self.by_pose = by_pose
        self.poses: list[int] = []
        self.maps = graph.listen(OntologyMap, 'ontology_map/build_map', STATE_QOS)
        self.ids = graph.node.create_publisher(Int32, 'aruco_detector/id', 100)
        topic = 'aruco_detector/detections'  # it tells of no picture
        self.detections = graph.node.create_publisher(MarkerDetectionArray, topic, 10)
        graph.node.create_service(MarkerRoutine, 'move_arm', self._move)
        graph.node.create_service(ReferenceName, 'ontology_map/reference_name', self._built)

    def _move(self, request: Any, response: Any) -> Any:
        self.poses.append(request.pos)
        for marker_id in self.by_pose.get(request.pos, []):
            self.show(marker_id)
        response.success = True
        return response

    @staticmethod
    def _built(_request: Any, response: Any) -> Any:
        response.name = 'surveillance'
        return response

    def show(self, marker_id: int) -> None:
        self.ids.publish(Int32(data=marker_id))

    def start(self) -> Any:
        client = self.graph.node.create_client(Empty, 'start')
        self.graph.until(client.service_is_ready)
        self.graph.until(lambda: self.ids.get_subscription_count())
        return client.call_async(Empty.Request())

    def rooms(self) -> set[str]:
        return {place.name for place in self.maps[-1].places}


def test_start_takes_the_poses_and_sends_the_map(graph: Any) -> None:
    robot = Robot(graph, {1: [11, 12, 99], 2: [13, 14], 3: [15, 16, 17]})
    graph.add(MarkerServer)
    graph.add(InitialState, parameters={'robot_room': 'E', 'patience': 0.3})
    first, second = robot.start(), robot.start()
    graph.until(lambda: first.done() and second.done() and robot.maps)
    assert robot.rooms() == {'E', 'C1', 'C2', 'R1', 'R2', 'R3', 'R4'}
    assert robot.maps[-1].robot_room == 'E'
    by_name = {place.name: place for place in robot.maps[-1].places}
    assert (by_name['R3'].position.x, by_name['R3'].position.y) == (9.0, 3.0)
    doors = {each.through_door: each.connected_to for each in by_name['C2'].connections}
    assert doors == {'D6': 'E', 'D7': 'C1', 'D3': 'R3', 'D4': 'R4'}
    assert robot.poses == [1, 2, 3, MarkerRoutine.Request.HOME]


def test_later_markers_extend_the_map(graph: Any) -> None:
    robot = Robot(graph, {1: [11, 13]})
    graph.add(MarkerServer)
    options = {'robot_room': 'E', 'patience': 0.1, 'deadline': 0.0}
    graph.add(InitialState, parameters=options)
    graph.until(robot.start().done)
    for shown, rooms in (
        ((), {'E', 'C2'}),
        ((17,), {'E', 'C2', 'R4'}),
        ((99, 16), {'E', 'C2', 'R3', 'R4'}),
    ):
        for each in shown:
            robot.show(each)
        graph.until(lambda rooms=rooms: robot.maps and robot.rooms() == rooms)


def test_a_map_that_is_not_complete_is_looked_at_again_on_patrol(graph: Any) -> None:
    robot = Robot(graph, {1: [11, 12, 13, 14, 15, 16]})
    arm = graph.add(PatrolNode, name='arm')
    in_view = threading.Event()

    def look(_goal: Any, _run: Any) -> Any:
        if in_view.is_set():
            robot.show(17)
        return ScanSurroundings.Result()

    GoalServer(arm, ScanSurroundings, 'scan_surroundings', look, lambda _goal: True)
    graph.add(MarkerServer)
    options = {'robot_room': 'E', 'patience': 0.1, 'deadline': 0.0, 'look_again': 0.2}
    graph.add(InitialState, parameters=options)
    graph.until(robot.start().done)
    graph.until(lambda: robot.maps)
    assert 'R4' not in robot.rooms()
    in_view.set()
    graph.until(lambda: 'R4' in robot.rooms())


def test_an_arm_that_takes_a_scan_and_says_nothing_holds_nothing_up(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scan_peers, '_SILENCE', 0.1)
    robot = Robot(graph, {1: [11, 12, 13, 14, 15, 16]})
    logged = graph.said()
    arm = graph.add(PatrolNode, name='arm')
    over = threading.Event()

    def look(_goal: Any, _run: Any) -> Any:
        over.wait(60.0)
        return ScanSurroundings.Result()

    GoalServer(arm, ScanSurroundings, 'scan_surroundings', look, lambda _goal: True)
    graph.add(MarkerServer)
    graph.add(InitialState, parameters={'robot_room': 'E', 'patience': 0.1, 'dwell': 0.1})
    try:
        started = robot.start()
        graph.until(lambda: any(each.startswith('scan given up: no view') for each in logged))
        robot.show(17)
        graph.until(started.done)
    finally:
        over.set()
    assert 'R4' in robot.rooms()


def test_a_scan_whose_node_was_killed_goes_on_where_it_was(graph: Any, tmp_path: Path) -> None:
    robot = Robot(graph, {1: [11, 12, 13], 2: [14, 15, 16, 17]})
    graph.add(MarkerServer)
    options = {'robot_room': 'E', 'patience': 0.3, 'record': str(tmp_path / 'events.jsonl')}
    first = graph.add(InitialState, parameters=options)
    robot.start()
    kept = tmp_path / 'events.jsonl.survey.json'
    graph.until(lambda: kept.exists() and '"poses": [1]' in kept.read_text())
    graph.remove(first)
    done = len(robot.poses)
    graph.add(InitialState, parameters=options)
    graph.until(robot.start().done)
    assert robot.rooms() == {'E', 'C1', 'C2', 'R1', 'R2', 'R3', 'R4'}
    assert 1 not in robot.poses[done:]


@pytest.mark.parametrize(
    'damage',
    [
        '{"notes": {}, "poses": [1], "seconds": NaN}',
        '{"notes": {"12": ["C1", [1e999, 2], {}]}, "poses": [1], "seconds": 1.0}',
        '{"notes": {"12": ["C1", [1, 2], {}], "13": "R1"}, "poses": [1], "seconds": 1.0}',
        '{"notes": {}, "poses": [1], "seconds": 1' + '0' * 400 + '}',
    ],
)
def test_what_was_found_and_is_damaged_counts_for_nothing(
    graph: Any, tmp_path: Path, damage: str
) -> None:
    (tmp_path / 'events.jsonl.survey.json').write_text(damage)
    node = graph.add(InitialState, parameters={'record': str(tmp_path / 'events.jsonl')})
    assert node._survey.to_json() == {'notes': {}}
    assert node._progress.poses == []


def test_without_its_room_the_robot_is_in_the_nearest_place(graph: Any) -> None:
    robot = Robot(graph, {1: [11, 12, 13, 14, 15, 16, 17]})
    graph.add(MarkerServer)
    node = graph.add(InitialState, parameters={'patience': 0.3})
    odometry = graph.node.create_publisher(Odometry, 'odom', 10)
    graph.until(odometry.get_subscription_count)
    message = Odometry()
    message.pose.pose.position.x, message.pose.pose.position.y = 8.0, 2.0
    odometry.publish(message)
    graph.until(lambda: node._survey.robot_position == (8.0, 2.0))
    graph.until(robot.start().done)
    assert robot.maps[-1].robot_room == 'R3'


def test_map_can_come_from_the_configuration(graph: Any) -> None:
    robot = Robot(graph, {})
    graph.add(InitialState, parameters=CONFIGURED)
    graph.until(robot.start().done)
    assert robot.poses == []
    assert robot.maps[-1].robot_room == 'A'
    [a] = [place for place in robot.maps[-1].places if place.name == 'A']
    assert [(c.connected_to, c.through_door) for c in a.connections] == [('B', 'D')]


def test_configuration_that_is_no_place_is_refused(graph: Any) -> None:
    with pytest.raises(ParameterError, match='robot_room'):
        graph.add(InitialState, parameters=CONFIGURED | {'robot_room': 'Z'})
    with pytest.raises(ParameterError, match='initial_state: parameter map: expected rooms'):
        graph.add(InitialState, parameters={'map_source': 'configuration'})


def test_node_stops_while_it_waits_for_an_arm_that_is_not_there(graph: Any) -> None:
    node = graph.add(InitialState, parameters={'robot_room': 'E'})
    client = graph.node.create_client(Empty, 'start')
    graph.until(client.service_is_ready)
    client.call_async(Empty.Request())
    graph.until(lambda: node._found._futures)
    graph.remove(node)
