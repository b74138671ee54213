"""Which doors are shut, as the ontology has them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from surveillance_controllers.planning.door_watch import DoorWatch


def test_a_door_whose_room_was_taken_from_the_map_is_not_closed_by_that(graph: Any) -> None:
    stub: Any = SimpleNamespace(connect=lambda interrupt: interrupt.wait())
    doors = DoorWatch(graph.node, {'D1': (0, 0, 1, 0), 'D2': (0, 0, 1, 0)}, stub, 1.0)
    assert doors.closed({'D1': {'C', 'R'}, 'D2': {'C', 'E'}}) == set()
    assert doors.closed({'D1': {'C', 'R'}, 'D2': {'C'}, 'D3': {'E'}}) == {'D2'}, 'E is still there'
    assert doors.closed({'D1': {'C'}, 'D2': {'C', 'E'}}) == set(), 'R is not'
    assert doors.closed({}) == set(), 'nothing is known'
