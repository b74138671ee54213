"""What the controllers know of the map while it changes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Point

from state_machines import Interrupt
from state_machines.ros import ServiceCaller
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_interfaces.srv import AddRoom
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder


def test_who_is_told_of_a_new_room_finds_it_with_its_point(
    graph: Any, seven_rooms: dict[str, Any]
) -> None:
    graph.add(ArmorServer)
    builder = graph.add(OntologyMapBuilder, seven_rooms)
    knowledge = MapKnowledge(graph.node, 10.0)
    told: list[tuple[set[str], bool]] = []

    def on_change() -> None:
        if knowledge.connected:
            sides = knowledge.doors(graph.node.stopping).values()
            rooms = set().union(*sides)
            told.append((rooms, 'ALCOVE' in builder._keeper.place.positions))

    knowledge.watch_doors(graph.node.stopping, on_change)
    graph.until(lambda: told and len(told[-1][0]) == 7)  # the map is built door by door
    request = AddRoom.Request(room_name='ALCOVE', position=Point(x=12.5, y=8.0), doors=['D9'])
    answer = ServiceCaller(graph.node, AddRoom, 'ontology_map/add_room').call(request, 60.0)
    assert answer.success, answer.message
    graph.until(lambda: any('ALCOVE' in rooms for rooms, _ in told))
    assert all(has_point for rooms, has_point in told if 'ALCOVE' in rooms)


def test_places_may_change_at_once_when_they_begin_to_be_followed(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    knowledge = MapKnowledge(graph.node, 1.0)
    node = SimpleNamespace(stopping=Interrupt(), spawn=lambda work, name: work())
    monkeypatch.setattr(knowledge, '_node', node)
    monkeypatch.setattr(knowledge, 'watch_doors', lambda _interrupt, on_change: on_change())

    def places(_interrupt: Interrupt) -> dict[str, Any]:
        node.stopping.set()
        return {}

    monkeypatch.setattr(knowledge, 'places', places)
    taken: list[Any] = []
    knowledge.follow_places(taken.append)
    assert taken == [{}]
