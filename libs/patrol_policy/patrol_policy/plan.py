"""Plans a patrol ahead within the rules, and keeps the plan up to date at each choice.

A plan follows a `Course`: targets on the way in, and a round that is walked again and again. The
search has three steps.

1. `rounds` looks for a short round that the rules allow (simulated annealing); where the robot
   would have to wait on it, also for one that is filled with further visits.
2. Ways into that round are compared by simulating each from where the robot is until the patrol
   repeats itself (`rollout`), which gives the longest wait for ever. So are the walks of the
   simple policies `oldest` and `lookahead`: the plan is never worse than those.
3. Random changes of the best course are kept when they leave less waiting (hill climbing).

The first choice takes all three steps. Each later one goes on for a few milliseconds, from where
the robot is then. Work is counted in steps and not in time, so that the same world gives the same
mission on a slow machine, too.

When times of legs, the threshold or the rules change, a new plan takes over the course as it
stands, and changes it only for one that leaves less waiting from where the robot is.
"""

from __future__ import annotations

import itertools
import math
import random
import time
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

from patrol_policy.rollout import (
    HALF_OPEN,
    URGENT,
    Choice,
    Outcome,
    RuleMap,
    State,
    lookahead,
    oldest,
    roll_out,
    rule_map,
)
from patrol_policy.rounds import Round, RoundChanges, RoundSearch
from patrol_policy.world import World

FIRST_WORK, MORE_WORK, ALL_WORK = 360_000.0, 1_500.0, 20e6
"""Work before the first choice of a plan, at each later one, in all: about microseconds."""
FULL_UP_TO = 100.0
"""Larger maps, in places, have less work before the first choice: knowing them takes its time."""
MOST_SECONDS = 2.0
"""Time of the processor for one choice at most; only a machine that is very slow comes to it."""
MOST_WORK = 12_000.0
"""Work of simulations at one later choice at most; larger maps keep the first course."""
WARM_WORK = 20_000.0
"""Work before the first choice of a plan that takes the place of another."""
SLICE_WORK = 500.0
"""Work between two looks at the clock."""
LEG_CHANGE = 0.1
"""Times of legs that differ by less than this part keep the plan."""
MOVE_WORK = 3.0
"""Work of a move that is simulated."""
HORIZON = 12.0
"""How many periods a course is simulated at most."""
GOOD_ENOUGH = 1.004
"""A longest wait of so many bounds is not improved any further."""
ACCEPTED = 1.03
"""A wait from visit to visit of so many bounds is accepted for shorter first waits. The round may
be a little longer than it need be itself, and both together are to stay below 1.05."""
SKIPS = (0.0, 0.3, 0.6)
"""Targets visited more lately than this may be skipped, in lengths of the round."""
SIMPLE: tuple[Choice, ...] = (oldest, lookahead)
"""The simple policies that a plan is never worse than."""
SIMPLE_UP_TO = 200
"""The largest map, in places, on which those are simulated."""


@dataclass(frozen=True)
class Course:
    """Targets in the order in which the robot goes to them.

    Attributes:
        targets: The way in and the round.
        back: Position of the first target of the round, which comes after the last.
        skip: Targets visited more lately than this are skipped, seconds.
        patience: A target that may be entered only when it is URGENT is waited for so long, else
            skipped, seconds.
    """

    targets: tuple[int, ...]
    back: int = 0
    skip: float = 0.0
    patience: float = 0.0

    def choose(self, rules: RuleMap, state: State) -> int:
        """Choose the next place on the way to the next target; see `rollout.Choice`.

        Where the rules forbid that, the allowed place that is nearest to the target.
        """
        target = self._target(rules, state)
        allowed = rules.allowed(state)
        if not allowed:
            return state.place
        hop = rules.hop(state.place, target)
        if hop in allowed:
            return hop
        legs, away = rules.leg_seconds[state.place], rules.away
        return min(allowed, key=lambda o: (legs[o] + away[o][target], state.seen[o], o))

    def _target(self, rules: RuleMap, state: State) -> int:
        """Move on to the next target that is not to be skipped, and return it."""
        place = state.place
        for _ in self.targets:
            target = self.targets[state.position]
            idle = state.now - state.seen[target]
            if target != place and idle >= self.skip and target not in state.avoided:
                gate = rules.gates[target]
                if gate < 0 or rules.threshold - idle - rules.away[place][gate] <= self.patience:
                    return target
            state.position = self.after(state.position)
        target = self.targets[state.position]
        return target if target != place else self.targets[self.after(state.position)]

    def after(self, position: int) -> int:
        """Return the position that comes next."""
        return position + 1 if position + 1 < len(self.targets) else self.back

    def seen_from(self, position: int) -> Course:
        """Return the same course for a robot that has come to a position of it."""
        if position < self.back:
            return replace(self, targets=self.targets[position:], back=self.back - position)
        around = self.targets[position:] + self.targets[self.back : position]
        return replace(self, targets=around, back=0)


