"""The map as the rules see it: ways, ranks, hours and charge, as lists that a search reads fast.

At each place the robot may only go to the neighbours that come first by the rules (`rule_table`).
Where the battery matters it may go charging from everywhere: a charge at the station number k is a
stop with the index ``count + k``, beside the places 0 to ``count - 1``.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from patrol_policy.battery import PERCENTILE_99, Energy
from patrol_policy.graph import PatrolGraph
from patrol_policy.rule_table import HALF_OPEN, RuleTable
from patrol_policy.situation import Situation

NEAR = 8
"""How many nearest places of each place are known."""
LOCAL_REACH = 200
"""Over how many places a way is searched on a large map before all ways from its start are."""


class RuleGraph:
    """A map with its rules, as lists that are fast to read. Places are indices of the graph's.

    Args:
        graph: The map.
        table: The rules.
        energy: What the charge comes to; None: the battery does not matter.
        windows: When places are open that are not always, by index: begin and end of each stretch,
            seconds of the patrol's clock.
        slower: How many times as long as expected nearly all drives take at most.

    Attributes:
        leg_seconds: For each stop, the seconds to each neighbour, exploring included.
        wanted: The places that a plan visits: all that the charge allows.
        slack: For each stop, by how much its threshold is above the least one, seconds: so much
            later than others it may be visited. inf: it is not visited at all.
    """

    def __init__(
        self,
        graph: PatrolGraph,
        table: RuleTable,
        energy: Energy | None = None,
        windows: Mapping[int, Sequence[tuple[float, float]]] | None = None,
        slower: float = 1.0,
    ) -> None:
        self.graph, self.table, self.energy = graph, table, energy
        self.windows, self._slower = windows or {}, slower
        self._exits = {place: graph.longest_exit(graph.places[place]) for place in self.windows}
        self.count = count = len(graph.places)
        limits = table.limits
        within = energy.within_range if energy else [True] * count
        self.wanted = [place for place in range(count) if within[place]]
        finite = [limits[p] for p in self.wanted if math.isfinite(limits[p])]
        least, most = min(finite, default=0.0), max(finite, default=0.0)
        self.is_even = least == most and len(finite) == len(self.wanted)
        self.slack = [min(limit, most) - least for limit in limits]
        for place in set(range(count)) - set(self.wanted):
            self.slack[place] = math.inf
        stations = energy.stations if energy else []
        self.places = [*range(count), *stations]
        self.leg_seconds = [*graph.edges, *(graph.edges[station] for station in stations)]
        self.slack += [0.0] * len(stations)
        self.away: Sequence[Mapping[int, float] | Sequence[float]]
        if graph.has_all_pairs:
            self._shortest: list[list[float]] = graph.distances.tolist()
            self._hops: dict[tuple[int, int], int] = {}
            self.away = self._seconds_away()
        else:
            self.away = [_FoundPaths(self, stop) for stop in range(len(self.places))]
        self._paths: dict[tuple[int, int], list[int]] = {}
        self._near: dict[int, list[int]] = {}

    # Ways.

    def _seconds_away(self) -> list[list[float]]:
        """Return the seconds from each stop to each other, shape (stops, stops).

        A neighbour is entered by the leg to it: where a way round by another place is shorter, the
        rules may not allow that.
        """
        shortest = self._shortest
        longer = {
            other
            for place in range(self.count)
            for other, seconds in self.leg_seconds[place].items()
            if seconds > shortest[place][other] + HALF_OPEN
        }
        away = [row.copy() for row in shortest]
        for target in sorted(longer):
            to_target = self.graph.distances[:, target]
            for place in np.argsort(to_target, kind='stable').tolist():
                if place != target and math.isfinite(to_target[place]):
                    hop = self.hop(place, target)
                    away[place][target] = self.leg_seconds[place][hop] + away[hop][target]
        if self.energy:
            for number, drive in enumerate(self.energy.drive):
                for place, row in enumerate(away):
                    row.append(drive[self.places[place]])
                away.append([*away[self.energy.stations[number]]])
            for number, station in enumerate(self.energy.stations):
                away[self.count + number][:] = away[station]
        return away

    def seconds_between(self, stop: int, target: int) -> float:
        """Return what `away` has for a large map, found by a search around the stop."""
        if target >= self.count:
            assert self.energy is not None
            return float(self.energy.drive[target - self.count][self.places[stop]])
        place = self.places[stop]
        if place == target:
            return 0.0
        leg = self.leg_seconds[place].get(target)
        return leg if leg is not None else self._search(place, target)[0]

    def _search(self, start: int, goal: int) -> tuple[float, list[int]]:
        """Return the seconds and the places of the shortest way, which is near as a rule."""
        pending: list[tuple[float, int, int]] = [(0.0, start, -1)]
        before: dict[int, int] = {}
        while pending and len(before) < LOCAL_REACH:
            seconds, place, last = heapq.heappop(pending)
            if place in before:
                continue
            before[place] = last
            if place == goal:
                way = [goal]
                while before[way[-1]] != start:
                    way.append(before[way[-1]])
                return seconds, way[::-1]
            for other, leg in self.leg_seconds[place].items():
                if other not in before:
                    heapq.heappush(pending, (seconds + leg, other, place))
        graph = self.graph
        names = graph.route(graph.places[start], graph.places[goal])
        return float(graph.row(start)[goal]), [graph.index[name] for name in names]

    def hop(self, stop: int, target: int) -> int:
        """Return the first stop on the way to a target."""
        place = self.places[stop]
        if target >= self.count or target in self.leg_seconds[place]:
            return target
        if not self.graph.has_all_pairs:
            return self.path(place, target)[0]
        found = self._hops.get((place, target))
        if found is None:
            ways, away = self.leg_seconds[place], self._shortest
            found = min(ways, key=lambda other: ways[other] + away[other][target])
            self._hops[place, target] = found
        return found

    def path(self, stop: int, target: int) -> list[int]:
        """Return the stops on the way to a target, without the first."""
        if target >= self.count:
            return [target]
        place = self.places[stop]
        found = self._paths.get((place, target))
        if found is None:
            if target in self.leg_seconds[place]:
                found = [target]
            elif place == target or not self.graph.has_all_pairs:
                found = [] if place == target else self._search(place, target)[1]
            else:
                hop = self.hop(place, target)
                found = [hop, *self.path(hop, target)]
            self._paths[place, target] = found
        return found

    def near(self, stop: int) -> list[int]:
        """Return wanted places that are near a stop, at most `NEAR`, and the nearest station."""
        place = self.places[stop]
        found = self._near.get(place)
        if found is None:
            found = self._near[place] = self._nearest(place)
        return found

    def _nearest(self, place: int) -> list[int]:
        wanted = set(self.wanted) - {place}
        if self.graph.has_all_pairs:
            both = self.graph.distances[place] + self.graph.distances[:, place]
            order = np.argsort(both, kind='stable').tolist()
            return [other for other in order if other in wanted][:NEAR]
        found: list[int] = []
        pending, done = [(0.0, place)], set[int]()
        while pending and len(found) < NEAR:
            seconds, other = heapq.heappop(pending)
            if other in done:
                continue
            done.add(other)
            if other in wanted:
                found.append(other)
            for after, leg in self.leg_seconds[other].items():
                heapq.heappush(pending, (seconds + leg, after))
        return found

    # Rules.

    @cached_property
    def gates(self) -> list[int]:
        """For each place that is entered only when URGENT, where from; -1 for all others."""
        gates = []
        for place in range(self.count):
            ways = self.leg_seconds[place]
            held = bool(ways) and all(
                self.table.is_held(place, self.leg_seconds[gate]) for gate in ways
            )
            gates.append(min(ways, key=lambda o: self.leg_seconds[o][place]) if held else -1)
        return gates

    @cached_property
    def held_periods(self) -> dict[int, float]:
        """Seconds that each place waits at least that may be entered only when it is URGENT: for
        its threshold and the leg to it. A place with a station may be entered for a charge."""
        stations = self.energy.stations if self.energy else ()
        limits = self.table.limits
        return {
            place: limits[place] + self.leg_seconds[self.gates[place]][place] + HALF_OPEN
            for place in self.wanted
            if self.gates[place] >= 0 and place not in stations and math.isfinite(limits[place])
        }

    @cached_property
    def least_period(self) -> float:
        """Seconds that some place waits from visit to visit whatever the robot does; 0: none."""
        return max(self.held_periods.values(), default=0.0)

    @cached_property
    def least_wait(self) -> float:
        """The same, less what the place has more time than others."""
        return max((p - self.slack[place] for place, p in self.held_periods.items()), default=0.0)

    @cached_property
    def least_cycle(self) -> float:
        """Seconds that no lawful round is known to fall below."""
        if self.energy is not None or not self.is_even:
            return self.least_wait
        tour = self.graph.tour
        return max(self.least_period, tour.length if tour.find_bound is None else 0.0)

    @cached_property
    def mean_leg(self) -> float:
        """Seconds of the mean leg."""
        legs = [seconds for ways in self.leg_seconds for seconds in ways.values()]
        return sum(legs) / max(1, len(legs))

    def allowed(self, state: PatrolState) -> list[int]:
        """Return the neighbours that the rules allow; empty: there are none at all."""
        now = state.now
        ways: Iterable[int] = self.leg_seconds[state.place]
        if self.energy:
            within = self.energy.within_range
            ways = [other for other in ways if within[other]]
        if self.windows:
            legs = self.leg_seconds[state.place]
            ways = [o for o in ways if o not in self.windows or self.is_open(o, now, legs[o])]
        if state.avoided:
            # Last, as in `decision.candidates`: they count when no other may be entered.
            ways = [other for other in ways if other not in state.avoided] or ways
        return self.table.first(ways, now, state.due or self.due(state))

    def due(self, state: PatrolState) -> list[float]:
        """Return when each place ranks as URGENT; see `PatrolState`."""
        return state.due or self.table.due_times(state.now, state.seen)

    # Hours.

    def is_open(self, place: int, now: float, seconds: float) -> bool:
        """Return whether a way to a place may be begun: it is open, and can be left in time.

        Args:
            place: One of `windows`.
            now: When the robot sets out.
            seconds: That the way takes, exploring included.
        """
        end = now + self._slower * (seconds + self._exits[place])
        return any(first <= now and end < last for first, last in self.windows[place])

    def opens_in(self, place: int, now: float) -> float:
        """Return the seconds until a place is open; inf: it is not known to be again."""
        return min(
            (max(0.0, first - now) for first, last in self.windows[place] if last > now),
            default=math.inf,
        )

    def waited(self, place: int, since: float, now: float) -> float:
        """Return how long a place waits; the next time in which it is closed does not count.

        A place that is missed for all the time that it is open has waited through the time in which
        it is closed after that.
        """
        windows = self.windows.get(place)
        if windows is None:
            return now - since
        closed = -math.inf
        for first, last in (*windows, (math.inf, math.inf)):
            if first > since and closed < now:
                return now - since - max(0.0, min(first, now) - max(closed, since))
            closed = last
        return now - since

    @cached_property
    def last_change(self) -> float:
        """When a place opens or closes for the last time, as far as is known, seconds."""
        times = (t for windows in self.windows.values() for pair in windows for t in pair)
        return max((t for t in times if math.isfinite(t)), default=-math.inf)

    # Rounds.

    def length(self, targets: Sequence[int]) -> float:
        """Return the seconds that a closed round over the targets takes, charging left aside."""
        away = self.away
        return sum(away[a][b] for a, b in zip(targets, (*targets[1:], targets[0]), strict=True))

    def cycles_in(self, walk: Sequence[int]) -> Iterator[tuple[int, ...]]:
        """Yield the stretches at the end of a walk that visit every place, as targets."""
        end, last, begun = walk[-4 * self.count :], dict[int, int](), -1
        for step, stop in enumerate(end):
            last[self.places[stop]] = step
            start = min(last.values())
            if len(last) >= len(self.wanted) and start > begun:
                begun = start
                yield tuple(end[start : step + 1])

    # Charge.

    def affords(self, state: PatrolState, target: int) -> bool:
        """Return whether the charge lets the robot go to a place and home from there."""
        energy = self.energy
        if energy is None or target >= self.count:
            return True
        left = state.level - energy.draw * self.away[state.place][target]
        return bool(left >= energy.least[target])

    def charge_from(self, place: int) -> int:
        """Return the stop of the nearest station; -1: there is none."""
        home = self.energy.home[place] if self.energy else -1
        return self.count + home if home >= 0 else -1

    def guarded(self, state: PatrolState, stop: int) -> int:
        """Return the choice, or a charge where the charge does not allow it.

        The robot's own place when it is at a station and full: then nothing helps.
        """
        if stop == state.place or self.affords(state, stop):
            return stop
        charge = self.charge_from(state.place)
        energy = self.energy
        assert energy is not None
        if charge < 0 or (state.level >= energy.full and self.places[charge] == state.place):
            return state.place
        return charge

    def go(self, state: PatrolState, stop: int) -> float:
        """Move a state to a stop: time passes and the level falls; at a station it is charged.

        Returns:
            Until when the place waited: a station's is visited when the charge begins.
        """
        seconds = self.leg_seconds[state.place].get(stop, math.inf)
        energy = self.energy
        if stop >= self.count:
            assert energy is not None
            number = stop - self.count
            seconds = energy.drive[number][state.place]
            state.level -= energy.draw * seconds
            arrived = state.now + seconds
            seconds += energy.charge_seconds(number, state.level) + energy.approach[number]
            state.level = max(state.level, energy.full)
        else:
            arrived = state.now + seconds
            if energy:
                state.level -= energy.draw * seconds
        state.now += seconds
        state.place = self.places[stop]
        return arrived


class _FoundPaths(dict[int, float]):
    """Seconds from one stop of a large map to others, found when they are first asked for."""

    def __init__(self, rules: RuleGraph, stop: int) -> None:
        self._rules, self._stop = rules, stop

    def __missing__(self, target: int) -> float:
        seconds = self[target] = self._rules.seconds_between(self._stop, target)
        return seconds


@dataclass
class PatrolState:
    """Where a patrol stands.

    Attributes:
        place: Where the robot is.
        now: Seconds.
        seen: When each place was visited last, seconds.
        met: Whether the robot came to each place since the patrol began.
        avoided: Places that could not be reached lately: they count only when no other is open.
        position: How far the robot is on the plan that it follows.
        level: Of the charge, percent.
        due: When each place ranks as URGENT, see `RuleTable.due_times`; empty: as its last visit
            says.
    """

    place: int
    now: float
    seen: list[float]
    met: list[bool]
    avoided: frozenset[int] = frozenset()
    position: int = 0
    level: float = 100.0
    due: list[float] = field(default_factory=list)

    def fresh(self) -> PatrolState:
        """Return a copy at the beginning of a plan, in which every place can be reached."""
        seen, met = self.seen.copy(), self.met.copy()
        return PatrolState(self.place, self.now, seen, met, level=self.level, due=self.due.copy())


def rule_graph(world: Situation, energy: Energy | None = None) -> RuleGraph:
    """Return the map of a world with its rules."""
    index, ahead, windows = world.graph.index, world.now + world.look_ahead, {}
    for place, stretches in world.openings.windows.items():
        known = tuple(_known_until(stretches, ahead))
        if place in index and any(world.now < when <= ahead for pair in known for when in pair):
            windows[index[place]] = known
    slower = 1.0 + PERCENTILE_99 * world.time_spread
    return RuleGraph(world.graph, world.table, energy, windows, slower)


def _known_until(
    stretches: Iterable[tuple[float, float]], ahead: float
) -> Iterator[tuple[float, float]]:
    """Yield stretches as far as a plan knows them: what changes later changes the plan then."""
    for begin, end in stretches:
        if begin <= ahead:
            yield begin, end if end <= ahead else math.inf
