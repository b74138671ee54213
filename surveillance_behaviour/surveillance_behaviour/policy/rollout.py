"""Rides a patrol ahead in thought, within the rules, and sees how long places will have waited.

The rules hold the robot to URGENT places while there are any, and to corridors else, so the best
tour cannot always be ridden. A ride therefore obeys the rules at each step, as the robot will
have to, and chooses among what they allow in one of two simple ways: round a tour, or always to
the place that went unvisited longest. What a policy that thinks ahead needs is only which first
step ends best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from surveillance_behaviour.policy.graph import PatrolGraph
from surveillance_behaviour.policy.world import World

URGENT = 'URGENT'
"""The class whose members change by waiting; all others are taken to stay as they are."""
HORIZON = 1.5
"""How far a ride goes, in tours or thresholds, whichever is longer."""


@dataclass(frozen=True)
class Ride:
    """What a ride came to.

    Attributes:
        longest: The longest wait of any place that it met or left waiting, seconds.
        squares: The sum of all waits squared, s^2; compares rides of the same longest wait.
        waiting: Index of the place that waited longest.
    """

    longest: float
    squares: float
    waiting: int


class Rollout:
    """Rides on one map in one world.

    Args:
        world: Where and when the rides begin; its classes are those of all places.
    """

    def __init__(self, world: World) -> None:
        graph = world.graph
        self._neighbours = _neighbours(graph)
        self._seen = [world.visited_at.get(place, world.since) for place in graph.places]
        self._here = graph.index[world.place]
        self._now = world.now
        self._threshold = world.threshold
        self._seconds = HORIZON * max(graph.tour.length, world.threshold)
        rules = world.rules
        self._urgent = rules.index(URGENT) if URGENT in rules else len(rules)
        self._ranks = []
        for place in graph.places:
            classes = world.classes.get(place, frozenset()) - {URGENT}
            ranks = [rank for rank, name in enumerate(rules) if name in classes]
            self._ranks.append(min(ranks, default=len(rules)))

    def run(self, first: int, way: Sequence[int] = (), begin: int = 0) -> Ride:
        """One ride.

        Args:
            first: Index of the place it goes to first.
            way: A closed walk to keep to as far as the rules allow; empty: always to the place
                that went unvisited longest.
            begin: Where on the walk ``first`` is met.
        """
        neighbours, ranks, threshold = self._neighbours, self._ranks, self._threshold
        seen = self._seen.copy()
        now, place, step = self._now, first, begin
        seconds = neighbours[self._here][first]
        end = now + self._seconds
        longest, squares, waiting = 0.0, 0.0, first
        while True:
            now += seconds
            wait = now - seen[place]
            squares += wait * wait
            if wait > longest:
                longest, waiting = wait, place
            seen[place] = now
            if now >= end:
                break
            planned = way[(step + 1) % len(way)] if way else -1
            best, least, oldest = -1, len(ranks) + 1, -1.0
            for other in neighbours[place]:
                idle = now - seen[other]
                rank = ranks[other]
                if idle > threshold and self._urgent < rank:
                    rank = self._urgent
                if rank < least or (
                    rank == least and best != planned and (other == planned or idle > oldest)
                ):
                    best, least, oldest = other, rank, idle
            if way:
                step += 1
                if best != planned:
                    step = _next_meeting(way, best, step)
            seconds = neighbours[place][best]
            place = best
        for other, time in enumerate(seen):
            wait = now - time
            squares += wait * wait
            if wait > longest:
                longest, waiting = wait, other
        return Ride(longest, squares, waiting)


def _next_meeting(way: Sequence[int], place: int, step: int) -> int:
    """The next position on the closed walk at which ``place`` is met."""
    count = len(way)
    for ahead in range(count):
        if way[(step + ahead) % count] == place:
            return (step + ahead) % count
    return step % count


def _neighbours(graph: PatrolGraph) -> list[dict[int, float]]:
    index, dwell = graph.index, graph.dwell
    return [
        {index[other]: seconds + dwell for other, seconds in sorted(graph.legs[place].items())}
        for place in graph.places
    ]
