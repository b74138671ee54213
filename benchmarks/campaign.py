#!/usr/bin/env python3
"""Kill, stop and end nodes of a whole mission at random, and compare it with the truth.

    .venv/bin/python benchmarks/campaign.py --quick
    .venv/bin/python benchmarks/campaign.py --hours 1 --seed 3 --behaviour patrol
    .venv/bin/python benchmarks/campaign.py --network --cuts 4

`python3 launch.py` runs the mission as it does for a user, in a ROS domain of its own. One or two
nodes at a time get SIGKILL, SIGSTOP or SIGTERM; now and then the launcher is killed with all it
started, and started again with `--resume`. A node that was hit is back when another process answers
for it. Now and then it is the whole machine: everything is stopped for a while and goes on, the
disk of the run is full, with `--clock-steps` the clock is set forward or back (`machine_faults`);
after that the next visit has to come within a minute. At the end three things must agree:

- the simulator's `ground_truth`: where the robot really was, and when;
- the mission's record: a visit that the truth does not know is *invented*; a visit that a reader
  saw once in the record and that is gone later is *lost*;
- the ontology's `visitedAt`: later than the record's last visit is *invented*, earlier is *lost*.

With `--twin` a second mission runs beside it, in a domain of its own, that nobody disturbs. The
first one's decisions are judged by it: the legs that it drove while all its nodes were there take
within 10 % of what the twin's take (in the median), and no place is chosen as URGENT that is not.
With `--steps-every 60` nothing else is done than to set the clock by an hour and by a second,
forward and back, once a minute.

The exit code is 1 when something was lost or invented, or a node stayed away, or processes are left
behind, or decisions differ from the twin's.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import ListParameters
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import UInt32

from benchmarks.decisions import Comparison, SetClock, compare, legs_of, wrongly_urgent
from benchmarks.hosts import Host, Network, may_be_made
from benchmarks.machine_faults import SmallDisk, SteppedClock
from benchmarks.processes import end_processes, memory_mb
from benchmarks.sizes import Size, sized_parser
from floor_plans import RoomMap, read_place
from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import ArmorDirective
from surveillance_runtime.discovery import prefer_quick_discovery
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.run_parameters import PLACES
from surveillance_runtime.testing import claim_domain

ENVIRON = dict(os.environ)
"""Of whoever began the campaign: the watcher chooses its own way of discovery later."""
STARTED = re.compile(r'started (\w+) \(process (\d+)\)')
STEPS = {
    'noticed': re.compile(r'\| (?:WARN: )?(\w+) died'),
    'started': STARTED,
    'ready': re.compile(r'(\w+) +\| ready$'),
}
"""The lines of the launcher that show how far the return of a node is."""
NEAR = 1.6
"""How far from a place's point the robot may be and count as having visited it, metres."""
CLOSE_IN_TIME = 4.0
"""By how much a record's time may differ from when the robot was there, seconds."""
SETTLED = 60.0
"""Seconds after its start from which a process's growth is watched."""
DISK = 300
"""Megabytes of the disk that is filled up."""
ASK_PERIOD = 0.1
"""Seconds between two requests to a node that may not be there yet."""
PATIENCE = 60.0
"""After how long a node that was hit counts as staying away, seconds."""
STEPS_OF_CLOCK = (3600, -3600, 1, -1)
"""By how much `--steps-every` sets the clock, seconds."""
ROBOT = ('simulator', 'motion_controller', 'planner_controller', 'battery_controller')
DESK = ('armor_server', 'ontology_map_builder', 'robot_behavior')
VISIT_PATIENCE = 120.0
"""Seconds that the next visit may take on a failing link."""
LOSS, DELAY = 0.2, 0.2
"""Of a frame in either direction: the chance that it is lost, and seconds that it takes."""
ALLOWED_SHARE, ALLOWED_SECONDS = 0.5, 5.0
"""What a campaign that passed has reached: share of undisturbed visits, seconds to go on."""


