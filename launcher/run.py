"""One run of the robot: which processes it needs, with which parameters, and what it sums up to.

Imported in the project's environment only: the packages read their own places and records.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import surveillance_runtime
from launcher import run_folder
from launcher.instance_lock import claim
from launcher.log_merge import ROS_FORMAT, MergedLog
from launcher.supervisor import Program, Supervisor
from launcher.system import LaunchError
from surveillance_behaviour.mission import mission_log
from surveillance_runtime import node_table
from surveillance_runtime.configuration import (
    Configuration,
    Entry,
    RosArguments,
    Setting,
    argument_layer,
    file_layer,
    resolved_text,
)
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place import read_place_file
from surveillance_runtime.run_parameters import (
    BEHAVIOUR_NODE,
    for_node,
    full_name,
    mode_entries,
    place_file,
    record_entries,
    run_layers,
    write_parameters,
)
from surveillance_runtime.yaml_file import YamlFileError

CHILD = Path(__file__).with_name('child.py')
NETWORK_ROS = {
    # Shared memory that a killed process leaves behind hides later nodes of the same domain.
    'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(
        Path(surveillance_runtime.__file__).with_name('discovery.xml')
    ),
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
}
"""How nodes of several machines find each other where the environment says nothing else."""
LOCAL_ROS = {
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('local_discovery.xml')),
    # The profile says it: LOCALHOST would add shared memory, whatever else is said.
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
}
"""The same for one machine, which is what a robot's nodes run on unless somebody says otherwise."""
RECORD = 'mission.jsonl'
ONTOLOGIES = 'ontologies'
STORE = 'armor_store'
COMPOSED = 'composed'
NOT_RECORDED = 'off'
RECORDER, MARKERS, PAGE = 'mission_recorder', 'mission_markers', 'mission_page'
RECORDING, PLACE = 'recording', 'place.yaml'
COMPOSED_SHARE = 3
MEMORY = 2048
"""Megabytes that a node may hold, unless the command line says otherwise."""
NOTHING_RECORDED = 'Mission: nothing was recorded.'
EXIT_NOTHING_DONE = 1
"""The exit code of a run that had all its time and in which the mission did not begin."""
HELP = 'waiting for help: '
"""What the behaviour says when it needs somebody."""
_NAMESPACE = re.compile(r'/?[A-Za-z]\w*(/[A-Za-z]\w*)*\Z', re.ASCII)
MAX_DOMAIN = 101
"""The highest ROS domain whose ports lie below those that Linux gives to clients."""


@dataclass(frozen=True)
class Run:
    """What the command line asks for.

    Attributes:
        mode: one of `node_table.MODES`, or None for the default one.
        behaviour: one of `node_table.BEHAVIOURS`.
        place: file that describes the place, None for the behaviour's own.
        parameters: further parameter file, None for none.
        assignments: `[NODE:]NAME:=VALUE` of `-p`, which win over every file.
        composed: all nodes in one process.
        only, without: names of nodes, see `node_table.select`.
        log_level: one of `node_table.LOG_LEVELS`, None for ROS's own choice.
        namespace: of all nodes, None for none.
        domain: ROS domain, None for the environment's.
        seconds: how long to run, None until stopped.
        record: `off`, or the folder for the run's own, None for the usual one.
        keep: most of the recordings to keep, gigabytes.
        web, web_control: show the mission in browsers; let them act.
        web_address: where, as HOST:PORT, None for the page's own choice.
        memory: megabytes that a node may hold before it is started again; 0: any.
        alarm: a command that is run, with one line as its argument, when somebody is needed.
        fresh: do not go on with a run whose launcher was killed.
        network: whether nodes of other machines are heard.
    """

    mode: str | None = None
    behaviour: str = 'surveillance'
    place: Path | None = None
    parameters: Path | None = None
    assignments: Sequence[str] = ()
    composed: bool = False
    only: Sequence[str] = ()
    without: Sequence[str] = ()
    log_level: str | None = None
    namespace: str | None = None
    domain: int | None = None
    seconds: float | None = None
    record: str | None = NOT_RECORDED
    keep: float = 20.0
    web: bool = False
    web_control: bool = False
    web_address: str | None = None
    memory: int = MEMORY
    alarm: str = ''
    network: bool = False
    fresh: bool = False

    def check(self) -> None:
        """Look at everything that can be wrong before a process is started.

        Raises:
            LaunchError: a value cannot be used.
        """
        if self.namespace is not None and not _NAMESPACE.match(self.namespace):
            raise LaunchError(
                f'--namespace {self.namespace!r}: expected letters, digits and _ like robot1'
            )
        if self.domain is not None and not 0 <= self.domain <= MAX_DOMAIN:
            raise LaunchError(f'--domain {self.domain}: expected a number from 0 to {MAX_DOMAIN}')
        if self.place is not None:
            try:
                read_place_file(self.place)
            except YamlFileError as error:
                raise LaunchError(f'--map {error}') from None
        if self.parameters is not None:
            try:
                Configuration((file_layer(self.parameters),)).check()
            except (YamlFileError, ParameterError) as error:
                raise LaunchError(f'--params {error}') from None
        if self.web_address is not None:
            _, _, port = self.web_address.rpartition(':')
            if not port.isdecimal() or int(port) > 65535:
                raise LaunchError(
                    f'--web-address {self.web_address!r}: expected HOST:PORT like 0.0.0.0:8080'
                )

    def nodes(self) -> tuple[node_table.Node, ...]:
        chosen = node_table.select(
            self.mode or node_table.DEFAULT_MODE, self.behaviour, self.only, self.without
        )
        asks = self.mode == 'MANUAL' and any(node.console for node in chosen)
        # First, so that it is there for what is typed at once.
        return (node_table.find(node_table.CONSOLE), *chosen) if asks else chosen

    def observers(self) -> tuple[node_table.Node, ...]:
        """Return the nodes that only look on; they start last. `only` starts no other ones."""
        names = []
        if self.record != NOT_RECORDED and not self.only:
            names += [RECORDER, MARKERS]
        if self.web or self.web_control:
            names.append(PAGE)
        return tuple(node_table.find(name) for name in names)


