"""A camera: the numbers that turn metres in front of the lens into pixels.

Frame: the optical frame of REP-103 (x right, y down, z forward). Pixel centres have integer
coordinates, as in OpenCV.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_COEFFICIENTS = {
    'plumb_bob': (0, 4, 5),
    'rational_polynomial': (8, 12, 14),
    'equidistant': (4,),
}

_OTHER_NAMES = {'fisheye': 'equidistant'}

DISTORTION_MODELS: tuple[str, ...] = (*_COEFFICIENTS, *_OTHER_NAMES)
"""The models of sensor_msgs/distortion_models.hpp that are understood, and OpenCV's own name."""

_SAME_SHAPE = 0.02
# of the larger side of the image: a lens that sees a hundredth of a degree
_LARGEST = 1e4
_CORRECTIONS = 40
_EXACT = 0.02
_WIDEST = 1e3
# angles from the axis up to which a lens is looked at, and how many of them
_ANGLES = np.linspace(0.0, math.atan(_WIDEST), 2000)


@dataclass(frozen=True)
class CameraModel:
    """Intrinsic parameters of a camera.

    Attributes:
        width: Image width in pixels.
        height: Image height in pixels.
        matrix: (3, 3) camera matrix K: [fx skew cx, 0 fy cy, 0 0 1].
        distortion: (n,) coefficients in the model's order; empty or zeros mean a rectified image.
            Zeros beyond the model's own are left out: bridges and drivers send as many for each.
        distortion_model: One of `DISTORTION_MODELS`; `fisheye` is kept as `equidistant`.

    Raises:
        ValueError: A number is not as a calibrated camera has it.
    """

    width: int
    height: int
    matrix: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))
    distortion_model: str = 'plumb_bob'

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f'an image of {self.width}x{self.height} pixels has no area')
        matrix = self.matrix
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all():
            raise ValueError('the camera matrix must be 3x3 finite numbers')
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            raise ValueError(
                f'focal lengths must be positive, got {matrix[0, 0]:g} and '
                f'{matrix[1, 1]:g}: the camera is not calibrated'
            )
        largest = _LARGEST * max(self.width, self.height)
        if np.abs(matrix).max() > largest:
            raise ValueError(f'the camera matrix must have no number above {largest:g}')
        if matrix[2].tolist() != [0.0, 0.0, 1.0] or matrix[1, 0]:
            raise ValueError(
                'the camera matrix must have the form [fx skew cx, 0 fy cy, 0 0 1], '
                f'got {" ".join(f"{value:g}" for value in matrix.ravel())}'
            )
        model = _OTHER_NAMES.get(self.distortion_model, self.distortion_model)
        object.__setattr__(self, 'distortion_model', model)
        allowed = _COEFFICIENTS.get(model)
        if allowed is None:
            raise ValueError(f'distortion model {self.distortion_model!r} is not known')
        if len(self.distortion) > max(allowed) and not self.distortion[max(allowed) :].any():
            object.__setattr__(self, 'distortion', self.distortion[: max(allowed)])
        if len(self.distortion) not in allowed:
            raise ValueError(
                f'{len(self.distortion)} distortion coefficients, expected '
                f'{" or ".join(str(each) for each in allowed)} for {self.distortion_model}'
            )
        if not np.isfinite(self.distortion).all():
            raise ValueError('distortion coefficients must be finite')

    @classmethod
    def from_field_of_view(cls, width: int, height: int, horizontal: float) -> CameraModel:
        """Return a distortion-free camera from its horizontal field of view.

        Args:
            width: Image width in pixels.
            height: Image height in pixels.
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

    def project(self, points: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in the optical frame, ignoring distortion."""
        homogeneous = points @ self.matrix.T
        return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])

    def scaled_to(self, width: int, height: int) -> CameraModel | None:
        """Return the same camera with images of another size; None where their shapes differ."""
        across, down = width / self.width, height / self.height
        if abs(across / down - 1.0) > _SAME_SHAPE:
            return None
        if across == down == 1.0:
            return self
        matrix = self.matrix.copy()
        matrix[0, 0] *= across
        matrix[1, 1] *= down
        # integer coordinates are pixels' middles
        matrix[0, 2] = (matrix[0, 2] + 0.5) * across - 0.5
        matrix[1, 2] = (matrix[1, 2] + 0.5) * down - 0.5
        return replace(self, width=width, height=height, matrix=matrix)

    def rays(self, pixels: Array) -> Array | None:
        """Return where the lines of sight (n, 2) of pixels (n, 2) meet the plane z = 1.

        Returns:
            None where the distortion cannot be taken back: coefficients that fit nothing there.
        """
        straight = np.linalg.inv(self.matrix)
        fisheye = self.distortion_model == 'equidistant'
        if not fisheye and not self.distortion.any():
            return np.asarray(pixels @ straight[:2, :2].T + straight[:2, 2])
        # OpenCV ignores a skew: its share is taken away before
        matrix, pixels = self.matrix.copy(), np.array(pixels, dtype=float)
        pixels[:, 0] -= matrix[0, 1] / matrix[1, 1] * (pixels[:, 1] - matrix[1, 2])
        matrix[0, 1] = 0.0
        scale = np.diag(matrix)[:2]
        points = pixels.reshape(-1, 1, 2)
        undistort = cv2.fisheye.undistortPoints if fisheye else cv2.undistortPoints
        project = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
        zero = np.zeros(3)
        try:
            rays = undistort(points, matrix, self.distortion).reshape(-1, 2).astype(float)
            for _ in range(_CORRECTIONS):
                if not np.isfinite(rays).all() or np.abs(rays).max(initial=0.0) > _WIDEST:
                    return None
                space = np.column_stack([rays, np.ones(len(rays))]).reshape(-1, 1, 3)
                again = project(space, zero, zero, matrix, self.distortion)[0]
                miss = pixels - again.reshape(-1, 2)
                if np.abs(miss).max(initial=0.0) < _EXACT:
                    angles = np.arctan(np.linalg.norm(rays, axis=1))
                    return np.asarray(rays) if (angles <= self._widest_angle).all() else None
                # OpenCV stops after a few steps, which is too early for strong distortion
                rays = rays + miss / scale
        except cv2.error:
            pass
        return None

    @cached_property
    def _widest_angle(self) -> float:
        """Angle from the axis, rad, up to which what lies further out is also seen further out.

        Beyond it the polynomial of the calibration turns back: a pixel there belongs to two rays,
        of which the fit knew one at most.
        """
        numbers = np.zeros(14)
        numbers[: len(self.distortion)] = self.distortion
        if self.distortion_model == 'equidistant':
            square = _ANGLES**2
            powers = np.stack([square, square**2, square**3, square**4])
            seen = _ANGLES * (1.0 + numbers[:4] @ powers)
        else:
            radius = np.tan(_ANGLES)
            powers = np.stack([radius**2, radius**4, radius**6])
            above = 1.0 + numbers[[0, 1, 4]] @ powers
            # a denominator that changes its sign is no lens beyond
            below = 1.0 + numbers[5:8] @ powers
            seen = np.where(np.minimum.accumulate(below) > 0.0, radius * above / below, -np.inf)
        falls = np.flatnonzero(~(seen[1:] > seen[:-1]))
        return float(_ANGLES[falls[0] if len(falls) else -1])
