#!/usr/bin/env python3
"""Starts each script of `benchmarks/` in its smallest form, two at a time: none may have rotted.

    .venv/bin/python .ci/benchmarks.py [NAME ...]

A script passes that ends by itself with the status 0 and measures, or says in one line beginning
with `skipped:` what it lacks here (Java, root, a package). What a benchmark measures is not judged.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
PYTHON = CHECKOUT / '.venv' / 'bin' / 'python'
OTHERS: dict[str, list[str] | None] = {
    'fleet_page.py': None,  # a process of `fleet.py --page`
    'nav2/foreign_robot.py': None,  # a process of `nav2/drives.py`
    'regular_places.py': ['ring'],
    'structure.py': [],
    'walks.py': [],
}
"""Words for scripts that have no `--smoke`; None: it is no command of its own."""
LONG = ('navigation.py', 'campaign.py', 'surveil.py', 'page.py', 'startup.py', 'armor_calls.py')
"""Begun first, so that both rows end together."""
PATIENCE = 1200.0
"""Seconds after which a script counts as hanging; a busy machine takes many times as long."""


@dataclass(frozen=True)
class Outcome:
    """What became of a script: seconds, why it failed or was skipped, and what it printed."""

    name: str
    seconds: float
    failed: str
    skipped: str
    output: str


def main(names: list[str]) -> int:
    """Start the scripts, print a line for each, and return the exit code."""
    folder = CHECKOUT / 'benchmarks'
    scripts = names or [str(path.relative_to(folder)) for path in folder.glob('**/*.py')]
    found = [name for name in scripts if OTHERS.get(name, []) is not None and is_command(name)]
    found.sort(key=lambda name: (LONG.index(name) if name in LONG else len(LONG), name))
    begun, failed = time.monotonic(), []
    with ThreadPoolExecutor(2) as pool:
        for outcome in pool.map(start, found):
            said = outcome.failed or outcome.skipped or 'runs'
            print(f'{outcome.name:24} {outcome.seconds:6.1f} s  {said}', flush=True)
            if outcome.failed:
                failed.append(outcome)
    for outcome in failed:
        print(f'\nbenchmarks/{outcome.name} {outcome.failed}:\n{outcome.output[-4000:]}')
    print(f'{len(found)} benchmarks, {len(failed)} failed, {time.monotonic() - begun:.0f} s')
    return 1 if failed else 0


def is_command(name: str) -> bool:
    """Tell whether a file of benchmarks is started by itself."""
    return "__name__ == '__main__'" in (CHECKOUT / 'benchmarks' / name).read_text('utf-8')


def start(name: str) -> Outcome:
    """Run one script to its end."""
    words = OTHERS.get(name, ['--smoke']) or []
    begun = time.monotonic()
    # A stop that somebody asked for on this machine holds no robot of a benchmark.
    own = tempfile.TemporaryDirectory(prefix='surveillance_state_', ignore_cleanup_errors=True)
    process = subprocess.Popen(
        [str(PYTHON), str(CHECKOUT / 'benchmarks' / name), *words],
        cwd=CHECKOUT,
        env={**os.environ, 'XDG_STATE_HOME': own.name, 'XDG_RUNTIME_DIR': own.name},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    failed = ''
    try:
        output, _ = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
        failed = f'does not end within {PATIENCE:g} s'
    own.cleanup()
    if not failed and process.returncode:
        failed = f'fails with status {process.returncode}'
    lines = output.strip().splitlines() or ['']
    skipped = '' if failed or not lines[-1].startswith('skipped:') else lines[-1]
    return Outcome(name, time.monotonic() - begun, failed, skipped, output)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