class Launcher:
    """`python3 launch.py` as a process, read line by line.

    Args:
        words: Its options.
        domain: The ROS domain.
        log: Where its output is kept.
        more: Further variables of its environment.
        on: Makes a command one for another host.

    Attributes:
        processes: The process id of each node that was started last.
        steps: When each of `STEPS` was seen last, by node, steady seconds.
    """

    def __init__(
        self,
        words: Sequence[str],
        domain: int,
        log: Path,
        more: Mapping[str, str] | None = None,
        on: Callable[..., list[str]] = lambda *command: list(command),
    ) -> None:
        environ = {**ENVIRON, **(more or {}), 'ROS_DOMAIN_ID': str(domain)}
        self.processes: dict[str, int] = {}
        self.steps: defaultdict[str, dict[str, float]] = defaultdict(dict)
        self.folder: Path | None = None
        self._log = log.open('a')
        self.steps['launcher']['started'] = time.monotonic()
        self.process = subprocess.Popen(
            on(sys.executable, str(ROOT / 'launch.py'), *words),
            cwd=ROOT,
            env=environ,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._log.write(line)
            self._log.flush()
            for step, pattern in STEPS.items():
                if seen := pattern.search(line):
                    self.steps[seen.group(1)][step] = time.monotonic()
            if found := STARTED.search(line):
                self.processes[found.group(1)] = int(found.group(2))
            elif self.folder is None and (found := re.search(r'files in (\S+)', line)):
                self.folder = ROOT / found.group(1)

    def end(self) -> None:
        """Stop the mission as Ctrl-C does."""
        end_processes([self.process], 20)
        self._thread.join(5)
        self._log.close()


class Watcher:
    """Sees the truth, and asks nodes whether they are there.

    Attributes:
        truth: (simulated seconds, x, y) of the robot, as the simulator has it.
        collisions: That the simulator counted.
    """

    def __init__(self, domain: int) -> None:
        prefer_quick_discovery()
        self.context = rclpy.Context()
        rclpy.init(
            args=['--ros-args', '--log-level', 'fatal'], context=self.context, domain_id=domain
        )
        self.node = Node('campaign', context=self.context, use_global_arguments=False)
        self.truth: list[tuple[float, float, float]] = []
        self.collisions = 0
        self.node.create_subscription(
            PoseStamped, 'ground_truth', self._on_truth, qos_profile_sensor_data
        )
        self.node.create_subscription(UInt32, 'collisions', self._on_collisions, STATE_QOS)
        self._armor = ServiceCaller(self.node, ArmorDirective, 'armor_interface_srv')
        self._clients: dict[str, Any] = {}
        self._spinning = ExecutorThread(self.context)
        self._spinning.executor.add_node(self.node)
        self._spinning.start()

    def close(self) -> None:
        """Leave the graph."""
        self._spinning.stop()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _on_truth(self, message: PoseStamped) -> None:
        stamp, at = message.header.stamp, message.pose.position
        self.truth.append((stamp.sec + 1e-9 * stamp.nanosec, at.x, at.y))

    def _on_collisions(self, message: UInt32) -> None:
        self.collisions = max(self.collisions, message.data)

    def answers(self, name: str, seconds: float = 1.0) -> bool:
        """Tell whether a node answers a request for its parameters, which is made repeatedly."""
        client = self._clients.get(name)
        if client is None:
            client = self.node.create_client(ListParameters, f'/{name}/list_parameters')
            self._clients[name] = client
        answered = threading.Event()
        pending = []
        deadline = time.monotonic() + seconds
        while not answered.is_set() and time.monotonic() < deadline:
            pending.append(client.call_async(ListParameters.Request()))
            pending[-1].add_done_callback(lambda _: answered.set())
            answered.wait(ASK_PERIOD)
        for future in pending:
            client.remove_pending_request(future)
        return answered.is_set()

    def visited_at(self, reference: str, places: Sequence[str]) -> dict[str, int]:
        """Return what the ontology has as each place's last visit, seconds."""
        return visited_at(self._armor, reference, places, 20.0)


def visited_at(
    armor: ServiceCaller, reference: str, places: Sequence[str], timeout: float
) -> dict[str, int]:
    """Return what the ontology has as each place's last visit, seconds.

    Args:
        armor: Calls the service for one directive.
        reference: The ontology's name.
        places: Of which it is asked; one that was never visited is missing in the answer.
        timeout: Of each call, seconds.

    Raises:
        CallError: It does not answer.
    """
    found = {}
    for place in places:
        request = ArmorDirective.Request()
        asked = request.armor_request
        asked.client_name, asked.reference_name = 'visited_at', reference
        asked.command, asked.primary_command_spec = 'QUERY', 'DATAPROP'
        asked.secondary_command_spec, asked.args = 'IND', ['visitedAt', place]
        values = armor.call(request, timeout).armor_response.queried_objects
        numbers = [int(each) for value in values for each in re.findall(r'"(-?\d+)"', value)]
        if numbers:
            found[place] = max(numbers)
    return found


@dataclass(frozen=True)
class Outage:
    """How long a node that was hit was away.

    Attributes:
        name: The node.
        steps: Seconds since the step before, for each of `STEPS` and for its first answer.
    """

    name: str
    steps: dict[str, float]

    @property
    def seconds(self) -> float:
        """The whole of it."""
        return sum(self.steps.values())


@dataclass
class Usage:
    """What a process held when it was looked at first, a minute after its start, and last."""

    name: str
    first_at: float
    first: tuple[float, int]
    last_at: float = 0.0
    last: tuple[float, int] = (0.0, 0)


@dataclass
class Results:
    """What the campaign saw."""

    hits: Counter[str] = field(default_factory=Counter)
    outages: list[Outage] = field(default_factory=list)
    away: list[str] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    invented: list[str] = field(default_factory=list)
    resumes: list[float] = field(default_factory=list)
    machine: list[tuple[str, float]] = field(default_factory=list)
    restarted: int = 0
    left_behind: list[str] = field(default_factory=list)
    usage: dict[tuple[int, float], Usage] = field(default_factory=dict)
    seen: dict[tuple[float, str], None] = field(default_factory=dict)
    collisions: int = 0
    urgent: list[str] = field(default_factory=list)
    legs: Comparison | None = None

    def passed(self) -> bool:
        """Tell whether nothing was lost, invented, away, left behind or decided otherwise."""
        wrong = self.away or self.lost or self.invented or self.left_behind or self.urgent
        return not wrong and (self.legs is None or self.legs.passed)

    def rows(self) -> list[tuple[str, str]]:
        """Return the table to print."""
        outages = [outage.seconds for outage in self.outages]
        longest = max(self.resumes, default=math.nan)
        median, late = _quantile(outages, 0.5), _quantile(outages, 0.99)
        return [
            ('hits', ', '.join(f'{kind} {count}' for kind, count in sorted(self.hits.items()))),
            ('nodes that stayed away', _named(self.away)),
            ('outage, median and p99', f'{median:.1f} s, {late:.1f} s'),
            *_steps(self.outages),
            ('start again after everything was killed, longest', f'{longest:.1f} s'),
            ('visits seen in the record', str(len(self.seen))),
            ('lost', _named(self.lost)),
            ('invented', _named(self.invented)),
            ('chosen as URGENT that was not', _named(self.urgent)),
            ('legs', 'no twin' if self.legs is None else str(self.legs)),
            ('collisions', str(self.collisions)),
            ('next visit after the machine was hit', _times(self.machine)),
            ('restarts by that', str(self.restarted)),
            ('growth of processes', _growth(self.usage.values())),
            ('processes left behind', _named(self.left_behind)),
        ]


def records(folder: Path) -> list[Path]:
    """Return the files of a run's mission record, oldest first."""
    return sorted(folder.glob('mission*.jsonl')) + sorted(folder.glob('mission/*.jsonl'))


def events_of(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the events of a run's mission record."""
    for path in records(folder):
        for line in path.read_text('utf-8', 'replace').splitlines():
            try:
                event = json.loads(line)
            except ValueError:
                continue  # the last line of a process that was killed while it wrote
            if isinstance(event, dict):
                yield event


def visits(folder: Path) -> list[tuple[float, str]]:
    """Return (simulated seconds, place) of every visit in a run's record."""
    return [
        (float(event['time']), str(event['place']))
        for event in events_of(folder)
        if event.get('event') == 'visit'
    ]


def _last_visits(folder: Path) -> dict[str, float]:
    """Return when each place was visited last, on the clock as it is at the record's end.

    The ontology is told of a visit with the next decision: one after which nothing was decided any
    more does not count.
    """
    last: dict[str, float] = {}
    arrived: dict[str, float] = {}
    before = 0.0
    for event in events_of(folder):
        back = max(0.0, before - event['time'])
        last, arrived = (
            {place: at - back for place, at in known.items()} for known in (last, arrived)
        )
        before = event['time']
        if event.get('event') == 'visit':
            arrived[event['place']] = before
        elif event.get('event') == 'decision':
            last.update(arrived)
            arrived.clear()
    return last


class Campaign:
    """One mission and what is done to it."""

    def __init__(self, chosen: argparse.Namespace, scratch: Path) -> None:
        self._chosen = chosen
        self._chance = random.Random(chosen.seed)
        self._domain = claim_domain()
        self._log = scratch / 'launch.log'
        self._disk = self._clock = None
        if SmallDisk.may_be_made():
            self._disk = SmallDisk(scratch / 'disk', DISK)
        if chosen.clock_steps and SteppedClock.may_be_made():
            self._clock = SteppedClock(scratch)
        self.watcher = Watcher(self._domain)
        self.results = Results()
        described = read_place(ROOT / 'config' / PLACES[chosen.behaviour])
        positions = described.place.positions
        self._positions = {name: (at[0], at[1]) for name, at in positions.items()}
        self._regions = RoomMap(described.plan) if described.plan.is_enclosed else None
        self._hits: list[tuple[float, float]] = []
        self._set_clock = SetClock()
        self._twin: Launcher | None = None
        if chosen.twin:
            words = ['--behaviour', chosen.behaviour, '--record', str(scratch / 'twin')]
            self._twin = Launcher(words, claim_domain(), scratch / 'twin.log')
        self.launcher = self._launch(())
        self._folder = self._wait_for_folder()

    def _launch(self, more: Sequence[str]) -> Launcher:
        words = ['--behaviour', self._chosen.behaviour, *more]
        if self._disk is not None:
            words += ['--record', str(self._disk.folder)]
        environ = {} if self._clock is None else self._clock.environ
        return Launcher(words, self._domain, self._log, environ)

    def _wait_for_folder(self) -> Path:
        deadline = time.monotonic() + 30.0
        while self.launcher.folder is None and time.monotonic() < deadline:
            time.sleep(0.05)
        if self.launcher.folder is None:
            raise SystemExit(f'campaign: the launcher did not start, see {self._log}')
        return self.launcher.folder

    def run(self, seconds: float) -> None:
        """Hit nodes and the machine until the time is over, then compare."""
        end = time.monotonic() + seconds
        self._await_all(PATIENCE)
        while time.monotonic() < end:
            every = self._chosen.steps_every
            time.sleep(every or self._chance.uniform(1.0, self._chosen.pause))
            self._read_record()
            self._note_usage()
            if every:
                self._step_clock(STEPS_OF_CLOCK[self.results.hits['clock step'] % 4])
                self.results.hits['clock step'] += 1
                continue
            begun = time.time()
            drawn = self._chance.random()
            if drawn < self._chosen.restarts:
                self._kill_everything()
            elif drawn < self._chosen.restarts + self._chosen.machine:
                self._hit_machine()
            else:
                self._hit_nodes()
            self._hits.append((begun, time.time()))
        self._await_all(PATIENCE)
        time.sleep(5.0)
        self._note_usage()
        self._compare()

    def _note_usage(self) -> None:
        now, launcher = time.monotonic(), self.launcher
        for name, process in {'launcher': launcher.process.pid, **launcher.processes}.items():
            began = launcher.steps[name]['started']
            if now - began < SETTLED or (held := _held(process)) is None:
                continue
            # Not by its number alone: the kernel gives it to others later.
            usage = self.results.usage.setdefault((process, began), Usage(name, now, held))
            usage.last_at, usage.last = now, held

    def _await_all(self, patience: float) -> None:
        deadline = time.monotonic() + patience
        names = list(self.launcher.processes) or ['robot_behavior']
        while time.monotonic() < deadline:
            if all(self.watcher.answers(name) for name in names):
                return
            names = list(self.launcher.processes) or names

    def _hit_nodes(self) -> None:
        chance = self._chance
        names = chance.sample(sorted(self.launcher.processes), 2 if chance.random() < 0.3 else 1)
        kind = chance.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM))
        # Before the hit: the successor may be there before this thread runs on.
        before = {name: self.launcher.processes[name] for name in names}
        began = time.monotonic()
        for name in names:
            try:
                os.kill(before[name], kind)
            except ProcessLookupError:
                continue
            self.results.hits[signal.Signals(kind).name] += 1

        def await_return(name: str) -> None:
            late = began + PATIENCE
            while self.launcher.processes[name] == before[name] and time.monotonic() < late:
                time.sleep(0.02)
            if self.watcher.answers(name, late - time.monotonic()):
                self.results.outages.append(self._outage(name, began, time.monotonic()))
            else:
                self.results.away.append(f'{name} after {signal.Signals(kind).name}')

        with ThreadPoolExecutor() as pool:
            list(pool.map(await_return, names))

    def _outage(self, name: str, began: float, answered: float) -> Outage:
        seen = {**self.launcher.steps[name], 'answers': answered}
        steps, last = {}, began
        for step in (*STEPS, 'answers'):
            # A step whose line was not read yet took no time of its own.
            at = min(answered, max(last, seen.get(step, last)))
            steps[step], last = at - last, at
        return Outage(name, steps)

    def _hit_machine(self) -> None:
        faults: dict[str, Callable[[], None]] = {'freeze': self._freeze}
        if self._disk is not None:
            faults['full disk'] = self._fill_disk
        if self._clock is not None:
            faults['clock step'] = lambda: self._step_clock(
                self._chance.choice((3600, 60, 5, -5, -60))
            )
        kind = self._chance.choice(sorted(faults))
        self.results.hits[kind] += 1
        before = dict(self.launcher.processes)
        faults[kind]()
        # The record may be behind: what was seen already does not count.
        visited, began = len(visits(self._folder)), time.monotonic()
        while len(visits(self._folder)) <= visited:
            if time.monotonic() - began > PATIENCE:
                self.results.away.append(f'the mission after {kind}')
                return
            time.sleep(0.1)
        self.results.machine.append((kind, time.monotonic() - began))
        self.results.restarted += sum(
            before[name] != process for name, process in self.launcher.processes.items()
        )
        self._await_all(PATIENCE)

    def _freeze(self) -> None:
        processes = [self.launcher.process.pid, *self.launcher.processes.values()]
        for kind, seconds in ((signal.SIGSTOP, self._chosen.freeze), (signal.SIGCONT, 0.0)):
            for process in processes:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, kind)
            time.sleep(seconds)

    def _fill_disk(self) -> None:
        assert self._disk is not None
        self._disk.fill()
        time.sleep(self._chosen.freeze)
        self._disk.free()

    def _step_clock(self, seconds: int) -> None:
        assert self._clock is not None
        self._clock.step(seconds)
        self._set_clock.steps.append((time.time(), float(self._clock.seconds)))

    def _kill_everything(self) -> None:
        self.results.hits['everything'] += 1
        began = time.monotonic()
        processes = [self.launcher.process.pid, *self.launcher.processes.values()]
        for process in processes:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self.launcher.end()
        self.launcher = self._launch(('--resume', str(self._folder)))
        self._wait_for_folder()
        while 'robot_behavior' not in self.launcher.processes or not self.watcher.answers(
            'robot_behavior'
        ):
            if time.monotonic() - began > PATIENCE:
                self.results.away.append('everything after SIGKILL')
                return
            time.sleep(0.05)
        self.results.resumes.append(time.monotonic() - began)
        self._await_all(PATIENCE)

    def _read_record(self) -> None:
        for visit in visits(self._folder):
            self.results.seen.setdefault(visit)

    def _compare(self) -> None:
        self._read_record()
        written = visits(self._folder)
        self.results.lost += [
            f'{place} at {at:.0f} s is gone from the record'
            for at, place in self.results.seen
            if (at, place) not in set(written)
        ]
        for at, place in written:
            if not self._was_there(place, at):
                self.results.invented.append(f'{place} at {at:.0f} s stands in the record')
        last = _last_visits(self._folder)
        for place, seconds in self.watcher.visited_at(
            'surveillance', list(self._positions)
        ).items():
            known = last.get(place)
            if known is None:
                if seconds > 0 and not self._was_there(place, seconds):
                    self.results.invented.append(f'{place} at {seconds} s stands in the ontology')
            elif seconds > known + 10.0 and not self._was_there(place, seconds):
                self.results.invented.append(
                    f'{place} at {seconds} s stands in the ontology, {known:.0f} s in the record'
                )
            elif seconds < known - CLOSE_IN_TIME:
                self.results.lost.append(
                    f'{place} at {known:.0f} s stands in the record, {seconds} s in the ontology'
                )

        self._judge()

    def _judge(self) -> None:
        """Judge the decisions, by those of the twin where there is one."""
        events = list(events_of(self._folder))
        self.results.urgent = wrongly_urgent(events, self._set_clock)
        if self._twin is not None and self._twin.folder is not None:
            twin = legs_of(list(events_of(self._twin.folder)), SetClock())
            self.results.legs = compare(legs_of(events, self._set_clock), twin, self._hits)

    def _was_there(self, place: str, at: float) -> bool:
        x, y = self._positions[place]
        regions = self._regions
        near = [
            math.hypot(px - x, py - y) < NEAR
            or (regions is not None and regions.room_at(px, py) == place)
            for seconds, px, py in self.watcher.truth
            if abs(seconds - at) < CLOSE_IN_TIME
        ]
        # Nobody looked at that time (the simulator itself was away): nothing can be said.
        return any(near) or not near

    def close(self) -> None:
        """Stop the mission, look for what is left of it, and leave."""
        self.launcher.end()
        if self._twin is not None:
            self._twin.end()
        self.results.collisions = self.watcher.collisions
        self.watcher.close()
        self.results.left_behind = list(_processes_of(self._folder))


