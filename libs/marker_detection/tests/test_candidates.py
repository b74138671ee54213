"""Outlines of dark blobs and borders, beside plain loops and drawn shapes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection.candidates import (
    BorderCheck,
    Mask,
    dark_masks,
    distinct,
    quads_around,
)
from marker_detection.image_sampling import ImagePyramid, homographies_of

from .drawn_codes import SEEN, SQUARE, drawn


def blank(*boxes, size=(120, 160)):
    pixels = np.zeros(size, np.uint8)
    for left, top, right, bottom in boxes:
        pixels[top : bottom + 1, left : right + 1] = 255
    return pixels


def ordered(quad):
    """Return corners from the upper left one on, clockwise as they are."""
    return np.roll(quad, -int(quad.sum(axis=1).argmin()), axis=0)


def box_of(left, top, right, bottom):
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]], float)


@pytest.mark.parametrize(('scale', 'eroded'), [(1, 0), (1, 2), (2, 0), (2, 1)])
def test_a_quad_runs_along_the_outer_edges_of_the_pixels_of_a_blob(scale, eroded):
    (quad,) = quads_around([Mask(blank((10, 20, 29, 49)), scale, eroded)])
    edge = 0.5 + eroded
    expected = box_of(10 - edge, 20 - edge, 29 + edge, 49 + edge)
    assert ordered(quad) == pytest.approx((expected + 0.5) * scale - 0.5, abs=1e-4)


def test_each_side_of_a_slanted_quad_is_moved_by_as_much():
    generator = np.random.default_rng(4)
    for _ in range(5):
        drawn = np.rint(40.0 * SQUARE + (80.0, 60.0) + generator.uniform(-15, 15, (4, 2)))
        pixels = np.zeros((120, 160), np.uint8)
        cv2.fillConvexPoly(pixels, drawn.astype(np.int32), 255)
        plain, eroded = (quads_around([Mask(pixels, 1, width)])[0] for width in (0, 3))
        assert np.abs(ordered(plain) - ordered(drawn)).max() < 2.5
        plain, eroded = ordered(plain), ordered(eroded)
        for start in range(4):
            first, second = plain[start], plain[(start + 1) % 4]
            along = (second - first) / np.linalg.norm(second - first)
            outwards = np.array([along[1], -along[0]])
            for corner in (eroded[start], eroded[(start + 1) % 4]):
                assert (corner - first) @ outwards == pytest.approx(3.0, abs=1e-4)


@pytest.mark.parametrize(
    ('box', 'found'),
    [
        ((5, 5, 12, 9), 1),
        ((5, 5, 11, 9), 0),
        ((5, 5, 9, 12), 1),
        ((5, 5, 14, 6), 1),
        ((5, 5, 14, 5), 0),
    ],
)
def test_how_small_a_blob_may_be(box, found):
    assert len(quads_around([Mask(blank(box))], min_length=8.0)) == found
    assert len(quads_around([Mask(blank(box), 2)], min_length=16.0)) == found


def test_the_likeliest_blobs_come_first_and_alone_after_the_limit():
    pixels = blank((10, 10, 29, 29))
    cv2.fillConvexPoly(pixels, np.array([[60, 10], [90, 10], [60, 50]]), 255)
    cv2.ellipse(pixels, (120, 30), (14, 20), 0, 0, 360, 255, -1)
    # an L lies far from its middle
    pixels[70:82, 10:60] = pixels[70:115, 10:22] = 255
    quads = quads_around([Mask(pixels)])
    middles = quads.mean(axis=1)
    assert middles[0] == pytest.approx([19.5, 19.5], abs=0.1)
    assert middles[1] == pytest.approx([120.0, 30.0], abs=1.0)
    assert middles[3][1] > 70
    assert len(quads) == 4
    # the first mask does not count for the others, and these end at the limit
    assert [len(quads_around([Mask(pixels)] * count, limit=0)) for count in (1, 2, 3)] == [3, 6, 6]
    assert len(quads_around([Mask(pixels)], limit=3)) == 4
    assert len(quads_around([Mask(pixels)], limit=2)) == 3


def test_a_box_is_looked_at_once_but_for_the_first_mask():
    mask = Mask(blank((10, 10, 29, 29)))
    assert [len(quads_around([mask] * count)) for count in range(4)] == [0, 1, 2, 2]
    moved = Mask(blank((13, 13, 32, 32)))
    assert len(quads_around([mask, mask, moved])) == 3
    half = Mask(blank((5, 5, 14, 14)), 2)
    assert len(quads_around([mask, mask, half])) in (2, 3)


def test_a_mask_without_blobs_has_no_quads():
    assert quads_around([Mask(np.zeros((9, 9), np.uint8))]).shape == (0, 4, 2)


def test_masks_are_what_is_darker_than_around():
    generator = np.random.default_rng(2)
    image = np.full((64, 96), 200, np.uint8)
    image[20:40, 30:50] = 60
    image[4, 4] = 20  # a speck
    image = np.clip(image + generator.integers(-2, 3, image.shape), 0, 255).astype(np.uint8)
    black, small, wide, split, closed_down, closed_across = dark_masks(image, [5, 31], 7.0, [5])
    assert [each.scale for each in (black, small, wide, split)] == [1, 1, 2, 2]
    assert {each.eroded for each in (black, small, wide, split, closed_down)} == {0}
    padded = np.pad(image.astype(float), 2, mode='edge')
    around = np.lib.stride_tricks.sliding_window_view(padded, (5, 5)).mean(axis=(2, 3))
    darker = (np.rint(around) - image) > 6.5
    near = np.pad(darker, 2, mode='reflect')
    near = np.lib.stride_tricks.sliding_window_view(near, (5, 5)).sum(axis=(2, 3))
    differs = (small.pixels > 0) != (darker & (near > 2.5))
    assert not differs[2:-2, 2:-2].any()
    assert not small.pixels[4, 4]
    assert small.pixels[20:22, 32:48].all()
    assert not small.pixels[26:34, 36:44].any()  # further inside than the window
    assert wide.pixels.shape == split.pixels.shape == (32, 48)
    assert wide.pixels[10:20, 15:25].all()
    assert wide.pixels.sum() == split.pixels.sum() == 255 * 100
    assert not black.pixels.any()  # the speck alone is darker than a quarter of white
    for closed, shape in ((closed_down, (5, 1)), (closed_across, (1, 5))):
        expected = cv2.morphologyEx(small.pixels, cv2.MORPH_CLOSE, np.ones(shape, np.uint8))
        assert (closed.pixels == expected).all()
    clean = blank((30, 20, 49, 39), size=(64, 96))
    touching = [*dark_masks(255 - clean, [31, 5], 7.0, [], touching=True)]
    assert [each.eroded for each in touching] == [0, 0, 0, 0, 1, 2, 1, 2]
    assert [each.scale for each in touching] == [1, 2, 1, 2, 1, 1, 1, 1]
    assert touching[6].pixels.sum() == 255 * 18**2
    assert touching[7].pixels.sum() == 255 * 16**2


def test_of_quads_that_are_nearly_the_same_the_first_is_kept():
    generator = np.random.default_rng(8)
    middles = generator.uniform(0, 60, (150, 1, 2))
    quads = middles + SQUARE * generator.choice([5.0, 5.2, 8.0], (150, 1, 1))
    kept: list[int] = []
    for index, quad in enumerate(quads):
        size = np.linalg.norm(quad - quad.mean(axis=0), axis=1).mean()
        for other in kept:
            apart = np.abs(quad.mean(axis=0) - quads[other].mean(axis=0)).max()
            its = np.linalg.norm(quads[other] - quads[other].mean(axis=0), axis=1).mean()
            if apart <= 2.0 and abs(its - size) < max(2.0, 0.06 * size):
                break
        else:
            kept.append(index)
    assert distinct(quads, 2.0).tolist() == kept
    assert distinct(quads[:1], 2.0).tolist() == [0]


# Borders.


PLACED = homographies_of(SEEN[None])


def test_a_border_with_its_margin_correlates_and_other_places_do_not():
    check = BorderCheck(7)
    pyramid = ImagePyramid(drawn(SEEN))
    ((found,), (beside,), (inside,)) = (
        check.correlation(pyramid, homographies, 7.0)
        for homographies in (
            PLACED,
            homographies_of(SEEN[None] + (12.0, 0.0)),
            homographies_of(0.6 * (SEEN[None] - (100.0, 75.0)) + (100.0, 75.0)),
        )
    )
    assert found > 0.95
    assert beside == inside == -1.0
    assert check.correlation(pyramid, PLACED, 155.0)[0] > 0.9
    assert check.correlation(pyramid, PLACED, 165.0)[0] == -1.0
    thin = ImagePyramid(drawn(SEEN, 0.5, 20.0))
    assert check.correlation(thin, PLACED, 7.0)[0] > 0.9
    white_on_black = ImagePyramid(255 - drawn(SEEN))
    assert check.correlation(white_on_black, PLACED, 7.0)[0] == -1.0
    empty = drawn(SEEN)
    cv2.fillConvexPoly(empty, np.rint(SEEN).astype(np.int32), 40)
    assert check.correlation(ImagePyramid(empty), PLACED, 7.0)[0] == -1.0
    one_side, two_sides = drawn(SEEN), drawn(SEEN)
    one_side[:, 132:] = two_sides[:, 132:] = two_sides[:, :69] = 40
    assert check.correlation(ImagePyramid(one_side), PLACED, 7.0)[0] > 0.0
    assert check.correlation(ImagePyramid(two_sides), PLACED, 7.0)[0] == -1.0


def test_the_correlation_is_that_of_two_levels_with_noise_around_them():
    noise = np.random.default_rng(6).normal(0.0, 40.0, (150, 200))
    noisy = np.clip(drawn(SEEN, white=170.0, black=90.0) + noise, 0, 255).astype(np.uint8)
    (found,) = BorderCheck(7).correlation(ImagePyramid(noisy), PLACED, 7.0)
    # contrast / sqrt(contrast^2 + 4 variance); halving the image once leaves a quarter of it,
    # interpolation about half
    assert found == pytest.approx(80.0 / np.sqrt(80.0**2 + 4.0 * 40.0**2 / 4.0 * 0.45), abs=0.06)


@pytest.mark.parametrize(('crowd', 'found'), [(1, 1), (2, 2)])
def test_gaps_are_bridged_unless_there_is_a_crowd(crowd: int, found: int) -> None:
    """Of the second mask every other blob would be one of the first, joined to its neighbours."""
    first, second = (np.zeros((100, 200), np.uint8) for _ in range(2))
    cv2.rectangle(first, (10, 10), (40, 40), 255, -1)
    cv2.rectangle(first, (60, 60), (64, 64), 255, -1)
    cv2.rectangle(second, (120, 20), (160, 60), 255, -1)
    masks = [Mask(np.zeros_like(first)), Mask(first), Mask(second, bridged=True)]
    large = quads_around(masks, min_length=5.0, crowd=crowd)
    assert len([each for each in large if np.ptp(each[:, 0]) > 20]) == found


def test_a_large_image_is_looked_at_coarsely_first():
    large, small = (np.full(shape, 200, np.uint8) for shape in ((2100, 2000), (1900, 2000)))
    for image in (large, small):
        image[300:340, 300:340] = 20
    black = next(dark_masks(large, (15, 31, 5), 7.0, (5,)))
    assert black.pixels.sum() == 255 * 20**2
    scales = [mask.scale for mask in dark_masks(large, (15, 31, 5), 7.0, (5,))]
    assert scales[:3] == [2, 2, 2]
    assert 1 in scales
    assert next(dark_masks(small, (15, 31, 5), 7.0, (5,))).scale == 1
    # where the halved image shows no crowd, a marker of few pixels is found in the image itself
    large[1000:1010, 1000:1010] = 20
    middles = quads_around(dark_masks(large, (15, 31, 5), 7.0, (5,))).mean(axis=1)
    for expected in ((319.5, 319.5), (1004.5, 1004.5)):
        assert np.abs(middles - expected).max(axis=1).min() < 1.0
