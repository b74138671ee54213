"""Maps in map_server's format: what is read as what, what is refused, and places that refer to
them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from floor_plans import read_place
from floor_plans.occupancy_map import read_map, write_map
from strict_files.files import FileError

from .two_rooms import SIDE, building, written

SHADES = [0, 88, 90, 190, 205, 206, 254, 255]
"""Of which 88 is occupied by 0.655, 90 by 0.647, 190 by 0.255, 205 by 0.1961, 206 by 0.192."""
CELLS: dict[str, list[int]] = {
    '': [100, 100, -1, -1, -1, 0, 0, 0],
    'negate: 1': [0, -1, -1, 100, 100, 100, 100, 100],
    'negate: true': [0, -1, -1, 100, 100, 100, 100, 100],
    'mode: Trinary': [100, 100, -1, -1, -1, 0, 0, 0],
    'mode: scale': [100, 100, 99, 13, 0, 0, 0, 0],
    'mode: scale\nnegate: 1': [0, 33, 35, 100, 100, 100, 100, 100],
    'mode: raw': [0, 88, 90, -1, -1, -1, -1, -1],
    'mode: raw\nnegate: 1': [0, 88, 90, -1, -1, -1, -1, -1],
    'occupied_thresh: 0.66\nfree_thresh: 0.1': [100, -1, -1, -1, -1, -1, 0, 0],
    'occupied_thresh: 0.9\nfree_thresh: 0.25': [100, -1, -1, -1, 0, 0, 0, 0],
}
"""The right cells by the rules of nav2_map_server 1.3.13, worked out by hand."""


def pictured(shades: list[int]) -> dict[str, Image.Image]:
    """Return the shades in a row as pictures of all kinds, by the names of their files."""
    row = np.array([shades], np.uint8)
    grey = Image.fromarray(row)
    opaque = np.full_like(row, 255)
    palette = Image.fromarray(np.arange(len(shades), dtype=np.uint8)[None], 'P')
    palette.putpalette([each for shade in shades for each in (shade, shade, shade)])
    return {
        'grey.pgm': grey,
        'grey.png': grey,
        'grey.bmp': grey,
        'grey.tif': grey,
        'palette.png': palette,
        'palette.bmp': palette,
        'colours.png': Image.fromarray(np.stack([row] * 3, axis=2)),
        'colours.bmp': Image.fromarray(np.stack([row] * 3, axis=2)),
        'opaque.png': Image.fromarray(np.stack([*[row] * 3, opaque], axis=2)),
        'grey_opaque.png': Image.fromarray(np.stack([row, opaque], axis=2)),
        'sixteen.png': Image.fromarray(row.astype(np.uint16) * 257),
        'sixteen.pgm': Image.fromarray(row.astype(np.uint16) * 257),
    }


@pytest.mark.parametrize('said', CELLS)
@pytest.mark.parametrize('name', pictured(SHADES))
def test_cells_are_those_of_map_server(tmp_path: Path, name: str, said: str) -> None:
    pictured(SHADES)[name].save(tmp_path / name)
    lines = {'occupied_thresh': '0.65', 'free_thresh': '0.196', 'origin': '[0, 0, 0]'}
    lines |= dict(line.split(': ') for line in said.splitlines())
    text = '\n'.join(f'{key}: {value}' for key, value in lines.items())
    (tmp_path / 'map.yaml').write_text(f'image: {name}\nresolution: 0.05\n{text}\n')
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [CELLS[said]]


@pytest.mark.parametrize('mode', ['trinary', 'scale', 'raw'])
def test_what_is_not_opaque_is_unknown_but_in_raw_mode(tmp_path: Path, mode: str) -> None:
    grey = np.array([[0, 0, 254, 254, 30]], np.uint8)
    alpha = np.array([[255, 254, 255, 0, 255]], np.uint8)
    kinds = {
        'rgba': Image.fromarray(np.stack([grey, grey, grey, alpha], axis=2)),
        'la': Image.fromarray(np.stack([grey, alpha], axis=2)),
    }
    right = {'trinary': [100, -1, 0, -1, 100], 'scale': [100, -1, 0, -1, 100]}
    for name, picture in kinds.items():
        picture.save(tmp_path / f'{name}.png')
        text = f'image: {name}.png\nresolution: 0.05\nmode: {mode}\n'
        (tmp_path / 'map.yaml').write_text(text)
        found = read_map(tmp_path / 'map.yaml').cells.tolist()
        assert found == [right.get(mode, [0, 0, -1, -1, 30])]
    palette = Image.fromarray(np.array([[0, 1, 2]], np.uint8), 'P')
    palette.putpalette([0, 0, 0, 254, 254, 254, 254, 254, 254])
    palette.save(tmp_path / 'la.png', transparency=1)
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [
        [0, -1, -1] if mode == 'raw' else [100, -1, 0]
    ]


def test_a_colour_is_as_bright_as_its_luminance(tmp_path: Path) -> None:
    colours = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [100, 100, 0]]], np.uint8)
    text = 'image: c.png\nresolution: 0.05\nmode: raw\n'
    (tmp_path / 'map.yaml').write_text(text)
    Image.fromarray(colours).save(tmp_path / 'c.png')
    # 255 times 306, 601 and 117 of 1,024; above 100 it is unknown.
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [[76, -1, 29, 89]]
    Image.fromarray(colours[..., 0] > 200).save(tmp_path / 'c.png')  # one bit
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [[-1, 0, 0, 0]]
    deep = np.array([[[0, 0, 0], [0x7F00, 0x7F00, 0x7F00], [0x40FF, 0x40FF, 0x40FF]]], np.uint16)
    assert cv2.imwrite(str(tmp_path / 'c.png'), deep)
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [[0, -1, 65]], 'rounded'


def test_a_threshold_belongs_to_what_it_bounds(tmp_path: Path) -> None:
    Image.fromarray(np.array([[102, 103, 203, 204]], np.uint8)).save(tmp_path / 'm.png')
    text = 'image: m.png\nresolution: 1\nnegate: 1\nfree_thresh: 0.4\noccupied_thresh: 0.8\n'
    (tmp_path / 'map.yaml').write_text(text)
    assert read_map(tmp_path / 'map.yaml').cells.tolist() == [[0, -1, -1, 100]]


def test_what_nav2_saved_as_unknown_is_unknown_to_whoever_asks_for_it(tmp_path: Path) -> None:
    shades = np.array([[0, 205, 206, 254]], np.uint8)
    text = 'image: building.png\nresolution: 0.05\norigin: [0, 0, 0]\nfree_thresh: {}\n'
    for free, read_as, saved_as in ((0.25, 0, -1), (0.196, -1, -1), (0.3, 0, 0)):
        read = read_map(written(tmp_path, text.format(free), 'png', shades))
        assert read.cells.tolist() == [[100, read_as, 0, 0]]
        assert read.as_saved().cells.tolist() == [[100, saved_as, 0, 0]]


@pytest.mark.parametrize(
    'image',
    [
        '/home/user/maps/building.pgm',
        '~/maps/building.pgm',
        "'maps\\building.pgm'",
        'C:\\maps\\building.pgm',
        'building.png',
        'Building.PGM',
    ],
)
def test_a_picture_is_found_beside_the_file_that_names_another_place(
    tmp_path: Path, image: str
) -> None:
    path = written(tmp_path, f'image: {image}\nresolution: {SIDE}\n')
    read = read_map(path)
    assert read.picture == tmp_path / 'building.pgm'
    (note,) = read.notes
    assert note == (
        f'{path}: the picture {image.strip(chr(39))} is not there: {tmp_path}/building.pgm is taken'
    )


def test_a_picture_that_is_nowhere_is_told_with_those_that_are_there(tmp_path: Path) -> None:
    path = written(tmp_path, f'image: /maps/floor.pgm\nresolution: {SIDE}\n')
    with pytest.raises(FileError) as caught:
        read_map(path)
    assert str(caught.value) == (
        f'{path}:1: image: /maps/floor.pgm: no such file, nor is {tmp_path}/floor.pgm; '
        'the pictures there are building.pgm: expected its name'
    )
    for ending in ('png', 'bmp'):
        Image.fromarray(building()).save(tmp_path / f'floor.{ending}')
    with pytest.raises(FileError, match=r'there are floor\.bmp, floor\.png: expected its name$'):
        read_map(path)


def test_keys_that_nobody_knows_are_named_and_ignored(tmp_path: Path) -> None:
    text = 'image: building.pgm\nresolution: 0.05\nmap_name: ground floor\noccupied_tresh: 0.5\n'
    path = written(tmp_path, text)
    (note,) = read_map(path).notes
    assert note == (
        f'{path}: keys that no map has are ignored: map_name, occupied_tresh; '
        "is 'occupied_thresh' meant by 'occupied_tresh'?"
    )


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
        ('image: building.pgm\nresolution: 0.05\nmode: grey\n', "mode: got 'grey', expected trina"),
        ('image: building.pgm\nresolution: 0.05\norigin: [1]\n', 'origin: got [1], expected [x, y'),
        ('image: building.yaml\nresolution: 0.05\n', 'a text (38 bytes): expected a picture'),
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


@pytest.mark.parametrize(
    ('content', 'said'),
    [
        (b'%PDF-1.4 plan', 'a PDF (13 bytes): expected a picture'),
        (b'', 'an empty file: expected a picture'),
        (b'<svg width="9"/>', 'an SVG drawing (16 bytes)'),
        (b'version https://git-lfs.github.com/spec/v1', "Git LFS's pointer to a picture"),
        (b'P5 12000 12000 255\n', '12000 by 12000 pixels: expected at most 100000000 in all'),
        (b'P5 90000 90000 255\n', 'more pixels than any map has: expected at most 100000000'),
    ],
)
def test_what_is_no_picture_is_named_by_what_it_is(
    tmp_path: Path, content: bytes, said: str
) -> None:
    path = written(tmp_path)
    (tmp_path / 'building.pgm').write_bytes(content)
    with pytest.raises(FileError) as caught:
        read_map(path)
    assert f'building.pgm: {said}' in str(caught.value)
    assert 'damaged' not in str(caught.value)


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


def test_a_file_that_is_no_map_is_told_by_what_it_is(tmp_path: Path) -> None:
    archive = tmp_path / 'maps.zip'
    archive.write_bytes(b'PK\x03\x04' + bytes(60))
    with pytest.raises(FileError, match=r'maps.zip: a zip archive: expected a map.yaml, or a pic'):
        read_map(archive)


def test_a_picture_whose_name_is_too_long_for_a_file_is_told_as_missing(tmp_path: Path) -> None:
    path = tmp_path / 'map.yaml'
    path.write_text(f'image: {"x" * 300}.png\nresolution: 0.05\norigin: [0, 0, 0]\n')
    with pytest.raises(FileError, match='no such file'):
        read_map(path)