def configuration(
    config: Path, run: Run, folder: Path | None = None, more: RosArguments | None = None
) -> Configuration:
    """Merge all that gives parameters to the nodes of a run; each entry and the place are checked.

    Args:
        config: The folder with the parameter files.
        run: What the command line asks for.
        folder: Where the run leaves its record, its ontologies and their store.
        more: Further arguments in ROS's own form.

    Raises:
        LaunchError: One line about the first entry that is wrong.
    """
    try:
        merged = _merged(config, run, folder, more)
        merged.check()
        merged.place('simulator', full_name(run.namespace, 'simulator'))
        _check_behaviour(merged, run)
    except YamlFileError as error:
        raise LaunchError(f'parameter file {error}') from None
    except ParameterError as error:
        raise LaunchError(str(error)) from None
    return merged


def _merged(
    config: Path, run: Run, folder: Path | None, more: RosArguments | None
) -> Configuration:
    files = [run.parameters] if run.parameters is not None else []
    layers = run_layers(
        config,
        run.behaviour,
        place=run.place,
        chosen=_folders_of(folder.resolve()) if folder is not None else (),
        files=[*files, *(Path(file) for file in (more.files if more else ()))],
        options=_option_entries(run, folder),
    )
    assignments = (*run.assignments, *(more.assignments if more else ()))
    return Configuration((*layers, argument_layer(assignments)))


def _folders_of(folder: Path) -> Iterator[Entry]:
    """Yield where the nodes of a run write, if the user's file names no other place."""
    for name, part in (('ontologies_folder', ONTOLOGIES), ('store', STORE)):
        yield for_node('armor_server', name, str(folder / part), 'this run')
    for node in ('battery_controller', 'motion_controller', 'simulator'):
        yield for_node(node, 'state_file', str(folder / f'{node}.json'), 'this run')


def _option_entries(run: Run, folder: Path | None) -> Iterator[Entry]:
    """Yield what the options say as parameters, for the nodes that they concern."""
    if folder is not None:
        yield from record_entries(folder / RECORD)
        yield from _observer_entries(run, folder)
    # Without one that was asked for, the mode is what the parameter files say.
    if run.mode:
        # In a whole run one console reads for all.
        yield from mode_entries(run.mode, prompts=run.mode != 'MANUAL' or folder is None)


def _check_behaviour(merged: Configuration, run: Run) -> None:
    given = merged.resolve(BEHAVIOUR_NODE, full_name(run.namespace, BEHAVIOUR_NODE)).get(
        'behaviour'
    )
    if given is not None and given.value != run.behaviour:
        raise LaunchError(
            f'{given.origin}: behaviour {given.value}, but the run is one of {run.behaviour}: '
            f'expected --behaviour {given.value}, which starts its nodes too'
        )


