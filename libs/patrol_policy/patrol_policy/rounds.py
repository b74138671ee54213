"""Searches a closed round through all places that the rules let a robot walk again and again.

A round is a cyclic list of targets; the robot takes the shortest way from each to the next. Walked
again and again it is periodic: how long each place went unvisited at each step is known, and so is
whether the rules allow the step. The search makes the round short and lawful: the cost of a round
is its length plus a penalty for each step that the rules forbid, and simulated annealing changes
the round where that costs little. It begins with a short tour, which usually needs a few changes:
a place beside the way that the rules would force the robot into is taken along.

Where places may be entered only when they are URGENT, a round can be shorter than they allow. Then
the robot waits by going to and fro, or the round is filled: another search adds the visits that
make it just long enough.
"""

from __future__ import annotations

import itertools
import math
import random
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass

from patrol_policy.rollout import RuleMap

PENALTY = 4.0
"""What a forbidden step costs, in mean legs."""
HEAT, FILLING_HEAT = 0.04, 0.3
"""The first temperature of an annealing, in penalties; of one that fills rounds."""
FILLING = 0.1
"""Part of the changes that add a visit where rounds are filled."""
FIRST_CYCLE = 200_000.0
"""Work of the first annealing; each later one takes twice as much as the one before."""
ALL_WORK = 10e6
"""Work after which no better round is looked for."""
STEP_WORK, TRY_WORK = 0.35, 4.0
"""Work of a step of a round that is checked, and of a change that is thought of: microseconds."""


@dataclass(frozen=True)
class Breach:
    """A step of a round that the rules forbid.

    Attributes:
        position: Of the target that the robot heads for, in the round.
        instead: The neighbour that comes first by the rules.
    """

    position: int
    instead: int


@dataclass(frozen=True)
class Round:
    """A cyclic list of targets.

    Attributes:
        targets: Every place at least once.
        length: Seconds for walking it once, with the time that it waits for places to be URGENT.
        breaches: The steps that the rules forbid.
    """

    targets: tuple[int, ...]
    length: float
    breaches: tuple[Breach, ...] = ()


class RoundSearch:
    """A search that can be gone on with; all of it is counted in work, about microseconds.

    Args:
        rules: The map.
        starts: Groups of rounds; the first annealings begin with the best of each group.
        fills: Whether a round must be as long as the rules demand by what it visits; else the robot
            is taken to wait before the first target.

    Attributes:
        best: The best round so far.
        work: Work done so far.
    """

    def __init__(
        self, rules: RuleMap, starts: Iterable[Iterable[tuple[int, ...]]], *, fills: bool = False
    ) -> None:
        self._rules = rules
        self._least = 0.0 if fills else rules.least_period
        self._heat = FILLING_HEAT if fills else HEAT
        self._filling = FILLING if fills else 0.0
        self._draw = random.Random(0)
        self._penalty = PENALTY * rules.mean_leg
        self.work = 0.0
        rounds = [min(map(self.judged, group), key=self.cost) for group in starts]
        rounds.sort(key=lambda found: (self.cost(found), len(found.targets)))
        self.best, self._starts = rounds[0], rounds
        self._cycle, self._cycle_end = FIRST_CYCLE / 2.0, 0.0

    def cost(self, found: Round) -> float:
        """Return the length of a round with the penalties for what the rules forbid, seconds."""
        return found.length + self._penalty * len(found.breaches)

    def judged(self, targets: tuple[int, ...], limit: float = math.inf) -> Round:
        """Return a round with its length and the steps that the rules forbid.

        Args:
            targets: Of the round.
            limit: Of the cost; a round that costs more may be judged in part only.
        """
        walk, ends, times = self._walked(targets)
        length = max(times[-1] if times else 0.0, self._least)
        most = (limit - length) / max(self._penalty, 1e-9)
        breaches = self._breaches(walk, ends, times, length, most)
        return Round(targets, length, tuple(breaches))

    def _walked(self, targets: tuple[int, ...]) -> tuple[list[int], list[int], list[float]]:
        """Return the places that a round enters, where in them each target is, and when."""
        rules = self._rules
        walk: list[int] = []
        ends: list[int] = []
        place = targets[-1]
        for target in targets:
            if target != place:
                walk += rules.path(place, target)
            ends.append(len(walk))
            place = target
        self.work += STEP_WORK * len(walk)
        times, now = [], 0.0
        for other in walk:
            now += rules.leg_seconds[place][other]
            times.append(now)
            place = other
        return walk, ends, times

    def _breaches(
        self, walk: list[int], ends: list[int], times: list[float], length: float, most: float
    ) -> list[Breach]:
        """Return the steps of a walk that the rules forbid; more than ``most``: not all of them."""
        if not walk:
            return []
        rules = self._rules
        legs, ranks, urgent = rules.leg_seconds, rules.ranks, rules.urgent
        # When each place was visited last, for the first step: in the round before.
        seen = {other: then - length for other, then in zip(walk, times, strict=True)}
        breaches, now, place = list[Breach](), 0.0, walk[-1]
        seen[place] = 0.0
        for step, (other, then) in enumerate(zip(walk, times, strict=True)):
            limit = now - rules.overdue
            rank = ranks[other]
            if rank > urgent and seen[other] < limit:
                rank = urgent
            if rank:
                for instead in legs[place]:
                    if ranks[instead] < rank or (urgent < rank and seen[instead] < limit):
                        breaches.append(Breach(bisect_right(ends, step), instead))
                        break
                if len(breaches) > most:
                    break
            seen[other] = now = then
            place = other
        return breaches

    @property
    def finished(self) -> bool:
        """Whether a better round is not looked for: none can be, or very much was tried."""
        best = self.best
        if self.work > ALL_WORK or len(best.targets) < 4:
            return True
        return not best.breaches and best.length <= self._rules.least_round + 1e-6

    def improve(self, work: float) -> None:
        """Search on."""
        end = self.work + work
        while self.work < end and not self.finished:
            self.work += TRY_WORK
            if self.work > self._cycle_end:
                if not self._starts:
                    self._cycle *= 2.0
                self._cycle_end = self.work + self._cycle
                self._take(self._starts.pop(0) if self._starts else self.best)
            cooling = (self._cycle_end - self.work) / self._cycle
            heat = self._heat * self._penalty * max(0.0, cooling)
            limit = self._cost + 6.0 * heat
            changes = self._changes
            fill = self._filling and self._draw.random() < self._filling
            targets = changes.doubled(limit) if fill else changes.one(limit)
            if targets is None:
                continue
            found = self.judged(targets, limit)
            cost = self.cost(found)
            rise = cost - self._cost
            if rise <= 0.0 or (heat > 0.0 and self._draw.random() < math.exp(-rise / heat)):
                self._take(found)
                if cost < self.cost(self.best) - 1e-9:
                    self.best = found

    def _take(self, found: Round) -> None:
        """Make a round the one that is changed."""
        self._cost = self.cost(found)
        self._changes = RoundChanges(self._rules, found, self._draw)


