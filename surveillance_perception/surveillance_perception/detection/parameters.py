"""The parameters of `aruco_detector`, declared once and read into settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from surveillance_perception.detection.detector import DetectorSettings, MarkerDetector
from surveillance_perception.detection.marker_stream import StreamSettings, sizes_from
from surveillance_runtime import parameter_checks
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import Described, declare_fields


@dataclass(frozen=True)
class ImageSettings:
    """Which images are looked at, and through which lens.

    Attributes:
        field_of_view: Horizontal, degrees, of a camera that tells nothing of itself.
        max_pixels: The largest image that is looked at.
        only_at_rest: Whether images taken while the arm moves are left out.
    """

    field_of_view: float = 60.0
    max_pixels: int = 20_000_000
    only_at_rest: bool = True


def sizes_expected(entries: list[str]) -> str | None:
    """Ask for sizes of markers."""
    try:
        sizes_from(entries)
    except ValueError as error:
        return str(error)
    return None


_DETECTOR = {
    'windows': Described(
        'Neighbourhoods of a border, odd, pixels.', check=parameter_checks.odd_numbers
    ),
    'bridges': Described('Gaps to close in a border, pixels.', 2, 99, of=int),
    'contrast': Described('Grey levels by which a border is darker than around it.', 1.0, 100.0),
    'min_length': Described('Longer side of the smallest marker, pixels.', 4.0, 1000.0),
    'blur': Described("Deviation of the lens's blur in a sharp image, pixels.", 0.0, 5.0),
    'least_correlation': Described('Correlation that a reading needs.', 0.0, 1.0),
    'least_inner_correlation': Described(
        "Correlation over the code's own cells that a reading needs.", 0.0, 1.0
    ),
    'known_lead': Described('Lead over the second best code, known ids.', 1.0, 100.0),
    'unknown_lead': Described('Lead over the second best code, other ids.', 1.0, 100.0),
    'max_outlines': Described(
        'Outlines after which only near quadrilaterals are looked at, in no further mask.',
        1,
        100_000,
    ),
    'max_candidates': Described("Bound of an image's work: outlines that are read.", 1, 100_000),
}
_WATCH = {
    'size': Described('Side of the black square, metres.', 1e-3, 100.0, name='marker_size'),
    'known_frames': Described(
        'Images that confirm a known id.', 1, 100, name='confirmation_frames'
    ),
    'unknown_frames': Described(
        'Images that confirm any other id.', 1, 100, name='unknown_confirmation_frames'
    ),
}
_PICTURES = {
    'field_of_view': Described('Horizontal, degrees, while there is no camera_info.', 5.0, 170.0),
    'max_pixels': Described('The largest image that is looked at.', 1),
    'only_at_rest': Described(
        'Leave out images taken while arm/at_rest is false; without an arm it is never told.'
    ),
}


class DetectorParameters:
    """Declares the parameters on a node; tells when one changed.

    Args:
        node: The node.
        changed: Called after each change.

    Attributes:
        images: Which images are looked at.

    Raises:
        ParameterError: A value given at the start is not allowed.
    """

    def __init__(self, node: PatrolNode, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._detector = DetectorSettings()
        self._watch = StreamSettings()
        self.images = ImageSettings()
        dictionary = node.parameter(
            'marker_dictionary',
            self._detector.dictionary,
            "One of OpenCV's marker dictionaries, or a file in OpenCV's form.",
            check=lambda value: self._problem(dictionary=value),
            on_change=lambda value: self._set_detector('dictionary', value),
        )
        self._detector = replace(self._detector, dictionary=dictionary)
        known = node.parameter(
            'known_ids',
            [],
            'Ids that are expected; empty: none more than another.',
            of=int,
            check=lambda ids: self._problem(known_ids=_known(ids)),
            on_change=lambda ids: self._set_detector('known_ids', _known(ids)),
        )
        self._detector = replace(self._detector, known_ids=_known(known))
        sizes = node.parameter(
            'marker_sizes',
            [],
            "Sizes of ids that differ, like '14:0.3'.",
            of=str,
            check=sizes_expected,
            on_change=lambda entries: self._set_watch('sizes', sizes_from(entries)),
        )
        self._watch = replace(self._watch, sizes=sizes_from(sizes))
        self._detector = declare_fields(
            node, self._detector, _DETECTOR, on_change=self._set_detector
        )
        self._watch = declare_fields(node, self._watch, _WATCH, on_change=self._set_watch)
        self.images = declare_fields(node, self.images, _PICTURES, on_change=self._set_images)

    def settings(self) -> StreamSettings:
        """Return the settings that the present values make."""
        return replace(self._watch, detector=self._detector)

    def _set_detector(self, field: str, value: Any) -> None:
        self._detector = replace(self._detector, **{field: value})
        self._changed()

    def _set_watch(self, field: str, value: Any) -> None:
        self._watch = replace(self._watch, **{field: value})
        self._changed()

    def _set_images(self, field: str, value: Any) -> None:
        self.images = replace(self.images, **{field: value})
        self._changed()

    def _problem(self, **changed: Any) -> str | None:
        used = {'dictionary': self._detector.dictionary, 'known_ids': self._detector.known_ids}
        try:
            MarkerDetector(DetectorSettings(**{**used, **changed}))
        except ValueError as error:
            return str(error)
        return None


def _known(ids: Sequence[int]) -> frozenset[int] | None:
    return frozenset(ids) or None
