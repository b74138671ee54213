"""The noise of an image, told and smoothed away, against noise of known strength."""

from __future__ import annotations

import numpy as np
import pytest

from marker_detection.preprocessing import prepare

# from black to white, so that nothing is stretched
SCENE = np.repeat(np.repeat(np.array([[20.0, 240.0], [240.0, 20.0]]), 120, axis=0), 160, axis=1)


def noisy(deviation):
    noise = np.random.default_rng(4).normal(0.0, deviation, SCENE.shape)
    return np.clip(np.rint(SCENE + noise), 0, 255).astype(np.uint8)


@pytest.mark.parametrize('deviation', [0.0, 1.5, 2.5])
def test_little_noise_is_told_and_left(deviation):
    prepared = prepare(noisy(deviation))
    assert prepared.noise == pytest.approx(deviation, rel=0.15)
    assert (prepared.smooth == prepared.grey).all()


@pytest.mark.parametrize('deviation', [4.0, 6.0])
def test_much_noise_is_smoothed_to_what_is_told(deviation):
    prepared = prepare(noisy(deviation))
    left = (prepared.smooth.astype(float) - SCENE)[10:110, 10:150]
    assert left.std() < 0.8 * deviation
    assert prepared.noise == pytest.approx(left.std(), rel=0.15)
