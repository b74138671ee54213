"""One run of the robot: which processes it needs, with which parameters, and what it sums up to.

Imported in the project's environment only: the packages read their own places and records.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launcher import node_table
from launcher.instance_lock import claim
from launcher.log_merge import ROS_FORMAT, MergedLog
from launcher.supervisor import Program, Supervisor
from surveillance_behaviour.mission import mission_log
from surveillance_runtime.place import read_place
from surveillance_runtime.yaml_file import YamlFileError, read_yaml_file

CHILD = Path(__file__).with_name('child.py')
DISCOVERY = Path(__file__).with_name('discovery.xml')
PLACES = {'surveillance': 'seven_rooms.yaml', 'patrol': 'patrol_world.yaml'}
RECORD = 'mission.jsonl'
ONTOLOGIES = 'ontologies'
STORE = 'armor_store'
COMPOSED = 'composed'
BEHAVIOUR_NODE = 'robot_behavior'
_NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/[A-Za-z]\w*)*\Z', re.ASCII)
MAX_DOMAIN = 101
"""The highest ROS domain whose ports lie below those that Linux gives to clients."""


class RunError(ValueError):
    """What was asked for cannot be run: one line that says why."""


@dataclass(frozen=True)
class Run:
    """What the command line asks for.

    Attributes:
        mode: one of `node_table.MODES`, or None for the default one.
        behaviour: one of `node_table.BEHAVIOURS`.
        place: file that describes the place, None for the behaviour's own.
        parameters: further parameter file, None for none.
        composed: all nodes in one process.
        only, without: names of nodes, see `node_table.select`.
        log_level: one of `node_table.LOG_LEVELS`, None for ROS's own choice.
        namespace: of all nodes, None for none.
        domain: ROS domain, None for the environment's.
        seconds: how long to run, None until stopped.
    """

    mode: str | None = None
    behaviour: str = 'surveillance'
    place: Path | None = None
    parameters: Path | None = None
    composed: bool = False
    only: Sequence[str] = ()
    without: Sequence[str] = ()
    log_level: str | None = None
    namespace: str | None = None
    domain: int | None = None
    seconds: float | None = None

    def check(self) -> None:
        """Looks at everything that can be wrong before a process is started.

        Raises:
            RunError: a value cannot be used.
        """
        if self.namespace is not None and not _NAMESPACE.match(self.namespace):
            raise RunError(
                f'--namespace {self.namespace!r}: expected letters, digits and _ like robot1'
            )
        if self.domain is not None and not 0 <= self.domain <= MAX_DOMAIN:
            raise RunError(f'--domain {self.domain}: expected a number from 0 to {MAX_DOMAIN}')
        if self.place is not None:
            try:
                read_place(self.place)
            except YamlFileError as error:
                raise RunError(f'--map {error}') from None
        if self.parameters is not None:
            check_parameter_file(self.parameters)

    def nodes(self) -> tuple[node_table.Node, ...]:
        chosen = node_table.select(
            self.mode or node_table.DEFAULT_MODE, self.behaviour, self.only, self.without
        )
        return (*chosen, node_table.find(node_table.CONSOLE)) if self.one_console else chosen

    @property
    def one_console(self) -> bool:
        """Whether a node reads the operator's lines for all controllers.

        In processes of their own each controller reads its own input, which the launcher fills.
        """
        return self.composed and self.mode == 'MANUAL'


def check_parameter_file(path: Path) -> None:
    """Makes sure that a file has the form of ROS parameters and names nodes that exist.

    Raises:
        RunError: one line with the file and what is wrong in it.
    """
    try:
        file = read_yaml_file(path)
    except YamlFileError as error:
        raise RunError(f'--params {error}') from None
    for key, section in file.values.items():
        name = key.rsplit('/', 1)[-1]
        problem = ''
        if name not in node_table.BY_NAME and name not in ('*', '**'):
            known = ', '.join(node_table.BY_NAME)
            problem = f'no node is called {key!r}, expected /** or one of {known}'
        elif not isinstance(section, dict) or not isinstance(section.get('ros__parameters'), dict):
            problem = f"expected 'ros__parameters:' with a mapping in {key!r}"
        if problem:
            raise RunError(f'--params {file.error_at((key,), problem)}')


def parameter_files(config: Path, run: Run) -> list[Path]:
    """The files that every node gets, in ROS's order: a later one wins."""
    place = run.place or config / PLACES[run.behaviour]
    files = [config / 'parameters.yaml', place]
    if run.parameters is not None:
        files.append(run.parameters)
    return [path.resolve() for path in files]


def ros_arguments(files: Sequence[Path], run: Run) -> list[str]:
    """The ROS arguments that all nodes of a run share."""
    arguments = ['--ros-args']
    for path in files:
        arguments += ['--params-file', str(path)]
    if run.behaviour == 'patrol':
        # the place's file is for the simulator: the robot learns its map from the markers
        arguments += ['-p', 'map_source:=markers']
    if run.namespace is not None:
        arguments += ['-r', f'__ns:=/{run.namespace.strip("/")}']
    if run.log_level is not None:
        arguments += ['--log-level', run.log_level]
    return arguments


def ros_domain(run: Run) -> str:
    """The ROS domain of a run: as asked for, else as the environment says.

    Raises:
        RunError: what the environment says is no domain.
    """
    if run.domain is not None:
        return str(run.domain)
    given = os.environ.get('ROS_DOMAIN_ID') or '0'
    if not given.isdecimal() or int(given) > MAX_DOMAIN:
        raise RunError(
            f'environment variable ROS_DOMAIN_ID: got {given!r}, '
            f'expected a number from 0 to {MAX_DOMAIN}'
        )
    return str(int(given))


