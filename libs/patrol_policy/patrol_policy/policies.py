"""Policies: how good is each of the places that the rules allow?

A policy is a function from a :class:`World` and the allowed places to a :class:`Score` for each. It
can be changed at run time: what it needs to remember (the target it was heading for, a plan, where
it draws its chance from) stands in the world.

========= ========================================================================================
seed      any allowed place, at random
oldest    the allowed place that went unvisited longest
lookahead the way to wherever on the whole map (time unvisited - time to get there) is highest
tour      the place next on a round that was planned within the rules to leave the least waiting
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

from patrol_policy.graph import PatrolGraph
from patrol_policy.plan import plan_of
from patrol_policy.suggestions import closest_name
from patrol_policy.world import Score, World

Scores = Mapping[str, Score]
DEFAULT_POLICY = 'tour'


class Policy(Protocol):
    """Scores the allowed places."""

    def __call__(self, world: World, allowed: Sequence[str]) -> Scores:
        """Return a score for each of ``allowed``, which is not empty."""


def make_policy(name: str) -> Policy:
    """Return the policy of that name, one of :data:`POLICIES`.

    Raises:
        ValueError: There is no such policy.
    """
    if name not in POLICIES:
        raise ValueError(f'unknown policy {name!r}, expected {closest_name(name, POLICIES)}')
    return POLICIES[name]


def by_chance(world: World, allowed: Sequence[str]) -> Scores:
    """Return a random score for each place."""
    generator = world.memory.generator
    return {place: Score(generator.random(), place, 'drawn at random') for place in allowed}


def oldest(world: World, allowed: Sequence[str]) -> Scores:
    """Return the time each place went unvisited."""
    scores = {}
    for place in allowed:
        scores[place] = Score(world.unvisited(place), place, 'the longest wait decides')
    return scores


def lookahead(world: World, allowed: Sequence[str]) -> Scores:
    """Return the best of (time unvisited - time to get there), by way of each candidate."""
    graph = world.graph
    scores = {}
    for place in allowed:
        worth = world.idleness - _seconds_by_way_of(world, place)
        worth[graph.index[world.place]] = -np.inf
        best = int(np.argmax(worth))
        target = graph.places[best]
        away = world.idleness[best] - worth[best]
        scores[place] = Score(float(worth[best]), target, _towards(world, place, target, away))
    return scores


def tour(world: World, allowed: Sequence[str]) -> Scores:
    """Return the next place of the plan, then how near each place is to its target; see `plan`."""
    plan, graph = plan_of(world), world.graph
    next_place, target = (graph.places[index] for index in plan.advance(world))
    words = f'the longest wait on this round is {plan.longest:.1f} s'
    return {
        place: Score(
            0.0 if place == next_place else -1.0 - graph.seconds(place, target),
            target,
            f'{_way_to(world, place, target) or "it is next on the round"}; {words}',
        )
        for place in allowed
    }


def heuristic_reactive(world: World, allowed: Sequence[str]) -> Scores:
    """Half the idleness, half the nearness of each candidate, each over the greatest of them."""
    idle = np.array([world.unvisited(place) for place in allowed])
    far = np.array([world.graph.seconds(world.place, place) for place in allowed])
    return {
        place: Score(float(value), place, _towards(world, place, place, away))
        for place, value, away in zip(allowed, _worth(idle, far), far, strict=True)
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
            _towards(world, place, target, far[goal]),
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


def cycle(world: World, allowed: Sequence[str]) -> Scores:
    """Return how soon each candidate comes on the closed tour, from where the robot is on it.

    The tour may pass a place several times: the pass that the robot is on is remembered. A robot
    that is elsewhere than the tour goes on takes the pass whose next steps have waited longest.
    """
    walk, passes = world.graph.walk, world.memory.passes
    here = (passes.get(walk, -1) + 1) % len(walk)
    if walk[here] != world.place:
        at = [number for number, place in enumerate(walk) if place == world.place]
        here = max(at, key=lambda number: world.unvisited(walk[(number + 1) % len(walk)]))
    passes.clear()
    passes[walk] = here
    ahead = walk[here + 1 :] + walk[: here + 1]
    return {
        place: Score(
            -float(ahead.index(place)),
            place,
            f'it is number {ahead.index(place) + 1} of the next places on the tour',
        )
        for place in allowed
    }


def _seconds_by_way_of(world: World, place: str) -> NDArray[np.float64]:
    """Return the seconds to each place when the robot first goes to ``place``, shape (n,)."""
    graph = world.graph
    seconds: NDArray[np.float64] = graph.distances[graph.index[place]]
    return seconds + graph.move(world.place, place)


def _worth(idle: NDArray[np.float64], far: NDArray[np.float64]) -> NDArray[np.float64]:
    nearness: NDArray[np.float64] = 1.0 - far / max(float(far.max()), 1e-9)
    worth: NDArray[np.float64] = idle / max(float(idle.max()), 1e-9) + nearness
    return worth


def _way_to(world: World, place: str, target: str) -> str:
    """Return where a place leads to in the end; empty when that is the place itself."""
    if place == target:
        return ''
    return f'it is on the way to {target} ({world.wait_in_words(target)})'


def _towards(world: World, place: str, target: str, seconds: float) -> str:
    """Return the target and how far away it is."""
    way = _way_to(world, place, target)
    return f'{way}, which is {seconds:.1f} s away' if way else f'it is {seconds:.1f} s away'


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
