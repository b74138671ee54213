"""Several robots on a map in simulated time: who enters which place when.

As in `patrol_policy.simulation` a place is visited whenever a robot enters it. Robots do not hinder
each other. Each decides when it has arrived and explored, or has stayed as long as it wanted; what
all publish is known to all at once, unless a robot is silent.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from patrol_policy.fleet.assignment import FleetChoice, FleetRobot, FleetSettings, choose
from patrol_policy.graph import PatrolGraph


@dataclass(frozen=True)
class FleetView:
    """What a robot decides by.

    Attributes:
        graph: The map.
        robots: What all published last, by name.
        visited_at: The last visit of each place, seconds.
        now: Seconds.
        settings: How the work is shared.
    """

    graph: PatrolGraph
    robots: Mapping[str, FleetRobot]
    visited_at: Mapping[str, float]
    now: float
    settings: FleetSettings


FleetPolicy = Callable[[FleetView, str], FleetChoice]


def shared(view: FleetView, name: str) -> FleetChoice:
    """Choose by `assignment.choose`."""
    return choose(
        view.graph, list(view.robots.values()), name, view.now, view.settings, view.visited_at
    )


@dataclass(frozen=True)
class Outage:
    """A robot stands still and is silent from ``begin`` until ``end``, seconds."""

    robot: str
    begin: float
    end: float = math.inf


@dataclass(frozen=True)
class FleetBattery:
    """Every robot's battery, in time: how long it lasts and how long a full charge takes."""

    run_seconds: float
    charge_seconds: float

    def needed(self, runs_until: float, now: float) -> float:
        """Return how long a charge takes that begins now, seconds."""
        left = max(0.0, runs_until - now) / self.run_seconds
        return self.charge_seconds * max(0.0, 1.0 - left)

    def runs_until(self, before: float, seconds: float, now: float) -> float:
        """Return until when it lasts after a charge of so many seconds that ends now.

        Args:
            before: Until when it lasted.
            seconds: Of charging.
            now: Seconds.
        """
        left = max(0.0, before - (now - seconds)) + seconds * self.run_seconds / self.charge_seconds
        return now + min(left, self.run_seconds)


