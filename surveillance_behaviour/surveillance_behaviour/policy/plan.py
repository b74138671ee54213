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
from collections.abc import Generator, Iterable, Iterator, Mapping
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
ACCEPTED = 1.04
"""A wait from visit to visit of so many bounds is accepted for shorter first waits."""
SKIPS = (0.0, 0.3, 0.6)
"""Targets visited more lately than this may be skipped, in lengths of the round."""
SIMPLE_UP_TO = 200
"""The largest map, in places, on which `oldest` and `lookahead` are tried."""
SIMPLE: Mapping[str, type[Oldest | Lookahead]] = {'oldest': Oldest, 'lookahead': Lookahead}
"""The simple policies, as guides."""
UNKNOWN = Outcome(1e12, 1e12)
"""What nothing is known of."""


@dataclass(frozen=True)
class Course:
    """How the robot chooses among the places that the rules allow.

    Attributes:
        kind: ``round``, ``oldest`` or ``lookahead``.
        targets: The targets of a round.
        position: Of the target that it heads for first; negative: in the beginning, from its end.
        skip: Targets visited more lately than this are skipped, seconds.
        patience: A target that may be entered only when it is URGENT is waited for so long, else
            skipped, seconds.
        beginning: Targets before the round, for the places that wait since the patrol began.
    """

    kind: str
    targets: tuple[int, ...] = ()
    position: int = 0
    skip: float = 0.0
    patience: float = 0.0
    beginning: tuple[int, ...] = ()

    def target(self, position: int) -> int:
        """Return the target at a position."""
        return self.targets[position] if position >= 0 else self.beginning[position]

    def after(self, position: int) -> int:
        """Return the position that comes next."""
        return position + 1 if position + 1 < len(self.targets) else 0


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
        place, position = state.place, self.position
        for _ in range(len(course.beginning) + len(course.targets)):
            target = course.target(position)
            idle = state.now - state.seen[target]
            if target != place and idle >= course.skip and target not in state.avoided:
                gate = rules.gates[target]
                if gate < 0 or rules.threshold - idle - rules.away[place][gate] <= course.patience:
                    break
            position = course.after(position)
        self.position = position
        target = course.target(position)
        return target if target != place else course.target(course.after(position))


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
        self._simple = math.inf  # The longest wait from visit to visit of the simple policies.
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
        return place, self._course.target(self._guide.position)

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
        return self._search.finished and self._good_enough(self._outcome)

    def _good_enough(self, outcome: Outcome) -> bool:
        return outcome.first <= GOOD_ENOUGH * self._bound

    def _better(self, one: Outcome, other: Outcome) -> bool:
        accepted = min(ACCEPTED * self._bound, self._simple)
        return one.grade(self._bound, accepted) < other.grade(self._bound, accepted)

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
        while self._work < end and not self._good_enough(outcome):
            course = next(courses, None) or self._changed(best_round, least)
            if course is None:
                self._work += MOVE_WORK
                continue
            found = yield from self._followed(course, state, 1.01 * least.settled)
            if course.kind in SIMPLE:
                self._simple = min(self._simple, found.settled)
            elif best_round.kind != 'round' or self._better(found, least):
                best_round, least = course, found
            if self._better(found, outcome):
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
        return SIMPLE[course.kind](self._rules)

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
        heads = [self._course.target(position)] if self._course.kind == 'round' else []
        phases = self._phases(targets, state, heads)
        for phase in phases:
            yield Course('round', targets, phase, 0.0, slack)
        simple = SIMPLE if first and rules.count <= SIMPLE_UP_TO else ()
        for kind in simple:
            yield Course(kind)
        for skip in SKIPS:
            for patience in (0.0, slack, math.inf):
                yield Course('round', targets, phases[0], skip * length, patience)
        for kind in simple:
            walk, begun = self._begun(kind, state)
            for phase in (*self._phases(targets, begun), *range(len(targets))):
                turned = targets[phase:] + targets[:phase]
                yield Course('round', turned, -len(walk), 0.0, slack, walk)
        for phase in range(len(targets) if first else 0):
            yield Course('round', targets, phase, 0.0, slack)
            yield Course('round', targets[::-1], phase, 0.0, slack)

    def _phases(
        self, targets: tuple[int, ...], state: State, heads: Iterable[int] = ()
    ) -> list[int]:
        """Return where a round is well begun: where it leads on, and with the oldest place."""
        oldest = min(range(self._rules.count), key=state.seen.__getitem__)
        phases = [k for k in range(len(targets)) if targets[k - 1] == state.place]
        phases += [targets.index(head) for head in (oldest, *heads)]
        return list(dict.fromkeys(phases))

    def _begun(self, kind: str, state: State) -> tuple[tuple[int, ...], State]:
        """Return how a simple policy visits every place once, and the state that follows."""
        guide, at, walk = SIMPLE[kind](self._rules), state.copy(), list[int]()
        end = at.now + HORIZON * max(self._bound, self._rules.threshold)
        while not all(at.met) and at.now < end:
            place = guide.next(at)
            if place == at.place:
                break
            at.enter(place, self._rules.legs[at.place][place])
            at.met[place] = True
            walk.append(place)
        self._work += MOVE_WORK * len(walk)
        return tuple(walk), at

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
        if course.position < 0 and choice < 0.7:
            return self._begun_otherwise(course)
        changes = RoundChanges(rules, Round(course.targets, 0.0), draw)
        limit = 1.1 * min(outcome.settled, 1.5 * self._bound)
        targets = changes.doubled(limit) if choice < 0.4 else changes.one(limit)
        if targets is None:
            return None
        if course.position < 0:
            return replace(course, targets=targets)
        head = course.targets[course.position]
        return replace(course, targets=targets, position=targets.index(head))

    def _begun_otherwise(self, course: Course) -> Course:
        """Return the course with a target of its beginning left out, or moved."""
        draw, beginning = self._draw, list(course.beginning[course.position :])
        moved = beginning.pop(draw.randrange(len(beginning)))
        if draw.random() < 0.5:
            beginning.insert(draw.randint(0, len(beginning)), moved)
        return replace(course, beginning=tuple(beginning), position=-len(beginning))


def plan_of(world: World) -> Plan:
    """Return the plan that the policy remembers, or a new one."""
    plan = world.memory.plan
    if not isinstance(plan, Plan) or not plan.fits(world):
        same = isinstance(plan, Plan) and plan.places == world.graph.places
        plan = world.memory.plan = Plan(world, plan if same else None)
    return plan
