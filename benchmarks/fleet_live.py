"""What the programs of a fleet do in a simulated place with people, judged from the truth.

Used by `fleet.py --live`. Each robot's whole stack runs (`fleet_stack`); time goes as fast as all
keep up. Seen from outside:

- collisions: a robot ran into something, a person or another robot
- standing: a robot did not move by 0.1 m for more than 30 s, by what it said it was at: `drives`
  (it was on its way), `traffic` (it waited for another robot), `dock` (it waited for a station);
  staying by the plan, exploring and charging are none
- double: a place that a robot was heading for was entered by it within 30 s after another robot
  that was heading for it, too; where the plan itself has robots there more often, within half of
  that
"""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from nav_msgs.msg import Odometry

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.fleet_stack import CONFIG, FleetStack
from benchmarks.tables import table
from floor_plans.facts import graph_over_doors
from patrol_policy.fleet.partition import fleet_plan
from surveillance_interfaces.msg import Decision, FleetRobot
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

__all__ = ['CONFIG', 'compare_places', 'patrol']

STANDS, MOVED, DOUBLE = 30.0, 0.1, 30.0
SPEED = 0.6
FLEET_DEPTH = 200


@dataclass
class _Seen:
    """What is seen of one robot."""

    anchor: tuple[float, float] = (math.inf, math.inf)
    since: float = 0.0
    why: Counter[str] = field(default_factory=Counter)
    place: str | None = None
    target: str = ''
    at: str = 'drives'
    collisions: int = 0


class FleetWatch:
    """Looks on from outside.

    Attributes:
        now: Simulated time, seconds.
        visits: Each place entered that the robot was heading for: time, robot, place.
        doubles: Those of them that came too soon after another robot's: time, robot, other, place.
        entered: How many places were entered.
        standing: Each time a robot stood for too long: from, seconds, robot, at what.
        collided: Each collision: time, robot, where.
        choices: The rules of all decisions.
    """

    def __init__(self, stack: FleetStack) -> None:
        self._stack = stack
        self._world = stack.robots.world
        self._changed = threading.Condition()
        self.now = 0.0
        self.visits: list[tuple[float, str, str]] = []
        self.doubles: list[tuple[float, str, str, str]] = []
        self.standing: list[tuple[float, float, str, str]] = []
        self.collided: list[tuple[float, str, tuple[float, float]]] = []
        self.entered = 0
        self.choices: Counter[str] = Counter()
        self._last: dict[str, tuple[float, str]] = {}
        self._waits: dict[str, float] = defaultdict(float)
        self._seen = {name: _Seen() for name in stack.names}
        plan = self._world.plan
        graph = graph_over_doors(plan)
        tour = fleet_plan(graph, len(stack.names))
        self._soon = {
            stop: min(DOUBLE, 0.5 * group.wait / SPEED)
            for group in tour.groups
            for stop in group.stops
        }
        node = stack.observer
        first = stack.names[0]
        node.create_subscription(Odometry, f'{first}/odom', self._on_step, SENSOR_QOS)
        node.create_subscription(FleetRobot, 'fleet_robots', self._on_fleet, FLEET_DEPTH)
        for name in stack.names:
            node.create_subscription(
                Decision, f'{name}/decision', partial(self._on_decision, name), STATE_QOS
            )

    def until(self, simulated: float, patience: float = 120.0) -> None:
        """Wait until a simulated time.

        Raises:
            TimeoutError: Time stood still for `patience` real seconds.
        """
        with self._changed:
            while self.now < simulated:
                before = self.now
                if not self._changed.wait(patience) and self.now == before:
                    raise TimeoutError(
                        f'time stands still at {before:.1f} s'
                    ) from self._stack.error

    def longest_wait(self, begin: float) -> tuple[float, str]:
        """Return the longest time from ``begin`` on that a place was without a robot, and which."""
        longest = {
            place: max(wait, self.now - max(begin, self._last.get(place, (0.0, ''))[0]))
            for place, wait in {**dict.fromkeys(self._soon, 0.0), **self._waits}.items()
            if all(seen.place != place for seen in self._seen.values())
        }
        longest = {**self._waits, **longest}
        place = max(longest, key=lambda name: longest[name])
        return longest[place], place

    def _on_decision(self, name: str, message: Decision) -> None:
        seen = self._seen[name]
        self.choices[message.rule] += 1
        seen.target = message.target or message.place
        if message.rule == 'recharge':
            seen.at = 'charges'
        elif message.rule == 'wait' and 'the station in' in message.reason:
            seen.at = 'dock'
        elif message.rule == 'wait' and message.stay:
            seen.at = 'traffic'
        elif message.stay:
            seen.at = 'stays'
        else:
            seen.at = 'drives'

    def _on_fleet(self, message: FleetRobot) -> None:
        if message.robot in self._seen and message.stop:
            self._seen[message.robot].target = message.stop

    def _on_step(self, message: Odometry) -> None:
        stamp = message.header.stamp
        now = stamp.sec + 1e-9 * stamp.nanosec
        for robot in self._stack.robots.robots:
            self._look(now, robot.name, robot.base.pose[:2], robot.base.collisions)
        with self._changed:
            self.now = now
            self._changed.notify_all()

    def _look(self, now: float, name: str, at: tuple[float, float], collisions: int) -> None:
        seen = self._seen[name]
        if collisions > seen.collisions:
            seen.collisions = collisions
            self.collided.append((now, name, at))
        place = self._world.place_at(*at)
        if place is not None and place != seen.place:
            self._enter(now, name, place)
            seen.place = place
        if math.dist(at, seen.anchor) > MOVED:
            self._end_standing(now, name)
            seen.anchor, seen.since = at, now
            seen.why.clear()
        seen.why[seen.at] += 1

    def _end_standing(self, now: float, name: str) -> None:
        seen = self._seen[name]
        if now - seen.since > STANDS and seen.why:
            self.standing.append(
                (seen.since, now - seen.since, name, seen.why.most_common(1)[0][0])
            )

    def _enter(self, now: float, name: str, place: str) -> None:
        self.entered += 1
        before = self._last.get(place)
        self._waits[place] = max(self._waits[place], now - (before[0] if before else 0.0))
        seen = self._seen[name]
        if place == seen.target and seen.at in ('drives', 'stays'):
            self.visits.append((now, name, place))
            for at, other, where in reversed(self.visits[:-1]):
                if now - at > self._soon[place]:
                    break
                if where == place and other != name:
                    self.doubles.append((now, name, other, place))
                    break
        self._last[place] = now, name

    def close(self) -> None:
        """Count what lasts."""
        for name in self._seen:
            self._end_standing(self.now, name)

    def begin(self) -> None:
        """Count from now on: all drive."""
        self.standing.clear()
        self.visits.clear()
        self.doubles.clear()
        self._waits.clear()
        self._last = dict.fromkeys(self._soon, (self.now, ''))

    def of_standing(self, *kinds: str) -> list[tuple[float, float, str, str]]:
        """Return the standing times of some kinds."""
        return [each for each in self.standing if each[3] in kinds]


