"""Where markers are, from all views of them: positions fused by their covariances.

Each view gives a position in the camera's frame with a covariance, long along the line of sight and
short across it. In a fixed frame the views of a turning camera lie differently, so together they
are surer than each alone: the information filter adds inverse covariances (Thrun, Burgard and Fox,
"Probabilistic Robotics", section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_MOST_AMBIGUOUS = 0.95
# 99.9 % of a chi-squared distribution with three degrees of freedom
_SAME_PLACE = 16.27
_MOVED_VIEWS = 5
# images that show an id at two places until it hangs there twice, and places that are kept of one
_TOGETHER, _MOST_PLACES = 3, 4
_CARRIER_DEVIATION = 0.02

MOST_MARKERS = 4096
"""So many ids are kept: more than any usual dictionary has."""


class FusedPosition(NamedTuple):
    """Where a marker is in the fixed frame.

    Attributes:
        position: (3,) metres.
        covariance: (3, 3) square metres.
        views: How many views it is made of.
    """

    position: Array
    covariance: Array
    views: int

    def distance_to(self, point: Array) -> float:
        """Return how many standard deviations away (Mahalanobis) a point (3,) is."""
        apart = np.asarray(point, dtype=float) - self.position
        return float(np.sqrt(apart @ np.linalg.solve(self.covariance, apart)))


def is_measured(position: Array, covariance: Array) -> bool:
    """Return whether a position (3,) and its covariance (3, 3) are such as a measurement gives."""
    if not np.isfinite(position).all() or not np.isfinite(covariance).all():
        return False
    return bool(np.linalg.eigvalsh((covariance + covariance.T) / 2.0)[0] > 0.0)


class _Place:
    """Somewhere an id was seen: a sum of views.

    Attributes:
        views: How many.
        in_a_row: How many since the id was last seen at the place that is told.
        told: Whether it was ever told as the marker's position.
        image: The last one that shows the id here; 0 where images are not told apart.
    """

    def __init__(self) -> None:
        self._information = np.zeros((3, 3))
        self._weighed = np.zeros(3)
        self._carrier = np.zeros((3, 3))
        self.views = self.in_a_row = 0
        self.told = False
        self.image = 0

    def add(self, place: Array, covariance: Array, carrier: Array, image: int) -> None:
        information = np.linalg.inv(covariance)
        self._information += information
        self._weighed += information @ place
        self.views += 1
        self._carrier += (carrier - self._carrier) / self.views
        self.in_a_row += 1
        self.image = image

    @property
    def fused(self) -> FusedPosition:
        # what all views share does not become less with their number
        covariance = np.linalg.inv(self._information) + self._carrier
        position = np.asarray(np.linalg.solve(self._information, self._weighed), dtype=float)
        return FusedPosition(position, covariance, self.views)

    def square_to(self, place: Array, covariance: Array) -> float:
        """Return the squared Mahalanobis distance of a view (3,) with its covariance (3, 3)."""
        fused = self.fused
        apart = place - fused.position
        return float(apart @ np.linalg.solve(fused.covariance + covariance, apart))


@dataclass
class _Panels:
    """The places at which one id was seen.

    Attributes:
        places: All of them, the one that is told first.
        together: Images that show the id at two of them.
        two: Whether there are two panels with this id.
    """

    places: list[_Place] = field(default_factory=list)
    together: int = 0
    two: bool = False

    def place_of(self, place: Array, covariance: Array) -> _Place:
        """Return the place that a view fits, a new one where it fits none."""
        by_distance = [(each.square_to(place, covariance), each) for each in self.places]
        square, nearest = min(by_distance, key=lambda pair: pair[0], default=(np.inf, None))
        if nearest is not None and square <= _SAME_PLACE:
            return nearest
        if len(self.places) == _MOST_PLACES:
            self.places.remove(min(self.places[1:], key=lambda each: (each.told, each.views)))
        self.places.append(_Place())
        return self.places[-1]

    def note(self, seen: _Place) -> None:
        """Take note of where the id was seen last: it may hang elsewhere now, or twice."""
        self.together += any(
            each.image == seen.image > 0 for each in self.places if each is not seen
        )
        if seen is self.places[0]:
            for each in self.places[1:]:
                each.in_a_row = 0
            seen.told = True
        elif seen.in_a_row >= _MOVED_VIEWS:
            # a marker that was moved does not come back
            self.two |= seen.told
            if not self.two:
                self.places.remove(seen)
                self.places.insert(0, seen)
                self.places[1].in_a_row = 0
                seen.told = True
        self.two |= self.together >= _TOGETHER


class FusedPositions:
    """Positions of markers in a fixed frame, fused over views.

    A view that lies elsewhere by more than its covariance allows is left out; after several in a
    row the marker is taken to have been moved, and its position begins anew. If it is seen at the
    former place again, or at both in the same images, there are two panels with one id: the
    position stays, and `two_places` tells both.

    Attributes:
        is_full: Whether `MOST_MARKERS` ids are known, and a view of a further one was left out.
    """

    def __init__(self) -> None:
        self.is_full = False
        self._panels: dict[int, _Panels] = {}
        self._image = 0

    def next_image(self) -> None:
        """Begin an image: what is added until the next one was seen at the same time."""
        self._image += 1

    def add(
        self,
        marker_id: int,
        camera: Array,
        position: Array,
        covariance: Array,
        ambiguity: float,
        carrier: Array | None = None,
    ) -> bool:
        """Take a view.

        Args:
            marker_id: The marker.
            camera: Transform (4, 4) from the camera's optical frame to the fixed frame.
            position: (3,) of the marker in the optical frame, metres.
            covariance: (3, 3) of it, square metres.
            ambiguity: Of the pose, 0 to 1; near 1 the distance is as doubtful as the tilt.
            carrier: (3, 3) of the marker's place by what the camera's own pose may be off, in the
                fixed frame, square metres: many views from one stand share that error, so that it
                does not become less with their number. None: an arm on a base that stands.

        Returns:
            Whether it counts: it is a finite view, not too ambiguous, of where the marker is, and
            there was room for the id.
        """
        # the arm and its base are not exact either
        least = np.eye(3) * _CARRIER_DEVIATION**2
        shared = least if carrier is None else least + carrier
        if ambiguity > _MOST_AMBIGUOUS or not is_measured(position, covariance):
            return False
        if marker_id not in self._panels and len(self._panels) >= MOST_MARKERS:
            self.is_full = True
            return False
        turn = camera[:3, :3]
        covariance = turn @ covariance @ turn.T + shared
        place = turn @ position + camera[:3, 3]
        panels = self._panels.setdefault(marker_id, _Panels())
        seen = panels.place_of(place, covariance)
        seen.add(place, covariance, shared, self._image)
        panels.note(seen)
        return seen is panels.places[0]

    def position_of(self, marker_id: int) -> FusedPosition | None:
        """Return where a marker is; None when it was not seen."""
        panels = self._panels.get(marker_id)
        return None if panels is None else panels.places[0].fused

    def two_places(self, marker_id: int) -> tuple[FusedPosition, FusedPosition] | None:
        """Return the positions of two panels with one id; None while one explains all views."""
        panels = self._panels.get(marker_id)
        if panels is None or not panels.two:
            return None
        other = max(panels.places[1:], key=lambda each: (each.told, each.views))
        return panels.places[0].fused, other.fused

    @property
    def twins(self) -> list[int]:
        """The ids of which there are two panels."""
        return sorted(marker_id for marker_id, panels in self._panels.items() if panels.two)
