"""The detect command: ids on the screen, drawings where they are asked for."""

from __future__ import annotations

import cv2
import pytest

from surveillance_perception.detect_command import main


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


def test_a_folder_that_cannot_be_made_costs_one_line_before_any_image_is_read(tmp_path, capsys):
    (tmp_path / 'taken').touch()
    assert main([str(tmp_path / 'nothing.png'), '--out', str(tmp_path / 'taken' / 'out')]) == 2
    assert capsys.readouterr().err == f'detect: {tmp_path}/taken/out: Not a directory\n'
