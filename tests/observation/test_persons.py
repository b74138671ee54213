"""Persons in pictures: photographs that others took, and the network's answer taken apart."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import skimage

from surveillance_perception.observation.persons import PersonFinder, load_finder
from surveillance_simulation.camera.model import Camera, Conditions, expose
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.world import read_world

SEVEN_ROOMS = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
DATA = Path(skimage.__file__).parent / 'data'


def photograph(name: str) -> np.ndarray:
    return np.asarray(cv2.imread(str(DATA / f'{name}.png')), np.uint8)


def camera_along_x(x: float, y: float, z: float) -> np.ndarray:
    """Return the transform (4, 4) of a camera that looks along x."""
    return np.array([[0, 0, 1, x], [-1, 0, 0, y], [0, -1, 0, z], [0, 0, 0, 1]], float)


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
    assert len(shown) == 2, 'squares of so small a picture would be enlarged'


def test_who_reaches_out_of_the_picture_is_found_with_a_margin_around_it():
    """Only in the second look, at 1.4 times the width, the anchor in the middle is sure of it."""
    for score, count in ((1.2, 0), (1.6, 1)):
        looks = 0

        def network(values: np.ndarray, score: float = score) -> tuple[np.ndarray, np.ndarray]:
            nonlocal looks
            looks += 1
            coordinates, scores = np.zeros((2254, 12), np.float32), np.full(2254, -200.0)
            if looks == 2:
                assert values[0, 30].max() == -1.0
                assert values[0, 112, 112].min() == 1.0
                number = 2 * (14 * 28 + 14)
                scores[number] = score
                coordinates[number, 6:8] = 0.0, -100.0
            return coordinates, scores.astype(np.float32)

        found = PersonFinder(network).find(np.full((200, 200, 3), 255, np.uint8))
        assert [each.box for each in found] == [(0, 0, 200, 200)] * count


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


@pytest.mark.parametrize('renderer', [Renderer, MujocoRenderer])
def test_the_simulators_person_looks_like_one_to_a_network_that_knows_photographs(renderer):
    find = finder().find
    if renderer is MujocoRenderer:
        pytest.importorskip('mujoco')
    seen = []
    for degrees in (0, 90, 225):
        world = read_world(SEVEN_ROOMS)
        world.put(person('p', 13.0, 8.0, math.radians(degrees)))
        drawn = renderer(world, Camera.from_field_of_view())
        picture = expose(
            drawn.ideal(camera_along_x(10.0, 8.0, 0.9)),
            Conditions(),
            np.random.default_rng(1),
        )
        drawn.close()
        seen.append(find(np.ascontiguousarray(picture[..., ::-1])))
    assert [len(each) for each in seen] == [1, 1, 1]
