"""Local contrast: patches of an image as if the light on them were even.

A shadow's edge or a bright window changes black and white by more than a marker's print does. What
stays is their ratio, and that near a black cell there is a white one: so each sample's logarithm is
compared with the darkest and the brightest ones around it. Where all around is of one colour, the
neighbourhoods with contrast say what black and white are there (normalised convolution: Knutsson
and Westin, "Normalized and differential convolution", CVPR 1993). A reflection adds light instead;
there the grey levels themselves are compared.
"""

from __future__ import annotations

import cv2
import numpy as np

from surveillance_perception.detection.image_sampling import Patches

_LEAST_SHARE = 0.08
_DARK_LEVEL = 12.0
_SPREAD = 2.0 / 3.0
_CLIP = 1.5


def evenly_lit(patches: Patches, count: int, cell: int, *, ratios: bool = True) -> Patches:
    """Patches (m, n) with local black near -1 and local white near +1.

    Args:
        patches: (m, n) grey levels, n = count * count.
        count: Samples along a side.
        cell: Samples along a side of a marker's cell.
        ratios: Whether light multiplies, as a shadow does, or adds, as a reflection does.
    """
    total = len(patches)
    if not total:
        return patches
    if ratios:
        patches = np.log(patches + np.float32(_DARK_LEVEL))
    reach, deviation = cell, cell * _SPREAD
    # all patches in one tall image, far enough apart that no filter sees two of them
    gap = 2 * reach + 1
    square = patches.reshape(total, count, count)
    padded = np.pad(square, ((0, 0), (gap, gap), (gap, gap)), mode='edge')
    side = count + 2 * gap
    tall = np.ascontiguousarray(padded.reshape(total * side, side), dtype=np.float32)
    window = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    low, high = cv2.erode(tall, window), cv2.dilate(tall, window)
    contrast = high - low
    largest = contrast.reshape(total, -1).max(axis=1).repeat(side)[:, None]
    weight = np.square(contrast / np.maximum(largest, 1e-3)) + 1e-4
    spread = (0, 0), deviation
    share = cv2.GaussianBlur(weight, *spread)
    middle = cv2.GaussianBlur(weight * (high + low) / 2.0, *spread) / share
    half = cv2.GaussianBlur(weight * contrast / 2.0, *spread) / share
    half = np.maximum(half, _LEAST_SHARE * largest + 1e-3)
    flat = np.clip((tall - middle) / half, -_CLIP, _CLIP)
    inside = flat.reshape(total, side, side)[:, gap : gap + count, gap : gap + count]
    return np.asarray(inside.reshape(total, -1), dtype=np.float32)
