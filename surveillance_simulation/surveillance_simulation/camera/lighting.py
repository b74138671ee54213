"""Uneven light on a picture: shadows' edges, a reflection, a lens that darkens the corners.

Shadow and reflection lie elsewhere in each picture, so that a camera that turns meets them anywhere
on a marker.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Scene = npt.NDArray[np.float32]

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
    return scene if light is None else light(scene, rng)


def _shadow(scene: Scene, rng: np.random.Generator, softness: float) -> Scene:
    from scipy.special import ndtr  # takes 0.1 s, which a simulator in even light does without

    x, y = _pixels(scene)
    direction = rng.uniform(0.0, 2.0 * math.pi)
    through = rng.uniform(0.25, 0.75, 2) * (scene.shape[1], scene.shape[0])
    depth = (x - through[0]) * math.cos(direction) + (y - through[1]) * math.sin(direction)
    light = 1.0 - (1.0 - _SHADE) * ndtr(depth / softness)
    return np.asarray(scene * light[:, :, None], dtype=np.float32)


def _vignette(scene: Scene, _rng: np.random.Generator) -> Scene:
    x, y = _pixels(scene)
    rows, columns = scene.shape[:2]
    radius = np.hypot(x - columns / 2, y - rows / 2) / math.hypot(columns / 2, rows / 2)
    return np.asarray(scene * (1.0 - _VIGNETTE * radius**2)[:, :, None], dtype=np.float32)


def _glare(scene: Scene, rng: np.random.Generator) -> Scene:
    x, y = _pixels(scene)
    rows, columns = scene.shape[:2]
    middle = rng.uniform(0.0, 1.0, 2) * (columns, rows)
    reach = _GLARE_REACH * columns
    added = _GLARE * np.exp(-((x - middle[0]) ** 2 + (y - middle[1]) ** 2) / (2.0 * reach**2))
    return np.asarray(scene + added[:, :, None], dtype=np.float32)


def _pixels(scene: Scene) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return columns (1, n) and rows (m, 1) of a scene's pixels."""
    rows, columns = scene.shape[:2]
    return np.arange(columns, dtype=np.float32)[None], np.arange(rows, dtype=np.float32)[:, None]


_LIGHTS: dict[str, Callable[[Scene, np.random.Generator], Scene] | None] = {
    'even': None,
    'hard shadow': lambda scene, rng: _shadow(scene, rng, _HARD),
    'soft shadow': lambda scene, rng: _shadow(scene, rng, _SOFT),
    'vignette': _vignette,
    'glare': _glare,
}

LIGHTINGS = tuple(_LIGHTS)
"""The names of the lights."""