def node_environ(run: Run, logs: Path | None = None) -> dict[str, str]:
    """The environment of a node's process."""
    environ = dict(os.environ)
    if run.domain is not None:
        environ['ROS_DOMAIN_ID'] = str(run.domain)
    # Shared memory that a killed process leaves behind hides later nodes of the same domain.
    environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
    environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(DISCOVERY))
    if logs is not None:
        environ['PYTHONUNBUFFERED'] = '1'
        environ['PYTHONIOENCODING'] = 'utf-8'
        environ['RCUTILS_CONSOLE_OUTPUT_FORMAT'] = ROS_FORMAT
        environ['RCUTILS_COLORIZED_OUTPUT'] = '0'
        environ.setdefault('ROS_LOG_DIR', str(logs))
    return environ


def command(nodes: Sequence[node_table.Node], arguments: Sequence[str], parent: int) -> list[str]:
    """The command of one process that holds `nodes`; it ends with `parent`, unless that is 0."""
    # Nodes of one process are stopped from the last to the first: the one that uses the others
    # comes last.
    ordered = sorted(nodes, key=lambda node: node.name == BEHAVIOUR_NODE)
    targets = ','.join(f'{n.name}={n.module}:{n.class_name}' for n in ordered)
    return [sys.executable, '-P', str(CHILD), str(parent), targets, *arguments]


def make_folder(runs: Path) -> Path:
    """A new folder for what the run leaves behind: its log, its parameters, its record."""
    stamp = time.strftime('%Y%m%d-%H%M%S')
    for suffix in ('', *(f'-{number}' for number in range(2, 100))):
        folder = runs / (stamp + suffix)
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise RunError(f'{folder}: cannot be made: {error.strerror}') from None
        return folder
    raise RunError(f'{folder}: a hundred runs began in this second')


def write_own_parameters(folder: Path, run: Run) -> Path:
    """Writes what the command line says as parameters, for the nodes that it concerns."""
    own: dict[str, dict[str, Any]] = {
        BEHAVIOUR_NODE: {'behaviour': run.behaviour, 'record': str(folder / RECORD)},
        'reasoner': {'record': str(folder / RECORD)},
        'armor_server': {
            'ontologies_folder': str(folder.resolve() / ONTOLOGIES),
            'store': str(folder.resolve() / STORE),
        },
    }
    # Without one that was asked for, the mode is what the parameter files say.
    if run.mode:
        for node in node_table.NODES:
            if node.console:
                own[node.name] = {'execution_mode': run.mode, 'console': not run.one_console}
    return _write_parameters(folder / 'launch.yaml', own)


def _write_parameters(path: Path, of_nodes: Mapping[str, Mapping[str, Any]]) -> Path:
    # `/**/name` is the node in any namespace. JSON is YAML too, and quotes safely.
    content = {f'/**/{name}': {'ros__parameters': of_nodes[name]} for name in of_nodes}
    try:
        path.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')
    except OSError as error:
        raise RunError(f'{path}: cannot be written: {error.strerror}') from None
    return path


def run_mission(run: Run, config: Path, runs: Path) -> int:
    """Starts the nodes, supervises them until the end, prints the summary; returns the exit code.

    Args:
        run: what to run.
        config: the folder with the parameter files.
        runs: where the run gets a folder of its own for its log, parameters and record.

    Raises:
        RunError, node_table.SelectionError, InstanceLockError: what was asked for cannot be run.
    """
    run.check()
    nodes = run.nodes()
    claims = claim(nodes, ros_domain(run), run.namespace)
    folder = make_folder(runs)
    files = [*parameter_files(config, run), write_own_parameters(folder, run)]
    arguments = ros_arguments(files, run)
    environ = node_environ(run, folder / 'ros')
    manual = run.mode == 'MANUAL'
    if run.composed:
        words = command(nodes, arguments, os.getpid())
        programs = [Program(COMPOSED, words, environ, takes_input=manual)]
    else:
        programs = [
            Program(
                node.name,
                command([node], arguments, os.getpid()),
                environ,
                takes_input=manual and bool(node.console),
                leads=node.name == BEHAVIOUR_NODE,
                says_up=True,
            )
            for node in nodes
        ]
    names = [*(node.name for node in nodes), *([COMPOSED] if run.composed else [])]
    log = MergedLog(None, names, path=folder / 'launch.log')
    log.say(
        f'{run.behaviour} in mode {run.mode or node_table.DEFAULT_MODE}, '
        f'place {files[1].name}, '
        f'ROS domain {ros_domain(run)}, files in {_short(folder)}'
    )
    log.say(f'watch it in a second terminal: {watch_command(run)}')
    supervisor = Supervisor(programs, log)
    console = None
    if manual:
        from launcher.console import OperatorConsole

        reader = COMPOSED if run.one_console else None
        console = OperatorConsole(supervisor, [n for n in nodes if n.console], log, reader)
        console.start()
    try:
        code = supervisor.run(run.seconds)
    finally:
        if console is not None:
            console.stop()
    if any(node.name == BEHAVIOUR_NODE for node in nodes):
        log.plain(summary(folder / RECORD))
    log.close()
    for descriptor in claims:
        os.close(descriptor)
    return code


def watch_command(run: Run) -> str:
    """What to type in another terminal to see this run."""
    words = ['python3', 'launch.py', 'watch']
    if ros_domain(run) != '0':
        words += ['--domain', ros_domain(run)]
    if run.namespace is not None:
        words += ['--namespace', run.namespace]
    return ' '.join(words)


def summary(record: Path) -> str:
    """The mission's summary as text; says so when there is none."""
    if not record.exists():
        return 'Mission: nothing was recorded.'
    try:
        return str(mission_log.summarize(mission_log.read(record)))
    except mission_log.RecordError as error:
        return f'Mission: {error}'


def _short(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
