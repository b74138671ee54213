"""The processes of a run: their commands, their environment, and which nodes share one."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from launcher.environment import interpreter
from launcher.fleet_launch import RobotProcesses
from launcher.log_merge import ROS_FORMAT
from launcher.run import PAGE, Run
from launcher.supervisor import ManagedProcess
from surveillance_runtime import node_table
from surveillance_runtime.composition import in_order
from surveillance_runtime.discovery import LAST_DOMAIN, launched_nodes
from surveillance_runtime.launch_protocol import ONE_THREAD
from surveillance_runtime.run_parameters import BEHAVIOUR_NODE

NODE_PROCESS = Path(__file__).with_name('node_process.py')
SHARE_OF_SEVERAL = 3
"""So many times the memory of one node nodes of one process may hold together."""


def ros_domain(run: Run) -> str:
    """Return the ROS domain of a run: as asked for, else as the environment says.

    Raises:
        ValueError: what the environment says is no domain.
    """
    if run.domain is not None:
        return str(run.domain)
    given = os.environ.get('ROS_DOMAIN_ID') or '0'
    if not given.isdecimal() or int(given) > LAST_DOMAIN:
        raise ValueError(
            f'environment variable ROS_DOMAIN_ID: got {given!r}, '
            f'expected a number from 0 to {LAST_DOMAIN}'
        )
    return str(int(given))


def ros_arguments(
    files: Sequence[Path], run: Run, renamed: Iterable[tuple[str, str]] = ()
) -> list[str]:
    """Return the ROS arguments of a node of a run.

    Args:
        files: Of parameters.
        run: What the command line asks for.
        renamed: From which name to which the robot's profile renames topics.
    """
    arguments = ['--ros-args']
    for path in files:
        arguments += ['--params-file', str(path)]
    # Of two rules for a name the first counts.
    for rule in (*run.remaps, *(f'{old}:={new}' for old, new in renamed)):
        arguments += ['-r', rule]
    if run.namespace is not None:
        arguments += ['-r', f'__ns:=/{run.namespace.strip("/")}']
    if run.log_level is not None:
        arguments += ['--log-level', run.log_level]
    return arguments


def node_environ(run: Run, logs: Path | None = None) -> dict[str, str]:
    """Return the environment of a node's process."""
    environ = dict(os.environ)
    if run.domain is not None:
        environ['ROS_DOMAIN_ID'] = str(run.domain)
    environ |= launched_nodes(environ, run.network)
    environ |= ONE_THREAD
    for name in ('NOTIFY_SOCKET', 'WATCHDOG_USEC', 'WATCHDOG_PID'):
        environ.pop(name, None)  # of the launcher alone
    if logs is not None:
        environ['PYTHONUNBUFFERED'] = '1'
        environ['PYTHONIOENCODING'] = 'utf-8'
        environ['RCUTILS_CONSOLE_OUTPUT_FORMAT'] = ROS_FORMAT
        environ['RCUTILS_COLORIZED_OUTPUT'] = '0'
        environ.setdefault('ROS_LOG_DIR', str(logs))
    return environ


def command(nodes: Sequence[node_table.Node], arguments: Sequence[str], parent: int) -> list[str]:
    """Return the command of one process that holds `nodes`; it ends with `parent`, unless that
    is 0.
    """
    targets = ','.join(f'{n.name}={n.module}:{n.class_name}' for n in in_order(nodes))
    return [interpreter(), '-P', str(NODE_PROCESS), str(parent), targets, *arguments]


def programs_of(
    part: RobotProcesses,
    files: Mapping[str, Path],
    environ: Mapping[str, str],
    renamed: Sequence[tuple[str, str]] = (),
) -> list[ManagedProcess]:
    """Return the processes of a part of a run, each with the nodes that share it."""
    run = part.run
    programs = []
    shared = node_table.by_process(part.everyone, run.processes, run.mode)
    for process, nodes in shared.items():
        names = [node.name for node in nodes]
        arguments = ros_arguments([files[name] for name in names], run, renamed)
        # It prints into the launcher's log; one of its own, as ROS writes it, grows without bound.
        words = command(nodes, [*arguments, '--disable-external-lib-logs'], os.getpid())
        programs.append(
            ManagedProcess(
                part.name(process if len(names) > 1 else names[0]),
                words,
                environ,
                nodes=[part.name(name) for name in names],
                # What the launcher tells of comes on the alarm's input.
                takes_input=not {node_table.CONSOLE, node_table.ALARM}.isdisjoint(names),
                leads=BEHAVIOUR_NODE in names and run.processes != node_table.ONE,
                can_be_missed=names == [PAGE],
                # Together they may hold what each may hold by itself, and share much.
                memory=run.memory * 2**20 * min(len(names), SHARE_OF_SEVERAL),
            )
        )
    return programs
