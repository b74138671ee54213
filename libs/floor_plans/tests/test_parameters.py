"""A place as parameters: sections that a node reads alone say the same as the whole place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from floor_plans import PlaceError, read_place
from floor_plans.parameters import (
    checked_plan,
    description_of,
    make_place,
    nested,
    patrol_rules,
    place_from,
    stations_in,
    tables_of,
    zones_from,
)

FILE = Path(__file__).with_name('places') / 'seven_rooms.yaml'


@pytest.fixture
def described() -> dict[str, Any]:
    whole: dict[str, Any] = yaml.safe_load(FILE.read_text())['/**']['ros__parameters']
    return whole


def test_each_section_is_what_the_whole_place_has(described: dict[str, Any]) -> None:
    file, plan = read_place(FILE), checked_plan(described)
    assert plan.place == file.place == place_from(described)
    assert make_place(*description_of(file.place).values()) == file.place
    assert stations_in(described) == file.plan.stations
    assert zones_from(described) == file.plan.zones
    assert patrol_rules(described, file.place.rooms) == file.rules


def test_flat_names_become_tables(described: dict[str, Any]) -> None:
    flat = [(f'map.{room}', doors) for room, doors in described['map'].items()]
    assert tables_of([*flat, ('robot_room', 'E')]) == {'map': described['map'], 'robot_room': 'E'}
    assert nested({'E.pose': [1, 2, 3], 'E.rate': 4}) == {'E': {'pose': [1, 2, 3], 'rate': 4}}
    with pytest.raises(PlaceError, match=r"map: got 'map.yaml', expected NAME: .* map_file: NAME"):
        tables_of([('map', 'map.yaml')])
