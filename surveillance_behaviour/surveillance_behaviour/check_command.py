"""The ``check-behaviour`` command: check the machines of the robot, or any other, before they run.

It executes no state and needs no ROS. The exit code is 0 when nothing is wrong, 1 when something
is, 2 when a machine cannot be built.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence

from state_machines import Container
from state_machines.clock import WALL_CLOCK
from state_machines.export import to_ascii, to_graphviz, to_mermaid
from state_machines.verify import Finding, verify
from strict_files.suggestions import nearest
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.machines import MACHINES
from surveillance_behaviour.mission.mission import Mission, MissionSettings
from surveillance_behaviour.ports import Ports
from surveillance_runtime.command_line import CommandParser

DRAWINGS: dict[str, Callable[[Container], str]] = {
    'mermaid': to_mermaid,
    'graphviz': to_graphviz,
    'ascii': to_ascii,
}


class _Nobody:
    """Stands where a peer would: machines are built, not run."""

    def __getattr__(self, name: str) -> object:
        raise AttributeError(f'no peer to ask for {name!r} while a machine is only checked')


def build(name: str) -> Container:
    """Build one of the robot's machines with nobody to talk to, or one given as ``module:factory``.

    Args:
        name: A name in `MACHINES`, or a module and a function in it that takes no argument.

    Raises:
        ValueError: There is no such machine.
    """
    if name in MACHINES:
        nobody = _Nobody()
        ports = Ports(nobody, nobody, nobody, nobody)  # type: ignore[arg-type]
        mission = Mission(name, MissionSettings(), ports, BatteryMonitor(), WALL_CLOCK)
        machine: object = MACHINES[name](mission)
    else:
        module_name, _, factory_name = name.partition(':')
        if not factory_name:
            raise ValueError(
                f"no machine '{name}': expected {nearest(name, MACHINES)}, or module:factory"
            )
        try:
            module = importlib.import_module(module_name)
        except ImportError as error:
            raise ValueError(f"machine '{name}': {error}") from error
        factory = getattr(module, factory_name, None)
        if not callable(factory):
            raise ValueError(f"machine '{name}': '{module_name}' has no function '{factory_name}'")
        machine = factory()
    if not isinstance(machine, Container):
        raise ValueError(f"machine '{name}' is a {type(machine).__name__}, expected a container")
    if machine.get_name() == type(machine).__name__:
        machine.set_name(name.rpartition(':')[2].upper())
    return machine


def report(name: str, findings: Sequence[Finding]) -> str:
    """Say in a few lines what is wrong with a machine."""
    errors = sum(finding.severity == 'error' for finding in findings)
    warnings = len(findings) - errors
    verdict = 'ok' if not findings else f'{errors} errors, {warnings} warnings'
    return '\n'.join([f'{name}: {verdict}', *(f'  {finding}' for finding in findings)])


def main(args: Sequence[str] | None = None) -> int:
    """Check machines; returns the exit code."""
    parser = CommandParser(
        prog='launch.py check-behaviour', description='Check state machines without running them.'
    )
    parser.add_argument(
        'machine',
        nargs='*',
        help=f'{", ".join(MACHINES)}, or module:factory of any other machine (default: all)',
    )
    parser.add_argument('--strict', action='store_true', help='let warnings fail the check, too')
    parser.add_argument(
        '--userdata',
        default='',
        metavar='KEY,...',
        help='userdata keys that will be set before the machine runs',
    )
    parser.add_argument('--draw', choices=sorted(DRAWINGS), help='print a drawing of each machine')
    options = parser.parse_args(args)
    keys = [key for key in options.userdata.split(',') if key]
    failed = False
    for name in options.machine or MACHINES:
        try:
            machine = build(name)
        except Exception as error:
            print(f'{name}: cannot be built: {error}', file=sys.stderr)
            return 2
        findings = verify(machine, keys)
        if options.draw:
            print(DRAWINGS[options.draw](machine), end='')
            print(report(name, findings), file=sys.stderr)
        else:
            print(report(name, findings))
        failed |= any(options.strict or finding.severity == 'error' for finding in findings)
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main())
