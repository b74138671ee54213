"""Where a board of markers is: OpenCV's grid and ChArUco boards, and Kalibr's AprilGrids.

A board is OpenCV's `cv2.aruco.Board`, which says where the corners of each id lie on it. All of its
markers that were found count together, so some may be hidden.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from marker_detection.camera_model import Array, CameraModel
from marker_detection.detector import Detection
from marker_detection.dictionaries import dictionary_named

_STRAIGHT = np.zeros(0)


@dataclass(frozen=True, eq=False)
class BoardPose:
    """Pose of a board in the camera's optical frame.

    Attributes:
        position: (3,) of the board's origin, metres.
        rotation: (3, 3) from the board's frame to the optical frame.
        reprojection_error: Root mean square over all corners, pixels.
        ids: The board's markers that were found.
    """

    position: Array
    rotation: Array
    reprojection_error: float
    ids: tuple[int, ...]


def aprilgrid(
    columns: int,
    rows: int,
    size: float,
    spacing: float,
    dictionary: str = 'DICT_APRILTAG_36h11',
) -> cv2.aruco.Board:
    """Return Kalibr's AprilGrid as a board; detect it with `DetectorSettings(..., border=2)`.

    Args:
        columns: Tags in a row (Kalibr's tagCols).
        rows: Rows of tags (tagRows).
        size: Side of a tag's black square, metres (tagSize).
        spacing: Gap between tags as a share of their size (tagSpacing).
        dictionary: What the tags are of.

    Returns:
        A board with the origin in the lower left corner of tag 0, x to the right, y up; ids run
        along the rows from the lowest one.
    """
    step = size * (1.0 + spacing)
    square = np.array([[0.0, size, 0.0], [size, size, 0.0], [size, 0.0, 0.0], [0.0, 0.0, 0.0]])
    corners = [
        (square + np.array([column * step, row * step, 0.0])).astype(np.float32)
        for row in range(rows)
        for column in range(columns)
    ]
    return cv2.aruco.Board(corners, dictionary_named(dictionary), np.arange(rows * columns))


def board_pose(
    detections: Iterable[Detection], board: cv2.aruco.Board, camera: CameraModel
) -> BoardPose | None:
    """Return the pose of a board; None when none of its markers is there or none fits.

    Args:
        detections: What a `MarkerDetector` found. An id that is there twice does not count.
        board: OpenCV's board: `GridBoard`, `CharucoBoard`, `Board`, or what `aprilgrid` returns.
        camera: The camera that took the image.
    """
    places = dict(zip(np.ravel(board.getIds()).tolist(), board.getObjPoints(), strict=True))
    seen: dict[int, list[Array]] = {}
    for each in detections:
        if each.marker_id in places:
            seen.setdefault(each.marker_id, []).append(each.corners)
    ids = tuple(sorted(marker_id for marker_id, outlines in seen.items() if len(outlines) == 1))
    if not ids:
        return None
    points = np.concatenate([np.reshape(places[each], (4, 3)) for each in ids]).astype(float)
    rays = camera.rays(np.concatenate([seen[each][0] for each in ids]))
    if rays is None:
        return None
    focal, middle = np.diag(camera.matrix)[:2], camera.matrix[:2, 2]
    matrix = np.array([[focal[0], 0, middle[0]], [0, focal[1], middle[1]], [0, 0, 1.0]])
    pixels = rays * focal + middle
    best: BoardPose | None = None
    try:
        # a board is flat, and has the two minima of one: `pose` says more
        _, *solved, _ = cv2.solvePnPGeneric(
            points, pixels.reshape(-1, 1, 2), matrix, _STRAIGHT, flags=cv2.SOLVEPNP_IPPE
        )
        for turn, place in zip(*solved, strict=True):
            turn, place = cv2.solvePnPRefineLM(
                points, pixels.reshape(-1, 1, 2), matrix, _STRAIGHT, turn.copy(), place.copy()
            )
            rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=float)
            position = np.asarray(place, dtype=float).ravel()
            ahead = points @ rotation.T + position
            if not np.isfinite(ahead).all() or (ahead[:, 2] <= 0).any():
                continue
            apart = ahead[:, :2] / ahead[:, 2:] * focal + middle - pixels
            error = float(np.sqrt(np.square(apart).sum(axis=1).mean()))
            if best is None or error < best.reprojection_error:
                best = BoardPose(position, rotation, error, ids)
    except cv2.error:
        return None
    return best
