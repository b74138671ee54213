"""What nobody publishes is asked for, and again when it may have changed."""

from __future__ import annotations

import json
from typing import Any

import pytest
from rclpy.task import Future
from std_msgs.msg import String

from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_operator import node_graph_watch
from surveillance_operator.mission_state import MissionState
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_operator.mission_view_node import MissionViewNode
from surveillance_runtime.place_changes import description_text, follow_place
from surveillance_runtime.qos import STATE_QOS
from tests.operator.peers import PLACE, Planner


def test_a_place_that_is_changed_brings_no_robot_back_that_was_left(graph: Any) -> None:
    """The page showed the robots of an earlier fleet again after an edit of the place."""
    heard: list[MissionState] = []
    subscriber = MissionSubscriber(
        graph.node, 0.05, lambda new, _told: heard.append(new), robot='anna'
    )
    sender = graph.node.create_publisher(String, 'place', STATE_QOS)

    def changed(x: float) -> None:
        sender.publish(String(data=description_text({'doors': {'D1': [x, 0.0, x, 1.0]}})))

    changed(1.0)
    graph.until(lambda: 'D1' in subscriber.state.place.door_lines)
    read: list[object] = []
    follow_place(graph.node, read.append)  # made later, and so told later
    subscriber.leave()
    before, told = subscriber.state.place.door_lines, len(heard)
    changed(2.0)
    graph.until(lambda: any('2.0' in str(each) for each in read))
    assert subscriber.state.place.door_lines == before
    assert len(heard) == told


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
