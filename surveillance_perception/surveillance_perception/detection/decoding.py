"""Reading the codes of candidate quadrilaterals: match, align, match again, sharper or softer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from surveillance_perception.detection.dictionaries import MarkerCodes
from surveillance_perception.detection.illumination import evenly_lit
from surveillance_perception.detection.image_sampling import (
    Array,
    ImagePyramid,
    Patches,
    cell_widths,
)
from surveillance_perception.detection.template_fit import (
    SAMPLES_PER_CELL,
    Footprint,
    Indices,
    TemplateFit,
)

_ROUGH_ITERATIONS = 5
_FINE_ITERATIONS = 3
_HYPOTHESES = 2
_RIVALS = 6
_ROUGH_BORDER, _ROUGH_BORDER_EVEN = 0.6, 0.4
_NARROW_CELL = 2.5
_UNEVEN_CELLS = 2
_PLAIN_WRONG = 1
_PLAIN_BORDER = 0.25
_GLARING = 250.0
_LIT = 140.0
_GLARED_SHARE = 0.4
_GLARED_CELLS = 4
_GLARED_BORDER = 3
_GLARE_LEAD = 2
_HYPOTHESIS_RATIO = 1.7
_LEAST_FIRST_CORRELATION, _LEAST_FIRST_EVEN = 0.65, 0.6
_LEAST_ROUGH_CORRELATION = 0.7
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
        inner_lead: (m,) the same of the code's own cells only.
        wrong: (m,) cells of the code that local contrast reads the other way.
        wrong_border: (m,) cells of the border that are not black.
        glared: (m,) entries of the code that fits once black cells in a reflection are excused;
            -1 where none does.
    """

    homographies: Array
    entries: Indices
    correlation: Patches
    inner: Patches
    lead: Patches
    inner_lead: Patches
    wrong: Indices
    wrong_border: Indices
    glared: Indices

    @classmethod
    def none(cls) -> Readings:
        """No reading at all."""
        number, index = np.zeros(0, np.float32), np.zeros(0, np.int64)
        return cls(np.zeros((0, 3, 3)), index, *(number,) * 4, index, index, index)


