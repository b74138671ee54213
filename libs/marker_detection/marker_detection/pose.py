"""Where a marker is in front of the camera, how sure that is, and whether it could be tilted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from marker_detection.camera_model import Array, CameraModel
from marker_detection.image_sampling import homographies_of

_OUTLINE = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
_CORNER_DEVIATION = 0.15
_SAME_POSE = 0.02
_FARTHEST = 1e6
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
        ambiguity: Error of this pose over that of its mirror image, 0 to 1: near 1 the marker may
            as well be tilted the other way.
    """

    position: Array
    rotation: Array
    reprojection_error: float
    covariance: Array
    ambiguity: float = 0.0

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation as x, y, z, w with w >= 0."""
        x, y, z, w = Rotation.from_matrix(self.rotation).as_quat(canonical=True).tolist()
        return x, y, z, w


def pose_of(corners: Array, size: float, camera: CameraModel) -> MarkerPose | None:
    """Pose of a marker from its corners.

    Args:
        corners: (4, 2) pixels, clockwise from the marker's own top left corner.
        size: Side of the black square, metres.
        camera: The camera that took the image.

    Returns:
        The pose that fits the corners best; None when none lies in front of the camera, or where
        the camera's distortion cannot be taken back.
    """
    outline = _OUTLINE * (size / 2.0)
    rays = camera.rays(np.asarray(corners, dtype=float))
    # a matrix that is no camera's spreads corners so far that their squares are no numbers
    if rays is None or not np.abs(rays).max() < _FARTHEST:
        return None
    # the corners as a camera without distortion would see them
    seen = rays @ camera.matrix[:2, :2].T + camera.matrix[:2, 2]
    rotation, position = _from_homography(homographies_of(rays[None])[0], size)
    if not np.isfinite(rotation).all() or not 0.0 < np.abs(position).max() < _FARTHEST:
        return None
    found = [
        pose
        for start in (rotation, _tilted_the_other_way(rotation, position))
        if (pose := _refined(outline, seen, camera, start, position)) is not None
    ]
    if not found:
        return None
    best, other = min(found, key=_error), max(found, key=_error)
    turned = float(np.linalg.norm(best.rotation - other.rotation))
    if best is other or turned < _SAME_POSE:
        return best
    ambiguity = min(1.0, max(best.reprojection_error, 1e-9) / max(other.reprojection_error, 1e-9))
    return replace(best, ambiguity=ambiguity)


def _error(pose: MarkerPose) -> float:
    return pose.reprojection_error


def _from_homography(homography: Array, size: float) -> tuple[Array, Array]:
    """Rotation and position (Zhang, "A flexible new technique for camera calibration", 2000).

    OpenCV's IPPE_SQUARE, made for this, fails on markers seen straight from the front.
    """
    across, down = homography[:, 0] * 2.0 / size, homography[:, 1] * 2.0 / size
    scale = 2.0 / (np.linalg.norm(across) + np.linalg.norm(down))
    if homography[2, 2] < 0:
        scale = -scale
    # marker coordinates have y down, the marker's frame has y up
    right, up = across * scale, -down * scale
    left, _, transposed = np.linalg.svd(np.column_stack([right, up, np.cross(right, up)]))
    return np.asarray(left @ transposed), np.asarray(homography[:, 2] * scale)


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
    outline: Array, seen: Array, camera: CameraModel, rotation: Array, position: Array
) -> MarkerPose | None:
    try:
        vector, moved = cv2.solvePnPRefineLM(
            outline,
            seen.reshape(4, 1, 2),
            camera.matrix,
            _STRAIGHT,
            cv2.Rodrigues(rotation)[0],
            position.reshape(3, 1).copy(),
        )
    except cv2.error:
        return None
    place = np.asarray(moved, np.float64).ravel()
    turned = np.asarray(cv2.Rodrigues(vector)[0], np.float64)
    # the paper's front faces the camera
    if not np.isfinite(place).all() or place[2] <= 0 or turned[:, 2] @ place > 0:
        return None
    arms = outline @ turned.T
    points = arms + place
    if (points[:, 2] <= 0).any():
        return None
    error = float(np.sqrt(np.square(camera.project(points) - seen).sum(axis=1).mean()))
    return MarkerPose(place, turned, error, _covariance(arms, points, camera, error))


def _covariance(arms: Array, points: Array, camera: CameraModel, error: float) -> Array:
    """Covariance (6, 6) of position and rotation: the inverse of the Gauss-Newton normal matrix.

    Eight coordinates determine six numbers, so the residual of one marker tells little of its
    corners' deviation: it counts where it is larger than what the detector's corners have.
    """
    focal = np.diag(camera.matrix)[:2]
    x, y, z = points.T
    by_point = np.zeros((4, 2, 3))
    by_point[:, 0, 0], by_point[:, 1, 1] = focal[0] / z, focal[1] / z
    by_point[:, 0, 2], by_point[:, 1, 2] = -focal[0] * x / z**2, -focal[1] * y / z**2
    # a small rotation w moves a point by w x arm
    by_turn = -np.cross(arms[:, None, :], np.eye(3)[None]).transpose(0, 2, 1)
    jacobian = np.concatenate([by_point, by_point @ by_turn], axis=2).reshape(8, 6)
    deviation = max(_CORNER_DEVIATION, error * np.sqrt(4.0 / 2.0))
    return np.asarray(np.linalg.pinv(jacobian.T @ jacobian, hermitian=True) * deviation**2)