@dataclass
class FleetPatrol:
    """A fleet on a map.

    Args:
        graph: The map.
        starts: Where each robot begins, by name.
        policy: What each decides by.
        settings: How the work is shared.
        outages: When robots fail.
        battery: None: it never gets empty.

    Attributes:
        visits: Each visit: the time, the robot, the place.
        decisions: Each decision: the time, the robot, the choice.
        charges: Each charge: the robot, the dock, the begin, the end.
        strandings: Times that a battery was empty away from a dock.
    """

    graph: PatrolGraph
    starts: Mapping[str, str]
    policy: FleetPolicy = shared
    settings: FleetSettings = field(default_factory=FleetSettings)
    outages: Sequence[Outage] = ()
    battery: FleetBattery | None = None

    def __post_init__(self) -> None:
        self.now = 0.0
        if self.battery is not None:
            ratio = self.battery.charge_seconds / self.battery.run_seconds
            self.settings = replace(self.settings, charge_ratio=ratio)
        self.robots = {
            name: FleetRobot(
                name,
                place,
                runs_until=self.battery.run_seconds if self.battery else None,
            )
            for name, place in self.starts.items()
        }
        self.visited_at = dict.fromkeys(self.graph.places, 0.0)
        self.visits: list[tuple[float, str, str]] = []
        self.decisions: list[tuple[float, str, FleetChoice]] = []
        self.charges: list[tuple[str, str, float, float]] = []
        self.strandings = 0
        # Due times, in the order of names where they are the same, and the places ahead.
        self._due = [(0.0, name) for name in sorted(self.starts)]
        heapq.heapify(self._due)
        self._ahead: dict[str, list[str]] = {name: [] for name in self.starts}
        self._failed: set[str] = set()
        self._slots: dict[str, tuple[float, float]] = {}
        self._charging: dict[str, float] = {}

    def until(self, end: float) -> None:
        """Go on until ``end``, seconds."""
        while self._due and self._due[0][0] < end:
            self.now, name = heapq.heappop(self._due)
            if (out := self._outage(name)) is None:
                self._step(name)
            elif math.isfinite(out.end):
                self._ahead[name] = []
                self._failed.add(name)
                heapq.heappush(self._due, (out.end, name))
        self.now = end

    def longest_waits(self, begin: float, end: float | None = None) -> dict[str, float]:
        """Return the longest time each place waited from ``begin`` on, seconds, up to now or
        ``end``.

        The wait that lasts at ``begin`` counts from there, and the one at the end up to there.
        """
        end = self.now if end is None else end
        waits = dict.fromkeys(self.graph.places, 0.0)
        last = dict.fromkeys(self.graph.places, begin)
        for at, _, place in self.visits:
            if begin <= at <= end:
                waits[place] = max(waits[place], at - last[place])
                last[place] = at
        for robot in self.robots.values():
            # Where a robot stands nothing waits.
            if self._standing(robot):
                last[robot.place] = end
        return {place: max(wait, end - last[place]) for place, wait in waits.items()}

    def longest(self, begin: float, end: float | None = None) -> float:
        """Return the longest time that any place waited from ``begin`` on, seconds."""
        return max(self.longest_waits(begin, end).values())

    def _standing(self, robot: FleetRobot) -> bool:
        return not self._ahead[robot.name] and self._outage(robot.name) is None

    def _outage(self, name: str) -> Outage | None:
        for outage in self.outages:
            if outage.robot == name and outage.begin <= self.now < outage.end:
                return outage
        return None

    def _hear(self) -> None:
        """Note that each robot that does not fail was heard now."""
        for name, robot in self.robots.items():
            out = self._outage(name)
            heard = self.now if out is None else out.begin
            if robot.heard_at != heard:
                robot = self.robots[name] = replace(robot, heard_at=heard)
            if self.battery is not None and robot.runs_until is not None:
                needed = self.battery.needed(robot.runs_until, self.now)
                self.robots[name] = replace(robot, charge_seconds=needed)

    def _step(self, name: str) -> None:
        """Enter the next place of the way, or decide anew."""
        robot = self.robots[name]
        if name in self._failed:
            # It is back, and begins anew where it stands.
            self._failed.discard(name)
            robot = self.robots[name] = replace(
                robot, heard_since=self.now, since=self.now, cell=None
            )
        if self._ahead[name]:
            place = self._ahead[name].pop(0)
            self._visit(name, place)
            robot = self.robots[name] = replace(robot, place=place, since=self.now)
            if robot.runs_until is not None and self.now > robot.runs_until + 1e-6:
                self.strandings += 1
            if self._ahead[name]:
                self._drive(name)
                return
        if self.battery is not None and robot.charging_until is not None:
            if robot.dock != robot.place:
                raise ValueError(f'{name} is to charge at {robot.dock} and is at {robot.place}')
            assert robot.runs_until is not None
            begin, longest = self._slots[name]
            if name not in self._charging:
                # It waits for its slot, and for the robot that still charges.
                begin = max(
                    begin,
                    *(end for _, dock, _, end in self.charges if dock == robot.place),
                    self.now,
                )
                if begin > self.now:
                    heapq.heappush(self._due, (begin, name))
                    return
                seconds = min(longest, self.battery.needed(robot.runs_until, self.now))
                end = self.now + seconds
                self.charges.append((name, robot.place, self.now, end))
                self.robots[name] = replace(robot, since=self.now, charging_until=end)
                self._charging[name] = seconds
                heapq.heappush(self._due, (end, name))
                return
            seconds = self._charging.pop(name)
            robot = self.robots[name] = replace(
                robot,
                charging_until=None,
                dock=None,
                since=self.now,
                runs_until=self.battery.runs_until(robot.runs_until, seconds, self.now),
            )
        self._visit(name, robot.place)
        self._decide(name)

    def _decide(self, name: str) -> None:
        self._hear()
        view = FleetView(self.graph, self.robots, self.visited_at, self.now, self.settings)
        choice = self.policy(view, name)
        self.decisions.append((self.now, name, choice))
        changes = replace(self.robots[name], cell=choice.cell or self.robots[name].cell)
        if choice.slot is not None:
            longest = (
                choice.slot.end - choice.slot.begin
                if choice.place == self.robots[name].place
                else math.inf
            )
            self._slots[name] = choice.slot.begin, longest
            changes = replace(changes, dock=choice.slot.dock, charging_until=choice.slot.end)
        self.robots[name] = changes
        place = changes.place
        if choice.place != place:
            self._ahead[name] = list(self.graph.route(place, choice.place))
            self._drive(name)
        elif choice.slot is not None:
            heapq.heappush(self._due, (self.now, name))
        else:
            # A policy that names no time looks around where it is again and again.
            until = choice.until or self.now
            heapq.heappush(self._due, (until if until > self.now else self.now + 1.0, name))

    def _drive(self, name: str) -> None:
        seconds = self.graph.move(self.robots[name].place, self._ahead[name][0])
        heapq.heappush(self._due, (self.now + seconds, name))

    def _visit(self, name: str, place: str) -> None:
        self.visited_at[place] = self.now
        self.visits.append((self.now, name, place))
