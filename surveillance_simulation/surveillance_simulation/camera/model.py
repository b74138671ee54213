"""The simulated camera: its lens, and what it suffers from: light, blur, motion and noise.

The optical frame is REP-103's: x right, y down, z forward. Pixel centres have whole coordinates.
Shadow and reflection lie elsewhere in each picture, so that a camera that turns meets them anywhere
on a marker.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection.testing.image_effects import Light, glare, shadow, streak, vignette
from strict_files.settings import parameter

Array = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]
Scene = npt.NDArray[np.float32]
Shape = tuple[int, int]

_SHADE = 0.4
_HARD, _SOFT = 0.3, 12.0
_VIGNETTE = 0.7
_GLARE, _GLARE_REACH = 255.0, 0.03


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


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion.

    Attributes:
        width: Columns of the picture.
        height: Rows of the picture.
        focal: Focal length, pixels.
    """

    width: int
    height: int
    focal: float

    @classmethod
    def from_field_of_view(
        cls, width: int = 640, height: int = 480, horizontal: float = math.radians(60)
    ) -> Camera:
        """Return a camera by the size of its picture and its horizontal field of view (rad).

        Raises:
            ValueError: The picture has no area, or the field of view is not between 0 and pi.
        """
        if width < 1 or height < 1:
            raise ValueError(f'a picture of {width}x{height} pixels has no area')
        if not 0.0 < horizontal < math.pi:
            raise ValueError(f'field of view {horizontal:g} rad: expected between 0 and pi')
        return cls(width, height, width / 2 / math.tan(horizontal / 2))

    @property
    def matrix(self) -> Array:
        """Camera matrix (3, 3)."""
        return np.array(
            [
                [self.focal, 0.0, (self.width - 1) / 2],
                [0.0, self.focal, (self.height - 1) / 2],
                [0.0, 0.0, 1.0],
            ]
        )


@dataclass(frozen=True)
class Conditions:
    """What stands between the scene and its picture.

    Attributes:
        motion_angle: Direction of the streak in the picture, rad, from x towards y.
    """

    light: float = parameter(
        1.0, "Brightness of the camera's pictures: 1 a lit room, 0.1 a dark one.", 0.0, 100.0
    )
    noise: float = parameter(
        2.0, "Standard deviation of the camera's noise, grey levels.", 0.0, 100.0
    )
    blur: float = parameter(0.4, "Standard deviation of the lens's blur, pixels.", 0.0, 100.0)
    motion: float = parameter(
        0.0, 'Length of the streak that motion draws in a picture, pixels.', 0.0, 100.0
    )
    motion_angle: float = parameter(0.0, 'Direction of that streak, rad.', -math.pi, math.pi)
    lighting: str = parameter(
        'even', 'How evenly the light falls on what the camera sees.', choices=LIGHTINGS
    )


def covered(scene: Scene) -> Scene:
    """Return what a camera sees of a scene through something that lies on its lens: a dim glow."""
    return np.full_like(scene, 0.12 * float(scene.mean()) + 8.0)


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


def expose(scene: Scene, conditions: Conditions, rng: np.random.Generator) -> Picture:
    """Return the picture (rows, columns, channels) that the camera takes of ideal brightnesses."""
    taken = lit(scene, conditions.lighting, rng)
    if conditions.blur > 0:
        taken = np.asarray(cv2.GaussianBlur(taken, (0, 0), conditions.blur), np.float32)
    if conditions.motion > 1:
        path = streak(conditions.motion, conditions.motion_angle)
        taken = np.asarray(cv2.filter2D(taken, -1, path), np.float32)
    if conditions.light != 1.0:
        taken = taken * np.float32(conditions.light)
    if conditions.noise > 0:
        grain = rng.standard_normal(taken.shape, dtype=np.float32)
        taken = np.asarray(cv2.scaleAdd(grain, conditions.noise, taken), np.float32)
    return np.asarray(cv2.convertScaleAbs(np.maximum(taken, 0.0)), dtype=np.uint8)
