"""A fleet on hosts of its own, with links that are cut, lose and delay, and hosts that go down.

Used by `fleet.py --hosts`. Each host is a network namespace (`hosts`). Its programs are started by
`launch.py` as docs/how-to/fleet.md shows it, and find the others by DDS over the links.
The simulated world stands for what is real around the robots: its links never fail. The ontology
has a host, and so has each robot.

What is counted:

- lost: the last visit in the robots' records that the ontology does not have
- invented: what the ontology or a record has as a visit while no robot was there
- twice URGENT: a place chosen as URGENT although another robot had just been there, after all had
  the time to hear of it
- left behind: a robot that decides nothing while the world goes on
- merged: real seconds from when the link is back until the ontology has every visit
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.campaign import CLOSE_IN_TIME, Launcher, events_of, visited_at
from benchmarks.hosts import Link, Network, may_be_made
from benchmarks.tables import table
from surveillance_runtime.discovery import launched_nodes

os.environ |= launched_nodes(os.environ, 'open')

import rclpy
from geometry_msgs.msg import PoseStamped

from floor_plans import RoomMap, read_place
from state_machines.exceptions import CallError
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import Decision
from surveillance_interfaces.srv import ArmorDirective, ReferenceName
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.testing import claim_domain

PLACE = Path(__file__).resolve().parents[1] / 'config' / 'seven_rooms.yaml'
SPEED = 3.0
"""Simulated seconds a second."""
LOSS, DELAY = 0.2, 0.2
HEARD_WITHIN = 20.0
"""After so long without a fault all know of all, simulated seconds."""
THRESHOLD = 240.0
LEFT_BEHIND = 60.0
"""A robot that has decided nothing for so long is left behind, simulated seconds."""
START_PATIENCE, MERGE_PATIENCE = 90.0, 90.0
"""Real seconds."""
WORLD, ONTOLOGY = 'world', 'ontology'
NODES = {WORLD: 'simulator', ONTOLOGY: 'armor_server,ontology_map_builder'}


@dataclass
class _Stay:
    place: str
    begin: float
    end: float


class Onlooker:
    """Sees where the robots really are, and asks the ontology, from the world's host.

    Attributes:
        now: Simulated seconds.
        stays: Where each robot was, and when.
        decided: When each robot decided, and for how long it stays by that, seconds.
    """

    def __init__(self, robots: Sequence[str], domain: int) -> None:
        self._regions = RoomMap(read_place(PLACE).plan)
        self._places = sorted(read_place(PLACE).place.positions)
        self.now = 0.0
        self.stays: dict[str, list[_Stay]] = {name: [] for name in robots}
        self.decided: dict[str, list[tuple[float, float]]] = {name: [] for name in robots}
        self._sequence: dict[str, int] = {}
        self._context = rclpy.Context()
        rclpy.init(
            args=['--ros-args', '--log-level', 'fatal'], context=self._context, domain_id=domain
        )
        self._node = PatrolNode('onlooker', context=self._context, use_global_arguments=False)
        for name in robots:
            self._node.create_subscription(
                PoseStamped, f'{name}/ground_truth', partial(self._on_truth, name), SENSOR_QOS
            )
            self._node.create_subscription(
                Decision, f'{name}/decision', partial(self._on_decision, name), STATE_QOS
            )
        self._armor = ServiceCaller(self._node, ArmorDirective, 'armor_interface_srv')
        self._built = ServiceCaller(self._node, ReferenceName, 'ontology_map/built')
        self._spinner = ExecutorThread(self._context)
        self._spinner.executor.add_node(self._node)
        self._spinner.start()

    def close(self) -> None:
        """Leave the graph."""
        self._spinner.stop()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def _on_decision(self, name: str, message: Decision) -> None:
        if message.sequence != self._sequence.get(name):  # not one that is repeated
            self._sequence[name] = message.sequence
            self.decided[name].append((self.now, message.stay))

    def longest_pause(self, name: str, begin: float, end: float) -> float:
        """Return how long a robot decided nothing, while it did not stay by a decision."""
        free = begin
        longest = 0.0
        for at, stay in [*self.decided[name], (end, 0.0)]:
            if begin < at <= end:
                longest = max(longest, at - free)
            if at <= end:
                free = max(free, at + stay)
        return longest

    def _on_truth(self, name: str, message: PoseStamped) -> None:
        stamp, at = message.header.stamp, message.pose.position
        self.now = now = stamp.sec + 1e-9 * stamp.nanosec
        place, stays = self._regions.room_at(at.x, at.y), self.stays[name]
        if place is None:
            return
        if stays and stays[-1].place == place:
            stays[-1].end = now
        else:
            stays.append(_Stay(place, now, now))

    def was_there(self, place: str, at: float, within: float, robot: str = '') -> bool:
        """Tell whether a robot, or the one that is named, was in a place at a time."""
        return any(
            stay.place == place and stay.begin - within <= at <= stay.end + within
            for name, stays in self.stays.items()
            for stay in list(stays)
            if robot in ('', name)
        )

    def await_map(self) -> str:
        """Wait until the map is built; return the ontology's name."""
        return str(self._built.call(ReferenceName.Request(), START_PATIENCE).name)

    def visited_at(self, reference: str) -> dict[str, int]:
        """Return what the ontology has as each place's last visit, seconds.

        Raises:
            CallError: It does not answer.
        """
        return visited_at(self._armor, reference, self._places, 5.0)


