"""The text of a place's file: what is changed, and what is kept."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from floor_plans import read_place
from floor_plans.occupancy_map import read_map
from floor_plans.writing import copy_place, updated_text

from .two_rooms import place, written


def test_a_copy_holds_its_map(tmp_path: Path) -> None:
    (tmp_path / 'run').mkdir()
    written(tmp_path, 'image: building.pgm\nresolution: 0.05\norigin: [1, 2, 0.35]\n')
    turned = read_map(tmp_path / 'building.yaml')
    a, b = (turned.to_world([point])[0] for point in ((1.5, 3.0), (5.0, 3.0)))
    x, y = turned.to_world([(3.225, 2.25)])[0]
    path = place(tmp_path, a=str(a.tolist()), b=str(b.tolist()))
    door = f'[{x}, {y}, {math.pi / 2 + 0.35}, 1.0]'
    path.write_text(path.read_text().replace('[3.225, 2.25, 1.5707963, 1.0]', door))
    copy_place(path, tmp_path / 'run' / 'place.yaml')
    (tmp_path / 'building.pgm').unlink()
    copied = read_place(tmp_path / 'run' / 'place.yaml').plan
    assert copied.map is not None
    assert copied.map.origin == (1.0, 2.0, 0.35)
    assert (copied.map.cells == turned.cells).all()


def test_a_change_keeps_the_comments(tmp_path: Path) -> None:
    written(tmp_path)
    path = place(tmp_path)
    before = path.read_text()
    parameters: dict[str, Any] = {
        'map_file': 'building.yaml',
        'map': {'A': ['D'], 'B': ['D']},
        'room_positions': {'A': [1.5, 3.0], 'B': [5.25, 3.0]},
        'robot_room': 'A',
        'doors': {'D': [3.225, 2.25, 1.5707963, 1.0]},
    }
    after = updated_text(before, parameters)
    assert after == before.replace('B: [5, 3]', 'B: [5.25, 3.0]')
    parameters['doors']['D'] = [3.225, 2.25, 1.5707963, 0.9]
    parameters['station'] = [1.0, 2.0, 0.0]
    path.write_text(updated_text(before, parameters))
    assert '0.9]  # wide' in path.read_text()
    assert next(iter(read_place(path).plan.stations.values())).pose == (1.0, 2.0, 0.0)
