"""What the launcher and the processes that it starts say to each other, exit codes included.

A process gets the descriptor of a pipe and its limits in environment variables, and writes bytes.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket

HEARTBEAT = 'LAUNCH_HEARTBEAT'
"""A descriptor that a process writes `UP`, `BEAT`, `SLEPT`, `FINISHED` or `DONE` to."""
RESTARTS = 'LAUNCH_RESTARTS'
"""How often the process has been started again."""
MEMORY = 'LAUNCH_MEMORY'
"""The bytes of data that the process may map."""

ONE_THREAD = dict.fromkeys(('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS'), '1')
"""Has the libraries behind NumPy and SciPy work on the calling thread alone, see `process`. They
read it when they are loaded, before a process can say so itself."""

LAUNCH, AGE = 'launch', 'launch_s'
"""Under these names a node tells on `/diagnostics` of which launch it is, and how old that is."""

FOR_THE_TERMINAL = '\x1e'
"""Begins a line that a process prints for the person at the terminal alone: it stands in no log."""

UP = b'U'
"""The bulk of its start is done."""
BEAT = b'.'
"""The process runs."""
SLEPT = b'S'
"""It did not run for so long that its peers may have forgotten it."""
FINISHED = b'F'
"""It ends on purpose."""
DONE = b'D'
"""Its nodes' work has ended: it has only to leave ROS. Fast DDS 2.14 was seen to block there for
ever, 18 s after a peer was killed; its issue 6502 tells of such a deadlock."""

SAY_WHERE = signal.SIGQUIT
"""Has a process say on stderr where each of its threads is, and end at once, whatever hangs."""

EXIT_CANNOT_START = 2
"""The exit code of a process whose configuration does not let it start."""
EXIT_NOT_NOW = os.EX_TEMPFAIL
"""That of one which what its configuration names does not let start now, but perhaps later."""


EXIT_THERE = 3
"""That of the look for other robots, see `duplicate_nodes`: there is one."""


class NotNowError(ValueError):
    """What is asked for cannot be had now, as an address or a file; it may be later, unchanged."""


def launch_of_process() -> tuple[str, float]:
    """Return who started this process (host and process), and for how many seconds that has run.

    All processes of one launch have one parent: `launch.py`, `ros2 launch` or `ros2 run`.
    """
    parent, age = os.getppid(), 0.0
    with contextlib.suppress(OSError, ValueError, IndexError):
        with open('/proc/uptime', encoding='ascii') as file:
            up = float(file.read().split()[0])
        with open(f'/proc/{parent}/stat', encoding='utf-8') as file:
            # Field 22 is when it began, in ticks since the machine did (proc(5)).
            ticks = int(file.read().rpartition(') ')[2].split()[19])
        age = up - ticks / os.sysconf('SC_CLK_TCK')
    return f'{socket.gethostname()}, process {parent}', age
