"""Markers of other dictionaries: what looks like one of ours, and is better explained as theirs.

Chance seldom shows a code, and the bounds of `cell_differences` are on chance. A marker of another
dictionary is not chance: a few of them look like one of ours, and always the same way, so that
seeing them again confirms it. DICT_APRILTAG_36h11's 561 was read as 80 of DICT_5X5_100 in half of
its views, also from near. So a reading that is not sure is held against the codes of all of
OpenCV's dictionaries, each in its own grid of cells: whichever explains the image best is there.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from marker_detection.cell_differences import CellDifferences
from marker_detection.dictionaries import DICTIONARY_NAMES, MarkerCodes, dictionary_named
from marker_detection.image_sampling import Array, ImagePyramid, Indices, Patches, corners_of
from marker_detection.template_fit import TemplateFit

# pixels of blur under which a reading and its rivals are compared
_BLURS = (0.8, 1.6, 2.4)
# how many times less a rival must leave unexplained, and how well it must fit itself: in poor light
# one of the 32,000 other codes often fits a little better. Of 48 doubtful markers of ours a rival
# that correlates with 0.85 had a lead of 0.9 at most, of 66 of other dictionaries of 3.5 at least
_LEAD, _LEAST_CORRELATION = 1.5, 0.85
# steps in which a code is aligned with the image
_ITERATIONS = 3
# expected false alarms of one candidate from which it is counted as a marker of another family
_LARGEST_ERROR = 1e-5
# half diagonals within which two outlines are one marker
_SAME_PLACE = 0.7


class _Family(NamedTuple):
    """All codes of dictionaries with one grid of cells.

    Attributes:
        fit: Compares images with them.
        differences: Reads them by their cells.
        source: (k,) of the dictionary in `names` that each entry is from.
        ids: (k,) its id there.
        names: Dictionaries.
    """

    fit: TemplateFit
    differences: CellDifferences
    source: Indices
    ids: Indices
    names: tuple[str, ...]


def _largest_names() -> list[str]:
    """Return the dictionaries that are no first part of another one, and one of each two alike."""
    names, seen = [], set[bytes]()
    sizes = {name: len(dictionary_named(name).bytesList) for name in DICTIONARY_NAMES}
    for name in sorted(sizes, key=lambda each: (-sizes[each], each.swapcase())):
        dictionary = dictionary_named(name)
        first = bytes([dictionary.markerSize]) + dictionary.bytesList[0].tobytes()
        if first not in seen:
            seen.add(first)
            names.append(name)
    return names


@cache
def _families() -> dict[int, tuple[str, ...]]:
    """Return names of dictionaries by the cells along a side of their codes."""
    by_bits = defaultdict[int, list[str]](list)
    for name in _largest_names():
        by_bits[dictionary_named(name).markerSize].append(name)
    return {bits: tuple(names) for bits, names in sorted(by_bits.items())}


class OtherFamilies:
    """The codes of OpenCV's dictionaries that are not in one's own.

    Args:
        own: The codes that are looked for.
        blur: Deviation of the lens's blur in a sharp image, pixels.
    """

    def __init__(self, own: TemplateFit, blur: float) -> None:
        self._own = own
        self._blurs = sorted({blur, *(each for each in _BLURS if each > blur)})
        self._built: dict[int, _Family] = {}

    def explain_better(
        self, pyramid: ImagePyramid, homographies: Array, entries: Indices
    ) -> npt.NDArray[np.bool_]:
        """Tell which readings are rather markers of another dictionary.

        Args:
            pyramid: The image.
            homographies: (m, 3, 3) from marker coordinates to pixels.
            entries: (m,) of the own codes that were read.
        """
        ours = np.full(len(homographies), -1.0, np.float32)
        blur = np.full((len(homographies), 2), self._blurs[0])
        for each in self._blurs:
            tried = np.full_like(blur, each)
            inner = _aligned_inner(self._own, pyramid, homographies, entries, tried)
            better = inner > ours
            ours[better], blur[better] = inner[better], each
        theirs = np.full(len(homographies), -1.0, np.float32)
        for bits in _families():
            fit = self._family(bits).fit
            rivals = _likeliest(fit, pyramid, homographies, blur)
            inner = _aligned_inner(fit, pyramid, homographies, rivals, blur)
            theirs = np.maximum(theirs, inner)
        unexplained = (1.0 - np.square(np.maximum(each, 0.0)) for each in (ours, theirs))
        lead = np.divide(*unexplained)
        return np.asarray((lead > _LEAD) & (theirs > _LEAST_CORRELATION))

    def count(self, pyramid: ImagePyramid, homographies: Array) -> dict[str, list[int]]:
        """Return the ids that candidates (m, 3, 3) show, by the smallest dictionary that has them.

        Only those whose cells alone show it, and of outlines on each other one.
        """
        shown: list[tuple[float, str, int, Array]] = []
        outlines = corners_of(homographies)
        for bits in _families():
            family = self._family(bits)
            fit = family.fit
            patches = fit.sample(pyramid, homographies, fit.levels(homographies))
            read = family.differences.read(fit.cells(patches))
            for row in np.flatnonzero(read.error < _LARGEST_ERROR).tolist():
                entry = int(read.entries[row])
                name = family.names[int(family.source[entry])]
                shown.append((float(read.error[row]), name, int(family.ids[entry]), outlines[row]))
        kept: list[Array] = []
        ids = defaultdict[str, set[int]](set)
        for _, name, marker_id, outline in sorted(shown, key=lambda each: each[0]):
            middle = outline.mean(axis=0)
            reach = _SAME_PLACE * float(np.linalg.norm(outline - middle, axis=1).mean())
            if all(np.linalg.norm(middle - each.mean(axis=0)) > reach for each in kept):
                kept.append(outline)
                ids[name].add(marker_id)
        return {_smallest(name, found): sorted(found) for name, found in ids.items()}

    def _family(self, bits: int) -> _Family:
        if bits not in self._built:
            codes = self._own.codes
            own = frozenset(_keys(codes.cells)) if codes.bits == bits else frozenset[bytes]()
            self._built[bits] = _family_without(bits, own)
        return self._built[bits]


def _likeliest(
    fit: TemplateFit, pyramid: ImagePyramid, homographies: Array, blur: Array
) -> Indices:
    """Return the codes (m,) that explain the image best where they are."""
    levels = fit.levels(homographies)
    patches = fit.sample(pyramid, homographies, levels)
    return fit.score(patches, fit.footprint(homographies, levels, blur))[0][:, 0]


def _aligned_inner(
    fit: TemplateFit, pyramid: ImagePyramid, homographies: Array, entries: Indices, blur: Array
) -> Patches:
    """Return the correlation (m,) inside the border, before or after aligning: the higher one."""
    best = np.full(len(homographies), -1.0, np.float32)
    for place in (
        homographies,
        fit.refine(pyramid, homographies, entries, blur, _ITERATIONS),
    ):
        levels = fit.levels(place)
        patches = fit.sample(pyramid, place, levels)
        footprint = fit.footprint(place, levels, blur)
        best = np.maximum(best, fit.inner_correlations(patches, entries[:, None], footprint)[:, 0])
    return np.asarray(best)


@lru_cache(maxsize=16)
def _family_without(bits: int, own: frozenset[bytes]) -> _Family:
    """Return all codes of so many cells a side but some; the same ones serve every detector."""
    names = _families()[bits]
    each = [MarkerCodes.of(dictionary_named(name)) for name in names]
    source = np.concatenate([np.full(len(codes.ids), at) for at, codes in enumerate(each)])
    cells = np.concatenate([codes.cells for codes in each])
    foreign = np.array([key not in own for key in _keys(cells)])
    ids, turns = (
        np.concatenate([getattr(codes, name) for codes in each])[foreign]
        for name in ('ids', 'turns')
    )
    codes = MarkerCodes(bits, ids, turns, cells[foreign])
    return _Family(TemplateFit(codes), CellDifferences(codes), source[foreign], ids, names)


def _keys(cells: Patches) -> list[bytes]:
    return [each.tobytes() for each in np.packbits(cells > 0, axis=2)]


def _smallest(name: str, ids: Iterable[int]) -> str:
    """Return the smallest dictionary that begins as a named one and has some ids of it."""
    whole, highest = dictionary_named(name), max(ids)
    counts = {
        each: len(part.bytesList)
        for each in DICTIONARY_NAMES
        if (part := dictionary_named(each)).markerSize == whole.markerSize
        and len(part.bytesList) > highest
        and (part.bytesList[0] == whole.bytesList[0]).all()
    }
    return min(counts, key=lambda each: (counts[each], each.swapcase()))
