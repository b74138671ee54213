"""Places with several charging stations."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import Station, read_place
from floor_plans.parameters import station_at, stations_of
from strict_files.files import FileError

PLACE = """\
/**:
  ros__parameters:
    map:
      A: [D1]
      B: [D1]
    room_positions: {A: [0.0, 1.0], B: [2.0, 3.0]}
    robot_room: B
    recharge_rooms: [B, A]
    stations:
      A: {pose: [0.5, 1.0, 3.1], rate: 4}
      B: {pose: [2.5, 3.0, 1.5], dock: bay}
"""


def write(tmp_path: Path, old: str = '', new: str = '') -> Path:
    path = tmp_path / 'place.yaml'
    assert old in PLACE
    path.write_text(PLACE.replace(old, new))
    return path


def test_each_recharge_room_has_its_station_and_the_robot_starts_at_its_own(tmp_path: Path) -> None:
    plan = read_place(write(tmp_path)).plan
    assert plan.stations == {
        'A': Station((0.5, 1.0, 3.1), rate=4.0),
        'B': Station((2.5, 3.0, 1.5), dock='bay'),
    }
    assert plan.start == (2.5, 3.0, 1.5)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        (', dock: bay', ', dok: bay', ":11: stations.B.dok: unknown, expected 'dock'"),
        (
            '      B: {pose: [2.5, 3.0, 1.5], dock: bay}\n',
            '',
            "recharge_rooms: room 'B' has no",
        ),
        ('B: {pose', 'C: {pose', ':11: stations.C: no such room, expected one of A, B'),
        ('rate: 4', 'rate: 0', ':10: stations.A.rate: 0: expected percent a minute, above 0'),
        ('[0.5, 1.0, 3.1]', '[0.5, 1.0]', ':10: stations.A.pose: [0.5, 1.0]: expected [x, y, yaw]'),
        (
            '    stations',
            '    station: [1, 2, 3]\n    stations',
            ':9: station: expected either',
        ),
        ('    recharge_rooms: [B, A]\n', '', 'stations: expected recharge_rooms, such as [A, B]'),
        (
            '{pose: [0.5, 1.0, 3.1], rate: 4}',
            '[1, 2, 3]',
            'stations.A: got [1, 2, 3]',
        ),
    ],
)
def test_what_is_wrong_with_a_station_is_told_with_its_line(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(FileError) as caught:
        read_place(write(tmp_path, old, new))
    assert words in str(caught.value)


def test_a_point_is_at_the_nearest_station_within_reach() -> None:
    near, far = Station((1.0, 0.0, 0.0)), Station((1.6, 0.0, 0.0))
    stations = {'A': near, 'B': far}
    assert station_at((1.2, 0.0), stations, 0.5) is near
    assert station_at((1.5, 0.0), stations, 0.5) is far
    assert station_at((3.0, 0.0), stations, 0.5) is None


def test_a_station_that_is_not_described_is_at_the_point_of_the_only_recharge_room() -> None:
    points = {'A': [1.0, 2.0], 'B': [3.0, 4.0]}
    assert stations_of({'recharge_rooms': ['B']}, points)['B'].pose == (3.0, 4.0, 0.0)
    assert stations_of({}, points) == {}
