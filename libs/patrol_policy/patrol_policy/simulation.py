"""A patrol in simulated time: the map, the clock and the battery, without any robot.

The same rules and policies as on the robot choose every move. It is what the benchmark measures
and what the tests search for mistakes; thousands of moves take a second.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field

from patrol_policy.battery import Battery, BatteryLimits, ChargeCurve, Draw
from patrol_policy.decision import QUIET, RECHARGE, DecisionSettings, decide
from patrol_policy.graph import PatrolGraph
from patrol_policy.hours import NO_CALENDAR, Calendar
from patrol_policy.plan import Planner
from patrol_policy.rule_table import Priorities
from patrol_policy.situation import Decision, PolicyMemory, Situation

CORRIDOR, ROOM = 'CORRIDOR', 'ROOM'
QUIET_STEP = 300.0
"""Seconds that the robot stays at its station before it decides anew."""


@dataclass(frozen=True)
class SimulatedBattery:
    """A battery that falls evenly.

    Attributes:
        draw: Percent per second away from the station.
        charge: Percent per second at the station.
        limits: When to charge.
        keeps_reserve: Whether the draw is known, so that charging is planned and the way home
            counts, or only the fixed level.
    """

    draw: float
    charge: float = 1.0
    limits: BatteryLimits = field(default_factory=BatteryLimits)
    keeps_reserve: bool = True


@dataclass
class PatrolRun:
    """What a simulated patrol came to.

    Attributes:
        longest: The longest time any place went unvisited, seconds, the start included.
        settled: The longest time from one visit of a place to its next, seconds.
        mean: The time a place went unvisited, averaged over places and time, seconds.
        moves: Places entered.
        recharges: Times charged.
        strandings: Times the battery was empty away from the station.
        rules: Decisions by rule.
        waits: The longest time each place went unvisited, seconds.
    """

    longest: float = 0.0
    settled: float = 0.0
    mean: float = 0.0
    moves: int = 0
    recharges: int = 0
    strandings: int = 0
    rules: dict[str, int] = field(default_factory=dict)
    waits: dict[str, float] = field(default_factory=dict)


@dataclass
class Patrol:
    """A robot on a map.

    Args:
        graph: The map.
        priorities: Which places may be chosen.
        policy: Name of the policy.
        threshold: Seconds after which a place is URGENT.
        station: Where the robot starts and charges.
        battery: None: it never gets empty.
        own_thresholds: Of places that differ.
        calendar: The hours of the places.
        stations: Where it can charge; default: where it starts.
        began: When it starts, seconds since 1970.
        classes: Of each place; default: all are ROOMs, those with two ways or more CORRIDORs, too.
    """

    graph: PatrolGraph
    priorities: Priorities
    policy: str
    threshold: float
    station: str
    battery: SimulatedBattery | None = None
    _: KW_ONLY  # by name alone: the list grows
    own_thresholds: Mapping[str, float] = field(default_factory=dict)
    calendar: Calendar = NO_CALENDAR
    stations: tuple[str, ...] = ()
    began: float = 0.0
    classes: Mapping[str, frozenset[str]] = field(default_factory=dict)
    generator: random.Random = field(default_factory=lambda: random.Random(1))

    def __post_init__(self) -> None:
        self.place = self.station
        self.now = self.began
        self.level = 100.0
        self.target: str | None = None
        self.visited_at = dict.fromkeys(self.graph.places, self.began)
        self._memory = PolicyMemory(self.generator)
        self.settings = DecisionSettings(
            self.priorities,
            self.policy,
            self.threshold,
            self.stations or (self.station,),
            self.battery.limits if self.battery else BatteryLimits(),
        )
        self._seen: set[str] = set()
        self.run = PatrolRun()
        self.classes = self.classes or {
            place: frozenset((ROOM, CORRIDOR) if len(ways) > 1 else (ROOM,))
            for place, ways in self.graph.leg_seconds.items()
        }
        self._area = 0.0

    def world(self) -> Situation:
        """Return what the robot knows now."""
        return Situation(
            place=self.place,
            now=self.now,
            reachable=tuple(sorted(self.graph.leg_seconds[self.place])),
            classes=self.classes,
            visited_at=self.visited_at,
            graph=self.graph,
            threshold=self.threshold,
            target=self.target,
            priorities=self.priorities,
            own_thresholds=self.own_thresholds,
            since=self.began,
            openings=self.calendar.at(self.now),
            memory=self._memory,
        )

    @property
    def planner(self) -> Planner:
        """The plan that is followed.

        Raises:
            ValueError: The policy plans nothing ahead, or nothing was decided yet.
        """
        if not isinstance(self._memory.planner, Planner):
            raise ValueError(f'{self.policy} has no plan')
        return self._memory.planner

    def step(self) -> Decision:
        """Charge if need be, or move to the next place; return the decision behind it."""
        world = self.world()
        decision = decide(world, self.known_battery(), self.settings)
        if decision.rule == QUIET and decision.place == self.place:
            self.now += min(QUIET_STEP, world.openings.quiet_for or QUIET_STEP)
            self.visited_at[self.place] = self.now
        elif decision.rule in (RECHARGE, QUIET):
            self._go(decision.place, self._drive_seconds(decision.place))
            if decision.rule == RECHARGE:
                self._charge()
        else:
            self._go(decision.place, self.graph.move(self.place, decision.place))
        self.target = decision.target
        self.run.rules[decision.rule] = self.run.rules.get(decision.rule, 0) + 1
        return decision

    def until(self, end: float) -> Iterator[Decision]:
        """Go on until ``end``, seconds, and then counts what still waits."""
        while self.now < end:
            yield self.step()
        for place in self.graph.places:
            self._count_gap(place)
        self.run.mean = self._area / ((self.now - self.began) * len(self.graph.places))

    def known_battery(self) -> Battery:
        """Return what the robot knows of its battery."""
        if self.battery is None:
            return Battery()
        if not self.battery.keeps_reserve:
            return Battery(self.level)
        curve = ChargeCurve.even(self.battery.charge)
        curves = dict.fromkeys(self.settings.recharge_rooms, curve)
        return Battery(self.level, draw=Draw(self.battery.draw), curves=curves)

    def _drive_seconds(self, place: str) -> float:
        """Return the seconds to a station; nothing is explored on the way."""
        seconds, _ = self.graph.drive_home([place])
        return seconds[self.graph.index[self.place]]

    def _go(self, place: str, seconds: float) -> None:
        self.now += seconds
        if self.battery is not None:
            self.level -= self.battery.draw * seconds
            if self.level < 0.0:
                self.run.strandings += 1
                self.level = 0.0
        self._count_gap(place)
        self.visited_at[place] = self.now
        self.place = place
        self.run.moves += 1

    def _charge(self) -> None:
        assert self.battery is not None
        wanted = self.battery.limits.stop_recharge
        self.now += max(0.0, wanted - self.level) / self.battery.charge
        self.level = max(self.level, wanted)
        # While it charges the robot is there.
        self.visited_at[self.place] = self.now
        self.run.recharges += 1

    def _count_gap(self, place: str) -> None:
        gap = self.now - self.visited_at[place]
        self.run.waits[place] = max(self.run.waits.get(place, 0.0), gap)
        self.run.longest = max(self.run.longest, gap)
        if place in self._seen:
            self.run.settled = max(self.run.settled, gap)
        self._seen.add(place)
        self._area += gap * gap / 2.0
