from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from launcher.supervisor import EXIT_CUT, STOP_AGAIN_AFTER, STOP_WITHIN, describe_exit
from tests.launcher.conftest import USER_ENVIRON, gone

DRIVER = str(Path(__file__).with_name('supervised.py'))


PATIENT = {**USER_ENVIRON, 'STOP_AT_MOST': '240'}


"""Where nothing is killed for want of time, however busy the machine is."""


WAIT = 'import signal; print("up", flush=True); signal.pause()'


STUBBORN = (
    'import signal\n'
    'for s in (signal.SIGTERM, signal.SIGINT): signal.signal(s, signal.SIG_IGN)\n'
    'print("up", flush=True)\n'
    'while True: signal.pause()'
)


FINISHED = 'import os; os.write(int(os.environ["LAUNCH_HEARTBEAT"]), b"F")'


PARENT = (
    'import subprocess, sys, signal\n'
    'child = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"])\n'
    'print("grandchild", child.pid, flush=True)\n'
    'signal.pause()'
)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_stop_signal_ends_all_and_counts_as_wanted(start, number):
    launch = start(DRIVER, f'one={WAIT}', f'two={WAIT}')
    pids = [int(launch.until(rf'started {n} \(process (\d+)\)')[1]) for n in ('one', 'two')]
    launch.until(r'one +\| up')
    launch.until(r'two +\| up')
    assert launch.end(number)[0] == 0
    assert gone(pids, 0)
    assert 'killed' not in '\n'.join(launch.lines)
    assert f'{number.name}: stopping' in '\n'.join(launch.lines)


def test_a_child_that_heeds_no_signal_and_does_nothing_is_killed(start):
    launch = start(DRIVER, f'deaf={STUBBORN}', f'grown={PARENT}', environ=PATIENT)
    deaf = int(launch.until(r'started deaf \(process (\d+)\)')[1])
    launch.until(r'deaf +\| up')
    grandchild = int(launch.until(r'grandchild (\d+)')[1])
    code, seconds = launch.end(signal.SIGINT)
    assert code == 0
    assert 2 < seconds < 200
    assert gone([deaf, grandchild])
    assert 'deaf did not end in time: killed' in '\n'.join(launch.lines)
    assert 'Traceback' not in '\n'.join(launch.lines)


HANGING = """
import threading
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node

class Hanging(PatrolNode):
    def __init__(self):
        super().__init__('hanging')

    def METHOD(self):
        threading.Event().wait()

run_node(Hanging, [])
"""


def test_a_node_that_hangs_says_where_unless_its_work_is_done(start, ros_domain):
    environ = {**USER_ENVIRON, 'ROS_DOMAIN_ID': str(ros_domain)}
    scripts = (('works', 'on_stop'), ('leaves', 'destroy_node'))
    programs = [f'{name}={HANGING.replace("METHOD", method)}' for name, method in scripts]
    launch = start(DRIVER, *programs, environ=environ)
    for name, _ in scripts:
        launch.until(rf'{name} +\| .*ready')
    assert launch.end(signal.SIGINT)[0] == 0
    output = '\n'.join(launch.lines)
    assert 'works did not end in time: killed' in output
    assert re.search(r'works +\| .* in on_stop', output)
    assert 'leaves has done its work' in output
    assert not re.search(r'leaves +\| .* in destroy_node', output)


WORKING = STUBBORN.replace('signal.pause()', 'pass')


def test_a_child_that_still_works_at_a_stop_is_waited_for(start):
    last_words = (
        'import signal, time\n'
        'stops = []\n'
        'signal.signal(signal.SIGTERM, lambda *_: stops.append(1))\n'
        'print("up", flush=True)\n'
        'while not stops: signal.pause()\n'
        f'end = time.monotonic() + {STOP_WITHIN + 1.0}\n'
        'while time.monotonic() < end: pass\n'
        'print("all is written", flush=True)'
    )
    launch = start(DRIVER, f'slow={last_words}', environ=PATIENT)
    launch.until(r'slow +\| up')
    assert launch.end(signal.SIGINT)[0] == 0
    assert 'all is written' in '\n'.join(launch.lines)
    assert 'killed' not in '\n'.join(launch.lines)


def test_another_ctrl_c_ends_at_once_but_not_the_echo_of_the_first(start):
    launch = start(DRIVER, f'deaf={WORKING}', environ=PATIENT)
    launch.until(r'deaf +\| up')
    # Both come at once, however long this process waits between two steps.
    for number in (signal.SIGSTOP, signal.SIGINT, signal.SIGTERM, signal.SIGCONT):
        launch.process.send_signal(number)
    launch.until('stopping')
    with pytest.raises(subprocess.TimeoutExpired):
        launch.process.wait(2 * STOP_AGAIN_AFTER)
    code, seconds = launch.end(signal.SIGINT)
    assert code == 0
    assert seconds < 200
    assert 'Traceback' not in '\n'.join(launch.lines)


