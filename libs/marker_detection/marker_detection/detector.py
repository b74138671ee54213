"""Finding ArUco markers in images, also where they are small, oblique, blurred, dark or noisy.

The way from an image to markers, with the module of each step:

1. `preprocessing` stretches a dark image and smooths a noisy one.
2. `candidates` proposes quadrilaterals around dark blobs and keeps those with a white margin, a
   black border and something inside; `edge_fit` moves their sides onto the border.
3. `cell_differences` reads those whose cells are wide enough to show their code, under any light;
   what such a reading may be wrong is computed.
4. `decoding` has `template_fit` compare what is left with every code of the dictionary through the
   camera's blur, align the likely ones with the image, and try stronger blur where the fit is poor.
5. `MarkerDetector` accepts such a reading by its correlation and by its lead over the second best
   code: a lower lead is enough for an id on the known list than for any other.
6. `other_families` takes away what is better explained as a marker of another dictionary.
7. `edge_fit` follows the sides of large markers, which were read from halved images, into the image
   itself, and tells how much of each outline lies on an edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection.candidates import (
    BorderCheck,
    dark_masks,
    distinct,
    quads_around,
)
from marker_detection.cell_differences import CellReadings
from marker_detection.decoding import MarkerReader, Readings
from marker_detection.dictionaries import MarkerCodes, dictionary_named
from marker_detection.edge_fit import EdgeFit, SharpEdges
from marker_detection.image_sampling import (
    Array,
    ImagePyramid,
    Indices,
    Quads,
    corners_of,
    homographies_of,
)
from marker_detection.other_families import OtherFamilies
from marker_detection.preprocessing import PreparedImage, grey_of, prepare
from strict_files.settings import converted, parameter

# pixels between the middles of outlines that are one: what the search's masks differ by
_SAME_QUAD = 2.0
# candidates that are matched at once: bounds the memory
_BATCH = 128
# share of a marker's half diagonal within which another outline's middle is taken for its part
_COVER = 0.7
# share of the cells that may rather have the other colour: cells a pixel wide show little
_CONTRADICTED = 0.4
# bits of a code beyond its id below which a higher lead is asked for, and how many raise it by one
_FEW_SPARE_BITS, _STRICT_BITS = 12.0, 4.0
# pixels of the image for which `max_outlines` is meant
_FULL_WORK = 2e6
# wrong ids that may be expected of one candidate
_LARGEST_ERROR = 1e-5
# confidence from which a reading is not held against other dictionaries: of their markers none was
# read with more than 0.6, of ours nineteen in twenty are read with more
_SURE = 0.8


def odd_numbers(values: Sequence[int]) -> str | None:
    """Ask for the sides of neighbourhoods around a pixel."""
    good = values and all(each >= 3 and each % 2 for each in values)
    return None if good else 'odd numbers from 3'


@dataclass(frozen=True)
class DetectorSettings:
    """What to look for, and how hard.

    Attributes:
        dictionary: Name of one of OpenCV's dictionaries.
        known_ids: Ids that are expected; None when none is more likely than another.
        windows: Sides in pixels of the neighbourhoods a border is compared with, odd, in the order
            in which they are tried. Only a small one parts a thin border from what lies beyond its
            margin; in a crowd on a large image it sees so many outlines that it comes last.
        bridges: Gaps in pixels that are closed for markers seen at a flat angle, where there are
            no more than `max_outlines` in an image of whatever size.
        max_outlines: Dark outlines in an image of two megapixels after which only those near
            quadrilaterals are looked at, and no further neighbourhood or bridge is tried; in a
            smaller one as many more as it has fewer pixels.
        max_candidates: Bound of an image's work: quadrilaterals that are read, the likeliest first.
        least_correlation: Correlation with the image that a reading needs, 0 to 1: of its cells'
            differences, or of the whole marker.
        known_lead: How many times less than the second best code the best one must leave
            unexplained, when its id is known.
        border: Black cells around a marker's code. With two or more, outlines that touch each other
            at their corners are parted, too.
        inverted: Whether markers with black and white exchanged are looked for as well, as OpenCV's
            `detectInvertedMarker`; takes twice the time.
    """

    dictionary: str = parameter(
        'DICT_5X5_100',
        "One of OpenCV's marker dictionaries, or a file in OpenCV's form.",
        name='marker_dictionary',
    )
    known_ids: frozenset[int] | None = converted(
        lambda ids: frozenset(ids) or None,
        [],
        'Ids that are expected; empty: none more than another.',
        of=int,
    )
    windows: tuple[int, ...] = parameter(
        (15, 31, 5), 'Neighbourhoods of a border, odd, pixels.', check=odd_numbers
    )
    bridges: tuple[int, ...] = parameter((5,), 'Gaps to close in a border, pixels.', 2, 99, of=int)
    contrast: float = parameter(
        7.0, 'Grey levels by which a border is darker than around it.', 1.0, 100.0
    )
    min_length: float = parameter(8.0, 'Longer side of the smallest marker, pixels.', 4.0, 1000.0)
    max_outlines: int = parameter(
        250,
        'Outlines in two megapixels after which only near quadrilaterals are looked at.',
        1,
        100000,
    )
    max_candidates: int = parameter(
        1000, "Bound of an image's work: outlines that are read.", 1, 100000
    )
    blur: float = parameter(0.8, "Deviation of the lens's blur in a sharp image, pixels.", 0.0, 5.0)
    least_correlation: float = parameter(0.85, 'Correlation that a reading needs.', 0.0, 1.0)
    least_inner_correlation: float = parameter(
        0.8, "Correlation over the code's own cells that a reading needs.", 0.0, 1.0
    )
    known_lead: float = parameter(2.6, 'Lead over the second best code, known ids.', 1.0, 100.0)
    unknown_lead: float = parameter(3.0, 'Lead over the second best code, other ids.', 1.0, 100.0)
    border: int = parameter(
        1, "Black cells around a code; Kalibr's AprilGrids have 2.", 1, 4, name='marker_border'
    )
    inverted: bool = parameter(
        False,
        'Whether markers in white on black are looked for, too; takes twice the time.',
        name='inverted_markers',
    )

    def __post_init__(self) -> None:
        if not self.windows or any(each < 3 or each % 2 == 0 for each in self.windows):
            raise ValueError(f'windows must be odd and at least 3, got {list(self.windows)}')
        if any(each < 2 for each in self.bridges):
            raise ValueError(f'bridges must be at least 2 pixels, got {list(self.bridges)}')


@dataclass(frozen=True, eq=False)
class Detection:
    """A marker in one image.

    Attributes:
        marker_id: Its id.
        corners: (4, 2) pixels, clockwise from the marker's own top left corner.
        confidence: 0 to 1: its correlation, less the share by which the second best code does
            nearly as well, less the share of its outline that lies on no edge; what of that is not
            in the image counts half.
        known: Whether its id is on the known list (always when there is no list).
    """

    marker_id: int
    corners: Array
    confidence: float
    known: bool


@dataclass
class MarkerDetector:
    """Finds the markers of one dictionary in images; keeps no markers from one to the next.

    Attributes:
        settings: What to look for.
        left_out: Candidates of the last image that were left unread, to bound the work.
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)
    left_out: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        dictionary = dictionary_named(self.settings.dictionary)
        if self.settings.known_ids is not None:
            MarkerCodes.of(dictionary, self.settings.known_ids)
        codes = MarkerCodes.of(dictionary, border=self.settings.border)
        self._reader = MarkerReader(codes, self.settings.blur)
        self._border = BorderCheck(self._reader.codes.side)
        self._edges = EdgeFit(self._reader.codes.side)
        self._sharp = SharpEdges(self._reader.codes.side)
        self._others = OtherFamilies(self._reader.fit, self.settings.blur)

    def detect(
        self, image: npt.NDArray[np.uint8], expected: Sequence[Array] = ()
    ) -> list[Detection]:
        """Markers in an image.

        Args:
            image: (height, width) grey levels or (height, width, 3) BGR.
            expected: Corners (4, 2) where markers were in the image before.

        Raises:
            ValueError: The image is empty, not of 8 bits, or of another shape, or OpenCV cannot
                work on it.
        """
        with _opencv_errors():
            found = self._detect(image, expected)
            if not self.settings.inverted:
                return found
            left_out = self.left_out
            found += self._detect(np.asarray(255 - grey_of(image), np.uint8), expected)
            self.left_out += left_out
            return _best(found)

    def other_families(self, image: npt.NDArray[np.uint8]) -> dict[str, list[int]]:
        """Return the ids of markers of other dictionaries, by the dictionary.

        Of dictionaries that begin alike the smallest is named that has all ids. Takes longer than
        `detect`: each outline is held against all of OpenCV's dictionaries.

        Raises:
            ValueError: As `detect`.
        """
        with _opencv_errors():
            prepared = prepare(image)
            pyramid = ImagePyramid(prepared.grey)
            quads = self._candidates(prepared, pyramid)
            if not len(quads):
                return {}
            return self._others.count(pyramid, homographies_of(quads))

    def _detect(self, image: npt.NDArray[np.uint8], expected: Sequence[Array]) -> list[Detection]:
        self.left_out = 0
        prepared = prepare(image)
        pyramid = ImagePyramid(prepared.grey)
        quads = self._candidates(prepared, pyramid)
        if len(expected):
            # a marker that stood there may stand there still although nothing outlines it now
            quads = np.concatenate([np.asarray(expected, dtype=float), quads])
        if not len(quads):
            return []
        homographies = homographies_of(quads)
        cells = self._reader.read_cells(pyramid, homographies)
        found = self._shown_by_cells(pyramid, homographies, cells)
        # the cells of a marker that is read have outlines of their own; to match each with all
        # codes is the dearest step
        unread = np.flatnonzero(~_covered(quads, found))
        for start in range(0, len(unread), _BATCH):
            part = unread[start : start + _BATCH]
            readings = self._reader.read(pyramid, homographies[part], cells.chosen(part))
            if readings is not None:
                found += self._accepted(pyramid, readings)
        return _best(found)

    def _shown_by_cells(
        self, pyramid: ImagePyramid, homographies: Array, cells: CellReadings
    ) -> list[Detection]:
        """Return the markers whose cells alone show their codes."""
        shown = cells.error < _LARGEST_ERROR
        shown &= cells.correlation > self.settings.least_correlation
        if not shown.any():
            return []
        cells = cells.chosen(shown)
        homographies = self._reader.aligned(pyramid, homographies[shown], cells)
        # a draw with the second best code is no confidence at all
        confidence = cells.correlation * (1.0 - 1.0 / cells.lead)
        return self._detections(pyramid, homographies, cells.entries, confidence)

    def _candidates(self, prepared: PreparedImage, pyramid: ImagePyramid) -> Quads:
        """Return quadrilaterals (m, 4, 2) that look like a marker's border, the likeliest first."""
        settings = self.settings
        # noise with a normal distribution exceeds three deviations to one side in 1 of 740 pixels
        contrast = max(settings.contrast, 3.0 * prepared.noise)
        masks = dark_masks(
            prepared.smooth,
            settings.windows,
            contrast,
            settings.bridges,
            touching=settings.border > 1,
        )
        # a smaller image has the same work to spare, not more outlines that are clutter
        limit = settings.max_outlines * max(1.0, _FULL_WORK / prepared.grey.size)
        quads = quads_around(
            masks, min_length=settings.min_length, limit=limit, crowd=settings.max_outlines
        )
        correlation = self._border.correlation(pyramid, homographies_of(quads), contrast)
        passed = correlation > 0.0
        quads, correlation = quads[passed], correlation[passed]
        fitted = self._edges.fitted(pyramid, quads)
        better = self._border.correlation(pyramid, homographies_of(fitted), contrast)
        # the fit may run to a stronger edge beside the border: it counts where the border shows
        # more clearly within it
        closer = better > correlation
        quads[closer], correlation[closer] = fitted[closer], better[closer]
        # masks of several neighbourhoods outline one marker several times: the clearest stays
        best = np.argsort(-correlation)
        best = best[distinct(quads[best], _SAME_QUAD)]
        self.left_out = max(0, len(best) - settings.max_candidates)
        return np.asarray(quads[best[: settings.max_candidates]])

    def _accepted(self, pyramid: ImagePyramid, readings: Readings) -> list[Detection]:
        settings, codes = self.settings, self._reader.codes
        known = self._known(codes.ids[readings.entries])
        listed = known & (settings.known_ids is not None)
        lead = np.where(listed, settings.known_lead, settings.unknown_lead)
        # how much a code says beyond telling the dictionary's markers apart
        spare = codes.bits**2 - np.log2(len(codes.ids))
        # print looks like some code where a dictionary uses a large part of all there are
        lead = lead * max(1.0, (_FEW_SPARE_BITS - spare) / _STRICT_BITS)
        # with the border and without: every code has the border, so that it lifts a poor agreement
        matched = (
            (readings.correlation > settings.least_correlation)
            & (np.minimum(readings.lead, readings.inner_lead) > lead)
            & (readings.wrong <= _CONTRADICTED * codes.bits**2)
            & (readings.wrong_border <= _CONTRADICTED * (codes.side**2 - codes.bits**2))
        )
        accepted = (matched | (readings.error < _LARGEST_ERROR)) & (
            readings.inner > settings.least_inner_correlation
        )
        confidence = readings.correlation * (1.0 - 1.0 / np.maximum(readings.lead, 1.0))
        return self._detections(
            pyramid,
            readings.homographies[accepted],
            readings.entries[accepted],
            confidence[accepted],
        )

    def _known(self, ids: Indices) -> npt.NDArray[np.bool_]:
        known = self.settings.known_ids
        return np.ones(len(ids), bool) if known is None else np.isin(ids, list(known))

    def _detections(
        self,
        pyramid: ImagePyramid,
        homographies: Array,
        entries: Indices,
        confidence: Array,
    ) -> list[Detection]:
        """Return readings as detections, but for those that rather are other families' markers."""
        codes = self._reader.codes
        doubtful = np.flatnonzero(confidence < _SURE)
        if len(doubtful):
            theirs = self._others.explain_better(pyramid, homographies[doubtful], entries[doubtful])
            ours = np.ones(len(entries), bool)
            ours[doubtful[theirs]] = False
            homographies, entries, confidence = homographies[ours], entries[ours], confidence[ours]
        if not len(entries):
            return []
        ids = codes.ids[entries]
        quads = self._sharp.followed(pyramid, corners_of(homographies))
        confidence = confidence * self._sharp.explained(pyramid, quads)
        outlines = [
            np.roll(corners, -turn, axis=0)
            for corners, turn in zip(quads, codes.turns[entries].tolist(), strict=True)
        ]
        return [
            Detection(marker_id, outline, sure, known)
            for marker_id, outline, sure, known in zip(
                ids.tolist(), outlines, confidence.tolist(), self._known(ids).tolist(), strict=True
            )
        ]


