"""Where a marker is in front of the camera, how sure that is, and whether it could be tilted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from marker_detection.camera_model import Array, CameraModel
from marker_detection.image_sampling import homographies_of
from marker_detection.rotations import quaternion_of

# in the order that OpenCV's IPPE_SQUARE asks for: clockwise from the top left, y up
_OUTLINE = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
_CORNER_DEVIATION = 0.15
# the same over both coordinates: what noise makes of either pose's error
_NOISE_ERROR = _CORNER_DEVIATION * math.sqrt(2.0)
_SAME_POSE = 0.02
# share of the side by which a start may miss the corners and still lead to its own minimum
_NEAR_START = 0.1
_FARTHEST = 1e6
# root mean square over the corners that is no measurement of a flat square any more: pixels, or
# the share of a side, for a large marker behind a lens that the model only nearly describes
_LARGEST_ERROR, _LARGEST_SHARE = 1.0, 0.005
_STRAIGHT = np.zeros(0)


@dataclass(frozen=True, eq=False)
class MarkerPose:
    """Pose of a marker in the camera's optical frame.

    The marker's frame has its origin in the middle, x to its right, y up and z out of the paper.

    Attributes:
        position: (3,) metres.
        rotation: (3, 3) from the marker's frame to the optical frame.
        reprojection_error: Root mean square over the corners, pixels.
        covariance: (6, 6) of position (m) and of small rotations about the optical frame's axes
            (rad), from the corners' deviation.
        ambiguity: Error of this pose over that of `other`, 0 to 1, both with the noise of corners:
            from 0.6 on the marker may as well be tilted the other way.
        other: The second pose that explains the corners, the marker tilted the other way; None
            where there is only one.
    """

    position: Array
    rotation: Array
    reprojection_error: float
    covariance: Array
    ambiguity: float = 0.0
    other: MarkerPose | None = None

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation as x, y, z, w with w >= 0."""
        return quaternion_of(self.rotation)


def pose_of(corners: Array, size: float, camera: CameraModel) -> MarkerPose | None:
    """Pose of a marker from its corners.

    Args:
        corners: (4, 2) pixels, clockwise from the marker's own top left corner.
        size: Side of the black square, metres.
        camera: The camera that took the image.

    Returns:
        The pose that fits the corners best; None when none lies in front of the camera or fits to
        a pixel, or where the camera's distortion cannot be taken back.
    """
    outline = _OUTLINE * (size / 2.0)
    rays = camera.rays(np.asarray(corners, dtype=float))
    # a matrix that is no camera's spreads corners so far that their squares are no numbers
    if rays is None or not np.abs(rays).max() < _FARTHEST:
        return None
    # the corners as a camera without distortion and skew would see them: OpenCV knows no skew
    matrix = camera.matrix.copy()
    matrix[0, 1] = 0.0
    seen = rays @ matrix[:2, :2].T + matrix[:2, 2]
    side = float(np.linalg.norm(np.roll(seen, -1, axis=0) - seen, axis=1).max())
    largest = max(_LARGEST_ERROR, _LARGEST_SHARE * side)
    found: list[_Fit] = []
    for starts in (_ippe, _zhang):
        begun = starts(outline, rays, size)
        for rotation, position in begun:
            fit = _refined(outline, seen, matrix, rotation, position)
            if fit is not None:
                found.append(fit)
        found.sort(key=lambda fit: fit.error)
        if len(begun) > 1 and found and found[0].error <= largest:
            break
    if not found or found[0].error > largest:
        return None
    best, *others = found
    pose = _pose(best, outline, matrix)
    for fit in others:
        if np.linalg.norm(best.rotation - fit.rotation) >= _SAME_POSE:
            ambiguity = math.hypot(best.error, _NOISE_ERROR) / math.hypot(fit.error, _NOISE_ERROR)
            ambiguity = min(1.0, ambiguity)
            return replace(pose, ambiguity=ambiguity, other=_pose(fit, outline, matrix))
    return pose


class _Fit(NamedTuple):
    """Where the corners were projected best from a start."""

    rotation: Array
    position: Array
    error: float


def _pose(fit: _Fit, outline: Array, matrix: Array) -> MarkerPose:
    covariance = _covariance(outline @ fit.rotation.T, fit.position, matrix, fit.error)
    return MarkerPose(fit.position, fit.rotation, fit.error, covariance)


