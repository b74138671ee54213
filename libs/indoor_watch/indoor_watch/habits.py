"""What is usual at which hour: a periodic model of each door and room, learned from the visits.

The frequency map enhancement FreMEn (Krajnik, Fentanes, Santos and Duckett, IEEE Transactions on
Robotics 2017) takes a state that is 0 or 1, such as a door that is open, for a constant and a few
harmonics of a week. Their amplitudes follow from sums that grow with each visit, whenever that is:
the visits need not be regular. Until there are enough of them, over enough days, nothing is said.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from indoor_watch.observations import Observation

WEEK = 7 * 86_400.0
HARMONICS = tuple(range(1, 29))
"""Periods of a week to six hours."""
STRONGEST = 4
"""So many of them make the model."""
WEAKEST = 0.05
"""A weaker harmonic is taken for chance."""
FEWEST_VISITS, FEWEST_SECONDS = 40, 3 * 86_400.0
"""Without so many visits over so long nothing is said."""
UNUSUAL_BELOW = 0.1
"""Probability below which a state is unusual for its hour."""
MOST_MODELS = 1000
"""Bounds the memory: of doors and places of one building there are fewer."""


@dataclass
class PeriodicState:
    """A state that is 0 or 1, over time.

    Attributes:
        count: How many values there were.
        first, last: When, seconds since 1970.
        total: The sum of the values.
        values: For each harmonic the sum of value times exp(-i w t).
        times: For each harmonic the sum of exp(-i w t).
    """

    count: int = 0
    first: float = math.inf
    last: float = -math.inf
    total: float = 0.0
    values: list[complex] = field(default_factory=lambda: [0j] * len(HARMONICS))
    times: list[complex] = field(default_factory=lambda: [0j] * len(HARMONICS))

    def learn(self, value: bool, stamp: float) -> None:
        """Take a value of a time, seconds since 1970; the order does not matter."""
        self.count += 1
        self.first, self.last = min(self.first, stamp), max(self.last, stamp)
        self.total += value
        for number, harmonic in enumerate(HARMONICS):
            wave = cmath.exp(-1j * math.tau * harmonic * stamp / WEEK)
            self.times[number] += wave
            if value:
                self.values[number] += wave

    @property
    def is_known(self) -> bool:
        """Whether it was seen often enough, over long enough."""
        return self.count >= FEWEST_VISITS and self.last - self.first >= FEWEST_SECONDS

    def probability(self, stamp: float) -> float:
        """Return how likely the value is 1 at a time, seconds since 1970; 0.02 to 0.98."""
        mean = self.total / max(1, self.count)
        spectrum = sorted(
            (
                ((value - mean * wave) / max(1, self.count), harmonic)
                for value, wave, harmonic in zip(self.values, self.times, HARMONICS, strict=True)
            ),
            key=lambda each: -abs(each[0]),
        )
        found = mean
        for amplitude, harmonic in spectrum[:STRONGEST]:
            if abs(amplitude) >= WEAKEST:
                turn = math.tau * harmonic * stamp / WEEK + cmath.phase(amplitude)
                found += 2.0 * abs(amplitude) * math.cos(turn)
        return min(0.98, max(0.02, found))

    def to_json(self) -> list[float]:
        """Return it as plain numbers, for `from_json`."""
        sums = [part for each in (*self.values, *self.times) for part in (each.real, each.imag)]
        return [float(self.count), self.first, self.last, self.total, *sums]

    @classmethod
    def from_json(cls, numbers: list[float]) -> PeriodicState:
        """Return what `to_json` gave.

        Raises:
            ValueError, TypeError: It is something else.
        """
        if len(numbers) != 4 + 4 * len(HARMONICS):
            raise ValueError(f'a periodic model of {len(numbers)} numbers')
        count, first, last, total, *sums = map(float, numbers)
        if not all(map(math.isfinite, (count, first, last, total, *sums))):
            raise ValueError('a periodic model of numbers that are not finite')
        waves = [complex(*pair) for pair in zip(sums[::2], sums[1::2], strict=True)]
        half = len(HARMONICS)
        return cls(int(count), first, last, total, waves[:half], waves[half:])


class Habits:
    """The models of all doors and rooms."""

    def __init__(self) -> None:
        self._models: dict[str, PeriodicState] = {}
        self._visits: dict[str, int] = {}

    def usual(self, seen: Observation) -> float | None:
        """Return how likely what was seen is at its hour; None: that is not known (yet)."""
        model = self._models.get(_key(seen))
        value = _value(seen)
        if model is None or value is None or not model.is_known:
            return None
        likely = model.probability(seen.stamp)
        return likely if value else 1.0 - likely

    def learn(self, seen: Observation, visit: int) -> None:
        """Take what was seen; of one visit once, since what lasts is no news."""
        key, value = _key(seen), _value(seen)
        if value is None or self._visits.get(key) == visit:
            return
        if key not in self._models and len(self._models) >= MOST_MODELS:
            return
        self._visits[key] = visit
        self._models.setdefault(key, PeriodicState()).learn(value, seen.stamp)

    def state(self) -> dict[str, Any]:
        """Return all as plain values, for `restore`."""
        return {key: model.to_json() for key, model in self._models.items()}

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, TypeError: It is something else; nothing is changed then.
        """
        self._models = {
            str(key): PeriodicState.from_json(each) for key, each in dict(values).items()
        }
        self._visits = {}


def _key(seen: Observation) -> str:
    return f'{seen.kind} {seen.subject or seen.place}'


def _value(seen: Observation) -> bool | None:
    """Return what was seen as 0 or 1: a door that is open, a person in a room, a light."""
    return seen.state == seen.kind.learned if seen.kind.learned else None
