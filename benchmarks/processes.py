#!/usr/bin/env python3
"""Processes that a benchmark starts, looks at and ends; and what a robot's processes need.

    .venv/bin/python benchmarks/processes.py --quick
    .venv/bin/python benchmarks/processes.py -- --processes one-each --web
    .venv/bin/python benchmarks/processes.py --topics

`launch.py` patrols the office in real time. From a quarter of a minute after the first decision on
every thread's processor time (user and system, proc(5)) and voluntary context switches are counted:
a switch is a thread that waited and was woken. Memory is the proportional set size (PSS) at the
end. Seconds on the wall are only divided by: other work on the machine changes little. Words after
`--` are further options of the launcher. `--topics` also counts what is published, and who takes
it, by a reader of each topic beside the mission.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from benchmarks.sizes import sized_parser
from benchmarks.tables import table
from launcher.process_watch import look_at

STARTED = re.compile(r'started ([\w/]+) \(process (\d+)')
CHOSEN = re.compile(r'robot_behavior +\| decision 1:')
SETTLE = 15.0
"""Seconds after the first decision that are not counted."""
LAUNCHER, SIMULATOR = 'launch.py', 'simulator'
TICKS = os.sysconf('SC_CLK_TCK')


def end_processes(
    processes: Sequence[subprocess.Popen[Any]], patience: float, by: int = signal.SIGINT
) -> None:
    """Stop processes as Ctrl-C does, all at once; kill those that do not end in time.

    Args:
        processes: Some may have ended.
        patience: Seconds for each.
        by: The signal.
    """
    for process in processes:
        if process.poll() is None:
            process.send_signal(by)
    for process in processes:
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used, seconds; 0 when it has ended."""
    look = look_at(pid)
    return 0.0 if look is None else look.cpu


def memory_mb(pid: int, field: str = 'VmRSS') -> float:
    """Return a size of a process, MB: `VmRSS` now, `VmHWM` at most; 0 when it has ended."""
    try:
        status = Path(f'/proc/{pid}/status').read_text()
    except OSError:
        return 0.0
    sizes = [line.split()[1] for line in status.splitlines() if line.startswith(field)]
    return int(sizes[0]) / 1024 if sizes else 0.0


def proportional_size(pid: int) -> float:
    """Return the memory of a process in MB, pages shared with others counted in part."""
    text = Path(f'/proc/{pid}/smaps_rollup').read_text()
    match = re.search(r'^Pss: +(\d+) kB', text, re.MULTILINE)
    assert match is not None
    return int(match[1]) / 1000


@dataclass
class Threads:
    """What the threads of a process have used so far, by their names.

    Attributes:
        cpu: Seconds.
        woken: Voluntary context switches.
        count: How many threads of that name there are.
    """

    cpu: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    woken: Counter[str] = field(default_factory=Counter)
    count: Counter[str] = field(default_factory=Counter)


def threads_of(pid: int) -> Threads:
    """Look at the threads of a process; those of DDS are named by what they do."""
    found = Threads()
    folder = Path(f'/proc/{pid}/task')
    for task in folder.iterdir():
        try:
            stat, status = (task / 'stat').read_text(), (task / 'status').read_text()
        except OSError:
            continue  # it has just ended
        name = re.sub(r'\d+$', '', stat[stat.index('(') + 1 : stat.rindex(')')])
        if task.name == str(pid):
            name = 'main'
        used = stat.rpartition(') ')[2].split()
        switches = re.search(r'^voluntary_ctxt_switches:\s+(\d+)', status, re.MULTILINE)
        found.cpu[name] += (int(used[11]) + int(used[12])) / TICKS
        found.woken[name] += int(switches[1]) if switches else 0
        found.count[name] += 1
    return found


@dataclass
class Needs:
    """What a process needed.

    Attributes:
        cpu: Share of a core.
        woken: A second.
        threads: How many it has.
        memory: PSS, MB.
        by_thread: Share of a core and wakeups a second of the threads of each name.
    """

    cpu: float
    woken: float
    threads: int
    memory: float
    by_thread: dict[str, tuple[float, float]]


def measured(words: Sequence[str], seconds: float, topics: float = 0.0) -> dict[str, Needs]:
    """Run a mission and return what each of its processes needed, by the nodes that it holds.

    Args:
        words: Options of the launcher.
        seconds: For which is counted.
        topics: For which then the messages are counted and printed, 0 for not at all.
    """
    from surveillance_runtime.testing import claim_domain

    domain = claim_domain()
    with tempfile.TemporaryDirectory(prefix='processes-') as folder:
        launcher = subprocess.Popen(
            [
                *(sys.executable, str(ROOT / 'launch.py'), '--domain', str(domain)),
                *('--record', f'{folder}/runs', *words),
            ],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            env={**os.environ, 'XDG_STATE_HOME': folder, 'XDG_RUNTIME_DIR': folder},
            text=True,
        )
        nodes = {launcher.pid: [LAUNCHER]}
        assert launcher.stdout is not None
        try:
            for line in launcher.stdout:
                if found := STARTED.search(line):
                    nodes.setdefault(int(found[2]), []).append(found[1])
                if CHOSEN.search(line):
                    break
            else:
                sys.exit('no place was chosen')
            drain = subprocess.Popen(['cat'], stdin=launcher.stdout, stdout=subprocess.DEVNULL)
            time.sleep(SETTLE)
            before, begun = {pid: threads_of(pid) for pid in nodes}, time.monotonic()
            time.sleep(seconds)
            lasted = time.monotonic() - begun
            needs = {
                ', '.join(names): _needs(
                    before[pid], threads_of(pid), lasted, proportional_size(pid)
                )
                for pid, names in nodes.items()
            }
            if topics:
                count_messages(domain, topics)
        finally:
            end_processes([launcher], 20)
            drain.wait()
    return needs


