"""Which room a point lies in, and whether walls, doors and rooms fit together."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import RoomMap, read_place
from floor_plans.drawing import draw_place
from strict_files.files import FileError

from .two_rooms import place, written


def test_a_place_with_a_map_knows_its_rooms(tmp_path: Path) -> None:
    written(tmp_path)
    plan = read_place(place(tmp_path)).plan
    regions = RoomMap(plan)
    assert [regions.room_at(x, 3.5) for x in (0.6, 3.0, 3.5, 6.0)] == ['A', 'A', 'B', 'B']
    assert regions.room_at(0.8, 3.9) == 'A'  # below the table
    assert [station.pose for station in plan.stations.values()] == [(1.5, 3.0, 0.0)]
    assert draw_place(plan, 'Two rooms', '').size[0] > 500


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'a': '[1.0, 3.9]'}, 'place.yaml:6: room_positions.A: (1, 3.9) lies in a wall'),
        ({'a': '[0.4, 1.0]'}, 'lies closer than 0.22 m to a wall'),
        ({'a': '[9.0, 9.0]'}, 'lies outside of what the map knows'),
        (
            {'more': '    station: [5, 3, 0]\n    recharge_rooms: [A]\n'},
            'lies in B: expected a poi',
        ),
        ({'more': '    map_file_resolution: 0.1\n'}, 'map_file: '),
    ],
)
def test_a_place_that_does_not_fit_its_map_is_refused(
    tmp_path: Path, change: dict[str, str], message: str
) -> None:
    written(tmp_path)
    with pytest.raises(FileError) as caught:
        read_place(place(tmp_path, **change))
    assert message in str(caught.value)
