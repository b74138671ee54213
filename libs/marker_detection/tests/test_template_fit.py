"""Blurred codes, beside codes that are drawn by the formula, sample by sample."""

from __future__ import annotations

import math

import numpy as np
import pytest

from marker_detection.dictionaries import MarkerCodes, dictionary_named
from marker_detection.image_sampling import ImagePyramid, corners_of, homographies_of
from marker_detection.template_fit import PixelFootprint, TemplateFit

from .drawn_codes import SQUARE

BLURS = np.geomspace(0.02, 2.0, 96)
"""The deviations that footprints name, in marker units."""


def codes_of(count, border=1):
    return MarkerCodes.of(dictionary_named('DICT_4X4_50'), range(count), border)


def places(fit, samples):
    side = fit.codes.side
    return [(n - (fit.count - 1) / 2) * 2.0 / side / samples for n in range(fit.count)]


def drawn(fit, samples, entry, down, across):
    """Return how a code looks: each cell's share of a Gaussian around each sample."""
    side, cells = fit.codes.side, fit.codes.cells[entry]

    def share(cell, at, deviation):
        low = -math.inf if cell == 0 else -1.0 + 2.0 / side * (cell - 1)
        high = math.inf if cell == side + 1 else -1.0 + 2.0 / side * cell
        return 0.5 * (
            math.erf((high - at) / deviation / math.sqrt(2))
            - math.erf((low - at) / deviation / math.sqrt(2))
        )

    def shares(deviation):
        return np.array(
            [[share(c, at, deviation) for c in range(side + 2)] for at in places(fit, samples)]
        )

    return (shares(BLURS[down]) @ cells @ shares(BLURS[across]).T).ravel()


@pytest.mark.parametrize('samples', [2, 3])
@pytest.mark.parametrize('border', [1, 2])
def test_codes_are_matched_as_if_each_was_drawn_with_its_blur(samples, border):
    fit = TemplateFit(codes_of(5, border), samples)
    truth, down, across = np.array([3, 17, 8]), np.array([20, 50, 64]), np.array([58, 30, 64])
    patches = np.array(
        [
            level + contrast * drawn(fit, samples, *each)
            for level, contrast, *each in zip(
                (90, 128, 60), (80.0, 5.0, 30.0), truth, down, across, strict=True
            )
        ],
        np.float32,
    )
    noise = np.random.default_rng(1).normal(0.0, 1.0, patches.shape).astype(np.float32)
    patches += noise
    footprint = PixelFootprint(down, across)
    entries, correlation = fit.score(patches, footprint)
    assert entries[:, 0].tolist() == truth.tolist()
    assert entries.shape == (3, 12)
    inner = fit.inner_correlations(patches, entries[:, :4], footprint)
    middle = np.abs(places(fit, samples)) < 1.0 - 2.0 * border / fit.codes.side
    middle = np.outer(middle, middle).ravel()
    for row in range(3):
        every = [
            np.corrcoef(patches[row], drawn(fit, samples, entry, down[row], across[row]))[0, 1]
            for entry in range(len(fit.codes.ids))
        ]
        assert correlation[row] == pytest.approx([every[e] for e in entries[row]], abs=2e-3)
        assert (np.diff(correlation[row]) <= 0).all()
        for place, entry in enumerate(entries[row, :4].tolist()):
            code = drawn(fit, samples, entry, down[row], across[row])
            expected = np.corrcoef(patches[row][middle], code[middle])[0, 1]
            assert inner[row, place] == pytest.approx(expected, abs=2e-3)
    listed = np.array([[0, 3], [17, 1], [2, 4]])
    chosen, agreement = fit.score(patches, footprint, listed)
    assert [sorted(each) for each in chosen.tolist()] == [sorted(each) for each in listed.tolist()]
    assert chosen[:2, 0].tolist() == [3, 17]
    assert agreement[:2, 0] == pytest.approx(correlation[:2, 0], abs=1e-4)
    assert footprint.chosen(np.array([2, 0])).down.tolist() == [64, 20]


def test_few_codes_are_all_matched():
    fit = TemplateFit(codes_of(2))
    patch = drawn(fit, 3, 5, 40, 40)[None].astype(np.float32)
    entries, correlation = fit.score(patch, PixelFootprint(np.array([40]), np.array([40])))
    assert sorted(entries[0].tolist()) == list(range(8))
    assert correlation[0, 0] == pytest.approx(1.0, abs=1e-4)
    even = fit.score(np.full_like(patch, 9.0), PixelFootprint(np.array([40]), np.array([40])))[1]
    assert even == pytest.approx(np.zeros((1, 8)))


def test_blur_is_that_of_lens_pixel_and_interpolation_in_the_markers_own_axes():
    fit = TemplateFit(codes_of(2))
    turned = np.array([[0.0, -30.0, 100.0], [10.0, 0.0, 80.0], [0.0, 0.0, 1.0]])
    plain = np.array([[30.0, 0.0, 100.0], [0.0, 10.0, 80.0], [0.0, 0.0, 1.0]])
    slanted = np.array([[30.0, 20.0, 100.0], [0.0, 20.0, 80.0], [0.0, 0.0, 1.0]])
    lens = np.array([[0.8, 0.8], [0.8, 0.8], [0.8, 1.5]])
    homographies, levels = np.stack([turned, plain, slanted]), np.array([0, 1, 0])
    footprint = fit.footprint(homographies, levels, lens)
    for row, (homography, level) in enumerate(zip(homographies, levels.tolist(), strict=True)):
        back = np.linalg.inv(homography[:2, :2])
        # across the marker's x: how far a pixel's blur reaches in that direction
        for named, (axis, blur) in zip(
            (footprint.across, footprint.down), enumerate(lens[row]), strict=True
        ):
            deviation = np.linalg.norm(back[axis]) * math.sqrt(blur**2 + 4.0**level / 4.0)
            found = BLURS[named[row]]
            assert deviation <= found <= deviation * BLURS[1] / BLURS[0] * 1.001
    ends = fit.footprint(
        np.stack([np.diag([1e4, 1e4, 1.0]), np.diag([0.1, 0.1, 1.0])]), np.zeros(2, int), lens[:2]
    )
    assert (ends.down.tolist(), ends.across.tolist()) == ([0, 95], [0, 95])