@dataclass(frozen=True)
class LiveRun:
    """A run's figures.

    Attributes:
        seconds: Simulated.
        took: Real seconds.
        watch: What was seen.
    """

    seconds: float
    took: float
    watch: FleetWatch


def patrol(
    place: Path,
    count: int,
    seconds: float,
    people: int = 2,
    seed: int = 1,
    folder: Path | None = None,
    assignments: Sequence[str] = (),
) -> LiveRun:
    """Let a fleet patrol and return what was seen.

    Args:
        place: The place's file.
        count: How many robots.
        seconds: Simulated, from when all drive.
        people: How many walk about; they look where they go, and stop before a robot.
        seed: Of the people and all noise.
        folder: Where the robots write.
        assignments: Further parameters.
    """
    stack = FleetStack(
        count,
        place,
        (
            f'simulator:people.count:={people}',
            f'simulator:random_seed:={seed}',
            *assignments,
        ),
        folder=folder,
    )
    watch = FleetWatch(stack)
    try:
        stack.start()
        while min(robot.base.travelled for robot in stack.robots.robots) < 0.5:
            watch.until(watch.now + 1.0)
        watch.begin()
        begin, began = watch.now, time.monotonic()
        next_word = began
        try:
            while watch.now < begin + seconds:
                watch.until(min(watch.now + 10.0, begin + seconds))
                if time.monotonic() > next_word:
                    next_word += 60.0
                    took = time.monotonic() - began
                    print(
                        f'{watch.now - begin:.0f} s at {(watch.now - begin) / max(took, 1.0):.2f}: '
                        f'{len(watch.collided)} collisions, '
                        f'{len(watch.of_standing("drives", "traffic", "dock"))} standing, '
                        f'{len(watch.doubles)} of {len(watch.visits)} double',
                        flush=True,
                    )
        except (KeyboardInterrupt, TimeoutError) as error:
            print(f'ended early: {error}')
        took = time.monotonic() - began
        watch.close()
        return LiveRun(watch.now - begin, took, watch)
    finally:
        stack.close()


def compare_places(places: Sequence[Path], count: int, seconds: float, people: int) -> None:
    """Print the figures of a fleet in each place."""
    rows = [
        [
            *('place', 'robots', 'people', 'simulated', 'rate', 'collisions', 'drives', 'traffic'),
            *('dock', 'stays', 'visits', 'double', 'longest wait'),
        ]
    ]
    for place in places:
        run = patrol(place, count, seconds, people)
        watch = run.watch
        wait, where = watch.longest_wait(0.0)
        standing = Counter(kind for *_, kind in watch.standing)
        share = len(watch.doubles) / max(1, len(watch.visits))
        rows.append(
            [
                *(place.stem, f'{count}', f'{people}', f'{run.seconds:.0f} s'),
                *(f'{run.seconds / run.took:.2f}', f'{len(watch.collided)}'),
                *(f'{standing[kind]}' for kind in ('drives', 'traffic', 'dock', 'stays')),
                *(f'{len(watch.visits)}', f'{100.0 * share:.1f} %', f'{wait:.0f} s in {where}'),
            ]
        )
        for begin, lasted, robot, kind in watch.of_standing('drives', 'traffic', 'dock'):
            print(f'  {begin:.0f} s: {robot} stood for {lasted:.0f} s ({kind})')
        for at, robot, point in watch.collided:
            print(f'  {at:.1f} s: {robot} touched something at ({point[0]:.2f}, {point[1]:.2f})')
    print(table(rows))
