"""Where a marker is in front of the camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from surveillance_perception.camera_model import Array, CameraModel

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
        camera: The camera that took the picture.

    Returns:
        The pose that fits the corners best; None when none lies in front of the camera.
    """
    count, rotations, positions, _ = cv2.solvePnPGeneric(
        _OUTLINE * (size / 2.0),
        corners.reshape(4, 1, 2).astype(float),
        camera.matrix,
        camera.distortion,
        flags=cv2.SOLVEPNP_IPPE_SQUARE,
    )
    found: list[MarkerPose] = []
    for rotation, position in zip(rotations[:count], positions[:count], strict=True):
        if not np.isfinite(position).all() or position[2] <= 0:
            continue
        projected, _ = cv2.projectPoints(
            _OUTLINE * (size / 2.0), rotation, position, camera.matrix, camera.distortion
        )
        offsets = projected.reshape(4, 2) - corners
        error = float(np.sqrt(np.square(offsets).sum(axis=1).mean()))
        found.append(MarkerPose(position.ravel(), cv2.Rodrigues(rotation)[0], error))
    return min(found, key=lambda pose: pose.reprojection_error, default=None)


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
