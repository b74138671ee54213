"""Ctrl-C at any moment of a command: no traceback, no warning, nothing left behind."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading

import pytest

from tests.launcher.conftest import ROOT, gone

# The first two are spent before the commands part.
MOMENTS = [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.7, 1.1]
LATER = MOMENTS[2:9:2]


@pytest.mark.parametrize(
    ('command', 'moment'),
    [
        *itertools.product(['node armor_server'], MOMENTS),
        *itertools.product(['params', 'map config/office.yaml'], LATER),
    ],
)
def test_ctrl_c_leaves_no_traceback(command, moment, tmp_path, ros_domain):
    words = [sys.executable, str(ROOT / 'launch.py'), *command.split()]
    words += {
        'node': ['--domain', str(ros_domain)],
        'map': ['-o', str(tmp_path / 'x.png')],
    }.get(words[2], [])
    # Until launch.py takes it: Python's own start makes a traceback of it, or loses it.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        process = subprocess.Popen(
            words,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    with process:
        threading.Event().wait(moment)
        for _ in range(2):
            os.killpg(process.pid, signal.SIGINT)
        try:
            output, _ = process.communicate(timeout=60.0)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    assert 'Traceback' not in output, output
    assert 'never awaited' not in output
    assert gone([process.pid], 0)


def test_a_ctrl_c_that_python_drops_is_raised_before_the_next_step():
    program = (
        'import os, signal\n'
        'from launcher import interrupt\n'
        'class Dropping:\n'
        '    def __del__(self):\n'
        '        signal.raise_signal(signal.SIGINT)\n'
        'interrupt.raise_at_stop_signals()\n'
        'Dropping()\n'
        'print("dropped")\n'
        'try:\n'
        '    interrupt.hold_back()\n'
        'except KeyboardInterrupt:\n'
        '    print("raised")\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == 'dropped\nraised\n'
    assert done.stderr == ''


def test_a_ctrl_c_that_python_makes_another_error_of_is_one_line():
    program = (
        'import signal, sys\n'
        'from launcher import cli\n'
        'class Field:\n'
        '    def __set_name__(self, owner, name):\n'
        '        signal.raise_signal(signal.SIGINT)\n'
        'cli._dispatch = lambda argv: type("Settings", (), {"speed": Field()})\n'
        'sys.exit(cli.main([]))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], cwd=ROOT, capture_output=True, text=True, timeout=60.0
    )
    assert done.returncode == 130
    assert done.stderr.strip() == 'launch.py: interrupted'
