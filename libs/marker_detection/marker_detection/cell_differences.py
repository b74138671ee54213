"""Codes by the differences between neighbouring cells, which uneven light hardly changes.

A shadow or a reflection changes grey levels slowly, print changes them from one cell to the next.
So the differences between a marker's neighbouring cells are correlated with those of each code.
They are taken of grey levels, to which a reflection adds, and of their logarithms, on which a
shadow's factor has no effect away from its edge. Where a reflection leaves less room up to white
than print needs, the expected difference is smaller by as much: saturated cells are erasures.

How likely it is that something else agrees as well is computed. For differences that have nothing
to do with a code, the square of the correlation follows a beta distribution, as in the test of a
correlation coefficient. Differences that share a cell depend on each other; their degrees of
freedom are trace(C)^2 / trace(C^2) of their covariance C (Satterthwaite, "An approximate
distribution of estimates of variance components", Biometrics 2(6), 1946). The number of codes
times that probability is what is expected of false alarms (Desolneux, Moisan and Morel, "From
Gestalt Theory to Image Analysis", 2008).

What nearly shows a code may be that code with dirt on a few cells, or another dictionary's print.
How much of all print lies so near a code tells which: in DICT_APRILTAG_36h11 one of 3,700 prints
differs from a code in three cells at most, in DICT_5X5_100 one of 3,200 in one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import bdtr, betainc

from marker_detection.dictionaries import MarkerCodes
from marker_detection.image_sampling import Array, Indices, Patches, Reals

_SATURATED = 252.0
_LEAST_STEP = 20.0
_STEP_QUANTILE = 0.85
_DARK_LEVEL = 12.0
# how many times less a code with one cell, or all that agree better, of the other colour leaves
# unexplained where print shows it: in print without noise single ones of several explain little,
# and where cells are a pixel wide many explain little together
_OTHER_CELL, _OTHER_CODE = 1.4, 4.0
# error from which a code is not looked at again
_LIKELY = 1e-3
# share of all print that may lie as near a code as what is taken for it
_LARGEST_SHARE = 3e-4


class CellReadings(NamedTuple):
    """What the cells of candidates show; arrays run over candidates.

    Attributes:
        entries: (m,) index of the best code.
        correlation: (m,) of its differences with those in the image, -1 to 1.
        lead: (m,) what the second best code leaves unexplained, as a multiple of what the best
            one does: 1 is a draw.
        error: (m,) bound of the probability of a wrong id: how often so good an agreement is
            expected where there is no marker, and the odds of the second best code.
    """

    entries: Indices
    correlation: Reals
    lead: Reals
    error: Array

    def chosen(self, which: npt.NDArray[np.bool_] | Indices) -> CellReadings:
        """Return the readings of some of the candidates, by a mask (m,) or their indices."""
        return CellReadings(
            self.entries[which], self.correlation[which], self.lead[which], self.error[which]
        )


class CellDifferences:
    """Correlates differences between the cells of candidates with the codes of a dictionary."""

    def __init__(self, codes: MarkerCodes) -> None:
        self._white = (codes.cells[:, 1:-1, 1:-1] > 0).astype(np.float32)
        self._codes = _differences(self._white)
        cells = codes.side**2
        # entries' share of all print that differs in so many cells at most
        differing = np.minimum(np.arange(cells + 1), codes.bits**2)
        self._share = len(self._codes) * bdtr(differing, codes.bits**2, 0.5)
        self._flips = _differences(np.eye(cells, dtype=np.float32).reshape(cells, codes.side, -1))
        # the border is black in all codes: what is white inside makes all of their differences
        inside = np.zeros((codes.side, codes.side), bool)
        self._own = slice(codes.border, codes.side - codes.border)
        inside[self._own, self._own] = True
        self._inside = self._flips[inside.ravel()]
        squares = np.square(self._codes)
        # a code without differences has no correlation with any
        energy = np.maximum(squares.sum(axis=1, keepdims=True), 1e-6)
        self._inner = self._white[:, inside] / np.sqrt(energy)
        self._shares = squares / energy
        covariance = self._flips @ self._flips.T
        self._freedom = float(np.trace(covariance) ** 2 / np.square(covariance).sum())

    def read(self, cells: Patches) -> CellReadings:
        """Read grey levels (m, side, side) of the black square's cells."""
        levels, logarithms = _differences(cells), _differences(_logarithms(cells))
        step = _step(levels)
        room = _room(cells, step)
        # which of the two is right depends on the light: a reflection adds, a shadow multiplies
        level = self._best(_normalised(levels, step), room)
        ratio = self._best(_normalised(logarithms, _step(logarithms)), np.ones_like(room))
        better = ratio.error < level.error
        return CellReadings(
            np.where(better, ratio.entries, level.entries),
            np.where(better, ratio.correlation, level.correlation),
            np.where(better, ratio.lead, level.lead),
            np.where(better, ratio.error, level.error),
        )

    def wrong(self, cells: Patches, entries: Indices) -> tuple[Indices, Indices]:
        """Count cells that agree better when they are taken for the other colour.

        Args:
            cells: (m, side, side) grey levels.
            entries: (m,) index of the code that each shows.

        Returns:
            (m,) such cells of the code, and of its border.
        """
        differences = _differences(_logarithms(cells))
        seen = _normalised(differences, _step(differences))
        before, flipped = self._flipped(seen, np.ones_like(seen), entries)
        better = (flipped > before).reshape(cells.shape)
        inner = better[:, self._own, self._own].sum(axis=(1, 2))
        return inner, better.sum(axis=(1, 2)) - inner

    def _flipped(self, seen: Patches, room: Patches, entries: Indices) -> tuple[Reals, Reals]:
        """Return correlations (m, 1) with codes, and (m, cells) with one cell of them flipped."""
        # flipping one cell changes its few differences only: agreement and energy are updated
        # instead of made anew for each cell
        expected, white = room * self._codes[entries], self._white[entries]
        sign = 1.0 - 2.0 * white.reshape(len(white), -1)
        agreement = (seen * expected).sum(axis=1, keepdims=True)
        energy = np.square(expected).sum(axis=1, keepdims=True)
        flipped = agreement + sign * ((seen * room) @ self._flips.T)
        flipped_energy = energy + 2.0 * sign * ((room * expected) @ self._flips.T)
        flipped_energy += np.square(room) @ np.square(self._flips).T
        size = np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-3)
        before = agreement / np.sqrt(np.maximum(energy, 1e-3)) / size
        return before, flipped / np.sqrt(np.maximum(flipped_energy, 1e-3)) / size

    def _best(self, seen: Patches, room: Patches) -> CellReadings:
        """Return the best codes for differences (m, n) that show in so much room.

        The error is infinite where the print rather shows another code.
        """
        correlation = self._correlation(seen, room)
        entries = correlation.argmax(axis=1)
        rows = np.arange(len(correlation))
        highest = correlation[rows, entries]
        correlation[rows, entries] = -1.0
        best, second = _unexplained(highest), _unexplained(correlation.max(axis=1))
        # saturated pairs say nothing, and count for no degree of freedom
        freedom = self._freedom * room.mean(axis=1, dtype=float)
        # P(r^2 >= best) of unrelated differences; half, as a negative correlation does not count
        by_chance = betainc((freedom - 1.0) / 2.0, 0.5, np.minimum(best, 1.0)) / 2.0
        # each code is tried with levels and with logarithms
        error = 2.0 * len(self._codes) * by_chance + (second / best) ** (-freedom / 2.0)
        # the look at other cells is the dearest step: only for what would be accepted
        likely = np.flatnonzero(error < _LIKELY)
        if len(likely):
            other_code = self._other_code(seen[likely], room[likely], entries[likely], best[likely])
            error[likely[other_code]] = np.inf
        return CellReadings(entries, highest, second / best, error)

    def _correlation(self, seen: Patches, room: Patches) -> Patches:
        """Return correlations (m, codes) of differences (m, n) that show in so much room."""
        size = np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-6)
        correlation = ((seen / size * room) @ self._inside.T) @ self._inner.T
        short = np.flatnonzero(room.min(axis=1) < 1.0)
        if len(short):
            share = np.square(room[short]) @ self._shares.T
            correlation[short] /= np.sqrt(np.maximum(share, 1e-6))
        return np.asarray(correlation)

    def _other_code(
        self, seen: Patches, room: Patches, entries: Indices, unexplained: Reals
    ) -> npt.NDArray[np.bool_]:
        """Return where so many cells of the other colour explain much of the rest that print with
        another code is not rare.
        """
        before, flipped = self._flipped(seen, room, entries)
        better = flipped > before
        white = np.abs(self._white[entries] - better.reshape(len(better), *self._white.shape[1:]))
        expected = room * _differences(white)
        scale = np.linalg.norm(seen, axis=1) * np.linalg.norm(expected, axis=1)
        nearer = (seen * expected).sum(axis=1) / np.maximum(scale, 1e-6)
        explained = unexplained > _OTHER_CELL * _unexplained(flipped.max(axis=1))
        explained |= unexplained > _OTHER_CODE * _unexplained(nearer)
        return np.asarray(explained & (self._share[better.sum(axis=1)] > _LARGEST_SHARE))