def _ippe(outline: Array, rays: Array, _size: float) -> list[tuple[Array, Array]]:
    """Return rotations and positions from which the corners are fitted: both solutions of IPPE.

    A small square is seen nearly the same when it is tilted the other way, so the error has two
    minima, and the solutions lie in them (Collins and Bartoli, "Infinitesimal plane-based pose
    estimation", IJCV 109(3), 2014): of 6,000 markers at 2 to 8 m none is more than 10 % off.

    Left out are rotations that OpenCV lost on the way: it divides by the sine of the angle, which
    is pi for a marker that hangs upright before a level camera, and returns any vector then.
    """
    try:
        _, vectors, positions, _ = cv2.solvePnPGeneric(
            outline, rays.reshape(4, 1, 2), np.eye(3), _STRAIGHT, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
    except cv2.error:
        return []
    side = np.linalg.norm(np.roll(rays, -1, axis=0) - rays, axis=1).max()
    starts = []
    for vector, moved in zip(vectors, positions, strict=True):
        rotation = np.asarray(cv2.Rodrigues(vector)[0], dtype=float)
        position = np.asarray(moved, dtype=float).ravel()
        points = outline @ rotation.T + position
        if np.isfinite(points).all() and (points[:, 2] > 0).all():
            apart = np.linalg.norm(points[:, :2] / points[:, 2:] - rays, axis=1)
            if apart.max() <= _NEAR_START * side:
                starts.append((rotation, position))
    return starts


def _zhang(_outline: Array, rays: Array, size: float) -> list[tuple[Array, Array]]:
    """Return starts from what the homography contains, and tilted the other way.

    For rotations by pi, of which OpenCV's IPPE makes none or a wrong one up to version 5.0. The
    decomposition is Zhang's ("A flexible new technique for camera calibration", 2000); from it
    alone 26 of the 6,000 markers were more than 10 % off.
    """
    homography = homographies_of(rays[None])[0]
    across, down = homography[:, 0] * 2.0 / size, homography[:, 1] * 2.0 / size
    scale = 2.0 / (np.linalg.norm(across) + np.linalg.norm(down))
    if homography[2, 2] < 0:
        scale = -scale
    # marker coordinates have y down, the marker's frame has y up
    right, up = across * scale, -down * scale
    left, _, transposed = np.linalg.svd(np.column_stack([right, up, np.cross(right, up)]))
    rotation, position = np.asarray(left @ transposed), np.asarray(homography[:, 2] * scale)
    if not np.isfinite(rotation).all() or not 0.0 < np.abs(position).max() < _FARTHEST:
        return []
    return [(rotation, position), (_tilted_the_other_way(rotation, position), position)]


def _tilted_the_other_way(rotation: Array, position: Array) -> Array:
    """Return the rotation with which a small flat thing looks nearly the same: mirrored at the
    sight.
    """
    sight = position / np.linalg.norm(position)
    normal = rotation[:, 2]
    mirrored = 2.0 * (normal @ sight) * sight - normal
    axis = np.cross(normal, mirrored)
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, normal @ mirrored))
    return np.asarray(cv2.Rodrigues(axis / max(sine, 1e-9) * angle)[0] @ rotation)


def _refined(
    outline: Array, seen: Array, matrix: Array, rotation: Array, position: Array
) -> _Fit | None:
    """Return the nearest minimum of the reprojection error; None where it is no visible marker."""
    try:
        vector, moved = cv2.solvePnPRefineLM(
            outline,
            seen.reshape(4, 1, 2),
            matrix,
            _STRAIGHT,
            cv2.Rodrigues(rotation)[0],
            position.reshape(3, 1).copy(),
        )
    except cv2.error:
        return None
    place, turned = (
        np.asarray(moved, dtype=float).ravel(),
        np.asarray(cv2.Rodrigues(vector)[0], dtype=float),
    )
    # the paper's front faces the camera
    if not np.isfinite(place).all() or place[2] <= 0 or turned[:, 2] @ place > 0:
        return None
    points = outline @ turned.T + place
    if (points[:, 2] <= 0).any():
        return None
    pixels = points @ matrix.T
    apart = pixels[:, :2] / pixels[:, 2:] - seen
    return _Fit(turned, place, float(np.sqrt(np.square(apart).sum(axis=1).mean())))


def _covariance(arms: Array, position: Array, matrix: Array, error: float) -> Array:
    """Covariance (6, 6) of position and rotation: the inverse of the Gauss-Newton normal matrix.

    Eight coordinates determine six numbers, so the residual of one marker tells little of its
    corners' deviation: it counts where it is larger than what the detector's corners have.
    """
    focal = np.diag(matrix)[:2]
    x, y, z = (arms + position).T
    by_point = np.zeros((4, 2, 3))
    by_point[:, 0, 0], by_point[:, 1, 1] = focal[0] / z, focal[1] / z
    by_point[:, 0, 2], by_point[:, 1, 2] = -focal[0] * x / z**2, -focal[1] * y / z**2
    # a small rotation w moves a point by w x arm
    by_turn = -np.cross(arms[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    jacobian = np.concatenate([by_point, by_point @ by_turn], axis=2).reshape(8, 6)
    deviation = max(_CORNER_DEVIATION, error * np.sqrt(4.0 / 2.0))
    return np.asarray(np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * deviation**2)
