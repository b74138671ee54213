"""A pinhole camera: the numbers that turn metres in front of the lens into pixels.

Frame: the optical frame of REP-103 (x right, y down, z forward). Pixel centres have integer
coordinates, as in OpenCV.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CameraModel:
    """Intrinsic parameters of a camera.

    Attributes:
        width: ImageArray width in pixels.
        height: ImageArray height in pixels.
        matrix: (3, 3) camera matrix K.
        distortion: (n,) coefficients in OpenCV's order; empty or zeros mean a rectified image.
    """

    width: int
    height: int
    matrix: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f'an image of {self.width}x{self.height} pixels has no area')
        if self.matrix.shape != (3, 3) or not np.isfinite(self.matrix).all():
            raise ValueError('the camera matrix must be 3x3 finite numbers')
        if self.matrix[0, 0] <= 0 or self.matrix[1, 1] <= 0:
            raise ValueError(
                f'focal lengths must be positive, got {self.matrix[0, 0]:g} and '
                f'{self.matrix[1, 1]:g}: the camera is not calibrated'
            )

    @classmethod
    def from_field_of_view(cls, width: int, height: int, horizontal: float) -> CameraModel:
        """A distortion-free camera from its horizontal field of view.

        Args:
            width: ImageArray width in pixels.
            height: ImageArray height in pixels.
            horizontal: Horizontal field of view in radians, between 0 and pi.

        Raises:
            ValueError: The field of view is not between 0 and pi.
        """
        if not 0.0 < horizontal < math.pi:
            raise ValueError(f'field of view must lie between 0 and pi rad, got {horizontal:g}')
        focal = width / 2.0 / math.tan(horizontal / 2.0)
        matrix = np.array(
            [[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]]
        )
        return cls(width, height, matrix)

    @property
    def horizontal_field_of_view(self) -> float:
        """Horizontal field of view in radians."""
        return 2.0 * math.atan(self.width / 2.0 / float(self.matrix[0, 0]))

    @property
    def vertical_field_of_view(self) -> float:
        """Vertical field of view in radians."""
        return 2.0 * math.atan(self.height / 2.0 / float(self.matrix[1, 1]))

    def project(self, points: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in the optical frame, ignoring distortion."""
        homogeneous = points @ self.matrix.T
        return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def camera_of(
    width: int, height: int, described: CameraModel | None, horizontal: float
) -> CameraModel:
    """The camera that took an image.

    Args:
        width: The image's width in pixels.
        height: Its height in pixels.
        described: The camera as it describes itself, of use for images of its size alone.
        horizontal: Horizontal field of view in radians of a camera that does not.
    """
    if described is not None and (described.width, described.height) == (width, height):
        return described
    return CameraModel.from_field_of_view(width, height, horizontal)
