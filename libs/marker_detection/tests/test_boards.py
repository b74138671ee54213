"""Boards in OpenCV's format, and Kalibr's AprilGrids, drawn by OpenCV."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from marker_detection import (
    CameraModel,
    Detection,
    DetectorSettings,
    MarkerDetector,
    aprilgrid,
    board_pose,
    dictionary_named,
)

CAMERA = CameraModel.from_field_of_view(640, 480, math.radians(60))
FAMILY = dictionary_named('DICT_APRILTAG_36h11')
TAG = 100


def kalibrs_grid(columns: int, rows: int) -> np.ndarray:
    """Return an AprilGrid with a spacing of 0.3: tags with two black cells, squares between."""
    gap, step = 30, 130
    height, width = rows * step + gap, columns * step + gap
    sheet = np.full((height, width), 255, np.uint8)
    for row in range(rows + 1):
        for column in range(columns + 1):
            low = height - row * step
            sheet[low - gap : low, column * step : column * step + gap] = 0
    for marker_id in range(rows * columns):
        row, column = divmod(marker_id, columns)
        top, left = height - gap - row * step - TAG, column * step + gap
        drawn = cv2.aruco.generateImageMarker(FAMILY, marker_id, TAG, borderBits=2)
        sheet[top : top + TAG, left : left + TAG] = drawn
    return sheet


TURN = cv2.Rodrigues(np.array([0.3, -0.25, 0.1]))[0]
"""Of the sheet, y down, in front of the camera."""


def seen(sheet: np.ndarray, width: float, distance: float) -> np.ndarray:
    """Return an image of a sheet so many metres wide, its middle on the camera's axis."""
    metres = width / sheet.shape[1]
    middle = np.array([sheet.shape[1] / 2 - 0.5, sheet.shape[0] / 2 - 0.5])
    onto_sheet = np.array([[metres, 0, -metres * middle[0]], [0, metres, -metres * middle[1]]])
    plane = np.column_stack([TURN[:, :2], [0.0, 0.0, distance]])
    matrix = CAMERA.matrix @ plane @ np.vstack([onto_sheet, [0, 0, 1.0]])
    image = cv2.warpPerspective(sheet, matrix, (640, 480), flags=cv2.INTER_AREA, borderValue=150)
    noise = np.random.default_rng(1).normal(0.0, 2.0, image.shape)
    blurred = cv2.GaussianBlur(image, (0, 0), 0.7).astype(float)
    return np.clip(0.85 * blurred + 15.0 + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize('distance', [1.2, 3.0])
def test_all_tags_of_kalibrs_grid_are_found_although_they_touch(distance: float) -> None:
    image = seen(kalibrs_grid(6, 4), 0.81, distance)
    detector = MarkerDetector(DetectorSettings('DICT_APRILTAG_36h11', border=2))
    found = detector.detect(image)
    assert sorted(each.marker_id for each in found) == list(range(24))
    pose = board_pose(found, aprilgrid(6, 4, 0.1, 0.3), CAMERA)
    assert pose is not None
    assert len(pose.ids) == 24
    assert pose.reprojection_error < 0.5
    # the grid's y is up, the sheet's down; the origin is a gap away from its lower left corner
    assert pose.rotation == pytest.approx(TURN @ np.diag([1, -1, -1]), abs=0.03)
    corner = TURN @ (-0.405 + 0.03, 0.275 - 0.03, 0.0) + (0.0, 0.0, distance)
    assert pose.position == pytest.approx(corner, abs=0.01 * distance)


@pytest.mark.parametrize('kind', ['grid', 'charuco'])
def test_pose_of_opencvs_boards_is_where_the_sheet_is(kind: str) -> None:
    dictionary = dictionary_named('DICT_5X5_100')
    board: cv2.aruco.Board
    if kind == 'grid':
        board, width, height = cv2.aruco.GridBoard((4, 3), 0.04, 0.01, dictionary), 0.19, 0.14
    else:
        board, width, height = cv2.aruco.CharucoBoard((5, 4), 0.05, 0.035, dictionary), 0.25, 0.2
    scale = 3000
    edge = 60
    size = (round(width * scale) + 2 * edge, round(height * scale) + 2 * edge)
    image = seen(board.generateImage(size, marginSize=edge), size[0] / scale, 0.5)
    found = MarkerDetector(DetectorSettings('DICT_5X5_100')).detect(image)
    assert len(found) == len(board.getIds())
    pose = board_pose(found, board, CAMERA)
    assert pose is not None
    corner = TURN @ (-width / 2, -height / 2, 0.0) + (0.0, 0.0, 0.5)
    assert pose.position == pytest.approx(corner, abs=5e-3)
    assert pose.rotation == pytest.approx(TURN, abs=0.03)


def test_board_of_which_nothing_is_seen_has_no_pose() -> None:
    assert board_pose([], aprilgrid(6, 6, 0.088, 0.3), CAMERA) is None


def tags(board: cv2.aruco.Board, ids: list[int], noise: float = 0.0) -> list[Detection]:
    """Return detections of a board's markers in front of the camera, turned by `TURN`."""
    places = dict(zip(np.ravel(board.getIds()).tolist(), board.getObjPoints(), strict=True))
    generator = np.random.default_rng(7)
    found = []
    for each in ids:
        corners = CAMERA.project(np.reshape(places[each], (4, 3)) @ TURN.T + (-0.1, 0.05, 1.5))
        found.append(Detection(each, corners + generator.normal(0.0, noise, (4, 2)), 0.9, True))
    return found


def test_an_aprilgrid_is_where_kalibr_says() -> None:
    board = aprilgrid(3, 2, 0.1, 0.25)
    assert np.ravel(board.getIds()).tolist() == list(range(6))
    places = np.array(board.getObjPoints()).reshape(6, 4, 3)
    low_left = [(0.125 * column, 0.125 * row, 0.0) for row in range(2) for column in range(3)]
    assert places[:, 3] == pytest.approx(np.array(low_left))
    square = np.array([[0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert places - places[:, 3:] == pytest.approx(np.broadcast_to(square, (6, 4, 3)), abs=1e-6)


def test_a_board_counts_the_ids_that_are_its_own_and_there_once() -> None:
    board = aprilgrid(3, 2, 0.1, 0.25)
    other = tags(aprilgrid(3, 3, 0.1, 0.25), [8])
    twice = tags(board, [2], 30.0)
    pose = board_pose([*tags(board, [5, 2, 0, 1]), *twice, *other], board, CAMERA)
    assert pose is not None
    assert pose.ids == (0, 1, 5)
    assert pose.position == pytest.approx([-0.1, 0.05, 1.5], abs=1e-4)
    assert pose.rotation == pytest.approx(TURN, abs=1e-4)
    assert pose.reprojection_error < 1e-2
    rough = board_pose(tags(board, [0, 1, 2, 3, 4, 5], 0.5), board, CAMERA)
    assert rough is not None
    # of 48 numbers six are the pose
    assert rough.reprojection_error == pytest.approx(0.5 * np.sqrt(2 * 42 / 48), rel=0.25)
    assert board_pose(other, board, CAMERA) is None
    assert board_pose([*twice, *tags(board, [2])], board, CAMERA) is None


def test_a_board_is_measured_through_a_lens_or_not_at_all() -> None:
    board = aprilgrid(3, 2, 0.1, 0.25)
    skewed = CAMERA.matrix.copy()
    skewed[0, 1] = 5.0
    lens = CameraModel(640, 480, skewed, np.array([-0.2, 0.05, 0.0, 0.0, 0.0]))
    found = []
    for each in tags(board, [0, 2, 5]):
        ideal = (each.corners - CAMERA.matrix[:2, 2]) / np.diag(CAMERA.matrix)[:2]
        square = (ideal**2).sum(axis=1, keepdims=True)
        bent = ideal * (1.0 - 0.2 * square + 0.05 * square**2)
        corners = bent @ skewed[:2, :2].T + skewed[:2, 2]
        found.append(Detection(each.marker_id, corners, 0.9, True))
    pose = board_pose(found, board, lens)
    assert pose is not None
    assert pose.position == pytest.approx([-0.1, 0.05, 1.5], abs=2e-3)
    hopeless = CameraModel(640, 480, skewed, np.array([-90.0, 5.0, 0.0, 0.0, 0.0]))
    assert board_pose(found, board, hopeless) is None
