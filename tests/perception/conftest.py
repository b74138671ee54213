"""What the tests of perception share."""

from __future__ import annotations

import math

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


@pytest.fixture(scope='module')
def image():
    generator = np.random.default_rng(3)
    camera = CameraModel.from_field_of_view(320, 240, math.radians(60))
    scene = backdrop_of('plain', camera, generator)
    panels = [Panel(12, 1.5, offset=(-60.0, 0.0)), Panel(17, 1.5, offset=(60.0, 0.0))]
    dictionary = dictionary_named('DICT_5X5_100')
    return image_of(panels, camera, dictionary, scene, Degradation(), generator)
