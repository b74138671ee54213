"""Where markers are, from all views of them: positions fused by their covariances.

Each view gives a position in the camera's frame with a covariance, long along the line of sight and
short across it. In a fixed frame the views of a turning camera lie differently, so together they
are surer than each alone: the information filter adds inverse covariances (Thrun, Burgard and Fox,
"Probabilistic Robotics", section 3.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_MOST_AMBIGUOUS = 0.95
# 99.9 % of a chi-squared distribution with three degrees of freedom
_SAME_PLACE = 16.27
_MOVED_VIEWS = 5
_CARRIER_DEVIATION = 0.02


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


@dataclass
class _Sum:
    information: Array
    weighed: Array
    views: int = 0
    elsewhere: int = 0


class FusedPositions:
    """Positions of markers in a fixed frame, fused over views.

    A view that lies elsewhere by more than its covariance allows is left out; after several in a
    row the marker is taken to have been moved, and its position begins anew.
    """

    def __init__(self) -> None:
        self._sums: dict[int, _Sum] = {}

    def add(
        self, marker_id: int, camera: Array, position: Array, covariance: Array, ambiguity: float
    ) -> bool:
        """Take a view.

        Args:
            marker_id: The marker.
            camera: Transform (4, 4) from the camera's optical frame to the fixed frame.
            position: (3,) of the marker in the optical frame, metres.
            covariance: (3, 3) of it, square metres.
            ambiguity: Of the pose, 0 to 1; near 1 the distance is as doubtful as the tilt.

        Returns:
            Whether it counts: it is a finite view, not too ambiguous, of where the marker was.
        """
        # the arm and its base are not exact either
        covariance = covariance + np.eye(3) * _CARRIER_DEVIATION**2
        if ambiguity > _MOST_AMBIGUOUS or not is_measured(position, covariance):
            return False
        turn = camera[:3, :3]
        seen = turn @ covariance @ turn.T
        place = turn @ position + camera[:3, 3]
        fused = self.position_of(marker_id)
        if fused is not None:
            apart = place - fused.position
            total = self._sums[marker_id]
            if apart @ np.linalg.solve(fused.covariance + seen, apart) > _SAME_PLACE:
                total.elsewhere += 1
                if total.elsewhere < _MOVED_VIEWS:
                    return False
                del self._sums[marker_id]
        total = self._sums.setdefault(marker_id, _Sum(np.zeros((3, 3)), np.zeros(3)))
        information = np.linalg.inv(seen)
        total.information += information
        total.weighed += information @ place
        total.views += 1
        total.elsewhere = 0
        return True

    def position_of(self, marker_id: int) -> FusedPosition | None:
        """Return where a marker is; None when it was not seen."""
        total = self._sums.get(marker_id)
        if total is None:
            return None
        covariance = np.linalg.inv(total.information)
        # what all views share does not become less with their number
        covariance = covariance + np.eye(3) * _CARRIER_DEVIATION**2
        position = np.asarray(np.linalg.solve(total.information, total.weighed), dtype=float)
        return FusedPosition(position, covariance, total.views)
