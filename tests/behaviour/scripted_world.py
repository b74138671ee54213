"""A robot, a map and an ontology as plain Python behind the machines' ports, with faults on demand.

Time is a number that the clock moves on when the machine waits; a mission of hours takes
milliseconds.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from floor_plans.parameters import AT_STATION
from patrol_policy.decision import NowhereToGoError
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError, UnavailableError
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.decision_maker import DecisionMaker
from surveillance_behaviour.learned_times import LearnedTimes
from surveillance_behaviour.mission.mission import Mission, MissionSettings
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_behaviour.ports import Point, Ports, UnknownPlaceError
from surveillance_ontology.robot_ontology import Snapshot
from tests.places import SEVEN_ROOMS

POSITIONS = {
    'R1': (10.0, 5.0, 0.0),
    'R2': (15.0, 5.0, 0.0),
    'R3': (10.0, 15.0, 0.0),
    'R4': (15.0, 15.0, 0.0),
    'E': (5.0, 10.0, 0.0),
    'C1': (10.0, 8.0, 0.0),
    'C2': (10.0, 14.0, 0.0),
}


class ScriptedClock:
    """Time that moves on by waiting; what is due on the way happens."""

    def __init__(self) -> None:
        self.time = 0.0
        self.limit = math.inf
        self.on_limit: Callable[[], None] = lambda: None
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._count = itertools.count()

    def now(self) -> float:
        return self.time

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        self._due.append((self.time + seconds, next(self._count), action))
        self._due.sort(key=lambda entry: entry[:2])

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        end = self.time + max(0.0, seconds)
        while not interrupt.is_set():
            if self.time >= self.limit:
                self.limit = math.inf
                self.on_limit()
                continue
            if self._due and self._due[0][0] <= end:
                due, _, action = self._due.pop(0)
                self.time = max(self.time, due)
                action()
                continue
            if end <= self.limit:
                self.time = end
                return True
            self.time = self.limit
        return False


@dataclass
class World:
    """The robot's surroundings, and all of the machines' ports in one object.

    Attributes:
        rooms: Doors of each room.
        is_silent: Whether an ontology that did not answer still does not.
        faults: Called with the name of each port method before it works; may raise, or change the
            world.
        seen_at: When the robot came to the place that the ontology has, nanoseconds: it has left
            it since, and is in none; 0: it is there.
        station_points: Where the stations are that are not at the points of their rooms.
        speed: Metres per second.
        draw: Percent per second away from the station; there it charges with ``charge``.
    """

    rooms: dict[str, list[str]] = field(default_factory=lambda: dict(SEVEN_ROOMS))
    positions: dict[str, Point] = field(default_factory=lambda: dict(POSITIONS))
    start_place: str = 'E'
    stations: tuple[str, ...] = ('E',)
    station_points: dict[str, Point] = field(default_factory=dict)
    speed: float = 1.0
    draw: float = 0.0
    charge: float = 2.0
    low_below: float = 20.0
    faults: Callable[[str], None] = lambda call: None
    is_silent: bool = False
    seen_at: int = 0

    def __post_init__(self) -> None:
        self.clock = ScriptedClock()
        self.battery = BatteryMonitor()
        self.level = 100.0
        self.battery.set_level(self.level)
        self.place = self.start_place
        self.is_in = self.start_place
        self.at: Point = self.positions[self.start_place]
        self.closed: set[str] = set()
        self.visited_at = dict.fromkeys(self.rooms, 0.0)
        self.threshold = 0.0
        self.built = True
        self.stranded = 0
        self.decisions: list[Decision] = []
        self.said: list[str] = []
        self.cries: list[str] = []
        self.arrivals: list[tuple[float, str]] = []
        self.calls: list[str] = []
        self.avoided: Callable[[], frozenset[str]] = frozenset
        self._tick()

    # The battery.

    def _tick(self) -> None:
        self.clock.after(1.0, self._tick)
        self.battery.set_charging(self.docked())
        self.set_level(self.level + (self.charge if self.docked() else -self.draw))

    def set_level(self, level: float) -> None:
        """Set the charge, and notice a robot that has none away from the station."""
        if level < 0.0 <= self.level:
            self.stranded += 1
        self.level = min(100.0, max(-1e-9, level))
        self.battery.set_level(float(max(0, round(self.level))))
        if (self.level < self.low_below) != self.battery.low:
            self.battery.set_low(self.level < self.low_below)

    # The ports.

    def _call(self, name: str, interrupt: Interrupt) -> None:
        self.calls.append(name)
        self.faults(name)
        if not self.clock.sleep(0.0, interrupt):
            raise CallInterruptedError

    def neighbours(self, place: str) -> tuple[str, ...]:
        """Return where the open doors of a place lead."""
        doors = set(self.rooms.get(place, ())) - self.closed
        return tuple(
            sorted(
                other
                for other, theirs in self.rooms.items()
                if other != place and doors & set(theirs)
            )
        )

    def urgent(self) -> set[str]:
        """Return the places that went unvisited for longer than the threshold."""
        now = int(self.clock.time)
        return {p for p, seen in self.visited_at.items() if now - int(seen) > self.threshold}

    def wait_until_built(self, interrupt: Interrupt) -> None:
        self._call('wait_until_built', interrupt)

    def answers(self) -> bool:
        self.calls.append('answers')
        return not self.is_silent

    def place_classes(self, interrupt: Interrupt) -> tuple[str, ...]:
        return ('LOCATION', 'ROOM', 'CORRIDOR', 'URGENT')

    def snapshot(
        self,
        now: float,
        classes: Sequence[str],
        visits: Mapping[str, float],
        interrupt: Interrupt,
        threshold: float | None = None,
        own_thresholds: Mapping[str, float] | None = None,
    ) -> Snapshot:
        self._call('snapshot', interrupt)
        self.threshold = self.threshold if threshold is None else threshold
        for place, at in visits.items():
            if place in self.rooms and int(at) > int(self.visited_at[place]):
                self.visited_at[place] = at
        urgent = self.urgent()
        members = {
            place: frozenset(
                ['ROOM']
                + ['CORRIDOR'] * (len(doors) > 1)
                + ['URGENT'] * (place in urgent and 'URGENT' in classes)
            )
            for place, doors in self.rooms.items()
        }
        return Snapshot(
            place=self.is_in,
            seen_at=self.seen_at,
            reachable=self.neighbours(self.is_in),
            classes=members,
            visited_at={place: float(int(self.visited_at[place])) for place in self.rooms},
            connections={place: self.neighbours(place) for place in self.rooms},
        )

    def reachable(self, interrupt: Interrupt) -> frozenset[str]:
        return frozenset(self.neighbours(self.is_in))

    def record_coverage(self, covered: Mapping[str, int], interrupt: Interrupt) -> None:
        self._call('record_coverage', interrupt)

    def await_place(self, place: str, seconds: float, interrupt: Interrupt) -> str:
        return '' if self.seen_at else self.is_in

    def position(self, place: str, interrupt: Interrupt) -> Point:
        self._call('position', interrupt)
        room, asked, _ = place.partition(AT_STATION)
        if asked and room in self.station_points:
            return self.station_points[room]
        if place not in self.positions or place not in self.rooms:
            raise UnknownPlaceError(f'ontology_map/room_position: there is no place {place}')
        return self.positions[place]

    def push(self, place: str) -> None:
        """Move the robot by hand; the battery notices within a second."""
        self.at, self.place = self.positions[place], place

    def docked(self) -> bool:
        """Tell whether the robot stands at a station."""
        points = {place: self.positions[place] for place in self.stations} | self.station_points
        return any(math.dist(self.at, point) < 1.0 for point in points.values())

    def plan_path(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        """Port of the planner."""
        self._call('plan', interrupt)
        middle = tuple((a + b) / 2 for a, b in zip(start, goal, strict=True))
        return [start, (middle[0], middle[1], middle[2]), goal]

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        self._call('follow', interrupt)
        return self._drive(path, interrupt)

    def _drive(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        for point in path:
            seconds = math.dist(self.at, point) / self.speed
            if not self.clock.sleep(seconds, interrupt):
                raise CallInterruptedError
            self.at = point
        self.battery.set_charging(self.docked())
        self.place = min(self.rooms, key=lambda room: math.dist(self.positions[room], self.at))
        self.is_in = self.place
        self.arrivals.append((self.clock.time, self.place))
        return self.at

    # The peers of `patrol`.

    def start(self, interrupt: Interrupt) -> None:
        self._call('start', interrupt)

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        self._call('control', interrupt)
        return self._drive(via_points, interrupt)

    def recharge(self, interrupt: Interrupt) -> None:
        self._call('recharge', interrupt)
        while self.level < 100.0 and self.docked():
            if not self.charge:
                raise CallError('recharge: nothing came from it for 60 s')
            if not self.clock.sleep(1.0, interrupt):
                raise CallInterruptedError

    def decided(self, decision: Decision) -> None:
        self.decisions.append(decision)

    def say(self, text: str, *, warning: bool = False) -> None:
        self.said.append(text)

    def waiting_for_help(self, reason: str) -> None:
        self.cries.append(reason)

    # The mission.

    def mission(
        self,
        settings: MissionSettings | None = None,
        record: MissionRecord | None = None,
        machine: str = 'surveillance',
        learned: LearnedTimes | None = None,
    ) -> Mission:
        """Return a mission in this world."""
        settings = settings or MissionSettings(settle_seconds=0.0)
        kind = ScriptedReasoner if machine == 'patrol' else DecisionMaker
        self.decision_maker = kind(
            settings.choice,
            self,
            self,
            self.battery,
            learned,
            warn=self.said.append,
            announce=self.decided,
        )
        self.decision_maker.world_of_test = self  # type: ignore[attr-defined]
        ports = Ports(
            ontology=self,
            places=self,
            announcer=self,
            reasoner=self.decision_maker,
            motion=ScriptedMotion(self),
            routine=ScriptedRoutine(self),
        )
        mission = Mission('scripted', settings, ports, self.battery, self.clock, record)
        self.avoided = lambda: mission.recovery.avoided(mission.now())
        self.decision_maker.learn_draw(self.clock.now)
        return mission


class ScriptedReasoner(DecisionMaker):
    """Decides in another process: what is called there may fail."""

    world_of_test: World

    def decide(
        self,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str] = frozenset(),
        *,
        to_charge: bool = False,
    ) -> Decision:
        self.world_of_test._call('reason', interrupt)
        try:
            return super().decide(now, interrupt, avoided, to_charge=to_charge)
        except NowhereToGoError as error:
            raise CallError(f'reason: {error}') from None


@dataclass
class ScriptedMotion:
    """Planner and controller; a port of its own, since `patrol` has another ``plan``."""

    world: World

    def plan(self, start: Point, goal: Point, interrupt: Interrupt) -> list[Point]:
        return self.world.plan_path(start, goal, interrupt)

    def follow(self, path: Sequence[Point], interrupt: Interrupt) -> Point:
        return self.world.follow(path, interrupt)

    def last_position(self) -> Point | None:
        return self.world.at

    def driven(self) -> list[Point]:
        return []


@dataclass
class ScriptedRoutine:
    """The peers of `patrol`."""

    world: World

    def start(self, interrupt: Interrupt) -> None:
        self.world.start(interrupt)

    def plan(self, target: str, interrupt: Interrupt) -> list[Point]:
        world = self.world
        return world.plan_path(world.at, world.position(target, interrupt), interrupt)

    def control(self, via_points: Sequence[Point], interrupt: Interrupt) -> Point:
        return self.world.control(via_points, interrupt)

    def recharge(self, interrupt: Interrupt) -> None:
        self.world.recharge(interrupt)


def started_again(message: str) -> UnavailableError:
    """Return the error of a peer that was lost and is there again."""
    return UnavailableError(message, lambda: True)


def fails(
    method: str,
    times: float = math.inf,
    reason: str = 'scripted fault',
    kind: Callable[[str], CallError] = CallError,
) -> Callable[[str], None]:
    """Return a fault: the first ``times`` calls of a port method fail."""
    left = [times]

    def fault(call: str) -> None:
        if call == method and left[0] > 0:
            left[0] -= 1
            raise kind(f'{method}: {reason}')

    return fault
