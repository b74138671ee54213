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
Patrols, with every node as a process of its own, until Ctrl-C; or does what COMMAND says. What the
project needs is set up first, where it is not yet."""
_COMMANDS = """\
commands (each has its own --help):
  run                       patrol: the same as without a command
  node NAME [ROS args]      run one node by itself in this terminal
  list                      name the nodes
  params [NODE]             print every parameter's value and where it comes from
  service                   write a systemd unit that keeps the robot running
  setup                     set up and do no more
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
        help='what stands in for the hardware: a simulated place, chance, or you at the console '
        f'(default: {node_table.DEFAULT_MODE})',
    )
    parser.add_argument(
        '--behaviour',
        choices=node_table.BEHAVIOURS,
        default=node_table.DEFAULT_BEHAVIOUR,
        metavar='|'.join(node_table.BEHAVIOURS),
        help='surveillance knows its map, patrol learns it from markers (default: %(default)s)',
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
        help='a ROS parameter file; what it says goes before config/parameters.yaml and the place',
    )
    parser.add_argument(
        '-p',
        dest='assignments',
        action='append',
        default=[],
        metavar='[NODE:]NAME:=VALUE',
        help='set a parameter; goes before every file',
    )
    parser.add_argument(
        '--log-level',
        choices=node_table.LOG_LEVELS,
        type=str.lower,
        metavar='|'.join(node_table.LOG_LEVELS),
        help='the least severity that the nodes print (default: info)',
    )
    parser.add_argument(
        '--namespace', metavar='NAME', help='goes before all names, for a second robot'
    )
    parser.add_argument(
        '--domain',
        type=int,
        metavar='N',
        help='ROS domain, 0 to 101: robots in different ones do not hear each other '
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
        help='all nodes in one process, which takes less memory and starts sooner',
    )
    group.add_argument(
        '--only',
        type=_names,
        action='extend',
        default=[],
        metavar='NODE,...',
        help='start these nodes and no others: the rest runs elsewhere',
    )
    group.add_argument(
        '--without',
        type=_names,
        action='extend',
        default=[],
        metavar='NODE,...',
        help='start all but these nodes, which run elsewhere',
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
        help='a node that holds more is started again; 0: any (default: %(default)s)',
    )
    group.add_argument(
        '--alarm',
        default='',
        metavar='COMMAND',
        help='run this, with one line as its last argument, when the robot needs somebody',
    )
    group.add_argument(
        '--network',
        action='store_true',
        help='hear nodes of other machines, which may then steer the robot (default: this machine)',
    )


def _add_recording_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--record',
        metavar='off|DIR',
        help='where the run keeps its recording, log and record; off: no recording (default: runs)',
    )
    group.add_argument(
        '--keep',
        type=_number(float, 'a number of gigabytes', lambda value: 0.0 <= value < 1e6),
        default=DEFAULT_KEEP,
        metavar='GB',
        help='delete the oldest recordings beyond this size (default: %(default)g)',
    )
    group.add_argument(
        '--resume',
        nargs='?',
        const='',
        metavar='RUN',
        help='go on with this run (default: the last one), its record, ontology and levels; done '
        'by itself where that had not come to its end',
    )
    group.add_argument(
        '--fresh',
        action='store_true',
        help='begin anew also where the last run had not come to its end',
    )


def _add_page_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        '--web', action='store_true', help='show the mission in browsers, see the printed address'
    )
    group.add_argument(
        '--web-control', action='store_true', help='as --web, and let whoever has the token act'
    )
    group.add_argument(
        '--web-address',
        metavar='HOST:PORT',
        help='as --web, and where: beyond 127.0.0.1 it needs the token (default: 127.0.0.1:8080)',
    )
