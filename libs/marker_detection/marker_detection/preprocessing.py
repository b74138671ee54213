"""What an image needs before its markers are read: stretched when dark, smoothed when noisy."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection.image_sampling import Grey

# fewer pixels than the smallest marker has are not taken for the image's black and white
_FEW_PIXELS = 16
_FAINT_RANGE = 160
_STRETCHED = (25.0, 230.0)
_LARGEST_GAIN = 16.0
_QUIET = 2.8
_SMOOTHINGS = (0.5, 0.7, 0.9, 1.2)
_STRIPS = 10
_ROWS = 8
# the second difference of white noise in both directions has 6 times its deviation (Immerkaer,
# "Fast noise variance estimation", CVIU 64(2), 1996); 0.6745 turns a median into a deviation
_SECOND_DIFFERENCE = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
_MEDIAN_TO_DEVIATION = 1.0 / (6.0 * 0.6745)


@dataclass(frozen=True)
class PreparedImage:
    """An image as the detector works on it.

    Attributes:
        grey: (height, width) stretched grey levels.
        smooth: The same with its noise averaged out.
        noise: Standard deviation of the noise in `smooth`, grey levels.
    """

    grey: Grey
    smooth: Grey
    noise: float


def prepare(image: npt.NDArray[np.uint8]) -> PreparedImage:
    """Prepare an image of grey levels (height, width) or BGR (height, width, 3).

    Raises:
        ValueError: The image is empty, not of 8 bits, or of another shape.
    """
    grey = _stretched(grey_of(image))
    noise = left = _noise(grey)
    smooth = grey
    for deviation in _SMOOTHINGS:
        if left <= _QUIET:
            break
        kernel = cv2.getGaussianKernel(9, deviation)
        smooth = np.asarray(cv2.sepFilter2D(grey, -1, kernel, kernel), np.uint8)
        left = noise * float(np.square(kernel).sum())
    return PreparedImage(grey, smooth, left)


def _stretched(grey: Grey) -> Grey:
    """Return a faint image, dark or washed out, with nearly the full range of grey levels."""
    # what some rows already span, the whole image spans as well
    for rows in (grey[::_ROWS], grey):
        dark, bright = _extremes(rows)
        if bright - dark > _FAINT_RANGE:
            return grey
    gain = min((_STRETCHED[1] - _STRETCHED[0]) / max(bright - dark, 1), _LARGEST_GAIN)
    levels = _STRETCHED[0] + gain * (np.arange(256) - dark)
    return np.asarray(cv2.LUT(grey, np.clip(np.rint(levels), 0, 255).astype(np.uint8)))


def _extremes(grey: Grey) -> tuple[int, int]:
    """Return the grey levels that only a few pixels are darker or brighter than."""
    darker = np.cumsum(cv2.calcHist([grey], [0], None, [256], [0, 256]), dtype=float)
    dark, bright = np.searchsorted(darker, (_FEW_PIXELS, grey.size - _FEW_PIXELS)).tolist()
    return dark, bright


def grey_of(image: npt.NDArray[np.uint8]) -> Grey:
    """Return grey levels of a grey or BGR image.

    Raises:
        ValueError: The image is empty, not of 8 bits, or of another shape.
    """
    if image.dtype != np.uint8:
        raise ValueError(f'images must have 8 bits a channel, got {image.dtype}')
    if image.ndim == 3 and image.shape[2] == 3 and image.size:
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    if image.ndim != 2 or not image.size:
        shape = 'x'.join(str(side) for side in image.shape)
        raise ValueError(f'an image of shape {shape} is neither grey nor BGR')
    return np.ascontiguousarray(image)


def _noise(grey: Grey) -> float:
    """Deviation of the noise, from some columns of at most `_STRIPS` strips of 8 rows."""
    rows = grey.shape[0] - 8
    if rows < 0:
        return 0.0
    strips = [
        np.abs(cv2.filter2D(grey[start : start + 8], cv2.CV_16S, _SECOND_DIFFERENCE)[1:-1, ::3])
        for start in np.unique(np.linspace(0, rows, _STRIPS, dtype=int)).tolist()
    ]
    return float(np.median(np.stack(strips))) * _MEDIAN_TO_DEVIATION
