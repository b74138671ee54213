"""Which marker a quadrilateral shows, and where exactly: matching of blurred codes.

The usual way to read a marker samples each cell and votes black or white, which needs two or three
pixels a cell. Here an image patch is compared with what each code of the dictionary would look
like through the same lens: a code's cells blurred by one pixel's footprint. As that blur is taken
as separable in the marker's own axes, all codes are compared by a few small matrix products. The
homography of the best ones is then aligned with the image by the inverse-compositional
Gauss-Newton method (Baker and Matthews, "Lucas-Kanade 20 years on", IJCV 56(3), 2004), all
candidates at once, with brightness and contrast projected out.

Marker coordinates: the black square spans [-1, 1] in x (right) and y (down).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from marker_detection.dictionaries import MarkerCodes
from marker_detection.image_sampling import (
    Array,
    ImagePyramid,
    Indices,
    Patches,
    homogeneous,
    jacobians_of,
    levels_for,
)

_MARGIN_SAMPLES = 1
_LEVEL_CELL_PIXELS = 4.0
_DAMPING = 1e-3
_LARGEST_STEP = 0.4
_SHORTLIST = 12
_SETTLED = 2e-3
_DEVIATIONS = np.geomspace(0.02, 2.0, 96)


class PixelFootprint(NamedTuple):
    """Blur of candidates in marker units, as rows (m,) of the table of profiles."""

    down: Indices
    across: Indices

    def chosen(self, which: Indices) -> PixelFootprint:
        """Return the blur of some of the candidates."""
        return PixelFootprint(self.down[which], self.across[which])


class TemplateFit:
    """Compares quadrilaterals of an image with the codes of a dictionary.

    Args:
        codes: The dictionary.
        samples: Samples along a side of a cell.

    Attributes:
        codes: The dictionary.
        count: Samples along a side of a patch.
    """

    def __init__(self, codes: MarkerCodes, samples: int = 3) -> None:
        self.codes = codes
        self._samples = samples
        cells = codes.side + 2
        self._flat = codes.cells.reshape(len(codes.ids), cells * cells)
        # border and margin are the same in all codes
        self._own = np.flatnonzero((self._flat != self._flat[0]).any(axis=0))
        self._own_cells = np.ascontiguousarray(self._flat[:, self._own])
        step = 2.0 / codes.side / samples
        self.count = codes.side * samples + 2 * _MARGIN_SAMPLES
        positions: Array = (np.arange(self.count, dtype=float) - (self.count - 1) / 2.0) * step
        x, y = (each.ravel() for each in np.meshgrid(positions, positions))
        self._grid = homogeneous(np.stack([x, y]))
        within = np.abs(positions) < 1.0 - 2.0 * codes.border / codes.side
        self._inside = np.outer(within, within).ravel()
        zero, one = np.zeros_like(x), np.ones_like(x)
        # derivative of the warped position by the eight parameters of a homography near identity
        self._warp_x = np.stack([x, y, one, zero, zero, zero, -x * x, -x * y]).astype(np.float32)
        self._warp_y = np.stack([zero, zero, zero, x, y, one, -x * y, -y * y]).astype(np.float32)
        self._profile, self._slope = _profiles(positions, codes.side)
        self._gram = self._profile.transpose(0, 2, 1) @ self._profile
        self._sum = self._profile.sum(axis=1)

    def levels(self, homographies: Array) -> Indices:
        """Return how often to halve the image before each candidate is read."""
        return levels_for(homographies, self.codes.side, _LEVEL_CELL_PIXELS)

    def sample(self, pyramid: ImagePyramid, homographies: Array, levels: Indices) -> Patches:
        """Patches (m, n) of the image under each homography."""
        return pyramid.sample(homographies, self._grid, levels)

    def cells(self, patches: Patches) -> Patches:
        """Return values (m, side, side) of the marker's cells, their middles counting most."""
        side, step = self.codes.side, self._samples
        square = patches.reshape(-1, self.count, self.count)
        inside = square[:, _MARGIN_SAMPLES:-_MARGIN_SAMPLES, _MARGIN_SAMPLES:-_MARGIN_SAMPLES]
        parts = inside.reshape(-1, side, step, side, step)
        middle = parts[:, :, step // 2, :, step // 2]
        return np.asarray((middle + parts.mean(axis=(2, 4))) / 2.0)

    def footprint(self, homographies: Array, levels: Indices, blur: Array) -> PixelFootprint:
        """Blur of each candidate.

        Args:
            homographies: (m, 3, 3).
            levels: (m,) how often the image was halved.
            blur: Standard deviation of the lens's blur in pixels, (2,) or (m, 2) across and down
                the marker.
        """
        scale = 2.0 ** levels[:, None]
        # a pixel's own square (1/12), linear interpolation (1/6) and the lens
        variance = np.square(blur) + scale * scale / 4.0
        jacobians = jacobians_of(homographies)
        # lengths of the rows of the inverse
        rows = np.linalg.norm(jacobians[:, ::-1, ::-1], axis=1)
        deviation = rows * np.sqrt(variance) / np.abs(np.linalg.det(jacobians))[:, None]
        index = np.searchsorted(_DEVIATIONS, deviation).clip(0, len(_DEVIATIONS) - 1)
        return PixelFootprint(index[:, 1], index[:, 0])

    def score(
        self, patches: Patches, footprint: PixelFootprint, listed: Indices | None = None
    ) -> tuple[Indices, Patches]:
        """Return the most likely codes of each patch and their correlations, the best one first.

        Args:
            patches: (m, n) grey levels.
            footprint: Blur of each.
            listed: (m, j) entries to choose from; None for all codes.

        Returns:
            (m, j) entries and (m, j) correlations, j at most `_SHORTLIST`.
        """
        # the blur is separable, so the image is blurred by it once and compared with sharp codes:
        # the same sums as with each code blurred, for all codes in one product
        down, across = self._profile[footprint.down], self._profile[footprint.across]
        centred = patches - patches.mean(axis=1, keepdims=True)
        square = centred.reshape(-1, self.count, self.count)
        agreement = (down.transpose(0, 2, 1) @ square @ across).reshape(len(patches), -1)
        if listed is None:
            # the codes differ in their own cells only; by the codes' energies, which are nearly
            # equal, the few best are divided below
            everything = agreement[:, self._own] @ self._own_cells.T
            count = min(_SHORTLIST, everything.shape[1])
            listed = np.argpartition(everything, -count, axis=1)[:, -count:]
        rows = np.arange(len(patches))[:, None]
        codes = self._flat[listed]
        energy = self._energy(self.codes.cells[listed], footprint)
        spread = np.einsum('mn,mn->m', centred, centred)
        scale = np.sqrt(np.maximum(energy * spread[:, None], 1e-6))
        correlation = (codes @ agreement[:, :, None])[:, :, 0] / scale
        order = np.argsort(-correlation, axis=1)
        return listed[rows, order], correlation[rows, order]

    def inner_correlations(
        self, patches: Patches, entries: Indices, footprint: PixelFootprint
    ) -> Patches:
        """Correlations (m, j) of codes (m, j) over their own cells, without border and margin."""
        count, listed = entries.shape
        repeated = PixelFootprint(footprint.down.repeat(listed), footprint.across.repeat(listed))
        drawn = self._render(entries.ravel(), repeated)[:, self._inside]
        drawn = drawn.reshape(count, listed, drawn.shape[1])
        seen = patches[:, self._inside]
        drawn = drawn - drawn.mean(axis=2, keepdims=True)
        seen = seen - seen.mean(axis=1, keepdims=True)
        energy = np.einsum('mjn,mjn->mj', drawn, drawn)
        energy = energy * np.einsum('mn,mn->m', seen, seen)[:, None]
        product = np.einsum('mjn,mn->mj', drawn, seen)
        return np.asarray(product / np.sqrt(np.maximum(energy, 1e-6)))

    def refine(
        self,
        pyramid: ImagePyramid,
        homographies: Array,
        entries: Indices,
        blur: Array,
        iterations: int,
    ) -> Array:
        """Homographies (m, 3, 3) aligned so that the codes lie on the image.

        Samples beyond the image's edge do not count: what is repeated there is neither the margin
        nor the border, and would draw the code towards it.
        """
        levels = self.levels(homographies)
        footprint = self.footprint(homographies, levels, blur)
        # inverse compositional: the template is moved instead of the image, so that its slopes
        # and the Hessian are made once for all iterations
        flat = self._render(entries, footprint)
        steepest = self._steepest(entries, footprint)
        flat -= flat.mean(axis=1, keepdims=True)
        steepest -= steepest.mean(axis=2, keepdims=True)
        self._leave_out_what_is_beyond(pyramid, homographies, levels, flat, steepest)
        energy = np.maximum(np.einsum('mn,mn->m', flat, flat), 1e-6)
        # brightness and contrast are no movement: what of a slope looks like them is taken away
        along = (steepest @ flat[:, :, None]) / energy[:, None, None]
        steepest -= along * flat[:, None]
        hessian = (steepest @ steepest.transpose(0, 2, 1)).astype(np.float64)
        # a code with few edges in one direction says little of some parameters
        damping = _DAMPING * np.trace(hessian, axis1=1, axis2=2) / 8.0 + 1e-9
        hessian += damping[:, None, None] * np.eye(8)
        solve = np.linalg.inv(hessian).astype(np.float32)
        result = homographies
        for _ in range(iterations):
            patches = self.sample(pyramid, result, levels)[:, :, None]
            contrast = (flat[:, None] @ patches)[:, 0, 0] / energy
            contrast = np.where(np.abs(contrast) < 1.0, 1.0, contrast)
            change = np.asarray((solve @ (steepest @ patches))[:, :, 0], dtype=float)
            change /= contrast[:, None]
            # the slopes hold within about a cell
            largest = np.abs(change).max(axis=1, keepdims=True)
            change *= np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, 1e-9))
            result = np.asarray(result @ np.linalg.inv(_warps(change)))
            result = result / result[:, 2:, 2:]
            if largest.max(initial=0.0) < _SETTLED:
                break
        return result

    def agreement(
        self, pyramid: ImagePyramid, homographies: Array, entries: Indices, blur: Array
    ) -> Patches:
        """Correlations (m,) of codes (m,) with what of them is in the image."""
        levels = self.levels(homographies)
        drawn = self._render(entries, self.footprint(homographies, levels, blur))
        drawn -= drawn.mean(axis=1, keepdims=True)
        seen = self.sample(pyramid, homographies, levels)
        seen -= seen.mean(axis=1, keepdims=True)
        self._leave_out_what_is_beyond(pyramid, homographies, levels, drawn, seen)
        sizes = np.einsum('mn,mn->m', drawn, drawn) * np.einsum('mn,mn->m', seen, seen)
        return np.asarray(np.einsum('mn,mn->m', drawn, seen) / np.sqrt(np.maximum(sizes, 1e-6)))

    def _leave_out_what_is_beyond(
        self, pyramid: ImagePyramid, homographies: Array, levels: Indices, *values: Patches
    ) -> None:
        """Set what belongs to samples (m, n) or (m, k, n) to 0 beyond the image's edge.

        What is left of each has a mean of 0 again.
        """
        corners = self._grid[:, [0, self.count - 1, -self.count, -1]]
        near = np.flatnonzero(~pyramid.shown(homographies, corners, levels).all(axis=1))
        if not len(near):
            return
        shown = pyramid.shown(homographies[near], self._grid, levels[near]).astype(np.float32)
        count = np.maximum(shown.sum(axis=1, keepdims=True), 1.0)
        for each in values:
            wide = (len(near), *[1] * (each.ndim - 2), -1)
            part = shown.reshape(wide)
            left = each[near] * part
            each[near] = left - part * left.sum(axis=-1, keepdims=True) / count.reshape(wide)

    def _render(self, entries: Indices, footprint: PixelFootprint) -> Patches:
        down, across = self._profile[footprint.down], self._profile[footprint.across]
        drawn = down @ self.codes.cells[entries] @ across.transpose(0, 2, 1)
        return np.asarray(drawn.reshape(len(entries), self.count**2))

    def _steepest(self, entries: Indices, footprint: PixelFootprint) -> Patches:
        """Change (m, 8, n) of the templates by each parameter of a homography."""
        cells = self.codes.cells[entries]
        down, across = self._profile[footprint.down], self._profile[footprint.across]
        slope_x = down @ cells @ self._slope[footprint.across].transpose(0, 2, 1)
        slope_y = self._slope[footprint.down] @ cells @ across.transpose(0, 2, 1)
        flat = (len(entries), 1, self.count * self.count)
        return np.asarray(
            slope_x.reshape(flat) * self._warp_x + slope_y.reshape(flat) * self._warp_y
        )

    def _energy(self, cells: Patches, footprint: PixelFootprint) -> Patches:
        """Sum of squares (m, j) of the centred templates of codes (m, j, rows, columns)."""
        count, listed, side, _ = cells.shape
        columns = cells.transpose(0, 2, 1, 3).reshape(count, side, listed * side)
        rows = (self._gram[footprint.down] @ columns).reshape(count, side * listed, side)
        weighed = rows @ self._gram[footprint.across]
        squares = np.einsum('mrjc,mjrc->mj', weighed.reshape(count, side, listed, side), cells)
        down, across = self._sum[footprint.down], self._sum[footprint.across]
        totals = ((cells @ across[:, None, :, None])[..., 0] @ down[:, :, None])[..., 0]
        return np.asarray(squares - totals * totals / self.count**2)


def _profiles(positions: Array, side: int) -> tuple[Patches, Patches]:
    """Return how far each cell reaches in each sample (deviations, samples, cells), and its
    slope.
    """
    edges = np.linspace(-1.0 - 2.0 / side, 1.0 + 2.0 / side, side + 3)
    # the white margin is taken to go on beyond its cell
    edges[0], edges[-1] = -1e3, 1e3
    reach = (edges - positions[:, None]) / _DEVIATIONS[:, None, None]
    profile = np.diff(ndtr(reach), axis=2)
    density = np.exp(-0.5 * np.minimum(np.square(reach), 80.0)) / np.sqrt(2.0 * np.pi)
    slope = -np.diff(density / _DEVIATIONS[:, None, None], axis=2)
    return profile.astype(np.float32), slope.astype(np.float32)


def _warps(parameters: Array) -> Array:
    result = np.zeros((len(parameters), 3, 3))
    result[:, 0] = parameters[:, :3]
    result[:, 1] = parameters[:, 3:6]
    result[:, 2, :2] = parameters[:, 6:]
    return result + np.eye(3)
