"""Whether somebody walks: what a lidar meets, sweep after sweep, where all was free before.

A thing that stands is met at the same spot in each sweep. What walks is met where beams passed
until now, and again a step farther on. Legs alone are no sign of a person: chairs have them, too.
So one who stands still is not told from a thing here: that takes the camera.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

Points = NDArray[np.float64]

TOGETHER = 0.45
"""Points so near to each other are of one thing, metres: two legs."""
LARGEST = 1.0
"""Extent of a person as a lidar sees one, metres."""
FASTEST = 2.5
"""Metres per second."""
SPAN = 3.0
"""A walk is told from what was met within so many seconds."""
STEPS = 4
"""It was met at so many spots."""
WAY = 0.5
"""It went so far, metres."""
STRAIGHT = 0.6
"""The way from the first spot to the last is this part of the whole way, at least."""
MOST_SHARE = 0.25
"""When more of a sweep ends where all was free, the pose is wrong, not the room full."""


@dataclass(frozen=True)
class Walk:
    """Something that walks.

    Attributes:
        position: Where it is, map frame, metres.
        speed: Metres per second.
    """

    position: tuple[float, float]
    speed: float


@dataclass
class _Track:
    spots: deque[tuple[float, tuple[float, float]]] = field(
        default_factory=lambda: deque(maxlen=20)
    )


class WalkFinder:
    """Follows what was met where all was free."""

    def __init__(self) -> None:
        self._tracks: list[_Track] = []

    def clear(self) -> None:
        """Forget all: another visit begins."""
        self._tracks = []

    def add(self, fresh: Points, beams: int, stamp: float) -> list[Walk]:
        """Take the ends of one sweep that lie where all was free before; return what walks.

        Args:
            fresh: (n, 2), map frame, metres; without walls, known things and leaves of doors.
            beams: How many beams the sweep has.
            stamp: Seconds; a later one than before.
        """
        self._tracks = [
            each for each in self._tracks if stamp - each.spots[-1][0] <= SPAN and each.spots
        ]
        if not len(fresh) or len(fresh) > MOST_SHARE * beams:
            return []
        found = []
        for spot in _things(fresh):
            track = self._nearest(spot, stamp)
            if track is None:
                track = _Track()
                self._tracks.append(track)
            track.spots.append((stamp, spot))
            walk = _walk([each for each in track.spots if stamp - each[0] <= SPAN])
            if walk is not None:
                found.append(walk)
        return found

    def _nearest(self, spot: tuple[float, float], stamp: float) -> _Track | None:
        near = [
            (away, number)
            for number, each in enumerate(self._tracks)
            if each.spots[-1][0] < stamp
            and (away := math.dist(each.spots[-1][1], spot))
            <= FASTEST * (stamp - each.spots[-1][0]) + 0.2
        ]
        return self._tracks[min(near)[1]] if near else None


def _things(points: Points) -> list[tuple[float, float]]:
    """Return the middles of groups of points that are as large as a person at most."""
    if len(points) < 2:
        return []
    groups = fcluster(linkage(points, 'single'), TOGETHER, 'distance')
    found = []
    for number in range(1, int(groups.max()) + 1):
        members = points[groups == number]
        if len(members) < 2 or float(np.ptp(members, axis=0).max()) > LARGEST:
            continue
        x, y = members.mean(axis=0).tolist()
        found.append((float(x), float(y)))
    return found


def _walk(spots: Sequence[tuple[float, tuple[float, float]]]) -> Walk | None:
    if len(spots) < STEPS:
        return None
    (began, first), (ended, last) = spots[0], spots[-1]
    away = math.dist(first, last)
    way = sum(math.dist(a[1], b[1]) for a, b in pairwise(spots))
    if away < WAY or away < STRAIGHT * way:
        return None
    return Walk(last, away / max(ended - began, 1e-3))
