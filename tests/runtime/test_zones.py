"""Zones of a place: what its file may say, and what Nav2 gets of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from floor_plans import PlaceError, read_place
from floor_plans.filter_masks import write_filter_masks
from floor_plans.occupancy_map import read_map
from floor_plans.parameters import zones_from
from strict_files.files import FileError

pytestmark = pytest.mark.unit
PLACE = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
SQUARE = [8.5, 8.6, 9.5, 8.6, 9.5, 10.0, 8.5, 10.0]
SHOP = [0.3, 13.0, 10.0, 18.0, 10.0, 18.0, 14.5, 13.0, 14.5]


def place_with(folder: Path, **tables: dict[str, Any]) -> Path:
    text = PLACE.read_text()
    for table, entries in tables.items():
        text += f'    {table}:\n' + ''.join(f'      {n}: {v}\n' for n, v in entries.items())
    file = folder / 'place.yaml'
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ('table', 'value', 'words'),
    [
        ('keep_out_zones', [1, 2, 3, 4], r'\[1, 2, 3, 4\]: expected \[x1, y1, x2, y2, x3, y3'),
        ('keep_out_zones', [0, 0, 2, 2, 2, 0, 0, 2], 'sides from corner 1 and from corner 3 cross'),
        ('keep_out_zones', [0, 0, 1, 0, 2, 0], '0 square metres: expected at least 0.01'),
        ('keep_out_zones', 'all', "'all': expected"),
        ('slow_zones', [0.0, 0, 0, 1, 0, 1, 1], 'speed 0 m/s: expected 0.02 to 20'),
        ('slow_zones', [0, 0, 1, 0, 1, 1], r'expected \[speed, x1, y1'),
        ('slow_zones', [0.3, 0, 0, 1, 0, 1, math.inf], r'expected \[speed, x1, y1'),
    ],
)
def test_what_is_no_zone_is_said_in_one_line(table: str, value: Any, words: str) -> None:
    with pytest.raises(PlaceError, match=words):
        zones_from({table: {'Z': value}})


def test_a_zone_of_any_shape_knows_what_lies_in_it() -> None:
    # An L: its notch is outside.
    zone = zones_from({'keep_out_zones': {'L': [0, 0, 4, 0, 4, 1, 1, 1, 1, 3, 0, 3]}}).keep_out['L']
    inside = zone.contains([(0.5, 2.5), (3.5, 0.5), (2.0, 2.0), (-0.1, 1.0)])
    assert inside.tolist() == [True, True, False, False]
    assert zone.distance((2.0, 2.0)) == pytest.approx(1.0)
    assert zone.distance((7.0, -4.0, 1.5)) == pytest.approx(5.0), 'of a pose, without its yaw'
    assert zone.area == pytest.approx(6.0)


def test_a_place_says_where_a_zone_does_not_fit(tmp_path: Path) -> None:
    file = place_with(tmp_path, keep_out_zones={'stairs': [9, 4, 11, 4, 11, 6, 9, 6]})
    with pytest.raises(FileError, match=r'R1: \(10, 5\) lies in the keep-out zone stairs'):
        read_place(file)
    file = place_with(tmp_path, keep_out_zones={'stairs': [9, 7.0, 11, 7.0, 11, 6, 9, 6]})
    with pytest.raises(FileError, match=r'doors.D1: a wall or a keep-out zone stands in it'):
        read_place(file)
    file = place_with(tmp_path, keep_out_zones={'a b': SQUARE})
    with pytest.raises(FileError, match="zone name 'a b': expected letters"):
        read_place(file)


def test_nav2_reads_the_same_zones_from_the_masks(tmp_path: Path) -> None:
    file = place_with(tmp_path, keep_out_zones={'S': SQUARE}, slow_zones={'A': SHOP})
    plan = read_place(file).plan
    keep_out, speed, parameters = write_filter_masks(plan, tmp_path / 'masks')
    servers = yaml.safe_load(parameters.read_text())
    info = servers['speed_costmap_filter_info_server']['ros__parameters']
    assert info['type'] == 2
    assert servers['keepout_costmap_filter_info_server']['ros__parameters']['type'] == 0
    grid = plan.grid()
    barred, slow = read_map(keep_out).grid, read_map(speed).grid
    assert barred.cells.shape == grid.cells.shape
    assert barred.at(barred.cells, 9.0, 9.0) == 100
    assert barred.at(barred.cells, 10.0, 9.0) == 0
    found = slow.at(slow.cells, 15.0, 12.0) * info['multiplier'] + info['base']
    assert found == pytest.approx(0.3, abs=0.003)
    assert slow.at(slow.cells, 10.0, 12.0) == 0, 'no limit'


def test_speed_falls_before_a_slow_zone_and_edges_show_before_one_to_keep_out_of() -> None:
    zones = zones_from({'keep_out_zones': {'S': SQUARE}, 'slow_zones': {'A': SHOP}})
    speeds = [zones.speed_limit((x, 12.0, 0.0), 0.5) for x in (10.0, 12.0, 12.9, 15.0)]
    assert speeds[0] == math.inf
    assert speeds[1] > speeds[2] > speeds[3] == pytest.approx(0.3)
    assert zones.speed_limit((12.5, 12.0, math.pi), 0.5) == math.inf, 'it drives away'
    seen = zones.edges_near((8.0, 9.0, math.pi / 2), 2.0)
    assert np.abs(seen[:, 1].max() + 0.5) < 0.01, 'on its right, half a metre away'
    assert len(zones.edges_near((9.0, 9.0, 0.0), 2.0)) == 0, 'it is in the zone and is to leave'
