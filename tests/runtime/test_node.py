"""Parameters, threads and the life of a node's process."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from typing import Any

import pytest
from rclpy.parameter import Parameter

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError


class Patient(PatrolNode):
    """Declares one parameter of each kind."""

    def __init__(self, **node_options):
        super().__init__('patient', **node_options)
        self.heard = []
        self.level = self.parameter(
            'level', 50, 'Percent.', minimum=0, maximum=100, on_change=self.heard.append
        )
        self.speed = self.parameter('speed', 1.0, 'Metres per second.', minimum=0.0)
        self.mode = self.parameter('mode', 'RANDOM', 'Mode.', choices=('MANUAL', 'RANDOM'))
        self.rooms = self.parameter('rooms', [], 'Names.', of=str)
        self.even = self.parameter(
            'even', 2, 'Even.', check=lambda v: None if v % 2 == 0 else 'an even number'
        )


def test_defaults_and_overrides_have_the_declared_types(graph):
    node = graph.add(Patient, parameters={'level': 7, 'speed': 2, 'rooms': ['E', 'C1']})
    assert (node.level, node.speed, node.mode, node.rooms) == (7, 2.0, 'RANDOM', ['E', 'C1'])
    assert isinstance(node.speed, float)


@pytest.mark.parametrize(
    ('name', 'value', 'expected'),
    [
        ('level', 101, 'parameter level: got 101, expected an integer from 0 to 100'),
        ('level', 'full', "parameter level: got 'full', expected an integer from 0 to 100"),
        ('level', True, 'parameter level: got true, expected an integer from 0 to 100'),
        ('speed', -1.0, 'parameter speed: got -1.0, expected a number, at least 0.0'),
        ('mode', 'AUTO', "parameter mode: got 'AUTO', expected one of 'MANUAL', 'RANDOM'"),
        ('rooms', 'E', "parameter rooms: got 'E', expected a list of texts"),
        ('rooms', [1, 2], 'parameter rooms: got [1, 2], expected a list of texts'),
        ('even', 3, 'parameter even: got 3, expected an even number'),
    ],
)
def test_bad_value_is_refused_in_the_same_words_at_start_and_at_run_time(
    graph, name, value, expected
):
    with pytest.raises(ParameterError) as error:
        graph.add(Patient, parameters={name: value})
    assert str(error.value) == expected
    node = graph.add(Patient)
    result = node.set_parameters([Parameter(name, value=value)])[0]
    assert not result.successful
    assert result.reason == expected or 'out of range' in result.reason


def test_change_at_run_time_reaches_the_node(graph):
    node = graph.add(Patient)
    assert node.set_parameters([Parameter('level', value=12)])[0].successful
    assert node.heard == [12]


def test_parameters_below_a_prefix_come_in_order(graph):
    node = graph.add(
        PatrolNode, name='map', parameters={'map.R1': ['D1'], 'map.C1': ['D1', 'D2'], 'other': 1}
    )
    assert node.parameters_under('map') == {'R1': ['D1'], 'C1': ['D1', 'D2']}


def test_stop_wakes_and_joins_threads(graph):
    node = graph.add(PatrolNode, name='worker')
    started = threading.Event()
    ended = []

    def work():
        started.set()
        node.stopping.wait()
        ended.append(True)

    node.spawn(work)
    assert started.wait(60.0)
    node.stop()
    assert ended == [True]


def test_exception_in_a_thread_fails_the_node(graph, capsys):
    node = graph.add(PatrolNode, name='worker')

    def work():
        raise LookupError('no such place')

    node.spawn(work)
    assert node.ended.wait(60.0)
    assert node.failure == 'LookupError: no such place'


READY = r'\[INFO\] \[[\d.]+\] \[program\]: ready\n'
PROGRAM = """
import sys
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
class Program(PatrolNode):
    def __init__(self):
        super().__init__('program')
        self.parameter('level', 1, 'Level.', minimum=0, maximum=9)
        self.create_timer(0.0, lambda: print('spinning', flush=True))
    def on_stop(self):
        print('stopping', flush=True)
