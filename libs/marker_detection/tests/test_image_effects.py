"""What light and a lens do to an image, at pixels where it is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from marker_detection.testing.image_effects import glare, shadow, vignette
from marker_detection.testing.marker_scene import Degradation, degrade

SHAPE = 60, 80


def test_glare_falls_off_as_a_normal_distribution_of_its_deviation():
    light = glare(SHAPE, (30.0, 20.0), 8.0, 200.0)
    assert light[20, 30] == pytest.approx(200.0)
    for steps in (1, 2):
        share = math.exp(-(steps**2) / 2)
        assert light[20, 30 + 8 * steps] == pytest.approx(200.0 * share, rel=1e-5)
        assert light[20 + 8 * steps, 30] == pytest.approx(200.0 * share, rel=1e-5)


def test_shadow_is_half_at_its_edge_and_dark_on_its_side():
    light = shadow(SHAPE, (30.0, 20.0), math.pi / 2, 0.4, 3.0)
    assert light[20, 5] == pytest.approx(0.7)
    assert light[0, 5] == pytest.approx(1.0, abs=1e-4)
    assert light[40, 5] == pytest.approx(0.4, abs=1e-4)


def test_corners_lack_the_share_of_the_light_that_is_asked_for():
    light = vignette(SHAPE, 0.5)
    assert light[30, 40] == pytest.approx(1.0)
    assert light[0, 0] == pytest.approx(0.5)


@pytest.mark.parametrize('blur', [0.0, 1.0, 3.0])
def test_an_edge_is_as_wide_as_the_blur(blur):
    scene = np.full(SHAPE, 20.0, np.float32)
    scene[:, 40:] = 220.0
    image = degrade(scene, Degradation(blur=blur, noise=0.0), np.random.default_rng(1))
    # the slope of a blurred edge is a normal distribution
    slope = np.diff(image[30].astype(float)) / 200.0
    assert slope.sum() == pytest.approx(1.0)
    spread = np.square(np.arange(len(slope)) - 39.0) @ slope
    assert math.sqrt(spread) == pytest.approx(blur, abs=0.1)
