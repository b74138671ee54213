"""What is read from files: images, videos, the registry of markers, and the detect command."""

from __future__ import annotations

import math
import resource
from pathlib import Path

import cv2
import numpy as np
import pytest

from libs.marker_detection.tests.backdrops import backdrop_of
from marker_detection.camera_model import CameraModel
from marker_detection.dictionaries import dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    image_of,
)
from strict_files.files import FileError
from surveillance_perception.detect_command import main
from surveillance_perception.marker_registry import read_registry
from surveillance_perception.stream.image_files import ImageError, decode_image, read_image
from surveillance_perception.stream.video import open_source

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.fixture(scope='module')
def image():
    generator = np.random.default_rng(3)
    camera = CameraModel.from_field_of_view(320, 240, math.radians(60))
    scene = backdrop_of('plain', camera, generator)
    panels = [Panel(12, 1.5, offset=(-60.0, 0.0)), Panel(17, 1.5, offset=(60.0, 0.0))]
    dictionary = dictionary_named('DICT_5X5_100')
    return image_of(panels, camera, dictionary, scene, Degradation(), generator)


def test_detect_prints_ids_and_draws_them_where_asked(tmp_path, capsys, image):
    path = tmp_path / 'room.png'
    cv2.imwrite(str(path), image)
    assert main([str(path), '--known', '12', '--out', str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert '2 markers' in said
    assert 'id   12' in said
    assert 'not on the known list' in said.splitlines()[-1]
    drawn = cv2.imread(str(tmp_path / 'room_markers.png'))
    assert drawn.shape == (240, 320, 3)
    assert (drawn != cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)).any()


def test_detect_writes_nothing_without_out(tmp_path, capsys, image):
    path = tmp_path / 'room.png'
    cv2.imwrite(str(path), image)
    assert main([str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == f'{path}: 2 markers'
    assert list(tmp_path.iterdir()) == [path]


def test_detect_names_each_file_that_is_no_image_and_goes_on(tmp_path, capsys, image):
    good, bad = tmp_path / 'good.png', tmp_path / 'bad.png'
    cv2.imwrite(str(good), image)
    bad.write_bytes(b'not an image')
    assert (
        main([str(bad), str(tmp_path / 'goood.png'), str(good), '--out', str(tmp_path / 'o')]) == 1
    )
    captured = capsys.readouterr()
    assert captured.err.splitlines() == [
        f'detect: {bad} is no image that OpenCV can decode',
        f'detect: {tmp_path / "goood.png"}: No such file or directory, expected {str(good)!r}',
    ]
    assert '2 markers' in captured.out
    assert (tmp_path / 'o' / 'good_markers.png').exists()


@pytest.mark.parametrize(
    ('options', 'reason'),
    [
        (['--dictionary', 'DICT_1'], "detect: unknown marker dictionary 'DICT_1'"),
        (['--known', '500'], 'detect: known id 500 is not in the dictionary'),
    ],
)
def test_detect_refuses_wrong_options_in_one_line(capsys, options, reason):
    assert main(['x.png', *options]) == 2
    assert capsys.readouterr().err.startswith(reason)


def test_detect_keeps_copies_of_images_with_one_name_apart(tmp_path, capsys, image):
    for folder in ('a', 'b'):
        (tmp_path / folder).mkdir()
        cv2.imwrite(str(tmp_path / folder / 'room.png'), image)
    files = [str(tmp_path / folder / 'room.png') for folder in ('a', 'b')]
    assert main([*files, '--out', str(tmp_path / 'out')]) == 0
    assert sorted(each.name for each in (tmp_path / 'out').iterdir()) == [
        'room_markers.png',
        'room_markers_2.png',
    ]


def test_detect_never_writes_over_an_image_it_was_given(tmp_path, capsys, image):
    room, other = tmp_path / 'room.png', tmp_path / 'room_markers.png'
    for path in (room, other):
        cv2.imwrite(str(path), image)
    given = other.read_bytes()
    assert main([str(room), str(other), '--out', str(tmp_path)]) == 0
    assert other.read_bytes() == given


def test_detect_leaves_an_image_alone_that_has_the_copys_name_too(tmp_path, image):
    path = tmp_path / 'room.png'
    cv2.imwrite(str(path), image)
    given = path.read_bytes()
    (tmp_path / 'room_markers.png').hardlink_to(path)
    assert main([str(path), '--out', str(tmp_path)]) == 0
    assert path.read_bytes() == given


def test_png_whose_length_was_damaged_is_refused_before_memory_is_taken(image):
    data = bytearray(cv2.imencode('.png', image)[1].tobytes())
    data[data.index(b'IDAT') - 4] = 0x70
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ImageError, match='no whole PNG'):
        decode_image(bytes(data), 'image')
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


@pytest.mark.parametrize('path', ['/dev/zero', '/dev'])
def test_what_is_no_regular_file_is_not_read(path):
    with pytest.raises(ImageError, match='expected a file, got a'):
        read_image(Path(path))


@pytest.mark.parametrize('data', [b'', b'\x89PNG\r\n\x1a\n', b'\xff\xd8\xff\xe0junk', b'BM'])
def test_corrupted_images_are_refused_in_one_line(data):
    with pytest.raises(ImageError) as error:
        decode_image(data, 'image')
    assert '\n' not in str(error.value)


def test_folder_is_played_in_order_of_names(tmp_path, image):
    for index, level in enumerate((10, 20, 30)):
        cv2.imwrite(str(tmp_path / f'{index}.png'), np.full((8, 8), level, np.uint8))
    (tmp_path / 'notes.txt').write_text('no image')
    (tmp_path / '1b.png').write_bytes(b'broken')
    frames = list(open_source(str(tmp_path)).frames)
    assert [int(each[0, 0, 0]) for each in frames if not isinstance(each, ImageError)] == [
        10,
        20,
        30,
    ]
    assert '1b.png' in str(frames[2])


def test_video_file_is_played_at_its_own_rate(tmp_path):
    path = tmp_path / 'video.avi'
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'MJPG'), 12.5, (64, 48))  # type: ignore[attr-defined]
    for level in (0, 100, 200):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    source = open_source(str(path))
    assert source.rate == pytest.approx(12.5)
    assert [round(float(np.mean(each)), -1) for each in source.frames] == [0, 100, 200]  # type: ignore[arg-type]
    source.frames.close()


