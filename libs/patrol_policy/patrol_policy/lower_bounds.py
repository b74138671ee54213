"""The least longest wait from visit to visit that any robot can have that obeys the rules.

The rules hold the robot to URGENT places while there are any within reach, and to corridors else.
`simple_bound` holds on every map: nobody is faster than the shortest closed tour, and a place that
may be entered only when it is URGENT waits for the threshold and the leg to it. It need not be
reachable.

`rule_bound` searches through all ways on, on maps whose core has at most `CORE_UP_TO` places (the
core is what is left when dead ends are cut off until there are none): can a robot that obeys go on
for ever with no wait above a limit? A depth-first search answers that. A state is a place, and how
long ago each place was visited. A state is dead when the places that are due cannot all be reached
in time (see `Covers`), or when all that follow from it are dead; one that comes back to itself goes
on for ever. The search begins anywhere, with any past: until a place was visited it may be URGENT
or not. The limit is raised as long as that is proven impossible.

`charge_bound` knows the charge, too. Beside legs there is the drive home from anywhere, with a
charge to the full level, and a state has the charge that was used. On every map two facts hold. At
any moment the place that waits longest was visited before all others, so its wait encloses a closed
tour. And a part draw / (draw + rate) of all time is spent charging; a moment of it lies in the wait
of all moments until every place was visited since. Averaged over time, such a wait therefore holds
a closed tour and that part of the shortest way from a station through all places. Lastly, in any
time as long as the longest wait every place is visited, so that it holds the shortest way through
all places, wherever that begins; and on average only the other part of time is spent on ways.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol_policy.battery import WORTH_CHARGING
from patrol_policy.graph import PatrolGraph
from patrol_policy.rule_graph import RuleGraph
from patrol_policy.rule_table import DEFAULT_PRIORITIES, RuleTable
from patrol_policy.tour import EXACT_UP_TO, shortest_tour

CORE_UP_TO = 20
"""The largest core of a map that is searched, in places: its table takes 84 MB and 4 s."""
STATES = 100_000
"""How many states the search may visit in all; about 50 microseconds each."""
TICKS = 1000
"""Ticks in a second; ages are whole ticks."""

Walk = tuple[int, int, tuple[int, ...]]
"""Place, the set of places visited since the search began, and the ticks since each was visited."""


@dataclass(frozen=True)
class RuleBound:
    """What is known of the least longest wait from visit to visit.

    Attributes:
        low: No robot that obeys the rules can have less, seconds.
        high: A robot can go on for ever with this, seconds; inf: no such walk was found.
    """

    low: float
    high: float = math.inf

    def within(self, precision: float) -> bool:
        """Return whether the two differ by less than this part."""
        return self.high <= self.low * (1.0 + precision)


def default_table(graph: PatrolGraph, threshold: float) -> RuleTable:
    """Return the default rules: what is URGENT, then places with several ways, then all others."""
    base = [1 if len(graph.leg_seconds[place]) > 1 else 2 for place in graph.places]
    return RuleTable(DEFAULT_PRIORITIES, base, [0] * len(base), [threshold] * len(base))


def simple_bound(graph: PatrolGraph, table: RuleTable) -> float:
    """Return a wait from visit to visit that no robot can go below, seconds; see `rule_bound`."""
    return max(graph.tour.bound, RuleGraph(graph, table).least_period)


def rule_bound(
    graph: PatrolGraph,
    table: RuleTable,
    precision: float = 0.01,
    states: int = STATES,
) -> RuleBound:
    """Return bounds of the least longest wait from visit to visit.

    Args:
        graph: The map.
        table: The rules; `default_table` has those of an assignment.
        precision: The bounds that are looked for differ by this part at most.
        states: How many states may be visited in all.
    """
    # The limit is raised from below: each step either is proven impossible, which raises the bound,
    # or finds an endless walk, which is a bound from above. Doubling steps find the place where the
    # answer changes, halving narrows it.
    low, high = simple_bound(graph, table), math.inf
    covers = covers_of(graph)
    if len(covers.core) > CORE_UP_TO:
        return RuleBound(low)
    search = _Search(RuleGraph(graph, table), covers, states)
    step = 0.9 * precision
    while high > low * (1.0 + precision):
        limit = min(low * (1.0 + step), (low + high) / 2.0)
        endless = search.goes_on(limit)
        if endless is None:
            break
        if endless:
            high = limit
        else:
            low, step = limit, 2.0 * step
    return RuleBound(low, high)


class _Search:
    """Asks whether a robot can go on for ever with no wait above a limit.

    Args:
        rules: The map.
        covers: What is due in time there.
        states: How many states may be visited, over all questions.
    """

    def __init__(self, rules: RuleGraph, covers: Covers, states: int) -> None:
        self._rules, self._left = rules, states
        self._legs = _legs_in_ticks(rules)
        self._covers = covers

    def goes_on(self, limit: float) -> bool | None:
        """Return whether it can; None: the states did not suffice to find out."""
        longest = round(TICKS * limit) + self._rules.count
        everywhere = (1 << self._rules.count) - 1
        # Whoever goes on for ever comes to the first place.
        begin: Walk = (0, 1, (0,) * self._rules.count)
        path = [(begin, self._moves(begin))]
        on_path, dead = {begin}, set[Walk]()
        while path:
            state, todo = path[-1]
            if not todo:
                dead.add(state)
                on_path.discard(state)
                path.pop()
                continue
            place, ticks = todo.pop()
            if state[2][place] + ticks > longest:
                continue
            # Ages are whole ticks, so states are finite in number: an endless walk within the limit
            # must come back to one, and a search that meets none has seen all.
            following = _after(state, place, ticks)
            if following in on_path and following[1] == everywhere:
                return True
            if following in dead or not self._covers.in_time(following, longest):
                continue
            self._left -= 1
            if self._left < 0:
                return None
            on_path.add(following)
            path.append((following, self._moves(following)))
        return False

    def _moves(self, state: Walk) -> list[tuple[int, int]]:
        """Return the legs that the rules may allow, the place that waited longest last."""
        return possible_moves(self._rules.table, self._legs[state[0]], state)


def _legs_in_ticks(rules: RuleGraph) -> list[dict[int, int]]:
    """Return for each place its neighbours and the ticks to them."""
    return [
        {other: round(TICKS * seconds) for other, seconds in ways.items()}
        for ways in rules.leg_seconds[: rules.count]
    ]


def possible_moves(table: RuleTable, legs: Mapping[int, int], state: Walk) -> list[tuple[int, int]]:
    """Return the legs that the rules may allow, the place that waited longest last.

    How long a place went unvisited that the search has not met yet is not known: so long at least.
    """
    _, met, ages = state
    waits = {other: ages[other] / TICKS for other in legs}
    allowed = table.possibly_first(waits, lambda other: bool(met >> other & 1))
    return sorted(((other, legs[other]) for other in allowed), key=lambda move: ages[move[0]])


def _after(state: Walk, place: int, ticks: int) -> Walk:
    """Return the state after a leg to a place."""
    _, met, ages = state
    now = [age + ticks for age in ages]
    now[place] = 0
    return place, met | 1 << place, tuple(now)


class Covers:
    """How long a robot needs at least to visit a set of places.

    The ways in the core are known exactly, from a table of the shortest way from each place of it
    through each set. What hangs on the core are trees: each leg of theirs that leads to a place of
    the set is driven in both directions, but for those on the way from where the robot is, and on
    the way back from where it ends; of the latter the longest is taken off, so that it stays a
    lower bound.

    Args:
        graph: The map.

    Attributes:
        core: The places of the core, as indices of the graph's.
    """

    def __init__(self, graph: PatrolGraph) -> None:
        # Rounded down, and one less: a cover must never be longer than the true way.
        ticks = np.maximum(np.floor(TICKS * graph.distances).astype(np.int32) - 1, 0)
        ways = {name: set(graph.leg_seconds[name]) for name in graph.places}
        removed = []
        while ends := [name for name, others in ways.items() if len(others) == 1]:
            end = ends[0]
            (trunk,) = ways.pop(end)
            ways[trunk].discard(end)
            removed.append((graph.index[end], graph.index[trunk]))
        self.core = [graph.index[name] for name in ways]
        count = len(graph.places)
        self._bits = [0] * count
        self._rows = [0] * count
        for row, place in enumerate(self.core):
            self._bits[place], self._rows[place] = 1 << row, row
        # For each place, the way up to the core: the places whose legs towards it are driven.
        self._up: list[tuple[int, ...]] = [()] * count
        self._there, self._back, self._ends = [0] * count, [0] * count, [0] * count
        for place, parent in reversed(removed):
            self._bits[place], self._rows[place] = self._bits[parent], self._rows[parent]
            self._up[place] = (place, *self._up[parent])
            self._there[place] = int(ticks[parent, place])
            self._back[place] = int(ticks[place, parent])
            self._ends[place] = self._ends[parent] + self._back[place]
        if len(self.core) <= CORE_UP_TO:
            self._table = _shortest_covers(ticks[np.ix_(self.core, self.core)])

    def in_time(self, state: Walk, longest: int) -> bool:
        """Return whether the places that are due before any moment can be visited by then."""
        place, _, ages = state
        table, here = self._table[self._rows[place]], set(self._up[place])
        # The oldest first: for each age, all places that are at least as old are due by then, and
        # no robot visits them faster than their cover says.
        due, hanging, saved = 0, sum(self._back[leg] for leg in here), 0
        driven: set[int] = set()
        for age, other in sorted(zip(ages, range(len(ages)), strict=True), reverse=True):
            due |= self._bits[other]
            saved = max(saved, self._ends[other])
            for leg in self._up[other]:
                if leg in driven:
                    break
                driven.add(leg)
                hanging += 0 if leg in here else self._there[leg] + self._back[leg]
            if int(table[due]) + hanging - saved > longest - age:
                return False
        return True


@lru_cache(maxsize=1)
def covers_of(graph: PatrolGraph) -> Covers:
    """Return the covers of a map, which serve for all thresholds."""
    return Covers(graph)


def _shortest_covers(ticks: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the ticks of the shortest way from each place through each set, shape (n, 2 ** n).

    Sets are bit masks. Held and Karp's dynamic programme over the size of the set.

    Args:
        ticks: From each place to each other, shape (n, n).
    """
    # Held and Karp, "A dynamic programming approach to sequencing problems", 1962; all sets of one
    # size at once, since each needs those that are smaller by one place alone.
    count = len(ticks)
    sets = np.arange(1 << count)
    sizes = np.array([(sets >> place) & 1 for place in range(count)]).sum(axis=0)
    cover = np.full((count, 1 << count), np.iinfo(np.int32).max, np.int32)
    cover[:, 0] = 0
    for size in range(1, count + 1):
        of_size = np.flatnonzero(sizes == size)
        for first in range(count):
            chosen = of_size[(of_size >> first) & 1 == 1]
            rest = cover[first, chosen ^ (1 << first)]
            for start in range(count):
                way = rest + ticks[start, first]
                cover[start, chosen] = np.minimum(cover[start, chosen], way)
    return cover


