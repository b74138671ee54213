"""Homographies and reading under them, beside OpenCV and plain loops."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection.image_sampling import (
    ImagePyramid,
    cell_widths,
    corners_of,
    halved,
    homographies_of,
    jacobians_of,
    levels_for,
)

from .drawn_codes import SQUARE

GENERATOR = np.random.default_rng(3)
QUADS = 40.0 * SQUARE + (200.0, 150.0) + GENERATOR.uniform(-25.0, 25.0, (20, 4, 2))


def test_homographies_are_those_of_opencv_and_lead_back():
    found = homographies_of(QUADS)
    for quad, homography in zip(QUADS, found, strict=True):
        expected = cv2.getPerspectiveTransform(SQUARE.astype(np.float32), quad.astype(np.float32))
        assert homography == pytest.approx(expected, rel=1e-4, abs=1e-4)
    assert corners_of(found) == pytest.approx(QUADS)


def test_jacobians_are_the_slopes_at_the_middle():
    found = homographies_of(QUADS)
    small = 1e-5
    for homography, jacobian in zip(found, jacobians_of(found), strict=True):

        def pixel(x, y, homography=homography):
            point = homography @ (x, y, 1.0)
            return point[:2] / point[2]

        across = (pixel(small, 0.0) - pixel(-small, 0.0)) / (2.0 * small)
        down = (pixel(0.0, small) - pixel(0.0, -small)) / (2.0 * small)
        assert jacobian == pytest.approx(np.column_stack([across, down]), rel=1e-4)
        narrow = min(np.linalg.norm(across), np.linalg.norm(down)) * 2.0 / 7
        assert cell_widths(homography[None], 7) == pytest.approx(narrow, rel=1e-4)
    # a homography is the same times any number
    assert jacobians_of(3.0 * found) == pytest.approx(jacobians_of(found))


@pytest.mark.parametrize(
    ('width', 'level'), [(0.01, 0), (3.9, 0), (4.1, 1), (7.9, 1), (8.1, 2), (127.0, 5), (900.0, 5)]
)
def test_a_wide_cell_is_read_from_a_halved_image(width, level):
    homography = np.diag([width * 3.5, 2.0 * width * 3.5, 1.0])[None]
    assert levels_for(homography, 7, 4.0).tolist() == [level]


def test_grey_levels_are_interpolated_between_pixels_of_the_halved_image():
    image = GENERATOR.integers(0, 256, (48, 64)).astype(np.uint8)
    pyramid = ImagePyramid(image)
    homographies = homographies_of(
        8.0 * SQUARE + (30.0, 20.0) + GENERATOR.uniform(-3, 3, (3, 4, 2))
    )
    places = np.array([[-1.0, -0.2, 0.5, 0.9], [0.3, -0.7, 0.0, 0.8], [1.0] * 4])
    levels = np.array([0, 2, 1])
    found = pyramid.sample(homographies, places.astype(np.float32), levels)
    for row, (homography, level) in enumerate(zip(homographies, levels.tolist(), strict=True)):
        small = image.astype(float)
        for _ in range(level):
            parts = small.reshape(small.shape[0] // 2, 2, small.shape[1] // 2, 2)
            small = np.rint(parts.mean(axis=(1, 3)))
        for column, place in enumerate(places.T):
            x, y = (homography @ place)[:2] / (homography @ place)[2]
            x, y = (x + 0.5) / 2**level - 0.5, (y + 0.5) / 2**level - 0.5
            left, top = int(np.floor(x)), int(np.floor(y))
            right, low = x - left, y - top
            expected = (
                small[top, left] * (1 - right) * (1 - low)
                + small[top, left + 1] * right * (1 - low)
                + small[top + 1, left] * (1 - right) * low
                + small[top + 1, left + 1] * right * low
            )
            # OpenCV has 32 places between two pixels
            assert found[row, column] == pytest.approx(expected, abs=9.0)
    same = pyramid.sample(homographies[1:2], places.astype(np.float32), levels[1:2])
    assert same == pytest.approx(found[1:2], abs=1e-3)


def test_beyond_the_image_its_edge_goes_on():
    image = np.full((20, 30), 7, np.uint8)
    image[:, -1] = 200
    far = homographies_of((5.0 * SQUARE + (100.0, 10.0))[None])
    middle = np.array([[0.0], [0.0], [1.0]], np.float32)
    assert ImagePyramid(image).sample(far, middle, np.array([0])).tolist() == [[200.0]]
    # so small that it cannot be halved as often
    assert ImagePyramid(image[:1, :1]).sample(far, middle, np.array([3])).tolist() == [[7.0]]


@pytest.mark.parametrize('shape', [(1, 1), (1, 4), (5, 8), (6, 7), (9, 11)])
def test_a_pixel_of_a_halved_image_is_the_mean_of_four(shape):
    image = GENERATOR.integers(0, 256, shape).astype(np.uint8)
    rows, columns = (np.minimum(np.arange(n + n % 2), n - 1) for n in shape)
    parts = image[rows][:, columns].astype(float)
    parts = parts.reshape(len(rows) // 2, 2, len(columns) // 2, 2)
    assert np.abs(halved(image) - parts.mean(axis=(1, 3))).max() <= 0.5


@pytest.mark.parametrize('shape', [(300, 400), (301, 403), (333, 417), (255, 511)])
@pytest.mark.parametrize('axis', [0, 1])
def test_a_halved_image_shows_each_thing_where_it_is(shape, axis):
    # grey levels that say which column or row they are of
    ramp = np.arange(shape[1 - axis]) * 0.5
    image = np.rint(np.broadcast_to(ramp if axis == 0 else ramp[:, None], shape)).astype(np.uint8)
    pyramid = ImagePyramid(image)
    places = np.array([[-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [1.0] * 3], np.float32)
    for level in range(6):
        edge = 2.0 ** (level + 1)
        low, high = np.full(2, edge), np.array([shape[1], shape[0]]) - edge
        quad = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        found = pyramid.sample(homographies_of(quad[None]), places, np.array([level]))[0]
        expected = 0.5 * np.array([low[axis], (low[axis] + high[axis]) / 2.0, high[axis]])
        assert found == pytest.approx(expected, abs=1.1)


def test_samples_are_of_the_image_where_whole_pixels_of_it_lie_around_them():
    pyramid = ImagePyramid(np.zeros((301, 403), np.uint8))
    across = np.zeros((1, 3, 3))
    across[:, 0, 0], across[:, 1, 1], across[:, 2, 2] = 1.0, 1.0, 1.0
    for level in range(4):
        size = 2**level
        # middles of the first and the last whole pixel, and half a pixel further inside
        for axis, length in ((0, 403), (1, 301)):
            first, last = (size - 1) / 2 + size / 2, (length // size - 0.5) * size - 0.5 - size / 2
            along = np.array([first - 0.1, first + 0.1, 150.0, last - 0.1, last + 0.1])
            grid = np.full((3, 5), 150.0)
            grid[2], grid[axis] = 1.0, along
            shown = pyramid.shown(across, grid.astype(np.float32), np.array([level]))
            assert shown.tolist() == [[False, True, True, True, False]]


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('depth', [-1.0, 0.0])
def test_samples_behind_the_camera_or_infinitely_far_are_not_of_the_image(depth):
    pyramid = ImagePyramid(np.zeros((301, 403), np.uint8))
    homography = np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, depth]]])
    place = np.array([[-150.0], [-150.0], [1.0]], np.float32)
    assert pyramid.shown(homography, place, np.array([0])).tolist() == [[False]]


def test_more_candidates_are_read_than_opencv_maps_at_once():
    image = GENERATOR.integers(0, 256, (48, 64)).astype(np.uint8)
    places = GENERATOR.uniform(0.0, 40.0, (2**15 + 5, 2))
    homographies = np.tile(np.eye(3), (len(places), 1, 1))
    homographies[:, :2, 2] = places
    middle = np.array([[0.0], [0.0], [1.0]], np.float32)
    levels = np.zeros(len(places), int)
    read = ImagePyramid(image).sample(homographies, middle, levels)
    for part in (slice(0, 5), slice(-10, None)):
        alone = ImagePyramid(image).sample(homographies[part], middle, levels[part])
        assert read[part] == pytest.approx(alone)
