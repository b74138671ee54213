"""The options of `launch.py`, and what each takes."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from launcher import package_commands
from surveillance_runtime import node_table
from surveillance_runtime.command_line import CommandParser

DEFAULT_KEEP = 20.0
DEFAULT_MEMORY = 2048
_DESCRIPTION = """\
Runs a patrol until Ctrl-C, each node in its own process, or runs COMMAND. The first start sets up
.venv."""
_COMMANDS = """\
commands (each has its own --help):
  run                       run a patrol: the same as without a command
  node NAME [ROS args]      run one node in this terminal
  list                      list the nodes
  params [NODE]             print the value of each parameter and where it comes from
  service                   write a systemd unit that keeps the robot running
  setup                     only set up .venv
  test [pytest args]        run the test suite
  lint                      check format, lint and types
"""


def _names(text: str) -> list[str]:
    names = [name for name in text.replace(' ', '').split(',') if name]
    if not names:
        raise argparse.ArgumentTypeError(f'{text!r} names no node')
    return names


def _number(
    kind: type[float], expected: str, fits: Callable[[float], bool]
) -> Callable[[str], Any]:
    """Return what reads an option's number, an `int` or a `float`."""

    def read(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not fits(value):
            raise argparse.ArgumentTypeError(f'{text!r} is not {expected}')
        return value

    return read


def shared_options() -> argparse.ArgumentParser:
    """Options of `run` and of `node`."""
    parser = CommandParser(add_help=False)
    parser.add_argument(
        '--mode',
        choices=node_table.MODES,
        type=str.upper,
        metavar='|'.join(node_table.MODES),
        help='what replaces the hardware: a simulation, random values, or you at the console '
        f'(default: {node_table.DEFAULT_MODE})',
    )
    parser.add_argument(
        '--behaviour',
        choices=node_table.BEHAVIOURS,
        default=node_table.DEFAULT_BEHAVIOUR,
        metavar='|'.join(node_table.BEHAVIOURS),
        help='surveillance starts with a map, patrol learns it from markers (default: %(default)s)',
    )
    parser.add_argument(
        '--map',
        dest='place',
        type=Path,
        metavar='FILE',
        help='the place (default: config/seven_rooms.yaml, for patrol config/patrol_world.yaml)',
    )
    parser.add_argument(
        '--params',
        dest='parameters',
        type=Path,
        metavar='FILE',
        help='a ROS parameter file; it overrides config/parameters.yaml and the place',
    )
    parser.add_argument(
        '-p',
        dest='assignments',
        action='append',
        default=[],
        metavar='[NODE:]NAME:=VALUE',
        help='set a parameter; it overrides every file',
    )
    parser.add_argument(
        '--log-level',
        choices=node_table.LOG_LEVELS,
        type=str.lower,
        metavar='|'.join(node_table.LOG_LEVELS),
        help='lowest severity that the nodes print (default: info)',
    )
    parser.add_argument(
        '--namespace', metavar='NAME', help='prefix of all ROS names, for a second robot'
    )
    parser.add_argument(
        '--domain',
        type=int,
        metavar='N',
        help='ROS domain, 0 to 101; robots in different domains do not hear each other '
        '(default: ROS_DOMAIN_ID, else 0)',
    )
    return parser


def make_parser(*, help_too: bool = True) -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    package_lines = ''.join(
        f'  {name:<25} {purpose}\n' for name, (_, purpose) in package_commands.COMMANDS.items()
    )
    parser = CommandParser(
        prog='launch.py',
        description=_DESCRIPTION,
        usage='%(prog)s [COMMAND] [options]',
        epilog=_COMMANDS + package_lines,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[shared_options()],
        add_help=help_too,
    )
    _add_process_options(parser.add_argument_group('how it runs'))
    _add_recording_options(parser.add_argument_group('what it leaves behind'))
    _add_page_options(parser.add_argument_group('the page'))
    return parser


def _add_process_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--for',
        dest='seconds',
        type=_number(float, 'a positive number of seconds', lambda value: 0.0 < value < 1e9),
        metavar='SECONDS',
        help='stop after this time (default: at Ctrl-C)',
    )
    group.add_argument(
        '--composed',
        action='store_true',
        help='run all nodes in one process: less memory, faster start',
    )
    group.add_argument(
        '--only',
        type=_names,
        action='extend',
        default=[],
        metavar='NODE,...',
        help='start only these nodes; the others run elsewhere',
    )
    group.add_argument(
        '--without',
        type=_names,
        action='extend',
        default=[],
        metavar='NODE,...',
        help='do not start these nodes; they run elsewhere',
    )
    group.add_argument(
        '--memory',
        type=_number(
            int,
            'a number of megabytes from 100, or 0',
            lambda value: value == 0 or 100 <= value < 1e7,
        ),
        default=DEFAULT_MEMORY,
        metavar='MB',
        help='restart a node that uses more memory; 0: no limit (default: %(default)s)',
    )
    group.add_argument(
        '--alarm',
        default='',
        metavar='COMMAND',
        help='run this when the robot needs a person; the last argument says why',
    )
    group.add_argument(
        '--network',
        action='store_true',
        help='talk to nodes on other machines, which can then control the robot (default: only '
        'this machine)',
    )


def _add_recording_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--record',
        metavar='off|DIR',
        help='folder for the files of runs; off: no recording (default: runs)',
    )
    group.add_argument(
        '--keep',
        type=_number(float, 'a number of gigabytes', lambda value: 0.0 <= value < 1e6),
        default=DEFAULT_KEEP,
        metavar='GB',
        help='delete the oldest recordings when all together exceed this (default: %(default)g)',
    )
    group.add_argument(
        '--resume',
        nargs='?',
        const='',
        metavar='RUN',
        help='continue this run (default: the last one) with its record, ontology and battery; '
        'automatic when the last run was killed',
    )
    group.add_argument(
        '--fresh',
        action='store_true',
        help='begin a new run even if the last one was killed',
    )


def _add_page_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--web', action='store_true', help='serve a live page; its address is printed'
    )
    group.add_argument(
        '--web-control',
        action='store_true',
        help='like --web, with controls for whoever has the printed token',
    )
    group.add_argument(
        '--web-address',
        metavar='HOST:PORT',
        help='address of the page; implies --web; other addresses than 127.0.0.1 need the printed '
        'token even to look (default: 127.0.0.1:8080)',
    )
