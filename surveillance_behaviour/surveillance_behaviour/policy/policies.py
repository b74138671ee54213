"""Policies: how good is each of the places that the rules allow?

A policy is a function from a :class:`World` and the allowed places to a :class:`Score` for each. It
can be changed at run time: what it needs to remember (the target it was heading for, a plan, where
it draws its chance from) stands in the world.

========= ========================================================================================
seed      any allowed place, at random
oldest    the allowed place that went unvisited longest
lookahead the way to wherever on the whole map (time unvisited - time to get there) is highest
tour      the place from which riding on, within the rules, leaves the least waiting
random    uniform choice, the literature's baseline
CR        conscientious reactive: the neighbour idle longest (Machado et al. 2002)
HCR       heuristic conscientious reactive: idleness and nearness, normalised (Almeida et al. 2004)
HPCC      heuristic path-finder conscientious cognitive: picks a goal on the whole map like HCR and
          keeps it, and goes there over idle places (Almeida et al. 2004)
cycle     round the shortest closed tour, always in the same sense (Chevaleyre 2004)
========= ========================================================================================

``random``, ``CR``, ``HCR``, ``HPCC`` and ``cycle`` know no rules in the literature; run them with
an empty list of rules to compare.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from surveillance_behaviour.policy.graph import PatrolGraph
from surveillance_behaviour.policy.rollout import Rollout
from surveillance_behaviour.policy.world import Score, World

Scores = Mapping[str, Score]
DEFAULT_POLICY = 'tour'
MEAN_WEIGHT = 1e-3
"""How much the mean wait counts beside the longest one where ``tour`` compares two ways."""
SQUARES_WEIGHT = 1e-9
"""How much the sum of all squared waits counts beside the longest wait of a ride."""
RIDES_UP_TO = 150
"""The largest map, in places, on which ``tour`` rides ahead step by step."""
RULES_BIND = 0.25
"""From which threshold on, as a part of the tour, the rules are thought of ahead."""


class Policy(Protocol):
    """Scores the allowed places."""

    def __call__(self, world: World, allowed: Sequence[str]) -> Scores:
        """A score for each of ``allowed``, which is not empty."""


def make_policy(name: str) -> Policy:
    """Return the policy of that name, one of :data:`POLICIES`.

    Raises:
        ValueError: There is no such policy.
    """
    if name not in POLICIES:
        raise ValueError(f'unknown policy {name!r}, expected one of {", ".join(POLICIES)}')
    return POLICIES[name]


def by_chance(world: World, allowed: Sequence[str]) -> Scores:
    """Return a random score for each place."""
    generator = world.memory.generator
    return {place: Score(generator.random(), place, 'drawn at random') for place in allowed}


def oldest(world: World, allowed: Sequence[str]) -> Scores:
    """The time each place went unvisited."""
    scores = {}
    for place in allowed:
        seconds = world.unvisited(place)
        scores[place] = Score(seconds, place, f'it went unvisited for {seconds:.1f} s')
    return scores


def lookahead(world: World, allowed: Sequence[str]) -> Scores:
    """The best (time unvisited - time to get there) of all places, by way of each candidate."""
    graph = world.graph
    scores = {}
    for place in allowed:
        worth = world.idleness - _seconds_by_way_of(world, place)
        worth[graph.index[world.place]] = -np.inf
        best = int(np.argmax(worth))
        target = graph.places[best]
        scores[place] = Score(
            float(worth[best]),
            target,
            f'{_leads_to(place, target)} went unvisited for {world.idleness[best]:.1f} s '
            f'and is {world.idleness[best] - worth[best]:.1f} s away',
        )
    return scores


def tour(world: World, allowed: Sequence[str]) -> Scores:
    """The longest wait of any place if the robot rides on from each candidate.

    It rides round the tour, joined in whichever sense and at whichever pass through the candidate
    leaves the least waiting. Where the threshold is long enough for the rules to forbid much of
    that, two rides are thought through within the rules instead: round the tour as far as they
    allow, and always to the place that went unvisited longest; the better one counts.
    """
    graph = world.graph
    steps = np.array([graph.index[place] for place in graph.walk], dtype=np.intp)
    bound_by_rules = world.rules and world.threshold >= RULES_BIND * graph.tour.length
    small = len(graph.places) <= RIDES_UP_TO
    rollout = Rollout(world) if bound_by_rules and small else None
    scores = {}
    for place in allowed:
        first = graph.index[place]
        start = graph.seconds(world.place, place)
        longest, mean, waiting, way, begin = min(
            (
                (*_wait_on_the_way(world, way, start, int(begin)), sense, int(begin))
                for sense, way in enumerate((steps, steps[::-1]))
                for begin in np.flatnonzero(way == first)
            ),
        )
        if rollout is None:
            value = -(longest + MEAN_WEIGHT * mean)
        else:
            course = (steps, steps[::-1])[way].tolist()
            rides = (rollout.run(first, course, begin), rollout.run(first))
            best = min(rides, key=lambda ride: (ride.longest, ride.squares))
            longest, waiting = best.longest, best.waiting
            value = -(longest + SQUARES_WEIGHT * best.squares)
        name = graph.places[waiting]
        scores[place] = Score(
            value,
            name,
            f'riding on from there leaves no place longer than {longest:.1f} s ({name})',
        )
    return scores


def _wait_on_the_way(
    world: World, way: NDArray[np.intp], start: float, begin: int
) -> tuple[float, float, int]:
    """Longest and mean time the places will have waited when the robot meets them on its way.

    Args:
        world: Where the robot is now.
        way: A closed walk as indices of places.
        start: Seconds until the robot is at ``way[begin]``.
        begin: Where on the walk it begins.

    Returns:
        The longest wait, the mean wait, seconds, and which place waits longest.
    """
    order = np.roll(way, -begin)
    legs = world.graph.distances[order[:-1], order[1:]]
    met = start + np.concatenate(([0.0], np.cumsum(legs)))
    places, first = np.unique(order, return_index=True)
    waits = world.idleness[places] + met[first]
    worst = int(np.argmax(waits))
    return float(waits[worst]), float(waits.mean()), int(places[worst])


def heuristic_reactive(world: World, allowed: Sequence[str]) -> Scores:
    """Half the idleness, half the nearness of each candidate, each over the greatest of them."""
    idle = np.array([world.unvisited(place) for place in allowed])
    far = np.array([world.graph.seconds(world.place, place) for place in allowed])
    return {
        place: Score(
            float(value),
            place,
            f'it went unvisited for {seconds:.1f} s and is {away:.1f} s away',
        )
        for place, value, seconds, away in zip(allowed, _worth(idle, far), idle, far, strict=True)
    }


def heuristic_cognitive(world: World, allowed: Sequence[str]) -> Scores:
    """Towards the goal with the best mix of idleness and nearness, over places that are idle."""
    graph = world.graph
    here = graph.index[world.place]
    far, idle = graph.distances[here], world.idleness
    kept = world.target
    if kept is not None and kept in graph.index and kept != world.place:
        goal = graph.index[kept]
    else:
        worth = _worth(idle, far)
        worth[here] = -np.inf
        goal = int(np.argmax(worth))
    target = graph.places[goal]
    first, rest = _idle_ways(graph, idle, here, goal)
    return {
        place: Score(
            -float(first[graph.index[place]] + rest[graph.index[place]]),
            target,
            f'{_leads_to(place, target)} went unvisited for {idle[goal]:.1f} s '
            f'and is {far[goal]:.1f} s away',
        )
        for place in allowed
    }


def _idle_ways(
    graph: PatrolGraph, idle: NDArray[np.float64], here: int, goal: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Costs of the legs from ``here`` and of the ways to ``goal``, each of shape (n,).

    A leg costs its time over the longest, plus the freshness of the place it enters.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import dijkstra

    legs = graph.adjacency.tocoo()
    idlest = max(float(idle.max()), 1e-9)
    fresh = 1.0 - np.clip(idle[legs.col] / idlest, 0.0, 1.0)
    weights = legs.data / float(legs.data.max()) + fresh + 1e-6
    first = np.full(len(idle), np.inf)
    leaving = legs.row == here
    first[legs.col[leaving]] = weights[leaving]
    backwards = csr_array((weights, (legs.col, legs.row)), shape=legs.shape)
    return first, dijkstra(backwards, indices=goal)


def cycle(world: World, allowed: Sequence[str]) -> Scores:
    """How soon each candidate comes on the closed tour, from where the robot is on it.

    Where the tour passes a place several times, the robot is taken to be at the pass after which
    the next steps have waited longest.
    """
    graph = world.graph
    walk = graph.walk
    passes = [number for number, place in enumerate(walk) if place == world.place]
    here = max(passes, key=lambda number: world.unvisited(walk[(number + 1) % len(walk)]))
    ahead = walk[here + 1 :] + walk[: here + 1]
    return {
        place: Score(
            -float(ahead.index(place)),
            place,
            f'it is {ahead.index(place) + 1} steps on, on the tour',
        )
        for place in allowed
    }


def _seconds_by_way_of(world: World, place: str) -> NDArray[np.float64]:
    """Seconds to each place when the robot first goes to ``place``, shape (n,)."""
    graph = world.graph
    seconds: NDArray[np.float64] = graph.distances[graph.index[place]]
    return seconds + graph.seconds(world.place, place)


def _worth(idle: NDArray[np.float64], far: NDArray[np.float64]) -> NDArray[np.float64]:
    nearness: NDArray[np.float64] = 1.0 - far / max(float(far.max()), 1e-9)
    worth: NDArray[np.float64] = idle / max(float(idle.max()), 1e-9) + nearness
    return worth


def _leads_to(place: str, target: str) -> str:
    return 'it' if place == target else f'it leads to {target}, which'


POLICIES: Mapping[str, Policy] = {
    'tour': tour,
    'lookahead': lookahead,
    'oldest': oldest,
    'seed': by_chance,
    'random': by_chance,
    'CR': oldest,
    'HCR': heuristic_reactive,
    'HPCC': heuristic_cognitive,
    'cycle': cycle,
}
"""The policies by name."""
