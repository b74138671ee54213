"""Where something stood, by the stamps of its readings: a robot's base, or the joints of its arm.

A picture is worth what is known of its camera's pose at the moment it was taken. It arrives later,
by seconds on a busy machine or where simulated time runs fast, and the robot may be elsewhere by
then. So the last readings are kept, and a picture is paired with those around its own stamp. One
that was taken in motion, or at a time of which no reading tells, has no pose.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

LATE = 0.5
"""A reading that is older than the one before by this much, seconds, or less came late; by more,
the clock was set back, or the one before was stamped by another."""
AHEAD = 0.2
"""The last reading counts for so much longer, seconds: the next one is still on its way."""
LONGEST_GAP = 5.0
"""Equal readings that are farther apart do not tell that nothing moved in between, seconds."""
KEPT = 60.0
"""For so long readings are kept, seconds."""
_MOST_RESTS = 4000
SAME_TIME = 0.02
"""Two stamps that are so near are of the same moment, seconds."""

_Where = TypeVar('_Where')


@dataclass
class _Rest:
    """A time in which all readings were nearly the same."""

    first: float
    last: float
    at: tuple[float, ...]


class StampedReadings:
    """The last readings of something that moves and rests, as the times of its rests.

    Args:
        within: Readings that differ by less, in each value, are the same.
        angles: Which of the values are angles that jump by a full turn, rad.
    """

    def __init__(self, within: float = 0.01, angles: Sequence[int] = ()) -> None:
        self._within, self._angles = within, frozenset(angles)
        self._rests: deque[_Rest] = deque(maxlen=_MOST_RESTS)

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._rests)

    def add(self, stamp: float, values: Sequence[float]) -> None:
        """Take a reading; one that is a little older than the last counts for nothing.

        Where the clock was set back, all before is forgotten: its times come once more.
        """
        if self._rests:
            rest = self._rests[-1]
            step = stamp - rest.last
            if step < -LATE:
                self._rests.clear()
            elif step <= 0.0:
                return
            elif step <= LONGEST_GAP and self._is_near(rest.at, values):
                rest.last = stamp
                return
        self._rests.append(_Rest(stamp, stamp, tuple(map(float, values))))
        while stamp - self._rests[0].last > KEPT:
            self._rests.popleft()

    def stood(self, first: float, last: float) -> tuple[float, ...] | None:
        """Return where it stood all the time from one stamp to another; None: nobody knows.

        That is so where it moved, where the readings begin later or have a gap, and where they end
        before, by more than `AHEAD`.
        """
        for rest in reversed(self._rests):
            if rest.first <= first:
                known = rest.last + (AHEAD if rest is self._rests[-1] else 0.0)
                # One reading alone was taken in passing.
                return rest.at if rest.first < rest.last and last <= known else None
        return None

    def covers(self, first: float, last: float) -> bool:
        """Tell whether readings cover a time, from one stamp to another, in motion or at rest."""
        if not self._rests or last > self._rests[-1].last + AHEAD:
            return False
        later: _Rest | None = None
        for rest in reversed(self._rests):
            is_gap = later is not None and later.first - rest.last > LONGEST_GAP
            if is_gap and rest.last < last:
                return False
            if rest.first <= first:
                return True
            later = rest
        return False

    def _is_near(self, one: Sequence[float], other: Sequence[float]) -> bool:
        if len(one) != len(other):
            return False
        for index, (a, b) in enumerate(zip(one, other, strict=True)):
            apart = math.remainder(a - b, math.tau) if index in self._angles else a - b
            if not abs(apart) <= self._within:
                return False
        return True


class OdometryStamps(Generic[_Where]):
    """The last odometry by its stamps, for a pose on the map that is told of the same moment.

    The two together tell where the odometry's frame lies on the map. `amcl_pose` is stamped by the
    node's clock, or by the driver's, as who localises likes it: so a reading counts under both.

    Args:
        most: So many stamps are kept.
    """

    def __init__(self, most: int) -> None:
        self._readings: deque[tuple[float, _Where]] = deque(maxlen=most)

    def add(self, where: _Where, stamp: float, measured: float) -> None:
        """Take a reading: its own stamp, and when it was made by the node's clock, seconds."""
        self._readings += [(each, where) for each in {stamp, measured}]

    def at(self, stamp: float) -> _Where | None:
        """Return the latest reading of a moment; None: there is none."""
        for each, where in reversed(self._readings):
            if abs(each - stamp) <= SAME_TIME:
                return where
        return None
