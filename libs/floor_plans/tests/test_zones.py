"""Zones of a place: what its file may say, and what Nav2 gets of them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from floor_plans import PlaceError, Zone, Zones, read_place
from floor_plans.parameters import zones_from
from strict_files.files import FileError

PLACE = Path(__file__).with_name('places') / 'seven_rooms.yaml'
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


def test_speed_falls_before_a_slow_zone_and_edges_show_before_one_to_keep_out_of() -> None:
    zones = zones_from({'keep_out_zones': {'S': SQUARE}, 'slow_zones': {'A': SHOP}})
    speeds = [zones.speed_limit((x, 12.0, 0.0), 0.5) for x in (10.0, 12.0, 12.9, 15.0)]
    assert speeds[0] == math.inf
    assert speeds[1] > speeds[2] > speeds[3] == pytest.approx(0.3)
    assert zones.speed_limit((12.5, 12.0, math.pi), 0.5) == math.inf, 'it drives away'
    seen = zones.edges_near((8.0, 9.0, math.pi / 2), 2.0)
    assert np.abs(seen[:, 1].max() + 0.5) < 0.01, 'on its right, half a metre away'
    assert len(zones.edges_near((9.0, 9.0, 0.0), 2.0)) == 0, 'it is in the zone and is to leave'


BENT = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (3.0, 3.0), (3.0, 1.0), (0.0, 1.0))


def test_a_bent_zone_holds_and_is_as_far_as_opencv_says() -> None:
    zone = Zone('K', BENT)
    polygon = np.array(BENT, np.float32).reshape(-1, 1, 2)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform((-1.0, -1.0), (5.0, 4.0), (300, 2)):
        peer = cv2.pointPolygonTest(polygon, (float(x), float(y)), True)
        assert zone.contains([(x, y)])[0] == (peer > 0)
        assert zone.distance((x, y)) == pytest.approx(max(0.0, -peer), abs=1e-5)
    assert zone.area == 6.0
    assert zone.box == (0.0, 0.0, 4.0, 3.0)
    turned = Zone('K', tuple((-y, x) for x, y in BENT[::-1]))
    assert turned.area == 6.0
    assert turned.box == (-3.0, 0.0, 0.0, 4.0)
    edge = zone.edge(0.3)
    assert len(edge) == 14 + 10 + 4 + 7 + 10 + 4
    assert np.hypot(*(np.roll(edge, -1, axis=0) - edge).T).max() <= 0.3 + 1e-9
    assert edge[0].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ('x', 'yaw', 'limit'),
    [
        (2.0, 0.0, 0.3),
        (-1.0, 0.0, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.0)),
        (-1.4, 0.0, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.4)),
        (-1.6, 0.0, math.inf),
        (-1.0, math.pi, math.inf),
        (5.0, math.pi, math.sqrt(0.3**2 + 2.0 * 0.5 * 1.0)),
    ],
)
def test_before_a_slow_zone_the_speed_is_that_from_which_one_can_brake(
    x: float, yaw: float, limit: float
) -> None:
    slow = Zone('S', BENT, 0.3)
    zones = Zones(slow={'S': slow})
    assert zones.speed_limit((x, 0.5, yaw), 0.5) == pytest.approx(limit, abs=0.04)
    slower = Zones(slow={'T': replace(slow, speed=0.2), 'S': slow})
    if x == 2.0:
        assert slower.speed_limit((x, 0.5, yaw), 0.5) == 0.2


def test_the_edges_of_zones_to_keep_out_of_are_told_in_the_robots_frame() -> None:
    zones = Zones(keep_out={'K': Zone('K', BENT), 'far': Zone('far', ((50, 0), (51, 0), (51, 1)))})
    barred = zones.barred((3.5, 2.0))
    assert barred is not None
    assert barred.name == 'K'
    assert zones.barred((1.0, 2.0)) is None
    pose = (1.0, 3.0, -math.pi / 2)  # it looks at the side from (3, 1) to (0, 1), 2 m ahead
    near = zones.edges_near(pose, 2.5, 0.1)
    assert near[np.abs(near[:, 1]) <= 1.0][:, 0] == pytest.approx(2.0)
    assert near[near[:, 0] < 1.9][:, 1].min() == pytest.approx(2.0), 'the sides to its left'
    assert np.hypot(*near.T).max() <= 2.5
    assert (near[:, 1] > 0).any()
    corner = near[np.argmin(np.hypot(near[:, 0] - 2.0, near[:, 1] - 1.4))]
    assert corner == pytest.approx([2.0, 1.4])
    assert zones.edges_near((1.0, 0.5, 0.0), 2.5).shape == (0, 2), 'it is in it, and is to leave'
    assert zones.edges_near((1.0, 4.0, 0.0), 2.2).shape == (0, 2)
