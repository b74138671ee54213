"""Cameras: which descriptions are taken, and where their pixels look."""

from __future__ import annotations

import math
import re

import cv2
import numpy as np
import pytest

from marker_detection import CameraModel

K = np.array([[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]])
PIXELS = np.array([[320.0, 240.0], [100.0, 60.0], [600.0, 100.0], [40.0, 460.0]])
MODELS = {
    'plumb_bob': [-0.3, 0.1, 0.001, -0.002, 0.0],
    'rational_polynomial': [0.5, 0.1, 0.001, 0.0, 0.02, 0.8, 0.3, 0.05],
    'equidistant': [0.02, -0.01, 0.003, 0.0],
}


@pytest.mark.parametrize('model', MODELS)
def test_rays_of_pixels_project_back_onto_them(model):
    camera = CameraModel(640, 480, K, np.array(MODELS[model]), model)
    rays = camera.rays(PIXELS)
    assert rays is not None
    project = cv2.fisheye.projectPoints if model == 'equidistant' else cv2.projectPoints
    points = np.column_stack([rays, np.ones(4)]).reshape(-1, 1, 3)
    again = project(points, np.zeros(3), np.zeros(3), K, camera.distortion)[0].reshape(-1, 2)
    assert np.allclose(again, PIXELS, atol=0.05)


def test_equidistant_is_no_plumb_bob():
    numbers = np.array([0.1, 0.01, 0.0, 0.0])
    fisheye = CameraModel(640, 480, K, numbers, 'equidistant').rays(PIXELS)
    plumb_bob = CameraModel(640, 480, K, numbers, 'plumb_bob').rays(PIXELS)
    assert fisheye is not None
    assert plumb_bob is not None
    assert np.abs(fisheye - plumb_bob).max() > 0.01


def test_distortion_that_cannot_be_taken_back_gives_no_rays():
    assert CameraModel(640, 480, K, np.array([-90.0, 5.0, 0.0, 0.0, 0.0])).rays(PIXELS) is None


def test_every_camera_that_is_taken_has_images_of_other_sizes():
    for exponent in range(12):
        matrix = np.diag([10.0**exponent, 10.0**exponent, 1.0])
        try:
            camera = CameraModel(640, 480, matrix)
        except ValueError:
            continue
        assert camera.scaled_to(6400, 4800).width == 6400


@pytest.mark.parametrize(('model', 'numbers'), MODELS.items())
def test_zeros_beyond_the_coefficients_of_a_model_say_nothing(model, numbers):
    # ros_gz copies as many numbers as come, whatever the model
    padded = np.array([*numbers, *[0.0] * (20 - len(numbers))])
    camera = CameraModel(640, 480, K, padded, model)
    expected = CameraModel(640, 480, K, np.array(numbers), model)
    assert camera.rays(PIXELS) == pytest.approx(expected.rays(PIXELS))
    padded[-1] = 0.01
    with pytest.raises(ValueError, match='20 distortion coefficients'):
        CameraModel(640, 480, K, padded, model)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'matrix': np.zeros((3, 3))}, 'not calibrated'),
        ({'matrix': K * np.array([[1, 1, 1], [1, 1, 1], [1, 1, 0]])}, 'must have the form'),
        ({'matrix': K + np.array([[0, 0, np.nan], [0, 0, 0], [0, 0, 0]])}, 'finite'),
        ({'distortion': np.zeros(3)}, '3 distortion coefficients, expected 0 or 4 or 5'),
        ({'distortion': np.ones(6)}, '6 distortion coefficients'),
        ({'distortion': np.array([np.nan, 0, 0, 0, 0])}, 'must be finite'),
        (
            {'distortion': np.ones(5), 'distortion_model': 'equidistant'},
            'expected 4 for equidistant',
        ),
        ({'width': 0}, 'no area'),
    ],
)
def test_description_that_is_none_is_refused(changes, reason):
    with pytest.raises(ValueError, match=reason):
        CameraModel(**({'width': 640, 'height': 480, 'matrix': K} | changes))


def test_camera_scales_with_its_images():
    half = CameraModel(640, 480, K).scaled_to(320, 240)
    assert half.matrix[0, 0] == pytest.approx(250.0)
    assert half.rays(np.array([[79.75, 59.75]])) == pytest.approx(
        CameraModel(640, 480, K).rays(np.array([[160.0, 120.0]]))
    )
    assert CameraModel(640, 480, K).scaled_to(640, 360) is None


@pytest.mark.parametrize('model', ['', *MODELS])
def test_skew_of_the_matrix_is_part_of_the_ray(model):
    numbers = np.array(MODELS.get(model, []))
    kind = model or 'plumb_bob'
    upright = CameraModel(640, 480, K, numbers, kind)
    skewed = K.copy()
    skewed[0, 1] = 8.0
    rays = upright.rays(PIXELS)
    shifted = PIXELS + np.column_stack([8.0 / 510.0 * (PIXELS[:, 1] - 240.0), np.zeros(4)])
    assert CameraModel(640, 480, skewed, numbers, kind).rays(shifted) == pytest.approx(rays)


def test_fisheye_is_opencvs_name_of_the_equidistant_model():
    numbers = np.array(MODELS['equidistant'])
    named = CameraModel(640, 480, K, numbers, 'fisheye')
    assert named.rays(PIXELS) == pytest.approx(
        CameraModel(640, 480, K, numbers, 'equidistant').rays(PIXELS)
    )


