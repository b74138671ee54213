"""Reading the codes of candidate quadrilaterals: match, align, match again, sharper or softer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surveillance_perception.detection.dictionaries import MarkerCodes
from surveillance_perception.detection.image_sampling import Array, ImagePyramid, Patches
from surveillance_perception.detection.template_fit import Footprint, Indices, TemplateFit

_ROUGH_ITERATIONS = 6
_FINE_ITERATIONS = 4
_HYPOTHESES = 3
_HYPOTHESIS_GAP = 0.15
_LEAST_FIRST_CORRELATION = 0.5
_GOOD_CORRELATION = 0.98
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
    """

    homographies: Array
    entries: Indices
    correlation: Patches
    inner: Patches
    lead: Patches


class MarkerReader:
    """Reads codes from images.

    Args:
        codes: The codes to choose from.
        blur: Standard deviation in pixels of the lens's blur in a sharp image.
    """

    def __init__(self, codes: MarkerCodes, blur: float) -> None:
        self.codes = codes
        self._blur = blur
        self._fit = TemplateFit(codes)

    def read(self, pyramid: ImagePyramid, homographies: Array) -> Readings:
        """Read candidates (m, 3, 3); those that show nothing like a marker are left out."""
        fit = self._fit
        blur = np.full((len(homographies), 2), self._blur)
        entries, correlation, _, _ = self._score(pyramid, homographies, blur)
        likely = correlation[:, 0] > _LEAST_FIRST_CORRELATION
        homographies, entries = homographies[likely], entries[likely]
        correlation, blur = correlation[likely], blur[likely]
        if not len(homographies):
            empty = np.zeros(0, np.float32)
            return Readings(homographies, np.zeros(0, np.int64), empty, empty, empty)
        close = correlation[:, :_HYPOTHESES] > correlation[:, :1] - _HYPOTHESIS_GAP
        owner, column = np.nonzero(close)
        aligned = fit.refine(
            pyramid, homographies[owner], entries[owner, column], blur[owner], _ROUGH_ITERATIONS
        )
        entries, correlation, patches, _ = self._score(pyramid, aligned, blur[owner])
        rank = np.lexsort((-correlation[:, 0], owner))
        best = rank[np.flatnonzero(np.diff(owner[rank], prepend=-1))]
        aligned, start = aligned[best], entries[best, 0]
        start, blur = self._softened(aligned, patches[best], start, correlation[best, 0], blur)
        aligned = fit.refine(pyramid, aligned, start, blur, _FINE_ITERATIONS)
        entries, correlation, patches, footprint = self._score(pyramid, aligned, blur)
        inner = fit.inner_correlation(patches, entries[:, 0], footprint)
        unexplained = 1.0 - np.square(np.maximum(correlation[:, :2], 0.0)) + 1e-6
        lead = np.asarray(unexplained[:, -1] / unexplained[:, 0], dtype=np.float32)
        return Readings(aligned, entries[:, 0], correlation[:, 0], inner, lead)

    def _score(
        self, pyramid: ImagePyramid, homographies: Array, blur: Array
    ) -> tuple[Indices, Patches, Patches, Footprint]:
        levels = self._fit.levels(homographies)
        patches = self._fit.sample(pyramid, homographies, levels)
        footprint = self._fit.footprint(homographies, levels, blur)
        return *self._fit.score(patches, footprint), patches, footprint

    def _softened(
        self,
        homographies: Array,
        patches: Patches,
        entries: Indices,
        correlation: Patches,
        blur: Array,
    ) -> tuple[Indices, Array]:
        """The best code and blur where stronger blur explains a poor fit better."""
        entries, correlation, blur = entries.copy(), correlation.copy(), blur.copy()
        poor = np.flatnonzero(correlation < _GOOD_CORRELATION)
        if not len(poor):
            return entries, blur
        levels = self._fit.levels(homographies[poor])
        for stronger in _STRONGER_BLURS:
            tried = np.maximum(stronger, self._blur)
            footprint = self._fit.footprint(homographies[poor], levels, tried)
            found, agreement = self._fit.score(patches[poor], footprint)
            better = agreement[:, 0] > correlation[poor]
            changed = poor[better]
            entries[changed] = found[better, 0]
            correlation[changed] = agreement[better, 0]
            blur[changed] = tried
        return entries, blur
