"""Plans a patrol ahead within the rules, and keeps the plan up to date at each choice.

A plan follows a course: a round that the rules let a robot walk again and again (see `rounds`), or
one of the simple policies `oldest` and `lookahead` where those do better from where the robot is.
Every course is judged by following it ahead from a state of the patrol (see `rollout`) until it
comes back to itself, so its longest wait is known for ever. A course is given up only for one that
leaves less waiting from there.

What is thought at one choice is bounded, in work that is counted: the same world gives the same
mission. On a machine that is too slow for that, the time is bounded, too. What does not fit into
one choice goes on at the next: a trial compares courses from where the robot will be some moves
later, and the course is changed when it comes there.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Generator, Iterator
from copy import copy
from dataclasses import dataclass, replace

from surveillance_behaviour.policy.rollout import (
    HALF_OPEN,
    URGENT,
    Guide,
    Lookahead,
    Oldest,
    Outcome,
    RuleMap,
    State,
    roll_out,
    rule_map,
)
from surveillance_behaviour.policy.rounds import Round, RoundChanges, RoundSearch
from surveillance_behaviour.policy.world import World

FIRST_WORK, MORE_WORK, ALL_WORK = 360_000.0, 1_500.0, 20e6
"""Work before the first choice of a plan, at each later one, in all: about microseconds."""
FULL_UP_TO = 150.0
"""Larger maps, in places, have less work before the first choice: knowing them takes its time."""
FIRST_SECONDS, MORE_SECONDS = 0.4, 0.004
"""Time of the processor for the first two at most."""
WARM_WORK = 50_000.0
"""Work before the first choice of a plan that takes the place of another."""
SLICE_WORK = 500.0
"""Work between two looks at the clock."""
LEG_CHANGE = 0.1
"""Times of legs that differ by less than this part keep the plan."""
MOVE_WORK = 3.0
"""Work of a move that is followed ahead."""
HORIZON = 12.0
"""How many periods a course is followed ahead at most."""
TRIED = 8
"""How many courses a trial between two choices has the time for."""
GOOD_ENOUGH = 1.004
"""A longest wait of so many bounds is not improved any further."""
SKIPS = (0.0, 0.3, 0.6)
"""Targets visited more lately than this may be skipped, in lengths of the round."""
SIMPLE_UP_TO = 200
"""The largest map, in places, on which `oldest` and `lookahead` are tried."""


UNKNOWN = Outcome(1e12, 1e12)
"""What nothing is known of."""


@dataclass(frozen=True)
class Course:
    """How the robot chooses among the places that the rules allow.

    Attributes:
        kind: ``round``, ``oldest`` or ``lookahead``.
        targets: The targets of a round.
        position: Of the target that it heads for first.
        skip: Targets visited more lately than this are skipped, seconds.
        patience: A target that may be entered only when it is URGENT is waited for so long, else
            skipped, seconds.
    """

    kind: str
    targets: tuple[int, ...] = ()
    position: int = 0
    skip: float = 0.0
    patience: float = 0.0


class RoundGuide:
    """Goes towards the targets of a round, one after the other.

    Attributes:
        position: Of the present target.
    """

    def __init__(self, rules: RuleMap, course: Course) -> None:
        self._rules, self._course = rules, course
        self.position = course.position

    def next(self, state: State) -> int:
        """Return the neighbour; see `rollout.Guide`."""
        rules = self._rules
        target = self._target(state)
        allowed = rules.allowed(state)
        if not allowed:
            return state.place
        hop = rules.hop(state.place, target)
        if hop in allowed:
            return hop
        legs, away = rules.legs[state.place], rules.away
        return min(allowed, key=lambda o: (legs[o] + away[o][target], state.seen[o], o))

    def _target(self, state: State) -> int:
        """Move on to the next target that is not to be skipped, and return it."""
        rules, course = self._rules, self._course
        targets, place = course.targets, state.place
        count, position = len(targets), self.position
        for _ in range(count):
            target = targets[position]
            idle = state.now - state.seen[target]
            if target != place and idle >= course.skip and target not in state.avoided:
                gate = rules.gates[target]
                if gate < 0 or rules.threshold - idle - rules.away[place][gate] <= course.patience:
                    break
            position = position + 1 if position + 1 < count else 0
        self.position = position
        target = targets[position]
        return target if target != place else targets[(position + 1) % count]


@dataclass(frozen=True)
class Switch:
    """A better course, and where it is to be taken.

    Attributes:
        moves: How many moves the robot has made then.
        place: Where it is then.
        course: The course.
        outcome: What it comes to from there.
    """

    moves: int
    place: int
    course: Course
    outcome: Outcome


class Plan:
    """The course of one robot on one map, and the search for a better one.

    Args:
        world: Where it begins.
        before: A plan for the same places that this one takes the place of.
    """

    _met: list[bool]
    _thinks = True

    def __init__(self, world: World, before: Plan | None = None) -> None:
        self._key = world.threshold, world.rules
        self._rules = rules = rule_map(world)
        self._met = before._met if before else [False] * rules.count
        self._moves, self._work = 0, 0.0
        self._draw = random.Random(0)
        self._trial: Generator[None] | None = None
        self._switch: Switch | None = None
        self._course = Course('none')
        self._guide: Guide = Oldest(rules)
        self._outcome = UNKNOWN
        self._state = self._state_of(world)
        order = before.targets if before else world.graph.tour.order
        self._search = RoundSearch(rules, order)
        self._offered: tuple[int, ...] = ()
        work = FIRST_WORK * min(1.0, FULL_UP_TO / rules.count)
        self._think(min(work, WARM_WORK) if before else work, FIRST_SECONDS, lead=0)

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
                ways.keys() == graph.legs[place].keys()
                and all(
                    abs(graph.legs[place][other] - seconds) <= LEG_CHANGE * seconds
                    for other, seconds in ways.items()
                )
                for place, ways in planned.legs.items()
            )
        )

    def for_a_question(self) -> Plan:
        """Return a copy that says where its course leads from now on, and thinks no further."""
        plan = copy(self)
        plan._guide, plan._met, plan._thinks = copy(self._guide), self._met.copy(), False
        return plan

    def advance(self, world: World) -> tuple[int, int] | None:
        """Think on, and return the place to go to and the target that it leads to, as indices.

        None: the simple policy `kind` is to be followed.
        """
        place = self._state.place
        self._state = self._state_of(world)
        if self._state.place != place:
            self._moves += 1
            self._met[self._state.place] = self._state.met[self._state.place] = True
        self._take_switch()
        if self._thinks and not self._finished():
            self._think(MORE_WORK, MORE_SECONDS, lead=self._lead())
        if not isinstance(self._guide, RoundGuide):
            return None
        place = self._guide.next(self._state)
        return place, self._course.targets[self._guide.position]

    @property
    def kind(self) -> str:
        """How the robot chooses: ``round``, ``oldest`` or ``lookahead``."""
        return self._course.kind

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the map."""
        return self._rules.graph.places

    @property
    def targets(self) -> tuple[int, ...]:
        """The best round that was found."""
        return self._course.targets or self._search.best.targets

    @property
    def longest(self) -> float:
        """The longest wait from visit to visit that the course leaves, seconds."""
        return self._outcome.settled

    @property
    def _bound(self) -> float:
        """The longest wait that cannot be helped, as far as is known, seconds."""
        return max(self._search.best.length, self._rules.least_period, 1e-6)

    def _state_of(self, world: World) -> State:
        graph, seen = world.graph, []
        for place in graph.places:
            last = world.visited_at.get(place, world.since)
            if world.now - last <= world.threshold and URGENT in world.classes.get(place, ()):
                # The ontology knows better: it was never visited.
                last = world.now - world.threshold - HALF_OPEN
            seen.append(last)
        avoided = frozenset(graph.index[name] for name in world.avoided if name in graph.index)
        return State(graph.index[world.place], world.now, seen, self._met.copy(), avoided)

    # Thinking.

    def _finished(self) -> bool:
        if self._work + self._search.work >= ALL_WORK:
            return True
        return self._search.finished and self._outcome.settled <= GOOD_ENOUGH * self._bound

    def _lead(self) -> int:
        """Return how many choices a trial takes."""
        trial = TRIED * MOVE_WORK * self._outcome.steps
        return 2 + math.ceil(2.0 * trial / MORE_WORK)

    def _think(self, work: float, seconds: float, lead: int) -> None:
        """Search rounds, and try courses from where the robot will be ``lead`` moves on."""
        deadline = time.thread_time() + seconds
        end = self._search.work + work / 2.0
        while self._search.work < end and not self._search.finished:
            self._search.improve(SLICE_WORK)
            if time.thread_time() > deadline - seconds / 2.0:
                break
        end = self._work + work / 2.0
        while self._work < end and time.thread_time() < deadline:
            if self._trial is None:
                if self._switch is not None:
                    break
                self._trial = self._tried(lead, max(lead, 1) * work / 2.0)
            if next(self._trial, self) is self:
                self._trial = None
                if lead == 0:
                    break
        if lead == 0:
            self._trial = None
        self._take_switch()

    def _take_switch(self) -> None:
        """Change the course where that was planned."""
        switch = self._switch
        if switch is None or self._moves < switch.moves:
            return
        self._switch = None
        if (self._moves, self._state.place) == (switch.moves, switch.place):
            self._course, self._outcome = switch.course, switch.outcome
            self._guide = self._guide_of(switch.course)

    def _tried(self, lead: int, work: float) -> Generator[None]:
        """Compare other courses with the present one from ``lead`` moves on."""
        rules, state, guide = self._rules, self._state.copy(), copy(self._guide)
        for _ in range(lead):
            place = guide.next(state)
            state.enter(place, rules.legs[state.place].get(place, 0.0))
            state.met[place] = True
        moves, end = self._moves + lead, self._work + work
        best = present = replace(self._course, position=guide.position)
        outcome = UNKNOWN
        if self._course.kind != 'none':
            outcome = self._outcome = yield from self._followed(present, state, math.inf)
        courses = self._portfolio(state, guide.position)
        best_round, least = present, outcome
        while self._work < end and outcome.settled > GOOD_ENOUGH * self._bound:
            course = next(courses, None) or self._changed(best_round, least)
            if course is None:
                self._work += MOVE_WORK
                continue
            found = yield from self._followed(course, state, 1.01 * least.settled)
            grade = found.grade(self._bound)
            if course.kind == 'round' and (
                best_round.kind != 'round' or grade < least.grade(self._bound)
            ):
                best_round, least = course, found
            if grade < outcome.grade(self._bound):
                best, outcome = course, found
                self._switch = Switch(moves, state.place, best, outcome)
        if best.kind == 'round' and self._search.best.targets == self._offered != best.targets:
            # That round cannot be come to from this one: look for one that is more like it.
            self._search = RoundSearch(rules, best.targets, self._search.work)

    def _followed(
        self, course: Course, state: State, stop: float
    ) -> Generator[None, None, Outcome]:
        """Follow a course ahead; what it comes to."""
        horizon = HORIZON * max(self._bound, self._rules.threshold)
        moves = roll_out(self._rules, self._guide_of(course), state, horizon, stop)
        while True:
            try:
                self._work += MOVE_WORK * next(moves)
            except StopIteration as end:
                outcome: Outcome = end.value
                return outcome
            yield

    def _guide_of(self, course: Course) -> Guide:
        if course.kind == 'round':
            return RoundGuide(self._rules, course)
        return (Oldest if course.kind == 'oldest' else Lookahead)(self._rules)

    def _portfolio(self, state: State, position: int) -> Iterator[Course]:
        """Yield the best round that was found since the last trial, in several ways, and the
        policies.
        """
        targets = self._search.best.targets
        if targets == self._offered and self._course.kind == 'round':
            return
        first, self._offered = not self._offered, targets
        rules = self._rules
        length = rules.length(targets)
        wait = max(0.0, rules.least_period - length)
        slack = wait + 2.0 * rules.mean_leg
        oldest = min(range(rules.count), key=state.seen.__getitem__)
        heads = [oldest]
        if self._course.kind == 'round':
            heads.append(self._course.targets[position])
        phases = [k for k, target in enumerate(targets) if targets[k - 1] == state.place]
        phases += [targets.index(head) for head in heads]
        for phase in dict.fromkeys(phases):
            yield Course('round', targets, phase, 0.0, slack)
        if first and rules.count <= SIMPLE_UP_TO:
            yield Course('oldest')
            yield Course('lookahead')
        for skip in SKIPS:
            for patience in (0.0, slack, math.inf):
                yield Course('round', targets, phases[0], skip * length, patience)

    def _changed(self, course: Course, outcome: Outcome) -> Course | None:
        """Return the course of a round with one random change."""
        if course.kind != 'round':
            return None
        draw, rules = self._draw, self._rules
        choice = draw.random()
        if choice < 0.1:
            skip = max(0.0, course.skip + draw.uniform(-0.2, 0.2) * self._bound)
            return replace(course, skip=skip)
        if choice < 0.2:
            return replace(course, patience=draw.random() ** 2 * self._bound)
        changes = RoundChanges(rules, Round(course.targets, 0.0), draw)
        limit = 1.1 * min(outcome.settled, 1.5 * self._bound)
        targets = changes.doubled(limit) if choice < 0.4 else changes.one(limit)
        if targets is None:
            return None
        head = course.targets[course.position]
        return replace(course, targets=targets, position=targets.index(head))


def plan_of(world: World) -> Plan:
    """Return the plan that the policy remembers, or a new one."""
    plan = world.memory.plan
    if not isinstance(plan, Plan) or not plan.fits(world):
        same = isinstance(plan, Plan) and plan.places == world.graph.places
        plan = world.memory.plan = Plan(world, plan if same else None)
    return plan