class Plan:
    """The course of one robot on one map, and the search for a better one.

    Args:
        world: Where it begins.
        before: The plan that this one takes the place of, if there is one.
    """

    _state: State

    def __init__(self, world: World, before: Plan | None = None) -> None:
        self._key = world.threshold, world.rules
        self._rules = rules = rule_map(world)
        self._draw = random.Random(0)
        self._work, self._spared, self._sent = 0.0, 0.0, -1
        self._deadline = time.thread_time() + MOST_SECONDS
        # Waits that began under the plan before count like all others: else each new plan might
        # turn on the round once, and the places behind would wait for two rounds.
        met = [before is not None] * rules.count
        self._state = State(world.graph.index[world.place], world.now, [], met)
        self._observe(world)
        work = FIRST_WORK * min(1.0, FULL_UP_TO / rules.count)
        if before and before.places == self.places:
            self._begin([before.targets], min(work, WARM_WORK), before.course)
        else:
            tour = world.graph.tour.order
            self._begin([tour, tour[::-1]], work)

    def fits(self, world: World) -> bool:
        """Return whether the plan is for this map, threshold and rules.

        Times of legs that differ a little keep the plan.
        """
        planned, graph = self._rules.graph, world.graph
        if self._key != (world.threshold, world.rules):
            return False
        return graph is planned or (
            graph.places == planned.places
            and all(
                ways.keys() == graph.leg_seconds[place].keys()
                and all(
                    abs(graph.leg_seconds[place][other] - seconds) <= LEG_CHANGE * seconds
                    for other, seconds in ways.items()
                )
                for place, ways in planned.leg_seconds.items()
            )
        )

    def for_a_question(self) -> Plan:
        """Return a copy that says where its course leads from now on, and thinks no further."""
        plan = copy(self)
        plan._state, plan._work = replace(self._state, met=self._state.met.copy()), math.inf
        return plan

    def advance(self, world: World) -> tuple[int, int]:
        """Think on, and return the place to go to and the target that it leads to, as indices."""
        self._observe(world)
        self._deadline = time.thread_time() + MOST_SECONDS
        if self._work + self._search.work < ALL_WORK:
            self._think()
        self._sent = self._course.choose(self._rules, self._state)
        return self._sent, self._course.targets[self._state.position]

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the map."""
        return self._rules.graph.places

    @property
    def targets(self) -> tuple[int, ...]:
        """The best round that was found."""
        return self._search.best.targets

    @property
    def course(self) -> Course:
        """What is left of the course from where the robot is on it."""
        return self._course.seen_from(self._state.position)

    @property
    def longest(self) -> float:
        """The longest wait from visit to visit that the course leaves, seconds."""
        return self._outcome.settled

    @property
    def _bound(self) -> float:
        """The longest wait that cannot be helped, as far as is known, seconds."""
        return max(self._search.best.length, 1e-6)

    @property
    def _accepted(self) -> float:
        """The longest wait from visit to visit that is accepted for shorter first waits."""
        return min(ACCEPTED * self._bound, self._simple)

    def _observe(self, world: World) -> None:
        """Take where the patrol stands."""
        graph, met, seen = world.graph, self._state.met, []
        for place in graph.places:
            last = world.visited_at.get(place, world.since)
            if world.now - last <= world.threshold and URGENT in world.classes.get(place, ()):
                # The ontology knows better: it was never visited.
                last = world.now - world.threshold - HALF_OPEN
            seen.append(last)
        here = graph.index[world.place]
        if here != self._state.place:
            met[here] = True
        avoided = frozenset(graph.index[name] for name in world.avoided if name in graph.index)
        self._state = State(here, world.now, seen, met, avoided, self._state.position)

    def _begin(
        self, rounds: list[tuple[int, ...]], work: float, course: Course | None = None
    ) -> None:
        """Find the first course.

        Args:
            rounds: Where the search for a round begins.
            work: For rounds and for courses together.
            course: One that is followed already; None: the best round is begun.
        """
        rules, length = self._rules, self._rules.length(rounds[0])
        self._horizon = HORIZON * max(length, rules.threshold)
        simple = SIMPLE if rules.count <= SIMPLE_UP_TO else ()
        walks = [roll_out(rules, choose, self._state, self._horizon) for choose in simple]
        self._simple = min((walk.settled for walk in walks), default=math.inf)
        filled = self._find_rounds(rounds, walks, work / 2.0)
        self._course = course or self._entered(self._phases()[0])
        self._outcome = self._followed(self._course, math.inf)
        self._climb(self._first_courses(filled), work / 2.0)
        for walk in walks:
            if (back := walk.repeated_from(rules.count)) is not None:
                self._try(Course(tuple(walk.walk), back, patience=math.inf))

    def _find_rounds(
        self, rounds: list[tuple[int, ...]], walks: list[Outcome], work: float
    ) -> tuple[int, ...]:
        """Search a short round; return one that is filled with visits where the robot would wait on
        the short one, else nothing."""
        rules = self._rules
        waits = rules.length(rounds[0]) < rules.least_period
        starts = [rounds]
        if not waits:  # Else the simple policies wait by walking more.
            starts += filter(None, ([*rules.laps(walk.walk)] for walk in walks))
        self._search = RoundSearch(rules, starts)
        filled = self._filled(starts, work / 2.0) if waits else ()
        self._search_on(self._search, work / 2.0 if filled else work)
        return filled

    def _first_courses(self, filled: tuple[int, ...]) -> Iterator[Course]:
        """Yield ways into the round that was found and the filled one, the likeliest first."""
        phases = [*self._phases(), *range(len(self._search.best.targets))]
        likeliest = [self._entered(phase) for phase in phases[:2]]
        yield from likeliest
        for phase in range(len(filled)):
            yield self._entered(phase, filled)
        for course in likeliest:
            yield replace(course, targets=course.targets[::-1])
        for skip, patience in itertools.product(SKIPS, (0.0, likeliest[0].patience, math.inf)):
            yield replace(likeliest[0], skip=skip * self._bound, patience=patience)
        for phase in phases[2:]:
            yield self._entered(phase)

    def _think(self) -> None:
        """Go on with the search from where the robot is."""
        if self._state.place == self._sent and self._finished():
            return
        self._search_on(self._search, MORE_WORK / 2.0)
        # The present course and two others are simulated, as soon as there was the work for that.
        self._spared = min(self._spared + MORE_WORK / 2.0, MOST_WORK)
        if 3.0 * MOVE_WORK * len(self._outcome.walk) > self._spared:
            return
        self._course, self._state.position = self.course, 0
        self._outcome = self._followed(self._course, math.inf)
        self._climb(map(self._entered, self._phases()), self._spared)
        self._spared = 0.0

    def _finished(self) -> bool:
        """Return whether no better course is looked for."""
        return self._search.finished and self._outcome.first <= GOOD_ENOUGH * self._bound

    def _filled(self, starts: list[list[tuple[int, ...]]], work: float) -> tuple[int, ...]:
        """Return a lawful round in which the robot need not wait; empty: none was found."""
        search = RoundSearch(self._rules, starts, fills=True)
        self._search_on(search, work)
        return () if search.best.breaches else search.best.targets

    def _search_on(self, search: RoundSearch, work: float) -> None:
        """Go on looking for a better round."""
        end = search.work + work
        while search.work < end and not search.finished and not self._late():
            search.improve(SLICE_WORK)

    def _late(self) -> bool:
        """Return whether the choice has taken all the time that there is."""
        return time.thread_time() > self._deadline

    def _climb(self, courses: Iterator[Course], work: float) -> None:
        """Try courses, and then random changes of the best one."""
        end = self._work + work
        while self._work < end and not self._finished() and not self._late():
            course = next(courses, None) or self._neighbour()
            if course is None:
                self._work += MOVE_WORK
                continue
            self._try(course)

    def _try(self, course: Course) -> None:
        """Take a course if it is better from here."""
        stop = max(1.01 * self._outcome.settled, self._accepted)
        outcome = self._followed(course, stop)
        # Of one that was stopped it is not known how long the wait would become.
        if outcome.settled <= stop and self._grade(outcome) < self._grade(self._outcome):
            self._course, self._outcome = course, outcome
            self._state.position = 0

    def _followed(self, course: Course, stop: float) -> Outcome:
        """Return what a course comes to from here."""
        outcome = roll_out(self._rules, course.choose, self._state, self._horizon, stop)
        self._work += MOVE_WORK * len(outcome.walk)
        return outcome

    def _grade(self, outcome: Outcome) -> tuple[int, int, float]:
        """Return what courses are compared by, less is better, in whole percents of the bound.

        Waits from visit to visit come again and again, so they count first, as far as they are
        longer than what is accepted. Then the first waits do, which come once.
        """
        bound = self._bound
        lasting = max(0, math.ceil(100.0 * (outcome.settled - self._accepted) / bound - 1e-6))
        return lasting, round(100.0 * outcome.first / bound), outcome.settled

    def _entered(self, phase: int, targets: tuple[int, ...] = ()) -> Course:
        """Return the course that begins a round, the best one if none is given, with one of its
        targets."""
        targets = targets or self._search.best.targets
        rules = self._rules
        wait = max(0.0, rules.least_period - rules.length(targets))
        patience = wait + 2.0 * rules.mean_leg
        return Course(targets[phase:] + targets[:phase], patience=patience)

    def _phases(self) -> list[int]:
        """Return where the best round is well begun: where it leads on, with the oldest place."""
        targets, seen = self._search.best.targets, self._state.seen
        phases = [k for k in range(len(targets)) if targets[k - 1] == self._state.place]
        return [*phases, targets.index(min(range(len(seen)), key=seen.__getitem__))]

    def _neighbour(self) -> Course | None:
        """Return the course with one to three random changes; None: it would become too long."""
        course: Course | None = self._course
        for _ in range(self._draw.choice((1, 1, 2, 3))):
            course = course and self._changed(course)
        return course

    def _changed(self, course: Course) -> Course | None:
        """Return a course with one random change; None: it would become too long."""
        draw = self._draw
        choice = draw.random()
        if choice < 0.1:
            skip = max(0.0, course.skip + draw.uniform(-0.2, 0.2) * self._bound)
            return replace(course, skip=skip)
        if choice < 0.2:
            return replace(course, patience=draw.random() ** 2 * self._bound)
        way, targets = course.targets[: course.back], course.targets[course.back :]
        limit = 1.1 * min(self._outcome.settled, 1.5 * self._bound)
        changes = RoundChanges(self._rules, Round(targets, 0.0), draw)
        changed = changes.doubled(limit) if choice < 0.4 else changes.one(limit)
        return replace(course, targets=way + changed) if changed else None


def plan_of(world: World) -> Plan:
    """Return the plan that the policy remembers, or a new one that takes over its course."""
    plan = world.memory.plan
    if not isinstance(plan, Plan) or not plan.fits(world):
        plan = world.memory.plan = Plan(world, plan)
    return plan