@dataclass
class Fault:
    """What was done, and what came of it.

    Attributes:
        what: In words.
        seconds: Real.
        visits: Of each robot meanwhile.
        pauses: The longest time between two decisions of each robot meanwhile, simulated seconds.
        doubles: Places visited by two robots within 30 s meanwhile.
        merged: See above; None: not within `MERGE_PATIENCE`.
    """

    what: str
    seconds: float
    visits: dict[str, int] = field(default_factory=dict)
    pauses: dict[str, float] = field(default_factory=dict)
    doubles: int = 0
    merged: float | None = None


class FleetHosts:
    """The hosts and what runs on them.

    Args:
        robots: How many.
        folder: For logs and runs.
        speed: Simulated seconds a second.

    Attributes:
        lost, invented, twice, behind: What went wrong, in words.
        faults: Those that were made.
    """

    def __init__(self, robots: int, folder: Path, speed: float = SPEED) -> None:
        if not may_be_made():
            raise SystemExit('fleet: --hosts needs root, unshare, nsenter, ip and /dev/net/tun')
        self.folder = folder
        self.robots = [f'robot{number + 1}' for number in range(robots)]
        self._speed = speed
        self._domain = claim_domain()
        self.network = Network(2 + robots)
        self.hosts = dict(zip((WORLD, ONTOLOGY, *self.robots), self.network.hosts, strict=True))
        self._launchers: dict[str, Launcher] = {}
        self.lost: list[str] = []
        self.invented: list[str] = []
        self.twice: list[str] = []
        self.behind: list[str] = []
        self.faults: list[Fault] = []
        self._quiet: list[tuple[float, float]] = []
        self._quiet_since = 0.0
        self.hosts[WORLD].enter()
        self.onlooker = Onlooker(self.robots, self._domain)
        self._reference = ''

    # --- programs ---

    def begin(self, name: str) -> None:
        """Start the programs of a host; those that were killed go on with their run."""
        words = [
            '--robots',
            f'{len(self.robots)}',
            '--network',
            'open',
            '--only',
            NODES.get(name, name),
        ]
        words += ['--map', str(PLACE), '--record', str(self.folder / name)]
        words += ['-p', 'use_sim_time:=true', '--domain', str(self._domain)]
        if name == WORLD:
            words += ['-p', f'simulator:speed:={self._speed}']
        elif name != ONTOLOGY:
            words.append('--composed')
        self._launchers[name] = Launcher(
            words, self._domain, self.folder / f'{name}.log', on=self.hosts[name].words
        )

    def kill(self, name: str) -> None:
        """Have all that runs on a host end at once, as with a power failure."""
        launcher = self._launchers.pop(name)
        self.hosts[name].kill_all()
        launcher.end()

    def start(self) -> None:
        """Start all, and wait until each robot has visited a place."""
        for name in self.hosts:
            self.begin(name)
        self._reference = self.onlooker.await_map()
        deadline = time.monotonic() + START_PATIENCE
        while any(not self.visits(name) for name in self.robots):
            if time.monotonic() > deadline:
                raise SystemExit(f'fleet: not all robots have come to a place, see {self.folder}')
            time.sleep(0.2)

    def close(self) -> None:
        """End all and take the hosts down."""
        threads = [threading.Thread(target=each.end) for each in self._launchers.values()]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.onlooker.close()
        self.network.close()

    # --- what the robots have written ---

    def events(self, name: str, kind: str) -> list[Mapping[str, object]]:
        """Return the events of a kind in a robot's records."""
        return [
            event
            for run in sorted((self.folder / name).glob(f'*/{name}'))
            for event in events_of(run)
            if event.get('event') == kind
        ]

    def visits(self, name: str) -> list[tuple[float, str]]:
        """Return when a robot visited which place."""
        return [
            (float(str(event['time'])), str(event['place'])) for event in self.events(name, 'visit')
        ]

    def decisions(self, name: str) -> list[tuple[float, str, str]]:
        """Return when a robot decided for which place, and by which rule."""
        return [
            (float(str(event['time'])), str(event['place']), str(event['rule']))
            for event in self.events(name, 'decision')
        ]

    # --- faults ---

    def let(self, simulated: float) -> None:
        """Let simulated time pass."""
        end = self.onlooker.now + simulated
        deadline = time.monotonic() + 10.0 * simulated / self._speed + 30.0
        while self.onlooker.now < end:
            if time.monotonic() > deadline:
                raise SystemExit(f'fleet: time stands still, see {self.folder}')
            time.sleep(0.1)

    def links(self, *names: str) -> list[Link]:
        """Return the links between hosts and all others that can fail."""
        failing = [name for name in self.hosts if name != WORLD]
        found = {
            id(link): link
            for name in names
            for other in failing
            if other != name
            for link in [self.network.link(self.hosts[name], self.hosts[other])]
        }
        return list(found.values())

    def cut(self, seconds: float, *names: str) -> None:
        """Cut hosts off from all others, and from each other, for real seconds."""
        with self._fault(f'{", ".join(names)} cut off', seconds):
            self._set(self.links(*names), cut=True)
            time.sleep(seconds)
            self._set(self.links(*names), cut=False)

    def lose(self, seconds: float) -> None:
        """Have every link lose and delay frames."""
        links = self.links(ONTOLOGY, *self.robots)
        with self._fault(f'{LOSS:.0%} lost, {1000 * DELAY:.0f} ms each way', seconds):
            self._set(links, loss=LOSS, delay=DELAY)
            time.sleep(seconds)
            self._set(links, loss=0.0, delay=0.0)

    def fail(self, name: str, seconds: float) -> None:
        """Have a host go down, and come back after real seconds."""
        with self._fault(f'host of {name} down', seconds):
            self.kill(name)
            time.sleep(seconds)
            self.begin(name)

    def fail_cut_off(self, name: str, seconds: float) -> None:
        """Cut a host off, have it go down and come back while it is cut off: what it did only its
        files know.
        """
        with self._fault(f'{name} cut off, down and back, then joined', seconds):
            self._set(self.links(name), cut=True)
            time.sleep(seconds / 2.0)
            self.kill(name)
            time.sleep(2.0)
            self.begin(name)
            time.sleep(seconds / 2.0)
            self._set(self.links(name), cut=False)

    @staticmethod
    def _set(links: Sequence[Link], **values: float) -> None:
        for link in links:
            for name, value in values.items():
                setattr(link, name, value)

    @contextlib.contextmanager
    def _fault(self, what: str, seconds: float) -> Iterator[None]:
        self._quiet.append((self._quiet_since, self.onlooker.now))
        fault = Fault(what, seconds)
        begin = self.onlooker.now
        yield
        joined, end = time.monotonic(), self.onlooker.now
        made = {
            name: [visit for visit in self.visits(name) if visit[0] <= end] for name in self.robots
        }
        for name in self.robots:
            fault.visits[name] = sum(at >= begin for at, _ in made[name])
            fault.pauses[name] = self.onlooker.longest_pause(name, begin, end)
        fault.doubles = len(self._doubles(begin, end))
        fault.merged = self._merged(made, joined)
        self._quiet_since = self.onlooker.now
        self.faults.append(fault)
        merged = '-' if fault.merged is None else f'{fault.merged:.1f} s'
        print(
            f'{what}, {seconds:.0f} s: visits {fault.visits}, longest pause '
            f'{ {name: round(value) for name, value in fault.pauses.items()} }, '
            f'{fault.doubles} double, merged after {merged}',
            flush=True,
        )
        self.let(2.0 * HEARD_WITHIN)
        self.check()

    def _doubles(self, begin: float, end: float) -> list[tuple[float, str]]:
        everyone = sorted(
            (at, place, name)
            for name in self.robots
            for at, place in self.visits(name)
            if begin - 30.0 <= at <= end
        )
        found = []
        for number, (at, place, name) in enumerate(everyone):
            for before, where, other in everyone[:number]:
                if where == place and other != name and at - before < 30.0 and at >= begin:
                    found.append((at, place))
                    break
        return found

    def _merged(
        self, made: Mapping[str, Sequence[tuple[float, str]]], joined: float
    ) -> float | None:
        latest: dict[str, float] = {}
        for visits in made.values():
            for at, place in visits:
                latest[place] = max(at, latest.get(place, 0.0))
        while time.monotonic() < joined + MERGE_PATIENCE:
            with contextlib.suppress(CallError):
                said = self.onlooker.visited_at(self._reference)
                if all(said.get(place, -1) >= math.floor(at) for place, at in latest.items()):
                    return time.monotonic() - joined
            time.sleep(0.3)
        return None

    # --- judgement ---

    def check(self) -> None:
        """Compare what the ontology, the records and the world say."""
        looker, now = self.onlooker, self.onlooker.now
        said = looker.visited_at(self._reference)
        for name in self.robots:
            pause = looker.longest_pause(name, self._quiet_since, now)
            if pause > LEFT_BEHIND:
                self.behind.append(f'{now:.0f} s: {name} has decided nothing for {pause:.0f} s')
            decided = self.decisions(name)
            last = decided[-1][0] if decided else -math.inf
            for at, place in self.visits(name):
                if not looker.was_there(place, at, CLOSE_IN_TIME, name):
                    self.invented.append(f'{name} wrote of {place} at {at:.0f} s')
                # A visit is told with the next decision.
                if at < last and said.get(place, -1) < math.floor(at):
                    self.lost.append(
                        f'{now:.0f} s: {name} visited {place} at {at:.0f} s, and the ontology says '
                        f'{said.get(place)}'
                    )
        for place, when in said.items():
            if when > 0 and not looker.was_there(place, when, CLOSE_IN_TIME):
                self.invented.append(f'{now:.0f} s: the ontology has {place} at {when:.0f} s')
        self._look_for_twice()

    def _look_for_twice(self) -> None:
        quiet = [*self._quiet, (self._quiet_since, self.onlooker.now)]
        for name in self.robots:
            for at, place, rule in self.decisions(name):
                if rule != 'URGENT' or not any(a + HEARD_WITHIN < at < b for a, b in quiet):
                    continue
                for other in self.robots:
                    for visited, where in self.visits(other):
                        since = at - visited
                        if where == place and HEARD_WITHIN < since < THRESHOLD - 5.0:
                            self.twice.append(
                                f'{at:.0f} s: {name} to {place}, where {other} was {since:.0f} s '
                                'before'
                            )

    def passed(self) -> bool:
        """Tell whether nothing went wrong."""
        merged = all(fault.merged is not None for fault in self.faults)
        return merged and not (self.lost or self.invented or self.twice or self.behind)

    def print(self) -> None:
        """Print what came of all faults."""
        rows = [['fault', 'seconds', 'visits', 'longest pause (simulated)', 'double', 'merged']]
        for fault in self.faults:
            rows.append(
                [
                    *(fault.what, f'{fault.seconds:.0f}'),
                    ', '.join(str(count) for count in fault.visits.values()),
                    ', '.join(f'{pause:.0f} s' for pause in fault.pauses.values()),
                    f'{fault.doubles}',
                    'never' if fault.merged is None else f'{fault.merged:.1f} s',
                ]
            )
        print(table(rows))
        made = sum(len(self.visits(name)) for name in self.robots)
        wrong = {
            'lost': self.lost,
            'invented': self.invented,
            'twice URGENT': self.twice,
            'left behind': self.behind,
        }
        counts = ', '.join(f'{len(set(each))} {kind}' for kind, each in wrong.items())
        print(f'{len(self.faults)} faults in {self.onlooker.now:.0f} s, {made} visits: {counts}')
        for each in wrong.values():
            for line in dict.fromkeys(each):
                print(f'  {line}')


