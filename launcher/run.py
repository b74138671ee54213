"""What one run of the robot is asked for: the options of `launch.py`, and what each takes.

Each option stands once, as a field of `Run`; `make_parser` reads them from the command line. It
needs no set-up: `--help` is said at once.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import shlex
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from launcher import package_commands
from launcher.environment import PROGRAM
from strict_files.files import FileError
from surveillance_runtime import node_table, parameter_checks
from surveillance_runtime.command_line import CommandParser, page_address
from surveillance_runtime.discovery import LAST_DOMAIN, problem_of
from surveillance_runtime.node_table import RESERVED
from surveillance_runtime.run_options import (
    BUILT_IN_ROBOT,
    KINEMATIC,
    OPTIONS,
    SIMULATORS,
    left_out,
)

NOT_RECORDED = 'off'
RECORDER, MARKERS, PAGE = node_table.RECORDER, node_table.MARKERS, 'mission_page'
ALARM = node_table.ALARM
OBSERVER = 'observer'
_REMAP = re.compile(r'[~/\w]+:=[~/\w]+\Z', re.ASCII)
_NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/[A-Za-z]\w*)*\Z', re.ASCII)
_DESCRIPTION = """\
Runs a patrol until Ctrl-C, or runs COMMAND. The first start sets up .venv."""
_COMMANDS = """\
commands (each has its own --help):
  run                       run a patrol: the same as without a command
  explore                   map a building by driving through it, and make a place of it
  node NAME [ROS args]      run one node in this terminal
  list                      list the nodes
  params [NODE]             print the value of each parameter and where it comes from
  service                   write a systemd unit that keeps the robot running
  setup                     only set up .venv
  lock                      write the lock file of this Python: packages by their hashes
  test [pytest args]        run the test suite
  lint                      check format, lint and types
