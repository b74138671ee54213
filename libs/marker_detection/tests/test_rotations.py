"""Rotations, compared with scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from marker_detection.rotations import quaternion_of, rotation_of

RANDOM = Rotation.random(500, random_state=7)
HALF_TURNS = Rotation.from_rotvec(np.pi * np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.0, -0.8]]]))
NEAR_HALF_TURNS = Rotation.from_rotvec((np.pi - 1e-7) * np.vstack([np.eye(3), -np.eye(3)]))
SMALL = Rotation.from_rotvec(1e-9 * np.eye(3))


@pytest.mark.parametrize('rotations', [RANDOM, HALF_TURNS, NEAR_HALF_TURNS, SMALL])
def test_quaternions_and_matrices_are_those_of_scipy(rotations: Rotation) -> None:
    for rotation in rotations:
        matrix = rotation.as_matrix()
        quaternion = quaternion_of(matrix)
        assert quaternion[3] >= 0.0
        assert np.allclose(
            quaternion, Rotation.from_matrix(matrix).as_quat(canonical=True), atol=1e-12
        )
        assert np.allclose(rotation_of(quaternion), matrix, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize('length', [1e-200, 0.1, 3.0, 1e200])
def test_a_quaternion_may_have_any_length(length: float) -> None:
    scaled = [length * part for part in (0.5, -0.5, 0.5, 0.5)]
    assert np.allclose(rotation_of(scaled), Rotation.from_quat([0.5, -0.5, 0.5, 0.5]).as_matrix())