def test_source_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ImageError, match='no such video file or folder'):
        open_source(str(tmp_path / 'none.avi'))
    with pytest.raises(ImageError, match='holds no images'):
        open_source(str(tmp_path))


def test_registry_holds_the_seven_markers():
    markers = read_registry(CONFIG / 'markers.yaml')
    assert {marker_id: place.room for marker_id, place in markers.items()} == {
        11: 'E',
        12: 'C1',
        13: 'C2',
        14: 'R1',
        15: 'R2',
        16: 'R3',
        17: 'R4',
    }
    assert (markers[16].x, markers[16].y) == (9.0, 3.0)
    assert dict(markers[12].connections) == {'D5': 'E', 'D7': 'C2', 'D1': 'R1', 'D2': 'R2'}


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('', ':1: expected a mapping, got nothing'),
        ('markers: []', ":1: expected a mapping 'markers'"),
        ('markers: {}', "'markers' is empty"),
        ('markers: {1: {room: A, x: 0, y: 0, connections: {D: B}}', ':1: not valid YAML'),
        ('markers: {a: {room: A, x: 0, y: 0, connections: {D: B}}}', 'markers.a: an id must be'),
        ('markers: {-1: {room: A, x: 0, y: 0, connections: {D: B}}}', 'markers.-1: an id must be'),
        ('markers: {[1]: E}', ':1: expected a name as key'),
        ('markers:\n  1: E', ":2: markers.1: expected 'room', 'x', 'y' and 'connections'"),
        (
            'markers: {1: {room: 3, x: 0, y: 0, connections: {D: B}}}',
            '1.room: place name 3:',
        ),
        ('markers: {1: {room: A, x: no, y: 0, connections: {D: B}}}', '1.x: expected a number in'),
        ('markers: {1: {room: A, x: .nan, y: 0, connections: {D: B}}}', 'got nan'),
        (
            'markers: {1: {room: A, x: 0, y: 0, connections: {}}}',
            '1.connections: expected',
        ),
        ('markers: {1: {room: A, x: 0, y: 0, connections: {D: A}}}', 'D: leads from A to itself'),
        (
            'markers: {1: {room: A, z: 0, x: 0, y: 0, connections: {D: B}}}',
            '1.z: unknown, exp',
        ),
        (
            'markers:\n  1: {room: A, x: 0, y: 0, connections: {D: B}}\n'
            '  1: {room: B, x: 0, y: 0, connections: {D: A}}\n',
            ":3: duplicate key '1', first given in line 2",
        ),
        (
            'markers:\n  1: {room: A, x: 0, y: 0, connections: {D: B}}\n'
            '  01: {room: B, x: 0, y: 0, connections: {D: A}}\n',
            ':3: markers.01: the id is given twice',
        ),
        ('markers: {1: &a {room: A, x: 0, y: 0, connections: {D: *a}}}', 'an alias'),
    ],
)
def test_wrong_registry_is_refused_in_one_line_that_names_the_file(tmp_path, text, reason):
    path = tmp_path / 'markers.yaml'
    path.write_text(text)
    with pytest.raises(FileError) as error:
        read_registry(path)
    assert str(error.value).startswith(str(path))
    assert reason in str(error.value)
    assert '\n' not in str(error.value)


def test_registry_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileError, match='No such file'):
        read_registry(tmp_path / 'none.yaml')


def test_a_folder_that_cannot_be_made_costs_one_line_before_any_image_is_read(tmp_path, capsys):
    (tmp_path / 'taken').touch()
    assert main([str(tmp_path / 'nothing.png'), '--out', str(tmp_path / 'taken' / 'out')]) == 2
    assert capsys.readouterr().err == f'detect: {tmp_path}/taken/out: Not a directory\n'
