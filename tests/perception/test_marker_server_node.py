"""The node `marker_server` answers from its file."""

from __future__ import annotations

from typing import Any

import pytest

from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import RoomInformation
from surveillance_perception.marker_server_node import MarkerServer
from surveillance_runtime.parameters import ParameterError


def test_marker_server_answers_from_its_file(graph: Any) -> None:
    graph.add(MarkerServer)
    client = ServiceCaller(graph.node, RoomInformation, 'room_info')
    answer = client.call(RoomInformation.Request(id=16), 60.0)
    assert (answer.room, answer.x, answer.y) == ('R3', 9.0, 3.0)
    assert [(c.connected_to, c.through_door) for c in answer.connections] == [('C2', 'D3')]
    unknown = client.call(RoomInformation.Request(id=99), 60.0)
    assert unknown.room == 'no room associated with this marker id'
    assert not unknown.connections


def test_marker_server_does_not_start_without_its_file(graph: Any) -> None:
    with pytest.raises(ParameterError, match='No such file'):
        graph.add(MarkerServer, parameters={'markers_file': 'none.yaml'})
