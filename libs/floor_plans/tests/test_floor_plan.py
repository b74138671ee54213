"""Walls, doors and map of a place, and the grid that they make."""

from __future__ import annotations

from pathlib import Path

import pytest

from floor_plans import PlaceFile, read_place
from floor_plans.drawing import draw_place
from strict_files.files import FileError

from .two_rooms import place, written


def test_a_place_needs_neither_walls_nor_map(tmp_path: Path) -> None:
    path = place(tmp_path)
    path.write_text(path.read_text().replace('map_file', '#'))
    file = read_place(path)
    assert isinstance(file, PlaceFile)
    assert not file.plan.is_enclosed
    assert draw_place(file.plan, 'Two rooms', '').size[0] > 500


def test_a_picture_with_a_scale_is_a_map(tmp_path: Path) -> None:
    written(tmp_path, ending='png')
    path = place(tmp_path, '    map_file_resolution: 0.05\n')
    path.write_text(path.read_text().replace('building.yaml', 'building.png'))
    assert read_place(path).plan.map is not None
    path.write_text(path.read_text().replace('map_file_resolution', '#'))
    with pytest.raises(FileError, match='says nothing of its scale'):
        read_place(path)
