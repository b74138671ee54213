"""The parameters of `aruco_detector`, declared once and read into settings."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from surveillance_perception.detection import DetectorSettings, MarkerDetector
from surveillance_perception.detection_watch import WatchSettings, sizes_from
from surveillance_perception.dictionaries import DICTIONARY_NAMES
from surveillance_runtime.node import PatrolNode

_DEFAULT = DetectorSettings()
_WATCH = WatchSettings()

_NUMBERS: tuple[tuple[str, float, str, float, float], ...] = (
    (
        'contrast',
        _DEFAULT.contrast,
        'Grey levels by which a border is darker than around it.',
        1,
        100,
    ),
    ('min_length', _DEFAULT.min_length, 'Longer side of the smallest marker, pixels.', 4, 1000),
    ('blur', _DEFAULT.blur, "Deviation of the lens's blur in a sharp picture, pixels.", 0, 5),
    ('least_correlation', _DEFAULT.least_correlation, 'Correlation that a reading needs.', 0, 1),
    (
        'least_inner_correlation',
        _DEFAULT.least_inner_correlation,
        "Correlation over the code's own cells that a reading needs.",
        0,
        1,
    ),
    ('known_lead', _DEFAULT.known_lead, 'Lead over the second best code, known ids.', 1, 100),
    ('unknown_lead', _DEFAULT.unknown_lead, 'Lead over the second best code, other ids.', 1, 100),
)
_COUNTS: tuple[tuple[str, int, str, int, int], ...] = (
    (
        'max_outlines',
        _DEFAULT.max_outlines,
        'Dark outlines after which no further neighbourhood or bridge is tried.',
        1,
        100000,
    ),
    ('max_candidates', _DEFAULT.max_candidates, 'Outlines of a picture that are read.', 1, 500),
    ('confirmation_frames', _WATCH.known_frames, 'Pictures that confirm a known id.', 1, 100),
    (
        'unknown_confirmation_frames',
        _WATCH.unknown_frames,
        'Pictures that confirm any other id.',
        1,
        100,
    ),
)


class DetectorParameters:
    """Declares the parameters on a node; tells when one changed.

    Args:
        node: The node.
        changed: Called after each change.

    Raises:
        ParameterError: A value given at the start is not allowed.
    """

    def __init__(self, node: PatrolNode, changed: Callable[[], None]) -> None:
        self._values: dict[str, Any] = {'marker_dictionary': _DEFAULT.dictionary, 'known_ids': []}
        self._node = node
        self._changed = changed
        self._add(
            'marker_dictionary',
            _DEFAULT.dictionary,
            "One of OpenCV's marker dictionaries.",
            choices=DICTIONARY_NAMES,
            check=lambda value: self._check(marker_dictionary=value),
        )
        self._add(
            'known_ids',
            [],
            'Ids that are expected; empty: none more than another.',
            of=int,
            check=lambda value: self._check(known_ids=value),
        )
        self._add(
            'marker_size',
            _WATCH.size,
            'Side of the black square, metres.',
            minimum=1e-3,
            maximum=100.0,
        )
        self._add(
            'marker_sizes',
            [],
            "Sizes of ids that differ, like '14:0.3'.",
            of=str,
            check=_check_sizes,
        )
        self._add(
            'windows',
            list(_DEFAULT.windows),
            'Neighbourhoods of a border, odd, pixels.',
            check=_check_windows,
        )
        self._add(
            'bridges',
            list(_DEFAULT.bridges),
            'Gaps to close in a border, pixels.',
            of=int,
            minimum=2,
            maximum=99,
        )
        self._add(
            'field_of_view',
            60.0,
            'Horizontal, degrees, while there is no camera_info.',
            minimum=5.0,
            maximum=170.0,
        )
        self._add('max_pixels', 20_000_000, 'The largest picture that is looked at.', minimum=1)
        self._add(
            'only_at_rest',
            True,
            'Leave out pictures taken while arm/at_rest is false; without an arm it is never told.',
        )
        for name, number, text, least, most in _NUMBERS:
            self._add(name, float(number), text, minimum=float(least), maximum=float(most))
        for name, count, text, lowest, highest in _COUNTS:
            self._add(name, count, text, minimum=lowest, maximum=highest)

    def settings(self) -> WatchSettings:
        """The settings that the present values make."""
        values = self._values
        detector = DetectorSettings(
            dictionary=values['marker_dictionary'],
            known_ids=frozenset(values['known_ids']) or None,
            windows=tuple(values['windows']),
            bridges=tuple(values['bridges']),
            max_outlines=values['max_outlines'],
            max_candidates=values['max_candidates'],
            **{name: values[name] for name, *_ in _NUMBERS},
        )
        return WatchSettings(
            detector,
            values['marker_size'],
            sizes_from(values['marker_sizes']),
            values['confirmation_frames'],
            values['unknown_confirmation_frames'],
        )

    @property
    def field_of_view(self) -> float:
        """Horizontal field of view of a camera that tells nothing of itself, rad."""
        return math.radians(self._values['field_of_view'])

    @property
    def max_pixels(self) -> int:
        """The largest picture that is looked at."""
        return int(self._values['max_pixels'])

    @property
    def only_at_rest(self) -> bool:
        """Whether pictures taken while the arm moves are left out."""
        return bool(self._values['only_at_rest'])

    def _add(self, name: str, default: Any, description: str, **limits: Any) -> None:
        def adopt(value: Any) -> None:
            self._values[name] = value
            self._changed()

        self._values[name] = self._node.parameter(
            name, default, description, on_change=adopt, **limits
        )

    def _check(self, **changed: Any) -> str | None:
        values = {**self._values, **changed}
        known = frozenset(values['known_ids']) or None
        try:
            MarkerDetector(DetectorSettings(values['marker_dictionary'], known))
        except ValueError as error:
            return str(error)
        return None


def _check_sizes(entries: list[str]) -> str | None:
    try:
        sizes_from(entries)
    except ValueError as error:
        return str(error)
    return None


def _check_windows(windows: list[int]) -> str | None:
    if windows and all(each >= 3 and each % 2 for each in windows):
        return None
    return 'odd numbers from 3'