@pytest.mark.parametrize(
    ('model', 'numbers', 'turns_back'),
    [
        # theta (1 + k1 theta^2) is highest where theta^2 = -1 / (3 k1): 76 and 72 degrees
        ('equidistant', [-0.19, 0.0, 0.0, 0.0], 75.9),
        ('equidistant', [-0.211, 0.0, 0.0, 0.0], 72.0),
        # likewise r (1 + k1 r^2): r = 1
        ('plumb_bob', [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0], 45.0),
    ],
)
def test_pixels_beyond_where_the_polynomial_turns_back_have_no_ray(model, numbers, turns_back):
    camera = CameraModel(640, 480, K, np.array(numbers), model)
    project = cv2.fisheye.projectPoints if model == 'equidistant' else cv2.projectPoints
    for degrees in range(5, 87, 2):
        ray = np.array([[[np.tan(np.radians(degrees)), 0.0, 1.0]]])
        pixel = project(ray, np.zeros(3), np.zeros(3), K, np.array(numbers))[0].reshape(1, 2)
        found = camera.rays(pixel)
        if degrees < turns_back - 3.0:
            assert found is not None
            assert np.degrees(np.arctan(found[0, 0])) == pytest.approx(degrees, abs=0.2)
        elif found is not None:
            # such a pixel is also what a ray on the near side shows
            assert np.degrees(np.arctan(found[0, 0])) < turns_back


def test_camera_of_a_field_of_view_sees_its_edges_at_half_of_it():
    camera = CameraModel.from_field_of_view(640, 480, 1.2)
    focal = 320.0 / math.tan(0.6)
    assert camera.matrix.tolist() == [[focal, 0.0, 319.5], [0.0, focal, 239.5], [0.0, 0.0, 1.0]]
    assert camera.horizontal_field_of_view == pytest.approx(1.2)
    edges = camera.rays(np.array([[-0.5, 239.5], [639.5, 239.5]]))
    assert edges is not None
    assert np.arctan(edges[:, 0]) == pytest.approx([-0.6, 0.6])
    assert camera.project(np.array([[0.0, 0.0, 2.0], [1.0, -1.0, 2.0]])) == pytest.approx(
        np.array([[319.5, 239.5], [319.5 + focal / 2, 239.5 - focal / 2]])
    )
    for wrong in (0.0, math.pi, -1.0):
        with pytest.raises(ValueError, match=r'must lie between 0 and pi rad, got'):
            CameraModel.from_field_of_view(640, 480, wrong)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'height': 0}, 'an image of 640x0 pixels has no area'),
        ({'matrix': np.eye(2)}, 'the camera matrix must be 3x3 finite numbers'),
        (
            {'matrix': np.diag([500.0, 0.0, 1.0])},
            'focal lengths must be positive, got 500 and 0: the camera is not calibrated',
        ),
        (
            {'matrix': np.diag([6.41e6, 500.0, 1.0])},
            'the camera matrix must have no number above 6.4e+06',
        ),
        (
            {'matrix': K + np.array([[0, 0, 0], [1, 0, 0], [0, 0, 0]])},
            'the camera matrix must have the form [fx skew cx, 0 fy cy, 0 0 1], '
            'got 500 0 320 1 510 240 0 0 1',
        ),
        ({'distortion_model': 'nix'}, "distortion model 'nix' is not known"),
    ],
)
def test_a_refused_description_says_what_was_expected(changes, reason):
    with pytest.raises(ValueError, match=f'^{re.escape(reason)}$'):
        CameraModel(**({'width': 640, 'height': 480, 'matrix': K} | changes))
    CameraModel(640, 480, np.diag([6.4e6, 1e-9, 1.0]))


def test_camera_with_images_of_another_size_sees_the_same():
    skewed = K + np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    camera = CameraModel(640, 480, skewed, np.array(MODELS['plumb_bob']))
    assert camera.scaled_to(640, 480) is camera
    points = np.array([[0.2, -0.1, 1.0], [-0.3, 0.2, 1.5]])
    plain = CameraModel(640, 480, K)
    for size in ((1280, 960), (320, 240), (642, 480)):
        scaled = plain.scaled_to(*size)
        assert (scaled.width, scaled.height) == size
        grown = (plain.project(points) + 0.5) * (size[0] / 640, size[1] / 480) - 0.5
        assert scaled.project(points) == pytest.approx(grown)
    assert plain.scaled_to(653, 480) is None
    assert plain.scaled_to(652, 480) is not None
    assert plain.scaled_to(640, 490) is None
    assert (camera.scaled_to(320, 240).distortion == camera.distortion).all()


def test_rays_of_a_straight_camera_are_lines():
    skewed = K + np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    rays = CameraModel(640, 480, skewed).rays(PIXELS)
    assert rays is not None
    assert rays[:, 1] == pytest.approx((PIXELS[:, 1] - 240.0) / 510.0)
    assert rays[:, 0] == pytest.approx((PIXELS[:, 0] - 320.0 - 3.0 * rays[:, 1]) / 500.0)
    fisheye = CameraModel(640, 480, K, np.zeros(4), 'equidistant').rays(PIXELS)
    assert fisheye is not None
    angle = np.linalg.norm((PIXELS - (320.0, 240.0)) / (500.0, 510.0), axis=1)
    assert np.arctan(np.linalg.norm(fisheye, axis=1)) == pytest.approx(angle, abs=1e-4)
