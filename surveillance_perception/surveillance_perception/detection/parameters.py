"""The parameters of `aruco_detector`, declared once and read into settings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from surveillance_perception.detection.detector import DetectorSettings, MarkerDetector
from surveillance_perception.detection.marker_stream import StreamSettings
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import parameter


@dataclass(frozen=True)
class ImageSettings:
    """Which images are looked at, and through which lens."""

    field_of_view: float = parameter(
        60.0, 'Horizontal, degrees, while there is no camera_info.', 5.0, 170.0
    )
    max_pixels: int = parameter(20_000_000, 'The largest image that is looked at.', 1)
    only_at_rest: bool = parameter(
        True, 'Leave out images taken while arm/at_rest is false; without an arm it is never told.'
    )


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
        self._codes: dict[str, Any] = {'dictionary': DetectorSettings.dictionary}
        self._codes['dictionary'] = node.parameter(
            'marker_dictionary',
            DetectorSettings.dictionary,
            "One of OpenCV's marker dictionaries, or a file in OpenCV's form.",
            check=lambda value: self._problem(dictionary=value),
            on_change=lambda value: self._set_codes(dictionary=value),
        )
        known = node.parameter(
            'known_ids',
            [],
            'Ids that are expected; empty: none more than another.',
            of=int,
            check=lambda ids: self._problem(known_ids=_known(ids)),
            on_change=lambda ids: self._set_codes(known_ids=_known(ids)),
        )
        self._codes['known_ids'] = _known(known)
        self._stream = node.declare_fields(StreamSettings(), on_change=self._set_stream)
        self.images = node.declare_fields(ImageSettings(), on_change=self._set_images)

    def settings(self) -> StreamSettings:
        """Return the settings that the present values make."""
        return replace(self._stream, detector=replace(self._stream.detector, **self._codes))

    def _set_codes(self, **changed: Any) -> None:
        self._codes.update(changed)
        self._changed()

    def _set_stream(self, settings: StreamSettings) -> None:
        self._stream = settings
        self._changed()

    def _set_images(self, settings: ImageSettings) -> None:
        self.images = settings
        self._changed()

    def _problem(self, **changed: Any) -> str | None:
        try:
            MarkerDetector(DetectorSettings(**{**self._codes, **changed}))
        except ValueError as error:
            return str(error)
        return None


def _known(ids: Sequence[int]) -> frozenset[int] | None:
    return frozenset(ids) or None
