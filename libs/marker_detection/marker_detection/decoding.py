"""Reading the codes of candidate quadrilaterals: match, align, match again, sharper or softer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marker_detection.cell_differences import CellDifferences, CellReadings
from marker_detection.dictionaries import MarkerCodes
from marker_detection.image_sampling import (
    Array,
    ImagePyramid,
    Indices,
    Patches,
    cell_widths,
)
from marker_detection.template_fit import PixelFootprint, TemplateFit

# along a side of a cell, until the likeliest codes are aligned
_ROUGH_SAMPLES = 2
_ROUGH_ITERATIONS = 5
_FINE_ITERATIONS = 3
_HYPOTHESES = 2
_RIVALS = 6
_SHOWN = 0.5
_LEAST_IF_SHOWN, _LEAST_IF_BLURRED = 0.65, 0.75
_HYPOTHESIS_RATIO = 1.7
_LEAST_ROUGH_CORRELATION = 0.76
# over the code's own cells, before and after the likeliest codes are aligned: the border alone
# makes much of the whole marker's correlation
_LEAST_INNER, _LEAST_ROUGH_INNER = 0.6, 0.68
_GOOD_CORRELATION = 0.98
# pixels a cell below which its middle tells, too, whether an alignment is better: the lens spreads
# what lies beyond the margin over all of that, which draws the outline outwards
_SMALL_CELL = 2.0
_STRONGER_BLURS = np.array([[1.6, 1.6], [2.4, 2.4], [0.8, 2.4], [2.4, 0.8]])


@dataclass(frozen=True, eq=False)
class Readings:
    """What candidates most likely show; arrays run over candidates.

    Attributes:
        homographies: (m, 3, 3) from marker coordinates to pixels, aligned with the image.
        entries: (m,) index of the best code.
        correlation: (m,) of the whole patch with that code, -1 to 1.
        inner: (m,) of the code's own cells only.
        lead: (m,) what the second best code leaves unexplained, as a multiple of what the best
            one does: 1 is a draw.
        inner_lead: (m,) the same of the code's own cells only.
        wrong: (m,) cells of the code that rather have the other colour.
        wrong_border: (m,) cells of the border that rather are white.
        error: (m,) probability that the differences between cells are this code's by chance, or
            another code's.
    """

    homographies: Array
    entries: Indices
    correlation: Patches
    inner: Patches
    lead: Patches
    inner_lead: Patches
    wrong: Indices
    wrong_border: Indices
    error: Array


class MarkerReader:
    """Reads codes from images.

    Args:
        codes: The codes to choose from.
        blur: Standard deviation in pixels of the lens's blur in a sharp image.

    Attributes:
        codes: The codes to choose from.
        fit: Compares images with them.
    """

    def __init__(self, codes: MarkerCodes, blur: float) -> None:
        self.codes = codes
        self._blur = blur
        self._rough = TemplateFit(codes, _ROUGH_SAMPLES)
        self.fit = TemplateFit(codes)
        self._differences = CellDifferences(codes)

    def read_cells(self, pyramid: ImagePyramid, homographies: Array) -> CellReadings:
        """Read candidates (m, 3, 3) by the differences between their cells."""
        levels = self.fit.levels(homographies)
        patches = self.fit.sample(pyramid, homographies, levels)
        return self._differences.read(self.fit.cells(patches))

    def aligned(self, pyramid: ImagePyramid, homographies: Array, cells: CellReadings) -> Array:
        """Homographies (m, 3, 3) moved to where what was read lies, unless that agrees less."""
        blur = np.full((len(homographies), 2), self._blur)
        moved = self.fit.refine(pyramid, homographies, cells.entries, blur, _ROUGH_ITERATIONS)
        # of the whole patch: the cells' middles hardly change within half a cell
        before, after = (
            self.fit.agreement(pyramid, each, cells.entries, blur) for each in (homographies, moved)
        )
        # Gauss-Newton steps may also lead away (Baker and Matthews, "Lucas-Kanade 20 Years On",
        # IJCV 56(3), 2004): what agrees less is not taken
        better = after >= before
        small = cell_widths(homographies, self.codes.side) < _SMALL_CELL
        if small.any():
            again = self.read_cells(pyramid, moved)
            same = again.entries == cells.entries
            better &= ~small | (same & (again.correlation >= cells.correlation))
        return np.where(better[:, None, None], moved, homographies)

    def read(
        self, pyramid: ImagePyramid, homographies: Array, cells: CellReadings
    ) -> Readings | None:
        """Match candidates (m, 3, 3) with blurred codes.

        Args:
            pyramid: The image.
            homographies: (m, 3, 3) from marker coordinates to pixels.
            cells: What their cells show.

        Returns:
            Those that look like a marker, at most m; None when there is none.
        """
        blur = np.full((len(homographies), 2), self._blur)
        entries, correlation, patches, footprint = self._score(
            self._rough, pyramid, homographies, blur, None
        )
        # blurred cells show little of their differences, but then the match is not far off
        shown = cells.correlation > _SHOWN
        least = np.where(shown, _LEAST_IF_SHOWN, _LEAST_IF_BLURRED)
        likely = np.flatnonzero(correlation[:, 0] > least)
        inner = self._rough.inner_correlations(
            patches[likely], entries[likely, :_HYPOTHESES], footprint.chosen(likely)
        )
        likely = likely[inner.max(axis=1, initial=-1.0) > _LEAST_INNER]
        if not len(likely):
            return None
        homographies, entries = homographies[likely], entries[likely]
        correlation, blur = correlation[likely], blur[likely]
        # before it is aligned, the right code may come second: all that leave nearly as little of
        # the image unexplained are aligned, each by itself
        unexplained = 1.0 - np.square(np.maximum(correlation[:, :_HYPOTHESES], 0.0))
        close = unexplained < _HYPOTHESIS_RATIO * unexplained[:, :1] + 1e-6
        owner, column = np.nonzero(close)
        aligned = self._rough.refine(
            pyramid, homographies[owner], entries[owner, column], blur[owner], _ROUGH_ITERATIONS
        )
        entries, correlation, patches, footprint = self._score(
            self._rough, pyramid, aligned, blur[owner], None
        )
        inner = self._rough.inner_correlations(patches, entries[:, :1], footprint)
        # of each candidate the hypothesis that agrees best: the first of its owner in this order
        rank = np.lexsort((-correlation[:, 0], owner))
        best = rank[np.flatnonzero(np.diff(owner[rank], prepend=-1))]
        best = best[correlation[best, 0] > _LEAST_ROUGH_CORRELATION]
        best = best[inner[best, 0] > _LEAST_ROUGH_INNER]
        if not len(best):
            return None
        blur = blur[owner[best]]
        aligned, listed = aligned[best], entries[best]
        # the dear fit, with more samples a cell, is for those alone that are left
        start, blur = self._softened(aligned, patches[best], listed, correlation[best, 0], blur)
        aligned = self.fit.refine(pyramid, aligned, start, blur, _FINE_ITERATIONS)
        return self._judged(pyramid, aligned, blur, listed)

    def _judged(
        self, pyramid: ImagePyramid, homographies: Array, blur: Array, listed: Indices
    ) -> Readings:
        """Return readings of aligned candidates (m, 3, 3), with codes out of (m, j)."""
        entries, correlation, patches, footprint = self._score(
            self.fit, pyramid, homographies, blur, listed
        )
        inner = self.fit.inner_correlations(patches, entries[:, :_RIVALS], footprint)
        cells = self.fit.cells(patches)
        shown = self._differences.read(cells)
        wrong, wrong_border = self._differences.wrong(cells, entries[:, 0])
        return Readings(
            homographies,
            entries[:, 0],
            correlation[:, 0],
            inner[:, 0],
            _lead(correlation[:, 0], correlation[:, 1]),
            _lead(inner[:, 0], inner[:, 1:].max(axis=1)),
            wrong,
            wrong_border,
            np.where(shown.entries == entries[:, 0], shown.error, np.inf),
        )

    @staticmethod
    def _score(
        fit: TemplateFit,
        pyramid: ImagePyramid,
        homographies: Array,
        blur: Array,
        listed: Indices | None,
    ) -> tuple[Indices, Patches, Patches, PixelFootprint]:
        levels = fit.levels(homographies)
        patches = fit.sample(pyramid, homographies, levels)
        footprint = fit.footprint(homographies, levels, blur)
        return *fit.score(patches, footprint, listed), patches, footprint

    def _softened(
        self,
        homographies: Array,
        patches: Patches,
        listed: Indices,
        correlation: Patches,
        blur: Array,
    ) -> tuple[Indices, Array]:
        """Return the best code and blur where stronger blur explains a poor fit better."""
        entries, correlation, blur = listed[:, 0].copy(), correlation.copy(), blur.copy()
        poor = np.flatnonzero(correlation < _GOOD_CORRELATION)
        if not len(poor):
            return entries, blur
        levels = self._rough.levels(homographies[poor])
        for stronger in _STRONGER_BLURS:
            tried = np.maximum(stronger, self._blur)
            footprint = self._rough.footprint(homographies[poor], levels, tried)
            found, agreement = self._rough.score(patches[poor], footprint, listed[poor])
            better = agreement[:, 0] > correlation[poor]
            changed = poor[better]
            entries[changed] = found[better, 0]
            correlation[changed] = agreement[better, 0]
            blur[changed] = tried
        return entries, blur


def _lead(best: Patches, second: Patches) -> Patches:
    unexplained = [1.0 - np.square(np.maximum(each, 0.0)) + 1e-6 for each in (second, best)]
    return np.asarray(unexplained[0] / unexplained[1], dtype=np.float32)
