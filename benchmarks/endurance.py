"""Eight simulated hours of patrol while doors close, things stand about and the robot is pushed.

    python benchmarks/endurance.py [--hours 8] [--seed 1] [--map FILE] [--people 5] [--range 3]
        [--calm] [--quick]

Runs the whole stack in one process as fast as it goes, makes trouble through the simulator's
services, and watches from outside: collisions, the battery, what the ontology says about where the
robot is beside where it really is, how many drives arrive, and how long each place waits. Ctrl-C or
SIGTERM ends a run early; it reports what it saw. The exit code is 1 when something failed.
"""

from __future__ import annotations

import logging
import math
import random
import signal
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import Size, sized_parser
from benchmarks.whole_stack import ROOT, Stack
from floor_plans.facts import graph_over_doors
from state_machines.ros import ServiceCaller
from surveillance_behaviour.mission.mission_log import summarize
from surveillance_controllers.battery import BatteryParameters
from surveillance_interfaces.msg import FactChanges
from surveillance_interfaces.srv import (
    DrainBattery,
    PlaceObstacle,
    PushRobot,
    RemoveObstacle,
    SetDoor,
    SlipOdometry,
)
from surveillance_ontology.armor_client import CHANGES_QOS, CHANGES_TOPIC
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.event_log import RecordEntry, read_all
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.world.simulated_place import read_simulated_place

USUAL_SPEED = 0.45
"""Of a drive, m/s: acceleration, bends and doors included."""
SAY_EVERY = 600.0
"""Simulated seconds between two lines that say how far the run is."""
NEVER = 1e12
"""Seconds that no run lasts."""
LONGEST_WRONG = 2.0
"""Simulated seconds that the ontology may be wrong about the robot's place."""


class Watch:
    """Looks on from outside and notes what went wrong.

    Attributes:
        now: Simulated time, seconds.
        visits: How often the robot really entered each place.
        waits: Longest time each place went without the robot, seconds.
        wrong: Periods in which the ontology was wrong for too long: from, seconds, said, true.
        longest_wrong: The longest such period however short, seconds.
        collided: Times at which the robot ran into something.
        empty: Times at which the battery was empty away from the station.
        least_charge: Least charge seen away from the station, percent.
    """

    def __init__(self, stack: Stack) -> None:
        self._stack = stack
        self._world = stack.robot.world
        self._changed = threading.Condition()
        self._said: set[str] = set()
        self._wrong_since: float | None = None
        self._wrong_said = ''
        self._place: str | None = None
        self.now = 0.0
        self.visits: Counter[str] = Counter()
        self.waits = dict.fromkeys(self._world.plan.place.rooms, 0.0)
        self._left = dict.fromkeys(self._world.plan.place.rooms, 0.0)
        self.wrong: list[tuple[float, float, str, str]] = []
        self.longest_wrong = 0.0
        self.collided: list[float] = []
        self.empty: list[float] = []
        self.least_charge = 100.0
        node = stack.observer
        node.create_subscription(PoseStamped, 'ground_truth', self._on_pose, SENSOR_QOS)
        node.create_subscription(FactChanges, CHANGES_TOPIC, self._on_changes, CHANGES_QOS)
        node.create_subscription(BatteryState, 'battery_state', self._on_battery, STATE_QOS)

    @property
    def collisions(self) -> int:
        """How often the robot ran into something."""
        return self._stack.robot.base.collisions

    @property
    def unvisited(self) -> list[str]:
        """Places that the robot never was in."""
        return [place for place in self.waits if not self.visits[place]]

    def until(self, simulated: float, patience: float = 60.0) -> None:
        """Wait until a simulated time.

        Raises:
            TimeoutError: Time stood still for `patience` real seconds.
        """
        with self._changed:
            while self.now < simulated:
                before = self.now
                # Each pose that arrives notifies, so a wait that times out saw none.
                if not self._changed.wait(patience) and self.now == before:
                    raise TimeoutError(
                        f'time stands still at {before:.1f} s'
                    ) from self._stack.error

    def close(self) -> None:
        """Count the time since each place was left last."""
        for place, left in self._left.items():
            if place != self._place:
                self.waits[place] = max(self.waits[place], self.now - left)

    def _on_pose(self, message: PoseStamped) -> None:
        now = seconds_of(message.header.stamp)
        place = self._world.place_at(message.pose.position.x, message.pose.position.y)
        if place is not None and place != self._place:
            if self._place is not None:
                self._left[self._place] = now
            self.waits[place] = max(self.waits[place], now - self._left[place])
            self.visits[place] += 1
            self._place = place
        if self.collisions > len(self.collided):
            self.collided.append(now)
        self._judge(now)
        with self._changed:
            self.now = now
            self._changed.notify_all()

    def _judge(self, now: float) -> None:
        if not self._said or self._said == {self._place}:
            self._end_wrong(now)
            self._wrong_since = None
        elif self._wrong_since is None:
            self._wrong_since, self._wrong_said = now, ', '.join(sorted(self._said))

    def _end_wrong(self, now: float) -> None:
        if self._wrong_since is None:
            return
        lasted = now - self._wrong_since
        self.longest_wrong = max(self.longest_wrong, lasted)
        if lasted > LONGEST_WRONG:
            self.wrong.append((self._wrong_since, lasted, self._wrong_said, self._place or 'none'))

    def _on_changes(self, message: FactChanges) -> None:
        now = self.now
        for change in message.changes:
            if change.fact.predicate != 'isIn' or change.derived:
                continue
            place = change.fact.arguments[1]
            if change.added:
                self._end_wrong(now)
                self._wrong_since = None
                self._said.add(place)
            else:
                self._said.discard(place)
        self._judge(now)

    def _on_battery(self, message: BatteryState) -> None:
        percent = 100.0 * float(message.percentage)
        x, y, _ = next(iter(self._world.plan.stations.values())).pose
        robot = self._stack.robot.base.pose
        if math.dist(robot[:2], (x, y)) > 0.5:
            self.least_charge = min(self.least_charge, percent)
            if percent <= 0.0:
                self.empty.append(self.now)


