"""Heartbeats: what hangs is ended and comes back, what only waits for the machine is left alone."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from launcher.process_watch import (
    SILENT_START,
    STARVED_AFTER,
    STOPPED_AFTER,
    STUCK_AFTER,
    Heartbeats,
    ProcessSample,
    look_at,
)
from tests.launcher.conftest import USER_ENVIRON, gone

DRIVER = str(Path(__file__).with_name('supervised.py'))
BEATING = (
    'import os, time\n'
    'pipe = int(os.environ["LAUNCH_HEARTBEAT"])\n'
    'print("up", flush=True)\n'
    'while True: os.write(pipe, b"."); time.sleep(0.1)'
)
ENDING = 'import os; os.write(int(os.environ["LAUNCH_HEARTBEAT"]), b".")'


def after(seconds: float, *looks: ProcessSample) -> str:
    """Return the judgement that long after a heartbeat, with looks spread over the time."""
    heartbeats = Heartbeats(0.0)
    heartbeats.beat(0.0)
    problems = [
        heartbeats.problem(seconds * (number + 1) / len(looks), look)
        for number, look in enumerate(looks)
    ]
    return problems[-1]


def test_a_process_that_beats_is_well_whatever_it_does():
    assert after(STOPPED_AFTER / 2, ProcessSample('T', 0.0, 0)) == ''


def test_a_stopped_process_is_found_soon():
    assert 'was stopped' in after(STOPPED_AFTER + 0.1, ProcessSample('T', 0.0, 0))


def test_a_process_that_only_sleeps_is_stuck():
    looks = [ProcessSample('S', 1.0, 0)] * 10
    assert 'hangs' in after(STUCK_AFTER + 2.0, *looks)


def test_a_process_that_gets_little_of_a_processor_is_given_time():
    waiting = [ProcessSample('R', 1.0, 0)] * 10
    assert after(STUCK_AFTER + 5.0, *waiting) == ''
    slow = [ProcessSample('S', 0.3 * number, 0) for number in range(10)]
    assert after(STUCK_AFTER + 5.0, *slow) == ''
    assert 'hangs' in after(STARVED_AFTER + 0.1, *waiting)


def test_an_endless_loop_is_found_by_its_own_time():
    looping = [ProcessSample('R', 10.0 + 0.4 * number, 0) for number in range(11)]
    assert 'hangs' in after(4.4, *looping)
    assert after(3.0, *looping[:8]) == ''


def test_a_start_may_take_long_but_not_for_ever():
    heartbeats = Heartbeats(0.0)
    assert heartbeats.problem(SILENT_START - 1.0, ProcessSample('S', 0.0, 0)) == ''
    assert 'did not come up' in heartbeats.problem(SILENT_START + 1.0, ProcessSample('S', 0.0, 0))


def test_a_watcher_that_slept_begins_to_count_anew():
    heartbeats = Heartbeats(0.0)
    heartbeats.beat(0.0)
    heartbeats.excuse(100.0)
    assert heartbeats.problem(100.5, ProcessSample('T', 0.0, 0)) == ''


def test_the_kernel_knows_this_process_and_no_other_of_its_number():
    look = look_at(os.getpid())
    assert look is not None
    assert look.state == 'R'
    assert look.memory > 2**20
    assert look_at(2**22 + 1) is None


def test_a_stopped_child_comes_back(start):
    launch = start(DRIVER, f'watched={BEATING}')
    first = int(launch.until(r'started watched \(process (\d+)\)')[1])
    launch.until(r'watched +\| up')
    seen = len(launch.lines)
    os.kill(first, signal.SIGSTOP)
    launch.until(r'watched was stopped .* ago: ending it', after=seen)
    launch.until(r'watched +\| up', after=seen)
    assert gone([first], 0)
    assert launch.end(signal.SIGINT)[0] == 0


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_a_stop_from_elsewhere_is_no_stop(start, number):
    polite = f'import signal, sys; signal.signal({int(number)}, lambda *_: sys.exit(0))\n{BEATING}'
    launch = start(DRIVER, f'watched={polite}')
    first = int(launch.until(r'started watched \(process (\d+)\)')[1])
    launch.until(r'watched +\| up')
    seen = len(launch.lines)
    os.kill(first, number)
    launch.until(r'watched died \(exit code 0\): starting it again', after=seen)
    launch.until(r'watched +\| up', after=seen)
    assert launch.end(signal.SIGINT)[0] == 0


def test_a_child_that_dies_again_and_again_calls_somebody(start):
    launch = start(DRIVER, f'watched={ENDING}')
    launch.until(r'ERROR: watched died 5 times in \d+ s, last: exit code 0: a person should')
    launch.until(r'alarm: watched died 5 times in \d+ s')
    assert launch.end(signal.SIGINT)[0] == 0


SLEEPER = (
    'import os; os.write(int(os.environ["LAUNCH_HEARTBEAT"]), b"S"); print("woke", flush=True)\n'
    'input()'
)


def test_children_that_slept_for_long_are_started_again_in_turn(start):
    """A machine that froze has all of them killed at once; they do not all come up at once."""
    sleepers = [f'{name}={SLEEPER}' for name in ('one', 'two')]
    launch = start(DRIVER, *sleepers, environ={**USER_ENVIRON, 'AT_ONCE': '1'})
    for name in ('one', 'two'):
        launch.until(rf'{name} slept so long that its peers may have forgotten it: ending it')
        launch.until(rf'{name} died \(slept so long .*\): starting it again')
    assert launch.end(signal.SIGINT)[0] == 0


def test_a_child_that_slept_and_has_no_peers_goes_on(start):
    launch = start(DRIVER, f'alone={SLEEPER}')
    launch.until(r'alone +\| woke')
    launch.write('alone go')
    launch.until(r'alone died \(exit code 0\)')
    assert not any('slept' in line for line in launch.lines)
    assert launch.end(signal.SIGINT)[0] == 0


def test_a_child_that_takes_all_memory_is_ended(start):
    greedy = f'kept = bytearray(80 * 2**20)\n{BEATING}'
    environ = {**USER_ENVIRON, 'MEMORY': str(50 * 2**20)}
    launch = start(DRIVER, f'watched={greedy}', environ=environ)
    launch.until(r'watched holds \d+ MB of memory, at most 50 MB are allowed: ending it')
    assert launch.end(signal.SIGINT)[0] == 0
