"""Which places k robots share: groups of places, a closed tour over each, how many robots on it.

k_i robots that follow one another at equal distances on a closed tour of L_i seconds visit each of
its places every L_i / k_i seconds (a cyclic solution: Afshani et al. 2022, "Cyclic solutions for
multi-robot patrol"; k_i robots on each part of a map: Agmon et al. 2011, MultiPartition). The plan
with the least longest wait max(L_i / k_i) is looked for among the cuts of one tour of the whole map
into stretches, by dynamic programming; one stretch with all robots is among them, so that the wait
is never above tour / k. Stretches of another tour can be better: it is no proven optimum.
`exact_wait` finds the optimum over all partitions of a small map.

Robots that charge do so in passing: each group's tour leads through a dock, where each robot stays
as long as one round has cost (`Group.charging`). That is a stop of known length on the cycle: all
robots of a group make rounds of the same length, so that equal distances in time stay equal, no
robot is ever missing, and robots that come to a dock one after another do not meet there.

A plan is a pure function of the map, the docks and the number of robots.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from patrol_policy.graph import PatrolGraph
from patrol_policy.tour import EXACT_UP_TO, shortest_tour

CUTS_WORK = 4_000_000
"""Pairs of places looked at to choose where the tour is cut open first."""
SEARCH_STEPS = 24
"""Steps of the search for the least wait; each halves what is left open."""
BUSY_DOCK = 0.7
"""A dock that would be taken for a larger part of the time is relieved by another one."""
RETOUR_UP_TO = 200
"""On maps of up to so many places each group's tour is looked for anew."""
RETOUR_EXACT_UP_TO = 9
"""Groups of up to so many places get their exact tour; the time doubles with each place."""


@dataclass(frozen=True)
class Group:
    """Places that some robots share.

    Attributes:
        stops: The places in the order of the tour; after the last one comes the first.
        leg_seconds: From each stop to the next one, exploring there included.
        robots: How many robots follow one another on it.
        charges: Seconds that each robot charges at each stop; empty: at none.
    """

    stops: tuple[str, ...]
    leg_seconds: tuple[float, ...]
    robots: int
    charges: tuple[float, ...] = ()

    @cached_property
    def length(self) -> float:
        """Seconds of one round, charging included."""
        return sum(self.leg_seconds) + sum(self.charges)

    @property
    def wait(self) -> float:
        """Seconds from one visit of a stop to the next when all robots are equally spaced.

        No sooner than one has charged, so that the next finds the dock free.
        """
        return max(self.length / self.robots, *self.charges, 0.0)

    @cached_property
    def offsets(self) -> NDArray[np.float64]:
        """Seconds from the arrival at the first stop to that at each, shape (stops,)."""
        stays = np.asarray(self.leg_seconds) + (np.asarray(self.charges) if self.charges else 0.0)
        return np.concatenate([[0.0], np.cumsum(stays[:-1])])

    @cached_property
    def position(self) -> dict[str, int]:
        """The number of each stop."""
        return {stop: number for number, stop in enumerate(self.stops)}

    def charge_at(self, stop: str) -> float:
        """Return the seconds that each robot charges at a stop."""
        return self.charges[self.position[stop]] if self.charges else 0.0

    def charging(self, docks: Collection[str], ratio: float) -> Group:
        """Return the group whose robots charge in passing.

        They use as few of the tour's docks as suffice for all, those farthest apart, and charge at
        each for as long.

        Args:
            docks: Where they can.
            ratio: Seconds of charging for each second of the legs.
        """
        used = [number for number, stop in enumerate(self.stops) if stop in docks]
        if not used or ratio <= 0.0:
            return replace(self, charges=())
        legs = sum(self.leg_seconds)
        whole = ratio * legs
        enough = BUSY_DOCK * (legs + whole) / self.robots
        while len(used) > 1 and whole / (len(used) - 1) <= enough:
            before = [used[-1], *used[:-1]]
            shortest = min(zip(before, used, strict=True), key=lambda ends: self._away(*ends))
            used.remove(shortest[1])
        charges = tuple(
            whole / len(used) if number in used else 0.0 for number in range(len(self.stops))
        )
        return replace(self, charges=charges)

    def _away(self, start: int, end: int) -> float:
        """Return the seconds of the legs from one stop to another one, or once round."""
        count = len(self.stops)
        legs = range(start, end + (count if end <= start else 0))
        return sum(self.leg_seconds[leg % count] for leg in legs)


@dataclass(frozen=True)
class FleetPlan:
    """A partition of a map into groups. :attr:`wait` is the longest wait of a place."""

    groups: tuple[Group, ...]

    @property
    def wait(self) -> float:
        """Seconds that no place waits longer, once all robots are equally spaced."""
        return max(group.wait for group in self.groups)


_Key = tuple[int, bool, bool, tuple[str, ...]]
_PLANS: WeakKeyDictionary[PatrolGraph, dict[_Key, FleetPlan]] = WeakKeyDictionary()


