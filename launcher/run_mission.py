"""One run from its start to its summary."""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from floor_plans.writing import copy_place
from launcher import run_folder
from launcher.environment import COMMAND, interpreter
from launcher.fleet_launch import RobotProcesses, parts, without_parts
from launcher.instance_lock import claim
from launcher.log_merge import MergedLog
from launcher.node_deaths import NodeDeaths
from launcher.run import NOT_RECORDED, Run
from launcher.run_configuration import (
    check_assignments,
    check_clocks,
    check_stage,
    check_watch,
    configuration,
    profile_of,
    with_mode_of,
    with_profile,
)
from launcher.run_processes import node_environ, programs_of, ros_domain
from launcher.service import is_service
from launcher.supervisor import EXIT_CUT, Supervisor
from strict_files.files import FileError
from surveillance_behaviour.mission import mission_log
from surveillance_runtime import event_log, node_table
from surveillance_runtime.configuration import Entry
from surveillance_runtime.discovery import LOCALHOST, problem_of
from surveillance_runtime.event_log import record_in
from surveillance_runtime.free_memory import give_back
from surveillance_runtime.launch_protocol import EXIT_THERE, NotNowError
from surveillance_runtime.profile import remappings
from surveillance_runtime.run_files import LAUNCH_LOG, PARAMETERS, PLACE, TIMELINE
from surveillance_runtime.run_parameters import (
    BEHAVIOUR_NODE,
    full_name,
    place_file,
    write_parameters,
)
from surveillance_runtime.rviz_layout import fleet_layout
from surveillance_runtime.stop_request import own_stop

STOP_KEEPER = 'motion_controller'
"""Who reads the stop that is kept, besides the collision monitor."""
NOTHING_RECORDED = 'Mission: nothing was recorded.'
EXIT_NOTHING_DONE = 1
"""The exit code of a run that had all its time and in which the mission did not begin."""

LOST = 'Mission: its record cannot be read: '
"""How the summary begins of a mission whose record cannot be read."""


@dataclass(frozen=True)
class RunJob:
    """What a run is for that ends by itself.

    Attributes:
        title: How the log calls it.
        node: When it has finished the run is over.
        entries: Return the parameters that the nodes are given, by the folder of the run.
        close: Do what is left to do with that folder when all nodes have ended; return the exit
            code.
    """

    title: str
    node: str
    entries: Callable[[Path], Sequence[Entry]]
    close: Callable[[Path], int]