def test_what_uses_the_others_is_stopped_before_them(start):
    polite = (
        'import signal, sys\n'
        'signal.signal(signal.SIGTERM, lambda *_: (print("leaving", flush=True), sys.exit(0)))\n'
        'print("up", flush=True)\n'
        'signal.pause()'
    )
    launch = start(DRIVER, f'lead={polite}', f'last={polite}')
    launch.until(r'lead +\| up')
    launch.until(r'last +\| up')
    assert launch.end(signal.SIGINT)[0] == 0
    leaving = [line.split()[1] for line in launch.lines if line.endswith('leaving')]
    assert leaving == ['lead', 'last']


def test_no_more_processes_come_up_at_once_than_allowed(start):
    slow = (
        'import os, signal\n'
        'print("coming", flush=True); input(); print("up", flush=True)\n'
        'os.write(int(os.environ["LAUNCH_HEARTBEAT"]), b"U"); signal.pause()'
    )
    programs = (f'one={slow}', f'two={FINISHED}', f'three={WAIT}')
    launch = start(DRIVER, *programs, environ={**USER_ENVIRON, 'AT_ONCE': '1'})
    launch.until(r'one +\| coming')
    launch.write('one go')
    launch.until(r'three +\| up')
    assert launch.end(signal.SIGINT)[0] == 0
    events = [line.split(' ', 1)[1] for line in launch.lines if ' | ' in line]
    ups = [re.sub(r' +\| ', ' ', e) for e in events if re.search(r'started|\| up', e)]
    assert [re.sub(r'^launch (started )?| \(.*', '', event) for event in ups] == [
        'one',
        'one up',
        'two',
        'three',
        'three up',
    ]


def test_restarts_wait_for_their_turn_as_first_starts_do(start):
    """All that died at once, as after a machine froze, would slow one another down."""
    slow = 'import signal; print("coming", flush=True); signal.pause()'
    launch = start(DRIVER, f'one={slow}', f'two={slow}', environ={**USER_ENVIRON, 'AT_ONCE': '1'})
    launch.until(r'one +\| coming')
    launch.until(r'two +\| coming')
    seen = len(launch.lines)
    for line in list(launch.lines):
        if match := re.search(r'started \w+ \(process (\d+)\)', line):
            os.kill(int(match[1]), signal.SIGKILL)
    launch.until(r'started one', after=seen)
    launch.until(r'started two', after=seen)
    starts = [line.split()[0] for line in launch.lines[seen:] if ' started ' in line]
    first, second = (float(start.rsplit(':', 1)[1]) for start in starts[:2])
    assert (second - first) % 60 > 1.0
    assert launch.end(signal.SIGINT)[0] == 0


def test_a_child_that_dies_comes_back_and_the_rest_goes_on(start):
    launch = start(DRIVER, f'one={WAIT}', f'two={WAIT}')
    first = int(launch.until(r'started one \(process (\d+)\)')[1])
    launch.until(r'one +\| up')
    seen = len(launch.lines)
    os.kill(first, signal.SIGKILL)
    launch.until(r'one died \(killed by SIGKILL\): starting it again in 0.01 s', after=seen)
    second = int(launch.until(r'started one \(process (\d+)\)', after=seen)[1])
    assert second != first
    launch.until(r'one +\| up', after=seen)
    assert launch.end(signal.SIGINT)[0] == 0
    assert sum('started two' in line for line in launch.lines) == 1


def test_each_node_of_a_process_is_named_and_lines_reach_the_process_that_holds_theirs(start):
    echo = 'print("got", input(), flush=True)\n'
    launch = start(DRIVER, f'one+two={WAIT}', f'three+four={echo}{WAIT}')
    first, second = (
        int(launch.until(rf'started {name} \(process (\d+)\)')[1]) for name in ('one', 'two')
    )
    assert first == second
    launch.write('four hello')
    launch.until('got hello')
    launch.until(r'one\+two +\| up')
    os.kill(first, signal.SIGKILL)
    for name in ('one', 'two'):
        launch.until(rf'{name} died \(killed by SIGKILL\): starting it again')
    launch.until(r'one\+two +\| up', after=len(launch.lines))
    assert launch.end(signal.SIGINT)[0] == 0