"""
_PROCESSES, _TRACES, _PAGE_GROUP = 'how it runs', 'what it leaves behind', 'the page'
"""Groups of options that `run` has and `node` has not."""


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


def _option(flag: str, unset: Any = None, *, group: str = '', **argument: Any) -> Any:
    """Return a field of `Run` that an option sets.

    Args:
        flag: As it is typed.
        unset: Default of the field, and of the option where `argument` has no other one.
        group: The group in the help text; empty: one that `node` has, too.
        **argument: As `argparse` takes it.
    """
    default = [] if unset == () else unset  # argparse appends to it
    argument = {'default': default, **argument}
    return field(default=unset, metadata={'flag': flag, 'group': group, 'argument': argument})


def _switch(flag: str, help_text: str, group: str) -> Any:
    return _option(flag, False, group=group, action='store_true', help=help_text)


def _nodes_option(flag: str, help_text: str) -> Any:
    return _option(
        flag,
        (),
        group=_PROCESSES,
        type=_names,
        action='extend',
        metavar='NODE,...',
        help=help_text,
    )


@dataclass(frozen=True)
class Run:
    """What the command line asks for; None where the user says nothing.

    Without a command line nothing is recorded.
    """

    mode: str | None = _option(
        '--mode',
        choices=node_table.MODES,
        type=str.upper,
        metavar='|'.join(node_table.MODES),
        help=f'{OPTIONS["mode"].help} (default: {node_table.DEFAULT_MODE})',
    )
    behaviour: str = _option(
        '--behaviour',
        node_table.DEFAULT_BEHAVIOUR,
        choices=node_table.BEHAVIOURS,
        metavar='|'.join(node_table.BEHAVIOURS),
        help=f'{OPTIONS["behaviour"].help} (default: %(default)s)',
    )
    place: Path | None = _option(
        '--map',
        type=Path,
        metavar='FILE',
        help=OPTIONS['map'].help,
    )
    robot: str = _option(
        '--robot',
        BUILT_IN_ROBOT,
        metavar='NAME|FILE',
        help=f'{OPTIONS["robot"].help} (default: %(default)s)',
    )
    robots: int | None = _option(
        '--robots',
        type=_number(int, 'a number of robots from 1 to 100', lambda value: 1 <= value <= 100),
        metavar='N',
        help=OPTIONS['robots'].help,
    )
    simulator: str = _option(
        '--simulator',
        KINEMATIC,
        choices=SIMULATORS,
        metavar='|'.join(SIMULATORS),
        help=f'{OPTIONS["simulator"].help} (default: %(default)s)',
    )
    remaps: Sequence[str] = _option(
        '--remap',
        (),
        action='append',
        metavar='FROM:=TO',
        help=OPTIONS['remap'].help,
    )
    parameters: Path | None = _option(
        '--params',
        type=Path,
        metavar='FILE',
        help=OPTIONS['params'].help,
    )
    assignments: Sequence[str] = _option(
        '-p',
        (),
        action='append',
        metavar='[NODE:]NAME:=VALUE',
        help='set a parameter; it overrides every file',
    )
    log_level: str | None = _option(
        '--log-level',
        choices=node_table.LOG_LEVELS,
        type=str.lower,
        metavar='|'.join(node_table.LOG_LEVELS),
        help=f'{OPTIONS["log_level"].help} (default: {OPTIONS["log_level"].default})',
    )
    namespace: str | None = _option('--namespace', metavar='NAME', help=OPTIONS['namespace'].help)
    domain: int | None = _option(
        '--domain',
        type=int,
        metavar='N',
        help='ROS domain, 0 to 101; robots in different domains do not hear each other '
        '(default: ROS_DOMAIN_ID, else 0)',
    )
    seconds: float | None = _option(
        '--for',
        group=_PROCESSES,
        type=_number(float, 'a positive number of seconds', lambda value: 0.0 < value < 1e9),
        metavar='SECONDS',
        help='stop after this time (default: at Ctrl-C)',
    )
    processes: str = _option(
        '--processes',
        node_table.FEW,
        group=_PROCESSES,
        choices=node_table.COMPOSITIONS,
        metavar='|'.join(node_table.COMPOSITIONS),
        help=f'{OPTIONS["processes"].help} (default: %(default)s)',
    )
    only: Sequence[str] = _nodes_option('--only', OPTIONS['only'].help)
    without: Sequence[str] = _nodes_option('--without', OPTIONS['without'].help)
    memory: int = _option(
        '--memory',
        2048,
        group=_PROCESSES,
        type=_number(
            int,
            'a number of megabytes from 100, or 0',
            lambda value: value == 0 or 100 <= value < 1e7,
        ),
        metavar='MB',
        help='restart a node that uses more memory; 0: no limit (default: %(default)s)',
    )
    alarm: str = _option(
        '--alarm',
        '',
        group=_PROCESSES,
        metavar='COMMAND',
        help=OPTIONS['alarm'].help,
    )
    notify: Path | None = _option(
        '--notify',
        group=_PROCESSES,
        type=Path,
        metavar='FILE',
        help=OPTIONS['notify'].help,
    )
    network: str = _option(
        '--network',
        '',
        group=_PROCESSES,
        metavar='localhost|NAME.xml|open',
        help=OPTIONS['network'].help,
    )
    record: str | None = _option(
        '--record',
        NOT_RECORDED,
        group=_TRACES,
        default=None,
        metavar='off|DIR',
        help=f'{OPTIONS["record"].help}; off: no recording (default: runs)',
    )
    keep: float = _option(
        '--keep',
        20.0,
        group=_TRACES,
        type=_number(float, 'a number of gigabytes', lambda value: 0.0 <= value < 1e6),
        metavar='GB',
        help='delete the oldest recordings when all together exceed this (default: %(default)g)',
    )
    watch: Path | None = _option(
        '--watch',
        group=_TRACES,
        type=Path,
        metavar='FILE',
        help=OPTIONS['watch'].help,
    )
    stage: Path | None = _option(
        '--stage',
        group=_TRACES,
        type=Path,
        metavar='FILE',
        help=OPTIONS['stage'].help,
    )
    fresh: bool = _switch('--fresh', 'begin a new run even if the last one was killed', _TRACES)
    web: bool = _switch('--web', OPTIONS['web'].help, _PAGE_GROUP)
    web_control: bool = _switch('--web-control', OPTIONS['web_control'].help, _PAGE_GROUP)
    web_address: str | None = _option(
        '--web-address',
        group=_PAGE_GROUP,
        metavar='HOST:PORT',
        help=f'{OPTIONS["web_address"].help} (default: 127.0.0.1:8080)',
    )
    web_origin: str | None = _option(
        '--web-origin',
        group=_PAGE_GROUP,
        metavar='URL',
        help=OPTIONS['web_origin'].help,
    )

    def check(self) -> None:
        """Look at everything that can be wrong before a process is started.

        Raises:
            ValueError: a value cannot be used.
        """
        if self.namespace is not None and not _NAMESPACE.match(self.namespace):
            raise ValueError(
                f'--namespace {self.namespace!r}: expected letters, digits and _ like robot1'
            )
        if self.domain is not None and not 0 <= self.domain <= LAST_DOMAIN:
            raise ValueError(f'--domain {self.domain}: expected a number from 0 to {LAST_DOMAIN}')
        if self.network and (problem := problem_of(self.network, os.environ)):
            raise ValueError(f'--network {problem}')
        if self.place is not None:
            from floor_plans import read_place  # needs a set-up

            try:
                read_place(self.place, reserved=RESERVED)
            except FileError as error:
                raise ValueError(f'--map {error}') from None
        if self.stage is not None:
            from surveillance_simulation.staging import read_script

            try:
                read_script(self.stage)
            except FileError as error:
                raise ValueError(f'--stage {error}') from None
        for text in self.remaps:
            if not _REMAP.match(text):
                raise ValueError(f'--remap {text!r}: expected FROM:=TO like scan:=front/scan')
        if self.web_address is not None:
            page_address(self.web_address)
        if expected := parameter_checks.web_origin(self.web_origin or ''):
            raise ValueError(f'--web-origin {self.web_origin!r}: expected {expected}')
        try:
            alarm = shlex.split(self.alarm)
        except ValueError as error:
            raise ValueError(f'--alarm {self.alarm!r}: {error}') from None
        if alarm and shutil.which(alarm[0]) is None:
            raise ValueError(f'--alarm {self.alarm!r}: {alarm[0]!r} cannot be run')
        if self.notify is not None:
            from surveillance_operator.notify.sinks import read_notify_file, sink_of

            try:
                for sink in read_notify_file(self.notify):
                    sink_of(sink)
            except (FileError, ValueError) as error:
                raise ValueError(f'--notify {error}') from None

    def nodes(self, *, monitored: bool = True) -> tuple[node_table.Node, ...]:
        """Return the nodes that work; without what monitors a base that others monitor."""
        chosen = node_table.select(
            self.mode or node_table.DEFAULT_MODE,
            self.behaviour,
            self.only,
            left_out(self.simulator, self.without),
            monitored=monitored,
        )
        asks = self.mode == 'MANUAL' and any(node.has_modes for node in chosen)
        # First, so that it is there for what is typed at once.
        return (node_table.find(node_table.CONSOLE), *chosen) if asks else chosen

    def observers(self) -> tuple[node_table.Node, ...]:
        """Return the nodes that only look on; they start last.

        With `only` nothing is recorded, an exploration apart, which is a whole run; what was asked
        for by its own option starts.
        """
        names = []
        if not self.only or self.alarm or self.notify is not None:
            names.append(ALARM)
        is_whole = not self.only or node_table.EXPLORER in self.only
        if self.record != NOT_RECORDED and is_whole:
            names += [RECORDER, MARKERS]
        if self.watch is not None:
            names.append(OBSERVER)
        if self.has_page:
            names.append(PAGE)
        return tuple(node_table.find(name) for name in names)

    @property
    def has_page(self) -> bool:
        """Whether the mission is shown in browsers; an address or origin asks for that, too."""
        given = (self.web_address, self.web_origin)
        return self.web or self.web_control or any(each is not None for each in given)


def shared_options() -> argparse.ArgumentParser:
    """Options of `run` and of `node`."""
    parser = CommandParser(add_help=False)
    _add_options(parser, '')
    return parser


def make_parser(*, help_too: bool = True) -> argparse.ArgumentParser:
    """Return the parser of the whole command line."""
    package_lines = ''.join(
        f'  {name:<25} {purpose}\n' for name, (_, purpose) in package_commands.COMMANDS.items()
    )
    parser = CommandParser(
        prog=PROGRAM,
        description=_DESCRIPTION,
        usage='%(prog)s [COMMAND] [options]',
        epilog=_COMMANDS + package_lines,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[shared_options()],
        add_help=help_too,
    )
    for title in (_PROCESSES, _TRACES, _PAGE_GROUP):
        group = parser.add_argument_group(title)
        _add_options(group, title)
        if title == _TRACES:
            group.add_argument(
                '--resume',
                nargs='?',
                const='',
                metavar='RUN',
                help='continue this run (default: the last one) with its record, ontology and '
                'battery; automatic when the last run was killed',
            )
    return parser


def _add_options(parser: argparse._ActionsContainer, group: str) -> None:
    for each in fields(Run):
        if each.metadata['group'] == group:
            parser.add_argument(each.metadata['flag'], dest=each.name, **each.metadata['argument'])
    if group == _PROCESSES:
        parser.add_argument(
            '--composed',
            dest='processes',
            action='store_const',
            const=node_table.ONE,
            help=f'the same as --processes {node_table.ONE}',
        )


def wanted_run(options: argparse.Namespace) -> Run:
    """Return what the options of `run`, or those that `node` has of them, ask for."""
    wanted = {each.name for each in fields(Run)}
    return Run(**{name: value for name, value in vars(options).items() if name in wanted})