def _needs(before: Threads, after: Threads, seconds: float, memory: float) -> Needs:
    by_thread = {
        name: (
            max(0.0, after.cpu[name] - before.cpu[name]) / seconds,
            max(0, after.woken[name] - before.woken[name]) / seconds,
        )
        for name in after.cpu
    }
    return Needs(
        sum(cpu for cpu, _ in by_thread.values()),
        sum(woken for _, woken in by_thread.values()),
        sum(after.count.values()),
        memory,
        by_thread,
    )


def count_messages(domain: int, seconds: float) -> None:
    """Print the topics of a domain: messages and bytes a second, and how many take them."""
    import rclpy
    from rclpy.node import Node
    from rclpy.qos import qos_profile_sensor_data

    from surveillance_runtime.discovery import prefer_quick_discovery
    from surveillance_runtime.process import ExecutorThread

    prefer_quick_discovery()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = Node('processes', context=context, use_global_arguments=False)
    time.sleep(3.0)
    counts: Counter[str] = Counter()
    sizes: Counter[str] = Counter()

    def taking(topic: str) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            counts[topic] += 1
            sizes[topic] += len(data)

        return take

    readers = {}
    for topic, (kind, *_) in node.get_topic_names_and_types():
        package, _, name = kind.rpartition('/')
        message = getattr(importlib.import_module(package.replace('/', '.')), name, None)
        if message is None:
            continue  # feedback of an action
        readers[topic] = len(node.get_subscriptions_info_by_topic(topic))
        node.create_subscription(message, topic, taking(topic), qos_profile_sensor_data, raw=True)
    spinning = ExecutorThread(context)
    spinning.executor.add_node(node)
    spinning.start()
    time.sleep(2.0)
    counts.clear()
    sizes.clear()
    time.sleep(seconds)
    rows = [('topic', 'messages/s', 'bytes/s', 'readers', 'taken/s')]
    for topic, count in counts.most_common():
        if (rate := count / seconds) >= 0.05:
            taken = f'{rate * readers[topic]:.1f}'
            size = f'{sizes[topic] / seconds:.0f}'
            rows.append((topic, f'{rate:.1f}', size, str(readers[topic]), taken))
    total = sum(counts[topic] * readers[topic] for topic in counts) / seconds
    rows.append(
        (
            'all',
            f'{sum(counts.values()) / seconds:.1f}',
            f'{sum(sizes.values()) / seconds:.0f}',
            '',
            f'{total:.1f}',
        )
    )
    print(table(rows), end='\n\n')
    spinning.stop()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def rows_of(needs: dict[str, Needs]) -> list[tuple[str, ...]]:
    """Return a table of processes, dearest first, and of all without the simulator."""
    rows: list[tuple[str, ...]] = [('process', 'CPU, % of a core', 'wakeups/s', 'threads', 'MB')]

    def row(name: str, each: Sequence[Needs]) -> tuple[str, ...]:
        return (
            name,
            f'{100 * sum(one.cpu for one in each):.1f}',
            f'{sum(one.woken for one in each):.0f}',
            str(sum(one.threads for one in each)),
            f'{sum(one.memory for one in each):.0f}',
        )

    for name in sorted(needs, key=lambda name: -needs[name].cpu):
        rows.append(row(name, [needs[name]]))
        for thread, (cpu, woken) in sorted(
            needs[name].by_thread.items(), key=lambda item: -item[1][0]
        ):
            if cpu >= 0.002 or woken >= 5:
                rows.append((f'    {thread}', f'{100 * cpu:.1f}', f'{woken:.0f}', '', ''))
    robot = [each for name, each in needs.items() if name.rpartition('/')[2] != SIMULATOR]
    rows += [row('all, simulator apart', robot), row('all', list(needs.values()))]
    return rows


def main(words: Sequence[str] | None = None) -> int:
    """Measure and print the tables."""
    parser = sized_parser(
        __doc__,
        quick='twenty seconds of the mission',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--seconds', type=float, help='of the mission (default: 600)')
    parser.add_argument('--topics', action='store_true', help='count the messages, too')
    parser.add_argument('options', nargs='*', metavar='OPTION', help='of the launcher, after --')
    given = parser.parse_args(words)
    seconds = given.seconds or given.size.of(600.0, 20.0, 2.0)
    options = given.options
    if '--map' not in options:
        options = ['--map', str(ROOT / 'config' / 'office.yaml'), *options]
    load = os.getloadavg()[0]
    needs = measured(options, seconds, min(seconds, 30.0) if given.topics else 0.0)
    print(f'{seconds:.0f} s of {" ".join(options)}; load {load:.0f} to {os.getloadavg()[0]:.0f}')
    print(table(rows_of(needs)))
    return 0


if __name__ == '__main__':
    sys.exit(main())
