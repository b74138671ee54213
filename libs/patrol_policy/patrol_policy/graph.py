"""The map as a patrol sees it: places, the ways between neighbours, and what they cost in time.

A leg costs the time to drive it; whoever enters a place also spends ``exploration_seconds`` there.
All costs that leave this module are the sum of both, in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol_policy.tour import (
    EXACT_UP_TO,
    Tour,
    shortest_tour,
    tour_over_blocks,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

DENSE_UP_TO = 128
"""Up to so many places the shortest ways are computed without scipy, whose import takes longer."""


class GraphError(ValueError):
    """A map cannot be patrolled as it is; the message names the place or the line."""


@dataclass(frozen=True, eq=False)
class PatrolGraph:
    """Places and the ways between them. Derived quantities are computed once, when first asked for.

    Attributes:
        leg_seconds: For each place, its neighbours and the seconds it takes to drive there. Each
            leg has a way back, which may take another time.
        exploration_seconds: Seconds that the robot stays in each place it enters.

    Raises:
        GraphError: A leg leads to an unknown place, is not positive, or has no way back.
    """

    leg_seconds: Mapping[str, Mapping[str, float]]
    exploration_seconds: float = 0.0

    def __post_init__(self) -> None:
        for place, ways in self.leg_seconds.items():
            for other, seconds in ways.items():
                if other not in self.leg_seconds:
                    raise GraphError(f'{place} leads to {other}, which is not a place of the map')
                if not seconds + self.exploration_seconds > 0.0 or not math.isfinite(seconds):
                    raise GraphError(f'{place} to {other} takes {seconds} s, expected more than 0')
                if place not in self.leg_seconds[other]:
                    raise GraphError(f'{place} leads to {other}, but {other} not back')

    @cached_property
    def places(self) -> tuple[str, ...]:
        """All places, in the order of every array below."""
        return tuple(sorted(self.leg_seconds))

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Position of each place in :attr:`places`."""
        return {place: position for position, place in enumerate(self.places)}

    @cached_property
    def direct(self) -> NDArray[np.float64]:
        """Seconds of each leg, exploring included, shape (n, n); inf: not neighbours."""
        costs = np.full((len(self.places), len(self.places)), np.inf)
        for place, ways in self.leg_seconds.items():
            for other, seconds in ways.items():
                costs[self.index[place], self.index[other]] = seconds + self.exploration_seconds
        return costs

    @cached_property
    def adjacency(self) -> csr_array:
        """:attr:`direct` as a sparse matrix without the infinite entries."""
        from scipy.sparse import csr_array

        rows, columns = np.nonzero(np.isfinite(self.direct))
        values = self.direct[rows, columns]
        return csr_array((values, (rows, columns)), shape=self.direct.shape)

    @cached_property
    def distances(self) -> NDArray[np.float64]:
        """Seconds from each place to each other by the shortest way, shape (n, n); inf: no way."""
        if len(self.places) > DENSE_UP_TO:
            from scipy.sparse.csgraph import dijkstra

            found: NDArray[np.float64] = dijkstra(self.adjacency)
            return found
        seconds = self.direct.copy()
        np.fill_diagonal(seconds, 0.0)
        for middle in range(len(seconds)):
            np.minimum(seconds, seconds[:, middle, None] + seconds[middle], out=seconds)
        return seconds

    def seconds(self, start: str, goal: str) -> float:
        """Return the seconds from ``start`` to ``goal`` by the shortest way; inf when there is
        none.
        """
        return float(self.distances[self.index[start], self.index[goal]])

    def move(self, start: str, goal: str) -> float:
        """Return the seconds of a move: over the leg to a neighbour, even where a way round is
        shorter; by the shortest way to any other place.
        """
        leg = self.leg_seconds[start].get(goal)
        return self.seconds(start, goal) if leg is None else leg + self.exploration_seconds

    def route(self, start: str, goal: str) -> tuple[str, ...]:
        """Return the places on the shortest way, without ``start``, with ``goal``.

        Raises:
            GraphError: There is no way.
        """
        if not math.isfinite(self.seconds(start, goal)):
            raise GraphError(f'there is no way from {start} to {goal}')
        way, place = [], start
        while place != goal:
            ways = self.leg_seconds[place]
            place = min(sorted(ways), key=lambda other: ways[other] + self.seconds(other, goal))
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
            place: {other: cost for other, cost in ways.items() if other in names}
            for place, ways in self.leg_seconds.items()
            if place in names
        }
        return PatrolGraph(legs, self.exploration_seconds)

    def without_leg(self, start: str, goal: str) -> PatrolGraph:
        """Return the map without the direct way between two places."""
        gone = {(start, goal), (goal, start)}
        legs = {
            place: {other: cost for other, cost in ways.items() if (place, other) not in gone}
            for place, ways in self.leg_seconds.items()
        }
        return PatrolGraph(legs, self.exploration_seconds)

    @cached_property
    def tour(self) -> Tour:
        """The shortest closed tour of a connected map, or a good one with a lower bound.

        Raises:
            GraphError: The map is not connected.
        """
        if not np.isfinite(self.distances).all():
            raise GraphError('no tour leads through all places: the map is not connected')
        if len(self.places) <= EXACT_UP_TO:
            return shortest_tour(self.distances)
        import networkx

        network: networkx.Graph[str] = networkx.Graph()
        network.add_nodes_from(self.places)
        network.add_edges_from(
            (place, other) for place in self.leg_seconds for other in self.leg_seconds[place]
        )
        blocks = [
            sorted(self.index[place] for place in block)  # type: ignore[index]
            for block in networkx.biconnected_components(network)
        ]
        return tour_over_blocks(self.distances, sorted(blocks))

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
