"""The places that a way leads through, and the doors that bar it."""

from __future__ import annotations

import pytest

from lidar_navigation import NoPathError
from surveillance_controllers.planning.map_planner import route

DOORS = {'D1': {'R1', 'C1'}, 'D2': {'C1', 'C2'}, 'D3': {'C2', 'R1'}, 'D4': {'C2', 'R2'}}
POINTS = {'R1': (0, 0), 'C1': (2, 0), 'C2': (4, 0), 'R2': (6, 0)}


def test_the_shortest_route_over_open_doors_is_taken() -> None:
    assert route(DOORS, [], 'R1', 'R2', POINTS) == ['D3', 'D4']
    assert route(DOORS, ['D3'], 'R1', 'R2', POINTS) == ['D1', 'D2', 'D4']
    assert route(DOORS, [], 'R1', 'R1', POINTS) == []


@pytest.mark.parametrize(
    ('closed', 'goal', 'text'),
    [
        (['D4'], 'R2', 'no route from R1 to R2: the door D4 is closed'),
        (['D3', 'D1', 'D4'], 'R2', 'no route from R1 to R2: the doors D3, D4 are closed'),
        ([], 'R9', 'no route from R1 to R9: no doors lead there'),
    ],
)
def test_without_a_route_the_closed_doors_are_named(
    closed: list[str], goal: str, text: str
) -> None:
    with pytest.raises(NoPathError) as caught:
        route(DOORS, closed, 'R1', goal, POINTS)
    assert str(caught.value) == text