@pytest.mark.parametrize('samples', [2, 3])
def test_the_middle_of_a_cell_counts_as_much_as_all_of_it(samples):
    fit = TemplateFit(codes_of(2), samples)
    patch = np.random.default_rng(2).uniform(0, 255, (2, fit.count**2)).astype(np.float32)
    cells = fit.cells(patch)
    square = patch.reshape(2, fit.count, fit.count)
    for row in range(fit.codes.side):
        for column in range(fit.codes.side):
            top, left = 1 + row * samples, 1 + column * samples
            part = square[:, top : top + samples, left : left + samples]
            middle = part[:, samples // 2, samples // 2]
            expected = (middle + part.mean(axis=(1, 2))) / 2.0
            assert cells[:, row, column] == pytest.approx(expected, rel=1e-5)


def scene(fit, quads, entries, contrasts):
    """Return an image of codes on grey, each pixel the mean of 25 places in it."""
    height, width, part = 90, 230, 5
    y, x = (np.mgrid[: height * part, : width * part] + 0.5) / part - 0.5
    image = np.full(x.shape, 110.0)
    side = fit.codes.side
    for homography, entry, contrast in zip(homographies_of(quads), entries, contrasts, strict=True):
        back = np.linalg.inv(homography)
        u, v, w = (back[n, 0] * x + back[n, 1] * y + back[n, 2] for n in range(3))
        column = np.floor((u / w + 1.0) * side / 2.0).astype(int) + 1
        row = np.floor((v / w + 1.0) * side / 2.0).astype(int) + 1
        within = (column >= 0) & (column < side + 2) & (row >= 0) & (row < side + 2)
        image[within] = 110.0 + contrast * fit.codes.cells[entry][row[within], column[within]]
    return np.rint(image.reshape(height, part, width, part).mean(axis=(1, 3))).astype(np.uint8)


def test_codes_are_aligned_with_the_image_whatever_their_contrast():
    fit = TemplateFit(codes_of(8))
    quads = np.stack(
        [
            SQUARE * 14.0 + (40.0, 50.0) + [(0.0, 0.3), (-2.0, 1.0), (0.5, -1.0), (2.0, 0.0)],
            SQUARE * 11.0 + (110.3, 60.2),
            SQUARE @ [[12.0, 5.0], [-5.0, 12.0]] + (190.0, 55.0),
        ]
    )
    entries = np.array([0, 13, 30])
    pyramid = ImagePyramid(scene(fit, quads, entries, (90.0, 25.0, 60.0)))
    moved = np.random.default_rng(5).uniform(-1.0, 1.0, quads.shape)
    start = homographies_of(quads + moved)
    blur = np.full((3, 2), 0.3)
    result = fit.refine(pyramid, start, entries, blur, 12)
    assert result[:, 2, 2] == pytest.approx(1.0)
    assert np.abs(corners_of(result) - quads).max() < 0.2
    once = fit.refine(pyramid, start, entries, blur, 1)
    assert np.abs(corners_of(once) - quads).max() > np.abs(corners_of(result) - quads).max()
    assert np.abs(once - start).max() > 1e-3
    assert fit.refine(pyramid, start, entries, blur, 0) is start
    # from the goal on nothing moves
    again = fit.refine(pyramid, result, entries, blur, 3)
    assert np.abs(corners_of(again) - corners_of(result)).max() < 0.05
    # each is aligned by itself
    alone = fit.refine(pyramid, start[1:2], entries[1:2], blur[1:2], 12)
    assert corners_of(alone) == pytest.approx(corners_of(result[1:2]), abs=0.02)


def test_what_lies_beyond_the_image_neither_counts_nor_moves_a_code():
    codes = codes_of(5)
    fit = TemplateFit(codes)
    quad = 24.0 * SQUARE + (59.5, 59.5)
    columns = np.clip((np.arange(120) - 36 + 8) // 8, 0, 7)
    entries, blur = np.array([6]), np.full((1, 2), 0.8)
    whole = (40.0 + 160.0 * (codes.cells[6][columns][:, columns] > 0)).astype(np.uint8)
    for cut in (120, 84, 80):
        image = whole[:, :cut].copy()
        # what is repeated beyond the edge is not what is there
        image[:, -1] = np.where(np.arange(120) % 8 < 4, 255, 0)
        pyramid, truth = ImagePyramid(image), homographies_of(quad[None])
        start = homographies_of(quad[None] + (1.5, -1.0))
        agreed = fit.agreement(
            pyramid, np.concatenate([truth, start]), entries[[0, 0]], blur[[0, 0]]
        )
        assert agreed[0] > 0.97
        assert agreed[1] < agreed[0] - 0.02
        found = fit.refine(pyramid, start, entries, blur, 8)
        assert np.abs(corners_of(found)[0] - quad).max() < 0.5