@dataclass
class LinkResults:
    """What the campaign saw.

    Attributes:
        undisturbed, disturbed: Visits a minute.
        lost_frames: Share that was lost while the link was disturbed.
        visits: Seconds from each joining to the first visit after it.
        waits: Seconds until the mission went on.
    """

    undisturbed: float = 0.0
    disturbed: float = 0.0
    lost_frames: float = 0.0
    visits: list[float] = field(default_factory=list)
    waits: list[float] = field(default_factory=list)

    def passed(self) -> bool:
        """Tell whether the figures are as good as they have to be."""
        enough = self.disturbed >= ALLOWED_SHARE * self.undisturbed
        return enough and max(self.waits, default=0.0) <= ALLOWED_SECONDS

    def rows(self) -> list[tuple[str, str]]:
        """Return the table to print."""
        shown = ', '.join(
            f'{wait:.1f} s, {visit:.1f} s'
            for wait, visit in zip(self.waits, self.visits, strict=True)
        )
        return [
            ('visits a minute, undisturbed', f'{self.undisturbed:.1f}'),
            (f'with {LOSS:.0%} loss, {DELAY * 1000:.0f} ms each way', f'{self.disturbed:.1f}'),
            ('frames lost meanwhile', f'{self.lost_frames:.0%}'),
            ('joined again: mission goes on, first visit', shown or 'not tried'),
        ]


