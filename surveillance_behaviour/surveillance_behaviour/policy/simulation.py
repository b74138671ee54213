"""A patrol in simulated time: the map, the clock and the battery, without any robot.

The same rules and policies as on the robot choose every move. It is what the benchmark measures
and what the tests search for mistakes; thousands of moves take a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from surveillance_behaviour.policy.battery import BatteryLimits, reserve
from surveillance_behaviour.policy.graph import PatrolGraph
from surveillance_behaviour.policy.policies import Policy
from surveillance_behaviour.policy.rules import Rules, decide, decide_to_charge
from surveillance_behaviour.policy.situation import Decision, Situation

URGENT, CORRIDOR, ROOM = 'URGENT', 'CORRIDOR', 'ROOM'


@dataclass(frozen=True)
class Battery:
    """A battery that falls evenly.

    Attributes:
        draw: Percent per second away from the station.
        charge: Percent per second at the station.
        limits: When to charge.
        keeps_reserve: Whether the way home counts, or only the fixed level.
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
    """

    longest: float = 0.0
    settled: float = 0.0
    mean: float = 0.0
    moves: int = 0
    recharges: int = 0
    strandings: int = 0
    rules: dict[str, int] = field(default_factory=dict)


@dataclass
class Patrol:
    """A robot on a map.

    Args:
        graph: The map; a place with two ways or more is a CORRIDOR.
        rules: Which places may be chosen.
        policy: Which of them is.
        name: The policy's name.
        threshold: Seconds after which a place is URGENT.
        station: Where the robot starts and charges.
        battery: None: it never gets empty.
    """

    graph: PatrolGraph
    rules: Rules
    policy: Policy
    name: str
    threshold: float
    station: str
    battery: Battery | None = None

    def __post_init__(self) -> None:
        self.place = self.station
        self.now = 0.0
        self.level = 100.0
        self.target: str | None = None
        self.visited_at = dict.fromkeys(self.graph.places, 0.0)
        self._seen: set[str] = set()
        self.run = PatrolRun()
        self._classes = {
            place: frozenset((ROOM, CORRIDOR) if len(ways) > 1 else (ROOM,))
            for place, ways in self.graph.legs.items()
        }
        self._area = 0.0

    def situation(self) -> Situation:
        """What the robot knows now."""
        reachable = tuple(sorted(self.graph.legs[self.place]))
        urgent = {
            place: self._classes[place] | {URGENT}
            for place in reachable
            if self.now - self.visited_at[place] > self.threshold
        }
        return Situation(
            place=self.place,
            now=self.now,
            reachable=reachable,
            classes={**self._classes, **urgent},
            visited_at=self.visited_at,
            graph=self.graph,
            threshold=self.threshold,
            target=self.target,
            rules=self.rules.classes,
        )

    def step(self) -> Decision:
        """Charges if need be, or moves to the next place; the decision behind it."""
        situation = self.situation()
        if self._must_charge(situation):
            decision = decide_to_charge(situation, [self.station], 'battery low')
            self._go(decision.place)
            self._charge()
        else:
            decision = decide(situation, self.rules, self.policy, self.name)
            self._go(decision.place)
        self.target = decision.target
        self.run.rules[decision.rule] = self.run.rules.get(decision.rule, 0) + 1
        return decision

    def until(self, end: float) -> Iterator[Decision]:
        """Goes on until ``end``, seconds, and then counts what still waits."""
        while self.now < end:
            yield self.step()
        for place in self.graph.places:
            self._count_gap(place)
        self.run.mean = self._area / (self.now * len(self.graph.places))

    def _must_charge(self, situation: Situation) -> bool:
        if self.battery is None:
            return False
        limits = self.battery.limits
        draw = self.battery.draw if self.battery.keeps_reserve else 0.0
        level, _ = reserve(
            self.graph, self.place, situation.reachable, [self.station], draw, limits
        )
        return self.level <= level and not (self.place == self.station and self.level >= 99.0)

    def _go(self, place: str) -> None:
        seconds = self.graph.seconds(self.place, place)
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
        self.run.recharges += 1

    def _count_gap(self, place: str) -> None:
        gap = self.now - self.visited_at[place]
        self.run.longest = max(self.run.longest, gap)
        if place in self._seen:
            self.run.settled = max(self.run.settled, gap)
        self._seen.add(place)
        self._area += gap * gap / 2.0
