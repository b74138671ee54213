"""Policies of the literature, which know no rules; they are here to compare with.

========= ========================================================================================
random    uniform choice, the literature's baseline
CR        conscientious reactive: the neighbour idle longest (Machado et al. 2002)
HCR       heuristic conscientious reactive: idleness and nearness, normalised (Almeida et al. 2004)
HPCC      heuristic path-finder conscientious cognitive: picks a goal on the whole map like HCR and
          keeps it, and goes there over idle places (Almeida et al. 2004)
cycle     round the shortest closed tour, always in the same sense (Chevaleyre 2004)
========= ========================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from patrol_policy.battery import Energy
from patrol_policy.graph import PatrolGraph
from patrol_policy.policies import Policy, Scores, by_chance, oldest
from patrol_policy.situation import PolicyMemory, Score, Situation

PASSES: WeakKeyDictionary[PolicyMemory, int] = WeakKeyDictionary()
"""Where on the tour each robot is."""


def heuristic_reactive(
    world: Situation, allowed: Sequence[str], energy: Energy | None = None
) -> Scores:
    """Half the idleness, half the nearness of each candidate, each over the greatest of them."""
    idle = np.array([world.idleness_of(place) for place in allowed])
    far = np.array([world.graph.seconds(world.place, place) for place in allowed])
    return {
        place: Score(float(value), place, f'{place} is {away:.1f} s away')
        for place, value, away in zip(allowed, _worth(idle, far), far, strict=True)
    }


def heuristic_cognitive(
    world: Situation, allowed: Sequence[str], energy: Energy | None = None
) -> Scores:
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
            f'{target} is {far[goal]:.1f} s away',
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
    return first, dijkstra(backwards, indices=goal)  # type: ignore[call-overload]


def cycle(world: Situation, allowed: Sequence[str], energy: Energy | None = None) -> Scores:
    """Return how soon each candidate comes on the closed tour, from where the robot is on it.

    The tour may pass a place several times: the pass that the robot is on is remembered. A robot
    that is elsewhere than the tour goes on takes the pass whose next steps have waited longest.
    """
    walk = world.graph.walk
    here = (PASSES.get(world.memory, -1) + 1) % len(walk)
    if walk[here] != world.place:
        at = [number for number, place in enumerate(walk) if place == world.place]
        here = max(at, key=lambda number: world.idleness_of(walk[(number + 1) % len(walk)]))
    PASSES[world.memory] = here
    ahead = walk[here + 1 :] + walk[: here + 1]
    return {
        place: Score(
            -float(ahead.index(place)),
            place,
            f'it is number {ahead.index(place) + 1} of the next places on the tour',
        )
        for place in allowed
    }


def _worth(idle: NDArray[np.float64], far: NDArray[np.float64]) -> NDArray[np.float64]:
    nearness: NDArray[np.float64] = 1.0 - far / max(float(far.max()), 1e-9)
    worth: NDArray[np.float64] = idle / max(float(idle.max()), 1e-9) + nearness
    return worth


LITERATURE: Mapping[str, Policy] = {
    'random': by_chance,
    'CR': oldest,
    'HCR': heuristic_reactive,
    'HPCC': heuristic_cognitive,
    'cycle': cycle,
}
"""The policies by name."""
