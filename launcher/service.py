"""The robot as a service of the user's systemd, and what it is told while it runs."""

from __future__ import annotations

import contextlib
import os
import shlex
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

from launcher.environment import INSTALLED, PROGRAM

UNIT = 'surveillance.service'
_SOCKET = 'NOTIFY_SOCKET'
_PROCESS = 'SYSTEMD_EXEC_PID'
"""The process that systemd started: what that starts inherits the socket, but is not the service.

systemd.exec(5); before version 248 nothing tells."""
_TEXT = """\
# Written by: python3 launch.py service
[Unit]
Description=Surveillance robot
StartLimitIntervalSec=0

[Service]
Type=notify
NotifyAccess=main
ExecStart={command}
WorkingDirectory={folder}
WatchdogSec=30
Restart=always
RestartSec=1
# A configuration that cannot work does not get better by itself.
RestartPreventExitStatus=2
SuccessExitStatus=130
KillMode=mixed
TimeoutStartSec=15min
TimeoutStopSec=20
MemoryMax={memory}M

[Install]
WantedBy=default.target
"""


def unit_text(checkout: Path, arguments: Sequence[str], memory: int) -> str:
    """Return a unit that runs `launch.py` with these arguments.

    Args:
        checkout: The folder of `launch.py`.
        arguments: Of the command `run`.
        memory: Megabytes that the whole service may hold.
    """
    # The interpreter below the environment, which outlives it.
    python = getattr(sys, '_base_executable', sys.executable)
    program = [python, str(checkout / 'launch.py')]
    if INSTALLED:
        program = [str(Path(sys.prefix) / 'bin' / PROGRAM)]
    words = [*program, 'run', *arguments]
    # Also within quotes systemd reads a backslash as C does, % as a specifier, $ as a variable.
    command = shlex.join(words).replace('\\', '\\\\').replace('%', '%%').replace('$', '$$')
    folder = str(checkout).replace('%', '%%')
    return _TEXT.format(command=command, folder=folder, memory=memory)


def unit_path() -> Path:
    """Return where the user's own units lie."""
    home = os.environ.get('XDG_CONFIG_HOME') or os.path.expanduser('~/.config')
    return Path(home, 'systemd', 'user', UNIT)


def is_service() -> bool:
    """Tell whether this process is the service that systemd started and takes messages from."""
    started = os.environ.get(_PROCESS, str(os.getpid()))
    return os.environ.get(_SOCKET, '')[:1] in ('/', '@') and started == str(os.getpid())


def notify(text: str) -> None:
    """Tell systemd something, such as `READY=1`; nothing happens where it does not listen."""
    if not is_service():
        return
    address = os.environ[_SOCKET]
    kind = socket.SOCK_DGRAM | socket.SOCK_NONBLOCK  # a systemd that hangs is not waited for
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, kind) as sender:
        # A leading @ stands for the zero byte of an abstract name (sd_notify(3)).
        sender.sendto(text.encode(), f'\0{address[1:]}' if address[0] == '@' else address)
