"""Shapes of a place beside plain geometry: zones, boxes, openings, doors on walls, joined rooms."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import read_place
from floor_plans.fleet import (
    robots_in_a_row,
)
from surveillance_runtime.fleet_parts import members

SEVEN_ROOMS = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
PLAN = read_place(SEVEN_ROOMS).plan


def test_a_run_has_the_robots_of_its_place_or_so_many_in_a_row(tmp_path: Path) -> None:
    assert members(SEVEN_ROOMS, None, 0.22) == ()
    assert members(SEVEN_ROOMS, 2, 0.22) == robots_in_a_row(PLAN, 2, 0.22)
    path = tmp_path / 'two.yaml'
    robots = (
        '    robots:\n      anna: {start: [10.0, 8.0, 0.0]}\n      bert: {start: [4.0, 9.0, 0.0]}\n'
    )
    path.write_text(SEVEN_ROOMS.read_text() + robots)
    for asked in (None, 2):
        assert [each.name for each in members(path, asked, 0.22)] == ['anna', 'bert']
    for asked in (1, 3):
        with pytest.raises(ValueError, match=f'--robots {asked}: two.yaml has 2: anna, bert'):
            members(path, asked, 0.22)
