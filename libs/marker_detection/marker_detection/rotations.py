"""Rotations as quaternions and as matrices, in numpy alone: scipy's take 0.2 s to import."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from marker_detection.camera_model import Array


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """Return a rotation as a quaternion x, y, z, w of length 1, with w >= 0.

    The largest of its parts is computed first, and the others by it, so that none is a quotient of
    small numbers: S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1978.

    Args:
        rotation: (3, 3), orthogonal, determinant 1.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    # rows of 4 q q^T, each of them the quaternion times four times one of its parts
    rows = (
        (1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz),
        (xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx),
        (xz + zx, yz + zy, 1.0 - xx - yy + zz, yx - xy),
        (zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz),
    )
    largest = max(range(4), key=lambda part: rows[part][part])
    row = np.array(rows[largest])
    # of a half turn w is zero: its axis points to where the first of x, y, z is positive
    leading = next(part for part in (row[3], *row[:3]) if part != 0.0)
    x, y, z, w = (np.copysign(1.0, leading) * row / np.linalg.norm(row)).tolist()
    return x, y, z, w


def rotation_of(quaternion: Sequence[float] | Array) -> Array:
    """Return the rotation of a quaternion x, y, z, w of any length but zero, shape (3, 3)."""
    parts = np.asarray(quaternion, float)
    x, y, z, w = parts / np.linalg.norm(parts / (largest := np.abs(parts).max())) / largest
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
