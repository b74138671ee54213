"""Whether somebody walks: what a lidar meets, sweep after sweep, where all was free before.

A thing that stands is met at the same spot in each sweep. What walks is met where beams passed
until now, and again a step farther on. Legs alone are no sign of a person: chairs have them, too.
So one who stands still is not told from a thing here: that takes the camera.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from indoor_watch.doors import Segment
from indoor_watch.floor import LEAF_SLACK

Points = NDArray[np.float64]
_Spot = tuple[float, tuple[float, float]]
"""When something was met, seconds, and where, map frame, metres."""

TOGETHER = 0.45
"""Points so near to each other are of one thing, metres: two legs."""
LARGEST = 1.0
"""Extent of a person as a lidar sees one, metres."""
ATTACHED = 0.25
"""What a sweep meets so near to a thing belongs to it, metres: the end of a wall that comes
into view bit by bit goes on in the wall; who walks stands alone."""
FASTEST = 2.5
"""Metres per second."""
SPAN = 3.0
"""A walk is told from what was met within so many seconds."""
STEPS = 5
"""It was met at so many spots."""
WAY = 0.5
"""It went so far, metres."""
WAY_AFAR = 0.12
"""And so many rad as seen from the lidar: an error of the heading moves what stands far off."""
STEADY = 0.85
"""So much of the variance of the spots is a steady motion along a line."""
STRAIGHT = 0.6
"""The way from the first spot to the last is this part of the whole way, at least."""
ONE_STEP = 0.5
"""Without its longest step a walk is still this part of its way, or long enough by itself: what was
met at two places only has not walked, and who walks behind something is met again farther on."""
MOST_SHARE = 0.25
"""When more of a sweep ends where all was free, the pose is wrong, not the room full."""
APART = 0.2
"""Spots that were met within a shorter time count as one, seconds: the middle of what is seen of a
person jumps by a leg from one sweep to the next, and many small jumps look like a long way."""
OFF_DOOR = 2
"""So many spots of a walk lie beyond the reach of any one leaf, which swings about its hinge."""


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
    spots: deque[_Spot] = field(default_factory=deque)

    def add(self, spot: _Spot) -> None:
        """Add where it is met now; the one before is replaced if it was met just before."""
        if len(self.spots) > 1 and spot[0] - self.spots[-2][0] < APART:
            self.spots.pop()
        self.spots.append(spot)
        while spot[0] - self.spots[0][0] > SPAN:
            self.spots.popleft()


class WalkFinder:
    """Follows what was met where all was free.

    Args:
        doors: The doors' openings, map frame, metres.
    """

    def __init__(self, doors: Iterable[Segment] = ()) -> None:
        self._tracks: list[_Track] = []
        # Each jamb may be the hinge of its leaf.
        self._leaves = [
            (jamb, math.dist(each[:2], each[2:]) + LEAF_SLACK)
            for each in doors
            for jamb in (each[:2], each[2:])
        ]

    def clear(self) -> None:
        """Forget all: another visit begins."""
        self._tracks = []

    def add(
        self,
        sensor: tuple[float, float],
        fresh: Points,
        met: Points,
        beams: int,
        stamp: float,
    ) -> list[Walk]:
        """Take the ends of one sweep that lie where all was free before; return what walks.

        Args:
            sensor: Where the lidar was, map frame, metres.
            fresh: (n, 2), map frame, metres; without walls and known things.
            met: All ends of the sweep where something was met, (m, 2), likewise.
            beams: How many beams the sweep has.
            stamp: Seconds; a later one than before.
        """
        self._tracks = [each for each in self._tracks if stamp - each.spots[-1][0] <= SPAN]
        if not len(fresh) or len(fresh) > MOST_SHARE * beams:
            return []
        found = []
        for spot in _things(fresh, met):
            track = self._nearest(spot, stamp)
            if track is None:
                track = _Track()
                self._tracks.append(track)
            track.add((stamp, spot))
            walk = _walk(track.spots, math.dist(sensor, spot))
            if walk is not None and not self._is_leaf(track.spots):
                found.append(walk)
        return found

    def _is_leaf(self, spots: Sequence[_Spot]) -> bool:
        """Tell whether one leaf may have been met at all spots but a stray one."""
        return any(
            sum(math.dist(jamb, at) > reach for _, at in spots) < OFF_DOOR
            for jamb, reach in self._leaves
        )

    def _nearest(self, spot: tuple[float, float], stamp: float) -> _Track | None:
        near = [
            (away, number)
            for number, each in enumerate(self._tracks)
            if each.spots[-1][0] < stamp
            and (away := math.dist(each.spots[-1][1], spot))
            <= FASTEST * (stamp - each.spots[-1][0]) + 0.2
        ]
        return self._tracks[min(near)[1]] if near else None


def _things(points: Points, met: Points) -> list[tuple[float, float]]:
    """Return the middles of groups of points that are as large as a person at most, and stand
    alone in all that was met."""
    if len(points) < 2:
        return []
    groups = fcluster(linkage(points, 'single'), TOGETHER, 'distance')
    found = []
    for number in range(1, int(groups.max()) + 1):
        members = points[groups == number]
        if len(members) < 2 or float(np.ptp(members, axis=0).max()) > LARGEST:
            continue
        if _reach(members, met) > LARGEST:
            continue
        x, y = members.mean(axis=0).tolist()
        found.append((float(x), float(y)))
    return found


def _reach(members: Points, met: Points) -> float:
    """Return the extent of a group with all that hangs together with it, metres."""
    near = met[(np.abs(met - members.mean(axis=0)) <= 2 * LARGEST).all(axis=1)]
    if len(near) < 2:
        return 0.0
    groups = fcluster(linkage(near, 'single'), ATTACHED, 'distance')
    apart = np.linalg.norm(near[:, None] - members[None], axis=2).min(axis=1)
    joined = np.isin(groups, groups[apart < ATTACHED])
    return float(np.ptp(near[joined], axis=0).max()) if joined.any() else 0.0


def _walk(spots: Sequence[_Spot], distance: float) -> Walk | None:
    if len(spots) < STEPS:
        return None
    (began, first), (ended, last) = spots[0], spots[-1]
    away = math.dist(first, last)
    steps = [math.dist(a[1], b[1]) for a, b in pairwise(spots)]
    enough = max(WAY, WAY_AFAR * distance)
    if away < enough or away < STRAIGHT * sum(steps):
        return None
    # Two things that stand, one of which is met and then the other, are one step apart.
    if away - max(steps) < min(enough, ONE_STEP * away):
        return None
    if _steadiness(spots) < STEADY:
        return None
    return Walk(last, away / max(ended - began, 1e-3))


def _steadiness(spots: Sequence[_Spot]) -> float:
    """Return how much of the variance of the spots a constant velocity explains, 0 to 1."""
    times = np.array([stamp for stamp, _ in spots])
    offsets = np.array([at for _, at in spots])
    times, offsets = times - times.mean(), offsets - offsets.mean(axis=0)
    velocity = times @ offsets / max(float(times @ times), 1e-9)
    rest = offsets - times[:, None] * velocity
    return 1.0 - float((rest**2).sum()) / max(float((offsets**2).sum()), 1e-9)