def _unexplained(correlation: Reals) -> Reals:
    return 1.0 - np.square(np.maximum(correlation, 0.0)) + 1e-6


def _differences(cells: Patches) -> Patches:
    """Differences (m, 2 * side * (side - 1)) between neighbours of cells (m, side, side)."""
    return _pairs(cells[:, :, 1:] - cells[:, :, :-1], cells[:, 1:] - cells[:, :-1])


def _logarithms(cells: Patches) -> Patches:
    return np.asarray(np.log(cells + np.float32(_DARK_LEVEL)))


def _normalised(differences: Patches, step: Patches) -> Patches:
    """Return differences, 1 for those from black to white."""
    return np.asarray(np.clip(differences / step, -1.0, 1.0))


def _step(differences: Patches) -> Patches:
    """Return the difference (m, 1) between black and white."""
    # half of the pairs of a code differ: a high quantile of all is the step between black and white
    index = round(_STEP_QUANTILE * (differences.shape[1] - 1))
    large = np.partition(np.abs(differences), index, axis=1)[:, index : index + 1]
    return np.asarray(np.maximum(large, np.float32(1e-3)))


def _room(cells: Patches, step: Patches) -> Patches:
    """Return which share of the difference between black and white each pair can show."""
    lower = _pairs(
        np.minimum(cells[:, :, 1:], cells[:, :, :-1]), np.minimum(cells[:, 1:], cells[:, :-1])
    )
    return np.asarray(np.clip((_SATURATED - lower) / np.maximum(step, _LEAST_STEP), 0.0, 1.0))


def _pairs(beside: Patches, below: Patches) -> Patches:
    return np.concatenate([beside.reshape(len(beside), -1), below.reshape(len(below), -1)], axis=1)
