"""What is usual at which hour: a periodic model of each door and room, learned from the visits.

The frequency map enhancement FreMEn (Krajnik, Fentanes, Santos and Duckett, IEEE Transactions on
Robotics 2017) takes a state that is 0 or 1, such as a door that is open, for a constant and a few
harmonics of a week. Their amplitudes follow from sums that grow with each visit, whenever that is:
the visits need not be regular. Between hours that were looked at the harmonics know nothing, and
are as sure as elsewhere. So the days on which it was so near this hour are counted beside them:
a state is as unlikely as both allow (`NearbyDays`).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from scipy.special import betaincinv

from indoor_watch.observations import Observation

WEEK = 7 * 86_400.0
HARMONICS = tuple(range(1, 29))
"""Periods of a week to six hours."""
STRONGEST = 4
"""So many of them make the model."""
WEAKEST = 0.05
"""A weaker harmonic is taken for chance."""
UNUSUAL_BELOW = 0.1
"""Probability below which a state is unusual for its hour."""
SURE = 0.9
"""So sure is the bound of a probability that days give: of a state that was not seen near an hour
13 days are to be known until it is unusual there, of one that was seen on one day 30."""
HOUR, DAY = 3600.0, 86_400.0
HOURS, WEEKDAYS = 24, 7
NO_DAY = -2
"""Before any time, days since 1970."""
MOST_MODELS = 1000
"""Bounds the memory: of doors and places of one building there are fewer."""


@dataclass
class NearbyDays:
    """On how many days a state was looked at near each hour, and on how many it was so.

    Looks of one day near one hour show the same: they count once. A day on which it changed near
    an hour counts for both states.

    Attributes:
        counts: For each weekday and hour: days with a look, days with a 0, days with a 1; flat.
        last: For each hour the last day that is counted, days since 1970, and what it showed: 1 for
            a 0, 2 for a 1, 3 for both; flat.
    """

    counts: list[int] = field(default_factory=lambda: [0] * (WEEKDAYS * HOURS * 3))
    last: list[int] = field(default_factory=lambda: [NO_DAY, 0] * HOURS)

    def learn(self, value: bool, stamp: float) -> None:
        """Take a value of a time, seconds since 1970, for its hour and those beside it."""
        for hours in (-1, 0, 1):
            day, hour = _day_and_hour(stamp + hours * HOUR)
            at = (day % WEEKDAYS * HOURS + hour) * 3
            if self.last[2 * hour] != day:
                self.last[2 * hour : 2 * hour + 2] = day, 0
                self.counts[at] += 1
            if not self.last[2 * hour + 1] & (1 << value):
                self.last[2 * hour + 1] |= 1 << value
                self.counts[at + 1 + value] += 1

    def at_most(self, value: bool, stamp: float) -> float:
        """Return how likely a value is at most at a time, seconds since 1970, `SURE` so.

        It is the upper bound of the posterior of a proportion by Jeffreys' prior (Brown, Cai and
        DasGupta, Statistical Science 2001). The hour on all days and on this weekday each give
        one; the smaller holds.
        """
        day, hour = _day_and_hour(stamp)
        bounds = []
        for weekdays in (range(WEEKDAYS), (day % WEEKDAYS,)):
            at = [(each * HOURS + hour) * 3 for each in weekdays]
            looked = sum(self.counts[each] for each in at)
            so = sum(self.counts[each + 1 + value] for each in at)
            bounds.append(float(betaincinv(so + 0.5, looked - so + 0.5, SURE)))
        return min(bounds)

    def to_json(self) -> list[float]:
        """Return it as plain numbers, for `from_json`."""
        return list(map(float, (*self.last, *self.counts)))

    @classmethod
    def from_json(cls, numbers: list[float]) -> NearbyDays:
        """Return what `to_json` gave.

        Raises:
            ValueError, TypeError: It is something else.
        """
        whole = [int(each) for each in numbers if float(each).is_integer()]
        last, counts = whole[: 2 * HOURS], whole[2 * HOURS :]
        if len(whole) != len(numbers) or len(counts) != 3 * HOURS * WEEKDAYS:
            raise ValueError(f'the days of a state in {len(numbers)} numbers')
        looks = zip(counts[::3], counts[1::3], counts[2::3], strict=True)
        if not all(0 <= min(so) <= max(so) <= looked for looked, *so in looks):
            raise ValueError('a state was seen on more days than it was looked at')
        return cls(counts, last)


@dataclass
class PeriodicState:
    """A state that is 0 or 1, over time.

    Attributes:
        count: How many values there were.
        total: The sum of the values.
        values: For each harmonic the sum of value times exp(-i w t).
        times: For each harmonic the sum of exp(-i w t).
        days: On how many days it was so near each hour.
    """

    count: int = 0
    total: float = 0.0
    values: list[complex] = field(default_factory=lambda: [0j] * len(HARMONICS))
    times: list[complex] = field(default_factory=lambda: [0j] * len(HARMONICS))
    days: NearbyDays = field(default_factory=NearbyDays)

    def learn(self, value: bool, stamp: float) -> None:
        """Take a value of a time, seconds since 1970; the order does not matter."""
        self.count += 1
        self.total += value
        for number, harmonic in enumerate(HARMONICS):
            wave = cmath.exp(-1j * math.tau * harmonic * stamp / WEEK)
            self.times[number] += wave
            if value:
                self.values[number] += wave
        self.days.learn(value, stamp)

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

    def at_most(self, value: bool, stamp: float) -> float:
        """Return how likely a value is at a time, seconds since 1970, by both models at most."""
        likely = self.probability(stamp)
        return max(likely if value else 1.0 - likely, self.days.at_most(value, stamp))

    def to_json(self) -> list[float]:
        """Return it as plain numbers, for `from_json`."""
        sums = [part for each in (*self.values, *self.times) for part in (each.real, each.imag)]
        return [float(self.count), self.total, *sums, *self.days.to_json()]

    @classmethod
    def from_json(cls, numbers: list[float]) -> PeriodicState:
        """Return what `to_json` gave.

        Raises:
            ValueError, TypeError: It is something else.
        """
        waves_end = 2 + 4 * len(HARMONICS)
        if len(numbers) == waves_end + 2:  # of before days were counted, with two times behind it
            numbers = [numbers[0], *numbers[3:], *NearbyDays().to_json()]
        if len(numbers) < waves_end:
            raise ValueError(f'a periodic model of {len(numbers)} numbers')
        count, total, *sums = map(float, numbers[:waves_end])
        if not all(map(math.isfinite, (count, total, *sums))):
            raise ValueError('a periodic model of numbers that are not finite')
        waves = [complex(*pair) for pair in zip(sums[::2], sums[1::2], strict=True)]
        half = len(HARMONICS)
        days = NearbyDays.from_json(numbers[waves_end:])
        return cls(int(count), total, waves[:half], waves[half:], days)


class Habits:
    """The models of all doors and rooms."""

    def __init__(self) -> None:
        self._models: dict[str, PeriodicState] = {}
        self._visits: dict[str, int] = {}

    def usual(self, seen: Observation) -> float | None:
        """Return how likely what was seen is at its hour at most; None: nothing was learned."""
        model = self._models.get(_key(seen))
        value = _value(seen)
        if model is None or value is None:
            return None
        return model.at_most(value, seen.stamp)

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


def _day_and_hour(stamp: float) -> tuple[int, int]:
    """Return the day since 1970, and its hour."""
    return int(stamp // DAY), int(stamp % DAY // HOUR)
