"""When to go charging: early enough for the worst next leg and the way home from there.

A fixed level strands a robot: what is enough beside the station is not enough at the far end of
the map. The reserve therefore depends on where the robot is, on how long the legs may take, and
on how fast the battery was seen to fall.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from surveillance_behaviour.policy.graph import PatrolGraph

LEGS_REMEMBERED = 50


@dataclass(frozen=True)
class BatteryLimits:
    """The battery's parameters, in percent.

    Attributes:
        require_recharge: Below this the robot goes charging in any case.
        stop_recharge: From this on it may leave the station.
        margin: What is left at the station after the worst leg and the way home.

    Raises:
        ValueError: The levels are not in order.
    """

    require_recharge: float = 20.0
    stop_recharge: float = 90.0
    margin: float = 5.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.require_recharge < self.stop_recharge <= 100.0:
            raise ValueError(
                'expected 0 <= battery_require_recharge < battery_stop_recharge <= 100, got '
                f'{self.require_recharge:g} and {self.stop_recharge:g}'
            )


@dataclass(frozen=True)
class Battery:
    """What a decision knows of the battery.

    Attributes:
        level: Charge in percent; None: not heard yet.
        low: Whether the battery's own warning is up.
        draw: Percent per second that it falls at most; 0: not known.
        sent_to_charge: Why the robot was sent to charge and has not been charged since; empty: it
            was not.
    """

    level: float | None = None
    low: bool = False
    draw: float = 0.0
    sent_to_charge: str = ''

    def charged_enough(self, limits: BatteryLimits) -> bool:
        """Return whether the robot may leave the station."""
        return (self.level is None or self.level >= limits.stop_recharge) and not self.low

    def level_text(self) -> str:
        """Return the charge in words."""
        return 'level unknown' if self.level is None else f'{self.level:g} %'


@dataclass
class DrawEstimate:
    """How fast the battery falls, learned from its level before and after each leg.

    The highest rate of the last legs counts: a reserve that is right on average strands every
    second time. A percent is added to each fall, since the level is known in whole percents. One
    fall that is more than twice the next highest is not counted until it is seen again: it was a
    jump of the level, not a draw.

    Attributes:
        fixed: Percent per second; 0: learn it.
    """

    fixed: float = 0.0
    _rates: deque[float] = field(default_factory=lambda: deque(maxlen=LEGS_REMEMBERED))
    _mark: tuple[float, float] | None = None

    def observe(self, time: float, level: float) -> None:
        """Take the level at the end of a leg or of a stay; charging starts a new stretch."""
        if self._mark is None or level > self._mark[1] or time <= self._mark[0]:
            self._mark = (time, level)
            return
        fallen = self._mark[1] - level
        if fallen >= 2.0:
            self._rates.append((fallen + 1.0) / (time - self._mark[0]))
            self._mark = (time, level)

    def forget(self) -> None:
        """Note that the level was set from outside: what it did since the last leg says nothing."""
        self._mark = None

    @property
    def percent_per_second(self) -> float:
        """The fastest fall of the last legs; 0 while nothing is known."""
        if self.fixed > 0.0:
            return self.fixed
        highest = sorted(self._rates, reverse=True)[:2]
        if len(self._rates) >= 5 and highest[0] > 2.0 * highest[1]:
            return highest[1]
        return highest[0] if highest else 0.0

    def to_json(self) -> list[float]:
        """Return the rates, to be kept in a file."""
        return list(self._rates)

    def restore(self, rates: Iterable[float]) -> None:
        """Take rates that `to_json` gave."""
        self._rates.extend(float(rate) for rate in rates)


def reserve(
    graph: PatrolGraph,
    place: str,
    next_places: Iterable[str],
    stations: Sequence[str],
    draw: float,
    limits: BatteryLimits,
) -> tuple[float, str]:
    """Return the level at which the robot must not go on, and why that one.

    Args:
        graph: The map, with the times that legs may take.
        place: Where the robot is.
        next_places: Where it could go instead of charging.
        stations: The places with a charging station.
        draw: Percent per second.
        limits: The parameters; the result lies between ``require_recharge`` and a little below
            ``stop_recharge``, so that a charged robot always goes on.

    Returns:
        Percent, and a clause that explains it.
    """
    needed = {
        other: graph.seconds(place, other) + way_home(graph, other, stations)
        for other in next_places
        if other in graph.index
    }
    finite = {other: seconds for other, seconds in needed.items() if math.isfinite(seconds)}
    fixed = f'the level that requires charging is {limits.require_recharge:g} %'
    if not finite or draw <= 0.0:
        return limits.require_recharge, fixed
    worst = max(sorted(finite), key=lambda other: finite[other])
    level = draw * finite[worst] + limits.margin
    if level <= limits.require_recharge:
        return limits.require_recharge, fixed
    most = max(limits.require_recharge, limits.stop_recharge - limits.margin)
    words = (
        f'{worst} and home from there takes {finite[worst]:.1f} s at {draw:.3g} % a second, '
        f'with {limits.margin:g} % to spare'
    )
    return min(level, most), words


def way_home(graph: PatrolGraph, place: str, stations: Sequence[str]) -> float:
    """Return the seconds from ``place`` to the nearest charging place; inf when there is none."""
    return min(
        (graph.seconds(place, station) for station in stations if station in graph.index),
        default=math.inf,
    )