@contextmanager
def _opencv_errors() -> Iterator[None]:
    """Raise what OpenCV refuses as a ValueError."""
    try:
        yield
    except cv2.error as error:
        reason = ' '.join(str(getattr(error, 'err', error)).split())
        raise ValueError(f'OpenCV cannot work on this image: {reason}') from error


def _best(found: Sequence[Detection]) -> list[Detection]:
    """Return the surest of detections that lie on each other."""
    ordered = sorted(found, key=lambda detection: -detection.confidence)
    if len(ordered) < 2:
        return ordered
    covered = _covering(np.array([each.corners for each in ordered]), ordered)
    kept: list[int] = []
    for index in range(len(ordered)):
        if not covered[index, kept].any():
            kept.append(index)
    return [ordered[index] for index in kept]


def _covered(quads: Quads, found: Sequence[Detection]) -> npt.NDArray[np.bool_]:
    """Return which quads (m,) have their middle in a marker that is read."""
    if not found:
        return np.zeros(len(quads), bool)
    return np.asarray(_covering(quads, found).any(axis=1))


def _covering(quads: Quads, found: Sequence[Detection]) -> npt.NDArray[np.bool_]:
    """Return in which of the markers that are read (k of them) quads have their middle, (m, k)."""
    outlines = np.array([each.corners for each in found])
    middles = outlines.mean(axis=1)
    reach = np.linalg.norm(outlines - middles[:, None], axis=2).mean(axis=1)
    apart = np.linalg.norm(quads.mean(axis=1)[:, None] - middles[None], axis=2)
    return np.asarray(apart < _COVER * reach)
