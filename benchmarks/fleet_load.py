"""What a fleet's programs cost: the ontology's server under ten robots, and time with eight stacks.

Used by `fleet.py --armor` and `fleet.py --composed`. Programs are started by `launch.py`, as a user
starts them. A call is measured beside a bare `std_srvs/Trigger` call to another process of the same
machine, in turn, so that whatever else the machine does slows both alike.
"""

from __future__ import annotations

import os
import random
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONFIG = ROOT / 'config'
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from benchmarks.tables import table
from floor_plans import read_place
from launcher.run import Run
from launcher.run_processes import node_environ
from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import ReferenceName
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.testing import claim_domain

TRIGGER = """
from std_srvs.srv import Trigger
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node

class Bare(PatrolNode):
    def __init__(self, **options):
        super().__init__('bare', **options)
        self.create_service(Trigger, 'bare', lambda _request, response: response)

run_node(Bare)
"""
STARTED = re.compile(r'started (\S+) \(process (\d+)\)')
CLASSES = ('URGENT', 'CORRIDOR', 'ROOM')
BETWEEN_DECISIONS, MOVES = 6.0, 2
"""Seconds between two decisions of a robot in the office, and the places it enters meanwhile."""
START_SECONDS = 300.0
TICKS = os.sysconf('SC_CLK_TCK')


class Launched:
    """A launch of the robot's programs in a domain of its own.

    Attributes:
        domain: That.
        processes: The number of each process, by its name in the log.
    """

    def __init__(self, words: Sequence[str], folder: Path) -> None:
        self.domain = claim_domain()
        self._log = folder / 'launch.txt'
        with open(self._log, 'wb') as log:
            self._process = subprocess.Popen(
                [
                    *(sys.executable, str(ROOT / 'launch.py'), *words),
                    *('--domain', str(self.domain), '--record', str(folder / 'runs'), '--fresh'),
                ],
                stdout=log,
                stderr=log,
            )

    @property
    def processes(self) -> dict[str, int]:
        """The number of each process that runs."""
        text = self._log.read_text(errors='replace')
        return {name: int(number) for name, number in STARTED.findall(text)}

    @property
    def text(self) -> str:
        """What was printed last."""
        return self._log.read_text(errors='replace')[-1500:]

    def close(self) -> None:
        """End all."""
        self._process.terminate()
        self._process.wait(60.0)


def cpu_seconds(process: int) -> float:
    """Return the seconds of processor time that a process has taken."""
    fields = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


@contextmanager
def bare_service(domain: int) -> Iterator[None]:
    """Run a service that does nothing, in a process of its own."""
    process = subprocess.Popen(
        [sys.executable, '-c', TRIGGER],
        env=node_environ(Run(domain=domain)),
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
    )
    try:
        yield
    finally:
        process.terminate()
        process.wait(30.0)


def armor_under(robots: int, seconds: float, place: Path) -> None:
    """Print what decisions and moves of so many robots cost in the server, and how long they take.

    Args:
        robots: How many; each is a client that decides and moves as often as one that drives.
        seconds: Of real time.
        place: The place's file.
    """
    plan = read_place(place).plan.place
    with tempfile.TemporaryDirectory(prefix='fleet-') as name:
        words = ['--map', str(place), '--robots', str(robots)]
        launched = Launched([*words, '--only', 'armor_server,ontology_map_builder'], Path(name))
        context = rclpy.Context()
        rclpy.init(args=[], context=context, domain_id=launched.domain)
        node = PatrolNode('onlooker', context=context, use_global_arguments=False)
        spinner = ExecutorThread(context)
        spinner.executor.add_node(node)
        spinner.start()
        try:
            with bare_service(launched.domain):
                built = ServiceCaller(node, ReferenceName, 'ontology_map/built')
                reference = built.call(ReferenceName.Request(), START_SECONDS).name
                bare = ServiceCaller(node, Trigger, 'bare')
                bare.call(Trigger.Request(), START_SECONDS)
                taken: dict[str, list[float]] = {'decision': [], 'move': [], 'bare': []}
                end = time.monotonic() + seconds

                def robot(number: int) -> None:
                    draw = random.Random(number)
                    own = f'robot{number + 1}'
                    armor = ArmorClient(node, own, reference, timeout=60.0)
                    ontology = RobotOntology(armor, own)
                    here = plan.start
                    time.sleep(draw.uniform(0.0, BETWEEN_DECISIONS))
                    while time.monotonic() < end:
                        for _ in range(MOVES):
                            time.sleep(BETWEEN_DECISIONS / MOVES * draw.uniform(0.8, 1.2))
                            doors = [door for door in plan.rooms[here] if len(plan.doors[door]) > 1]
                            sides = plan.doors[draw.choice(doors)]
                            here = sides[0] if sides[1] == here else sides[1]
                            began = time.perf_counter()
                            ontology.record_place(here, time.time_ns())
                            taken['move'].append(time.perf_counter() - began)
                        began = time.perf_counter()
                        now = time.time()
                        ontology.snapshot(now, CLASSES, visits={here: now}, threshold=240.0)
                        taken['decision'].append(time.perf_counter() - began)
                        began = time.perf_counter()
                        bare.call(Trigger.Request(), 60.0)
                        taken['bare'].append(time.perf_counter() - began)

                server = launched.processes['armor_server']
                before, began = cpu_seconds(server), time.monotonic()
                threads = [threading.Thread(target=robot, args=(n,)) for n in range(robots)]
                for thread in threads:
                    thread.start()
                for thread in threads:
                    thread.join()
                share = (cpu_seconds(server) - before) / (time.monotonic() - began)
        except Exception:
            print(launched.text)
            raise
        finally:
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown(context=context)
            launched.close()
    rows = [['round trip', 'calls', 'median', '90 %', '99 %']]
    for kind, times in taken.items():
        hundredths = [1000 * each for each in statistics.quantiles(times, n=100)]
        rows.append(
            [kind, f'{len(times)}', *(f'{hundredths[each - 1]:.1f} ms' for each in (50, 90, 99))]
        )
    print(table(rows))
    calls = len(taken['decision']) + len(taken['move'])
    print(
        f'{place.stem}, {robots} robots, {calls / seconds:.1f} calls a second: armor_server takes '
        f'{100 * share:.1f} % of a core'
    )