class Trouble:
    """Makes trouble through the simulator's services.

    Attributes:
        made: How often each kind of trouble was made.
    """

    def __init__(self, stack: Stack, watch: Watch, rng: random.Random) -> None:
        self._stack = stack
        self._watch = watch
        self._rng = rng
        self._plan = stack.robot.world.plan
        self._undo: list[tuple[float, Callable[[], None]]] = []
        self._number = 0
        self.made: Counter[str] = Counter()
        self._callers = {
            kind: ServiceCaller(stack.observer, kind, f'simulation/{name}')
            for kind, name in (
                (SetDoor, 'set_door'),
                (PlaceObstacle, 'place_obstacle'),
                (RemoveObstacle, 'remove_obstacle'),
                (PushRobot, 'push_robot'),
                (SlipOdometry, 'slip_odometry'),
                (DrainBattery, 'drain_battery'),
            )
        }

    def make(self) -> str:
        """Make one trouble; return what it was."""
        kinds = (self._close_door, self._drop_obstacle, self._push, self._slip, self._drain)
        kind = self._rng.choices(kinds, weights=(4, 4, 3, 3, 1))[0]
        made = kind()
        self.made[made.split()[0]] += 1
        return made

    def mend(self) -> None:
        """Undo what has stood long enough."""
        now = self._watch.now
        for due, undo in [each for each in self._undo if each[0] <= now]:
            undo()
            self._undo.remove((due, undo))

    @property
    def next_mend(self) -> float:
        """Simulated time at which something is undone next, seconds."""
        return min((due for due, _ in self._undo), default=math.inf)

    def _call(self, kind: Any, **request: Any) -> bool:
        return bool(self._callers[kind].call(kind.Request(**request), timeout=30.0).success)

    def _later(self, shortest: float, longest: float, undo: Callable[[], object]) -> None:
        due = self._watch.now + self._rng.uniform(shortest, longest)
        self._undo.append((due, lambda: (undo(), None)[1]))

    def _close_door(self) -> str:
        robot = self._stack.robot.base.pose
        far = [
            name
            for name, door in self._plan.doors.items()
            if math.dist(robot[:2], (door.x, door.y)) > 1.0
            and self._stack.robot.world.is_open(name)
        ]
        if not far:
            return 'nothing'
        name = self._rng.choice(far)
        self._call(SetDoor, door=name, open=False)
        self._later(30.0, 180.0, lambda: self._call(SetDoor, door=name, open=True))
        return f'door {name} closed'

    def _drop_obstacle(self) -> str:
        place = self._rng.choice(list(self._plan.place.rooms))
        x, y, _ = self._plan.place.positions[place]
        angle, away = self._rng.uniform(0, math.tau), self._rng.uniform(0.8, 2.0)
        x, y = x + away * math.cos(angle), y + away * math.sin(angle)
        radius = self._rng.uniform(0.1, 0.3)
        world, robot = self._stack.robot.world, self._stack.robot.base.pose
        blocked = any(
            math.dist((x, y), (door.x, door.y)) < radius + 0.9 for door in self._plan.doors.values()
        )
        near = math.dist((x, y), robot[:2]) < radius + 0.8
        # It stands free, so that there is a way around it.
        if blocked or near or world.clearance(x, y) < radius + 0.6:
            return 'nothing'
        self._number += 1
        name = f'box{self._number}'
        self._call(PlaceObstacle, name=name, x=x, y=y, radius=radius)
        self._later(60.0, 300.0, lambda: self._call(RemoveObstacle, name=name))
        return f'obstacle {name} in {place}'

    def _push(self) -> str:
        angle, way = self._rng.uniform(0, math.tau), self._rng.uniform(0.2, 0.8)
        turn = self._rng.uniform(-0.8, 0.8)
        self._call(PushRobot, dx=way * math.cos(angle), dy=way * math.sin(angle), dyaw=turn)
        return f'push by {way:.2f} m and {turn:.2f} rad'

    def _slip(self) -> str:
        way, turn = self._rng.uniform(-0.5, 0.5), self._rng.uniform(-0.5, 0.5)
        self._call(SlipOdometry, dx=way, dy=0.0, dyaw=turn)
        return f'slip by {way:.2f} m and {turn:.2f} rad'

    def _drain(self) -> str:
        if self._watch.least_charge < 45.0:
            return 'nothing'
        self._call(DrainBattery, percent=10.0)
        return 'drain by 10 percent'


