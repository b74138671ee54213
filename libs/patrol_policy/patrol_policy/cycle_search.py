"""Searches a cycle through all places that the rules let a robot walk again and again.

A cycle is a cyclic list of targets, charges among them; the robot takes the shortest way from each
to the next. Walked again and again it is periodic: how long each place went unvisited at each step
is known, what is left of the charge, and so is whether the rules allow the step. The search makes
the waits on the cycle short and the cycle lawful: its cost is the longest wait plus a penalty for
each step that the rules or the charge forbid, and simulated annealing (Kirkpatrick et al., 1983)
changes the cycle where that costs little. It begins with a short tour, which usually needs a few
changes: a place beside the way that the rules would force the robot into is taken along, a charge
is put elsewhere.

Where places may be entered only when they are URGENT, a cycle can be shorter than they allow. Then
it begins with further turns through the other places, as many as make it just long enough
(`filled`). Where that would be very many turns the cycle stays short, and such places are skipped
until they are due.
"""

from __future__ import annotations

import itertools
import math
import random
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from patrol_policy.battery import WORTH_CHARGING
from patrol_policy.rule_graph import RuleGraph

PENALTY = 4.0
"""What a forbidden step costs, in mean legs."""
HEAT, FILLING_HEAT = 0.04, 0.3
"""The first temperature of an annealing, in penalties; of one of cycles that are filled."""
FILLING = 0.1
"""Part of the changes that add a visit where cycles are filled."""
FILLED_UP_TO = 6.0
"""Cycles are filled with visits while places wait at most so many shortest cycles."""
CHARGES = 0.12
"""Part of the changes that add or move a charge where the battery matters."""
EMPTY = 3.0
"""What it costs to come home with nothing left, in penalties, and once more for each mean leg by
which the charge is too short."""
ROTATIONS = 4_000
"""From so many places of a cycle further turns are tried, divided by its places."""
GOOD_ENOUGH = 1.004
"""A longest wait of so many bounds is not improved any further."""
FIRST_ANNEALING = 200_000.0
"""Work of the first annealing; each later one takes twice as much as the one before."""
ALL_WORK = 10e6
"""Work after which no better cycle is looked for."""
STEP_WORK, TRY_WORK = 0.35, 4.0
"""Work of a step of a cycle that is checked, and of a change that is thought of: microseconds."""


@dataclass(frozen=True)
class Breach:
    """A step of a cycle that the rules forbid.

    Attributes:
        position: Of the target that the robot heads for, in the cycle.
        instead: The neighbour that comes first by the rules.
    """

    position: int
    instead: int


@dataclass(frozen=True)
class Cycle:
    """A cyclic list of targets.

    Attributes:
        targets: Stops; every wanted place at least once.
        length: Seconds for walking it once, with charging.
        wait: The longest wait on it, less what the place has more time than others, seconds.
        breaches: The steps that the rules forbid.
        short: By how much the charge is too short at the worst places, seconds in all.
    """

    targets: tuple[int, ...]
    length: float
    wait: float = 0.0
    breaches: tuple[Breach, ...] = ()
    short: float = 0.0


