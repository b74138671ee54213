"""Dictionaries by name and from OpenCV's files."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection import (
    DICTIONARY_NAMES,
    DetectorSettings,
    MarkerDetector,
    dictionary_named,
)
from marker_detection.dictionaries import MarkerCodes


@pytest.fixture(params=['yml', 'json', 'xml'])
def own(request, tmp_path):
    path = tmp_path / f'own.{request.param}'
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    dictionary = cv2.aruco.extendDictionary(8, 6)
    dictionary.writeDictionary(storage)
    storage.release()
    return path, dictionary


def test_own_dictionary_in_opencvs_file_is_read_and_detected(own):
    path, dictionary = own
    assert (dictionary_named(str(path)).bytesList == dictionary.bytesList).all()
    image = np.full((200, 200), 220, np.uint8)
    image[50:146, 50:146] = dictionary.generateImageMarker(3, 96)
    found = MarkerDetector(DetectorSettings(str(path))).detect(image)
    assert [each.marker_id for each in found] == [3]


def test_file_without_correction_bits_is_read_as_opencv_reads_it(tmp_path):
    path = tmp_path / 'own.yaml'
    path.write_text(
        '%YAML:1.0\n---\nnmarkers: 2\nmarkersize: 4\n'
        'marker_0: "1011010011100101"\nmarker_1: "0010111010011100"\n'
    )
    theirs = cv2.aruco.Dictionary()
    assert theirs.readDictionary(cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ).root())
    ours = dictionary_named(str(path))
    assert (ours.bytesList == theirs.bytesList).all()
    assert ours.maxCorrectionBits == theirs.maxCorrectionBits == 0


@pytest.mark.parametrize('name', DICTIONARY_NAMES)
def test_codes_are_what_opencv_draws(name):
    dictionary = dictionary_named(name)
    codes = MarkerCodes.of(dictionary)
    for marker_id in range(0, len(dictionary.bytesList), 97):
        drawn = dictionary.generateImageMarker(marker_id, codes.side)
        assert ((drawn > 127) == (codes.cells[4 * marker_id, 1:-1, 1:-1] > 0)).all()
        turned = np.rot90(codes.cells[4 * marker_id], -1)
        assert (codes.cells[4 * marker_id + 1] == turned).all()


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('', 'cannot be read'),
        ('{', 'not valid YAML'),
        ('<?xml version="1.0"?><a>', 'not valid XML'),
        ('<?xml version="1.0"?><!DOCTYPE a><a/>', 'document type'),
        ('nmarkers: 1', 'lacks markersize'),
        (
            'nmarkers: 2\nmarkersize: 3\nmaxCorrectionBits: 1\nmarker_0: "010101010"',
            'lacks marker_1',
        ),
        ('nmarkers: 1\nmarkersize: 3\nmaxCorrectionBits: 1\nmarker_0: "01"', '9 digits 0 or 1'),
        ('nmarkers: 1\nmarkersize: 300\nmaxCorrectionBits: 1\nmarker_0: "01"', '300x300'),
        ('nmarkers: .inf\nmarkersize: 3\nmaxCorrectionBits: 1', 'cannot be read'),
        (
            'nmarkers: 1\nmarkersize: 3\nmaxCorrectionBits: 9999999999\nmarker_0: "010101010"',
            'maxCorrectionBits must be 0 to 9, got 9999999999',
        ),
    ],
)
def test_file_that_is_no_dictionary_is_refused_in_one_line(tmp_path, text, reason):
    path = tmp_path / 'own.yml'
    path.write_text(text)
    with pytest.raises(ValueError, match=reason) as error:
        dictionary_named(str(path))
    assert '\n' not in str(error.value)


def test_what_is_no_regular_file_is_refused():
    with pytest.raises(ValueError, match='unknown marker dictionary'):
        dictionary_named('/dev/zero')
    with pytest.raises(ValueError, match='did you mean DICT_5X5_'):
        dictionary_named('DICT_5x5')


def written(path, side, count=2, correction=None, lines=None):
    """Write a dictionary of markers that have one white cell each."""
    codes = (f'marker_{at}: "{(1 << at):0{side * side}b}"' for at in range(lines or count))
    correction = '' if correction is None else f'\nmaxCorrectionBits: {correction}'
    path.write_text(f'nmarkers: {count}\nmarkersize: {side}{correction}\n' + '\n'.join(codes))
    return str(path)


@pytest.mark.parametrize(('side', 'good'), [(2, False), (3, True), (16, True), (17, False)])
def test_markers_of_a_file_have_3_to_16_cells_a_side(tmp_path, side, good):
    name = written(tmp_path / 'own.yml', side)
    if good:
        dictionary = dictionary_named(name)
        assert (dictionary.markerSize, len(dictionary.bytesList)) == (side, 2)
        codes = MarkerCodes.of(dictionary)
        assert (codes.cells[4, 2:-2, 2:-2] > 0).sum() == 1
        assert codes.cells[4, -3, -4] > 0
    else:
        with pytest.raises(ValueError, match=f'has 2 markers of {side}x{side} cells, expected'):
            dictionary_named(name)


@pytest.mark.parametrize(('bits', 'good'), [(-1, False), (0, True), (9, True), (10, False)])
def test_as_many_bits_are_corrected_as_a_marker_has_at_most(tmp_path, bits, good):
    name = written(tmp_path / 'own.YML', 3, 1, bits)
    if good:
        assert dictionary_named(name).maxCorrectionBits == bits
    else:
        with pytest.raises(ValueError, match=f'maxCorrectionBits must be 0 to 9, got {bits}$'):
            dictionary_named(name)


@pytest.mark.parametrize('count', [-1, 0])
def test_a_file_has_one_marker_at_least(tmp_path, count):
    assert len(dictionary_named(written(tmp_path / 'one.yml', 3, 1)).bytesList) == 1
    with pytest.raises(ValueError, match=f'has {count} markers of 3x3 cells'):
        dictionary_named(written(tmp_path / 'none.yml', 3, count, lines=1))


def test_a_file_that_cannot_be_is_refused_and_says_why(tmp_path):
    for name, reason in (
        ('missing.yml', 'No such file or directory'),
        ('folder.yml', 'expected a file'),
        ('large.yml', 'larger than 10000000 bytes'),
        ('bytes.yml', 'is no text'),
    ):
        path = tmp_path / name
        if name == 'folder.yml':
            path.mkdir()
        elif name == 'large.yml':
            path.write_text(' ' * 10_000_001)
        elif name == 'bytes.yml':
            path.write_bytes(b'nmarkers: \xff')
        with pytest.raises(ValueError, match=f'^marker dictionary {path}:? {reason}$'):
            dictionary_named(str(path))
    (tmp_path / 'large.yml').write_text(' ' * 10_000_000)
    with pytest.raises(ValueError, match='cannot be read'):
        dictionary_named(str(tmp_path / 'large.yml'))


@pytest.mark.parametrize(('known', 'wrong'), [([-1], -1), ([5, 100, 7], 100), ([3, 102, 101], 101)])
def test_ids_beyond_the_dictionary_are_refused(known, wrong):
    reason = f'^known id {wrong} is not in the dictionary, expected 0 to 99$'
    with pytest.raises(ValueError, match=reason):
        MarkerCodes.of(dictionary_named('DICT_5X5_100'), known)
    codes = MarkerCodes.of(dictionary_named('DICT_5X5_100'), [99, 0, 99])
    assert codes.ids.tolist() == [0] * 4 + [99] * 4
    assert codes.turns.tolist() == [0, 1, 2, 3] * 2
