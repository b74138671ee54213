"""Persons over several pictures: finds of one person become a track.

Where somebody stands on the map is followed by a Kalman filter with constant velocity (Bar-Shalom,
Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, chapter 6), and
the finds of a picture are given to tracks by the Hungarian method (`linear_sum_assignment`). A find
whose place is not known is given to the only track without one.

How sure a track is: the log odds of its finds, where pictures of one moment err together, so that
each further one counts a quarter; a picture that shows where somebody should be, and nobody, counts
against it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Array = NDArray[np.float64]
Spot = tuple[float, float]

ACCELERATION = 1.0
"""Of who walks, standard deviation, m/s^2: from standing to a walk in a second."""
SPEED = 1.2
"""And speed at most times, standard deviation of a new track's, m/s."""
MEASURED = 0.3
"""Standard deviation of where a picture and the lidar put somebody, metres."""
GATE = 9.21
"""99 % of a chi-squared distribution with two degrees of freedom."""
FORGOTTEN = 10.0
"""A track that nothing was given to for so long ends, seconds."""
FURTHER = 0.25
"""What a further picture counts, of an independent one."""
MISSED = 1.0
"""Log odds that a picture without a find takes away."""
MOST_ODDS = 6.0
"""Log odds at most, of 0.9975: a track that is wrong is doubtful again after six pictures that
show nobody."""
MOST_TRACKS = 100
"""Bounds the memory, and the work of the assignment."""


@dataclass
class PersonTrack:
    """One person over several pictures.

    Attributes:
        number: From 1.
        stamp: Of the last picture, seconds since 1970.
        state: (4,) position and velocity on the map, metres and m/s; None: it has no place.
        covariance: Of these, (4, 4).
        finds: How many pictures showed the person.
        odds: How sure it is, as log odds.
    """

    number: int
    stamp: float
    state: Array | None
    covariance: Array = field(default_factory=lambda: np.eye(4))
    finds: int = 0
    odds: float = 0.0

    @property
    def confidence(self) -> float:
        """How likely it is a person, 0 to 1."""
        return 1.0 / (1.0 + math.exp(-self.odds))

    @property
    def position(self) -> Spot | None:
        """Where the person is, map frame, metres; None: not known."""
        return None if self.state is None else (float(self.state[0]), float(self.state[1]))

    def predict(self, stamp: float) -> None:
        """Move it to a later time."""
        after = max(0.0, stamp - self.stamp)
        self.stamp = max(self.stamp, stamp)
        if self.state is None or not after:
            return
        step = np.eye(4)
        step[0, 2] = step[1, 3] = after
        pull = np.array([[after**2 / 2, 0], [0, after**2 / 2], [after, 0], [0, after]])
        self.state = step @ self.state
        self.covariance = step @ self.covariance @ step.T + ACCELERATION**2 * pull @ pull.T

    def distance(self, spot: Spot) -> float:
        """Return the squared Mahalanobis distance to where somebody was found."""
        assert self.state is not None
        off = np.asarray(spot) - self.state[:2]
        return float(off @ np.linalg.solve(self._spread(), off))

    def take(self, confidence: float, spot: Spot | None) -> None:
        """Take a find."""
        sure = min(0.999, max(0.001, confidence))
        self.odds += (FURTHER if self.finds else 1.0) * math.log(sure / (1.0 - sure))
        self.odds = min(MOST_ODDS, self.odds)
        self.finds += 1
        if spot is None:
            return
        if self.state is None:
            self.state = np.array([*spot, 0.0, 0.0])
            self.covariance = np.diag([MEASURED**2, MEASURED**2, SPEED**2, SPEED**2])
            return
        gain = self.covariance[:, :2] @ np.linalg.inv(self._spread())
        self.state = self.state + gain @ (np.asarray(spot) - self.state[:2])
        self.covariance = self.covariance - gain @ self.covariance[:2]

    def _spread(self) -> Array:
        return self.covariance[:2, :2] + MEASURED**2 * np.eye(2)


class PersonTracks:
    """The tracks of a visit; owned by whoever calls it, one thread."""

    def __init__(self) -> None:
        self._tracks: list[PersonTrack] = []
        self._next = 1

    def begin(self) -> None:
        """Take that a visit begins."""
        self._tracks = []

    def take(
        self, finds: Sequence[tuple[float, Spot | None]], stamp: float, in_view: Sequence[bool] = ()
    ) -> list[PersonTrack]:
        """Give the finds of a picture to tracks; return those tracks, the surest first.

        Args:
            finds: How sure each is, and where, map frame, metres; None: not known.
            stamp: Of the picture, seconds since 1970.
            in_view: Of each of `tracks`, whether the picture shows where it should be; shorter: not
                known.
        """
        known = self.tracks(stamp)
        given = self._assigned(known, [spot for _, spot in finds])
        seen = []
        for index, (confidence, spot) in enumerate(finds):
            track = given.get(index)
            if track is None:
                track = PersonTrack(self._next, stamp, None)
                self._next += 1
                self._tracks.append(track)
            track.take(confidence, spot)
            seen.append(track)
        for track, is_shown in zip(known, in_view, strict=False):
            if is_shown and not any(track is each for each in seen):
                track.odds -= MISSED
        self._tracks = [each for each in self._tracks if each.odds > -MOST_ODDS][-MOST_TRACKS:]
        return sorted(seen, key=lambda each: -each.odds)

    def tracks(self, stamp: float) -> list[PersonTrack]:
        """Return the tracks that go on, moved to a time."""
        self._tracks = [each for each in self._tracks if 0.0 <= stamp - each.stamp <= FORGOTTEN]
        for each in self._tracks:
            each.predict(stamp)
        return list(self._tracks)

    def _assigned(
        self, tracks: Sequence[PersonTrack], spots: Sequence[Spot | None]
    ) -> dict[int, PersonTrack]:
        """Return which find belongs to which track."""
        placed = [each for each in tracks if each.state is not None]
        here = [(index, spot) for index, spot in enumerate(spots) if spot is not None]
        found: dict[int, PersonTrack] = {}
        if placed and here:
            costs = np.array([[each.distance(spot) for each in placed] for _, spot in here])
            rows, columns = linear_sum_assignment(np.minimum(costs, 10.0 * GATE))
            for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
                if costs[row, column] <= GATE:
                    found[here[row][0]] = placed[column]
        rest = [each for each in tracks if each.state is None]
        lost = [index for index, spot in enumerate(spots) if index not in found]
        if len(rest) == 1 and lost:
            found[lost[0]] = rest[0]
        return found
