"""Where the places are, while the map is there and while it is away."""

from __future__ import annotations

from typing import Any

import pytest
from geometry_msgs.msg import Point

from state_machines import Interrupt
from state_machines.exceptions import CallError
from surveillance_behaviour.ports import UnknownPlaceError
from surveillance_behaviour.ros_adapters.peers import Deadlines, RosPlaces
from surveillance_interfaces.srv import RoomPosition
from surveillance_runtime.node import PatrolNode

NOBODY = Interrupt()


class Map(PatrolNode):
    """Knows one place, where it is told."""

    x = 1.0

    def __init__(self, **options: Any) -> None:
        super().__init__('map', **options)
        self.create_service(RoomPosition, 'ontology_map/room_position', self._on_ask)

    def _on_ask(self, request: Any, answer: Any) -> Any:
        answer.valid = request.room_name == 'R1'
        answer.position = Point(x=self.x)
        return answer


def test_while_the_map_is_away_a_place_is_where_it_was(graph: Any) -> None:
    server = graph.add(Map)
    places = RosPlaces(graph.node, Deadlines(answer=60.0))
    assert places.position('R1', NOBODY) == (1.0, 0.0, 0.0)
    with pytest.raises(UnknownPlaceError):
        places.position('R9', NOBODY)
    graph.drop(server)
    assert places.position('R1', NOBODY) == (1.0, 0.0, 0.0)
    with pytest.raises(CallError):
        RosPlaces(graph.node, Deadlines(answer=0.1)).position('R1', NOBODY)


def test_a_map_that_is_back_is_asked_again(graph: Any) -> None:
    server = graph.add(Map)
    places = RosPlaces(graph.node, Deadlines(answer=60.0))
    places.position('R1', NOBODY)
    graph.drop(server)
    places.position('R1', NOBODY)
    graph.add(Map).x = 2.0
    assert graph.until(lambda: places.position('R1', NOBODY) == (2.0, 0.0, 0.0))
