"""The commands that belong to packages: where their code is, and what they say to `--help`.

Their help is kept in a file (`launch.py params --write` writes it), so that it is said at once and
without a set-up.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import os
import signal
from collections.abc import Callable
from pathlib import Path

COMMANDS = {
    'watch': ('surveillance_operator.watch_command', 'show a running mission in this terminal'),
    'console': (
        'surveillance_operator.watch_command:console',
        'one prompt for a running mission: answers, doors, rooms, why, go',
    ),
    'fleet': (
        'surveillance_operator.fleet_command',
        'show the robots of a fleet; pause, go, stop, release, out, in for one or all',
    ),
    'doctor': (
        'surveillance_operator.doctor_command',
        'say what a mission awaits of a robot, what comes, and what is missing',
    ),
    'urdf': ('surveillance_operator.urdf_command', "print a robot's description as a URDF"),
    'replay': ('surveillance_operator.replay', 'show a recorded mission in a browser'),
    'report': ('surveillance_operator.report', 'write what a mission did into one HTML file'),
    'map': ('surveillance_operator.map_command', 'check a place and draw it as a picture'),
    'edit': (
        'surveillance_operator.place_page.edit_command',
        'change a place in a browser: rooms, doors, zones, rules',
    ),
    'import': ('surveillance_operator.import_command', 'make a place of a map'),
    'detect': ('surveillance_perception.detect_command', 'find ArUco markers in pictures'),
    'check-behaviour': (
        'surveillance_behaviour.check_command',
        'check the state machines and draw them',
    ),
}
"""Module and function (`main` unless named), which takes the arguments, and purpose; by name."""
HELP = Path(__file__).with_name('package_help.json')


def main_of(name: str) -> Callable[[list[str]], int]:
    """Return what carries a command out; imports its module."""
    # A Ctrl-C waits: in the middle of an import a library may make an error of its own of it.
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        where, _, function = COMMANDS[name][0].partition(':')
        command = getattr(importlib.import_module(where), function or 'main')
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    return lambda argv: int(command(argv) or 0)


def help_of(name: str) -> str:
    """Return what a command says to `--help`, empty where nobody has written that down."""
    if not HELP.exists():
        return ''
    return str(json.loads(HELP.read_text(encoding='utf-8')).get(name, ''))


def all_helps() -> dict[str, str]:
    """Return what each command says to `--help` now, by name; imports all of them."""
    return {name: printed(main_of(name), ['--help']) for name in COMMANDS}


def printed(command: Callable[[list[str]], int], argv: list[str]) -> str:
    """Return what a command prints, 80 columns wide and without colours."""
    from unittest import mock  # here: `--help` of the launcher is to be quick

    said = io.StringIO()
    with (
        mock.patch.dict(os.environ, COLUMNS='80', NO_COLOR='1'),
        contextlib.redirect_stdout(said),
        contextlib.suppress(SystemExit),
    ):
        command(argv)
    return said.getvalue()