class MarkerReader:
    """Reads codes from images.

    Args:
        codes: The codes to choose from.
        blur: Standard deviation in pixels of the lens's blur in a sharp image.
        even: Whether to read by local contrast, as under shadows and glare.
    """

    def __init__(self, codes: MarkerCodes, blur: float, *, even: bool = False) -> None:
        self.codes = codes
        self._blur = blur
        self._bits = codes.cells[:, 2:-2, 2:-2].reshape(len(codes.ids), -1)
        self._even = even
        self._fit = TemplateFit(codes, even=even)
        self._glare_limit = min(_GLARED_CELLS, codes.correction + 1)

    def read_plain(self, pyramid: ImagePyramid, homographies: Array) -> Readings:
        """Read those of the candidates (m, 3, 3) whose cells show a code without a mistake."""
        fit = self._fit
        levels = fit.levels(homographies)
        cells = self._cells(fit.sample(pyramid, homographies, levels))
        entries, wrong = self._nearest(cells)
        white = self._white_border(cells)
        plain = (wrong <= _PLAIN_WRONG) & (white <= _PLAIN_BORDER * 4 * (self.codes.side - 1))
        if not plain.any():
            return Readings.none()
        aligned, entries = homographies[plain], entries[plain]
        blur = np.full((len(aligned), 2), self._blur)
        aligned = fit.refine(pyramid, aligned, entries, blur, _ROUGH_ITERATIONS)
        levels = fit.levels(aligned)
        patches = fit.sample(pyramid, aligned, levels)
        cells = self._cells(patches)
        found, wrong = self._nearest(cells)
        footprint = fit.footprint(aligned, levels, blur)
        correlation = fit.correlation(patches, entries, footprint)
        inner, second = self._cell_correlations(cells)
        lead = _lead(inner, second)
        kept = (found == entries) & (wrong == 0)
        none = np.full(kept.sum(), -1, np.int64)
        return Readings(
            aligned[kept],
            entries[kept],
            correlation[kept],
            inner[kept],
            lead[kept],
            lead[kept],
            wrong[kept],
            self._white_border(cells)[kept],
            none,
        )

    def read(self, pyramid: ImagePyramid, homographies: Array) -> Readings:
        """Read candidates (m, 3, 3); those that show nothing like a marker are left out."""
        fit = self._fit
        blur = np.full((len(homographies), 2), self._blur)
        entries, correlation, patches, _ = self._score(pyramid, homographies, blur, None)
        least = _LEAST_FIRST_EVEN if self._even else _LEAST_FIRST_CORRELATION
        likely = correlation[:, 0] > least
        likely[likely] = self._has_border(patches[likely], homographies[likely])
        homographies, entries = homographies[likely], entries[likely]
        correlation, blur = correlation[likely], blur[likely]
        if not len(homographies):
            return Readings.none()
        unexplained = 1.0 - np.square(np.maximum(correlation[:, :_HYPOTHESES], 0.0))
        close = unexplained < _HYPOTHESIS_RATIO * unexplained[:, :1] + 1e-6
        owner, column = np.nonzero(close)
        aligned = fit.refine(
            pyramid, homographies[owner], entries[owner, column], blur[owner], _ROUGH_ITERATIONS
        )
        entries, correlation, patches, _ = self._score(pyramid, aligned, blur[owner], None)
        rank = np.lexsort((-correlation[:, 0], owner))
        best = rank[np.flatnonzero(np.diff(owner[rank], prepend=-1))]
        best = best[correlation[best, 0] > _LEAST_ROUGH_CORRELATION]
        if not len(best):
            return Readings.none()
        blur = blur[owner[best]]
        aligned, listed = aligned[best], entries[best]
        start, blur = self._softened(aligned, patches[best], listed, correlation[best, 0], blur)
        aligned = fit.refine(pyramid, aligned, start, blur, _FINE_ITERATIONS)
        entries, correlation, patches, footprint = self._score(pyramid, aligned, blur, listed)
        rivals = entries[:, :_RIVALS]
        inner = fit.inner_correlations(patches, rivals, footprint)
        best_inner, others = inner[:, 0], inner[:, 1:].max(axis=1, initial=-1.0)
        cells = self._cells(patches)
        wrong, wrong_border = self._wrong(cells, entries[:, 0])
        return Readings(
            aligned,
            entries[:, 0],
            correlation[:, 0],
            best_inner,
            _lead(correlation[:, 0], correlation[:, -1 if correlation.shape[1] < 2 else 1]),
            _lead(best_inner, others),
            wrong.sum(axis=(1, 2)),
            wrong_border,
            self._glared(patches, rivals),
        )

    def _cells(self, patches: Patches, *, ratios: bool = True) -> Patches:
        """Cells (m, side, side) of patches by local contrast: black -1, white 1."""
        if not self._even or not ratios:
            patches = evenly_lit(patches, self._fit.count, SAMPLES_PER_CELL, ratios=ratios)
        return self._fit.cells(patches)

    def uneven(self, pyramid: ImagePyramid, homographies: Array) -> npt.NDArray[np.bool_]:
        """Return where (m,) the light makes cells lighter or darker than those of their own
        colour.
        """
        patches = self._fit.sample(pyramid, homographies, self._fit.levels(homographies))
        local, levels = self._cells(patches), self._fit.cells(patches)
        flat = levels.reshape(len(levels), -1)
        low, high = np.quantile(flat, (0.1, 0.9), axis=1)
        split = (low + high)[:, None, None] / 2.0
        return np.asarray(((local > 0) != (levels > split)).sum(axis=(1, 2)) >= _UNEVEN_CELLS)

    def _nearest(self, cells: Patches) -> tuple[Indices, Indices]:
        """Return the code (m,) that fewest of the cells (m, side, side) contradict, and how many
        do.
        """
        seen = np.where(cells[:, 1:-1, 1:-1].reshape(len(cells), -1) > 0, 1.0, -1.0)
        agreement = seen.astype(np.float32) @ self._bits.T
        entries = agreement.argmax(axis=1)
        best = agreement[np.arange(len(cells)), entries]
        wrong = np.rint((self._bits.shape[1] - best) / 2.0)
        return entries, np.asarray(wrong, dtype=np.int64)

    def _cell_correlations(self, cells: Patches) -> tuple[Patches, Patches]:
        """Correlations (m,) of the cells' values with the best and the second best code."""
        seen = np.clip(cells[:, 1:-1, 1:-1].reshape(len(cells), -1), -1.0, 1.0)
        codes = self._bits - self._bits.mean(axis=1, keepdims=True)
        codes /= np.maximum(np.linalg.norm(codes, axis=1, keepdims=True), 1e-6)
        seen = seen - seen.mean(axis=1, keepdims=True)
        seen /= np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-6)
        correlation = seen @ codes.T
        best = np.partition(correlation, -2, axis=1)[:, -2:]
        return best[:, 1], best[:, 0]

    def _white_border(self, cells: Patches) -> Indices:
        """Return how many cells of the border (m,) are white."""
        white = cells > 0
        return np.asarray(white.sum(axis=(1, 2)) - white[:, 1:-1, 1:-1].sum(axis=(1, 2)))

    def _has_border(self, patches: Patches, homographies: Array) -> npt.NDArray[np.bool_]:
        """Tell whether most cells of the border (m,) are black, as far as rough corners show it.

        Cells too narrow for that are given the benefit of the doubt, but not under uneven light.
        """
        narrow = cell_widths(homographies, self.codes.side) < _NARROW_CELL
        share = _ROUGH_BORDER_EVEN if self._even else _ROUGH_BORDER
        black = self._white_border(self._cells(patches)) <= share * 4 * (self.codes.side - 1)
        return np.asarray(black & ~narrow if self._even else black | narrow)

    def _wrong(self, cells: Patches, entries: Indices) -> tuple[npt.NDArray[np.bool_], Indices]:
        """Cells of the codes (m, bits, bits) and number of border cells (m,) read otherwise."""
        seen = cells > 0
        wrong = seen != (self.codes.cells[entries][:, 1:-1, 1:-1] > 0)
        inner = wrong[:, 1:-1, 1:-1]
        return inner, wrong.sum(axis=(1, 2)) - inner.sum(axis=(1, 2))

    def _glared(self, patches: Patches, rivals: Indices) -> Indices:
        """Return the one code (m,) of the rivals (m, j) that fits but for a reflection; -1 where
        none.

        A reflection turns neighbouring black cells white and no white one black, and it is
        brighter than white is elsewhere.
        """
        found = np.full(len(patches), -1, np.int64)
        if self._even:
            return found
        cells = self._cells(patches, ratios=False)
        levels = self._fit.cells(patches)
        share = (levels[:, 1:-1, 1:-1] >= _GLARING).mean(axis=(1, 2))
        # on paper as bright as that everywhere no reflection shows
        bright = (share > 0.0) & (share < _GLARED_SHARE)
        for index in np.flatnonzero(bright):
            count = len(rivals[index])
            wrong, border = self._wrong(cells[index : index + 1].repeat(count, 0), rivals[index])
            total = wrong.sum(axis=(1, 2))
            order = np.argsort(total, kind='stable')
            best = order[0]
            where = np.argwhere(wrong[best])
            if not 0 < total[best] <= self._glare_limit or border[best] > _GLARED_BORDER:
                continue
            if count > 1 and total[order[1]] < total[best] + _GLARE_LEAD:
                continue
            turned_white = cells[index, 1:-1, 1:-1][wrong[best]] > 0
            near = where.max(axis=0) - where.min(axis=0)
            lit = levels[index, 1:-1, 1:-1][wrong[best]]
            if turned_white.all() and near.max() <= 2 and lit.max() >= _LIT:
                found[index] = rivals[index, best]
        return found

    def _score(
        self, pyramid: ImagePyramid, homographies: Array, blur: Array, listed: Indices | None
    ) -> tuple[Indices, Patches, Patches, Footprint]:
        levels = self._fit.levels(homographies)
        patches = self._fit.sample(pyramid, homographies, levels)
        footprint = self._fit.footprint(homographies, levels, blur)
        return *self._fit.score(patches, footprint, listed), patches, footprint

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
        levels = self._fit.levels(homographies[poor])
        for stronger in _STRONGER_BLURS:
            tried = np.maximum(stronger, self._blur)
            footprint = self._fit.footprint(homographies[poor], levels, tried)
            found, agreement = self._fit.score(patches[poor], footprint, listed[poor])
            better = agreement[:, 0] > correlation[poor]
            changed = poor[better]
            entries[changed] = found[better, 0]
            correlation[changed] = agreement[better, 0]
            blur[changed] = tried
        return entries, blur


def _lead(best: Patches, second: Patches) -> Patches:
    unexplained = [1.0 - np.square(np.maximum(each, 0.0)) + 1e-6 for each in (second, best)]
    return np.asarray(unexplained[0] / unexplained[1], dtype=np.float32)
