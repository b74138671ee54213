"""Plans a patrol ahead within the rules: looks for a round that leaves the least waiting.

A course says how the robot chooses among the places that the rules allow: it goes towards the
next target of a round (an order of all places, which skips targets that were visited lately), or
to the place that went unvisited longest, or looks ahead. A rollout follows a course over several
periods, with the rules applied at each step as they will be on the robot, and gives the longest
time from visit to visit. A period is the shortest tour, or the threshold where that is longer.

The plan begins with the best of a portfolio (the shortest tour in both senses with several ways
to skip, `oldest`, `lookahead`) and is improved by local search: part of the round is turned round
or moved, and what leaves less waiting is kept. At each choice a little more is tried from where
the robot is then, so that a change of course is never for the worse. All of it is counted in
steps, not in time, so the same world gives the same mission.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from surveillance_behaviour.policy.world import World

URGENT = 'URGENT'
"""The class whose members change by waiting; all others are taken to stay as they are."""
SKIPS = (0.0, 0.3, 0.5, 0.65, 0.8, 0.9)
"""Targets of a round visited more lately than this are skipped, in periods."""
PULLS = (0.0, 0.02)
"""How many seconds of a way a second of waiting outweighs."""
PERIODS = 7
"""How many periods a rollout follows a course."""
LARGE_PERIODS = 1.5
"""The same on maps that are not searched."""
FIRST_STEPS = 60_000
"""Steps of rollouts before the first choice (about 5 microseconds each)."""
MORE_STEPS = 1_000
"""Steps of rollouts at each later choice."""
ALL_STEPS = 2_000_000
"""Steps of rollouts for one map and threshold in all."""
SEARCHED_UP_TO = 300
"""The largest map, in places, on which rounds are improved by local search."""
GOOD_ENOUGH = 1.005
"""A longest wait of so many periods is not improved any further."""


@dataclass(frozen=True)
class Course:
    """How the robot chooses among the places that the rules allow.

    Attributes:
        kind: ``round``, ``oldest`` or ``lookahead``.
        order: The targets of a round, as indices of places.
        skip: Targets visited more lately than this are skipped, in periods.
        pull: Seconds of way that a second of waiting outweighs.
    """

    kind: str
    order: tuple[int, ...] = ()
    skip: float = 0.0
    pull: float = 0.0


@dataclass(frozen=True, order=True)
class Worth:
    """What a course is worth; less is better.

    Attributes:
        grade: The longest time from visit to visit, in whole hundredths of a period, rounded up.
        first: The longest time including that until the first visit, likewise.
        fourths: The sum of all waits to the fourth power; compares courses of the same grades.
        longest: The longest time from visit to visit, seconds.
    """

    grade: int
    first: int
    fourths: float
    longest: float


@dataclass
class State:
    """Where a rollout begins.

    Attributes:
        place: Index of the place.
        now: Seconds.
        seen: When each place was visited last, seconds.
        target: Position in the round.
        settled: Whether waits before a place's first visit count, too.
    """

    place: int
    now: float
    seen: list[float]
    target: int = 0
    settled: bool = True


class Plan:
    """The course of one robot on one map, and the search for a better one.

    Args:
        world: Where it begins.
    """

    def __init__(self, world: World) -> None:
        self._draw = random.Random(0)
        self._steps = 0
        self._met: set[int] = set()
        self.target = 0
        self._take_map(world)
        state = self._state(world)
        state.settled = False
        found = self._portfolio(state)
        self.worth, self.course = min(found, key=lambda entry: entry[0])
        rounds = [entry for entry in found if entry[1].kind == 'round']
        self._round_worth, self._round = min(rounds, key=lambda entry: entry[0])
        self._search(state, FIRST_STEPS)

    def _take_map(self, world: World) -> None:
        graph = world.graph
        self._graph, self._threshold = graph, world.threshold
        self.period = max(graph.tour.length, world.threshold, 1e-6)
        index = graph.index
        self._neighbours = [
            [(index[other], seconds + graph.dwell) for other, seconds in sorted(ways.items())]
            for ways in (graph.legs[place] for place in graph.places)
        ]
        # Seconds from every place to a target: the target's column.
        self._to: list[list[float]] = graph.distances.T.tolist()
        self._rules = rules = world.rules
        self._urgent = rules.index(URGENT) if URGENT in rules else len(rules)
        self._ranks = _ranks(world)

    def fits(self, world: World) -> bool:
        """Return whether the plan is for this map, threshold and rules.

        Other times of the legs, or another threshold, keep the course and go on from there.
        """
        if world.graph is self._graph and world.threshold == self._threshold:
            return world.rules == self._rules
        if world.graph.places != self._graph.places or world.rules != self._rules:
            return False
        self._take_map(world)
        self._steps = min(self._steps, ALL_STEPS // 2)
        return True

    def advance(self, world: World) -> int | None:
        """Return the index of the place that the course heads for; None: it has no target.

        Before, a little more is tried than was.
        """
        state = self._state(world)
        self._met.add(state.place)
        if self._steps < ALL_STEPS and len(self._graph.places) <= SEARCHED_UP_TO:
            state.settled = len(self._met) == len(self._graph.places)
            self.worth = self._rollout(self.course, state)
            same = self.course is self._round
            self._round_worth = self.worth if same else self._rollout(self._round, state)
            self._search(state, MORE_STEPS)
        if self.course.kind != 'round':
            return None
        order = self.course.order
        position = self._next(order, self.target, state, self.course.skip * self.period)
        avoided = {self._graph.index.get(place) for place in world.avoided}
        for _ in order:
            if order[position] not in avoided:
                break
            position = (position + 1) % len(order)
        self.target = position
        return order[position]

    def cost(self, world: World, place: str, target: int) -> float:
        """Return what going to ``place`` on the way to a target costs, seconds."""
        index = self._graph.index[place]
        away = self._to[target][index] + self._graph.seconds(world.place, place)
        return away - self.course.pull * world.unvisited(place)

    def _state(self, world: World) -> State:
        graph = self._graph
        seen = [world.visited_at.get(place, world.since) for place in graph.places]
        return State(graph.index[world.place], world.now, seen, self.target)

    @staticmethod
    def _next(order: Sequence[int], position: int, state: State, skip: float) -> int:
        """The position of the next target that is not visited lately."""
        for _ in order:
            target = order[position]
            if target != state.place and state.now - state.seen[target] >= skip:
                break
            position = (position + 1) % len(order)
        return position

    # The search.

    def _portfolio(self, state: State) -> list[tuple[Worth, Course]]:
        """The courses that are known to be good somewhere, with their worth."""
        large = len(self._graph.places) > SEARCHED_UP_TO
        tour = self._graph.tour.order
        begin = tour.index(state.place)
        way = tour[begin + 1 :] + tour[: begin + 1]
        rounds = (way, (*way[-2::-1], way[-1]))
        courses = [
            Course('round', order, skip, pull)
            for order in rounds
            for skip in (SKIPS[1:4:2] if large else SKIPS)
            for pull in (PULLS[:1] if large else PULLS)
        ]
        courses += [Course('oldest'), Course('lookahead')]
        return [(self._rollout(course, state), course) for course in courses]

    def _search(self, state: State, steps: int) -> None:
        """Try changes of the best round for so many steps; take it once it is the best course."""
        count = len(self._graph.places)
        end = min(self._steps + steps, ALL_STEPS)
        if not 3 <= count <= SEARCHED_UP_TO:
            return
        enough = GOOD_ENOUGH * self.period
        while self._steps < end and self.worth.longest > enough:
            course = self._changed(self._round)
            begin = replace(state, target=course.order.index(self._round.order[self.target]))
            stop = self._round_worth.longest + self.period / 100.0
            worth = self._rollout(course, begin, stop)
            self._steps += 1
            if worth <= self._round_worth:
                self._round_worth, self._round = worth, course
                self.target = state.target = begin.target
                if self.course.kind == 'round' or worth < self.worth:
                    self.worth, self.course = worth, course

    def _changed(self, course: Course) -> Course:
        """The course with one random change."""
        draw, order = self._draw, list(course.order)
        count, choice = len(order), draw.random()
        first = draw.randrange(count)
        last = min(count, first + 1 + int(draw.expovariate(1.0 / max(2.0, count / 8.0))))
        if choice < 0.3:
            order[first:last] = order[first:last][::-1]
        elif choice < 0.75:
            last = last if choice < 0.45 else min(count, first + 1 + draw.randrange(3))
            moved = order[first:last]
            del order[first:last]
            where = draw.randrange(len(order) + 1)
            order[where:where] = moved if draw.random() < 0.5 else moved[::-1]
        elif choice < 0.9:
            skip = min(0.97, max(0.0, course.skip + draw.uniform(-0.15, 0.15)))
            return replace(course, skip=skip)
        else:
            other = draw.randrange(count)
            order[first], order[other] = order[other], order[first]
        return replace(course, order=tuple(order))

    # Rollouts.

    def _rollout(self, course: Course, state: State, stop: float = math.inf) -> Worth:
        """Follow a course; give up once a wait is longer than ``stop``."""
        periods = PERIODS if len(self._graph.places) <= SEARCHED_UP_TO else LARGE_PERIODS
        horizon = periods * self.period
        if course.kind != 'round':
            return self._follow(course, state, horizon)
        neighbours, ranks, urgent = self._neighbours, self._ranks, self._urgent
        threshold, order, count = self._threshold, course.order, len(course.order)
        skip, pull, position = course.skip * self.period, course.pull, state.target
        seen, place, now = state.seen.copy(), state.place, state.now
        met = [state.settled] * count
        longest = first = fourths = 0.0
        end, steps = now + horizon, 0
        while now < end:
            for _ in range(count):
                target = order[position]
                if target != place and now - seen[target] >= skip:
                    break
                position = position + 1 if position + 1 < count else 0
            away = self._to[order[position]]
            least, best, taken, cost, oldest = len(ranks) + 9, place, horizon, math.inf, math.inf
            for other, seconds in neighbours[place]:
                last = seen[other]
                rank = ranks[other]
                if urgent < rank and now - last > threshold:
                    rank = urgent
                if rank > least:
                    continue
                value = seconds + away[other] - pull * (now - last)
                if rank < least or value < cost - 1e-9 or (value < cost + 1e-9 and last < oldest):
                    least, best, taken, cost, oldest = rank, other, seconds, value, last
            now += taken
            steps += 1
            wait = now - seen[best]
            if met[best]:
                if wait > longest:
                    longest = wait
                    if wait > stop:
                        break
                fourths += wait**4
            elif wait > first:
                first = wait
            met[best] = True
            seen[best] = now
            place = best
        self._steps += steps
        return self._worth(max(longest, now - min(seen)), first, fourths)

    def _worth(self, longest: float, first: float, fourths: float) -> Worth:
        grain = self.period / 100.0
        grade, whole = (math.ceil(wait / grain - 1e-6) for wait in (longest, max(longest, first)))
        return Worth(grade, whole, fourths, longest)

    def _follow(self, course: Course, state: State, horizon: float) -> Worth:
        """Follow `oldest` or `lookahead`."""
        distances = self._graph.distances
        seen, place, now = np.array(state.seen), state.place, state.now
        met = np.full(len(seen), state.settled)
        longest = first = fourths = 0.0
        end = now + horizon
        while now < end:
            ranks = [
                min(self._ranks[other], self._urgent)
                if now - seen[other] > self._threshold
                else self._ranks[other]
                for other, _ in self._neighbours[place]
            ]
            if not ranks:
                break
            least = min(ranks)
            allowed = [
                way
                for way, rank in zip(self._neighbours[place], ranks, strict=True)
                if rank == least
            ]
            best, taken = allowed[0]
            if len(allowed) > 1 and course.kind == 'oldest':
                best, taken = min(allowed, key=lambda way: (seen[way[0]], way[0]))
            elif len(allowed) > 1:
                idle = now - seen
                idle[place] = -np.inf
                best, taken = max(
                    allowed,
                    key=lambda way: (
                        round(float((idle - distances[way[0]]).max()) - way[1], 6),
                        -seen[way[0]],
                        -way[0],
                    ),
                )
            now += taken
            self._steps += 1
            wait = now - float(seen[best])
            if met[best]:
                longest = max(longest, wait)
                fourths += wait**4
            else:
                first = max(first, wait)
            met[best] = True
            seen[best] = now
            place = best
        return self._worth(max(longest, now - float(seen.min())), first, fourths)


def _ranks(world: World) -> list[int]:
    """The position of each place's best class in the rules, URGENT left aside."""
    ranks = []
    for place in world.graph.places:
        classes = world.classes.get(place, frozenset()) - {URGENT}
        positions = [rank for rank, name in enumerate(world.rules) if name in classes]
        ranks.append(min(positions, default=len(world.rules)))
    return ranks


def plan_of(world: World) -> Plan:
    """Return the plan that the policy remembers, or a new one."""
    plan = world.memory.plan
    if not isinstance(plan, Plan) or not plan.fits(world):
        plan = world.memory.plan = Plan(world)
    return plan
