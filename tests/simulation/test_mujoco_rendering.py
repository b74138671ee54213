"""Pictures from MuJoCo show the same place; without it the error says what is missing."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from surveillance_simulation.camera import mujoco_rendering
from surveillance_simulation.camera.model import Camera, Conditions, expose
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.world.simulated_place import read_simulated_place
from tests.places import CONFIG, camera_pose, two_rooms

CLEAN = Conditions(noise=0.0, blur=0.0)


def corners_in(picture: np.ndarray) -> dict[int, np.ndarray]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
    found = [] if ids is None else [int(each) for each in np.ravel(ids)]
    return dict(zip(found, (np.reshape(each, (4, 2)) for each in corners), strict=True))


def test_both_renderers_show_the_same_markers_at_the_same_pixels() -> None:
    pytest.importorskip('mujoco')
    world = read_simulated_place(CONFIG / 'patrol_world.yaml')
    camera = Camera.from_field_of_view()
    renderer, other = MujocoRenderer(world, camera), Renderer(world, camera)
    rng = np.random.default_rng(0)
    seen = set()
    for degrees in range(0, 360, 40):
        pose = camera_pose(1.5, 8.0, 0.8, math.radians(degrees))
        found = corners_in(expose(renderer.ideal(pose), CLEAN, rng))
        expected = corners_in(expose(other.ideal(pose), CLEAN, rng))
        for marker in found.keys() & expected.keys():
            assert found[marker] == pytest.approx(expected[marker], abs=2.0)
        seen |= found.keys()
    renderer.close()
    assert seen == {marker.id for marker in world.plan.markers.values()}


def test_changes_are_shown_after_refresh() -> None:
    pytest.importorskip('mujoco')
    world = two_rooms()
    renderer = MujocoRenderer(world, Camera.from_field_of_view())
    pose, rng = camera_pose(1.0, 1.4, 1.0, -math.pi / 2), np.random.default_rng(0)
    before = expose(renderer.ideal(pose), CLEAN, rng)
    world.place_obstacle('box', 1.0, 0.6, 0.2)
    assert (expose(renderer.ideal(pose), CLEAN, rng) == before).all()
    renderer.refresh()
    assert (expose(renderer.ideal(pose), CLEAN, rng) != before).any()
    renderer.close()


def test_without_mujoco_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco_rendering, 'mujoco', None)
    with pytest.raises(ImportError, match='pip install mujoco'):
        MujocoRenderer(two_rooms(), Camera.from_field_of_view())