class LinkCampaign:
    """One mission on two hosts.

    The simulated robot and its controllers are on one host, ontology and behaviour on the other.
    First the visits are counted over an undisturbed link, then over one that loses and delays
    frames, then the hosts are cut off from each other, at any moment of a leg, and joined again.
    What counts then is when the mission goes on: when it decides anew, or the leg ends that it was
    on. How long the first visit takes, whose drive depends on the place, is told as well.

    Args:
        scratch: Folder for logs and runs.
        seed: Of the losses.
    """

    def __init__(self, scratch: Path, seed: int) -> None:
        if not may_be_made():
            raise SystemExit('campaign: --network needs root, unshare and /dev/net/tun')
        self._scratch = scratch
        self._chance = random.Random(seed)
        self._domain = claim_domain()
        self.network = Network(2, seed)
        robot, desk = self.network.hosts
        self._link = self.network.link(robot, desk)
        self._launchers = [
            self._launch(robot, 'robot', ROBOT),
            self._launch(desk, 'desk', DESK),
        ]

    def _launch(self, host: Host, name: str, nodes: Sequence[str]) -> Launcher:
        words = [
            '--network',
            'open',
            '--record',
            str(self._scratch / name),
            '--only',
            ','.join(nodes),
        ]
        return Launcher(words, self._domain, self._scratch / f'{name}.log', on=host.words)

    def run(self, seconds: float, cuts: int, cut_seconds: float) -> LinkResults:
        """Go through the phases; `seconds` for each of the first two."""
        results = LinkResults()
        self._await_visit()
        results.undisturbed = self._rate(seconds)
        link = self._link
        link.loss, link.delay = LOSS, DELAY
        link.passed = link.lost = 0
        results.disturbed = self._rate(seconds)
        results.lost_frames = link.lost / max(1, link.lost + link.passed)
        link.loss = link.delay = 0.0
        for _ in range(cuts):
            self._await_visit()
            time.sleep(self._chance.uniform(0.0, 10.0))
            link.cut = True
            time.sleep(cut_seconds)
            link.cut = False
            joined = time.time()
            self._await_visit()
            results.visits.append(time.time() - joined)
            steps = [float(each['time']) for each in (*self._of('decision'), *self._of('visit'))]
            results.waits.append(min(step for step in steps if step > joined) - joined)
        return results

    def _of(self, kind: str) -> list[dict[str, Any]]:
        return [
            event
            for folder in (self._scratch / 'desk').glob('*')
            for event in events_of(folder)
            if event.get('event') == kind
        ]

    def _await_visit(self) -> None:
        before, late = len(self._of('visit')), time.monotonic() + VISIT_PATIENCE
        while len(self._of('visit')) == before:
            if time.monotonic() > late:
                raise SystemExit(f'campaign: no visit in {VISIT_PATIENCE:g} s, see {self._scratch}')
            time.sleep(0.1)

    def _rate(self, seconds: float) -> float:
        """Return visits a minute."""
        before = len(self._of('visit'))
        time.sleep(seconds)
        return 60.0 * (len(self._of('visit')) - before) / seconds

    def close(self) -> None:
        """Stop both and take the hosts down."""
        for launcher in self._launchers:
            launcher.end()
        self.network.close()


