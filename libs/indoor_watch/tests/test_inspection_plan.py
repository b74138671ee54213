"""From where the rooms of a map are looked at, and again."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np

from floor_plans import Grid
from indoor_watch import Event, EventState, Kind, rule_from
from indoor_watch.hung_markers import HungSpot
from indoor_watch.inspection_plan import InspectionPlan


def plan(*rules: dict[str, Any]) -> tuple[InspectionPlan, dict[str, list[tuple[float, float]]]]:
    """Return the plan of a room of 6 by 5 metres with a corner cut off by a wall."""
    cells = np.zeros((100, 120), np.int8)
    cells[[0, 1, -1, -2], :] = cells[:, [0, 1, -1, -2]] = 100
    cells[:70, 60:62] = 100
    grid = Grid(cells, 0.05, (0.0, 0.0))
    rooms: Any = SimpleNamespace(
        cells_of=lambda place: grid.free if place == 'R1' else None, place_at=lambda _: 'R1'
    )
    doors, points = {'D1': (5.0, 0.05, 5.8, 0.05)}, {'R1': (1.5, 1.5), 'gone': (9.0, 9.0)}
    found = InspectionPlan([rule_from(each) for each in rules], rooms, points, doors, 0.2)
    return found, found.use_map(grid)


def event(**more: Any) -> Event:
    return Event(
        1, Kind.OBJECT, 'appeared', more.pop('place', 'R1'), '', (1.5, 3.0), 3, '', EventState.OPEN,
        0.0, 0.0, 1, 1, 0.7, (), (), **more,
    )  # fmt: skip


def test_a_room_that_its_point_does_not_show_is_looked_at_from_elsewhere_too() -> None:
    _, viewpoints = plan()
    assert viewpoints.keys() == {'R1'}
    assert viewpoints['R1']
    assert all(math.dist(each, (1.5, 1.5)) > 0.5 for each in viewpoints['R1'])


def test_what_a_rule_names_is_looked_at() -> None:
    spot = HungSpot(21, (5.8, 2.5, 1.0), math.pi, 0.2)
    assert plan()[0].checks([spot]) == []
    (check,) = plan({'marker': '21'})[0].checks([spot])
    assert check.name == 'marker 21'


def test_a_second_look_is_from_another_side_where_that_is_known() -> None:
    found, _ = plan()
    again = found.again_from(event(seen_from=(1.5, 1.0)))
    assert again is not None
    assert math.dist(again, (1.5, 1.0)) > 0.5
    assert found.again_from(event()) is None
    assert found.again_from(event(place='elsewhere', seen_from=(1.5, 1.0))) is None
