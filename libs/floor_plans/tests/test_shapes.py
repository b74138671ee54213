"""Boxes seen from above are as far away as OpenCV says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from floor_plans import shapes


def test_how_far_points_are_from_boxes_is_what_opencv_says() -> None:
    some = shapes.boxes_around([((0.0, 0.0), (3.0, 4.0)), ((5.0, 1.0), (5.0, 3.0))], 0.2)
    corners = shapes.corners(some)
    assert corners[1] == pytest.approx(np.array([[5.1, 1], [5.1, 3], [4.9, 3], [4.9, 1]]))
    rng = np.random.default_rng(5)
    points = rng.uniform((-2.0, -2.0), (7.0, 6.0), (200, 2))
    away = shapes.distances(some, *points.T)
    assert away.shape == (200, 2)
    for number, polygon in enumerate(corners.astype(np.float32)):
        for (x, y), gap in zip(points, away[:, number], strict=True):
            peer = cv2.pointPolygonTest(polygon.reshape(-1, 1, 2), (float(x), float(y)), True)
            assert gap == pytest.approx(max(0.0, -peer), abs=1e-5)
