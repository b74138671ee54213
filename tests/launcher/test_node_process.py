"""What a supervised process is: a node that ends with its launcher."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

from tests.launcher.conftest import ROOT, USER_ENVIRON, gone

"""Where nothing is killed for want of time, however busy the machine is."""


def test_children_end_with_a_launcher_that_is_killed(start):
    child = str(ROOT / 'launcher' / 'node_process.py')
    script = (
        'import os, subprocess, sys\n'
        f'subprocess.run([sys.executable, "-P", {child!r}, str(os.getpid()), '
        '"x=tests.launcher.waiting_node:X", "--ros-args"])'
    )
    launch = start('-c', script)
    launch.until('up with --ros-args')
    children = Path(f'/proc/{launch.process.pid}/task/{launch.process.pid}/children')
    pids = [int(pid) for pid in children.read_text().split()]
    assert len(pids) == 1
    launch.end(signal.SIGKILL)
    assert gone(pids)


def test_a_child_whose_launcher_is_gone_already_does_not_start():
    child = str(ROOT / 'launcher' / 'node_process.py')
    done = subprocess.run(
        # No process has this number: 1 is the parent of whatever a container begins with.
        [sys.executable, '-P', child, str(2**22 + 1), 'x=tests.launcher.waiting_node:X'],
        env=USER_ENVIRON,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 1


def test_what_a_node_wants_of_its_process_counts_beside_others_too(tmp_path):
    (tmp_path / 'one_node.py').write_text(
        'import surveillance_runtime.process as process\n'
        'def prepare_process(): print("prepared", flush=True)\n'
        'class Node: pass\n'
        'process.run_nodes = lambda classes, arguments: print("run", len(classes)) or 0\n'
    )
    done = subprocess.run(
        [
            sys.executable,
            '-P',
            str(ROOT / 'launcher' / 'node_process.py'),
            '0',
            'a=one_node:Node,b=one_node:Node',
        ],
        env=USER_ENVIRON | {'PYTHONPATH': str(tmp_path)},
        timeout=60.0,
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout.splitlines() == ['prepared', 'prepared', 'run 2']
