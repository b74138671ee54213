"""Sides that are found in images of codes, which are drawn with known corners."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection.edge_fit import EdgeFit, SharpEdges
from marker_detection.image_sampling import ImagePyramid

from .drawn_codes import SEEN, SQUARE, drawn


def moved(quad, side, cells):
    """Return a quad with one side moved outwards: 0 the upper one, 1 the right one."""
    result, middle = quad.copy(), quad.mean(axis=0)
    ends = [side, (side + 1) % 4]
    outwards = quad[ends].mean(axis=0) - middle
    result[ends] += outwards * cells * 2.0 / 7.0
    return result


@pytest.mark.parametrize('wrong', [-0.09, 0.0, 0.12])
def test_sides_are_moved_onto_the_edges(wrong):
    pyramid = ImagePyramid(drawn(SEEN))
    start = SEEN + wrong * (SEEN - (100.0, 75.0))
    start[1] += (1.5, -2.0)
    (fitted,) = EdgeFit(7).fitted(pyramid, start[None])
    assert np.abs(fitted - SEEN).max() < 0.8
    (again,) = EdgeFit(7).fitted(pyramid, fitted[None])
    assert np.abs(again - SEEN).max() < 0.8
    both = EdgeFit(7).fitted(pyramid, np.stack([start, SEEN]))
    assert both[0] == pytest.approx(fitted)
    assert np.abs(both[1] - SEEN).max() < 0.8


@pytest.mark.parametrize('side', range(4))
@pytest.mark.parametrize('cells', [-0.4, 0.4])
@pytest.mark.parametrize('scale', [0.6, 1.0, 2.3, 4.1])
def test_a_side_that_is_nearly_half_a_cell_wrong_is_followed_to_its_edge(side, cells, scale):
    quad = (SEEN - (100.0, 75.0)) * scale + np.array([100.3, 75.6]) * max(scale, 1.0)
    shape = (round(150 * max(scale, 1.0)), round(200 * max(scale, 1.0)))
    # a dark wall beyond a margin of two thirds of a cell
    pyramid = ImagePyramid(drawn(quad, 0.67, 60.0, shape))
    (found,) = SharpEdges(7).followed(pyramid, moved(quad, side, cells)[None])
    assert np.abs(found - quad).max() < 0.3


def test_quads_of_several_sizes_are_followed_as_each_alone():
    large, small = 3.0 * (SEEN - (100.0, 75.0)) + (300.0, 225.0), 0.45 * SEEN + (0.2, 0.4)
    image = drawn(large, shape=(450, 600))
    image[:80, :120] = drawn(small, shape=(80, 120))
    pyramid, edges = ImagePyramid(image), SharpEdges(7)
    start = np.stack([moved(large, 1, 0.2), np.add(small, (0.3, -0.2)), moved(large, 2, -0.3)])
    together = edges.followed(pyramid, start)
    for quad, found in zip(start, together, strict=True):
        assert edges.followed(pyramid, quad[None])[0] == pytest.approx(found, abs=1e-6)
    assert np.abs(together[[0, 2]] - large).max() < 0.1
    # cells of less than five pixels
    assert (together[1] == start[1]).all()


def test_a_bowed_side_has_its_corners_where_they_are():
    """A marker on a curled sheet: its upper and lower sides are arcs."""
    image = drawn(3.0 * (SQUARE * 35.0) + (300.0, 225.0), shape=(450, 600))
    y, x = np.mgrid[:450, :600].astype(np.float32)
    bow = (2.5 * (1.0 - np.square((x - 300.0) / 105.0))).astype(np.float32)
    bent = cv2.remap(image, x, y + bow, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    truth = 105.0 * SQUARE + (300.0, 225.0)
    (found,) = SharpEdges(7).followed(
        ImagePyramid(np.asarray(bent, np.uint8)), (truth - (0.0, 1.5))[None]
    )
    assert np.abs(found - truth).max() < 0.8


@pytest.mark.parametrize('side', range(4))
@pytest.mark.parametrize('beyond', [-2.0, 0.0, 3.0])
def test_a_side_at_the_images_edge_stays_and_the_others_are_followed(side, beyond):
    quad = 84.0 * SQUARE + (300.0, 225.0)
    image = drawn(quad, shape=(450, 600))
    low, high = quad[0] + 0.5, quad[2] + 0.5
    cut = [0, 600, 450, 0]
    cut[side] = round([low[1] + beyond, high[0] - beyond, high[1] - beyond, low[0] + beyond][side])
    image = image[cut[0] : cut[2], cut[3] : cut[1]].copy()
    truth = quad - (cut[3], cut[0])
    start = moved(truth, (side + 2) % 4, 0.3)
    noise = np.random.default_rng(1).normal(0.0, 3.0, image.shape)
    image = np.clip(image + noise, 0, 255).astype(np.uint8)
    (found,) = SharpEdges(7).followed(ImagePyramid(image), start[None])
    # where the image ends in the edge itself, half of it is seen
    assert np.abs(found - truth).max() < (1.6 if beyond == 0.0 else 0.6)


def test_what_of_an_outline_lies_on_no_edge_explains_nothing():
    pyramid, edges = ImagePyramid(drawn(SEEN)), SharpEdges(7)
    quads = np.stack([SEEN, moved(SEEN, 0, -0.4), moved(SEEN, 2, 0.4), np.add(SEEN, (70.0, 0.0))])
    right, inside, outside, beside = edges.explained(pyramid, quads).tolist()
    assert right == 1.0
    # a quarter, and the ends of the sides next to it
    assert 0.6 < inside <= 0.75
    assert 0.6 < outside <= 0.75
    assert beside < 0.5
    assert edges.explained(pyramid, quads[:1]).tolist() == [1.0]


def test_what_of_an_outline_is_not_in_the_image_counts_half():
    image = drawn(SEEN)
    right = round(SEEN[:, 0].mean())
    half = SharpEdges(7).explained(ImagePyramid(image[:, :right].copy()), SEEN[None])
    assert half[0] == pytest.approx(0.75, abs=0.05)
    # a margin that the image does not show is no reason to doubt the outline
    thin = image[:, : int(SEEN[1:3, 0].max()) + 3].copy()
    assert SharpEdges(7).explained(ImagePyramid(thin), SEEN[None])[0] > 0.95


def test_a_side_in_a_deep_shadow_is_an_edge_as_well():
    image = drawn(SEEN)
    image[:, 100:] //= 5
    pyramid = ImagePyramid(image)
    (found,) = SharpEdges(7).followed(pyramid, moved(SEEN, 1, 0.3)[None])
    assert np.abs(found - SEEN).max() < 0.5
    assert SharpEdges(7).explained(pyramid, found[None])[0] > 0.9


@pytest.mark.parametrize(('size', 'most'), [(250.0, 3.0), (275.0, 5.2), (350.0, 5.2)])
def test_what_is_repeated_beyond_the_image_is_no_side(size, most):
    # turned by an eighth: all corners are beyond the image, and a third of each side or most of it
    turned = SQUARE @ np.array([[0.72, 0.69], [-0.69, 0.72]])
    turned += [(0.02, 0.0), (-0.01, 0.0), (0.0, -0.01), (0.0, 0.02)]
    truth = size * turned + (299.0, 266.0)
    pyramid = ImagePyramid(drawn(truth, shape=(534, 600)))
    start = truth + np.array([(3.0, -2.0), (-4.0, 2.0), (3.0, 3.0), (-2.0, -3.0)])
    (followed,) = SharpEdges(7).followed(pyramid, start[None])
    assert np.linalg.norm(followed - truth, axis=1).max() < most