def run_mission(
    run: Run,
    config: Path,
    runs: Path,
    resume: Path | None = None,
    job: RunJob | None = None,
) -> int:
    """Start the nodes, supervise them to the end, print the summary; return the exit code."""
    run, team = checked(run, config)  # before anything is written
    if problem := problem_of(run.network, os.environ):
        raise NotNowError(problem)
    domain = ros_domain(run)
    claims = [held for part in team for held in claim(part.nodes, domain, part.run.namespace)]
    if run.network not in ('', LOCALHOST):
        _look_for_others(run, team)
    if run.record not in (None, NOT_RECORDED):
        runs = Path(run.record)
    folder, how = chosen_folder(run, runs, resume)
    deleted = run_folder.prune(runs, run.keep * 1e9, folder)
    state = run_folder.RunState(folder, run_folder.options_of(run))
    mode = run.mode or node_table.DEFAULT_MODE
    environ = node_environ(run, folder / 'ros')
    place = place_file(config, run.behaviour, run.place)
    programs = []
    for part in team:
        own = part.folder(folder)
        own.mkdir(exist_ok=True)
        given = (*part.entries, *(job.entries(own) if job is not None else ()))
        merged = configuration(config, part.run, own, fleet=given)
        files = write_parameters(own / PARAMETERS, part.run.namespace, merged, part.everyone)
        names = [node.name for node in part.nodes]
        of_robot = profile_of(config, part.run).profile
        renamed = (*part.renamed, *remappings(of_robot, names, mode))
        programs += programs_of(part, files, environ, renamed)
        copy_place(place, own / PLACE)
    if job is not None:
        programs = [
            replace(each, leads=True, ends_run=True) if job.node in each.nodes else each
            for each in programs
        ]
    alarm = next((node_table.ALARM for each in programs if node_table.ALARM in each.nodes), None)
    names = [part.name(node.name) for part in team for node in part.everyone]
    names += [each.name for each in programs if each.name not in names]
    log = MergedLog(None, names, path=folder / LAUNCH_LOG)
    log.say(
        f'{job.title if job is not None else run.behaviour} in mode {mode}, '
        f'{_robots(team, profile_of(config, run).profile.name)}, place {place.name}, '
        f'ROS domain {ros_domain(run)}, files in {_short(folder)}'
    )
    if moved := team[0].moved_points:
        log.say(f'the points of {", ".join(moved)} are moved inside: a robot there blocks no door')
    if how:
        log.say(how)
    for old in deleted:
        log.say(f'deleted {_short(old)}: the runs take more than --keep {run.keep:g} GB')
    if run.network not in ('', LOCALHOST):
        heard = 'nodes of other machines may be heard, docs/how-to/secure.md'
        log.say(f'--network {run.network}: {heard}')
    for line in stopped_ones(run, team, os.environ):
        log.warn(line)
    log.say(f'watch it in a second terminal: {watch_command(run)}')
    robots = [part.robot for part in team if part.robot]
    if robots:
        layout = folder / 'fleet.rviz'
        usual = (config / 'mission.rviz').read_text(encoding='utf-8')
        layout.write_text(fleet_layout(usual, robots, run.namespace), encoding='utf-8')
        log.say(f'or in RViz: rviz2 -d {_short(layout)}')
    deaths = NodeDeaths(
        lambda line: alarm is not None and supervisor.send(alarm, line),
        partial(_call_without_alarm, run.alarm, log),
        folder,
    )
    supervisor = Supervisor(
        programs,
        log,
        on_trouble=deaths.trouble,
        on_restart=deaths.restarted,
        on_tick=deaths.advance,
    )
    code = _supervised(run, team, supervisor, folder, log)
    for line in what_to_look_at(folder):
        log.plain(line)
    log.close()
    # A service is stopped with its machine, and goes on with it.
    state.end(ended=supervisor.time_is_over or not is_service())
    for descriptor in claims:
        os.close(descriptor)
    if job is None or code not in (0, EXIT_CUT):
        return code
    return job.close(folder) or code


def stopped_ones(run: Run, team: Sequence[RobotProcesses], environ: Mapping[str, str]) -> list[str]:
    """Return a line for each robot that somebody has stopped and nobody has released since."""
    lines = {}
    for part in team:
        if all(node.name != STOP_KEEPER for node in part.everyone):
            continue
        kept = own_stop(int(ros_domain(run)), part.run.namespace or '/', environ)
        if (request := kept.read()) is not None:
            robot = part.robot or 'the robot'
            lines[kept.path] = (
                f'{robot} is {request.words()}, not released: it stands until somebody does'
            )
    return list(lines.values())


def _call_without_alarm(command: str, log: MergedLog, text: str) -> None:
    """Call a person where the node that does so does not live."""
    log.warn(f'alarm: {text}')
    if command:
        from surveillance_operator.notify.calls import run_command

        if problem := run_command(command, text):
            log.error(problem)


def checked(run: Run, config: Path) -> tuple[Run, tuple[RobotProcesses, ...]]:
    """Return the run, with what follows for it from files, and its parts.

    Raises:
        ValueError: One line about the first option, place or parameter that is wrong.
    """
    merged = configuration(config, without_parts(run))
    run, _ = with_profile(with_mode_of(run, merged), config)
    team = parts(run, config, profile_of(config, run))
    everyone = [node for part in team for node in part.everyone]
    check_stage(run, everyone)
    for part in team:
        merged = configuration(config, part.run, fleet=part.entries)
        check_assignments(merged, everyone)
        check_watch(merged, part.run, part.everyone)
        check_clocks(merged, part.run, part.everyone)
    return run, team


