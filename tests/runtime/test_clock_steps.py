"""A machine's clock that is set while nodes run: what they wait for lasts no longer for that."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.machine_faults import SteppedClock

ROOT = Path(__file__).resolve().parents[2]
WAITS = """
import sys, threading, time
from state_machines.ros import ClockWait
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread
import rclpy

rclpy.init()
node, spinner = PatrolNode('waiting'), ExecutorThread()
wait, ticked = ClockWait(node), threading.Event()
node.create_timer(0.05, ticked.set)
spinner.executor.add_node(node)
spinner.start()
assert ticked.wait(60.0)
date = wait.now()
print('ready', flush=True)
sleeper = threading.Thread(target=wait.sleep, args=(1.0,), daemon=True)
began = wait.elapsed()
sleeper.start()
sys.stdin.readline()
print('date', round((wait.now() - date) / 600.0), flush=True)
ticked.clear()
assert ticked.wait(60.0), 'the timer rests'
sleeper.join(60.0)
assert not sleeper.is_alive(), 'the sleep goes on'
assert 0.9 < wait.elapsed() - began < 40.0
spinner.stop()
node.destroy_node()
rclpy.try_shutdown()
"""


@pytest.mark.parametrize('seconds', [-3600, 3600])
def test_a_clock_that_is_set_changes_no_wait(tmp_path: Path, seconds: int) -> None:
    if not SteppedClock.may_be_made():
        pytest.skip('needs a C compiler and glibc on x86-64')
    clock = SteppedClock(tmp_path)
    process = subprocess.Popen(
        [sys.executable, '-c', WAITS],
        cwd=ROOT,
        env={**os.environ, **clock.environ},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stdout.readline() == 'ready\n'
    clock.step(seconds)
    out, errors = process.communicate('\n', timeout=60)
    assert out == f'date {round(seconds / 600)}\n'
    assert process.returncode == 0, errors