def _processes_of(folder: Path) -> Iterator[str]:
    """Yield the processes whose command line names a folder."""
    for entry in Path('/proc').glob('[0-9]*'):
        with contextlib.suppress(OSError):
            words = (entry / 'cmdline').read_bytes().decode('utf-8', 'replace').split('\0')
            if (
                any(word.startswith(str(folder)) for word in words)
                and int(entry.name) != os.getpid()
            ):
                yield f'process {entry.name}: {" ".join(words)[:120]}'


def _held(process: int) -> tuple[float, int] | None:
    """Return megabytes of resident memory and open descriptors; None for a process that is gone."""
    try:
        descriptors = len(os.listdir(f'/proc/{process}/fd'))
    except OSError:
        return None
    resident = memory_mb(process)
    return (resident, descriptors) if resident else None


def _growth(usage: Iterable[Usage]) -> str:
    """Return in words which processes grew most, among those that were watched for long."""
    watched = [each for each in usage if each.last_at - each.first_at >= SETTLED]
    if not watched:
        return 'none lived long enough'
    most = max(watched, key=lambda each: each.last[0] - each.first[0])
    files = max(watched, key=lambda each: each.last[1] - each.first[1])
    return (
        f'{len(watched)} watched; most: {most.name} {most.last[0] - most.first[0]:+.1f} MB in '
        f'{most.last_at - most.first_at:.0f} s, '
        f'{files.name} {files.last[1] - files.first[1]:+d} descriptors'
    )


