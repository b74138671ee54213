"""How long each leg takes: predicted from lengths, learned from each drive, with the spread.

A leg that was never driven takes ``overhead + metres / speed``; both numbers are fitted to all
drives so far (least squares with the configured speed as prior). A leg that was driven takes the
mean of its own drives, drawn towards that prediction while they are few. Each direction of a leg
is learned for itself; while one was not driven, the other stands for it.

The spread is the standard deviation of what drives took over what was predicted for them just
before, pooled over all legs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

DRIVES_REMEMBERED = 20
"""How many of the last drives of a leg count."""
ERRORS_REMEMBERED = 200
PRIOR_SPREAD = 0.15
"""Spread before anything was learned."""
PRIOR_WEIGHT = 5.0
"""How many ratios the prior of the spread weighs as much as."""
CHANGE = 0.03
"""Expected times of the map follow what was learned once they differ by more than this part."""

Leg = tuple[str, str]


def spread_of(ratios: Collection[float]) -> float:
    """Return the standard deviation from 1 of ratios of what was seen to what was expected.

    `PRIOR_SPREAD` stands for it while they are few; none counts as further off than 2.
    """
    squares = sum(min(abs(ratio - 1.0), 2.0) ** 2 for ratio in ratios)
    return math.sqrt((PRIOR_WEIGHT * PRIOR_SPREAD**2 + squares) / (PRIOR_WEIGHT + len(ratios)))


@dataclass
class LegTimes:
    """Learned times of the legs of one map.

    Attributes:
        speed: Metres per second while nothing was driven.
        metres: Lengths of the paths that were planned, by leg.
        drives: Seconds of the last drives, by leg.
        errors: Driven over predicted seconds of the last drives of all legs.
    """

    speed: float = 0.6
    metres: dict[Leg, float] = field(default_factory=dict)
    drives: dict[Leg, deque[float]] = field(default_factory=dict)
    errors: deque[float] = field(default_factory=lambda: deque(maxlen=ERRORS_REMEMBERED))
    _used: dict[Leg, float] = field(default_factory=dict)
    _fit: tuple[float, float] | None = None

    def observe(
        self, start: str, goal: str, seconds: float, straight: float, metres: float | None = None
    ) -> None:
        """Learn from a drive from ``start`` to ``goal``.

        Args:
            start: Where it began.
            goal: Where it ended.
            seconds: How long it took, planning included.
            straight: Metres between the two places in a straight line.
            metres: Length of the planned path; None: not known.
        """
        if start == goal or not 0.0 < seconds < math.inf:
            return
        expected = self.expected(start, goal, straight)
        if expected > 0.0:
            self.errors.append(seconds / expected)
        self.metres[start, goal] = metres if metres else self.metres.get((start, goal), straight)
        self.drives.setdefault((start, goal), deque(maxlen=DRIVES_REMEMBERED)).append(seconds)
        self._fit = None

    def expected(self, start: str, goal: str, straight: float) -> float:
        """Return the seconds that the leg is expected to take.

        Args:
            start: Where it begins.
            goal: Where it ends.
            straight: Metres between the two places in a straight line.
        """
        leg, back = (start, goal), (goal, start)
        prediction = self._predicted(leg, straight)
        if back in self.drives and leg not in self.drives:
            leg = back
        own = self.drives.get(leg)
        if not own:
            return prediction
        return (prediction + sum(own)) / (1.0 + len(own))

    @property
    def spread(self) -> float:
        """Standard deviation of driven over predicted time."""
        return spread_of(self.errors)

    def _predicted(self, leg: Leg, straight: float) -> float:
        overhead, pace = self._line()
        metres = self.metres.get(leg) or self.metres.get((leg[1], leg[0])) or straight
        return max(overhead + pace * metres, 1e-3)

    def _line(self) -> tuple[float, float]:
        """Overhead in seconds and seconds per metre, fitted to all drives."""
        if self._fit is None:
            # The prior: no overhead, the configured speed; as sure as one drive of a usual leg.
            usual, weight = 5.0, 1.0
            n, sx, sxx = weight, weight * usual, 1.25 * weight * usual**2
            sy, sxy = sx / self.speed, sxx / self.speed
            for leg, seconds in self.drives.items():
                x, count, total = self.metres[leg], len(seconds), sum(seconds)
                n, sx, sxx = n + count, sx + count * x, sxx + count * x * x
                sy, sxy = sy + total, sxy + total * x
            determinant = n * sxx - sx * sx
            pace = (n * sxy - sx * sy) / determinant
            overhead = (sy - pace * sx) / n
            if pace <= 0.0 or overhead < 0.0:
                overhead, pace = 0.0, sxy / sxx
            self._fit = overhead, pace
        return self._fit

    def used(self, start: str, goal: str, straight: float) -> float:
        """Return the expected seconds as maps use them: they follow in steps of `CHANGE`."""
        expected = self.expected(start, goal, straight)
        used = self._used.get((start, goal), 0.0)
        if abs(expected - used) > CHANGE * expected:
            used = self._used[start, goal] = float(f'{expected:.3g}')
        return used

    def forget_fit(self, speed: float) -> None:
        """Take another configured speed."""
        if speed != self.speed:
            self.speed, self._fit = speed, None

    def to_json(self) -> dict[str, Any]:
        """Return what was learned, to be kept in a file."""
        legs = [[*leg, self.metres[leg], list(drives)] for leg, drives in self.drives.items()]
        return {'legs': legs, 'errors': list(self.errors)}

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `to_json` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        for start, goal, metres, drives in kept['legs']:
            leg = str(start), str(goal)
            seconds = [float(value) for value in drives]
            if not all(0.0 < value < math.inf for value in (*seconds, float(metres))):
                raise ValueError(f'times of {start} to {goal}: expected finite and positive')
            self.metres[leg] = float(metres)
            self.drives[leg] = deque(seconds, maxlen=DRIVES_REMEMBERED)
        self.errors.extend(float(value) for value in kept['errors'])
        self._fit = None