def charge_bound(rules: RuleGraph, precision: float = 0.01, states: int = STATES) -> RuleBound:
    """Return bounds of the least longest wait of a robot whose charges end at the full level.

    Args:
        rules: The map; its energy is known, all its places are within range and have the same
            threshold.
        precision: The bounds that are looked for differ by this part at most.
        states: How many states may be visited in all.
    """
    energy = rules.energy
    assert energy is not None
    away = _relaxed_ways(rules)
    if rules.count > EXACT_UP_TO:
        return RuleBound(max(rules.least_period, _tree_length(away)))
    cover = _shortest_covers(np.maximum(np.floor(TICKS * away) - 1, 0).astype(np.int32))
    through = min(int(cover[station, -1]) for station in energy.stations) / TICKS
    # What is drawn must be charged again: in the long run so much of all time goes there, at best.
    charging = energy.draw / (energy.draw + energy.fastest)
    low = max(
        rules.least_period,
        shortest_tour(away).length + through * charging,
        float(cover[:, -1].min()) / TICKS / (1.0 - charging),
    )
    high, step = math.inf, 0.9 * precision
    search = _ChargeSearch(rules, cover, states)
    while high > low * (1.0 + precision):
        limit = min(low * (1.0 + step), (low + high) / 2.0)
        endless = search.goes_on(limit)
        if endless is None:
            break
        if endless:
            high = limit
        else:
            low, step = limit, 2.0 * step
    return RuleBound(low, high)


