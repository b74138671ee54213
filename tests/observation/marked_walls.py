"""Pictures of walls with markers, and the markers in them as a detector would tell."""

from __future__ import annotations

import cv2
import numpy as np

from surveillance_perception.observation.marker_views import SeenMarker

SIDE = 24
"""Of a marker, pixels; 0.15 metres."""


def wall(seed: int = 1) -> np.ndarray:
    """Return a textured wall in colour."""
    coarse = np.random.default_rng(seed).integers(90, 200, (30, 40, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_CUBIC), np.uint8)


def hang(picture: np.ndarray, number: int, left: int, top: int) -> SeenMarker:
    """Draw a marker on its sheet, and return it as a detector would."""
    cells = np.random.default_rng(number).integers(0, 2, (4, 4)) * 255
    square = np.kron(np.pad(cells, 1), np.ones((SIDE // 6, SIDE // 6)))
    edge = SIDE // 6
    picture[top - edge : top + SIDE + edge, left - edge : left + SIDE + edge] = 255
    picture[top : top + SIDE, left : left + SIDE] = square[..., None]
    corners = [(left, top), (left + SIDE, top), (left + SIDE, top + SIDE), (left, top + SIDE)]
    return SeenMarker(number, np.asarray(corners, float), 0.15)
