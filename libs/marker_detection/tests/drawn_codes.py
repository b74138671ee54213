"""Images of codes with known corners, drawn under a homography by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np

from marker_detection.dictionaries import MarkerCodes, dictionary_named
from marker_detection.image_sampling import homographies_of

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
SEEN = 35.0 * SQUARE + (100.0, 75.0) + [(3.0, 2.0), (-4.0, 0.0), (0.0, -3.0), (2.0, 1.0)]
"""Corners of a marker that is seen a little from the side, in an image of 200x150 pixels."""
CELLS = MarkerCodes.of(dictionary_named('DICT_5X5_100'), [11]).cells[0] > 0


def drawn(quad, margin=1.0, wall=None, shape=(150, 200), white=200.0, black=40.0):
    """Return an image of a code, blurred a little.

    Args:
        quad: (4, 2) its corners in pixels.
        margin: How many cells wide, at most 2.
        wall: Grey level beyond; None: white as the margin.
        shape: Of the image.
        white: Grey level of margin and code.
        black: The same.
    """
    # four samples to a pixel, thirty to a cell; white goes on to the end of the margin
    cells = np.pad(CELLS[1:-1, 1:-1], 2, constant_values=True).repeat(30, 0).repeat(30, 1)
    sheet = (black + (white - black) * cells).astype(np.float32)
    matrix = homographies_of(quad[None])[0]
    to_pixel = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]])
    to_marker = np.array([[1 / 105, 0.0, -164.5 / 105], [0.0, 1 / 105, -164.5 / 105], [0, 0, 1]])
    size = (4 * shape[1], 4 * shape[0])
    image = np.full(size[::-1], white if wall is None else wall, np.float32)
    border = round((2.0 - margin) * 30.0)
    sheet = sheet[border : len(sheet) - border, border : len(sheet) - border]
    to_marker = to_marker @ np.array([[1, 0, border], [0, 1, border], [0, 0, 1.0]])
    cv2.warpPerspective(
        sheet, to_pixel @ matrix @ to_marker, size, image, borderMode=cv2.BORDER_TRANSPARENT
    )
    image = image.reshape(shape[0], 4, shape[1], 4).mean(axis=(1, 3))
    return np.rint(cv2.GaussianBlur(image, (0, 0), 0.7)).astype(np.uint8)