def _relaxed_ways(rules: RuleGraph) -> NDArray[np.float64]:
    """Return seconds between places that no robot falls below, shape (n, n).

    A station may be entered by driving only, as on the way to charge, and left for elsewhere.
    """
    energy = rules.energy
    assert energy is not None
    away = rules.graph.distances.copy()
    for station, drive in zip(energy.stations, energy.drive, strict=True):
        away[:, station] = np.minimum(away[:, station], drive)
    for middle in range(len(away)):
        np.minimum(away, away[:, middle, None] + away[middle], out=away)
    return away


def _tree_length(away: NDArray[np.float64]) -> float:
    """Return the length of the shortest tree through all places, which no tour falls below."""
    from scipy.sparse.csgraph import minimum_spanning_tree

    return float(minimum_spanning_tree(np.minimum(away, away.T)).sum())


ChargeState = tuple[int, int, tuple[int, ...], int]
"""A `Walk`, and for how many ticks the robot was at work since its last charge."""


class _ChargeSearch:
    """Asks whether a robot with a battery can go on for ever with no wait above a limit.

    Args:
        rules: The map.
        cover: The ticks from each place through each set, see `_shortest_covers`.
        states: How many states may be visited, over all questions.
    """

    def __init__(self, rules: RuleGraph, cover: NDArray[np.int32], states: int) -> None:
        energy = rules.energy
        assert energy is not None
        self._rules, self._energy, self._left = rules, energy, states
        self._cover: list[list[int]] = cover.tolist()
        self._legs = _legs_in_ticks(rules)
        self._worth = math.floor(TICKS * WORTH_CHARGING / energy.draw) - 1
        # How long it may be at work until it leaves each place, rather too long than too short.
        self._usable = [
            math.ceil(TICKS * (energy.full - least) / energy.draw) + rules.count
            for least in energy.least
        ]

    def goes_on(self, limit: float) -> bool | None:
        """Return whether it can; None: the states did not suffice to find out."""
        longest = round(TICKS * limit) + self._rules.count
        everywhere, dead = (1 << self._rules.count) - 1, set[ChargeState]()
        # Whoever goes on for ever charges again and again.
        for station in self._energy.stations:
            begin: ChargeState = (station, 1 << station, (0,) * self._rules.count, 0)
            path = [(begin, self._following(begin, longest))]
            on_path = {begin}
            while path:
                state, todo = path[-1]
                if not todo:
                    dead.add(state)
                    on_path.discard(state)
                    path.pop()
                    continue
                following = todo.pop()
                if following in on_path and following[1] == everywhere:
                    return True
                if following in dead or not self._is_in_time(following, longest):
                    continue
                self._left -= 1
                if self._left < 0:
                    return None
                on_path.add(following)
                path.append((following, self._following(following, longest)))
        return False

    def _following(self, state: ChargeState, longest: int) -> list[ChargeState]:
        """Return the states that may come next, the place that waited longest last."""
        place, met, ages, used = state
        moves = possible_moves(self._rules.table, self._legs[place], (place, met, ages))
        found = []
        for other, ticks in moves:
            if used + ticks <= self._usable[other] and ages[other] + ticks <= longest:
                found.append((*_after((place, met, ages), other, ticks), used + ticks))
        charges = []
        for number, station in enumerate(self._energy.stations):
            drive = math.floor(TICKS * self._energy.drive[number][place])
            # A charge that gives next to nothing is none: else a robot could charge to drive home
            # without exploring, which no plan may.
            if used + drive < self._worth:
                continue
            level = self._energy.full - self._energy.draw * (used + drive) / TICKS
            charge = math.floor(TICKS * self._energy.charge_seconds(number, max(level, 0.0)))
            ticks = drive + charge
            # It is visited when the charge begins.
            if ages[station] + drive <= longest:
                charges.append((*_after((place, met, ages), station, ticks), 0))
        return [*charges, *found]

    def _is_in_time(self, state: ChargeState, longest: int) -> bool:
        """Return whether the places that are due before any moment can be visited by then."""
        place, _, ages, _ = state
        cover, due = self._cover[place], 0
        for age, other in sorted(zip(ages, range(len(ages)), strict=True), reverse=True):
            due |= 1 << other
            if cover[due] > longest - age:
                return False
        return True