def fail_hosts(robots: int, *, quick: bool, keep: Path | None = None) -> int:
    """Print what faults of links and hosts cost a fleet of real programs; return the exit code."""
    folder = keep or Path(tempfile.mkdtemp(prefix='fleet-hosts-'))
    folder.mkdir(parents=True, exist_ok=True)
    fleet = FleetHosts(robots, folder)
    try:
        fleet.start()
        fleet.let(20.0)
        last = fleet.robots[-1]
        steps: list[Callable[[], None]] = [
            partial(fleet.cut, 5.0, last),
            partial(fleet.cut, 30.0, last),
            partial(fleet.lose, 30.0),
        ]
        if not quick:
            steps += [
                partial(fleet.cut, 120.0, last),
                partial(fleet.cut, 30.0, ONTOLOGY),
                partial(fleet.cut, 120.0, ONTOLOGY, *fleet.robots),
                partial(fleet.fail, last, 30.0),
                partial(fleet.fail, ONTOLOGY, 30.0),
                partial(fleet.fail_cut_off, last, 30.0),
            ]
        for step in steps:
            step()
    finally:
        fleet.close()
    fleet.print()
    if fleet.passed() and keep is None:
        shutil.rmtree(folder, ignore_errors=True)
    else:
        print(f'files in {folder}')
    return 0 if fleet.passed() else 1