class CycleSearch:
    """A search that can be gone on with; all of it is counted in work, about microseconds.

    Args:
        rules: The map.
        starts: Groups of cycles; the first annealings begin with the best of each group. Visits
            and charges that they lack are added.
        tour: Length of the shortest cycle that is known, rules and charges left aside, seconds.

    Attributes:
        best: The best cycle so far.
        begun: The best of those that it began with.
        work: Work done so far.
    """

    def __init__(
        self, rules: RuleGraph, starts: Iterable[Iterable[tuple[int, ...]]], tour: float
    ) -> None:
        self._rules = rules
        periods = {
            place: period
            for place, period in rules.held_periods.items()
            if period <= FILLED_UP_TO * tour
        }
        # What is held for longer is skipped until it is due, which is no breach.
        self._resting = rules.held_periods.keys() - periods
        within = rules.energy.within_range if rules.energy else [True] * rules.count
        # The neighbours that a robot at each place may go to, as far as the charge allows it.
        self._onward = [[o for o in ways if within[o]] for ways in rules.leg_seconds[: rules.count]]
        self._period = max(periods.values(), default=0.0)
        fills = self._period > tour
        self._heat = FILLING_HEAT if fills else HEAT
        # A place with less time than others is visited more than once.
        self._filling = FILLING if fills or not rules.is_even else 0.0
        # Always the same chance: the same map and state give the same round on every machine.
        self._draw = random.Random(0)
        self._penalty = PENALTY * rules.mean_leg
        self.work = 0.0
        prepared = (
            [round for start in group for round in self._prepared(start)] for group in starts
        )
        cycles = [min(map(self.judged, group), key=self.cost) for group in prepared if group]
        cycles = cycles or [self.judged((max(0, rules.charge_from(0)),))]
        cycles.sort(key=lambda found: (self.cost(found), len(found.targets)))
        self.best = self.begun = cycles[0]
        self._starts = cycles
        self._annealing, self._annealing_end = FIRST_ANNEALING / 2.0, 0.0

    def _prepared(self, targets: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        """Yield a cycle without what the charge does not allow, with the visits and charges that
        it needs."""
        rules = self._rules
        wanted = {*rules.wanted, *range(rules.count, len(rules.places))}
        kept = tuple(target for target in targets if target in wanted)
        if not kept:
            return
        # Which places come once more depends on where the cycle is taken to begin: all, or on a
        # large map some, are tried.
        turned: Iterable[tuple[int, ...]] = (kept,)
        if rules.length(kept) < self._period:
            every = max(1, len(kept) ** 2 // ROTATIONS)
            turned = (kept[k:] + kept[:k] for k in range(0, len(kept), every))
            turned = (filled(rules, each, self._period) for each in turned)
        for each in turned:
            if rules.energy and all(target < rules.count for target in each):
                each = with_charges(rules, each)
            yield each

    def cost(self, found: Cycle) -> float:
        """Return the longest wait of a cycle with the penalties for what is forbidden, seconds."""
        # That a cycle is shorter than places can be visited on is no merit.
        cost = max(found.wait, self._rules.least_wait) + self._penalty * len(found.breaches)
        if found.short > 0.0:
            cost += EMPTY * self._penalty * (1.0 + found.short / self._rules.mean_leg)
        return cost

    def judged(self, targets: tuple[int, ...], limit: float = math.inf) -> Cycle:
        """Return a cycle with its length, waits and the steps that the rules forbid.

        Args:
            targets: Of the cycle.
            limit: Of the cost; a cycle that costs more may be judged in part only.
        """
        # In the order of cost: what a limit can tell from the length is known before the rules are
        # asked for each step.
        walk, ends = self._walked(targets)
        times, short = self._timed(walk)
        wait = length = times[-1] if times else 0.0
        if not self._rules.is_even:
            wait = self._longest_wait(walk, times, length)
        # More breaches than these cost more than the limit: the count may stop there.
        most = (limit - wait) / max(self._penalty, 1e-9)
        breaches = self._breaches(walk, ends, times, most)
        return Cycle(targets, length, wait, tuple(breaches), short)

    def _walked(self, targets: tuple[int, ...]) -> tuple[list[int], list[int]]:
        """Return the stops that a cycle enters, and where in them each target is."""
        rules = self._rules
        walk: list[int] = []
        ends: list[int] = []
        stop = targets[-1]
        for target in targets:
            if target != stop:
                walk += rules.path(stop, target)
            ends.append(len(walk))
            stop = target
        self.work += STEP_WORK * len(walk)
        return walk, ends

    def _timed(self, walk: list[int]) -> tuple[list[float], float]:
        """Return when each stop of a walk is left, and by how much the charge is too short.

        The level is followed from the last charge on the cycle, after which it is full.
        """
        rules, energy, count = self._rules, self._rules.energy, self._rules.count
        legs, now, times = rules.leg_seconds, 0.0, []
        if not walk:
            return [], 0.0
        before = walk[-1]
        if energy is None:
            for stop in walk:
                now += legs[before][stop]
                times.append(now)
                before = stop
            return times, 0.0
        drives, least, full, draw = energy.drive, energy.least, energy.full, energy.draw
        places = rules.places
        seconds = []
        for stop in walk:
            if stop < count:
                seconds.append(legs[before][stop])
            else:
                seconds.append(drives[stop - count][places[before]])
            before = stop
        last = max((step for step, stop in enumerate(walk) if stop >= count), default=-1)
        if last < 0:
            return list(itertools.accumulate(seconds)), sum(seconds)
        # A periodic walk has no beginning: the level at its first step is what is left since the
        # last charge of the turn before.
        level = full - draw * sum(seconds[last + 1 :])
        # Of several charges none is a mere excuse for driving without exploring.
        charges = sum(stop >= count for stop in walk)
        most = full - WORTH_CHARGING if charges > 1 else math.inf
        lacking = 0.0
        for stop, passed in zip(walk, seconds, strict=True):
            level -= draw * passed
            now += passed
            if stop >= count:
                lacking += max(0.0, -level, level - most)
                now += energy.charge_seconds(stop - count, max(level, 0.0))
                level = full
            elif level < least[stop]:
                lacking += least[stop] - level
            times.append(now)
        return times, lacking / draw

    def _longest_wait(self, walk: list[int], times: list[float], length: float) -> float:
        """Return the longest wait on a periodic walk, less the slack of the place."""
        places, slack = self._rules.places, self._rules.slack
        # The walk comes round: before its first step each place was visited as it is at its end,
        # one length earlier. So one pass knows all waits of the endless patrol.
        seen = {places[stop]: then - length for stop, then in zip(walk, times, strict=True)}
        longest = 0.0
        for stop, then in zip(walk, times, strict=True):
            place = places[stop]
            longest = max(longest, then - seen[place] - slack[place])
            seen[place] = then
        return longest

    def _breaches(
        self, walk: list[int], ends: list[int], times: list[float], most: float
    ) -> list[Breach]:
        """Return the steps of a walk that the rules forbid; more than ``most``: not all of them."""
        breaches = list[Breach]()
        if walk:
            rules = self._rules
            broken = rules.table.broken(walk, times, rules.places, self._onward, self._resting)
            for step, instead in broken:
                breaches.append(Breach(bisect_right(ends, step), instead))
                if len(breaches) > most:
                    break
        return breaches

    @property
    def finished(self) -> bool:
        """Whether a better cycle is not looked for: none can be, or very much was tried."""
        # Below `least_cycle` no lawful cycle is known to fall; a little above it, further work
        # would gain less than drives differ from what is expected of them.
        best = self.best
        if self.work > ALL_WORK or len(best.targets) < 4:
            return True
        if best.breaches or best.short > 0.0:
            return False
        return self.cost(best) <= GOOD_ENOUGH * self._rules.least_cycle

    def improve(self, work: float) -> None:
        """Search on."""
        end = self.work + work
        while self.work < end and not self.finished:
            self.work += TRY_WORK
            # Simulated annealing (Kirkpatrick, Gelatt and Vecchi, Science 1983), again and again
            # and longer each time: a short one finds a cycle that will do, and the search may be
            # ended after any of them.
            if self.work > self._annealing_end:
                if not self._starts:
                    self._annealing *= 2.0
                self._annealing_end = self.work + self._annealing
                self._take(self._starts.pop(0) if self._starts else self.best)
            cooling = (self._annealing_end - self.work) / self._annealing
            heat = self._heat * self._penalty * max(0.0, cooling)
            # A rise of six times the heat is taken once in 400 tries: what costs more is not judged
            # to its end.
            limit = self._cost + 6.0 * heat
            # Three kinds of changes: more visits (where thresholds differ, or a cycle has to be
            # filled), charges, and the order of the targets.
            changes = self._changes
            chance = self._draw.random()
            if chance < self._filling:
                targets = changes.doubled(limit)
            elif self._rules.energy and chance < self._filling + CHARGES:
                targets = changes.charged()
            else:
                targets = changes.one(limit)
            if targets is None:
                continue
            found = self.judged(targets, limit)
            cost = self.cost(found)
            rise = cost - self._cost
            # Metropolis' rule: what is worse is taken with the chance exp(-rise / heat), so that
            # the search leaves a valley, and seldom does once it is cold.
            if rise <= 0.0 or (heat > 0.0 and self._draw.random() < math.exp(-rise / heat)):
                self._take(found)
                if cost < self.cost(self.best) - 1e-9:
                    self.best = found

    def _take(self, found: Cycle) -> None:
        """Make a cycle the one that is changed."""
        self._cost = self.cost(found)
        self._changes = CycleChanges(self._rules, found, self._draw)


class CycleChanges:
    """Random changes of a cycle; what each adds to the length is known before it is made.

    Args:
        rules: The map.
        found: The cycle.
        draw: Chance.
    """

    def __init__(self, rules: RuleGraph, found: Cycle, draw: random.Random) -> None:
        self._rules, self._draw = rules, draw
        self._targets = targets = found.targets
        self._breaches = found.breaches
        self._at = {target: position for position, target in enumerate(targets)}
        # Lengths of the legs up to each position, there and back: with them the length of a stretch
        # that is turned round is known without walking it, though legs differ by direction.
        away = rules.away
        there, back = [0.0], [0.0]
        for before, after in itertools.pairwise(targets):
            there.append(there[-1] + away[before][after])
            back.append(back[-1] + away[after][before])
        self._there, self._back = there, back
        self._length = there[-1] + away[targets[-1]][targets[0]]
        # What a change adds to the length says nothing of the waits where thresholds differ.
        self._has_limit = rules.is_even

    def one(self, limit: float) -> tuple[int, ...] | None:
        """Return the targets with one random change; None: it would be longer than the limit."""
        draw, breaches = self._draw, self._breaches
        if not self._has_limit:
            limit = math.inf
        choice = draw.random()
        # A step that is forbidden says itself what is lacking: repairs are tried before chance.
        if breaches and choice < 0.3:
            return self._taken_along(breaches[draw.randrange(len(breaches))], limit)
        if choice < 0.35:
            return self._without_double()
        count = len(self._targets)
        if count < 4:
            return None
        # Only changes that bring near places beside one another are tried: nearly all that shorten
        # a tour do (neighbour lists, Johnson and McGeoch, "The traveling salesman problem", 1997).
        first = draw.randrange(count)
        near = self._rules.near(self._targets[first])
        if not near:
            return None
        beside = self._at.get(draw.choice(near), first)
        if choice < 0.7:
            return self._turned_round(min(first, beside), max(first, beside), limit)
        return self._moved(first, beside, limit)

    def _taken_along(self, breach: Breach, limit: float) -> tuple[int, ...] | None:
        """Visit the place that the rules demand before the target; there alone, or there, too."""
        targets, away = self._targets, self._rules.away
        position, place = breach.position, breach.instead
        if self._draw.random() < 0.4:
            before, after = targets[position - 1], targets[position]
            added = away[before][place] + away[place][after] - away[before][after]
            if self._length + added > limit:
                return None
            return (*targets[:position], place, *targets[position:])
        old = self._at.get(place)
        if old is None:  # It is visited by charging there.
            return (*targets[:position], place, *targets[position:])
        rest = targets[:old] + targets[old + 1 :]
        position -= old < position
        return (*rest[:position], place, *rest[position:])

    def doubled(self, limit: float) -> tuple[int, ...] | None:
        """Return the targets with one more visit of a place that is near the cycle there."""
        targets, away = self._targets, self._rules.away
        position = self._draw.randrange(len(targets))
        before, after = targets[position - 1], targets[position]
        near = self._rules.near(after)
        if not near:
            return None
        place = self._draw.choice(near)
        if not self._has_limit:
            limit = math.inf
        added = away[before][place] + away[place][after] - away[before][after]
        if self._length + added > limit:
            return None
        return (*targets[:position], place, *targets[position:])

    def charged(self) -> tuple[int, ...] | None:
        """Return the targets with one more charge, or one that was put elsewhere."""
        targets, draw, rules = self._targets, self._draw, self._rules
        charges = [k for k, target in enumerate(targets) if target >= rules.count]
        if charges and draw.random() < 0.5:
            gone = draw.choice(charges)
            targets = targets[:gone] + targets[gone + 1 :]
        position = draw.randrange(len(targets))
        stop = rules.charge_from(rules.places[targets[position - 1]])
        assert rules.energy is not None
        if draw.random() < 0.2:
            stop = rules.count + draw.randrange(len(rules.energy.stations))
        return (*targets[:position], stop, *targets[position:])

    def _without_double(self) -> tuple[int, ...] | None:
        """Leave out one of the targets that stand twice, or a charge."""
        targets, places, count = self._targets, self._rules.places, self._rules.count
        times = Counter(places[target] for target in targets)
        twice = [k for k, target in enumerate(targets) if times[places[target]] > 1]
        charges = sum(target >= count for target in targets)
        if charges == 1:
            twice = [k for k in twice if targets[k] < count]
        if not twice:
            return None
        position = self._draw.choice(twice)
        return targets[:position] + targets[position + 1 :]

    def _turned_round(self, first: int, last: int, limit: float) -> tuple[int, ...] | None:
        """Turn a stretch round so that its ends come beside each other's neighbours."""
        # 2-opt (Croes, "A method for solving traveling-salesman problems", 1958): two legs are
        # taken out, and the stretch between them is walked the other way.
        targets, away = self._targets, self._rules.away
        count = len(targets)
        if self._draw.random() < 0.5:
            first += 1
        else:
            last -= 1
        if first >= last:
            return None
        before, after = targets[first - 1], targets[(last + 1) % count]
        head, tail = targets[first], targets[last]
        added = away[before][tail] + away[head][after] - away[before][head] - away[tail][after]
        inner = (self._back[last] - self._back[first]) - (self._there[last] - self._there[first])
        if last - first + 1 < count and self._length + added + inner > limit:
            return None
        turned = targets[first : last + 1][::-1]
        return targets[:first] + turned + targets[last + 1 :]

    def _moved(self, first: int, beside: int, limit: float) -> tuple[int, ...] | None:
        """Move a short stretch beside a place that is near it."""
        # Or-opt (Or, 1976): one to three places or so are put elsewhere, turned round or not. Long
        # stretches seldom fit between two others, so they are drawn seldom.
        draw, targets, away = self._draw, self._targets, self._rules.away
        count = len(targets)
        size = 1 + min(int(draw.expovariate(0.5)), count - 3)
        last = first + size - 1
        if last >= count or first <= beside <= last:
            return None
        where = beside + draw.randrange(2)
        outer, inner = targets[where - 1], targets[where % count]
        head, tail = targets[first], targets[last]
        before, after = targets[first - 1], targets[(last + 1) % count]
        stretch = targets[first : last + 1]
        turned = draw.random() < 0.5
        added = away[before][after] - away[before][head] - away[tail][after]
        if turned:
            stretch, head, tail = stretch[::-1], tail, head
            there, back = self._there, self._back
            added += (back[last] - back[first]) - (there[last] - there[first])
        added += away[outer][head] + away[tail][inner] - away[outer][inner]
        if where not in (first, last + 1) and self._length + added > limit:
            return None
        rest = targets[:first] + targets[last + 1 :]
        if where > last:
            where -= size
        return rest[:where] + stretch + rest[where:]


def filled(rules: RuleGraph, targets: tuple[int, ...], period: float) -> tuple[int, ...]:
    """Return a cycle that goes on with the places that may always be entered until it is so long.

    Args:
        rules: The map.
        targets: The cycle; the further turns keep to its order.
        period: Seconds that it is to take.
    """
    free = [t for t in dict.fromkeys(targets) if t < rules.count and rules.gates[t] < 0]
    found, away = list(targets), rules.away
    walked = sum(away[a][b] for a, b in itertools.pairwise(targets))
    if len(free) < 2:
        return targets
    at = min(range(len(free)), key=lambda k: away[targets[-1]][free[k]])
    while walked + away[found[-1]][targets[0]] < period:
        after = free[at % len(free)]
        if after != found[-1]:
            walked += away[found[-1]][after]
            found.append(after)
        at += 1
    return tuple(found)


def with_charges(rules: RuleGraph, targets: Sequence[int]) -> tuple[int, ...]:
    """Return a cycle with charges where they are needed: before the charge is too short.

    Args:
        rules: The map; its energy is known.
        targets: The cycle without charges.
    """
    energy = rules.energy
    assert energy is not None
    # From the target that is nearest to a station: the way home from there costs least.
    begin = min(range(len(targets)), key=lambda k: energy.home_seconds[targets[k]])
    ordered = [*targets[begin:], *targets[:begin]]
    found: list[int] = []
    stop, used = rules.charge_from(ordered[0]), 0.0
    for target in ordered:
        used += rules.away[stop][target]
        if found and energy.full - energy.draw * used < energy.least[target]:
            charge = rules.charge_from(rules.places[stop])
            found.append(charge)
            used = rules.away[charge][target]
        found.append(target)
        stop = target
    found.append(rules.charge_from(rules.places[stop]))
    return tuple(found)
