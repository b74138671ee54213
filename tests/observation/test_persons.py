"""Persons in pictures: photographs that others took, and the network's answer taken apart."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
import skimage

from surveillance_perception.observation.persons import PersonFinder, load_finder

DATA = Path(skimage.__file__).parent / 'data'


def photograph(name: str) -> np.ndarray:
    return np.asarray(cv2.imread(str(DATA / f'{name}.png')), np.uint8)


def finder() -> PersonFinder:
    pytest.importorskip('ai_edge_litert')
    try:
        return load_finder()
    except ValueError as error:
        pytest.skip(str(error))


def test_persons_are_found_in_photographs_and_in_no_other():
    find = finder().find
    found = {name: find(photograph(name)) for name in ('astronaut', 'coffee')}
    assert len(found['astronaut']) == 1
    left, top, width, height = found['astronaut'][0].box
    assert left <= 224 <= left + width
    assert top <= 110 + 100 <= top + height
    for name in ('coffee', 'chelsea', 'brick', 'grass', 'motorcycle_left', 'coins', 'clock_motion'):
        assert not find(photograph(name)), name


def test_a_small_picture_of_a_person_in_a_wide_one_is_found_where_it_is():
    person = cv2.resize(photograph('astronaut'), (240, 240))
    scene = np.full((480, 1280, 3), 127, np.uint8)
    scene[200:440, 900:1140] = person
    (found,) = finder().find(scene)
    assert 820 < found.box[0] + found.box[2] / 2 < 1220


def test_a_box_follows_from_the_anchor_and_lies_within_the_picture():
    """The anchor in row 3, column 5 of the finest grid; a person in the whole of a wide picture."""
    shown = []

    def network(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        shown.append(values)
        coordinates, scores = np.zeros((2254, 12), np.float32), np.full(2254, -200.0, np.float32)
        if len(shown) == 1:
            number = 2 * (3 * 28 + 5)
            scores[number] = 3.0
            coordinates[number, 5] = 60.0  # the hips, 60 pixels below
            coordinates[number, 6:8] = 0.0, 80.0
        return coordinates, scores

    picture = np.full((112, 224, 3), 255, np.uint8)
    (person,) = PersonFinder(network).find(picture)
    assert 0.95 < person.confidence < 0.96
    # The anchor is at (44, 28), its hips at (44, 88), the rim 20 below; 56 black rows stand above.
    assert person.box == (24, 12, 40, 40)
    assert shown[0].shape == (1, 224, 224, 3)
    assert shown[0].min() == -1.0
    assert shown[0].max() == 1.0
    assert len(shown) == 1, 'squares of so small a picture would be enlarged'


def test_what_is_missing_or_wrong_is_one_line(tmp_path: Path, monkeypatch):
    real = importlib.util.find_spec
    wrong = tmp_path / 'pose.tflite'
    wrong.write_bytes(b'no network')
    if real('ai_edge_litert') is not None:
        with pytest.raises(ValueError, match=r'pose\.tflite'):
            load_finder(str(wrong))
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(ValueError, match=r'no package mediapipe .*pip install'):
        load_finder()
    with pytest.raises(ValueError, match=r'no package ai_edge_litert; pip install'):
        load_finder(str(wrong))