def fleet_plan(
    graph: PatrolGraph,
    robots: int,
    *,
    alone: bool = False,
    whole: bool = False,
    docks: Collection[str] = (),
) -> FleetPlan:
    """Return the plan for so many robots; each is computed once for a map.

    Args:
        graph: A connected map.
        robots: How many robots patrol; more robots than places stand in their places.
        alone: One robot for each group (the literature's partition strategy).
        whole: One group with all robots (the literature's cyclic strategy).
        docks: Places of the map where robots charge: each tour leads through one, which may be a
            stop of several. Empty: robots do not charge.

    Raises:
        GraphError: The map is not connected.
        ValueError: Fewer than one robot, or a map without places.
    """
    if robots < 1:
        raise ValueError(f'a plan for {robots} robots: expected at least 1')
    if not graph.places:
        raise ValueError('a plan for a map without places: expected at least 1 place')
    plans = _PLANS.setdefault(graph, {})
    key = (robots, alone, whole, tuple(sorted(docks)))
    if key not in plans:
        rows = np.array([graph.index[dock] for dock in key[-1]], dtype=np.intp)
        plans[key] = _plan(graph, robots, alone, whole, rows)
    return plans[key]


def balanced(tours: Sequence[Group], robots: int) -> FleetPlan | None:
    """Return the groups with so many robots shared out for the least longest wait.

    None: there are fewer robots than groups.
    """
    if robots < len(tours):
        return None
    counts = [1] * len(tours)
    for _ in range(robots - len(tours)):
        worst = max(range(len(tours)), key=lambda number: tours[number].length / counts[number])
        counts[worst] += 1
    return FleetPlan(
        tuple(
            Group(tour.stops, tour.leg_seconds, count)
            for tour, count in zip(tours, counts, strict=True)
        )
    )


def group_of(graph: PatrolGraph, stops: Sequence[str], robots: int = 1) -> Group:
    """Return a group of the places in this order."""
    distances = graph.distances
    rows = [graph.index[stop] for stop in stops]
    after = [*rows[1:], *rows[:1]]
    return Group(tuple(stops), tuple(float(v) for v in distances[rows, after]), robots)


def exact_wait(graph: PatrolGraph, robots: int) -> float:
    """Return the least longest wait of all cyclic solutions of a small map.

    Every set of places gets its shortest tour (Held and Karp), every partition into sets and every
    number of robots on each is looked at.

    Raises:
        ValueError: The map has more than `EXACT_UP_TO` places.
    """
    count = len(graph.places)
    if count > EXACT_UP_TO:
        raise ValueError(f'a map of {count} places: expected at most {EXACT_UP_TO}')
    lengths = lengths_of_sets(graph.distances)
    full = (1 << count) - 1
    best = np.full((robots + 1, full + 1), np.inf)
    best[:, 0] = 0.0
    for chosen in range(1, full + 1):
        first = chosen & -chosen
        rest = chosen ^ first
        # All subsets of the set that hold its first place.
        subset, parts = rest, []
        while True:
            parts.append(subset | first)
            if not subset:
                break
            subset = (subset - 1) & rest
        part = np.array(parts)
        for total in range(1, robots + 1):
            for here in range(1, total + 1):
                found = np.maximum(lengths[part] / here, best[total - here, chosen ^ part]).min()
                best[total, chosen] = min(best[total, chosen], found)
    return float(best[robots, full])