def check_assignments(merged: Configuration, nodes: Sequence[node_table.Node]) -> None:
    """Make sure that each `-p` is for a node that is started.

    Raises:
        LaunchError: One would be ignored.
    """
    for entry in merged.layers[-1].entries:
        takers = [
            node.name
            for node in nodes
            if merged.schema[node.name].takes(entry.name)
            and (entry.rank == 0 or entry.pattern.rsplit('/', 1)[-1] in (node.name, '*', '**'))
        ]
        if not takers:
            names = ', '.join(node.name for node in nodes)
            raise LaunchError(f'{entry.origin}: no node that is started takes it: {names}')


def with_mode_of(run: Run, merged: Configuration) -> Run:
    """Return the run, where none was asked for with the mode that all controllers are given."""
    if run.mode:
        return run
    modes = set()
    for node in node_table.NODES:
        if node.name in node_table.RUN_NODES and node.console:
            setting = merged.resolve(node.name, full_name(run.namespace, node.name)).get(
                'execution_mode'
            )
            modes.add(setting.value if setting is not None else node_table.DEFAULT_MODE)
    mode = modes.pop()
    return run if modes or mode == node_table.DEFAULT_MODE else replace(run, mode=mode)


def _observer_entries(run: Run, folder: Path) -> Iterator[Entry]:
    """Yield what the recorder and the page are told."""
    yield for_node(RECORDER, 'folder', str(folder / RECORDING), 'this run')
    yield for_node(RECORDER, 'keep', float(run.keep), '--keep')
    if run.web or run.web_control:
        yield for_node(PAGE, 'control', run.web_control, '--web-control')
        # Made here, so that a page that is started again keeps it.
        yield for_node(PAGE, 'token', secrets.token_urlsafe(24), 'this run')
    if run.web_address is not None:
        host, _, port = run.web_address.rpartition(':')
        yield for_node(PAGE, 'host', host.strip('[]') or '127.0.0.1', '--web-address')
        yield for_node(PAGE, 'port', int(port), '--web-address')


def parameters_in_memory(name: str, settings: Mapping[str, Setting]) -> Path:
    """Return a file with a node's parameters that lives as long as this process."""
    descriptor = os.memfd_create('parameters', 0)
    os.write(descriptor, resolved_text(name, settings).encode())
    return Path(f'/proc/self/fd/{descriptor}')


def ros_arguments(files: Sequence[Path], run: Run) -> list[str]:
    """Return the ROS arguments of a node of a run."""
    arguments = ['--ros-args']
    for path in files:
        arguments += ['--params-file', str(path)]
    if run.namespace is not None:
        arguments += ['-r', f'__ns:=/{run.namespace.strip("/")}']
    if run.log_level is not None:
        arguments += ['--log-level', run.log_level]
    return arguments


def _merged_arguments(files: Sequence[Path], run: Run) -> list[str]:
    """Return the arguments of a node that prints into the launcher's log.

    A log file of its own, as ROS writes it, would grow without bound.
    """
    return [*ros_arguments(files, run), '--disable-external-lib-logs']


def ros_domain(run: Run) -> str:
    """Return the ROS domain of a run: as asked for, else as the environment says.

    Raises:
        LaunchError: what the environment says is no domain.
    """
    if run.domain is not None:
        return str(run.domain)
    given = os.environ.get('ROS_DOMAIN_ID') or '0'
    if not given.isdecimal() or int(given) > MAX_DOMAIN:
        raise LaunchError(
            f'environment variable ROS_DOMAIN_ID: got {given!r}, '
            f'expected a number from 0 to {MAX_DOMAIN}'
        )
    return str(int(given))


def node_environ(run: Run, logs: Path | None = None) -> dict[str, str]:
    """Return the environment of a node's process."""
    environ = dict(os.environ)
    if run.domain is not None:
        environ['ROS_DOMAIN_ID'] = str(run.domain)
    for name, value in (NETWORK_ROS if run.network else _local_ros(environ)).items():
        environ.setdefault(name, value)
    if run.network:
        environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SUBNET'
    for name in ('NOTIFY_SOCKET', 'WATCHDOG_USEC', 'WATCHDOG_PID'):
        environ.pop(name, None)  # of the launcher alone
    if logs is not None:
        environ['PYTHONUNBUFFERED'] = '1'
        environ['PYTHONIOENCODING'] = 'utf-8'
        environ['RCUTILS_CONSOLE_OUTPUT_FORMAT'] = ROS_FORMAT
        environ['RCUTILS_COLORIZED_OUTPUT'] = '0'
        environ.setdefault('ROS_LOG_DIR', str(logs))
    return environ