def capacity_for(place: Path, ranges: float) -> float:
    """Return the energy of ways from the station to the farthest place and home, Wh."""
    plan = read_simulated_place(place).plan
    graph = graph_over_doors(plan)
    home = plan.place.recharge_rooms[0]
    metres = max(graph.seconds(home, other) for other in plan.place.rooms)
    battery = BatteryParameters()
    joules_per_metre = battery.joules_per_metre + battery.rest_power / USUAL_SPEED
    return ranges * 2.0 * metres * joules_per_metre / 3600.0


def run(
    place: Path,
    seconds: float,
    seed: int,
    pause: tuple[float, float] = (40.0, 120.0),
    tell: Callable[[str], None] = lambda _: None,
    log_level: str = 'fatal',
    people: int = 0,
    ranges: float | None = None,
) -> tuple[Watch, Trouble, list[RecordEntry]]:
    """Patrol for simulated seconds with trouble every `pause` seconds.

    The seconds count from when the robot first drives. A KeyboardInterrupt ends them early.

    Args:
        place: The place's file.
        seconds: How long.
        seed: Of the trouble, the people and all noise.
        pause: Least and greatest time between two troubles, seconds.
        tell: Told each trouble.
        log_level: Of all nodes.
        people: How many walk about, who keep to their way (`pushy`).
        ranges: The battery lasts for so many ways to the farthest place and home; None: as it is.

    Returns:
        What was seen, what was made, and the mission's record until the seconds were over.
    """
    rng = random.Random(seed)
    parameters: dict[str, dict[str, Any]] = {
        'simulator': {'random_seed': seed, 'people.count': people, 'people.manner': 'pushy'}
    }
    if ranges is not None:
        parameters['battery_controller'] = {'battery.capacity': capacity_for(place, ranges)}
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / 'events.jsonl'
        parameters['robot_behavior'] = {'record': str(record)}
        stack = Stack(place, parameters, log_level=log_level)
        watch = Watch(stack)
        trouble = Trouble(stack, watch, rng)
        stack.start()
        try:
            _patrol(stack, watch, trouble, seconds, lambda: rng.uniform(*pause), tell)
        except KeyboardInterrupt:
            print('ended early')
        finally:
            ended = watch.now
            watch.close()
            stack.close()
        # The drive that the end of the run cuts off has neither arrived nor failed.
        return watch, trouble, [each for each in read_all(record) if each.time <= ended]


