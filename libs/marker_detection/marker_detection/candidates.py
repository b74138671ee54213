"""Four-sided dark outlines in a grey image: where a marker could be.

A marker's black border is one dark blob on its white margin, so its outline is found by local
thresholding and the convex hull of each dark blob is cut down to the smallest quadrilateral around
it. Hulls survive what breaks polygon approximation on small and oblique markers: the corners are a
few tenths of a pixel wrong, which `template_fit` repairs, but they are there. `edge_fit` moves the
sides of those that are wrong by up to a cell.

Of the hundreds of dark outlines in a textured image only a few pass `BorderCheck`, and every marker
that can be read does. A candidate costs 121 samples there and some thousands in `template_fit`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from marker_detection.image_sampling import (
    Array,
    Grey,
    ImagePyramid,
    Indices,
    Quads,
    beside_sides,
    halved,
    homogeneous,
    levels_for,
)

Outline = npt.NDArray[Any]

# pixels across the narrowest blob
_LEAST_WIDTH = 2.0
# how far from a parallelogram's scatter outlines are looked at in a crowd, and how scattered one
# may be elsewhere: those of small markers touch something or miss a corner
_QUAD_DEVIATION, _MOST_SCATTER = 0.35, 8.0
# an outline runs through the middles of the outermost dark pixels
_INSET = 0.5
# sine between sides below which a corner is not moved further: it would leave the image
_LEAST_SINE = 0.3
# pixels that are taken from blobs that touch at their corners, to part them
_ERODED = (1, 2)
# neighbourhood in pixels from which the halved image does, and the least one that has a middle
_WIDE_WINDOW, _LEAST_WINDOW = 21, 3
# pixels of an image that is looked at coarsely first. In front of textures that halves the time for
# 12 million pixels, and finds there 32 instead of 36 of 37 markers of 10 to 16 pixels; of
# larger ones all
_LARGE_IMAGE = 4e6
# blobs with one box to so many pixels, and quadrilaterals with one size to this share, are the same
_SAME_BOX, _SAME_SIZE = 3, 0.06
# a box's four places, each below 2^15 pixels, in one number
_BOX_PLACES = 1 << np.array([0, 15, 30, 45])
# places that `BorderCheck` looks at along each side, and along each side of the code
_PER_SIDE, _INNER = 6, 5
# cells beyond the border at which its white margin is looked for: a pixel of a large marker too
_MARGINS = (0.07, 0.2, 0.5)
# image pixels a cell has at most where borders are looked at
_CELL_PIXELS = 6.0
# what passes: correlation of border and margin, contrast of the two worst sides as shares of all,
# and deviation within the code: beyond a missing margin may lie what is far brighter than print,
# or a thin one half darker
_LEAST_CORRELATION = 0.68
_LEAST_SIDE, _WORST_SIDE = 0.15, 0.5
_LEAST_INNER_DEVIATION, _MOST_INNER_DEVIATION = 0.1, 2.0


class Mask(NamedTuple):
    """What is dark in an image.

    Attributes:
        pixels: (height, width) not 0 where it is dark.
        scale: Factor by which it is smaller than the image.
        eroded: Pixels that were taken from the edge of every blob.
        bridged: Whether gaps were closed in it.
    """

    pixels: Grey
    scale: int = 1
    eroded: int = 0
    bridged: bool = False


def dark_masks(
    image: Grey,
    windows: Sequence[int],
    contrast: float,
    bridges: Sequence[int],
    *,
    touching: bool = False,
) -> Iterator[Mask]:
    """Masks of what is dark, the most telling first.

    Args:
        image: (height, width) grey levels.
        windows: Sides in pixels of the neighbourhoods that a border is compared with, odd; one
            mask for each, in their order. Wide ones, which only large markers need, are taken
            from the halved image. Of a large image the halved one comes first: a crowd in it ends
            the search before the image itself is looked at, as in ArUco's third version
            (Romero-Ramirez et al., "Speeded up detection of squared fiducial markers", Image and
            Vision Computing 76, 2018).
        contrast: How many grey levels darker.
        bridges: Lengths in pixels of gaps to close in the narrowest window's mask, along columns
            and along rows, each in a mask of its own: a marker seen at a flat angle has a border
            thinner than a pixel, which breaks at white rows of its code. A wider window would not
            part it from the wall beyond its margin.
        touching: Whether markers may touch at their corners, as in Kalibr's AprilGrids, where small
            black squares lie between them: each mask is eroded as well, which parts them.

    Yields:
        A mask for each window; one of what is darker than a quarter of white, and one split where
        the image's grey levels part best: a shadow's edge, which is dark beside the light, is
        still brighter than ink in the light. Then the masks with gaps closed.
    """
    half = halved(image)
    white = float(np.percentile(half[::4, ::4], 98.0))
    large = image.size > _LARGE_IMAGE
    black = cv2.threshold(half if large else image, white / 4.0, 255, cv2.THRESH_BINARY_INV)[1]
    yield Mask(_without_specks(_bytes(black)), 2 if large else 1)
    if large:
        for window in windows:
            if (halved_window := _half_window(window)) > _LEAST_WINDOW:
                yield Mask(_darker_than_around(half, halved_window, contrast), 2)
    full_size: list[Grey] = []
    for window in windows:
        wide = window >= _WIDE_WINDOW and window > min(windows)
        if wide:
            # of a large image that mask was among the first
            if not large:
                yield Mask(_darker_than_around(half, _half_window(window), contrast), 2)
        else:
            full_size.append(_darker_than_around(image, window, contrast))
            yield Mask(full_size[-1])
    split, parted = cv2.threshold(half, 0, 255, cv2.THRESH_BINARY_INV + cv2.THRESH_OTSU)
    yield Mask(_without_specks(_bytes(parted)), 2)
    if touching:
        whole = _bytes(cv2.threshold(image, split, 255, cv2.THRESH_BINARY_INV)[1])
        for dark in (*full_size, whole):
            for width in _ERODED:
                kernel = np.ones((2 * width + 1, 2 * width + 1), np.uint8)
                yield Mask(_bytes(cv2.erode(dark, kernel)), 1, width)
    for length in bridges:
        for dark in full_size:
            for shape in ((length, 1), (1, length)):
                closed = cv2.morphologyEx(dark, cv2.MORPH_CLOSE, np.ones(shape, np.uint8))
                yield Mask(_bytes(closed), bridged=True)


def _half_window(window: int) -> int:
    """Return the odd side of a neighbourhood in the halved image."""
    return max(_LEAST_WINDOW, window // 4 * 2 + 1)


def _bytes(image: npt.NDArray[Any]) -> Grey:
    """Return what OpenCV gives, whose pixels are bytes like those of what it was given."""
    return np.asarray(image, np.uint8)


def _darker_than_around(image: Grey, window: int, contrast: float) -> Grey:
    """Return where an image is darker than the mean of its neighbourhood, without specks."""
    mask = cv2.boxFilter(image, -1, (window, window), borderType=cv2.BORDER_REPLICATE)
    cv2.subtract(mask, image, dst=mask)
    cv2.threshold(mask, contrast - 0.5, 255, cv2.THRESH_BINARY, dst=mask)
    return _without_specks(_bytes(mask))


def _without_specks(mask: Grey) -> Grey:
    """Return a mask without blobs of one or two pixels.

    They are noise, and each would cost an outline.
    """
    # each pixel of a larger blob has two more of its pixels within two steps
    near = cv2.boxFilter(mask, -1, (5, 5))
    cv2.threshold(near, 2.5 * 255 / 25, 255, cv2.THRESH_BINARY, dst=near)
    return np.asarray(cv2.bitwise_and(mask, near, dst=near))


def quads_around(
    masks: Iterable[Mask],
    *,
    min_length: float = 8.0,
    limit: float = math.inf,
    crowd: float = math.inf,
) -> Quads:
    """Quadrilaterals around the blobs of masks.

    Args:
        masks: What is dark. A blob with the same upright box as one before is left out.
        min_length: Longer side in pixels of the smallest blob's upright box.
        limit: Once so many blobs were looked at, in the first mask or in all others, only those
            with a parallelogram's moments are; after the others, no further mask.
        crowd: Once so many were, no gaps are bridged: in clutter at VGA that takes a third of the
            time, and finds one more of 120 markers at 55 to 82 degrees.

    Returns:
        (n, 4, 2) corners in pixels, clockwise as seen.
    """
    found: list[Quads] = []
    seen: set[int] = set()
    for order, (mask, scale, eroded, bridged) in enumerate(masks):
        # the first mask is of black alone: what it shows is no reason to look at less elsewhere
        if order == 1:
            seen.clear()
        if len(seen) > (min(limit, crowd) if bridged else limit):
            break
        blobs = _blobs_in(mask, min_length / scale, _LEAST_WIDTH)
        if blobs is None:
            continue
        outlines, boxes, scatter = blobs
        # the likeliest blobs first, so that the limit costs what is least like a marker
        unlike = np.abs(scatter - 1.0)
        kept = np.argsort(unlike)
        kept = kept[scatter[kept] < _MOST_SCATTER]
        places = ((boxes[kept] * scale // _SAME_BOX) @ _BOX_PLACES).tolist()
        fresh = []
        for index, place in zip(kept.tolist(), places, strict=True):
            if len(seen) > limit and unlike[index] > _QUAD_DEVIATION:
                break
            if place not in seen:
                seen.add(place)
                fresh.append(outlines[index])
        quads = _quads_around(fresh)
        if len(quads):
            # a pixel's middle has whole coordinates, in a halved image as well
            grown = _grown(_clockwise(quads), _INSET + eroded)
            found.append((grown + 0.5) * scale - 0.5)
    return np.concatenate(found) if found else np.zeros((0, 4, 2))


class _Blobs(NamedTuple):
    """Outlines of a mask's blobs and of the holes in them.

    Attributes:
        outlines: (n, 1, 2) points of each.
        boxes: (k, 4) left, top, right, bottom of each.
        scatter: (k,) 1 for a parallelogram, 0.91 for an ellipse, 1.33 for a triangle, the more,
            the further a blob's parts lie from its middle; far above these for a hole. It is the
            first affine moment invariant (Flusser and Suk, "Pattern recognition by affine moment
            invariants", Pattern Recognition 26(1), 1993), relative to a parallelogram's.
    """

    outlines: list[Outline]
    boxes: Indices
    scatter: Array


def _blobs_in(mask: Grey, length: float, width: float) -> _Blobs | None:
    """Return a mask's blobs of at least a length and a width in pixels, measured all at once.

    One with far more corners than its box has pixels around it is no quadrilateral.
    """
    # in one pass over the rows; it traces blobs and holes in opposite directions. What has fewer
    # than four points is no quadrilateral: to join so many arrays would take long
    traced, _ = cv2.findContoursLinkRuns(mask)
    outlines = [outline for outline in traced if len(outline) >= 4]
    if not outlines:
        return None
    counts = np.fromiter(map(len, outlines), np.int64, len(outlines))
    x, y = np.concatenate(outlines)[:, 0].T.copy()
    starts = counts.cumsum() - counts
    left, right = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    top, bottom = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    wide, high = right - left + 1, bottom - top + 1
    large = (np.maximum(wide, high) >= length) & (np.minimum(wide, high) >= width)
    # a square has as many outline points as its box has pixels around it; foliage has far more
    large &= counts <= 3 * (wide + high)
    if not large.any():
        return None
    within = large.repeat(counts)
    boxes = np.stack([left, top, right + 1, bottom + 1], axis=1)[large].astype(np.int64)
    return _Blobs(
        [outlines[index] for index in np.flatnonzero(large).tolist()],
        boxes,
        _scatter(
            x[within] - left.repeat(counts)[within],
            y[within] - top.repeat(counts)[within],
            counts[large],
        ),
    )


def _scatter(x: Indices, y: Indices, counts: Indices) -> Array:
    """Return the scatter (k,) of polygons with so many corners (k,) each, (n,) in all.

    An outline of a hole has a negative area, which is taken for a small one.
    """
    starts = counts.cumsum() - counts
    x, y = x.astype(np.float32), y.astype(np.float32)
    u, v = np.roll(x, -1), np.roll(y, -1)
    u[starts + counts - 1], v[starts + counts - 1] = x[starts], y[starts]
    # moments of polygons by Green's theorem
    cross = x * v - u * y
    # in double precision: what is divided by the 1 of a large hole has squares beyond single
    area = np.maximum(np.add.reduceat(cross, starts) / 2.0, 1.0).astype(float)
    terms = (x + u, y + v, x * x + (x + u) * u, y * y + (y + v) * v)
    mean_x, mean_y, xx, yy = (np.add.reduceat(cross * term, starts) / area for term in terms)
    xy = np.add.reduceat(cross * (2.0 * (x * y + u * v) + x * v + u * y), starts) / area
    spread_x, spread_y = xx / 12.0 - (mean_x / 6.0) ** 2, yy / 12.0 - (mean_y / 6.0) ** 2
    spread_xy = xy / 24.0 - mean_x * mean_y / 36.0
    return np.asarray(144.0 * (spread_x * spread_y - spread_xy**2) / area**2)


def distinct(quads: Quads, distance: float) -> Indices:
    """Return the indices of the quads whose middle and size are not those of an earlier one.

    Args:
        quads: (m, 4, 2) corners in pixels, the best first.
        distance: How near middles are taken for the same, pixels.
    """
    middles = quads.mean(axis=1)
    sizes = np.linalg.norm(quads - middles[:, None], axis=2).mean(axis=1)
    # only neighbours are compared: a crowd has thousands of quads
    pairs = cKDTree(middles).query_pairs(distance, np.inf, output_type='ndarray')
    first, second = pairs[np.argsort(pairs[:, 0])].T
    alike = np.abs(sizes[first] - sizes[second]) < np.maximum(distance, _SAME_SIZE * sizes[second])
    kept = [True] * len(quads)
    for better, other in zip(first[alike].tolist(), second[alike].tolist(), strict=True):
        if kept[better]:
            kept[other] = False
    return np.flatnonzero(kept)


def _quads_around(outlines: Sequence[Outline]) -> Quads:
    """Return the smallest quadrilaterals (n, 4, 2) around outlines, of those that have one."""
    # of the hull, not of the outline: a border that touches something or lacks a corner has no
    # polygon of four corners, but its hull is cut down to one
    hulls = [np.asarray(cv2.convexHull(outline), np.float32) for outline in outlines]
    quads = [cv2.approxPolyN(hull, 4, None, -1.0, False) for hull in hulls if len(hull) >= 4]
    four = [quad for quad in quads if quad.shape[1] == 4]
    return np.concatenate(four).astype(float) if four else np.zeros((0, 4, 2))


def _clockwise(quads: Quads) -> Quads:
    first, second = quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 1]
    reversed_ = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0
    quads[reversed_] = quads[reversed_, ::-1]
    return quads


def _grown(quads: Quads, distance: float) -> Quads:
    """Quads (n, 4, 2), clockwise, with each side moved outwards by a distance in pixels."""
    along = np.roll(quads, -1, axis=1) - quads
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9)
    before = np.roll(along, 1, axis=1)
    sine = before[..., 0] * along[..., 1] - before[..., 1] * along[..., 0]
    # where both moved sides meet; a corner nearly straight or sharp is not moved without bound
    shift = (before - along) / np.maximum(sine, _LEAST_SINE)[..., None]
    return np.asarray(quads + distance * shift)


class BorderCheck:
    """Samples around the border of a marker of `side` cells along its black square."""

    def __init__(self, side: int) -> None:
        self._side = side
        along = np.linspace(-0.85, 0.85, _PER_SIDE)
        inner = np.linspace(-1.0, 1.0, _INNER) * (1.0 - 3.0 / side)
        cell = 2.0 / side
        points = [beside_sides(along, np.array([1.0 + cell * part])) for part in (*_MARGINS, -0.5)]
        points.append(np.stack([each.ravel() for each in np.meshgrid(inner, inner)]))
        self._grid = homogeneous(np.concatenate(points, axis=1))

    def correlation(
        self, pyramid: ImagePyramid, homographies: Array, least_contrast: float
    ) -> Array:
        """Return how well white margin and black border correlate with the image.

        Args:
            pyramid: The image.
            homographies: (m, 3, 3) from marker coordinates to pixels.
            least_contrast: Grey levels from black to white below which nothing is taken for a
                marker.

        Returns:
            (m,) 0 to 1; -1 where it can be no marker.
        """
        levels = levels_for(homographies, self._side, _CELL_PIXELS)
        values = pyramid.sample(homographies, self._grid, levels)
        count = 4 * _PER_SIDE
        rings = len(_MARGINS)
        margins = values[:, : rings * count].reshape(len(values), rings, count)
        border = values[:, rings * count : (rings + 1) * count]
        deviation = values[:, (rings + 1) * count :].std(axis=1)
        # a white margin may be thinner than half a cell: the brightest ring is it
        brightest = margins.mean(axis=2).argmax(axis=1)
        margin = margins[np.arange(len(margins)), brightest]
        contrast = margin.mean(axis=1) - border.mean(axis=1)
        # of a step of two levels with that spread around them
        variance = (margin.var(axis=1) + border.var(axis=1)) / 2.0
        correlation = contrast / np.sqrt(contrast**2 + 4.0 * variance + 1e-6)
        # a shadow, a thumb or the image's edge may spoil one side: the two worst are judged apart
        by_side = np.sort((margin - border).reshape(-1, 4, _PER_SIDE).mean(axis=2), axis=1)
        passed = (
            (contrast > least_contrast)
            & (correlation > _LEAST_CORRELATION)
            & (by_side[:, 1] > _LEAST_SIDE * contrast)
            & (by_side[:, 0] > -_WORST_SIDE * contrast)
            & (deviation > _LEAST_INNER_DEVIATION * contrast)
            & (deviation < _MOST_INNER_DEVIATION * contrast)
        )
        return np.where(passed, correlation, -1.0)
