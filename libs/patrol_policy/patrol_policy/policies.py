"""Policies: how good is each of the places that the rules allow?

A policy is a function from a :class:`Situation`, the allowed places and what the charge comes to,
to a :class:`Score` for each place; one that plans ahead may choose to charge instead. It can be
changed at run time: what it needs to remember (the target it was heading for, a plan, where it
draws its chance from) stands in the situation.

========= ========================================================================================
seed      any allowed place, at random
oldest    the allowed place that went unvisited longest
lookahead the way to wherever on the whole map (time unvisited - time to get there) is highest
tour      the place next on a cycle that was planned within the rules to leave the least waiting
========= ========================================================================================

The literature's policies (CR, HCR, HPCC, cycle), which know no rules, are in the benchmark.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from patrol_policy.battery import Energy
from patrol_policy.plan import planner_of
from patrol_policy.situation import Score, Situation
from strict_files.suggestions import nearest

Scores = Mapping[str, Score]
DEFAULT_POLICY = 'tour'


@dataclass(frozen=True)
class Charge:
    """The choice to charge before any place is visited.

    Attributes:
        place: Of the station.
        words: Why, as a clause.
    """

    place: str
    words: str


class Policy(Protocol):
    """Scores the allowed places, or chooses to charge."""

    def __call__(
        self, world: Situation, allowed: Sequence[str], energy: Energy | None = None
    ) -> Scores | Charge:
        """Return a score for each of ``allowed``, which is not empty."""


def make_policy(name: str) -> Policy:
    """Return the policy of that name, one of :data:`POLICIES`.

    Raises:
        ValueError: There is no such policy.
    """
    if name not in POLICIES:
        raise ValueError(f'unknown policy {name!r}, expected {nearest(name, POLICIES)}')
    return POLICIES[name]


def by_chance(world: Situation, allowed: Sequence[str], energy: Energy | None = None) -> Scores:
    """Return a random score for each place."""
    # As the assignment's own solution: what any policy is to be better than.
    generator = world.memory.generator
    return {place: Score(generator.random(), place, 'drawn at random') for place in allowed}


def oldest(world: Situation, allowed: Sequence[str], energy: Energy | None = None) -> Scores:
    """Return the time each place went unvisited."""
    scores = {}
    for place in allowed:
        scores[place] = Score(world.idleness_of(place), place, 'the longest wait decides')
    return scores


def lookahead(world: Situation, allowed: Sequence[str], energy: Energy | None = None) -> Scores:
    """Return the best of (time unvisited - time to get there), by way of each candidate."""
    # Greedy over the whole map, not over the candidates alone: a place far off that has waited long
    # outweighs a near one, less the time that the way to it costs. The cognitive agents of Machado
    # et al. ("Multi-agent patrolling", 2002) choose by idleness alone and drive there, too; here
    # only the next place is entered, and the choice is made anew from there.
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


def tour(world: Situation, allowed: Sequence[str], energy: Energy | None = None) -> Scores | Charge:
    """Return the next place of the plan, then how near each place is to its target; see `plan`."""
    # The plan already says where to; the other places have scores so that a person can compare:
    # how much further than the chosen one each is from the target.
    planner, graph = planner_of(world, energy), world.graph
    stop, target_stop = planner.advance(world)
    longest = f'the longest wait on this round is {planner.longest:.1f} s'
    words = f'{longest} ({planner.cut})' if planner.cut else longest
    if stop >= len(graph.places):
        place = graph.places[planner.rule_graph.places[stop]]
        return Charge(
            place, f'a charge in {place} costs least now, at {world.level:.1f} %; {words}'
        )
    next_place, target = graph.places[stop], graph.places[planner.rule_graph.places[target_stop]]
    return {
        place: Score(
            0.0
            if place == next_place
            else -1.0 - planner.rule_graph.away[graph.index[place]][target_stop],
            target,
            f'{_way_to(world, place, target) or "it is next on the round"}; {words}',
        )
        for place in allowed
    }


def _seconds_by_way_of(world: Situation, place: str) -> NDArray[np.float64]:
    """Return the seconds to each place when the robot first goes to ``place``, shape (n,)."""
    graph = world.graph
    seconds = graph.row(graph.index[place])
    return seconds + graph.move(world.place, place)


def _way_to(world: Situation, place: str, target: str) -> str:
    """Return where a place leads to in the end; empty when that is the place itself."""
    if place == target:
        return ''
    return f'it is on the way to {target} ({world.idleness_in_words(target)})'


def _towards(world: Situation, place: str, target: str, seconds: float) -> str:
    """Return the target and how far away it is."""
    way = _way_to(world, place, target)
    return f'{way}, which is {seconds:.1f} s away' if way else f'it is {seconds:.1f} s away'


POLICIES: dict[str, Policy] = {
    'tour': tour,
    'lookahead': lookahead,
    'oldest': oldest,
    'seed': by_chance,
}
"""The policies by name."""
