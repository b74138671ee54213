"""Where a marker is in front of the camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from surveillance_perception.detection.camera_model import Array, CameraModel
from surveillance_perception.detection.image_sampling import homographies_of

_OUTLINE = np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class MarkerPose:
    """Pose of a marker in the camera's optical frame.

    The marker's frame has its origin in the middle, x to its right, y up and z out of the paper.

    Attributes:
        position: (3,) metres.
        rotation: (3, 3) from the marker's frame to the optical frame.
        reprojection_error: Root mean square over the corners, pixels.
    """

    position: Array
    rotation: Array
    reprojection_error: float

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
        The pose that fits the corners best; None when none lies in front of the camera.
    """
    outline = _OUTLINE * (size / 2.0)
    seen = corners.reshape(4, 1, 2).astype(float)
    rays = cv2.undistortPoints(seen, camera.matrix, camera.distortion).reshape(4, 2)
    rotation, position = _from_homography(homographies_of(rays[None])[0], size)
    found = [
        pose
        for start in (rotation, _tilted_the_other_way(rotation, position))
        if (pose := _refined(outline, seen, camera, start, position)) is not None
    ]
    return min(found, key=lambda pose: pose.reprojection_error, default=None)


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
    """The rotation with which a small flat thing looks nearly the same: mirrored at the sight."""
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
    if not np.isfinite(rotation).all() or not np.isfinite(position).all():
        return None
    vector, position = cv2.solvePnPRefineLM(
        outline,
        seen,
        camera.matrix,
        camera.distortion,
        cv2.Rodrigues(rotation)[0],
        position.reshape(3, 1).copy(),
    )
    turned = cv2.Rodrigues(vector)[0]
    # the paper's front faces the camera
    if not np.isfinite(position).all() or position[2] <= 0 or turned[:, 2] @ position.ravel() > 0:
        return None
    projected, _ = cv2.projectPoints(outline, vector, position, camera.matrix, camera.distortion)
    error = float(np.sqrt(np.square(projected - seen).sum(axis=2).mean()))
    return MarkerPose(position.ravel(), turned, error)


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """Unit quaternion x, y, z, w with w >= 0 of a rotation matrix (3, 3).

    From the largest of the four squared components, which keeps clear of small divisors
    (Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978).
    """
    trace = float(np.trace(rotation))
    squares = np.array([*(2.0 * np.diag(rotation) - trace), trace])
    largest = int(np.argmax(squares))
    matrix = np.empty((4, 4))
    matrix[:3, :3] = rotation + rotation.T
    matrix[np.arange(3), np.arange(3)] = 1.0 + 2.0 * np.diag(rotation) - trace
    matrix[3, :3] = matrix[:3, 3] = [
        rotation[2, 1] - rotation[1, 2],
        rotation[0, 2] - rotation[2, 0],
        rotation[1, 0] - rotation[0, 1],
    ]
    matrix[3, 3] = 1.0 + trace
    row = matrix[largest]
    row = row / np.linalg.norm(row)
    x, y, z, w = (row if row[3] >= 0 else -row).tolist()
    return x, y, z, w