def _look_for_others(run: Run, team: Sequence[RobotProcesses]) -> None:
    """Refuse to start beside a robot of the same names on another machine.

    Two of one machine are told apart by their claims, without a wait.

    Raises:
        NotNowError: There is one.
    """
    names = [
        full_name(part.run.namespace, node.name)
        for part in team
        for node in part.nodes
        if node.name in node_table.RUN_NODES
    ]
    words = [interpreter(), '-P', '-m', 'surveillance_runtime.duplicate_nodes', *names]
    found = subprocess.run(words, env=node_environ(run), stdout=subprocess.PIPE, text=True)
    if found.returncode == EXIT_THERE:
        raise NotNowError(found.stdout.strip())


def chosen_folder(run: Run, runs: Path, resume: Path | None) -> tuple[Path, str]:
    """Return the folder to work in, and what there is to say about it."""
    if resume is not None:
        return resume, f'continuing {_short(resume)}'
    found = run_folder.latest(runs) if not run.fresh else None
    if found is not None and not found.ended and not found.running:
        differing = _differing(found.options, run_folder.options_of(run))
        if not differing:
            how = 'which was not finished; --fresh begins a new one'
            return found.folder, f'continuing {_short(found.folder)}, {how}'
        how = f'was started with other options ({differing}) and is not finished'
        left = f'{_short(found.folder)} {how}'
        return run_folder.make_folder(runs), f'{left}; --resume continues it'
    # A run that was told to end is not missed.
    how = '' if run.fresh or (found and found.running) else run_folder.damaged(runs, found)
    return run_folder.make_folder(runs), how


def _differing(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return which options differ, with what they were; how long it runs does not matter."""
    names = sorted((before.keys() | now.keys()) - {'seconds'})
    found = [name for name in names if before.get(name) != now.get(name)]
    return ', '.join(f'{name} was {before.get(name)}, is {now.get(name)}' for name in found)


def _supervised(
    run: Run,
    team: Sequence[RobotProcesses],
    supervisor: Supervisor,
    folder: Path,
    log: MergedLog,
) -> int:
    """Run the processes to the end, print the summary; return the exit code."""
    console = None
    if any(node.name == node_table.CONSOLE for part in team for node in part.nodes):
        from launcher.console import OperatorConsole

        console = OperatorConsole(supervisor, log, node_table.CONSOLE)
        console.start()
    give_back()  # what reading the configuration took
    try:
        code = supervisor.run(run.seconds)
    finally:
        if console is not None:
            console.stop()
    for part in team:
        if all(node.name != BEHAVIOUR_NODE for node in part.nodes):
            continue
        done = summary(record_in(part.folder(folder)))
        log.plain(f'{part.robot}: {done}' if part.robot else done)
        is_lost = done.startswith(LOST)
        if is_lost or (supervisor.time_is_over and done == NOTHING_RECORDED):
            code = code or EXIT_NOTHING_DONE
    return code


def what_to_look_at(folder: Path) -> list[str]:
    """Write the report of a run; return where it is, and how to replay the run."""
    from surveillance_operator.recording.runs import robots_of
    from surveillance_operator.report import write_report

    lines = []
    robots = robots_of(folder).values()
    if any(summary(record_in(own)) != NOTHING_RECORDED for own in robots):
        try:
            lines.append(f'report: {_short(write_report(folder))}')
        except FileError as error:
            lines.append(f'report: {error}')
    if any((own / TIMELINE).exists() for own in robots):
        lines.append(f'replay: {" ".join(COMMAND)} replay {shlex.quote(_short(folder))}')
    return lines


def watch_command(run: Run) -> str:
    """Return what to type in another terminal to see this run."""
    words = [*COMMAND, 'watch']
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
        left_out = event_log.UnreadLines()
        text = str(mission_log.summary_in(record, left_out))
        return f'{text}\n  {left_out.words()}' if left_out.damaged else text
    except FileError as error:
        return f'{LOST}{error}'


def _robots(team: Sequence[RobotProcesses], profile: str) -> str:
    """Return which robots a run has, in words."""
    names = [part.robot for part in team if part.robot]
    return f'robots {", ".join(names)} ({profile})' if names else f'robot {profile}'


def _short(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
