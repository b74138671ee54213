"""Places whose lamp is not as by day."""

from __future__ import annotations

import numpy as np
import pytest

from surveillance_simulation.camera.lamps import LampLight
from surveillance_simulation.camera.model import Array, Camera
from surveillance_simulation.world.simulated_place import SimulatedPlace
from tests.places import TWO_ROOMS


def looking_down(x: float, y: float) -> Array:
    """Return the pose of a camera 2 m above the floor that looks down; its top is the north."""
    pose = np.eye(4)
    pose[:3, :3] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    pose[:3, 3] = x, y, 2.0
    return pose


def seen_light(light: LampLight, x: float, y: float) -> np.ndarray:
    """Return how bright a floor of brightness 1 is in a picture of 3 x 3 pixels, 0.1 m each."""
    camera = Camera(3, 3, 20.0)
    floor = np.ones((3, 3, 3), np.float32)
    nearness = np.full((3, 3), 0.5, np.float32)
    return light.shine(floor, nearness, camera, looking_down(x, y))[..., 0]


def test_each_place_has_the_light_of_its_own_lamp() -> None:
    world = SimulatedPlace.from_parameters(TWO_ROOMS)
    assert LampLight.of(world, None) is None
    world.set_lamp('A', 0.3)
    world.set_door('D', is_open=False)
    light = LampLight.of(world, None)
    assert light is not None
    assert LampLight.of(world, light) is light
    assert seen_light(light, 1.0, 1.0) == pytest.approx(np.full((3, 3), 0.3), abs=1e-4)
    assert seen_light(light, 5.0, 1.0) == pytest.approx(np.ones((3, 3)), abs=1e-4)
    assert seen_light(light, 90.0, 1.0) == pytest.approx(np.ones((3, 3)), abs=1e-4)
    world.set_lamp('A', 0.0)
    dark = LampLight.of(world, light)
    assert dark is not None
    assert dark is not light
    assert seen_light(dark, 1.0, 1.0) == pytest.approx(np.full((3, 3), 0.02)), 'some is left'


def test_through_an_open_door_light_comes_as_far_as_a_metre() -> None:
    world = SimulatedPlace.from_parameters(TWO_ROOMS)
    world.set_lamp('A', 0.2)
    world.set_door('D', is_open=False)
    closed = LampLight.of(world, None)
    assert closed is not None
    beside, away, bright = (2.8, 1.0), (1.5, 1.0), (3.2, 1.0)
    assert seen_light(closed, *beside)[1, 1] == pytest.approx(0.2, abs=0.01)
    world.set_door('D', is_open=True)
    open_door = LampLight.of(world, closed)
    assert open_door is not None
    assert open_door is not closed
    assert 0.22 < seen_light(open_door, *beside)[1, 1] < 0.6
    assert 0.6 < seen_light(open_door, *bright)[1, 1] < 0.95
    assert seen_light(open_door, *away)[1, 1] == pytest.approx(0.2, abs=0.01)
    assert seen_light(open_door, 2.4, 1.0)[1, 1] == pytest.approx(0.2, abs=1e-4)
    assert seen_light(open_door, 2.8, 0.2)[1, 1] < 0.3, 'beside the door the wall keeps it out'
