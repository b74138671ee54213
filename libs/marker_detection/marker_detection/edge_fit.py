"""The sides of a marker's border, found in the image.

Across each side the steepest rise from dark to light is looked for at some places, and a curve
laid through them; places far from the curve count less (iteratively reweighted least squares with
Cauchy's weights: Holland and Welsch, "Robust regression using iteratively reweighted
least-squares", Communications in Statistics A6, 1977). Where a side shows no such rise, as where
the image ends at it, it stays where it was.

`EdgeFit` moves the sides of outlines that are wrong by up to a cell. `SharpEdges` follows the sides
of what was read from halved images into the image itself, from level to level, each time with half
the reach: what lies beyond the margin, and the image's own edge, stay out of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from marker_detection.image_sampling import (
    Array,
    ImagePyramid,
    Indices,
    Patches,
    Quads,
    Reals,
    beside_sides,
    cell_widths,
    homogeneous,
    homographies_of,
    levels_for,
)

# What is said of corners below is their median error in 126 images of `benchmarks/marker_steps.py`
# (0.085 pixels), and the largest of 60 markers that the image's edge cuts or nearly cuts, as
# `benchmarks/perception.py` renders them (1.6 pixels). Half or twice of a number without such a
# remark changes the median by at most 0.01 pixels.

# image pixels a cell has at most where outlines are moved, and how far that looks, in cells
_CELL_PIXELS, _REACH = 6.0, 1.2
# the same of the first level at which sharp edges are looked for, and pixels a cell has at least:
# with half the pixels the median is 0.11, with half the reach 0.13; with 10 pixels at least 0.15
_FIRST_PIXELS, _FIRST_REACH, _LEAST_PIXELS = 8.0, 0.5, 5.0
# cells from an outline within which its edge is looked for, to tell whether it lies right
_NEAR = 0.25
# what a part of an outline counts that is not in the image
_UNSEEN = 0.5
# steps across a side: a tenth of the first reach each
_STEPS = 13
# share of a side's reach from its curve at which a place counts half
_STRAIGHTNESS = 0.125
# the steepest slope of a side, and its largest bow, in marker units: paper bends, and lenses do;
# of flat markers a straight line would do better at the image's edge (1.0)
_STEEPEST, _LARGEST_BOW = 0.5, 0.1
# share of the marker's steepest rise below which a place shows no edge
_LEAST_RISE = 0.12
# what a place without an edge counts, as a share of one with the steepest: with nothing a few
# places decide where a side runs that the image's edge cuts (8.2)
_STAYS = 0.1
# share of a side that is in the image, below which it stays where it was
_LEAST_SEEN = 0.6
# how often corners are moved along sides that are not straight: each time brings them nearer by the
# product of two slopes
_APPROACHES = 4
_TOP, _RIGHT, _BOTTOM, _LEFT = range(4)


class _Sides(NamedTuple):
    """Where the sides of squares are: `1 + shift + slope t + bow t^2` outwards at t along them.

    All in marker units.

    Attributes:
        shift: (m, 4) top, right, bottom, left.
        slope: (m, 4).
        bow: (m, 4).
    """

    shift: Array
    slope: Array
    bow: Array

    def out(self, side: int, along: Array) -> Array:
        """Return how far out (m,) a side is at places (m,) along it."""
        bend = self.slope[:, side] + self.bow[:, side] * along
        return np.asarray(1.0 + self.shift[:, side] + bend * along)


class _Scan:
    """Looks across the sides of squares for their edges.

    Args:
        side: Cells along a side.
        reach: Cells that it looks inwards and outwards.
        places: How many places along each side.
        order: Of the curve through them: 1 a straight line, 2 a parabola.
    """

    def __init__(self, side: int, reach: float, *, places: int, order: int) -> None:
        self._side = side
        self._along = np.linspace(-0.9, 0.9, places)
        self._powers = np.stack([self._along**power for power in range(order + 1)], axis=1)
        across = np.linspace(-reach, reach, _STEPS) * 2.0 / side
        self._across = across[1:-1]
        self._spread = 2.0 / side * reach * _STRAIGHTNESS
        self._grid = homogeneous(beside_sides(self._along, 1.0 + across))
        # a little inwards: a side may be in the image though its outline is not, which may be a few
        # pixels wrong
        self._within = self.outline(-reach / 4.0)

    def outline(self, cells: float) -> Patches:
        """Return the places (3, 4 * places) so many cells outwards from the sides."""
        out = np.array([1.0 + 2.0 / self._side * cells])
        return homogeneous(beside_sides(self._along, out))

    def edges(
        self, pyramid: ImagePyramid, homographies: Array, levels: Indices
    ) -> tuple[Patches, Patches]:
        """Return how steep the edge is at each place of each side, and where: both (m, 4, places).

        In grey levels over two steps, and in marker units outwards.
        """
        values = pyramid.sample(homographies, self._grid, levels)
        values = values.reshape(len(values), 4, len(self._along), _STEPS)
        # from dark to light on the way out: the code's own edges in the border's other direction
        # do not attract it. Central differences: each rise is that at the step between
        rise = np.maximum(values[..., 2:] - values[..., :-2], 0.0)
        steepest = rise.max(axis=3)
        # to a part of a step: an edge is blurred over several, so the centre of gravity counts, of
        # the squares of what rises at least half as steeply
        near = np.square(rise * (rise > 0.5 * steepest[..., None])) + 1e-9
        return steepest, (near * self._across).sum(axis=3) / near.sum(axis=3)

    def sides(self, pyramid: ImagePyramid, homographies: Array, levels: Indices) -> _Sides:
        """Return the curves along the edges that are nearest to the squares' sides."""
        steepest, found = self.edges(pyramid, homographies, levels)
        # what is repeated beyond the image's edge rises, too, where that is crossed aslant
        inside = pyramid.shown(homographies, self._within, np.zeros_like(levels))
        inside = inside.reshape(steepest.shape)
        steepest = np.where(inside, steepest, 0.0)
        most = np.maximum(steepest.max(axis=(1, 2), keepdims=True), 1e-6)
        shown = steepest > _LEAST_RISE * most
        # where no edge shows, the side rather is where it was
        found = np.where(shown, found, 0.0)
        weight = np.where(shown, steepest / most, _STAYS)
        curve = self._curve(found, weight)
        for _ in range(2):
            residual = (found - curve @ self._powers.T) / self._spread
            curve = self._curve(found, weight / (1.0 + np.square(residual)))
        # of a side of which little is seen, the rest of the marker says more
        curve = np.where(inside.mean(axis=2)[..., None] < _LEAST_SEEN, 0.0, curve)
        slope = np.clip(curve[..., 1], -_STEEPEST, _STEEPEST)
        bow = np.zeros_like(slope)
        if curve.shape[2] > 2:
            bow = np.clip(curve[..., 2], -_LARGEST_BOW, _LARGEST_BOW)
        return _Sides(curve[..., 0], slope, bow)

    def _curve(self, height: Reals, weight: Reals) -> Array:
        """Return the coefficients (m, 4, k) of weighted curves through places (m, 4, n)."""
        weighed = weight[..., None] * self._powers
        normal = np.swapaxes(weighed, 2, 3) @ self._powers
        # not singular, whatever the places count
        normal += 1e-9 * np.eye(normal.shape[-1])
        moments = np.swapaxes(weighed, 2, 3) @ height[..., None]
        return np.asarray(np.linalg.solve(normal, moments)[..., 0], float)


