"""Plans a patrol ahead within the rules and the charge, and follows the plan at each choice.

A `Plan` is targets on the way in, and a cycle that is walked again and again; a `Planner` finds one
and follows it. Charges are targets like places, put where they cost least. There is one search:
`cycle_search` looks for a cycle with short waits that the rules and the charge allow (simulated
annealing). Ways into it are then compared by simulating each from where the robot is until the
patrol repeats itself (`rollout`), which gives the longest wait for ever. So are the walks of the
simple policies `oldest` and `lookahead`: the plan is never worse than those.

All that is done at the first choice. Work is counted in steps and not in time, so that the same
world gives the same mission on a slow machine, too; only `MOST_SECONDS` of the processor's time end
it early, and the plan then says so.

When times of legs, thresholds, rules or the charge change, a new planner takes over the plan as it
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
from patrol_policy.cycle_search import GOOD_ENOUGH, Cycle, CycleSearch
from patrol_policy.rollout import Choice, Outcome, lookahead, oldest, roll_out
from patrol_policy.rule_graph import PatrolState, RuleGraph, rule_graph
from patrol_policy.rule_table import HALF_OPEN
from patrol_policy.situation import Situation

FIRST_WORK = 360_000.0
"""Work before the first choice of a plan: about microseconds."""
FULL_FROM, FULL_UP_TO = 16.0, 100.0
"""Smaller maps, in places, need less work; larger ones have less: knowing them takes its time."""
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
"""How many periods a plan is simulated at most."""
PHASE_STEPS = 60_000
"""Steps of cycles that are looked at to compare with which target one is begun."""
ACCEPTED = 1.03
"""A wait from visit to visit of so many bounds is accepted for shorter first waits. The cycle may
be a little longer than it need be itself, and both together are to stay below 1.05."""
MOST_POSITIONS = 60
"""So many positions of a cycle are tried for a visit of a place that opens or closes soon."""
SKIPS = (0.0, 0.3, 0.6)
"""Targets visited more lately than this may be skipped, in lengths of the cycle."""
SIMPLE: tuple[Choice, ...] = (oldest, lookahead)
"""The simple policies that a plan is never worse than."""
SIMPLE_UP_TO = 200
"""The largest map, in places, on which those are simulated."""


@dataclass(frozen=True)
class Plan:
    """Targets in the order in which the robot goes to them.

    Attributes:
        targets: The way in and the cycle.
        back: Position of the first target of the cycle, which comes after the last.
        skip: Targets visited more lately than this are skipped, seconds.
        patience: A target that may be entered only when it is URGENT is waited for so long, else
            skipped, seconds.
    """

    targets: tuple[int, ...]
    back: int = 0
    skip: float = 0.0
    patience: float = 0.0

    def choose(self, rules: RuleGraph, state: PatrolState) -> int:
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
        # The rules force it elsewhere: to where the detour is shortest, and among equals to the
        # place that waits longest.
        legs, away = rules.leg_seconds[state.place], rules.away
        return min(allowed, key=lambda o: (legs[o] + away[o][target], state.seen[o], o))

    def _target(self, rules: RuleGraph, state: PatrolState) -> int:
        """Move on to the next target that is not to be skipped, and return it."""
        # At most once round: of targets that are all to be skipped none is due.
        place, times = state.place, state.due or rules.due(state)
        for _ in self.targets:
            target = self.targets[state.position]
            if target >= rules.count:
                if not _is_full(rules, state, target) and rules.places[target] not in state.avoided:
                    return target
            elif target != place and target not in state.avoided:
                if target in rules.windows and not rules.is_open(
                    target, state.now, rules.away[place][target]
                ):
                    state.position = self.after(state.position)
                    continue
                # What the ontology holds URGENT is due, however lately it was visited.
                due = times[target]
                if state.now - state.seen[target] >= self.skip or due == -math.inf:
                    gate = rules.gates[target]
                    if gate < 0:
                        return target
                    wait = due - HALF_OPEN / 2.0 - state.now - rules.away[place][gate]
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

    def seen_from(self, position: int) -> Plan:
        """Return the same plan for a robot that has come to a position of it."""
        if position < self.back:
            return replace(self, targets=self.targets[position:], back=self.back - position)
        around = self.targets[position:] + self.targets[self.back : position]
        return replace(self, targets=around, back=0)


def _is_full(rules: RuleGraph, state: PatrolState, charge: int) -> bool:
    """Return whether a charge would give too little to be worth its while."""
    energy = rules.energy
    assert energy is not None
    away = energy.drive[charge - rules.count][state.place]
    return state.level - energy.draw * away > energy.full - WORTH_CHARGING


class Planner:
    """Finds and follows the plan of one robot on one map.

    Args:
        world: Where it begins.
        energy: What the charge comes to; None: the battery does not matter.
        before: The plan that this one takes the place of, if there is one.

    Attributes:
        rule_graph: The map with its rules.
        state: Where the patrol stands.
        cut: What the deadline has cut off, in words; empty: nothing.
    """

    state: PatrolState
    _began: PatrolState
    _tour_seconds: (
        float  # Length of the shortest cycle that is known, rules and charges left aside.
    )

    def __init__(
        self, world: Situation, energy: Energy | None = None, before: Planner | None = None
    ) -> None:
        # Processor time of this thread: a busy machine makes the search slower, not worse.
        self._deadline = time.thread_time() + MOST_SECONDS
        # What opens or closes later than that is looked at then.
        self._from, self._changes = world.now, world.changes(world.now + world.look_ahead)
        self.rule_graph = rules = rule_graph(world, energy)
        self._work = 0.0
        self.cut = ''
        # Waits that began under the plan before count like all others: else each new plan might
        # turn on the cycle once, and the places behind would wait for two cycles.
        met = [before is not None] * rules.count
        self.state = PatrolState(world.graph.index[world.place], world.now, [], met)
        self._observe(world, 100.0 if energy is None else world.level)
        work = FIRST_WORK * min(1.0, rules.count / FULL_FROM, FULL_UP_TO / rules.count)
        if before and before.places == self.places and before.stations == self.stations:
            # A warm start: leg times that were learned change the map a little, and the cycle that
            # was best is nearly that again.
            self._tour_seconds = before._tour_seconds
            self._begin([before.targets], min(work, WARM_WORK), before.plan)
        else:
            tour = world.graph.tour
            self._tour_seconds = tour.length
            # Both ways round: legs and what the rules forbid differ by direction.
            self._begin([tour.order, tour.order[::-1]], work)

    def fits(self, world: Situation, energy: Energy | None) -> bool:
        """Return whether the plan is for this map, these thresholds, rules and stations.

        Times and rates that differ a little keep the plan.
        """
        # All that follows is compared because a plan is only as good as what it rests on; what
        # differs by less than drives do is not worth the turn that a new plan may bring.
        planned, graph = self.rule_graph.graph, world.graph
        if world.table is not self.rule_graph.table and world.table != self.rule_graph.table:
            return False
        if world.now < self._from - HALF_OPEN:
            return False
        ahead = world.now + world.look_ahead
        due = {change for change in self._changes if world.now < change[1] <= ahead}
        if world.changes(ahead) != due:
            return False
        mine = self.rule_graph.energy
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
            for now, then in zip(graph.edges, planned.edges, strict=True)
        )

    def for_a_question(self) -> Planner:
        """Return a copy that says where its plan leads from now on, and changes nothing."""
        planner = copy(self)
        planner.state = replace(self.state, met=self.state.met.copy())
        return planner

    def advance(self, world: Situation) -> tuple[int, int]:
        """Return the stop to go to and the target that it leads to, as indices."""
        self._observe(world, world.level)
        choice = self._plan.choose(self.rule_graph, self.state)
        target = self._plan.targets[self.state.position]
        stop = self.rule_graph.guarded(self.state, choice)
        return stop, target if stop < self.rule_graph.count else stop

    @property
    def places(self) -> tuple[str, ...]:
        """The places of the map."""
        return self.rule_graph.graph.places

    @property
    def stations(self) -> list[int]:
        """The places of the stations, by index."""
        return self.rule_graph.energy.stations if self.rule_graph.energy else []

    @property
    def targets(self) -> tuple[int, ...]:
        """The best cycle that was found."""
        return self._search.best.targets

    @property
    def plan(self) -> Plan:
        """What is left of the plan from where the robot is on it."""
        return self._plan.seen_from(self.state.position)

    @property
    def longest(self) -> float:
        """The longest wait from visit to visit that the plan leaves, seconds.

        Where places have time of their own, the first waits count, too.
        """
        if self.rule_graph.is_even:
            return self._outcome.settled
        return max((self._outcome.waits[place] for place in self.rule_graph.wanted), default=0.0)

    @property
    def repeats(self) -> bool:
        """Whether it is proven what the plan comes to: it leads back to where it was."""
        return self._outcome.back is not None

    @property
    def missed(self) -> frozenset[str]:
        """Places that close before the plan comes to them, as far as it was looked ahead."""
        rules = self.rule_graph
        entered = {rules.places[stop] for stop in self._outcome.walk}
        return frozenset(self.places[place] for place in rules.windows if place not in entered)

    def settled_waits(self) -> list[float]:
        """Return for each place the wait from visit to visit that the plan leaves, seconds.

        inf: the place is not visited.
        """
        rules, outcome, state = self.rule_graph, self._outcome, self._began.fresh()
        begin = outcome.repeated_from(rules)
        waits = [math.inf] * rules.count
        for place in rules.windows:
            waits[place] = outcome.waits[place]
        if begin is None:
            for place in {rules.places[stop] for stop in outcome.walk}:
                waits[place] = outcome.waits[place]
            return waits
        for stop in outcome.walk[:begin]:
            rules.go(state, stop)
        seen: dict[int, float] = {}
        for stop in (*outcome.walk[begin:], *outcome.walk[begin:]):
            # From the end to the beginning there need be no door.
            arrived = state.now
            for step in rules.path(state.place, stop):
                arrived = rules.go(state, step)
            place = rules.places[stop]
            if place in seen and place not in rules.windows:
                known = 0.0 if math.isinf(waits[place]) else waits[place]
                waits[place] = max(known, arrived - seen[place])
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

    def _observe(self, world: Situation, level: float) -> None:
        """Take where the patrol stands."""
        graph, met = world.graph, self.state.met
        seen = [world.visited_at.get(place, world.since) for place in graph.places]
        index = graph.index
        said = {index[place]: world.said_of(place) for place in world.said if place in index}
        due = self.rule_graph.table.due_times(world.now, seen, said)
        # What is said of a place stays until it is visited: see `RuleTable.due_times`.
        here = graph.index[world.place]
        if here != self.state.place:
            met[here] = True
        avoided = frozenset(graph.index[name] for name in world.avoided if name in graph.index)
        position = self.state.position
        self.state = PatrolState(here, world.now, seen, met, avoided, position, level, due)

    def _begin(self, cycles: list[tuple[int, ...]], work: float, plan: Plan | None = None) -> None:
        """Find the plan.

        Args:
            cycles: Where the search for a cycle begins.
            work: For cycles and for plans together.
            plan: One that is followed already; None: the best cycle is begun.
        """
        rules = self.rule_graph
        self._horizon = HORIZON * max(rules.length(cycles[0]), rules.least_period)
        if rules.energy:
            # A plan that has not come to its charge yet looks better than it is.
            self._horizon += 2.0 * rules.energy.cycle_seconds
        simple = SIMPLE if rules.count <= SIMPLE_UP_TO else ()
        # The simple policies are simulated first: what they come to is a limit for all that
        # follows, and their walks are starts of the search.
        walks = [self._simulated(choose) for choose in simple]
        self._simple = min((walk.settled for walk in walks if not walk.cut), default=math.inf)
        starts = [cycles, *(list(rules.cycles_in(walk.walk)) for walk in walks)]
        self._search = CycleSearch(rules, starts, self._tour_seconds)
        self._search_on(self._search, 0.7 * work)
        # A charge on its cycle takes time that the length of the ways does not tell.
        self._horizon = max(self._horizon, HORIZON * self._search.best.length)
        self._plan = plan or self._entered(self._search.best, 0)
        self._outcome = self._followed(self._plan, math.inf)
        self._began = self.state
        # Each candidate is walked until it repeats itself: only so it is known what the rules make
        # of a way into the cycle, on which places are as old as they are now.
        end = self._work + work
        for candidate in self._candidates():
            if self._work > end or self._is_finished() or self._late():
                break
            self._try(candidate)
        # What closes soon cannot wait for the cycle to come round to it.
        for candidate in self._in_time():
            if self._late():
                break
            self._try(candidate)
        for walk in walks:
            # A walk that comes back to a state that it had before is periodic: it can be followed
            # as a plan, with the waits that were simulated.
            if (back := walk.repeated_from(rules)) is not None and not walk.cut:
                self._try(Plan(tuple(walk.walk), back, patience=math.inf))
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
        # Else the first time round would be longer than all later ones, and never come back.
        state, energy = self.state, self.rule_graph.energy
        if energy is not None and state.level > energy.full:
            state = replace(state, level=energy.full)
        outcome = roll_out(self.rule_graph, choose, state, self._horizon, stop, self._late)
        self._work += MOVE_WORK * len(outcome.walk)
        return outcome

    def _candidates(self) -> Iterator[Plan]:
        """Yield ways into the cycles, the likeliest first.

        A cycle that the search has made a little shorter may be harder to come into than the one
        that it began with.
        """
        search = self._search
        # The direction counts, too: legs differ by it, and what waits longest may lie behind.
        ways = [
            [self._entered(found, phase) for phase in self._phases(found)]
            for found in dict.fromkeys((search.begun, search.best))
        ]
        for plans in ways:
            yield from plans[:2]
        for plans in ways:
            for plan in plans[:2]:
                yield replace(plan, targets=plan.targets[::-1])
        first = ways[-1][0]
        for skip, patience in itertools.product(SKIPS, (0.0, first.patience, math.inf)):
            yield replace(first, skip=skip * self._bound, patience=patience)
        for further in itertools.zip_longest(*(each[2:] for each in ways)):
            yield from filter(None, further)

    def _in_time(self) -> Iterator[Plan]:
        """Yield the best plan with one more visit the first time round of a place that opens or
        closes soon, whatever closes first."""
        windows = self.rule_graph.windows

        def closes(place: int) -> tuple[float, float]:
            known = [(last, first) for first, last in windows[place] if last > self.state.now]
            return min(known, default=(math.inf, math.inf))

        for place in sorted(windows, key=closes):
            plan = self._plan
            begun = plan.back > 0
            way, tour = plan.targets[: plan.back], plan.targets[plan.back :]
            way = way if begun else tour
            for position in range(0, len(way) + 1, max(1, len(way) // MOST_POSITIONS)):
                targets = (*way[:position], place, *way[position:], *tour)
                for patience in (plan.patience, math.inf):
                    yield replace(plan, targets=targets, back=len(way) + 1, patience=patience)

    def _is_finished(self) -> bool:
        """Return whether no better plan is looked for."""
        return self._search.finished and self._outcome.first <= GOOD_ENOUGH * self._bound

    def _search_on(self, search: CycleSearch, work: float) -> None:
        """Go on looking for a better cycle."""
        end = search.work + work
        while search.work < end and not search.finished and not self._late():
            search.improve(SLICE_WORK)

    def _late(self) -> bool:
        """Return whether the choice has taken all the time that there is."""
        return time.thread_time() > self._deadline

    def _try(self, plan: Plan) -> None:
        """Take a plan if it is better from here."""
        stop = max(1.01 * self._outcome.settled, self._accepted)
        outcome = self._followed(plan, stop)
        # A better cycle is no excuse for a longer wait on the way into it: each new plan could
        # then turn on the cycle once more.
        most = max(self._outcome.settled, self._accepted) + 1e-6
        if outcome.settled <= most and self._grade(outcome) < self._grade(self._outcome):
            self._plan, self._outcome = plan, outcome
            self.state.position = 0

    def _followed(self, plan: Plan, stop: float) -> Outcome:
        """Return what a plan comes to from here."""
        return self._simulated(plan.choose, stop)

    def _grade(self, outcome: Outcome) -> tuple[bool, int, int, int, float]:
        """Return what plans are compared by, less is better, in whole percents of the bound.

        Waits that come again and again count first, as far as they are longer than what is
        accepted, then those on the way into the cycle, which come once, then the first waits. A
        plan that takes the place of another has long waits behind it: if they counted as much, all
        cycles would be alike, and the place would get what is left of them as its bound. Of a plan
        that was looked at in part only nothing good is known.
        """
        bound = self._bound

        def late(wait: float) -> int:
            return max(0, math.ceil(100.0 * (wait - self._accepted) / bound - 1e-6))

        first = round(100.0 * outcome.first / bound)
        return outcome.cut, late(outcome.lasting), late(outcome.settled), first, outcome.settled

    def _entered(self, found: Cycle, phase: int) -> Plan:
        """Return the plan that begins a cycle with one of its targets."""
        targets, rules = found.targets, self.rule_graph
        wait = max(0.0, rules.least_period - rules.length(targets))
        patience = wait + 2.0 * rules.mean_leg
        return Plan(targets[phase:] + targets[:phase], patience=patience)

    def _phases(self, found: Cycle) -> list[int]:
        """Return with which targets a cycle may be begun, the least first waits first.

        How long each place would wait follows from the times of the cycle; what the rules demand
        in between is left to the simulation.
        """
        rules, state, targets = self.rule_graph, self.state, found.targets
        count, away, here = len(targets), rules.away, state.place
        times = [0.0]
        for before, after in zip(targets, (*targets[1:], targets[0]), strict=True):
            times.append(times[-1] + away[before][after])
        length = times.pop()
        idle = [state.now - seen for seen in state.seen]
        every = max(1, count * count // PHASE_STEPS)
        phases = {*range(0, count, every)}
        phases |= {k for k in range(count) if rules.places[targets[k - 1]] == here}
        phases.add(min(range(count), key=lambda k: state.seen[rules.places[targets[k]]]))

        def longest(phase: int) -> float:
            waits: dict[int, float] = {}
            begin = away[here][targets[phase]] - times[phase]
            for position in range(phase, phase + count):
                target = targets[position % count]
                place = rules.places[target]
                wait = begin + times[position % count] + idle[place]
                wait += length if position >= count else 0.0
                if rules.gates[place] >= 0 and state.now + wait - idle[place] <= state.due[place]:
                    wait += length
                waits[place] = min(wait, waits.get(place, math.inf))
            return max(wait - rules.slack[place] for place, wait in waits.items())

        return sorted(phases, key=lambda phase: (round(longest(phase), 3), phase))


def planner_of(world: Situation, energy: Energy | None = None) -> Planner:
    """Return the plan that the policy remembers, or a new one that takes over its plan."""
    planner = world.memory.planner
    if not isinstance(planner, Planner) or not planner.fits(world, energy):
        before = planner if isinstance(planner, Planner) else None
        planner = world.memory.planner = Planner(world, energy, before)
    return planner
