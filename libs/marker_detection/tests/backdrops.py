"""Textures without any marker, as backgrounds and for counting false detections.

Every random number comes from the caller's generator.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection import CameraModel

Array = npt.NDArray[np.float64]

BACKDROPS = ('plain', 'clouds', 'bricks', 'boards', 'boxes', 'letters', 'stripes', 'leaves')


def backdrop_of(
    kind: str, camera: CameraModel, generator: np.random.Generator
) -> npt.NDArray[np.float32]:
    """Return grey levels (height, width) of a background without any marker.

    Args:
        kind: One of `BACKDROPS`, or 'dark': a dark wall.
        camera: Gives the size.
        generator: Source of every random choice.

    Raises:
        ValueError: `kind` is unknown.
    """
    shape = (camera.height, camera.width)
    level = generator.uniform(90, 170)
    clouds = level + 18.0 * _clouds(shape, generator)
    if kind == 'plain':
        drawn = np.full(shape, level)
    elif kind == 'dark':
        drawn = level / 4.0 + 6.0 * _clouds(shape, generator)
    elif kind == 'clouds':
        drawn = level + 70.0 * _clouds(shape, generator)
    elif kind == 'bricks':
        drawn = _bricks(shape, clouds, generator)
    elif kind == 'boards':
        drawn = _boards(shape, generator)
    elif kind == 'boxes':
        drawn = _boxes(clouds, generator)
    elif kind == 'letters':
        drawn = _letters(clouds, generator)
    elif kind == 'stripes':
        drawn = _stripes(shape, generator)
    elif kind == 'leaves':
        noise = generator.normal(0, 1, shape)
        drawn = level + 160.0 * cv2.GaussianBlur(noise, (0, 0), generator.uniform(1.0, 3.0))
    else:
        raise ValueError(f"unknown backdrop '{kind}', expected one of {', '.join(BACKDROPS)}")
    return np.asarray(np.clip(drawn, 0, 255), dtype=np.float32)


def _clouds(shape: tuple[int, int], generator: np.random.Generator) -> Array:
    total = np.zeros(shape)
    for octave in range(1, 7):
        grid = generator.uniform(-1, 1, (2**octave + 1, 2**octave + 1))
        total += cv2.resize(grid, shape[::-1], interpolation=cv2.INTER_CUBIC) / 1.6**octave
    return total


def _bricks(shape: tuple[int, int], base: Array, generator: np.random.Generator) -> Array:
    drawn = base.copy()
    height, width = generator.integers(8, 50, 2)
    mortar = generator.uniform(-80, 80)
    for row, y in enumerate(range(0, shape[0], height)):
        drawn[y : y + 2] += mortar
        for x in range((row % 2) * width // 2, shape[1], width):
            drawn[y : y + height, x : x + 2] += mortar
            drawn[y : y + height, x : x + width] += generator.normal(0, 12)
    return drawn


def _boards(shape: tuple[int, int], generator: np.random.Generator) -> Array:
    square = generator.uniform(3, 40)
    angle = generator.uniform(0, math.pi)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    across = x * math.cos(angle) + y * math.sin(angle)
    along = -x * math.sin(angle) + y * math.cos(angle)
    odd = (np.floor(across / square) + np.floor(along / square)) % 2
    dark, light = sorted(generator.uniform(10, 240, 2))
    return np.asarray(dark + (light - dark) * odd)


def _boxes(base: Array, generator: np.random.Generator) -> Array:
    drawn = base.astype(np.float32)
    for _ in range(int(generator.integers(20, 150))):
        centre = generator.uniform(0, 1, 2) * drawn.shape[::-1]
        size = generator.uniform(6, 90, 2)
        box = cv2.boxPoints((centre.tolist(), size.tolist(), float(generator.uniform(0, 180))))
        cv2.fillConvexPoly(drawn, np.rint(box).astype(np.int32), float(generator.uniform(0, 255)))
    return drawn.astype(float)


def _letters(base: Array, generator: np.random.Generator) -> Array:
    drawn = np.clip(base, 0, 255).astype(np.uint8)
    alphabet = list('ABCDEFGHKLMNOPQRSTUVXYZ0123456789#%&@')
    for _ in range(int(generator.integers(20, 80))):
        text = ''.join(generator.choice(alphabet, int(generator.integers(2, 12))))
        x, y = (generator.uniform(0, 1, 2) * drawn.shape[::-1]).astype(int).tolist()
        scale = float(generator.uniform(0.3, 2.0))
        grey = float(generator.choice([15, 40, 235]))
        cv2.putText(drawn, text, (x, y), 0, scale, grey, max(1, int(2 * scale)), cv2.LINE_AA)
    return drawn.astype(float)


def _stripes(shape: tuple[int, int], generator: np.random.Generator) -> Array:
    period = generator.uniform(4, 60)
    angle = generator.uniform(0, math.pi)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    phase = (x * math.cos(angle) + y * math.sin(angle)) / period
    second = (-x * math.sin(angle) + y * math.cos(angle)) / generator.uniform(4, 60)
    wave = np.sign(np.sin(2 * math.pi * phase)) + np.sign(np.sin(2 * math.pi * second))
    return np.asarray(128 + 50 * wave)
