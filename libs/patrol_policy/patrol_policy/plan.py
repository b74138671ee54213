"""Plans a patrol ahead within the rules and the charge, and follows the plan at each choice.

A plan follows a `Course`: targets on the way in, and a round that is walked again and again.
Charges are targets like places, put where they cost least. There is one search: `rounds` looks for
a round with short waits that the rules and the charge allow (simulated annealing). Where the robot
would have to wait on it for places to be URGENT, also for one that is filled with further visits.
Ways into the rounds that were found are then compared by simulating each from where the robot is
until the patrol repeats itself (`rollout`), which gives the longest wait for ever. So are the walks
of the simple policies `oldest` and `lookahead`: the plan is never worse than those.

All that is done at the first choice. Work is counted in steps and not in time, so that the same
world gives the same mission on a slow machine, too; only `MOST_SECONDS` of the processor's time end
it early, and the plan then says so.

When times of legs, thresholds, rules or the charge change, a new plan takes over the course as it
stands, and changes it only for one that leaves less waiting from where the robot is.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

from patrol_policy.battery import WORTH_CHARGING, Energy
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
from patrol_policy.rounds import RoundSearch, with_charges
from patrol_policy.world import World

FIRST_WORK = 360_000.0
"""Work before the first choice of a plan: about microseconds."""
FULL_UP_TO = 100.0
"""Larger maps, in places, have less work before the first choice: knowing them takes its time."""
MOST_SECONDS = 1.5
"""Time of the processor for one choice; what is looked for then is ended, and the plan says so."""
WARM_WORK = 60_000.0
"""Work before the first choice of a plan that takes the place of another."""
SLICE_WORK = 500.0
"""Work between two looks at the clock."""
LEG_CHANGE = 0.1
"""Times of legs that differ by less than this part keep the plan."""
MOVE_WORK = 3.0
"""Work of a move that is simulated."""
HORIZON = 12.0
"""How many periods a course is simulated at most."""
FILLED_UP_TO = 6.0
"""Rounds are filled with visits while places wait at most so many shortest rounds."""
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
        if target >= rules.count or target == state.place:
            return target
        if not rules.affords(state, target):
            # Before it sets out, and not half-way.
            charge = rules.charge_from(state.place)
            if charge >= 0 and not _is_full(rules, state, charge):
                return charge
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
            if target >= rules.count:
                if not _is_full(rules, state, target) and rules.places[target] not in state.avoided:
                    return target
            elif target != place and target not in state.avoided:
                idle = state.now - state.seen[target]
                gate = rules.gates[target] if idle >= self.skip else -2
                if gate == -1:
                    return target
                if gate >= 0:
                    wait = rules.thresholds[target] - idle - rules.away[place][gate]
                    if wait <= self.patience:
                        return target
            state.position = self.after(state.position)
        # None is due: on to the next place, whatever it is.
        for _ in self.targets:
            target = self.targets[state.position]
            if target < rules.count and target != place:
                return target
            state.position = self.after(state.position)
        return place

    def after(self, position: int) -> int:
        """Return the position that comes next."""
        return position + 1 if position + 1 < len(self.targets) else self.back

    def seen_from(self, position: int) -> Course:
        """Return the same course for a robot that has come to a position of it."""
        if position < self.back:
            return replace(self, targets=self.targets[position:], back=self.back - position)
        around = self.targets[position:] + self.targets[self.back : position]
        return replace(self, targets=around, back=0)


def _is_full(rules: RuleMap, state: State, charge: int) -> bool:
    """Return whether a charge would give too little to be worth its while."""
    energy = rules.energy
    assert energy is not None
    away = energy.drive[charge - rules.count][state.place]
    return state.level - energy.draw * away > energy.full - WORTH_CHARGING


class Plan:
    """The course of one robot on one map.

    Args:
        world: Where it begins.
        energy: What the charge comes to; None: the battery does not matter.
        before: The plan that this one takes the place of, if there is one.

    Attributes:
        rules: The map with its rules.
        cut: What the deadline has cut off, in words; empty: nothing.
    """

    _state: State
    _began: State

    def __init__(
        self, world: World, energy: Energy | None = None, before: Plan | None = None
    ) -> None:
        self._deadline = time.thread_time() + MOST_SECONDS
        self._key = world.threshold, world.own_thresholds, world.rules
        self.rules = rules = rule_map(world, energy)
        self._work = 0.0
        self.cut = ''
        # Waits that began under the plan before count like all others: else each new plan might
        # turn on the round once, and the places behind would wait for two rounds.
        met = [before is not None] * rules.count
        self._state = State(world.graph.index[world.place], world.now, [], met)
        self._observe(world, 100.0 if energy is None else world.level)
        work = FIRST_WORK * min(1.0, FULL_UP_TO / rules.count)
        if before and before.places == self.places and before.stations == self.stations:
            self._begin([before.targets], min(work, WARM_WORK), before.course)
        else:
            tour = world.graph.tour.order
            self._begin([tour, tour[::-1]], work)

    def fits(self, world: World, energy: Energy | None) -> bool:
        """Return whether the plan is for this map, these thresholds, rules and stations.

        Times and rates that differ a little keep the plan.
        """
        planned, graph = self.rules.graph, world.graph
        if self._key != (world.threshold, world.own_thresholds, world.rules):
            return False
        mine = self.rules.energy
        if energy is not mine and (energy is None or not energy.alike(mine)):
            return False
        if graph is planned:
            return True
        if graph.places != planned.places:
            return False
        return all(
            now.keys() == then.keys()
            and all(
                abs(now[other] - seconds) <= LEG_CHANGE * seconds for other, seconds in then.items()
            )
            for now, then in zip(graph.ways, planned.ways, strict=True)
        )

    def for_a_question(self) -> Plan:
        """Return a copy that says where its course leads from now on, and changes nothing."""
        plan = copy(self)
        plan._state = replace(self._state, met=self._state.met.copy())
        return plan

    def advance(self, world: World) -> tuple[int, int]:
        """Return the stop to go to and the target that it leads to, as indices."""
        self._observe(world, world.level)
        choice = self._course.choose(self.rules, self._state)
        target = self._course.targets[self._state.position]
        stop = self.rules.guarded(self._state, choice)
        return stop, target if stop < self.rules.count else stop

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the map."""
        return self.rules.graph.places

    @property
    def stations(self) -> list[int]:
        """The places of the stations, by index."""
        return self.rules.energy.stations if self.rules.energy else []

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
        """The longest wait from visit to visit that the course leaves, seconds.

        Where places have time of their own, the first waits count, too.
        """
        if self.rules.is_even:
            return self._outcome.settled
        return max((self._outcome.waits[place] for place in self.rules.wanted), default=0.0)

    @property
    def repeats(self) -> bool:
        """Whether it is proven what the course comes to: it leads back to where it was."""
        return self._outcome.back is not None

    def settled_waits(self) -> list[float]:
        """Return for each place the wait from visit to visit that the course leaves, seconds.

        inf: the place is not visited.
        """
        rules, outcome, state = self.rules, self._outcome, self._began.fresh()
        begin = outcome.repeated_from(rules)
        waits = [math.inf] * rules.count
        if begin is None:
            for place in {rules.places[stop] for stop in outcome.walk}:
                waits[place] = outcome.waits[place]
            return waits
        for stop in outcome.walk[:begin]:
            rules.go(state, stop)
        seen: dict[int, float] = {}
        for stop in (*outcome.walk[begin:], *outcome.walk[begin:]):
            # From the end to the beginning there need be no door.
            for step in rules.path(state.place, stop):
                rules.go(state, step)
            place = rules.places[stop]
            if place in seen:
                known = 0.0 if math.isinf(waits[place]) else waits[place]
                waits[place] = max(known, state.now - seen[place])
            seen[place] = state.now
        return waits

    @property
    def _bound(self) -> float:
        """The longest wait that cannot be helped, as far as is known, seconds."""
        return max(self._search.best.wait, 1e-6)

    @property
    def _accepted(self) -> float:
        """The longest wait from visit to visit that is accepted for shorter first waits."""
        return min(ACCEPTED * self._bound, self._simple)

    def _observe(self, world: World, level: float) -> None:
        """Take where the patrol stands."""
        graph, met, seen = world.graph, self._state.met, []
        thresholds = self.rules.thresholds
        for place, threshold in zip(graph.places, thresholds, strict=True):
            last = world.visited_at.get(place, world.since)
            if world.now - last <= threshold and URGENT in world.classes.get(place, ()):
                # The ontology knows better: it was never visited, or something was noticed there.
                limit = threshold if math.isfinite(threshold) else world.threshold
                last = world.now - limit - HALF_OPEN
            seen.append(last)
        here = graph.index[world.place]
        if here != self._state.place:
            met[here] = True
        avoided = frozenset(graph.index[name] for name in world.avoided if name in graph.index)
        position = self._state.position
        self._state = State(here, world.now, seen, met, avoided, position, level)

    def _begin(
        self, rounds: list[tuple[int, ...]], work: float, course: Course | None = None
    ) -> None:
        """Find the course.

        Args:
            rounds: Where the search for a round begins.
            work: For rounds and for courses together.
            course: One that is followed already; None: the best round is begun.
        """
        rules = self.rules
        rounds = list(filter(None, (self._feasible(targets) for targets in rounds)))
        if not rounds:
            # Nothing can be visited but the place where the robot is.
            rounds = [(rules.charge_from(self._state.place),) if rules.energy else (0,)]
        length = rules.length(rounds[0])
        self._horizon = HORIZON * max(length, rules.least_period)
        if rules.energy:
            # A course that has not come to its charge yet looks better than it is.
            self._horizon += 2.0 * rules.energy.cycle_seconds
        simple = SIMPLE if rules.count <= SIMPLE_UP_TO else ()
        walks = [self._simulated(choose) for choose in simple]
        self._simple = min((walk.settled for walk in walks if not walk.cut), default=math.inf)
        filled = self._find_rounds(rounds, walks, 0.7 * work)
        # A charge on its round takes time that the length of the ways does not tell.
        self._horizon = max(self._horizon, HORIZON * self._search.best.length)
        self._course = course or self._entered(self._phases()[0])
        self._outcome = self._followed(self._course, math.inf)
        self._began = self._state
        end = self._work + work
        for candidate in self._candidates(filled):
            if self._work > end or self._is_finished() or self._late():
                break
            self._try(candidate)
        for walk in walks:
            if (back := walk.repeated_from(rules)) is not None and not walk.cut:
                self._try(Course(tuple(walk.walk), back, patience=math.inf))
        self._explain_cut()

    def _explain_cut(self) -> None:
        """Note what was not looked at for want of time."""
        if self._late():
            self.cut = f'the search was ended after {MOST_SECONDS:g} s of the processor'
        elif self._outcome.cut:
            self.cut = f'it was looked ahead for {len(self._outcome.walk)} moves only'

    def _simulated(self, choose: Choice, stop: float = math.inf) -> Outcome:
        """Return what a way to choose comes to from here.

        A level above that at which charges end is had once only.
        """
        state, energy = self._state, self.rules.energy
        if energy is not None and state.level > energy.full:
            state = replace(state, level=energy.full)
        outcome = roll_out(self.rules, choose, state, self._horizon, stop, self._late)
        self._work += MOVE_WORK * len(outcome.walk)
        return outcome

    def _feasible(self, targets: tuple[int, ...]) -> tuple[int, ...]:
        """Return a round without what the charge does not allow, and with the charges it needs."""
        rules = self.rules
        if rules.energy is None:
            return targets
        wanted = set(rules.wanted)
        kept = tuple(t for t in targets if t >= rules.count or t in wanted)
        if any(target >= rules.count for target in kept):
            return kept
        return with_charges(rules, kept) if kept else ()

    def _find_rounds(
        self, rounds: list[tuple[int, ...]], walks: list[Outcome], work: float
    ) -> tuple[int, ...]:
        """Search a short round; return one that is filled with visits where the robot would wait on
        the short one, else nothing."""
        rules = self.rules
        length = rules.length(rounds[0])
        waits = length < rules.least_period
        starts = [rounds]
        if not waits:  # Else the simple policies wait by walking more.
            laps = ([*rules.laps(walk.walk)] for walk in walks)
            starts += [group for group in laps if group]
            if rules.energy:
                starts = [[*filter(None, map(self._feasible, group))] for group in starts]
        self._search = RoundSearch(rules, starts)
        filled: tuple[int, ...] = ()
        if waits and rules.least_period < FILLED_UP_TO * length:
            search = RoundSearch(rules, starts, fills=True)
            self._search_on(search, work / 2.0)
            if not search.best.breaches and not search.best.short:
                filled = search.best.targets
        self._search_on(self._search, work / 2.0 if filled else work)
        return filled

    def _candidates(self, filled: tuple[int, ...]) -> Iterator[Course]:
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
        if self.rules.least_period > self._search.best.length - 1e-6:
            yield from self._with_one_more_visit()

    def _with_one_more_visit(self) -> Iterator[Course]:
        """Yield the best course so far with one visit more or less: waiting in another way.

        That is gone on with as long as one of them is better.
        """
        course = None
        while course is not self._course:
            course = self._course
            targets, patience = course.targets, {0.0, course.patience, math.inf}
            for position in range(course.back, len(targets)):
                changed = [
                    (*targets[:position], place, *targets[position:])
                    for place in self.rules.near(targets[position])
                ]
                if targets.count(targets[position]) > 1:
                    changed.append((*targets[:position], *targets[position + 1 :]))
                for other, wait in itertools.product(changed, sorted(patience)):
                    yield replace(course, targets=other, patience=wait)

    def _is_finished(self) -> bool:
        """Return whether no better course is looked for."""
        return self._search.finished and self._outcome.first <= GOOD_ENOUGH * self._bound

    def _search_on(self, search: RoundSearch, work: float) -> None:
        """Go on looking for a better round."""
        end = search.work + work
        while search.work < end and not search.finished and not self._late():
            search.improve(SLICE_WORK)

    def _late(self) -> bool:
        """Return whether the choice has taken all the time that there is."""
        return time.thread_time() > self._deadline

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
        return self._simulated(course.choose, stop)

    def _grade(self, outcome: Outcome) -> tuple[bool, int, int, float]:
        """Return what courses are compared by, less is better, in whole percents of the bound.

        Waits from visit to visit come again and again, so they count first, as far as they are
        longer than what is accepted. Then the first waits do, which come once. Of a course that was
        looked at in part only nothing good is known.
        """
        bound = self._bound
        lasting = max(0, math.ceil(100.0 * (outcome.settled - self._accepted) / bound - 1e-6))
        return outcome.cut, lasting, round(100.0 * outcome.first / bound), outcome.settled

    def _entered(self, phase: int, targets: tuple[int, ...] = ()) -> Course:
        """Return the course that begins a round, the best one if none is given, with one of its
        targets."""
        targets = targets or self._search.best.targets
        rules = self.rules
        wait = max(0.0, rules.least_period - rules.length(targets))
        patience = wait + 2.0 * rules.mean_leg
        return Course(targets[phase:] + targets[:phase], patience=patience)

    def _phases(self) -> list[int]:
        """Return where the best round is well begun: where it leads on, with the oldest place."""
        targets, seen, places = self._search.best.targets, self._state.seen, self.rules.places
        phases = [k for k in range(len(targets)) if places[targets[k - 1]] == self._state.place]
        return [*phases, min(range(len(targets)), key=lambda k: seen[places[targets[k]]])]


def plan_of(world: World, energy: Energy | None = None) -> Plan:
    """Return the plan that the policy remembers, or a new one that takes over its course."""
    plan = world.memory.plan
    if not isinstance(plan, Plan) or not plan.fits(world, energy):
        before = plan if isinstance(plan, Plan) else None
        plan = world.memory.plan = Plan(world, energy, before)
    return plan
