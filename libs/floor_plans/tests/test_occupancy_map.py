"""Maps in map_server's format: what is read as what, what is refused, and places that refer to
them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from floor_plans import read_place
from floor_plans.occupancy_map import read_map, write_map
from strict_files.files import FileError

from .two_rooms import SIDE, written


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
        assert f'`import {path}`' in str(caught.value)


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    cells = np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (30, 50))
    write_map(tmp_path / 'm.yaml', cells, 0.1, (1.0, -2.0, 0.5))
    read = read_map(tmp_path / 'm.yaml')
    assert (read.cells == cells).all()
    assert (read.resolution, read.origin) == (0.1, (1.0, -2.0, 0.5))
