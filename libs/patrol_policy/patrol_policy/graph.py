"""The map as a patrol sees it: places, the ways between neighbours, and what they cost in time.

A leg costs the time to drive it; whoever enters a place also spends ``exploration_seconds`` there.
All costs that leave this module are the sum of both, in seconds.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol_policy.tour import (
    DENSE_UP_TO,
    EXACT_UP_TO,
    Tour,
    shortest_tour,
    tour_over_blocks,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

ALL_PAIRS_UP_TO = 600
"""Up to so many places the shortest ways between all pairs are kept. On larger maps they are found
when they are asked for, so that memory grows with the ways and not with the pairs."""
TREES_KEPT = 64
"""How many trees of shortest ways a large map keeps."""


class GraphError(ValueError):
    """A map cannot be patrolled as it is; the message names the place or the line."""


@dataclass(frozen=True, eq=False)
class PatrolGraph:
    """Places and the ways between them. Derived quantities are computed once, when first asked for.

    Attributes:
        leg_seconds: For each place, its neighbours and the seconds it takes to drive there. Each
            leg has a way back, which may take another time.
        exploration_seconds: Seconds that the robot stays in each place it enters.
        own_exploration: The same for places that differ from that.

    Raises:
        GraphError: A leg leads to an unknown place, is not positive, or has no way back.
    """

    leg_seconds: Mapping[str, Mapping[str, float]]
    exploration_seconds: float = 0.0
    own_exploration: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for place, edges in self.leg_seconds.items():
            for other, seconds in edges.items():
                if other not in self.leg_seconds:
                    raise GraphError(f'{place} leads to {other}, which is not a place of the map')
                if not seconds + self.exploring(other) > 0.0 or not math.isfinite(seconds):
                    raise GraphError(f'{place} to {other} takes {seconds} s, expected more than 0')
                if place not in self.leg_seconds[other]:
                    raise GraphError(f'{place} leads to {other}, but {other} not back')

    def exploring(self, place: str) -> float:
        """Return the seconds that the robot stays in a place it enters."""
        return self.own_exploration.get(place, self.exploration_seconds)

    @cached_property
    def places(self) -> tuple[str, ...]:
        """All places, in the order of every array below."""
        return tuple(sorted(self.leg_seconds))

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Position of each place in :attr:`places`."""
        return {place: position for position, place in enumerate(self.places)}

    @cached_property
    def edges(self) -> list[dict[int, float]]:
        """For each place, the seconds to each neighbour, exploring there included, by index."""
        index = self.index
        return [
            {
                index[other]: seconds + self.exploring(other)
                for other, seconds in sorted(self.leg_seconds[place].items())
            }
            for place in self.places
        ]

    def drive_home(self, stations: Iterable[str]) -> tuple[list[float], list[int]]:
        """Return the seconds of driving from each place to the nearest of some places.

        Nothing is explored on the way: so the robot drives when it goes to charge.

        Args:
            stations: Places of the map.

        Returns:
            The seconds, inf where there is no way, and the index of the place they lead to, -1
            where there is none.
        """
        back: list[list[tuple[int, float]]] = [[] for _ in self.places]
        for name, others in self.leg_seconds.items():
            for other, leg in others.items():
                back[self.index[other]].append((self.index[name], leg))
        away, leads_to = [math.inf] * len(back), [-1] * len(back)
        pending = [(0.0, self.index[station], self.index[station]) for station in stations]
        heapq.heapify(pending)
        while pending:
            seconds, place, station = heapq.heappop(pending)
            if seconds >= away[place]:
                continue
            away[place], leads_to[place] = seconds, station
            for before, leg in back[place]:
                if seconds + leg < away[before]:
                    heapq.heappush(pending, (seconds + leg, before, station))
        return away, leads_to

    def longest_exit(self, place: str) -> float:
        """Return the seconds of driving over the longest leg out of a place."""
        return max(self.leg_seconds[place].values(), default=0.0)

    @cached_property
    def cheapest_entries(self) -> float:
        """Seconds for entering each place once from its nearest neighbour: no tour is shorter."""
        edges = self.edges
        entries = (
            min((edges[o][p] for o in others), default=0.0) for p, others in enumerate(edges)
        )
        return sum(entries)

    @cached_property
    def adjacency(self) -> csr_array:
        """The seconds of the legs, exploring included, as a sparse matrix."""
        from scipy.sparse import csr_array

        count = len(self.places)
        rows = np.repeat(np.arange(count), [len(others) for others in self.edges])
        columns = np.array([o for others in self.edges for o in others], dtype=np.intp)
        values = np.array([s for others in self.edges for s in others.values()])
        return csr_array((values, (rows, columns)), shape=(count, count))

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """Seconds from each place to each other by the shortest way, shape (n, n); inf: no way.

        Ask a large map for `row` instead.
        """
        if len(self.places) > DENSE_UP_TO:
            from scipy.sparse.csgraph import dijkstra

            found: NDArray[np.float64] = dijkstra(self.adjacency)
            return found
        count = len(self.places)
        seconds = np.full((count, count), np.inf)
        for place, others in enumerate(self.edges):
            seconds[place, list(others)] = list(others.values())
        np.fill_diagonal(seconds, 0.0)
        for middle in range(count):
            np.minimum(seconds, seconds[:, middle, None] + seconds[middle], out=seconds)
        return seconds

    @cached_property
    def has_all_pairs(self) -> bool:
        """Whether the map is small enough for :attr:`distances`."""
        return len(self.places) <= ALL_PAIRS_UP_TO

    @cached_property
    def _trees(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.int32]]]:
        return {}

    def _tree(self, start: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return the seconds to each place of a large map, and the place before it on the way."""
        trees = self._trees
        if start not in trees:
            from scipy.sparse.csgraph import dijkstra

            while len(trees) >= TREES_KEPT:
                trees.pop(next(iter(trees)))
            seconds, before = dijkstra(self.adjacency, indices=[start], return_predecessors=True)
            trees[start] = seconds[0], before[0]
        return trees[start]

    def row(self, start: int) -> NDArray[np.float64]:
        """Return the seconds from one place to each other by the shortest way, shape (n,)."""
        found: NDArray[np.float64] = (
            self.distances[start] if self.has_all_pairs else self._tree(start)[0]
        )
        return found

    def seconds(self, start: str, goal: str) -> float:
        """Return the seconds from ``start`` to ``goal`` by the shortest way; inf when there is
        none.
        """
        return float(self.row(self.index[start])[self.index[goal]])

    def move(self, start: str, goal: str) -> float:
        """Return the seconds of a move: over the leg to a neighbour, even where a way round is
        shorter; by the shortest way to any other place.
        """
        leg = self.leg_seconds[start].get(goal)
        return self.seconds(start, goal) if leg is None else leg + self.exploring(goal)

    def route(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places on the shortest way, without ``start``, with ``goal``.

        Raises:
            GraphError: There is no way.
        """
        if not math.isfinite(self.seconds(start, goal)):
            raise GraphError(f'there is no way from {start} to {goal}')
        if not self.has_all_pairs:
            before, at = self._tree(self.index[start])[1], self.index[goal]
            back = []
            while at != self.index[start]:
                back.append(self.places[at])
                at = int(before[at])
            return tuple(reversed(back))
        way, place = [], start
        while place != goal:
            place = min(
                sorted(self.leg_seconds[place]),
                key=lambda other: self.move(place, other) + self.seconds(other, goal),
            )
            way.append(place)
        return tuple(way)

    def connected(self, place: str) -> PatrolGraph:
        """Return the part of the map that can be reached from ``place``; itself when that is
        all.
        """
        within, pending = {place}, [place]
        while pending:
            found = [other for other in self.leg_seconds[pending.pop()] if other not in within]
            within.update(found)
            pending += found
        return self if len(within) == len(self.leg_seconds) else self.restricted(within)

    def restricted(self, kept: Iterable[str]) -> PatrolGraph:
        """Return the map without all places but ``kept``."""
        names = set(kept)
        legs = {
            place: {other: cost for other, cost in edges.items() if other in names}
            for place, edges in self.leg_seconds.items()
            if place in names
        }
        return PatrolGraph(legs, self.exploration_seconds, self.own_exploration)

    def without_leg(self, start: str, goal: str) -> PatrolGraph:
        """Return the map without the direct way between two places."""
        gone = {(start, goal), (goal, start)}
        legs = {
            place: {other: cost for other, cost in edges.items() if (place, other) not in gone}
            for place, edges in self.leg_seconds.items()
        }
        return PatrolGraph(legs, self.exploration_seconds, self.own_exploration)

    @cached_property
    def tour(self) -> Tour:
        """The shortest closed tour of a connected map, or a good one with a lower bound.

        Raises:
            GraphError: The map is not connected.
        """
        if self.places and not np.isfinite(self.row(0)).all():
            raise GraphError('no tour leads through all places: the map is not connected')
        if len(self.places) <= EXACT_UP_TO:
            return shortest_tour(self.distances)
        return tour_over_blocks(self.edges, biconnected_blocks(self.edges))

    @cached_property
    def walk(self) -> tuple[str, ...]:
        """The tour step by step over neighbours, closed: after the last place comes the first."""
        order = [self.places[position] for position in self.tour.order]
        if len(order) < 2:
            return tuple(order)
        steps: list[str] = []
        for start, goal in zip(order, [*order[1:], order[0]], strict=True):
            steps.extend(self.route(start, goal))
        return tuple(steps)


def biconnected_blocks(edges: Sequence[Iterable[int]]) -> list[list[int]]:
    """Return the blocks of a graph: places that stay connected whichever of them is taken away.

    By one depth-first walk (Hopcroft and Tarjan, Algorithm 447, Communications of the ACM, 1973).

    Args:
        edges: Where a way leads from each place; its direction does not count.
    """
    joined: list[set[int]] = [set() for _ in edges]
    for place, others in enumerate(edges):
        for other in others:
            joined[place].add(other)
            joined[other].add(place)
    number: dict[int, int] = {}
    lowest: dict[int, int] = {}
    blocks = []
    for root in range(len(edges)):
        if root in number:
            continue
        number[root] = lowest[root] = len(number)
        walk, waiting = [(root, root, iter(joined[root]))], [root]
        while walk:
            place, above, beside = walk[-1]
            for other in beside:
                if other not in number:
                    number[other] = lowest[other] = len(number)
                    waiting.append(other)
                    walk.append((other, place, iter(joined[other])))
                    break
                if other != above:
                    lowest[place] = min(lowest[place], number[other])
            else:
                walk.pop()
                if place == root:
                    continue
                lowest[above] = min(lowest[above], lowest[place])
                if lowest[place] >= number[above]:
                    # Nothing below leads past the place above: a block ends there.
                    block = [above]
                    while block[-1] != place:
                        block.append(waiting.pop())
                    blocks.append(sorted(block))
    return sorted(blocks)


def graph_of_places(
    connections: Mapping[str, Iterable[str]],
    positions: Mapping[str, Sequence[float]],
    speed: float = 1.0,
    exploration_seconds: float = 0.0,
) -> PatrolGraph:
    """Return a graph whose legs are as long as the straight line between the places.

    Args:
        connections: For each place, its neighbours.
        positions: A point in each place, metres.
        speed: Metres per second.
        exploration_seconds: Seconds spent in each place.

    Raises:
        GraphError: A position is missing, or the connections do not fit together.
    """
    for place in connections:
        if place not in positions:
            raise GraphError(f'{place} has no position')
    return PatrolGraph(
        {
            place: {
                other: math.dist(positions[place][:2], positions[other][:2]) / speed
                for other in others
                if other in positions
            }
            for place, others in connections.items()
        },
        exploration_seconds,
    )
