"""The lights that a simulated camera may take its pictures in.

Shadow and reflection lie elsewhere in each picture, so that a camera that turns meets them anywhere
on a marker.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from surveillance_runtime.image_effects import Light, glare, shadow, vignette

Scene = npt.NDArray[np.float32]
Shape = tuple[int, int]

_SHADE = 0.4
_HARD, _SOFT = 0.3, 12.0
_VIGNETTE = 0.7
_GLARE, _GLARE_REACH = 255.0, 0.03


def lit(scene: Scene, lighting: str, rng: np.random.Generator) -> Scene:
    """Return a scene (rows, columns, channels) under one of `LIGHTINGS`.

    Raises:
        KeyError: There is no light of that name.
    """
    light = _LIGHTS[lighting]
    if light is None:
        return scene
    shape = scene.shape[0], scene.shape[1]
    cast = light(shape, rng)[:, :, None]
    return np.asarray(scene + cast if lighting == 'glare' else scene * cast)


def _shadow(shape: Shape, rng: np.random.Generator, softness: float) -> Light:
    direction = rng.uniform(0.0, 2.0 * math.pi)
    rows, columns = shape
    through = columns * rng.uniform(0.25, 0.75), rows * rng.uniform(0.25, 0.75)
    return shadow(shape, through, direction, _SHADE, softness)


def _glare(shape: Shape, rng: np.random.Generator) -> Light:
    rows, columns = shape
    middle = columns * rng.uniform(0.0, 1.0), rows * rng.uniform(0.0, 1.0)
    return glare(shape, middle, _GLARE_REACH * columns, _GLARE)


_LIGHTS: dict[str, Callable[[Shape, np.random.Generator], Light] | None] = {
    'even': None,
    'hard shadow': lambda shape, rng: _shadow(shape, rng, _HARD),
    'soft shadow': lambda shape, rng: _shadow(shape, rng, _SOFT),
    'vignette': lambda shape, _rng: vignette(shape, _VIGNETTE),
    'glare': _glare,
}

LIGHTINGS = tuple(_LIGHTS)
"""The names of the lights."""
