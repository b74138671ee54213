"""What the robot learns on a mission: visits, leg times, the battery's draw; kept in a small file.

**Leg times.** A leg that was never driven takes ``overhead + metres / speed``; both numbers are
fitted to all drives so far (least squares with the configured speed as prior). A leg that was
driven takes the mean of its own drives, drawn towards that prediction while they are few. Each
direction of a leg is learned for itself; while one was not driven, the other stands for it. The
spread is the standard deviation of what drives took over what was predicted for them just before,
pooled over all legs.

All of these are Huber's estimates (Huber 1964, *Robust Estimation of a Location Parameter*): what
lies within 1.345 deviations counts as in a mean, which wastes nothing of usual drives, and what
lies further off pulls only as hard as that. One absurd drive changes next to nothing; of two that
agree the second is believed. A median would do the latter as well, but needs more drives for the
same certainty, and the draw of the battery must be a mean: what a way costs is the sum of its
parts. Values that no robot can have (`FASTEST`, `SLOWEST`, `FASTEST_FALL`) never enter, and are
left out of what is read back.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field
from operator import mul
from pathlib import Path
from statistics import fmean, median
from typing import Any

from patrol_policy.battery import LEARNED_FALL, Draw
from patrol_policy.situation import Decision
from strict_files.files import FileError, KeptFile
from surveillance_behaviour.charge_estimate import ChargeEstimate
from surveillance_behaviour.mission.mission_log import (
    account_in,
    is_other_simulation,
    on_present_clock,
)

SIMULTANEOUS = 1.0
"""Seconds by which what several threads take for the present may differ."""
FALLS_REMEMBERED = 50
"""How many of the last falls of the battery's level count."""
DRIVES_REMEMBERED = 20
"""How many of the last drives of a leg count."""
ERRORS_REMEMBERED = 200
PRIOR_SPREAD = 0.15
"""Spread before anything was learned."""
PRIOR_WEIGHT = 5.0
"""How many ratios the prior of the spread weighs as much as."""
HUBER = 1.345
"""Deviations within which an estimate is a mean: 95 % as good as that for normal errors."""
ROUNDS = 30
"""Steps of an estimate; each moves less than the one before."""
FASTEST = 10.0
"""No robot drives faster from place to place, m/s."""
SLOWEST = 86_400.0
"""A drive that takes longer is none, seconds."""
FASTEST_FALL = 5.0
"""No battery falls faster, percent per second: it would last 20 s."""
CHANGE = 0.03
"""Expected times of the map follow what was learned once they differ by more than this part."""

Leg = tuple[str, str]


def spread_of(ratios: Collection[float]) -> float:
    """Return the standard deviation from 1 of ratios of what was seen to what was expected.

    `PRIOR_SPREAD` stands for it while they are few; none counts as further off than 2, and one in
    twenty, or one alone, as no further off than the next.
    """
    away = sorted(min(abs(ratio - 1.0), 2.0) for ratio in ratios)
    # The furthest ones count as the next, until there are more of their kind.
    odd = 1 + len(away) // 20
    most = max(PRIOR_SPREAD, away[-1 - odd]) if len(away) > odd else PRIOR_SPREAD
    squares = sum(min(each, most) ** 2 for each in away)
    return math.sqrt((PRIOR_WEIGHT * PRIOR_SPREAD**2 + squares) / (PRIOR_WEIGHT + len(ratios)))


def robust_mean(values: Collection[float], start: float, *, prior: float = 0.0) -> float:
    """Return Huber's estimate of where values lie, all of them positive.

    Args:
        values: At least one.
        start: Where it is expected; the estimate begins there.
        prior: How many values `start` itself counts as.
    """
    estimate = start
    for _ in range(ROUNDS):
        within = HUBER * PRIOR_SPREAD * estimate
        weights = [within / max(within, abs(value - estimate)) for value in values]
        own = prior * within / max(within, abs(start - estimate))
        total = sum(weights) + own
        step = float((sum(map(mul, weights, values)) + own * start) / total)
        if abs(step - estimate) < 1e-4 * estimate:
            return step
        estimate = step
    return estimate


@dataclass(frozen=True)
class TimedDrive:
    """A drive that came where it was sent.

    Attributes:
        start: The place where it was decided.
        seconds: From the decision to the arrival.
    """

    start: str
    seconds: float


