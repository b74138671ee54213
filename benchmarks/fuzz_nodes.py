#!/usr/bin/env python3
"""Send random messages to every topic, service, action and parameter of every node.

    .venv/bin/python benchmarks/fuzz_nodes.py --quick
    .venv/bin/python benchmarks/fuzz_nodes.py --messages 1000000 --seed 7 --node armor_server

Each node of the table runs as a process of its own in a ROS domain of its own. What it takes is
read from the ROS graph, what a message may hold from the message's definition: NaN, infinities,
1e308, negative stamps, empty and long arrays, long strings, control characters, names of places and
of files. Half of the messages are plain ones with a few fields changed, because a message that is
wrong everywhere is refused at its first field.

A node fails when its process ends, or when it does not answer a parameter request at the end. The
table prints the deaths, the log lines a second (on average of the node's life, and of the minute
with most lines; 0 for a run of less than a minute), the highest memory and the slowest answer. What
`mission_view` prints for its reader, a line for each change, is no log and not counted. The exit
code is 1 when a node died.
"""

from __future__ import annotations

import argparse
import array
import importlib
import math
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import rclpy
from rcl_interfaces.srv import ListParameters
from rclpy.action import (
    ActionClient,
    get_action_server_names_and_types_by_node,
)
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from benchmarks.processes import end_processes, memory_mb
from benchmarks.sizes import sized_parser
from benchmarks.whole_stack import ros_arguments
from surveillance_runtime import node_table
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.testing import claim_domain

