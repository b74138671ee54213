"""The one console on a real terminal."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import threading
import time
from functools import partial
from pathlib import Path

import pytest
from geometry_msgs.msg import Point

from state_machines.ros import GoalCaller
from surveillance_interfaces.action import ComputePath, FollowPath
from tests.launcher.conftest import USER_ENVIRON

PROCESS = str(Path(__file__).with_name('mission_process.py'))
ESCAPES = re.compile(rb'\x1b\[[0-9;?]*[a-zA-Z]')
WHERE_IS_THE_CURSOR, AT_THE_BOTTOM = b'\x1b[6n', b'\x1b[40;1R'


class Terminal:
    """A terminal with somebody at it."""

    def __init__(self, command: list[str]) -> None:
        self.ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack('HHHH', 40, 160, 0, 0))
        self.settings = termios.tcgetattr(theirs)
        self.theirs = theirs
        environ = {**USER_ENVIRON, 'TERM': 'xterm'}
        # Its own session's terminal, so that Ctrl-C between two prompts is a signal.
        words = ['setsid', '--ctty', *command]
        self.process = subprocess.Popen(
            words, stdin=theirs, stdout=theirs, stderr=theirs, env=environ
        )
        self.seen = b''

    def until(self, pattern: bytes, timeout: float = 240.0) -> None:
        deadline = time.monotonic() + timeout
        while not re.search(pattern, ESCAPES.sub(b'', self.seen)):
            readable, _, _ = select.select([self.ours], [], [], deadline - time.monotonic())
            assert readable, f'no {pattern!r} in {self.seen!r}'
            self.seen += os.read(self.ours, 65536)
            if WHERE_IS_THE_CURSOR in self.seen:
                self.seen = self.seen.replace(WHERE_IS_THE_CURSOR, b'')
                os.write(self.ours, AT_THE_BOTTOM)

    def type(self, keys: str) -> None:
        self.seen = b''
        os.write(self.ours, keys.encode())

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.ours)
        os.close(self.theirs)


@pytest.fixture
def terminal(tmp_path, ros_domain):
    nodes = 'battery_controller,planner_controller,motion_controller'
    options = ['--mode', 'MANUAL', '--only', nodes, '--domain', str(ros_domain)]
    terminal = Terminal([sys.executable, PROCESS, str(tmp_path), *options])
    yield terminal
    terminal.close()


def test_a_person_answers_a_mission_and_ctrl_c_gives_the_terminal_back(terminal, graph):
    def sent(action, name, goal):
        run = partial(GoalCaller(graph.node, action, name).run, goal, accept_timeout=60.0)
        ends = []
        threading.Thread(target=lambda: ends.append(run()), daemon=True).start()
        return ends

    terminal.until(rb'patrol>')
    # Its last line: later ones of its name would be taken for the word that is completed.
    terminal.until(rb'battery_controller.*ready')
    terminal.type('bat\t')
    terminal.until(rb'tery')
    terminal.type(' set 15\r')
    terminal.until(rb'The battery is at 15 %')
    terminal.until(rb'battery low: 15 %')
    planned = sent(ComputePath, 'compute_path', ComputePath.Goal(goal=Point(x=3.0)))
    terminal.until(rb'New request: compute a path')
    terminal.type('plan set [[1, 2, 0]]\r')
    graph.until(lambda: planned)
    path = planned[0].result.path
    assert [(point.x, point.y) for point in path] == [(0.0, 0.0), (1.0, 2.0), (3.0, 0.0)]
    moved = sent(FollowPath, 'follow_path', FollowPath.Goal(path=path))
    terminal.until(rb'New request: follow')
    terminal.type('move 0.1 0\r')
    graph.until(lambda: moved)
    assert moved[0].status == 'succeeded'
    terminal.type('exit planner_controller\r')
    terminal.until(rb'planner_controller has ended by itself')
    terminal.type('\x03')
    terminal.until(rb'every process has ended')
    assert terminal.process.wait(60.0) == 0
    assert termios.tcgetattr(terminal.theirs) == terminal.settings