def lengths_of_sets(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length of the shortest closed tour through each set of places, by bits.

    Ways begin at the lowest place of their set, so that each set is looked at once.
    """
    count = len(distances)
    size = 1 << count
    ways = np.full((size, count), np.inf)
    lengths = np.full(size, np.inf)
    lengths[0] = 0.0
    for place in range(count):
        ways[1 << place, place] = 0.0
    for chosen in range(1, size):
        lowest = (chosen & -chosen).bit_length() - 1
        for place in range(lowest + 1, count):
            if chosen >> place & 1:
                ways[chosen, place] = (ways[chosen ^ (1 << place)] + distances[:, place]).min()
        lengths[chosen] = (ways[chosen] + distances[:, lowest]).min()
    return lengths


def _plan(
    graph: PatrolGraph, robots: int, alone: bool, whole: bool, docks: NDArray[np.intp]
) -> FleetPlan:
    order = np.asarray(graph.tour.order, dtype=np.intp)
    if whole or robots == 1 or len(order) == 1:
        return FleetPlan((group_of(graph, [graph.places[p] for p in order], robots),))
    distances = graph.distances
    if alone:
        robots = min(robots, len(order))
    stretches = [
        _through_a_dock(distances, stretch, docks)
        for stretch in _cut(distances, order, robots, alone, docks)
    ]
    groups = [
        group_of(graph, [graph.places[p] for p in _best_order(distances, stretch, len(order))])
        for stretch in stretches
    ]
    # The stretches may need fewer robots than there are: the rest go where the wait is longest.
    plan = balanced(groups, len(groups) if alone else robots)
    assert plan is not None
    return plan


def _best_order(
    distances: NDArray[np.float64], stretch: NDArray[np.intp], places: int
) -> list[int]:
    """Return a stretch in the shortest order that is found for it alone."""
    kept: list[int] = stretch.tolist()
    few, many = len(kept) <= RETOUR_EXACT_UP_TO, len(kept) > EXACT_UP_TO
    if places > RETOUR_UP_TO or len(kept) in (1, 2, 3, places) or not (few or many):
        return kept
    inner = distances[np.ix_(stretch, stretch)]
    tour = shortest_tour(inner)
    before = float(inner[np.arange(len(kept)), np.roll(np.arange(len(kept)), -1)].sum())
    return kept if before <= tour.length else [kept[number] for number in tour.order]


def _through_a_dock(
    distances: NDArray[np.float64], stretch: NDArray[np.intp], docks: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return a stretch with a dock put in where that costs least, if it has none."""
    if not len(docks) or np.isin(stretch, docks).any():
        return stretch
    after = np.roll(stretch, -1)
    costs = (
        distances[np.ix_(stretch, docks)]
        + distances[np.ix_(docks, after)].T
        - distances[stretch, after][:, None]
    )
    leg, dock = divmod(int(costs.argmin()), len(docks))
    return np.insert(stretch, leg + 1, docks[dock])


def detours(
    distances: NDArray[np.float64], order: NDArray[np.intp], docks: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the seconds by which a dock makes each stretch longer, shape (n, n), in the rows
    and columns of `closed_lengths`.
    """
    count = len(order)
    # From each place of the order by a dock to each other one, less the way between them.
    around = np.full((count, count), np.inf)
    for dock in docks:
        np.minimum(around, distances[order, dock][:, None] + distances[dock, order], out=around)
    around -= distances[np.ix_(order, order)]
    closing = around.T
    found = np.zeros((count, count))
    legs = around[np.arange(count - 1), np.arange(1, count)]
    dockless = ~np.isin(order, docks)
    for start in range(count):
        inner = np.concatenate([[np.inf], np.minimum.accumulate(legs[start:])])
        has_none = np.logical_and.accumulate(dockless[start:])
        found[start, start:] = np.where(has_none, np.minimum(inner, closing[start, start:]), 0.0)
    return found


def _cut(
    distances: NDArray[np.float64],
    order: NDArray[np.intp],
    robots: int,
    alone: bool,
    docks: NDArray[np.intp],
) -> list[NDArray[np.intp]]:
    """Return the stretches of the best cut.

    Whether some wait can be kept is asked for each place at which the tour may be cut open; only
    where it can, the least one is searched by halving.
    """
    count = len(order)
    openings = min(count, max(1, CUTS_WORK // (count * count)))
    length = float(distances[order, np.roll(order, -1)].sum())
    # One robot a part has no known wait to begin with; one part with all robots has.
    high = length if alone else length / robots
    best: list[NDArray[np.intp]] = [order]
    for opening in np.linspace(0, count, openings, endpoint=False).astype(int):
        turned = np.roll(order, -int(opening))
        closed = closed_lengths(distances, turned)
        if len(docks):
            closed = closed + detours(distances, turned, docks)
        if (found := _stretches(closed, high * (1.0 - 1e-4), robots, alone)) is None:
            continue
        low = 0.0
        for _ in range(SEARCH_STEPS):
            high = min(high, _wait_of(closed, found))
            if high - low <= 1e-4 * high:
                break
            middle = (low + high) / 2.0
            better = _stretches(closed, middle, robots, alone)
            if better is None:
                low = middle
            else:
                found = better
        best = [turned[start:end] for start, end, _ in found]
    return best


def closed_lengths(distances: NDArray[np.float64], order: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the closed length of each stretch from row to column, shape (n, n); inf below."""
    along = np.concatenate([[0.0], np.cumsum(distances[order[:-1], order[1:]])])
    back = distances[np.ix_(order, order)].T
    closed: NDArray[np.float64] = along[None, :] - along[:, None] + back
    closed[np.tril_indices(len(order), -1)] = np.inf
    return closed


def _stretches(
    closed: NDArray[np.float64], wait: float, robots: int, alone: bool
) -> list[tuple[int, int, int]] | None:
    """Return stretches (start, end, robots) that keep a wait with so many robots; None: no cut.

    For each end the least number of robots is kept, over all starts of the last stretch.
    """
    count = len(closed)
    with np.errstate(invalid='ignore', divide='ignore'):
        need = np.maximum(1.0, np.ceil(closed / wait - 1e-9))
    if alone:
        need[need > 1.0] = np.inf
    least = np.full(count + 1, np.inf)
    least[0] = 0.0
    start_of = np.zeros(count + 1, dtype=np.intp)
    columns = np.ascontiguousarray(need.T)
    for end in range(1, count + 1):
        sums = least[:end] + columns[end - 1, :end]
        start = int(sums.argmin())
        least[end], start_of[end] = sums[start], start
    if not least[count] <= robots:
        return None
    found, end = [], count
    while end:
        start = int(start_of[end])
        found.append((start, end, int(need[start, end - 1])))
        end = start
    return found[::-1]


def _wait_of(closed: NDArray[np.float64], stretches: list[tuple[int, int, int]]) -> float:
    waits = [float(closed[start, end - 1]) / robots for start, end, robots in stretches]
    return max(max(waits), math.ulp(1.0))