STRANGE_FLOATS = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, -0.0, 1e9, -1e9, 0.0, 1.0, -1.0,
)  # fmt: skip
STRANGE_STRINGS = (
    *('', ' ', '\n', 'R1\nlaunch | forged', '\x1b[2J\x1b[31m', '\x00', 'é' * 50, '\U0001f916'),
    *('Robot1', 'E', 'C1', 'R9', 'surveillance', 'LOAD', 'SAVE', 'QUERY', 'REASON'),
    *('/', '..', '/dev/zero', '/dev/stdin', '../launch.py', 'a#b', '<http://x#y>', '%'),
    *('"5"^^xsd:long', '{}', '[[1,2],[3]]', 'nan', '1e308', '-1'),
)
PLACE = ROOT / 'config' / 'patrol_world.yaml'
PARAMETERS = {'video_source': {'source': str(ROOT / 'docs' / 'images'), 'loop': True}}
"""Without which a node does not start."""
ARRAY_CODES = {
    **{'double': 'd', 'float': 'f', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H'},
    **{'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q'},
}
"""The codes of Python's arrays for the numbers of messages."""
WINDOW = 60.0
"""Seconds over which the log lines of a node are counted."""
SCREEN = 'mission_view'
_LOGGED = re.compile(rb'^\[(?:DEBUG|INFO|WARN|ERROR|FATAL)\] ', re.MULTILINE)
FEW = 20
"""How many different values a long array has."""
STARTED_WITHIN = 120.0
"""Seconds that a node may take to start, on a busy machine."""
PATIENCE = 10.0
"""Seconds that a node may take to answer."""
PACE, ROUNDS = 50, 5
"""After so many messages the node has to answer so many times before it gets more."""
OUTSTANDING = 200
"""Requests to one service that may wait for their answers."""
IGNORED = ('/parameter_events', '/rosout', '/clock')


class Generator:
    """Random messages of any type.

    Args:
        chance: Where randomness comes from.
        most: The longest array and string, in elements.

    Attributes:
        names: Further strings to choose from, such as a node's parameters.
    """

    def __init__(self, chance: random.Random, most: int) -> None:
        self._chance = chance
        self._most = most
        self.names: tuple[str, ...] = ()

    def message(self, kind: Any) -> Any:
        """Return a message: random everywhere, or a plain one with one to three fields changed."""
        message = kind()
        if self._chance.random() < 0.5:
            self._fill(message)
            return message
        for _ in range(self._chance.randint(1, 3)):
            self._change_one(message)
        return message

    def _fields(self, message: Any) -> list[tuple[str, str]]:
        return list(message.get_fields_and_field_types().items())

    def _fill(self, message: Any) -> None:
        for name, kind in self._fields(message):
            self._set(message, name, kind)

    def _change_one(self, message: Any) -> None:
        fields = self._fields(message)
        if not fields:
            return
        name, kind = self._chance.choice(fields)
        value = getattr(message, name)
        if hasattr(value, 'get_fields_and_field_types') and self._chance.random() < 0.8:
            self._change_one(value)
        else:
            self._set(message, name, kind)

    def _set(self, message: Any, name: str, kind: str) -> None:
        try:
            setattr(message, name, self._value(kind))
        except (AssertionError, ValueError, TypeError, OverflowError):
            return  # The Python class takes no such value, so no rclpy peer can send it.

    def _value(self, kind: str) -> Any:
        if kind.startswith('sequence<'):
            inner, _, bound = kind[9:-1].partition(', ')
            longest = int(bound) if bound else self._length()
            return self._values(inner, self._chance.randint(0, longest))
        if kind.endswith(']'):
            inner, _, count = kind[:-1].rpartition('[')
            return self._values(inner, int(count))
        if '/' in kind:
            package, name = kind.split('/')
            return self.message(getattr(importlib.import_module(f'{package}.msg'), name))
        return self._plain(kind)

    def _values(self, kind: str, count: int) -> Any:
        if kind in ARRAY_CODES and count > FEW:
            # A long array repeats a few values: drawing each took nearly all of the time.
            some = array.array(ARRAY_CODES[kind], [self._plain(kind) for _ in range(FEW)])
            return (some * (count // FEW + 1))[:count]
        if kind in ('octet', 'byte', 'char') and count:
            return list(self._chance.randbytes(count))
        if '/' in kind or kind == 'string':
            count = min(count, 50)
        return [self._value(kind) for _ in range(count)]

    def _length(self) -> int:
        lengths = (0, 1, 2, 3, 10, 1000, self._most)
        return self._chance.choices(lengths, (20, 20, 20, 20, 10, 9, 1))[0]

    def _plain(self, kind: str) -> Any:
        chance = self._chance
        if kind == 'boolean':
            return chance.random() < 0.5
        if kind in ('double', 'float'):
            value = chance.choice(STRANGE_FLOATS) if chance.random() < 0.6 else chance.gauss(0, 10)
            return (
                value if kind == 'double' or abs(value) < 3e38 or not math.isfinite(value) else 3e38
            )
        if kind.startswith(('string', 'wstring')):
            if chance.random() < 0.02:
                return 'x' * self._most
            return chance.choice((*STRANGE_STRINGS, *self.names))
        if kind in ('octet', 'byte', 'char'):
            return chance.randrange(256)
        bits = int(''.join(filter(str.isdigit, kind)))
        low, high = (
            (0, 2**bits - 1) if kind.startswith('u') else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        )
        return chance.choice((low, high, 0, 1, 2, 5, chance.randint(low, high)))


@dataclass
class Target:
    """Something of a node that takes messages.

    Attributes:
        name: Of the topic, service or action.
        send: Sends one random message.
    """

    name: str
    send: Callable[[], None]


@dataclass
class Report:
    """What became of one node."""

    node: str
    targets: int = 0
    sent: int = 0
    deaths: list[str] = field(default_factory=list)
    answers: bool = True
    lines: int = 0
    most_lines: float = 0.0
    seconds: float = 0.0
    memory: float = 0.0
    slowest: float = 0.0


class NodeProcess:
    """A node as a process, with its output counted."""

    def __init__(self, name: str, domain: int, folder: Path, place: Path) -> None:
        node = node_table.find(name)
        start = f'import sys; from {node.module} import main; sys.exit(main())'
        words = [sys.executable, '-c', start, *ros_arguments(place, folder, PARAMETERS)]
        environ = {**os.environ, 'ROS_DOMAIN_ID': str(domain)}
        self._shows = name == SCREEN
        self.output = folder / f'{name}.log'
        self._file = self.output.open('ab')
        self.process = subprocess.Popen(
            words, cwd=folder, env=environ, stdin=subprocess.PIPE, stdout=self._file,
            stderr=subprocess.STDOUT, preexec_fn=_bound_memory,
        )  # fmt: skip

    def memory(self) -> float:
        """Return the highest resident size so far in MB; 0 when the process has ended."""
        return memory_mb(self.process.pid, 'VmHWM')

    def lines_after(self, position: int) -> tuple[int, int]:
        """Return the present end of the output, and how many log lines came after a position."""
        with self.output.open('rb') as file:
            file.seek(position)
            new = file.read()
        lines = _LOGGED.findall(new) if self._shows else new.splitlines()
        return position + len(new), len(lines)

    def tail(self) -> str:
        """Return the last line that says something."""
        lines = self.output.read_text('utf-8', 'replace').strip().splitlines()
        return lines[-1][:160] if lines else ''

    def end(self) -> None:
        """Stop the process."""
        end_processes([self.process], 5)
        self._file.close()


def _bound_memory() -> None:
    # A node that asks for 300 GB is to fail here and not to take the machine with it.
    resource.setrlimit(resource.RLIMIT_AS, (12 << 30, 12 << 30))


class Fuzzer:
    """Finds what a node takes and sends it messages.

    Args:
        domain: The ROS domain.
        seed: Of the randomness.
        most: The longest array and string, in elements.
    """

    def __init__(self, domain: int, seed: int, most: int) -> None:
        self.context = rclpy.Context()
        quiet = ['--ros-args', '--log-level', 'fatal']
        rclpy.init(args=quiet, context=self.context, domain_id=domain)
        self.node = Node('fuzzer', context=self.context, use_global_arguments=False)
        self._generator = Generator(random.Random(seed), most)
        self._chance = random.Random(seed + 1)
        self._lister: Any = None
        self._spinning = ExecutorThread(self.context)
        self._spinning.executor.add_node(self.node)
        self._spinning.start()

    def close(self) -> None:
        """Leave the graph."""
        self._spinning.stop()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def targets(self, name: str) -> list[Target]:
        """Return what the node takes, as far as its types can be imported."""
        found = []
        for topic, kinds in self.node.get_subscriber_names_and_types_by_node(name, '/'):
            if topic not in IGNORED and '/_action/' not in topic:
                found.append(self._topic(topic, _type(kinds[0])))
        for service, kinds in self.node.get_service_names_and_types_by_node(name, '/'):
            if '/_action/' in service:
                continue
            found.append(self._service(service, _type(kinds[0])))
        for action, kinds in get_action_server_names_and_types_by_node(self.node, name, '/'):
            found.append(self._action(action, _type(kinds[0])))
        return found

    def _topic(self, topic: str, kind: Any) -> Target:
        # Reliable and latched: what every subscription takes, whatever it asks for.
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher = self.node.create_publisher(kind, topic, latched)
        return Target(topic, lambda: publisher.publish(self._generator.message(kind)))

    def _service(self, name: str, kind: Any) -> Target:
        client = self.node.create_client(kind, name)
        waiting: list[Any] = []

        def send() -> None:
            waiting[:] = [future for future in waiting if not future.done()]
            if len(waiting) >= OUTSTANDING:
                client.remove_pending_request(waiting.pop(0))
            waiting.append(client.call_async(self._generator.message(kind.Request)))

        return Target(name, send)

    def _action(self, name: str, kind: Any) -> Target:
        client = ActionClient(self.node, kind, name)

        def send() -> None:
            client.send_goal_async(self._generator.message(kind.Goal))

        return Target(name, send)

    def learn_names(self, name: str) -> None:
        """Let messages name the node's own parameters."""
        answer = self.list_parameters(name)
        if answer is not None:
            self._generator.names = tuple(answer.result.names)

    def list_parameters(self, name: str) -> Any:
        """Return a node's answer to a request for its parameters; None: none came in time."""
        if self._lister is None:
            self._lister = self.node.create_client(ListParameters, f'/{name}/list_parameters')
        future = self._lister.call_async(ListParameters.Request())
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if done.wait(PATIENCE):
            return future.result()
        self._lister.remove_pending_request(future)
        return None

    def run(
        self, process: NodeProcess, targets: Sequence[Target], count: int, report: Report
    ) -> None:
        """Send messages until there were enough or the process ended."""
        began = last = time.monotonic()
        size, printed = 0, deque([(began, 0)])
        for number in range(1, count + 1):
            target = self._chance.choice(targets)
            target.send()
            report.sent += 1
            if number % PACE and number < count:
                continue
            if process.process.poll() is not None:
                report.deaths.append(f'{target.name}: {process.tail()}')
                break
            # Lets the node keep up: what is lost is not tested. Each answer is a round of its
            # executor, which takes one message of each topic and service.
            for _ in range(ROUNDS):
                asked = time.monotonic()
                self.list_parameters(report.node)
                report.slowest = max(report.slowest, time.monotonic() - asked)
            now = time.monotonic()
            if now - last >= 1.0 or number == count:
                size, new = process.lines_after(size)
                printed.append((now, printed[-1][1] + new))
                while len(printed) > 1 and now - printed[1][0] >= WINDOW:
                    printed.popleft()
                if now - printed[0][0] >= WINDOW:
                    rate = (printed[-1][1] - printed[0][1]) / (now - printed[0][0])
                    report.most_lines = max(report.most_lines, rate)
                report.lines += new
                last = now
        report.seconds += time.monotonic() - began
        report.memory = max(report.memory, process.memory())


def _type(text: str) -> Any:
    package, folder, name = text.split('/')
    return getattr(importlib.import_module(f'{package}.{folder}'), name)


def fuzz(name: str, count: int, seed: int, most: int, folder: Path, place: Path) -> Report:
    """Fuzz one node; a node that dies is started again until all messages are sent."""
    report = Report(name)
    domain = claim_domain()
    fuzzer = Fuzzer(domain, seed, most)
    try:
        while report.sent < count and len(report.deaths) < 20:
            process = NodeProcess(name, domain, folder, place)
            try:
                deadline = time.monotonic() + STARTED_WITHIN
                while name not in fuzzer.node.get_node_names():
                    if process.process.poll() is not None or time.monotonic() > deadline:
                        report.deaths.append(f'does not start: {process.tail()}')
                        return report
                    time.sleep(0.1)
                fuzzer.learn_names(name)
                if not (targets := fuzzer.targets(name)):
                    report.deaths.append(f'takes nothing: {process.tail()}')
                    return report
                report.targets = len(targets)
                fuzzer.run(process, targets, count - report.sent, report)
                if process.process.poll() is None:
                    report.answers = fuzzer.list_parameters(name) is not None
                    if process.process.poll() is not None:
                        report.deaths.append(f'at the end: {process.tail()}')
            finally:
                process.end()
    finally:
        fuzzer.close()
    return report


def show(report: Report) -> None:
    """Print a node's row, and its first deaths."""
    rate = report.lines / report.seconds if report.seconds else 0.0
    print(
        f'{report.node:22} {report.targets:7} {report.sent:8} {len(report.deaths):6} '
        f'{"yes" if report.answers else "NO":>7} {rate:7.1f} {report.most_lines:6.1f} '
        f'{report.memory:6.0f} {report.slowest:9.1f}',
        flush=True,
    )
    for death in report.deaths[:5]:
        print(f'    {death}', flush=True)


def main(words: Sequence[str] | None = None) -> int:
    """Fuzz the nodes, print the table, return the exit code."""
    parser = sized_parser(
        __doc__,
        quick='100 messages a node',
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument(
        '--messages', type=int, default=26000, help='over all nodes (default 26000)'
    )
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--node', action='append', help='only this node; may be repeated')
    parser.add_argument('--longest', type=int, default=100_000, help='array and string elements')
    parser.add_argument('--jobs', type=int, default=3, help='nodes at a time')
    parser.add_argument('--keep', type=Path, help='folder for the logs (default: thrown away)')
    chosen = parser.parse_args(words)
    every = [node.name for node in node_table.NODES]
    names = chosen.node or chosen.size.of(every, every, ['battery_controller'])
    each = chosen.size.of(max(1, chosen.messages // len(names)), 100, 20)
    reports = []
    print(f'{"node":22} {"targets":>7} {"sent":>8} {"deaths":>6} {"answers":>7} '
          f'{"lines/s":>7} {"most":>6} {"MB":>6} {"slowest s":>9}')  # fmt: skip
    with tempfile.TemporaryDirectory(prefix='fuzz-') as scratch:

        def one(name: str) -> Report:
            folder = (chosen.keep or Path(scratch)) / name
            folder.mkdir(parents=True, exist_ok=True)
            return fuzz(name, each, chosen.seed, chosen.longest, folder, PLACE)

        with ThreadPoolExecutor(chosen.jobs) as pool:
            for report in pool.map(one, names):
                reports.append(report)
                show(report)
    deaths = sum(len(report.deaths) for report in reports)
    print(f'{sum(report.sent for report in reports)} messages, {deaths} deaths')
    return 1 if deaths or not all(report.answers for report in reports) else 0


if __name__ == '__main__':
    sys.exit(main())
