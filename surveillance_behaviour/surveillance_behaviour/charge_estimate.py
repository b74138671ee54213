"""How fast each station charges, learned from the level whenever that is heard.

The level is known in whole percents. A rate is taken from a rise of at least `LEARNED_RISE`, and
counts for the band of the charge in which it lies; the median of the last ones of a band stands for
it, so that one absurd sample changes nothing. Bands without any take the rate of the nearest one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from patrol_policy.battery import BANDS, ChargeCurve

LEARNED_RISE = 2.0
"""Percent by which the level rises while one rate is learned."""
RATES_REMEMBERED = 9
"""How many of the last rates of a band count."""
LONGEST_RISE = 86_400.0
"""A rise that takes longer tells nothing, seconds."""

Rates = dict[int, deque[float]]


@dataclass
class ChargeEstimate:
    """The rates of all stations, by place and band."""

    _rates: dict[str, Rates] = field(default_factory=dict)
    _mark: tuple[str, float, float] | None = None
    _curves: dict[str, ChargeCurve] = field(default_factory=dict, compare=False, repr=False)

    def observe(self, place: str, time: float, level: float) -> None:
        """Take the level at a time, seconds, of a robot in a place."""
        mark = self._mark
        if mark is None or mark[0] != place or level < mark[2] or time <= mark[1]:
            self._mark = (place, time, level)
            return
        rise, seconds = level - mark[2], time - mark[1]
        if rise < LEARNED_RISE:
            return
        self._mark = (place, time, level)
        if seconds <= LONGEST_RISE:
            band = min(BANDS - 1, int((mark[2] + level) / 2.0 * BANDS / 100.0))
            rates = self._rates.setdefault(place, {})
            rates.setdefault(band, deque(maxlen=RATES_REMEMBERED)).append(rise / seconds)
            self._curves.pop(place, None)

    def curves(self) -> dict[str, ChargeCurve]:
        """Return what is known of each station, by its place."""
        # A level is heard seldom, and a decision asks often.
        for place in self._rates.keys() - self._curves.keys():
            rates = self._rates[place]
            medians = {band: median(values) for band, values in rates.items()}
            # Only what differs in two digits makes a new plan.
            self._curves[place] = ChargeCurve(
                tuple(
                    float(f'{medians[min(medians, key=lambda b: (abs(b - band), b))]:.2g}')
                    for band in range(BANDS)
                )
            )
        return {place: self._curves[place] for place in self._rates}

    def to_json(self) -> dict[str, Any]:
        """Return what was learned, to be kept in a file."""
        return {
            place: {str(band): list(values) for band, values in rates.items()}
            for place, rates in self._rates.items()
        }

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `to_json` gave.

        Raises:
            ValueError, TypeError, AttributeError: It is something else.
        """
        for place, rates in kept.items():
            for band, values in rates.items():
                seconds = [float(value) for value in values]
                if not 0 <= int(band) < BANDS or not all(0.0 < v < 1e3 for v in seconds):
                    raise ValueError(f'charge rates of {place}: expected positive ones by band')
                known = self._rates.setdefault(str(place), {})
                known[int(band)] = deque(seconds, maxlen=RATES_REMEMBERED)
            self._curves.pop(str(place), None)