class LegTimer:
    """Times the present drive, from the decision to the arrival.

    Args:
        elapsed: Seconds as they pass, whatever the date is set to; None: the times that are told
            count.
    """

    def __init__(self, elapsed: Callable[[], float] | None = None) -> None:
        self._elapsed = elapsed
        self._leg: Decision | None = None
        self._began = 0.0

    @property
    def is_running(self) -> bool:
        """Whether a drive is timed."""
        return self._leg is not None

    def begin(self, decision: Decision) -> None:
        """Begin with a decision."""
        self._leg, self._began = decision, self._passed(decision.time)

    def forget(self) -> None:
        """End it: the drive is no example."""
        self._leg = None

    def end(self, place: str, now: float) -> TimedDrive | None:
        """Return the drive that ended at a place; None: it was sent elsewhere, or forgotten.

        Args:
            place: Where the robot has come.
            now: Seconds on the mission's clock.
        """
        leg, self._leg = self._leg, None
        if leg is None or leg.place != place:
            return None
        return TimedDrive(leg.from_place, self._passed(now) - self._began)

    def _passed(self, now: float) -> float:
        return now if self._elapsed is None else self._elapsed()


@dataclass
class LegTimes:
    """Learned times of the legs of one map.

    Attributes:
        speed: Metres per second while nothing was driven.
        metres: Lengths of the paths that were planned, by leg.
        drives: Seconds of the last drives, by leg.
        errors: Driven over predicted seconds of the last drives of all legs.
    """

    speed: float = 0.6
    metres: dict[Leg, float] = field(default_factory=dict)
    drives: dict[Leg, deque[float]] = field(default_factory=dict)
    errors: deque[float] = field(default_factory=lambda: deque(maxlen=ERRORS_REMEMBERED))
    _used: dict[Leg, float] = field(default_factory=dict)
    _fit: tuple[float, float] | None = None
    _expected: dict[tuple[str, str, float], float] = field(
        default_factory=dict, compare=False, repr=False
    )

    def observe(
        self, start: str, goal: str, seconds: float, straight: float, metres: float | None = None
    ) -> None:
        """Learn from a drive from ``start`` to ``goal``.

        Args:
            start: Where it began.
            goal: Where it ended.
            seconds: How long it took, planning included.
            straight: Metres between the two places in a straight line.
            metres: Length of the planned path; None: not known.
        """
        if start == goal or not is_drive(seconds, straight):
            return
        expected = self.expected(start, goal, straight)
        if expected > 0.0:
            self.errors.append(seconds / expected)
        self.metres[start, goal] = metres if metres else self.metres.get((start, goal), straight)
        self.drives.setdefault((start, goal), deque(maxlen=DRIVES_REMEMBERED)).append(seconds)
        self._forget()

    def expected(self, start: str, goal: str, straight: float) -> float:
        """Return the seconds that the leg is expected to take.

        Args:
            start: Where it begins.
            goal: Where it ends.
            straight: Metres between the two places in a straight line.
        """
        # Every decision asks for every leg; a drive or another speed changes them.
        asked = start, goal, straight
        found = self._expected.get(asked)
        if found is None:
            found = self._expected[asked] = self._estimated((start, goal), straight)
        return found

    def _estimated(self, leg: Leg, straight: float) -> float:
        back = leg[::-1]
        prediction = self._predicted(leg, straight)
        if back in self.drives and leg not in self.drives:
            leg = back
        own = self.drives.get(leg)
        if not own:
            return prediction
        return robust_mean(own, prediction, prior=1.0)

    def _forget(self) -> None:
        self._fit = None
        self._expected.clear()

    @property
    def spread(self) -> float:
        """Standard deviation of driven over predicted time."""
        return spread_of(self.errors)

    def _predicted(self, leg: Leg, straight: float) -> float:
        overhead, pace = self._line()
        metres = self.metres.get(leg) or self.metres.get((leg[1], leg[0])) or straight
        return max(overhead + pace * metres, 1e-3)

    def _line(self) -> tuple[float, float]:
        """Overhead in seconds and seconds per metre, fitted to all drives."""
        if self._fit is None:
            # The prior: no overhead, the configured speed; as sure as one drive of a usual leg.
            usual, weight = 5.0, 1.0
            legs = [
                (self.metres[leg], float(len(seconds)), median(seconds))
                for leg, seconds in self.drives.items()
            ]
            overhead, pace = 0.0, 1.0 / self.speed
            for _ in range(ROUNDS):
                n, sx, sxx = weight, weight * usual, 1.25 * weight * usual**2
                sy, sxy = sx / self.speed, sxx / self.speed
                for x, count, seconds in legs:
                    expected = overhead + pace * x
                    # Of a leg that was driven once, another one of its length tells more.
                    within = HUBER * PRIOR_SPREAD * expected * count
                    w = count * within / max(within, abs(seconds - expected))
                    n, sx, sxx = n + w, sx + w * x, sxx + w * x * x
                    sy, sxy = sy + w * seconds, sxy + w * seconds * x
                before = overhead, pace
                pace = (n * sxy - sx * sy) / (n * sxx - sx * sx)
                overhead = (sy - pace * sx) / n
                if pace <= 0.0 or overhead < 0.0:
                    overhead, pace = 0.0, sxy / sxx
                if abs(pace - before[1]) + abs(overhead - before[0]) / usual < 1e-4 * pace:
                    break
            self._fit = overhead, pace
        return self._fit

    def used(self, start: str, goal: str, straight: float) -> float:
        """Return the expected seconds as maps use them: they follow in steps of `CHANGE`."""
        expected = self.expected(start, goal, straight)
        used = self._used.get((start, goal), 0.0)
        if abs(expected - used) > CHANGE * expected:
            used = self._used[start, goal] = float(f'{expected:.3g}')
        return used

    def forget_fit(self, speed: float) -> None:
        """Take another configured speed."""
        if speed != self.speed:
            self.speed = speed
            self._forget()

    def to_json(self) -> dict[str, Any]:
        """Return what was learned, to be kept in a file."""
        legs = [[*leg, self.metres[leg], list(drives)] for leg, drives in self.drives.items()]
        return {'legs': legs, 'errors': list(self.errors)}

    def restore(self, kept: Mapping[str, Any]) -> int:
        """Take what `to_json` gave; return how many values no robot can have, which are left out.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        left_out = 0
        for start, goal, metres, drives in kept['legs']:
            leg = str(start), str(goal)
            seconds = [float(value) for value in drives]
            if not all(0.0 < value < math.inf for value in (*seconds, float(metres))):
                raise ValueError(f'times of {start} to {goal}: expected finite and positive')
            # A path is longer than the straight line that new drives are compared with.
            likely = [value for value in seconds if is_drive(value, 0.0)]
            left_out += len(seconds) - len(likely)
            if likely:
                self.metres[leg] = float(metres)
                self.drives[leg] = deque(likely, maxlen=DRIVES_REMEMBERED)
        errors = [float(value) for value in kept['errors']]
        if not all(0.0 < value < math.inf for value in errors):
            raise ValueError('errors: expected finite and positive numbers')
        self.errors.extend(errors)
        self._forget()
        return left_out


def is_drive(seconds: float, metres: float) -> bool:
    """Tell whether a robot can drive some metres in some seconds."""
    return 0.0 < seconds <= SLOWEST and metres <= FASTEST * seconds


@dataclass
class DrawEstimate:
    """How fast the battery falls, learned from its level whenever that is heard.

    The level is known in whole percents. Between two moments at which it changes the fall is
    exact. One that no battery can have is a jump of the level.
    """

    _rates: deque[float] = field(default_factory=lambda: deque(maxlen=FALLS_REMEMBERED))
    _mark: tuple[float, float] | None = None

    def observe(self, time: float, level: float) -> None:
        """Take the level at a time; charging begins anew."""
        if self._mark is None or level > self._mark[1] or time <= self._mark[0]:
            self._mark = (time, level)
            return
        fallen = self._mark[1] - level
        if fallen >= LEARNED_FALL:
            rate = fallen / (time - self._mark[0])
            if rate <= FASTEST_FALL:
                self._rates.append(rate)
            self._mark = (time, level)

    @property
    def draw(self) -> Draw:
        """The mean and the spread of the last rates; the mean is 0 while nothing is known."""
        rates = list(self._rates)
        if not rates:
            return Draw()
        middle = median(rates)
        # Standing and driving differ: what lies within that is averaged.
        spread = max(PRIOR_SPREAD * middle, 1.4826 * median(abs(each - middle) for each in rates))
        within = 2.0 * HUBER * spread
        rate = fmean(min(max(each, middle - within), middle + within) for each in rates)
        return Draw(rate, spread_of([each / rate for each in rates]))

    def to_json(self) -> list[float]:
        """Return the rates, to be kept in a file."""
        return list(self._rates)

    def restore(self, rates: Iterable[float]) -> int:
        """Take rates that `to_json` gave; return how many no battery can have.

        Raises:
            ValueError, TypeError: It is something else.
        """
        given = [float(rate) for rate in rates]
        likely = [rate for rate in given if 0.0 < rate <= FASTEST_FALL]
        self._rates.extend(likely)
        return len(given) - len(likely)


@dataclass
class LearnedTimes:
    """What the robot has learned, kept in a file beside the mission record.

    The file is ``<record>.experience.json``: `of_record` makes it from the parameter ``record``.
    Whoever decides reads it when it starts and writes it after each decision, so that a mission
    that goes on (``launch.py --resume``, or a node that was started again) knows the visits, the
    leg times and the battery's draw of before. To take them to another run, copy the file with
    the record.

    Attributes:
        file: Where it is kept.
        visited_at: When the robot was in each place last, seconds on the mission's clock.
        leg_times: How long the legs take.
        draw: How fast the battery falls.
        charge: How fast the stations charge.
        sent_to_charge: Why the robot was sent to charge and has not been charged since.
        requested: Where an operator wants the robot, and it has not been since; empty: nowhere.
        now: The last time that was told, seconds on the clock of the visits.
        problem: What is wrong with the file; empty: nothing.
        left_out: What of it was not taken.
        elapsed: Tells seconds as they pass, which shows when the clock is set; None: nobody does.
    """

    file: KeptFile = field(default_factory=KeptFile)
    visited_at: dict[str, float] = field(default_factory=dict)
    leg_times: LegTimes = field(default_factory=LegTimes)
    draw: DrawEstimate = field(default_factory=DrawEstimate)
    charge: ChargeEstimate = field(default_factory=ChargeEstimate)
    sent_to_charge: str = ''
    requested: str = ''
    now: float = 0.0
    problem: str = ''
    left_out: str = ''
    elapsed: Callable[[], float] | None = None
    _passed: float | None = None

    @classmethod
    def of_record(cls, record: str) -> LearnedTimes:
        """Return what was learned on the mission of a record; new for an empty name.

        The visits in the record itself count: they are on the clock of its end. A file that cannot
        be read counts as none; `problem` says what is wrong with it.
        """
        learned = cls(KeptFile.of_record(record, '.experience.json'))
        learned.problem = learned.file.read(learned._take) or learned.left_out
        if record and Path(record).is_file():
            try:
                account = account_in(record)
            except FileError as error:
                learned.problem = str(error)
                return learned
            learned.visited_at.update(account.visits)
            learned.now = account.now or 0.0
        return learned

    def _take(self, kept: dict[str, Any]) -> None:
        leg_times, draw, charge = LegTimes(), DrawEstimate(), ChargeEstimate()
        visits = {str(place): float(at) for place, at in kept['visits'].items()}
        if not all(math.isfinite(at) for at in visits.values()):
            raise ValueError('visits: expected finite times')
        left_out = leg_times.restore(kept['leg_times']) + draw.restore(kept['draw'])
        charge.restore(kept['charge'])
        sent_to_charge, requested = str(kept['sent_to_charge']), str(kept['requested'])
        self.visited_at, self.leg_times = visits, leg_times
        self.draw, self.charge = draw, charge
        self.sent_to_charge, self.requested = sent_to_charge, requested
        if left_out:
            self.left_out = f'{left_out} learned values that no robot can have are left out'

    def save(self) -> None:
        """Write the file, if anything has changed."""
        self.file.write(
            {
                'visits': {place: round(at, 3) for place, at in self.visited_at.copy().items()},
                'leg_times': self.leg_times.to_json(),
                'draw': self.draw.to_json(),
                'charge': self.charge.to_json(),
                'sent_to_charge': self.sent_to_charge,
                'requested': self.requested,
            }
        )

    def saw(self, place: str, now: float, *, came: float | None = None) -> None:
        """Note that the robot is in ``place``, or came there before and has left; seconds."""
        self.tell_time(now)
        at = now if came is None else min(came, now)
        # What was seen of it since it came there stays, unless that lies ahead of the clock.
        self.visited_at[place] = max(at, min(now, self.visited_at.get(place, at)))

    def tell_time(self, now: float) -> float:
        """Take the visits with a clock that was set, forget those of another simulation.

        Returns:
            By how much the clock was set since the last time, seconds; 0: not at all, or not
            noticed.
        """
        passed = None if self.elapsed is None else self.elapsed()
        jump = 0.0
        if passed is not None and self._passed is not None:
            jump = now - self.now - (passed - self._passed)
        latest = max((self.now, *self.visited_at.values()))
        if is_other_simulation(latest - SIMULTANEOUS, now):
            self.visited_at = on_present_clock(self.visited_at, latest, now)
        elif abs(jump) > SIMULTANEOUS:
            self.visited_at = {place: at + jump for place, at in self.visited_at.items()}
        elif now < latest - SIMULTANEOUS:
            self.visited_at = on_present_clock(self.visited_at, latest, now)
        self.now, self._passed = now, passed
        return jump if abs(jump) > SIMULTANEOUS else 0.0