def _local_ros(environ: Mapping[str, str]) -> Mapping[str, str]:
    """Return how nodes of one machine find each other with the middleware that is asked for."""
    others = not environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp').startswith('rmw_fastrtps')
    if others or 'FASTRTPS_DEFAULT_PROFILES_FILE' in environ:
        return {**NETWORK_ROS, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    return LOCAL_ROS


def command(nodes: Sequence[node_table.Node], arguments: Sequence[str], parent: int) -> list[str]:
    """Return the command of one process that holds `nodes`; it ends with `parent`, unless that
    is 0.
    """
    # Nodes of one process are stopped from the last to the first: the one that uses the others
    # comes last.
    ordered = sorted(nodes, key=lambda node: node.name == BEHAVIOUR_NODE)
    targets = ','.join(f'{n.name}={n.module}:{n.class_name}' for n in ordered)
    return [sys.executable, '-P', str(CHILD), str(parent), targets, *arguments]


def options_of(run: Run) -> dict[str, Any]:
    """Return what a run is asked for, as JSON holds it."""
    options: dict[str, Any] = {}
    for name, value in vars(run).items():
        sequence = isinstance(value, list | tuple)
        options[name] = (
            str(value) if isinstance(value, Path) else list(value) if sequence else value
        )
    return options


def run_from(options: Mapping[str, Any]) -> Run:
    """Return the run of options that `options_of` gave.

    Raises:
        LaunchError: They are not of a run.
    """
    known = {field.name for field in fields(Run)}
    try:
        values = {name: options[name] for name in options if name in known}
        for name in ('place', 'parameters'):
            values[name] = Path(values[name]) if values.get(name) else None
        return Run(**values)
    except TypeError as error:
        raise LaunchError(f'--resume: {error}') from None


def resumed(run: Run, usual: Run, runs: Path, name: str) -> tuple[Run, Path]:
    """Return the run to go on with and its folder.

    Args:
        run: What the command line asks for now; it goes before what the run was asked for.
        usual: What a command line without options asks for.
        runs: The folder of the runs.
        name: Of the run; empty: the last one.

    Raises:
        LaunchError: There is no such run.
    """
    if run.record not in (None, NOT_RECORDED):
        runs = Path(run.record)
    found = run_folder.find(runs, name)
    given = {name: value for name, value in vars(run).items() if value != getattr(usual, name)}
    return replace(run_from(found.options), **given), found.folder


def _chosen_folder(run: Run, runs: Path, resume: Path | None) -> tuple[Path, str]:
    """Return the folder to work in, and what there is to say about it."""
    if resume is not None:
        return resume, f'going on with {_short(resume)}'
    found = run_folder.latest(runs) if not run.fresh else None
    if found is not None and not found.ended and not found.running:
        same = {**found.options, 'seconds': None} == {**options_of(run), 'seconds': None}
        if same:
            how = 'whose launcher was killed; --fresh begins anew'
            return found.folder, f'going on with {_short(found.folder)}, {how}'
    return run_folder.make_folder(runs), ''


def alarm_caller(alarm: str, log: MergedLog) -> Callable[[str], None]:
    """Return what calls somebody: it runs the user's command with one line as its argument."""

    def call(text: str) -> None:
        if not alarm:
            return
        try:
            subprocess.Popen(
                [*shlex.split(alarm), text],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            log.error(f'--alarm {alarm}: {error}')

    return call


def run_mission(run: Run, config: Path, runs: Path, resume: Path | None = None) -> int:
    """Start the nodes, supervise them to the end, print the summary; return the exit code."""
    run.check()
    merged = configuration(config, run)  # before anything is written
    run = with_mode_of(run, merged)
    nodes = run.nodes()
    observers = run.observers()
    check_assignments(merged, (*nodes, *observers))
    claims = claim(nodes, ros_domain(run), run.namespace)
    if run.record not in (None, NOT_RECORDED):
        runs = Path(run.record)
    folder, how = _chosen_folder(run, runs, resume)
    deleted = run_folder.prune(runs, run.keep * 1e9)
    state = run_folder.RunState(folder, options_of(run))
    merged = configuration(config, run, folder)
    everyone = (*nodes, *observers)
    files = write_parameters(folder / 'parameters', run.namespace, merged, everyone)
    programs = _programs(run, nodes, observers, files, node_environ(run, folder / 'ros'))
    place = place_file(config, run.behaviour, run.place)
    shutil.copyfile(place, folder / PLACE)
    names = [*(node.name for node in everyone), *([COMPOSED] if run.composed else [])]
    log = MergedLog(None, names, path=folder / 'launch.log')
    log.say(
        f'{run.behaviour} in mode {run.mode or node_table.DEFAULT_MODE}, '
        f'place {place.name}, '
        f'ROS domain {ros_domain(run)}, files in {_short(folder)}'
    )
    if how:
        log.say(how)
    for old in deleted:
        log.say(f'deleted {_short(old)}: the runs take more than --keep {run.keep:g} GB')
    if run.network:
        log.say('nodes of other machines are heard: see docs/security.md')
    log.say(f'watch it in a second terminal: {watch_command(run)}')
    call = alarm_caller(run.alarm, log)
    log.listen(lambda name, text: call(text) if name == BEHAVIOUR_NODE and HELP in text else None)
    code = _supervised(run, nodes, Supervisor(programs, log, on_trouble=call), folder, log)
    for line in what_to_look_at(folder):
        log.plain(line)
    log.close()
    state.end()
    for descriptor in claims:
        os.close(descriptor)
    return code


def _programs(
    run: Run,
    nodes: Sequence[node_table.Node],
    observers: Sequence[node_table.Node],
    files: Mapping[str, Path],
    environ: Mapping[str, str],
) -> list[Program]:
    """Return the processes of a run, each with the nodes that share it."""

    def program(members: Sequence[node_table.Node]) -> Program:
        own = [files[node.name] for node in members]
        words = command(members, _merged_arguments(own, run), os.getpid())
        memory = run.memory * 2**20
        return Program(members[0].name, words, environ, says_up=True, watched=True, memory=memory)

    if run.composed:
        everything = program(nodes)
        programs = [
            replace(
                everything,
                name=COMPOSED,
                takes_input=run.mode == 'MANUAL',
                says_up=False,
                # Together they may hold what each may hold by itself, and share much.
                memory=everything.memory * COMPOSED_SHARE,
            )
        ]
    else:
        programs = [
            replace(
                program([node]),
                takes_input=node.name == node_table.CONSOLE,
                leads=node.name == BEHAVIOUR_NODE,
            )
            for node in nodes
        ]
    # What only listens shares a process; the page, which strangers talk to, has its own.
    for together in ((RECORDER, MARKERS), (PAGE,)):
        if members := [node for node in observers if node.name in together]:
            programs.append(program(members))
    return programs


def _supervised(
    run: Run,
    nodes: Sequence[node_table.Node],
    supervisor: Supervisor,
    folder: Path,
    log: MergedLog,
) -> int:
    """Run the processes to the end, print the summary; return the exit code."""
    console = None
    if any(node.name == node_table.CONSOLE for node in nodes):
        from launcher.console import OperatorConsole

        reader = COMPOSED if run.composed else node_table.CONSOLE
        console = OperatorConsole(supervisor, log, reader)
        console.start()
    try:
        code = supervisor.run(run.seconds)
    finally:
        if console is not None:
            console.stop()
    if any(node.name == BEHAVIOUR_NODE for node in nodes):
        done = summary(folder / RECORD)
        log.plain(done)
        if supervisor.time_is_over and done == NOTHING_RECORDED:
            code = code or EXIT_NOTHING_DONE
    return code


def what_to_look_at(folder: Path) -> list[str]:
    """Write the report of a run; return where it is, and how to replay the run."""
    from surveillance_operator.recording import RecordingError, timeline
    from surveillance_operator.report import write_report

    lines = []
    with contextlib.suppress(RecordingError):  # nothing was visited: the summary says so
        lines.append(f'report: {_short(write_report(folder))}')
    if (folder / timeline.NAME).exists():
        lines.append(f'replay: python3 launch.py replay {_short(folder)}')
    return lines


def watch_command(run: Run) -> str:
    """Return what to type in another terminal to see this run."""
    words = ['python3', 'launch.py', 'watch']
    if ros_domain(run) != '0':
        words += ['--domain', ros_domain(run)]
    if run.namespace is not None:
        words += ['--namespace', run.namespace]
    return ' '.join(words)


def summary(record: Path) -> str:
    """Return the mission's summary as text, also when there is none."""
    if not record.exists():
        return NOTHING_RECORDED
    try:
        return str(mission_log.summarize(mission_log.read(record)))
    except mission_log.MissionLogError as error:
        return f'Mission: {error}'


def _short(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
