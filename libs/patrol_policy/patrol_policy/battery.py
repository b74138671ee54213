"""The battery: how fast it falls, how long a charge takes, and what must be left for the way home.

A fixed level strands a robot: what is enough beside the station is not enough at the far end of
the map. What must be left therefore depends on where the robot is, on how long the way home takes,
and on how fast the battery falls. Both are uncertain; their deviations are added as those of
independent quantities, and the reserve is what 99 of 100 such ways need. On its way home the robot
drives and explores nothing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from patrol_policy.graph import PatrolGraph
from strict_files.settings import parameter

LEARNED_FALL = 2.0
"""Percent by which the level falls while one rate is learned."""
PERCENTILE_99 = 2.326
"""Standard deviations from the mean to the 99th percentile of a normal distribution."""


@dataclass(frozen=True)
class Draw:
    """How fast the battery falls.

    Attributes:
        rate: Percent per second; 0: not known.
        spread: Standard deviation of the rate over a fall of `LEARNED_FALL`, as a part of it.
    """

    rate: float = 0.0
    spread: float = 0.0

    def most(self, seconds: float, time_spread: float) -> float:
        """Return the percent that the level falls by in 99 of 100 ways.

        Args:
            seconds: How long the way is expected to take.
            time_spread: Standard deviation of that time, as a part of it.
        """
        fall = self.rate * seconds
        # Of the rate's deviations, those of one part of a way do not depend on those of another.
        deviation = self.spread * math.sqrt(LEARNED_FALL * max(fall, LEARNED_FALL))
        return fall + PERCENTILE_99 * math.hypot(time_spread * fall, deviation)


@dataclass(frozen=True)
class BatteryLimits:
    """The battery's parameters, in percent.

    Raises:
        ValueError: The levels are not in order.
    """

    require_recharge: float = parameter(
        20, 'Charge below which it must charge, %.', 0, 100, name='battery_require_recharge'
    )
    stop_recharge: float = parameter(
        90, 'Charge from which it may stop charging, %.', 0, 100, name='battery_stop_recharge'
    )
    margin: float = parameter(
        5, 'Charge left after the way home, %.', 0, 100, name='battery_margin'
    )

    def __post_init__(self) -> None:
        if not 0.0 <= self.require_recharge < self.stop_recharge <= 100.0:
            raise ValueError(
                'battery_require_recharge: expected 0 <= battery_require_recharge < '
                f'battery_stop_recharge <= 100, got {self.require_recharge:g} and '
                f'{self.stop_recharge:g}'
            )


@dataclass(frozen=True)
class Battery:
    """What a decision knows of the battery.

    Attributes:
        level: Charge in percent; None: not heard yet.
        low: Whether the battery's own warning is up.
        draw: How fast it falls.
        sent_to_charge: Why the robot was sent to charge and has not been charged since; empty: it
            was not.
        curves: How fast each station charges, by its place.
        approaches: Seconds of driving from the points of places to their stations, where known.
    """

    level: float | None = None
    low: bool = False
    draw: Draw = Draw()
    sent_to_charge: str = ''
    curves: Mapping[str, ChargeCurve] = field(default_factory=dict)
    approaches: Mapping[str, float] = field(default_factory=dict)

    def charged_enough(self, limits: BatteryLimits) -> bool:
        """Return whether the robot may leave the station."""
        return (self.level is None or self.level >= limits.stop_recharge) and not self.low

    def level_text(self) -> str:
        """Return the charge in words."""
        return 'level unknown' if self.level is None else f'{self.level:g} %'


WORTH_CHARGING = 1.0
"""A planned charge that would give less than this is left out, percent."""
BANDS = 20
"""Into how many parts of equal size the charge is cut where its rate is learned."""
GUESSED_CHARGE = 3.0
"""A charge is taken to be so much faster than the draw until one was seen."""


@dataclass(frozen=True)
class ChargeCurve:
    """How fast a station charges.

    Attributes:
        rates: Percent per second in each of `BANDS` bands of the charge, the lowest first; empty:
            not known.
    """

    rates: tuple[float, ...] = ()

    @classmethod
    def even(cls, rate: float) -> ChargeCurve:
        """Return the curve of a station that charges with the same rate up to the end."""
        return cls((rate,) * BANDS if rate > 0.0 else ())

    def seconds(self, start: float, end: float) -> float:
        """Return the seconds from one level to a higher one, percent; 0: nothing is to be done."""
        width, total = 100.0 / BANDS, 0.0
        first, last = max(0, int(start / width)), min(len(self.rates), math.ceil(end / width))
        for band in range(first, last):
            low, high = max(start, band * width), min(end, (band + 1) * width)
            if high > low:
                total += (high - low) / self.rates[band]
        return total


@dataclass(frozen=True)
class Charger:
    """Where the robot can charge.

    Attributes:
        place: The place it stands in.
        curve: How fast it charges.
        approach: Seconds of driving from the place's point to it.
    """

    place: str
    curve: ChargeCurve = ChargeCurve()
    approach: float = 0.0


class Energy:
    """What a plan must know of the charge, by the indices of a map's places.

    Args:
        graph: The map.
        stations: The places with a station that can be used; others than the map's are left out.
        draw: How fast the battery falls; its rate must be known.
        time_spread: Standard deviation of what legs take, as a part of what is expected.
        limits: The battery's parameters.

    Attributes:
        index: Of each place by its name.
        draw: Percent per second away from a station.
        full: The level that a charge ends at, percent.
        stations: The index of the place of each station.
        approach: For each station, the seconds from its place's point to it.
        drive: For each station, the seconds of driving to it from each place.
        least: The level that the robot must have left in each place, percent.
        home_seconds: Seconds of driving from each place to the nearest station.
        out_seconds: Seconds from the nearest station to each place, exploring included.
        within_range: Whether a full charge suffices for each place and the way home.
        home: The number of the nearest station for each place, -1: there is none.
    """

    def __init__(
        self,
        graph: PatrolGraph,
        stations: Sequence[Charger],
        draw: Draw,
        time_spread: float,
        limits: BatteryLimits,
    ) -> None:
        usable = [station for station in stations if station.place in graph.index]
        self._draw, self._spread, self._limits = draw, time_spread, limits
        self.key = (graph.places, tuple(usable), draw.rate, limits)
        self.index = graph.index
        self.draw, self.full = draw.rate, limits.stop_recharge
        self.stations = [graph.index[station.place] for station in usable]
        self.approach = [station.approach for station in usable]
        self.drive = [
            [away + station.approach for away in graph.drive_home([station.place])[0]]
            for station in usable
        ]
        nearest = [
            min(range(len(usable)), key=lambda n: self.drive[n][place], default=-1)
            for place in range(len(graph.places))
        ]
        seconds = [
            self.drive[number][place] if number >= 0 else math.inf
            for place, number in enumerate(nearest)
        ]
        self.home_seconds = seconds
        self.home = [
            number if math.isfinite(away) else -1
            for number, away in zip(nearest, seconds, strict=True)
        ]
        self.least = [
            math.inf
            if not math.isfinite(away)
            else max(limits.require_recharge, draw.most(away, time_spread) + limits.margin)
            for away in seconds
        ]
        curves = [
            station.curve if station.curve.rates else ChargeCurve.even(GUESSED_CHARGE * draw.rate)
            for station in usable
        ]
        self._tables = [[curve.seconds(low, self.full) for low in range(101)] for curve in curves]
        out = [math.inf] * len(seconds)
        for station, approach in zip(self.stations, self.approach, strict=True):
            ways = (graph.row(station) + approach).tolist()
            out = [min(*pair) for pair in zip(out, ways, strict=True)]
        self.out_seconds = out
        self.within_range = [
            self.full - self.draw * away >= least
            for away, least in zip(out, self.least, strict=True)
        ]

    def suffices(self, out: float, home: float) -> bool:
        """Return whether a full charge suffices for a way out, seconds, and one of driving home."""
        limits = self._limits
        left = self._draw.most(home, self._spread) + limits.margin
        return self.full - self.draw * out >= max(limits.require_recharge, left)

    @property
    def fastest(self) -> float:
        """Percent per second of the fastest part of a charge; inf: it takes no time."""
        rates = [
            1.0 / seconds if seconds > 0.0 else math.inf
            for table in self._tables
            for seconds in (a - b for a, b in itertools.pairwise(table[: int(self.full) + 1]))
        ]
        return max(rates)

    @property
    def cycle_seconds(self) -> float:
        """Seconds from one full charge to the next at most."""
        least = min(self.least, default=0.0)
        longest = max(self.charge_seconds(number, least) for number in range(len(self.stations)))
        return max(0.0, self.full - least) / self.draw + longest

    def why_never(self, place: str) -> str:
        """Return why a place that is not within range never is visited."""
        at = self.index[place]
        out, home = self.out_seconds[at], self.home_seconds[at]
        need = self.draw * out + self.least[at]
        return (
            f'out takes {out:.0f} s and home {home:.0f} s, which needs {need:.0f} % of charge with '
            f'what must be left, and a charge ends at {self.full:g} %'
        )

    def charge_seconds(self, station: int, level: float) -> float:
        """Return how long a charge from a level to the full one takes at a station, seconds."""
        if level >= self.full:
            return 0.0
        table, low = self._tables[station], max(0, int(level))
        return table[low] + (level - low) * (table[low + 1] - table[low])

    def charge_ratio(self, seconds: float) -> float:
        """Return the seconds at a dock for each second away, when so many seconds are made good.

        The way from a place's point to the dock and back counts as time at the dock.
        """
        if seconds <= 0.0:
            return 0.0
        level = max(min(self.least), self.full - self.draw * seconds)
        away = (self.full - level) / self.draw
        approach = 2.0 * self.approach[0] if math.isfinite(self.approach[0]) else 0.0
        return (self.charge_seconds(0, level) + approach) / min(seconds, max(away, 1e-9))

    def alike(self, other: Energy | None) -> bool:
        """Return whether a plan made with the other still serves."""
        if other is None:
            return False
        places, stations, draw, limits = self.key
        mine, theirs = (places, limits), (other.key[0], other.key[3])
        if mine != theirs or self.stations != other.stations:
            return False
        if abs(draw - other.draw) > RATE_CHANGE * draw:
            return False
        half = self.full / 2.0
        return all(
            abs(self.charge_seconds(n, half) - other.charge_seconds(n, half))
            <= RATE_CHANGE * self.charge_seconds(n, half)
            for n in range(len(stations))
        )


RATE_CHANGE = 0.1
"""Rates of the battery that differ by less than this part keep the plan."""


def seconds_to_station(graph: PatrolGraph, place: str, stations: Sequence[str]) -> float:
    """Return the seconds of driving from ``place`` to the nearest charging place; inf: none."""
    seconds, _ = graph.drive_home([each for each in stations if each in graph.index])
    return seconds[graph.index[place]]
