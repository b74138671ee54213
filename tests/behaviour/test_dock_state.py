"""Whether a drive ends at a station, and whether the robot stands at one."""

from __future__ import annotations

import pytest

from surveillance_behaviour.mission.dock_state import DockState

pytestmark = pytest.mark.unit

ROOM, STATION, NEAR = (1.0, 1.0, 0.0), (3.0, 1.0, 0.0), (1.1, 1.0, 0.0)


@pytest.mark.parametrize(
    ('to_station', 'station', 'is_recharge_room', 'ends_there', 'docks'),
    [
        (True, STATION, True, True, True),
        (False, STATION, True, False, False),
        (False, NEAR, True, False, True),  # the room's point is at the station
        (False, None, True, False, True),  # the map knows of no stations
        (True, STATION, False, False, False),
    ],
)
def test_where_a_drive_ends_says_whether_it_docks(
    to_station: bool,
    station: tuple[float, float, float] | None,
    is_recharge_room: bool,
    ends_there: bool,
    docks: bool,
) -> None:
    dock = DockState()
    assert dock.is_docked, 'it starts there'
    dock.to_station = to_station
    assert dock.leaves_for(ROOM, station, is_recharge_room=is_recharge_room) == ends_there
    dock.arrived()
    assert dock.is_docked == docks
    dock.strayed()
    assert not dock.is_docked