def spread(place: Path, robots: int, folder: Path) -> Path:
    """Return a copy of a place in which so many robots start in places far from each other.

    Beside one another at the station they would leave one after the other, by one door.
    """
    points = read_place(place).plan.place.positions
    names = sorted(points)
    chosen = [names[number * len(names) // robots] for number in range(robots)]
    lines = [
        f'      robot{number + 1}: {{start: [{points[name][0]}, {points[name][1]}, 0.0]}}'
        for number, name in enumerate(chosen)
    ]
    copy = folder / place.name
    copy.write_text('\n'.join((place.read_text().rstrip(), '    robots:', *lines, '')))
    return copy


def composed(robots: int, seconds: float, place: Path) -> None:
    """Print how fast time goes with the stacks of so many robots, each composed in a process."""
    with tempfile.TemporaryDirectory(prefix='fleet-') as name:
        fast = ['-p', 'use_sim_time:=true', '-p', 'simulator:speed:=0.0']
        began_start = time.monotonic()
        words = ['--map', str(spread(place, robots, Path(name))), '--composed', *fast]
        launched = Launched(words, Path(name))
        context = rclpy.Context()
        rclpy.init(args=[], context=context, domain_id=launched.domain)
        node = PatrolNode('onlooker', context=context, use_global_arguments=False)
        times: list[float] = []
        node.create_subscription(
            Clock,
            '/clock',
            lambda message: times.append(message.clock.sec + 1e-9 * message.clock.nanosec),
            SENSOR_QOS,
        )
        spinner = ExecutorThread(context)
        spinner.executor.add_node(node)
        spinner.start()
        try:
            record = list[Path]()
            deadline = time.monotonic() + START_SECONDS
            while len(record) < robots and time.monotonic() < deadline:
                time.sleep(1.0)
                found = Path(name).glob('runs/*/*/events.jsonl')
                record = [each for each in found if b'"decision"' in each.read_bytes()]
            if len(record) < robots:
                print(launched.text)
                print(f'only {len(record)} of {robots} robots have decided')
            started = time.monotonic() - began_start
            before = {name: cpu_seconds(each) for name, each in launched.processes.items()}
            first, began = times[-1], time.monotonic()
            time.sleep(seconds)
            took, passed = time.monotonic() - began, times[-1] - first
            used = {
                name: (cpu_seconds(each) - before[name]) / took
                for name, each in launched.processes.items()
                if name in before
            }
        finally:
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown(context=context)
            launched.close()
    cores = os.cpu_count() or 1
    own = [share for part, share in used.items() if part.startswith('robot')]
    total = sum(used.values())
    at_start = sum(before.values())
    print(
        f'all {robots} robots decided after {started:.0f} s, which took {at_start:.0f} s of '
        f'processor time in {len(before)} processes'
    )
    print(
        f'{place.stem}, {robots} robots composed on {cores} cores (load '
        f'{os.getloadavg()[0]:.0f}): {passed / took:.2f} simulated seconds a second with '
        f'{total:.2f} cores of processor time ({100 * max(own, default=0.0):.0f} % for the busiest '
        f'robot), {1000 * total / max(passed / took, 1e-9):.0f} ms of it a simulated second: '
        f'{cores / max(total / max(passed / took, 1e-9), 1e-9):.1f} a second if all cores '
        'were free'
    )
