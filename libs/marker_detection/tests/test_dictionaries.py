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
