#!/usr/bin/env python3
"""How long a start takes, and what the running robot needs.

Warm: from the command to the first chosen room, with few processes, one each and one, beside
the time of a bare `import rclpy` in the same run, and the processor time that all processes have
used by then, which other work on the machine changes little. `resumed`: the mission goes on after
launcher and nodes were killed. `--cold` also measures a start from nothing, in a fresh copy of the
checkout. Memory is the proportional set size (PSS): a page that several processes
share is counted in part in each, so that the sum counts it once.

    .venv/bin/python benchmarks/startup.py --quick
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
if str(CHECKOUT) not in sys.path:
    sys.path.insert(0, str(CHECKOUT))

from benchmarks.processes import STARTED, proportional_size
from benchmarks.sizes import Size, sized_parser
from launcher.process_watch import look_at
from surveillance_runtime.node_table import COMPOSITIONS, FEW
from surveillance_runtime.testing import claim_domain

BASE_PYTHON = str(getattr(sys, '_base_executable', sys.executable))
NOTE = ', start not explored'
NO_EXPLORING = '/**/robot_behavior:\n  ros__parameters:\n    exploration_seconds: 0.0\n'
CHOSEN = re.compile(r'robot_behavior +\| decision 1:')
LONGEST = 60.0


@dataclass
class Start:
    """One start: seconds and processor time until the first chosen room, memory of each in MB."""

    seconds: float
    cpu: float
    memory: dict[str, float]


def own_environ() -> dict[str, str]:
    """Return this environment as a shell has it that never entered the project's."""
    environ = dict(os.environ)
    if environ.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None):
        environ.pop('LD_LIBRARY_PATH', None)
    # Without its cache of compiled modules Python takes twice as long.
    environ.pop('PYTHONDONTWRITEBYTECODE', None)
    return environ


def launch(checkout: Path, *options: str, longest: float = LONGEST, kill: bool = False) -> Start:
    """Start the robot, wait for the first chosen room, look at its processes, stop or kill it."""
    begin = time.monotonic()
    process = subprocess.Popen(
        [BASE_PYTHON, str(checkout / 'launch.py'), '--for', str(longest), *options],
        env=own_environ(),
        stdout=subprocess.PIPE,
        text=True,
        cwd=checkout,
    )
    processes = {process.pid: 'launch.py'}
    assert process.stdout is not None
    lines = []
    try:
        for line in process.stdout:
            lines.append(line)
            if match := STARTED.search(line):
                processes.setdefault(int(match[2]), match[1])
            if CHOSEN.search(line):
                seconds = time.monotonic() - begin
                cpu = sum(look.cpu for pid in processes if (look := look_at(pid)))
                memory = {name: proportional_size(pid) for pid, name in processes.items()}
                return Start(seconds, cpu, memory)
    finally:
        for pid in reversed(processes) if kill else ():
            os.kill(pid, signal.SIGKILL)
        process.send_signal(signal.SIGINT)
        process.communicate()
    sys.exit(f'no room was chosen within {longest:.0f} s:\n' + ''.join(lines[-20:]))


def time_of(words: list[str], environ: dict[str, str]) -> float:
    begin = time.monotonic()
    subprocess.run(words, env=environ, check=True)
    return time.monotonic() - begin


def resumed(words: list[str]) -> Start:
    """Kill a mission with its launcher, and start it again."""
    with tempfile.TemporaryDirectory() as runs:
        launch(CHECKOUT, *words, '--record', runs, kill=True)
        return launch(CHECKOUT, *words, '--record', runs, '--resume')


def cold_start() -> Start:
    """Start from a fresh copy without an environment."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, 'surveillance')
        ignored = shutil.ignore_patterns(
            '.venv', '.git', 'build', 'runs', '__pycache__', '.*_cache'
        )
        shutil.copytree(CHECKOUT, copy, ignore=ignored)
        return launch(copy, longest=900.0)


def main() -> None:
    """Measure and print the tables."""
    parser = sized_parser(__doc__, quick='one start of each kind')
    parser.add_argument('--cold', action='store_true', help='also a start from nothing (minutes)')
    options = parser.parse_args()
    repeats = options.size.of(5, 1, 1)
    python = str(CHECKOUT / '.venv' / 'bin' / 'python')
    bare = statistics.median(
        time_of([python, '-c', 'import rclpy'], own_environ()) for _ in range(2 + repeats)
    )
    with tempfile.NamedTemporaryFile('w', suffix='.yaml') as parameters:
        parameters.write(NO_EXPLORING)
        parameters.flush()
        at_once = ['--params', parameters.name]
        domain = ['--domain', str(claim_domain())]
        kinds = {
            f'{how}{note}': [*domain, '--processes', how, *more]
            for how in COMPOSITIONS
            for note, more in (('', []), (NOTE, at_once))
        }
        starts = {
            kind: [launch(CHECKOUT, *words) for _ in range(repeats)]
            for kind, words in kinds.items()
            if options.size is not Size.SMOKE or kind == f'{FEW}{NOTE}'
        }
    if options.size is not Size.SMOKE:
        starts['resumed'] = [resumed(domain) for _ in range(repeats)]
    if options.cold:
        starts['cold, from nothing'] = [cold_start()]
    print(f'from the command to the first chosen room, median of {repeats}')
    print(f'{"start":<40} {"seconds":>8} {"x import":>9} {"processor s":>12}')
    print(f'{"import rclpy, bare":<40} {bare:>8.2f} {1.0:>9.1f}')
    for name, done in starts.items():
        seconds = statistics.median(start.seconds for start in done)
        cpu = statistics.median(start.cpu for start in done)
        print(f'{name:<40} {seconds:>8.2f} {seconds / bare:>9.1f} {cpu:>12.2f}')
    print('\nmemory at that moment, PSS')
    print(f'{"process":<40} {"MB":>8}')
    for kind in starts.keys() & {*COMPOSITIONS} or starts:
        memory = starts[kind][-1].memory
        for name, size in memory.items():
            print(f'{kind + ": " + name:<40} {size:>8.1f}')
        print(f'{kind + ": all":<40} {sum(memory.values()):>8.1f}')


if __name__ == '__main__':
    main()
