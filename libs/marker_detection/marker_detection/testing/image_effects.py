"""What light and motion do to an image: a shadow's edge, dark corners, a reflection, a streak.

Shared by the simulated camera and by the renderer that detectors are measured with. Lights are
arrays (rows, columns): shadow and vignette are factors on the brightness, a reflection adds to it.
A streak is a kernel to filter the image with.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Light = npt.NDArray[np.float32]

_HARDEST = 0.3


def shadow(
    shape: tuple[int, int],
    through: tuple[float, float],
    direction: float,
    brightness: float,
    softness: float,
) -> Light:
    """Return 1 on one side of a straight edge and less on the other.

    Args:
        shape: Rows and columns of the image.
        through: Pixel (x, y) that the edge runs through.
        direction: Angle of the normal that points to the dark side, rad.
        brightness: Factor on the dark side.
        softness: Standard deviation of the edge's width, pixels.
    """
    from scipy.special import ndtr  # takes 0.1 s, which a simulator in even light does without

    x, y = _pixels(shape)
    depth = (x - through[0]) * math.cos(direction) + (y - through[1]) * math.sin(direction)
    dark = ndtr(depth / max(softness, _HARDEST))
    return np.asarray(1.0 - (1.0 - brightness) * dark, dtype=np.float32)


def vignette(shape: tuple[int, int], share: float) -> Light:
    """Return 1 in the middle and less towards the corners, which lack a share of the light."""
    x, y = _pixels(shape)
    rows, columns = shape
    radius = np.hypot(x - columns / 2, y - rows / 2) / math.hypot(columns / 2, rows / 2)
    return np.asarray(1.0 - share * radius**2, dtype=np.float32)


def glare(
    shape: tuple[int, int], middle: tuple[float, float], deviation: float, strength: float
) -> Light:
    """Return the grey levels that a round reflection adds around a pixel (x, y)."""
    x, y = _pixels(shape)
    square = (x - middle[0]) ** 2 + (y - middle[1]) ** 2
    return np.asarray(strength * np.exp(-square / (2.0 * deviation**2)), dtype=np.float32)


def streak(length: float, direction: float) -> Light:
    """Return the kernel that averages along a line.

    Args:
        length: Length of the line, pixels.
        direction: Its angle, rad, from x towards y.
    """
    half = math.ceil(length / 2)
    pixels = np.arange(-half, half + 1)[:, None]
    along = np.linspace(-length / 2, length / 2, 16 * half + 1)
    # each point of the line counts for the four pixels around it, by its distance from them
    rows = np.maximum(1.0 - np.abs(pixels - along * math.sin(direction)), 0.0)
    columns = np.maximum(1.0 - np.abs(pixels - along * math.cos(direction)), 0.0)
    kernel = rows @ columns.T
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def _pixels(shape: tuple[int, int]) -> tuple[Light, Light]:
    """Return columns (1, n) and rows (m, 1) of an image's pixels."""
    rows, columns = shape
    return np.arange(columns, dtype=np.float32)[None], np.arange(rows, dtype=np.float32)[:, None]
