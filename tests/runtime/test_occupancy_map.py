"""Maps in map_server's format: what is read as what, what is refused, and places that refer to
them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from floor_plans import PlaceFile, RoomMap, read_place
from floor_plans.drawing import draw_place
from floor_plans.occupancy_map import read_map, write_map
from floor_plans.writing import copy_place, updated_text
from strict_files.files import FileError

SIDE = 0.05


def building() -> np.ndarray:
    """Return the pixels of two rooms of 3 x 4 m with a door of 1 m and a table; white is free."""
    pixels = np.full((90, 130), 205, np.uint8)
    pixels[5:85, 5:125] = 254
    for row, column in ((5, slice(5, 125)), (84, slice(5, 125))):
        pixels[row : row + 1, column] = 0
    pixels[5:85, 5] = pixels[5:85, 124] = pixels[5:85, 64] = 0
    pixels[35:55, 64] = 254
    pixels[10:16, 10:26] = 0
    return pixels


def written(folder: Path, text: str = '', ending: str = 'pgm', pixels: Any = None) -> Path:
    image = Image.fromarray(building() if pixels is None else pixels)
    image.save(folder / f'building.{ending}')
    (folder / 'building.yaml').write_text(
        text or f'image: building.{ending}\nresolution: {SIDE}\norigin: [0, 0, 0]\nnegate: 0\n'
    )
    return folder / 'building.yaml'


def place(folder: Path, more: str = '', a: str = '[1.5, 3.0]', b: str = '[5, 3]') -> Path:
    path = folder / 'place.yaml'
    path.write_text(
        '# What a person wrote.\n/**:\n  ros__parameters:\n    map_file: building.yaml  # ours\n'
        f'    map: {{A: [D], B: [D]}}\n    room_positions: {{A: {a}, B: {b}}}\n'
        f'    robot_room: A\n    doors:\n      D: [3.225, 2.25, 1.5707963, 1.0]  # wide\n{more}'
    )
    return path


def test_pixels_become_cells_as_map_server_has_them(tmp_path: Path) -> None:
    shades = np.array([[0, 88, 90, 190, 206, 255]], np.uint8)  # 90: occupied by 0.647

    def cells(**said: object) -> list[int]:
        lines = {'image': 'building.png', 'resolution': SIDE, 'origin': [0, 0, 0], **said}
        text = ''.join(f'{key}: {value}\n' for key, value in lines.items())
        read = read_map(written(tmp_path, text, 'png', shades)).cells
        return [int(each) for each in read.ravel()]

    assert cells() == [100, 100, -1, -1, 0, 0]
    assert cells(negate=1) == [0, -1, -1, 100, 100, 100]
    assert cells(negate='true') == cells(negate=1)
    assert cells(occupied_thresh=0.66, free_thresh=0.2) == [100, -1, -1, -1, 0, 0]
    assert cells(mode='raw') == [0, 88, 90, -1, -1, -1]
    assert cells(mode='scale', free_thresh=0.196) == [100, 100, 99, 13, 0, 0]


def test_what_nav2_saved_as_unknown_is_unknown(tmp_path: Path) -> None:
    shades = np.array([[0, 205, 206, 254]], np.uint8)
    text = 'image: building.png\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: {}\n'
    for free, cell in ((0.25, -1), (0.196, -1), (0.3, 0)):
        read = read_map(written(tmp_path, text.format(free), 'png', shades))
        assert read.cells.tolist() == [[100, cell, 0, 0]]


def test_transparency_and_colours(tmp_path: Path) -> None:
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 0], [0, 0, 0, 255]]], np.uint8)
    text = 'image: building.png\nresolution: 0.05\norigin: [0, 0, 0]\nmode: {}\n'
    found = {
        mode: read_map(written(tmp_path, text.format(mode), 'png', pixels)).cells.tolist()
        for mode in ('trinary', 'scale')
    }
    assert found == {'trinary': [[0, -1, 100]], 'scale': [[0, -1, 100]]}


def test_a_turned_map_is_where_its_origin_says(tmp_path: Path) -> None:
    pixels = np.full((40, 80), 254, np.uint8)
    pixels[:, 70] = 0  # one pixel wide
    text = 'image: building.pgm\nresolution: 0.1\norigin: [2.0, -1.0, 0.6]\n'
    read = read_map(written(tmp_path, text, pixels=pixels))
    ends = read.to_world([(7.05, 0.0), (7.05, 4.0)])
    grid = read.grid
    wall = np.linspace(ends[0], ends[1], 200)[3:-3]
    cells = grid.cells_of(wall)
    assert (grid.cells[cells[:, 0], cells[:, 1]] == 100).all()
    assert grid.at(grid.cells, *read.to_world([(3.0, 2.0)])[0]) == 0
    assert grid.at(grid.cells, *read.to_world([(3.0, 4.5)])[0]) == -1
    assert read.to_own(read.to_world([(3.0, 2.0)]))[0] == pytest.approx((3.0, 2.0))


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('image: x.pgm\nresolution: 0.05\n', 'building.yaml:1: '),
        ('image: building.pgm\nresolution: fine\n', "resolution: got 'fine', expected a number"),
        ('image: building.pgm\nresolution: -1\n', 'resolution: got -1, expected a number from'),
        ('resolution: 0.05\n', "a map in map_server's format needs 'image'"),
        ('image: building.pgm\nresolution: 0.05\nmodus: raw\n', 'modus: no key of a map, expected'),
        ('image: building.pgm\nresolution: 0.05\nmode: grey\n', "mode: got 'grey', expected trina"),
        ('image: building.pgm\nresolution: 0.05\norigin: [1]\n', 'origin: got [1], expected [x, y'),
        ('image: building.yaml\nresolution: 0.05\n', 'no picture that can be read'),
        (
            'image: building.pgm\nresolution: 1\noccupied_thresh: 0.1\nfree_thresh: 0.2\n',
            'free_thresh: 0.2: expected at most occupied_thresh, 0.1',
        ),
    ],
)
def test_a_map_that_cannot_be_used_costs_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError) as caught:
        read_map(written(tmp_path, text))
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_damaged_pictures_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    data = (tmp_path / 'building.pgm').read_bytes()
    for bad in (data[: len(data) // 2], b'P5 9999999 9999999 255 ', b'', data[:3]):
        (tmp_path / 'building.pgm').write_bytes(bad)
        with pytest.raises(FileError):
            read_map(path)


def test_a_map_given_as_a_place_names_the_command_that_makes_one(tmp_path: Path) -> None:
    for path in (written(tmp_path), tmp_path / 'building.pgm'):
        with pytest.raises(FileError) as caught:
            read_place(path)
        assert f'`python3 launch.py import {path}`' in str(caught.value)


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


def test_a_picture_with_a_scale_is_a_map(tmp_path: Path) -> None:
    written(tmp_path, ending='png')
    path = place(tmp_path, '    map_file_resolution: 0.05\n')
    path.write_text(path.read_text().replace('building.yaml', 'building.png'))
    assert read_place(path).plan.map is not None
    path.write_text(path.read_text().replace('map_file_resolution', '#'))
    with pytest.raises(FileError, match='says nothing of its scale'):
        read_place(path)


def test_a_place_needs_neither_walls_nor_map(tmp_path: Path) -> None:
    path = place(tmp_path)
    path.write_text(path.read_text().replace('map_file', '#'))
    file = read_place(path)
    assert isinstance(file, PlaceFile)
    assert not file.plan.is_enclosed
    assert draw_place(file.plan, 'Two rooms', '').size[0] > 500


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


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    cells = np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (30, 50))
    write_map(tmp_path / 'm.yaml', cells, 0.1, (1.0, -2.0, 0.5))
    read = read_map(tmp_path / 'm.yaml')
    assert (read.cells == cells).all()
    assert (read.resolution, read.origin) == (0.1, (1.0, -2.0, 0.5))


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
