"""When to go charging: early enough for the worst next leg and the way home from there.

A fixed level strands a robot: what is enough beside the station is not enough at the far end of
the map. The reserve therefore depends on where the robot is, on how long the legs take, and on how
fast the battery falls. Both are uncertain; their deviations are added as those of independent
quantities, and the reserve is what 99 of 100 such ways need.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from patrol_policy.graph import PatrolGraph
from patrol_policy.settings import parameter

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
        5, 'Charge left after the worst leg and the way home, %.', 0, 100, name='battery_margin'
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
    """

    level: float | None = None
    low: bool = False
    draw: Draw = Draw()
    sent_to_charge: str = ''

    def charged_enough(self, limits: BatteryLimits) -> bool:
        """Return whether the robot may leave the station."""
        return (self.level is None or self.level >= limits.stop_recharge) and not self.low

    def level_text(self) -> str:
        """Return the charge in words."""
        return 'level unknown' if self.level is None else f'{self.level:g} %'


def reserve(
    graph: PatrolGraph,
    place: str,
    next_places: Iterable[str],
    stations: Sequence[str],
    draw: Draw,
    time_spread: float,
    limits: BatteryLimits,
) -> tuple[float, str]:
    """Return the level at which the robot must not go on, and why that one.

    Args:
        graph: The map, with the times that legs are expected to take.
        place: Where the robot is.
        next_places: Where it could go instead of charging.
        stations: The places with a charging station.
        draw: How fast the battery falls.
        time_spread: Standard deviation of what legs take, as a part of what is expected.
        limits: The parameters; the result lies between ``require_recharge`` and a little below
            ``stop_recharge``, so that a charged robot always goes on.

    Returns:
        Percent, and a clause that explains it.
    """
    away = {
        other: graph.seconds(place, other) + way_home(graph, other, stations)
        for other in next_places
        if other in graph.index
    }
    finite = {other: seconds for other, seconds in away.items() if math.isfinite(seconds)}
    fixed = 'battery_require_recharge'
    if not finite or draw.rate <= 0.0:
        return limits.require_recharge, fixed
    worst = max(sorted(finite), key=lambda other: finite[other])
    needed = draw.most(finite[worst], time_spread)
    level = needed + limits.margin
    if level <= limits.require_recharge:
        return limits.require_recharge, fixed
    most = max(limits.require_recharge, limits.stop_recharge - limits.margin)
    words = (
        f'to {worst} and home takes {finite[worst]:.1f} s at {draw.rate:.3g} %/s, '
        f'in 99 of 100 cases at most {needed:.1f} %, plus a margin of {limits.margin:g} %'
    )
    return min(level, most), words


def way_home(graph: PatrolGraph, place: str, stations: Sequence[str]) -> float:
    """Return the seconds from ``place`` to the nearest charging place; inf when there is none."""
    return min(
        (graph.seconds(place, station) for station in stations if station in graph.index),
        default=math.inf,
    )
