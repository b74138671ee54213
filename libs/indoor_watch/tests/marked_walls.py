"""Pictures of walls with markers, and the markers in them as a detector would tell.

The camera is at (0, 0, 1) on the map and looks along x; the wall is two metres ahead of it.
"""

from __future__ import annotations

import cv2
import numpy as np

from indoor_watch.hung_markers import CameraView, SeenMarker

SIDE = 24
"""Of a marker, pixels; 0.15 metres."""
FOCAL, AWAY = 320.0, 2.0
METRE = FOCAL / AWAY
"""On the wall, pixels."""
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_MATRIX = np.array([[FOCAL, 0.0, 159.5], [0.0, FOCAL, 119.5], [0.0, 0.0, 1.0]])


def wall(seed: int = 1) -> np.ndarray:
    """Return a textured wall in colour."""
    coarse = np.random.default_rng(seed).integers(90, 200, (30, 40, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_CUBIC), np.uint8)


def bare() -> np.ndarray:
    """Return a wall without any features."""
    noise = np.random.default_rng(5).normal(150.0, 1.5, (240, 320, 3))
    return np.asarray(np.clip(noise, 0, 255), np.uint8)


def camera_pose(
    x: float, y: float, yaw: float, height: float = 1.0, pitch: float = 0.0
) -> np.ndarray:
    """Return the pose (4, 4) of a camera that looks along the floor, or downwards by a pitch."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    cosine, sine = np.cos(pitch), np.sin(pitch)
    tilt = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    pose = np.eye(4)
    pose[:3, :3] = turn @ tilt @ _OPTICAL
    pose[:3, 3] = x, y, height
    return pose


def camera(
    y: float = 0.0, yaw: float = 0.0, deviation: float = 0.02, turn: float = 0.01
) -> CameraView:
    """Return a camera that stands somewhere along the wall, or says that it does."""
    return CameraView(camera_pose(0.0, y, yaw), _MATRIX, deviation, turn)


def seen_at(number: int, left: float, top: float) -> SeenMarker:
    """Return a marker as a detector tells it, from column and row of its first corner."""
    across, down = (left + (SIDE - 1) / 2 - 159.5), (top + (SIDE - 1) / 2 - 119.5)
    position = np.array([across / METRE, down / METRE, AWAY])
    return SeenMarker(number, 0.15, position, np.diag([1.0, -1.0, -1.0]), np.eye(3) * 1e-4)


def hang(picture: np.ndarray, number: int, left: int, top: int) -> SeenMarker:
    """Draw a marker on its sheet, and return it as a detector would."""
    cells = np.random.default_rng(number).integers(0, 2, (4, 4)) * 255
    square = np.kron(np.pad(cells, 1), np.ones((SIDE // 6, SIDE // 6)))
    edge = SIDE // 6
    picture[top - edge : top + SIDE + edge, left - edge : left + SIDE + edge] = 255
    picture[top : top + SIDE, left : left + SIDE] = square[..., None]
    return seen_at(number, left, top)


def aside(picture: np.ndarray, pixels: int) -> np.ndarray:
    """Return what a camera shows that stands so far to its left, in pixels of the wall."""
    shift = np.array([[1, 0, pixels], [0, 1, 0]], float)
    shown = cv2.warpAffine(picture, shift, (320, 240), borderMode=cv2.BORDER_REFLECT)
    return np.asarray(shown, np.uint8)
