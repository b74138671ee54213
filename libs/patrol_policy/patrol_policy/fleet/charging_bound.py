"""A lower bound on the longest wait that robots which charge can keep.

It holds for cyclic solutions with charging: each place is of one group; each robot goes round the
closed tour of a group, always the same way, or charges, or is on its way to or from a dock. A
battery lasts ``run`` seconds and is full again after ``charge`` seconds, in proportion when it is
less empty; ratio = charge / run. So of each run + charge seconds a robot is away from the docks for
at most run, and d of these go for the way to a dock that is not on its tour and back.

Let L be the length of a group's shortest tour, and T that of the shortest one through a dock, too.
When on average n robots go round, a place is passed n / L times a second: it waits L / n at least.

- A group kept by one robot: in some round it charges for what a round has cost, or more. Who waits
  since before the charge waits a whole round with it: T (1 + ratio).
- A group kept by k > 1 robots: n <= k / (1 + ratio), so L (1 + ratio) / k at least.
- A group whose robots are relieved: whoever goes to charge is replaced by one that comes from a
  dock, of whatever group. n is any number from 1 on, and takes n (run + charge) / (run - d) robots.

The bound is the least wait for which some partition takes no more robots than there are, and no
less than what the fleet could keep if it need not charge. Robots that are relieved at no loss of
time may not exist for it: it says what cannot be beaten, not what can be reached.

The docks limit a fleet, too: one serves (1 + ratio) / ratio robots. Where more share it, those
beyond wait, and the bound is not near what can be reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from patrol_policy.fleet.partition import (
    closed_lengths,
    detours,
    exact_wait,
    fleet_plan,
    lengths_of_sets,
)
from patrol_policy.graph import PatrolGraph

PROVEN_UP_TO = 10
"""On maps of up to so many places all partitions are looked at."""
PRECISION = 1e-4
"""How near the bound is searched, as a part of it."""

Needs = Callable[[float], float]


def charging_wait(
    graph: PatrolGraph, robots: int, docks: Sequence[str], run: float, charge: float
) -> float:
    """Return seconds below which no cyclic solution with charging has its longest wait.

    On maps of more than `PROVEN_UP_TO` places only the cuts of the shortest tour are looked at, so
    that another partition might be below.

    Args:
        graph: A connected map.
        robots: How many robots.
        docks: Where they charge.
        run: Seconds that a full battery lasts.
        charge: Seconds of a charge of an empty one.

    Raises:
        ValueError: There is no dock, or a time is not above 0.
    """
    if not docks or run <= 0.0 or charge <= 0.0:
        raise ValueError(f'{len(docks)} docks, {run:g} s, {charge:g} s: expected each above 0')
    is_small = len(graph.places) <= PROVEN_UP_TO
    least = exact_wait(graph, robots) if is_small else fleet_plan(graph, robots).wait
    need = (_of_sets if is_small else _of_cuts)(graph, docks, run, charge)
    if need(least) <= robots + 1e-9:
        return least
    high = graph.tour.length * (1.0 + charge / run)
    low = least
    while high - low > PRECISION * high:
        middle = (low + high) / 2.0
        low, high = (low, middle) if need(middle) <= robots + 1e-9 else (middle, high)
    return low


def _robots(
    tours: NDArray[np.float64],
    through: NDArray[np.float64],
    wait: float,
    run: float,
    charge: float,
) -> NDArray[np.float64]:
    """Return the least number of robots that each group takes for a wait.

    Args:
        tours: L of each group, seconds.
        through: T of each group, seconds.
        wait: Seconds.
        run: Seconds.
        charge: Seconds.
    """
    longer = 1.0 + charge / run
    with np.errstate(invalid='ignore'):
        several = np.maximum(2.0, np.ceil(tours * longer / wait - 1e-9))
        kept = np.where(through * longer <= wait * (1.0 + 1e-9), 1.0, several)
        away = through - tours
        relieved = np.maximum(1.0, tours / wait) * (run + charge) / np.maximum(run - away, 1e-9)
        found = np.fmin(kept, relieved)
    return np.where(np.isfinite(tours), found, math.inf)


def _of_sets(graph: PatrolGraph, docks: Sequence[str], run: float, charge: float) -> Needs:
    """Return how many robots a wait takes, over all partitions of a small map."""
    lengths = lengths_of_sets(graph.distances)
    full = len(lengths) - 1
    bits = [1 << graph.index[dock] for dock in docks]
    sets = np.arange(full + 1)
    through = np.minimum.reduce([lengths[sets | bit] for bit in bits])
    # The subsets of each set that hold its lowest place.
    parts: list[NDArray[np.intp]] = [np.zeros(0, dtype=np.intp)]
    for chosen in range(1, full + 1):
        holds = (sets & (chosen & -chosen)).astype(bool) & ((sets & ~chosen) == 0)
        parts.append(np.flatnonzero(holds))

    def need(wait: float) -> float:
        takes = _robots(lengths, through, max(wait, math.ulp(1.0)), run, charge)
        best = np.zeros(full + 1)
        for chosen in range(1, full + 1):
            part = parts[chosen]
            best[chosen] = (takes[part] + best[chosen ^ part]).min()
        return float(best[full])

    return need


def _of_cuts(graph: PatrolGraph, docks: Sequence[str], run: float, charge: float) -> Needs:
    """Return how many robots a wait takes, over all cuts of the shortest tour."""
    order = np.asarray(graph.tour.order, dtype=np.intp)
    rows = np.array([graph.index[dock] for dock in docks], dtype=np.intp)
    turned = [np.roll(order, -opening) for opening in range(len(order))]
    tours = [closed_lengths(graph.distances, each) for each in turned]
    through = [
        tour + detours(graph.distances, each, rows)
        for tour, each in zip(tours, turned, strict=True)
    ]

    def need(wait: float) -> float:
        least = math.inf
        for tour, by_dock in zip(tours, through, strict=True):
            takes = _robots(tour, by_dock, max(wait, math.ulp(1.0)), run, charge)
            best = np.zeros(len(order) + 1)
            for end in range(1, len(order) + 1):
                best[end] = (best[:end] + takes[:end, end - 1]).min()
            least = min(least, float(best[-1]))
        return least

    return need