def _quantile(values: Sequence[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else math.nan


def main(words: Sequence[str] | None = None) -> int:
    """Run a campaign, print its table, return the exit code."""
    parser = sized_parser(
        __doc__,
        quick='25 s of hits',
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument('--hours', type=float, default=0.1)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--behaviour', choices=tuple(PLACES), default='surveillance')
    parser.add_argument('--pause', type=float, default=8.0, help='longest pause between hits, s')
    parser.add_argument('--restarts', type=float, default=0.1, help='share of hits on everything')
    parser.add_argument(
        '--network',
        action='store_true',
        help='two hosts whose link fails; root only',
    )
    parser.add_argument('--cuts', type=int, default=2, help='with --network: cuts of 120 s')
    parser.add_argument('--machine', type=float, default=0.15, help='share of hits on the machine')
    parser.add_argument('--clock-steps', action='store_true', help='set the clock, too')
    parser.add_argument(
        '--twin', action='store_true', help='judge the decisions by a second mission'
    )
    parser.add_argument(
        '--steps-every', type=float, default=0.0, help='only set the clock, each so many seconds'
    )
    parser.add_argument('--freeze', type=float, default=30.0, help='how long those last, s')
    parser.add_argument('--keep', type=Path, default=ROOT / 'runs', help='folder for the log')
    chosen = parser.parse_args(words)
    chosen.clock_steps |= chosen.steps_every > 0.0
    if chosen.size is not Size.FULL:
        chosen.hours, chosen.pause, chosen.freeze = (
            chosen.size.of(0.0, 25.0, 1.0) / 3600.0,
            3.0,
            4.0,
        )
    chosen.keep.mkdir(parents=True, exist_ok=True)
    scratch = chosen.keep / time.strftime('campaign-%Y%m%d-%H%M%S')
    scratch.mkdir()
    results: Results | LinkResults
    if chosen.network:
        results = run_on_two_hosts(chosen, scratch)
    else:
        campaign = Campaign(chosen, scratch)
        results = campaign.results
        try:
            campaign.run(chosen.hours * 3600.0)
        finally:
            campaign.close()
    rows = [*results.rows(), ('log', str(scratch))]
    width = max(len(title) for title, _ in rows)
    for title, figure in rows:
        print(f'{title:{width}}  {figure}')
    return 0 if results.passed() else 1


def run_on_two_hosts(chosen: argparse.Namespace, scratch: Path) -> LinkResults:
    """Run the campaign on a failing link."""
    seconds, cuts, cut_seconds = (
        (20.0, 0, 0.0) if chosen.size is not Size.FULL else (120.0, chosen.cuts, 120.0)
    )
    campaign = LinkCampaign(scratch, chosen.seed)
    try:
        return campaign.run(seconds, cuts, cut_seconds)
    finally:
        campaign.close()


def _times(what: Sequence[tuple[str, float]]) -> str:
    return ', '.join(f'{kind} {seconds:.1f} s' for kind, seconds in what) or 'not tried'


def _steps(outages: Sequence[Outage]) -> Iterator[tuple[str, str]]:
    """Yield a row for each node: the median seconds of each step of its return."""
    for name in sorted({outage.name for outage in outages}):
        own = [outage for outage in outages if outage.name == name]
        medians = {
            step: _quantile([outage.steps[step] for outage in own], 0.5) for step in own[0].steps
        }
        steps = ', '.join(f'{step} {seconds:.1f}' for step, seconds in medians.items())
        yield f'  {name} ({len(own)})', f'{steps} s'


def _named(what: Sequence[str]) -> str:
    return f'{len(what)}' + ''.join(f'\n    {each}' for each in what[:12])


if __name__ == '__main__':
    sys.exit(main())