class RoundChanges:
    """Random changes of a round; what each adds to the length is known before it is made.

    Args:
        rules: The map.
        found: The round.
        draw: Chance.
    """

    def __init__(self, rules: RuleMap, found: Round, draw: random.Random) -> None:
        self._rules, self._draw = rules, draw
        self._targets = targets = found.targets
        self._breaches = found.breaches
        self._at = {target: position for position, target in enumerate(targets)}
        # Lengths of the legs up to each position, there and back.
        away = rules.away
        there, back = [0.0], [0.0]
        for before, after in itertools.pairwise(targets):
            there.append(there[-1] + away[before][after])
            back.append(back[-1] + away[after][before])
        self._there, self._back = there, back
        self._length = there[-1] + away[targets[-1]][targets[0]]

    def one(self, limit: float) -> tuple[int, ...] | None:
        """Return the targets with one random change; None: it would be longer than the limit."""
        draw, breaches = self._draw, self._breaches
        choice = draw.random()
        if breaches and choice < 0.3:
            return self._taken_along(breaches[draw.randrange(len(breaches))], limit)
        if choice < 0.35:
            return self._without_double()
        count = len(self._targets)
        if count < 4:
            return None
        first = draw.randrange(count)
        beside = self._at[draw.choice(self._rules.near[self._targets[first]])]
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
        old = self._at[place]
        rest = targets[:old] + targets[old + 1 :]
        position -= old < position
        return (*rest[:position], place, *rest[position:])

    def doubled(self, limit: float) -> tuple[int, ...] | None:
        """Return the targets with one more visit of a place that is near the round there."""
        targets, away = self._targets, self._rules.away
        position = self._draw.randrange(len(targets))
        before, after = targets[position - 1], targets[position]
        if not self._rules.near[after]:
            return None
        place = self._draw.choice(self._rules.near[after])
        added = away[before][place] + away[place][after] - away[before][after]
        if self._length + added > limit:
            return None
        return (*targets[:position], place, *targets[position:])

    def _without_double(self) -> tuple[int, ...] | None:
        """Leave out one of the targets that stand twice."""
        targets = self._targets
        if len(targets) == self._rules.count:
            return None
        twice = [k for k, target in enumerate(targets) if self._at[target] != k]
        position = self._draw.choice(twice)
        if self._draw.random() < 0.5:
            position = self._at[targets[position]]
        return targets[:position] + targets[position + 1 :]

    def _turned_round(self, first: int, last: int, limit: float) -> tuple[int, ...] | None:
        """Turn a stretch round so that its ends come beside each other's neighbours."""
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
