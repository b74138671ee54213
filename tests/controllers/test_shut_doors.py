"""A door that is open on the map is shut before the robot: it stays where it is."""

from __future__ import annotations

import pytest

from benchmarks.localisation import Ours, before_a_shut_door, worst_of
from surveillance_simulation.world.simulated_place import SimulatedPlace


@pytest.mark.parametrize('away', [0.3, 0.45])
@pytest.mark.parametrize(('room', 'door'), [('R1', 'D1'), ('R3', 'D3'), ('R4', 'D4')])
def test_a_robot_before_a_shut_door_knows_where_it_is(
    seven_rooms_world: SimulatedPlace, room: str, door: str, away: float
) -> None:
    grid = seven_rooms_world.plan.grid(0.05)
    case = before_a_shut_door(seven_rooms_world, room, door, away)
    assert worst_of(Ours, grid, case) < 0.1