class EdgeFit:
    """Moves the sides of quadrilaterals onto the outer edges of a border of `side` cells.

    A hull is wrong by up to a cell where something dark touches the marker, or light ate a corner.
    """

    def __init__(self, side: int) -> None:
        self._side = side
        self._scan = _Scan(side, _REACH, places=10, order=1)

    def fitted(self, pyramid: ImagePyramid, quads: Quads) -> Quads:
        """Return quads (m, 4, 2) with their sides on the edges nearest to them."""
        homographies = homographies_of(quads)
        levels = levels_for(homographies, self._side, _CELL_PIXELS)
        return _corners_between(homographies, self._scan.sides(pyramid, homographies, levels))


class SharpEdges:
    """Follows the sides of a border of `side` cells from a halved image into the image itself."""

    def __init__(self, side: int) -> None:
        self._side = side
        self._near = _Scan(side, _FIRST_REACH, places=10, order=1)
        self._scans: list[_Scan] = []

    def followed(self, pyramid: ImagePyramid, quads: Quads) -> Quads:
        """Return quads (m, 4, 2) of large markers with their sides where the image has them.

        Those whose cells are smaller than 5 pixels are returned as they are: the whole code says
        more of them than a few pixels of its border.
        """
        quads = quads.copy()
        homographies = homographies_of(quads)
        levels = levels_for(homographies, self._side, _FIRST_PIXELS)
        # below every step's level: left out of all of them
        levels[cell_widths(homographies, self._side) < _LEAST_PIXELS] = -2
        # once more in the image itself: what lay at the end of the reach was seen in part
        for step in range(int(levels.max(initial=-2)) + 2):
            if len(self._scans) <= step:
                reach = _FIRST_REACH / 2.0**step
                self._scans.append(_Scan(self._side, reach, places=20, order=2))
            large = np.flatnonzero(levels >= step - 1)
            homographies = homographies_of(quads[large])
            sides = self._scans[step].sides(
                pyramid, homographies, np.maximum(levels[large] - step, 0)
            )
            quads[large] = _corners_between(homographies, sides)
        return quads

    def explained(self, pyramid: ImagePyramid, quads: Quads) -> Array:
        """Return which share (m,) of each outline lies on an edge from dark to light.

        What is not in the image counts half.
        """
        homographies = homographies_of(quads)
        levels = levels_for(homographies, self._side, _FIRST_PIXELS)
        steepest, found = self._near.edges(pyramid, homographies, levels)
        typical = np.median(steepest.reshape(len(quads), -1), axis=1)[:, None, None]
        lies = (steepest > _LEAST_RISE * typical) & (np.abs(found) < _NEAR * 2.0 / self._side)
        in_image = pyramid.shown(homographies, self._near.outline(0.0), np.zeros_like(levels))
        # where the margin is not in the image that is read, no edge can be seen: that is no doubt
        margin = pyramid.shown(homographies, self._near.outline(_NEAR), levels)
        lies |= ~margin.reshape(lies.shape)
        counts = np.where(in_image.reshape(lies.shape), lies, _UNSEEN)
        return np.asarray(counts.mean(axis=(1, 2)))


def _corners_between(homographies: Array, sides: _Sides) -> Quads:
    """Return the corners (m, 4, 2) in pixels where the sides of squares meet."""
    corners = np.ones((len(homographies), 4, 3))
    for index, (level, upright) in enumerate(
        [(_TOP, _LEFT), (_TOP, _RIGHT), (_BOTTOM, _RIGHT), (_BOTTOM, _LEFT)]
    ):
        down = -1.0 if level == _TOP else 1.0
        across = -1.0 if upright == _LEFT else 1.0
        x, y = np.full(len(corners), across), np.full(len(corners), down)
        for _ in range(_APPROACHES):
            x, y = across * sides.out(upright, y), down * sides.out(level, x)
        corners[:, index, 0], corners[:, index, 1] = x, y
    pixels = corners @ homographies.transpose(0, 2, 1)
    depth = np.where(np.abs(pixels[..., 2:]) < 1e-6, 1e-6, pixels[..., 2:])
    return np.asarray(pixels[..., :2] / depth)
