"""The simulator's persons are found by the network that finds those in photographs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from indoor_watch.persons import load_finder
from surveillance_simulation.camera.model import Camera, Conditions, expose
from surveillance_simulation.camera.mujoco_rendering import MujocoRenderer
from surveillance_simulation.camera.rendering import Renderer
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.simulated_place import read_simulated_place

SEVEN_ROOMS = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'


def camera_along_x(x: float, y: float, z: float) -> np.ndarray:
    """Return the transform (4, 4) of a camera that looks along x."""
    return np.array([[0, 0, 1, x], [-1, 0, 0, y], [0, -1, 0, z], [0, 0, 0, 1]], float)


@pytest.mark.parametrize('renderer', [Renderer, MujocoRenderer])
def test_the_simulators_person_looks_like_one_to_a_network_that_knows_photographs(renderer):
    try:
        find = load_finder().find
    except ValueError as error:
        pytest.skip(str(error))
    if renderer is MujocoRenderer:
        pytest.importorskip('mujoco')
    seen = []
    for degrees in (0, 90, 225):
        world = read_simulated_place(SEVEN_ROOMS)
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