def _patrol(
    stack: Stack,
    watch: Watch,
    trouble: Trouble,
    seconds: float,
    pause: Callable[[], float],
    tell: Callable[[str], None],
) -> None:
    while stack.robot.base.travelled < 0.5:
        watch.until(watch.now + 1.0)
    end = watch.now + seconds
    next_trouble = watch.now + pause()
    begun, next_said = time.monotonic(), watch.now
    while watch.now < end:
        if watch.now >= next_said:
            next_said += SAY_EVERY
            print(
                f'{watch.now / 3600:.2f} simulated hours after {time.monotonic() - begun:.0f} s: '
                f'{watch.visits.total()} places entered, {watch.collisions} collisions, '
                f'least charge {watch.least_charge:.0f} %',
                flush=True,
            )
        watch.until(min(next_trouble, trouble.next_mend, next_said, end))
        trouble.mend()
        if watch.now >= next_trouble:
            tell(f'{watch.now:8.1f} s  {trouble.make()}')
            next_trouble = watch.now + pause()


def main() -> int:
    """Run and report."""
    parser = sized_parser(__doc__, quick='ten simulated minutes')
    parser.add_argument('--hours', type=float, default=8.0, help='simulated hours')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--map', type=Path, default=ROOT / 'config' / 'seven_rooms.yaml')
    parser.add_argument('--people', type=int, default=0, help='how many walk about')
    parser.add_argument(
        '--range', type=float, help='ways to the farthest place and home that a charge lasts for'
    )
    parser.add_argument('--calm', action='store_true', help='no trouble is made')
    parser.add_argument('--verbose', action='store_true', help='print each trouble')
    options = parser.parse_args()
    seconds = options.size.of(options.hours * 3600.0, 600.0, 30.0)
    logging.disable()
    begun = time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    watch, trouble, record = run(
        options.map,
        seconds,
        options.seed,
        pause=(NEVER, NEVER) if options.calm else (40.0, 120.0),
        tell=print if options.verbose else lambda _: None,
        people=options.people,
        ranges=options.range,
    )
    took = time.monotonic() - begun
    made = ', '.join(f'{kind} {count}' for kind, count in sorted(trouble.made.items()))
    print(f'{watch.now / 3600:.2f} simulated hours in {took:.0f} s, {watch.now / took:.1f} times')
    print(f'trouble made          {made}')
    at = ', '.join(f'{when:.1f} s' for when in watch.collided)
    print(f'collisions            {watch.collisions}{f" (at {at})" if at else ""}')
    print(f'empty away from home  {len(watch.empty)} (least charge {watch.least_charge:.0f} %)')
    print(
        f'wrong about its place {len(watch.wrong)} times for more than {LONGEST_WRONG:g} s', end=''
    )
    print(f' (longest {watch.longest_wrong:.1f} s)')
    for since, lasted, said, true in watch.wrong[:20]:
        print(f'  at {since:.1f} s for {lasted:.1f} s: {said} instead of {true}')
    summary = summarize(record)
    failures = [event for event in record if event.name == 'failure']
    visits = summary.visits.total()
    drives = visits + sum(event.text('what') != 'recharging' for event in failures)
    print(f'drives that arrive    {visits} of {drives}; {summary.recharges} recharges')
    for event in failures:
        print(f'  at {event.time:.1f} s: {event.text("what")}: {event.text("reason")}')
    print(f'{"place":<8} {"entered":>8} {"longest wait":>13}')
    for place, wait in watch.waits.items():
        print(f'{place:<8} {watch.visits[place]:>8} {wait:>11.0f} s')
    # Within half a minute nobody comes to all places.
    unvisited = options.size is not Size.SMOKE and watch.unvisited
    broken = watch.collisions or watch.empty or watch.wrong or unvisited
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