sys.exit(run_node(Program, sys.argv[1:]))
"""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_process_stops_cleanly_on_a_signal(number):
    process = subprocess.Popen(
        [sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == 'spinning\n'
    os.kill(process.pid, number)
    os.kill(process.pid, number)
    out, err = process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert 'stopping' in out
    assert re.fullmatch(READY, err)


SIGNALS_IN_EVERY_STEP = """
import signal, sys, threading
def trace(frame, event, argument):
    if frame.f_code.co_filename == threading.__file__:
        signal.raise_signal(signal.SIGTERM)
        return trace
class Traced(Program):
    def __init__(self):
        super().__init__()
        sys.settrace(trace)
    def on_stop(self):
        sys.settrace(None)
        super().on_stop()
sys.exit(run_node(Traced, []))
"""


def test_signals_in_the_middle_of_any_step_of_a_wait_stop_the_process():
    program = PROGRAM.rpartition('sys.exit')[0] + SIGNALS_IN_EVERY_STEP
    run = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, timeout=60
    )
    assert run.returncode == 0
    assert 'stopping' in run.stdout
    assert re.fullmatch(READY, run.stderr)


SIGNAL_ELSEWHERE = """
import signal, sys
class Deaf(Program):
    def __init__(self):
        super().__init__()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
sys.exit(run_node(Deaf, []))
"""


def test_a_signal_that_does_not_wake_the_main_thread_stops_the_process():
    # As one does that comes just before the wait, or that the system gives to another thread.
    program = PROGRAM.rpartition('sys.exit')[0] + SIGNAL_ELSEWHERE
    process = subprocess.Popen([sys.executable, '-c', program], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == 'spinning\n'
    process.terminate()
    try:
        out, _ = process.communicate(timeout=60.0)
    finally:
        process.kill()
    assert process.returncode == 0
    assert 'stopping' in out


@pytest.mark.parametrize(
    ('arguments', 'complaint'),
    [
        (['-p', 'level:=12'], 'parameter level: got 12, expected an integer from 0 to 9'),
        (['-p', 'level:=high'], "parameter level: got 'high', expected an integer from 0 to 9"),
        (['--params-file', 'missing.yaml'], 'parameter file missing.yaml: No such file'),
    ],
)
def test_process_with_a_bad_parameter_says_so_in_one_line(arguments, complaint):
    run = subprocess.run(
        [sys.executable, '-c', PROGRAM, '--ros-args', *arguments],
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    assert run.returncode == 2
    assert run.stderr.count('\n') == 1
    assert complaint in run.stderr


def test_process_with_a_parameter_given_twice_says_where(tmp_path):
    path = tmp_path / 'twice.yaml'
    path.write_text('/**:\n  ros__parameters:\n    level: 1\n    level: 2\n')
    run = subprocess.run(
        [sys.executable, '-c', PROGRAM, '--ros-args', '--params-file', str(path)],
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    assert run.returncode == 2
    complaint = f"parameter file {path}:4: duplicate key 'level', first given in line 3"
    assert run.stderr == f'cannot start: {complaint}\n'


def test_a_stop_waits_for_a_thread_that_is_just_being_started(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(PatrolNode, name='spawner')
    starting, go = threading.Event(), threading.Event()
    start = threading.Thread.start

    def slow_start(thread: threading.Thread) -> None:
        if thread.name == 'late':
            starting.set()
            assert go.wait(60.0)
        start(thread)

    failed: list[BaseException] = []

    def stop() -> None:
        try:
            node.stop()
        except RuntimeError as error:
            failed.append(error)

    monkeypatch.setattr(threading.Thread, 'start', slow_start)
    spawner = threading.Thread(target=lambda: node.spawn(node.stopping.wait, 'late'))
    spawner.start()
    assert starting.wait(60.0)
    stopper = threading.Thread(target=stop)
    stopper.start()
    assert node.stopping.wait(60.0)
    stopper.join(0.2)
    go.set()
    spawner.join(60.0)
    stopper.join(60.0)
    assert not failed