def test_pauses_grow_while_a_child_keeps_dying(start):
    launch = start(DRIVER, 'one=import sys; sys.exit(3)')
    launch.until(r'died \(exit code 3\): starting it again in 0.01 s')
    launch.until(r'starting it again in 0.02 s')
    assert launch.end(signal.SIGTERM)[0] == 0


@pytest.mark.parametrize('code', [2, os.EX_TEMPFAIL])
def test_a_child_that_cannot_be_configured_ends_the_launch(start, code):
    bad = f'print("cannot start: level is -1"); raise SystemExit({code})'
    launch = start(DRIVER, f'one={WAIT}', f'two={bad}')
    assert launch.end()[0] == code
    output = '\n'.join(launch.lines)
    assert 'cannot start: level is -1' in output
    assert 'two cannot start with this configuration' in output
    assert 'starting it again' not in output


def test_a_page_whose_port_is_taken_costs_a_line_and_not_the_mission(start):
    taken = f'print("Address already in use"); raise SystemExit({os.EX_TEMPFAIL})'
    launch = start(DRIVER, f'one={WAIT}', f'page={taken}')
    launch.until('page cannot start: the run goes on without it')
    assert launch.end(signal.SIGTERM)[0] == 0
    output = '\n'.join(launch.lines)
    assert 'Address already in use' in output
    assert 'starting it again' not in output


def test_a_child_that_says_it_has_finished_is_left_alone(start):
    launch = start(DRIVER, f'one={FINISHED}; print("bye", end="")')
    assert launch.end()[0] == 0
    assert any(line.endswith('| bye') for line in launch.lines)
    assert sum('started one' in line for line in launch.lines) == 1


def test_a_child_whose_work_is_the_run_is_not_begun_anew(start):
    launch = start(DRIVER, f'job={WAIT}', f'two={WAIT}')
    first = int(launch.until(r'started job \(process (\d+)\)')[1])
    launch.until(r'job +\| up')
    os.kill(first, signal.SIGKILL)
    assert launch.end()[0] == EXIT_CUT
    output = '\n'.join(launch.lines)
    assert 'job died (killed by SIGKILL): the run ends with what there is' in output
    assert output.count('started job') == 1


def test_a_line_of_input_reaches_the_named_child(start):
    echo = 'import sys\nfor line in sys.stdin: print("got", line.strip(), flush=True)'
    launch = start(DRIVER, f'one={echo}', f'two={echo}')
    launch.write('two battery set 15')
    launch.until(r'two +\| got battery set 15')
    launch.until('sent True')
    assert launch.process.stdin is not None
    launch.process.stdin.close()  # the end of input ends nothing
    assert launch.end(signal.SIGINT)[0] == 0


def test_the_time_to_run_ends_the_launch(start):
    environ = {**USER_ENVIRON, 'SECONDS_TO_RUN': '0.3'}
    launch = start(DRIVER, f'one={WAIT}', environ=environ)
    assert launch.end()[0] == 0
    assert 'the time is over' in '\n'.join(launch.lines)


DIES_AS_A_STOP_BEGINS = """
import os, sys
from launcher.log_merge import MergedLog
from launcher.supervisor import ManagedProcess, Supervisor

class Log(MergedLog):
    def line(self, name, text):
        # Between a child's death and the next look at it.
        os.waitid(os.P_PID, supervisor.children[name].process.pid, os.WEXITED | os.WNOWAIT)
        supervisor.stop()

program = ManagedProcess('one', [sys.executable, '-c', 'print("bye")'], os.environ)
supervisor = Supervisor([program], Log(None, ['one'], colour=False))
sys.exit(supervisor.run())
"""


def test_a_child_that_dies_as_a_stop_begins_is_no_trouble(start):
    launch = start('-c', DIES_AS_A_STOP_BEGINS)
    assert launch.end()[0] == 0
    assert 'every process has ended' in launch.lines[-1]


def test_a_reader_that_goes_away_ends_the_launch():
    chatty = 'while True: print("x" * 1000, flush=True)'
    with subprocess.Popen(
        [sys.executable, DRIVER, f'one={chatty}'],
        env=USER_ENVIRON,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as launch:
        assert launch.stdout is not None
        match = re.search(r'process (\d+)', launch.stdout.readline())
        assert match is not None
        launch.stdout.close()
        assert launch.wait(60.0) == 0
    assert gone([int(match[1])], 0)


def test_exit_codes_in_words():
    assert describe_exit(1) == 'exit code 1'
    assert describe_exit(-9) == 'killed by SIGKILL'
    assert describe_exit(-99) == 'killed by signal 99'
