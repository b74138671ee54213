"""The parameters of the nodes of a run, merged from all that gives them and checked."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from launcher.run import OBSERVER, RECORDER, Run
from strict_files.files import FileError
from surveillance_runtime import node_table
from surveillance_runtime.configuration import (
    Configuration,
    Entry,
    RosArguments,
    Setting,
    argument_layer,
    resolved_text,
)
from surveillance_runtime.event_log import record_in
from surveillance_runtime.profile import (
    ProfileFile,
    RobotProfile,
    check_base,
    check_behaviour,
    find_profile,
    read_profile,
    unmonitored_entries,
)
from surveillance_runtime.run_files import ARMOR_STORE, RECORDING, TRUTH
from surveillance_runtime.run_parameters import (
    BEHAVIOUR_NODE,
    alarm_entries,
    for_node,
    full_name,
    mode_entries,
    page_entries,
    place_file,
    record_entries,
    run_layers,
    simulator_entries,
    stage_entry,
    watch_entries,
)

ONTOLOGIES = 'ontologies'


def configuration(
    config: Path,
    run: Run,
    folder: Path | None = None,
    more: RosArguments | None = None,
    fleet: Sequence[Entry] = (),
) -> Configuration:
    """Merge all that gives parameters to the nodes of a run; each entry and the place are checked.

    Args:
        config: The folder with the parameter files.
        run: What the command line asks for.
        folder: Where the run leaves its record, its ontologies and their store.
        more: Further arguments in ROS's own form.
        fleet: What the fleet says of the nodes; it yields to the user's files and options.

    Raises:
        ValueError: One line about the first entry that is wrong.
    """
    run.check()
    try:
        merged = _merged(config, run, folder, more, fleet)
        merged.check()
        merged.place('simulator', full_name(run.namespace, 'simulator'))
        _check_behaviour(merged, run)
        check_behaviour(profile_of(config, run), run.behaviour)
        check_base(profile_of(config, run), run.mode or node_table.DEFAULT_MODE)
    except FileError as error:
        raise ValueError(f'parameter file {error}') from None
    return merged


def profile_of(config: Path, run: Run) -> ProfileFile:
    """Read the profile of the robot that a run asks for.

    Raises:
        FileError: There is none, or it cannot be used.
    """
    return read_profile(find_profile(config, run.robot))


def with_profile(run: Run, config: Path) -> tuple[Run, RobotProfile]:
    """Return the run with what the profile says where the run asked for nothing, and the profile.

    Raises:
        FileError: There is no such profile, or it cannot be used.
    """
    profile = profile_of(config, run).profile
    if run.namespace is None and profile.namespace:
        run = replace(run, namespace=profile.namespace)
    return run, profile


def _merged(
    config: Path,
    run: Run,
    folder: Path | None,
    more: RosArguments | None,
    fleet: Sequence[Entry],
) -> Configuration:
    files = [run.parameters] if run.parameters is not None else []
    layers = run_layers(
        config,
        run.behaviour,
        place=run.place,
        robot=profile_of(config, run),
        watched=run.watch is not None,
        chosen=[*fleet, *(_folders_of(folder.resolve()) if folder is not None else ())],
        files=[*files, *(Path(file) for file in (more.files if more else ()))],
        options=[
            *_option_entries(config, run, folder),
            *_unmonitored(config, run),
        ],
    )
    assignments = (*run.assignments, *(more.assignments if more else ()))
    return Configuration((*layers, argument_layer(assignments)))


def _unmonitored(config: Path, run: Run) -> Iterator[Entry]:
    """Yield what the controller is told when no collision monitor is started."""
    file = profile_of(config, run)
    names = {node.name for node in run.nodes(monitored=file.profile.is_monitored)}
    return unmonitored_entries(file, names)


def _folders_of(folder: Path) -> Iterator[Entry]:
    """Yield where the nodes of a run write, if the user's file names no other place."""
    for name, part in (('ontologies_folder', ONTOLOGIES), ('store', ARMOR_STORE)):
        yield for_node('armor_server', name, str(folder / part), 'this run')
    for node in (
        'battery_controller',
        'motion_controller',
        'ontology_map_builder',
        'simulator',
    ):
        yield for_node(node, 'state_file', str(folder / f'{node}.json'), 'this run')
    yield for_node('simulator', 'truth_file', str(folder / TRUTH), 'this run')


def _option_entries(config: Path, run: Run, folder: Path | None) -> Iterator[Entry]:
    """Yield what the options say as parameters, for the nodes that they concern."""
    yield from simulator_entries(run.simulator)
    if folder is not None:
        yield from record_entries(record_in(folder))
        yield from _observer_entries(config, run, folder)
    if run.stage is not None:
        yield stage_entry(run.stage)
    # Without one that was asked for, the mode is what the parameter files say.
    if run.mode:
        # In a whole run one console reads for all.
        yield from mode_entries(run.mode, prompts=run.mode != 'MANUAL' or folder is None)


def _observer_entries(config: Path, run: Run, folder: Path) -> Iterator[Entry]:
    """Yield what the recorder and the page are told."""
    yield for_node(RECORDER, 'folder', str(folder / RECORDING), 'this run')
    yield for_node(RECORDER, 'keep', float(run.keep), '--keep')
    yield from alarm_entries(folder, command=run.alarm, notify=run.notify)
    if run.watch is not None:
        yield from watch_entries(folder, run.watch)
    if run.has_page:
        yield from page_entries(
            folder,
            control=run.web_control,
            address=run.web_address,
            origin=run.web_origin,
            place=place_file(config, run.behaviour, run.place),
        )


def _check_behaviour(merged: Configuration, run: Run) -> None:
    given = merged.resolve(BEHAVIOUR_NODE, full_name(run.namespace, BEHAVIOUR_NODE)).get(
        'behaviour'
    )
    if given is not None and given.value != run.behaviour:
        raise ValueError(
            f'{given.origin}: behaviour {given.value}, but the run is one of {run.behaviour}: '
            f'expected --behaviour {given.value}, which starts its nodes too'
        )


def check_assignments(merged: Configuration, nodes: Sequence[node_table.Node]) -> None:
    """Make sure that each `-p` is for a node that is started.

    Raises:
        ValueError: One would be ignored.
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
            raise ValueError(f'{entry.origin}: no node that is started takes it: {names}')


def check_stage(run: Run, nodes: Sequence[node_table.Node]) -> None:
    """Make sure that what is staged has a simulator to happen in.

    Raises:
        ValueError: No simulator is started.
    """
    if run.stage is not None and all(node.name != 'simulator' for node in nodes):
        raise ValueError(f'--stage {run.stage}: expected a run whose simulator is started')


def check_watch(merged: Configuration, run: Run, nodes: Sequence[node_table.Node]) -> None:
    """Make sure that the rules of `--watch` name places and doors of the observer's place.

    Raises:
        ValueError: One names another, or the file is wrong.
    """
    if run.watch is None or all(node.name != OBSERVER for node in nodes):
        return
    from indoor_watch import read_watch_file

    settings = merged.resolve(OBSERVER, full_name(run.namespace, OBSERVER))
    places, doors = (
        tuple(name.removeprefix(table) for name in settings if name.startswith(table))
        for table in ('room_positions.', 'doors.')
    )
    try:
        read_watch_file(run.watch, places, doors)
    except FileError as error:
        raise ValueError(f'--watch {error}') from None


def check_clocks(merged: Configuration, run: Run, nodes: Sequence[node_table.Node]) -> None:
    """Make sure that all nodes live by the clock of a simulation that is slower or faster.

    Raises:
        ValueError: One would live by the machine's.
    """
    given = {
        each.name: merged.resolve(each.name, full_name(run.namespace, each.name)) for each in nodes
    }
    speed = given.get('simulator', {}).get('speed')
    if speed is None or speed.value == 1.0:
        return
    for name, settings in given.items():
        follows = settings.get('use_sim_time')
        if follows is None or not follows.value:
            raise ValueError(
                f'{speed.origin}: at speed {speed.value:g} {name} needs use_sim_time:=true, '
                'expected for all nodes as in config/fast.yaml'
            )


def with_mode_of(run: Run, merged: Configuration) -> Run:
    """Return the run, where none was asked for with the mode that all controllers are given."""
    if run.mode:
        return run
    modes = set()
    for node in node_table.NODES:
        if node.name in node_table.RUN_NODES and node.has_modes:
            setting = merged.resolve(node.name, full_name(run.namespace, node.name)).get(
                'execution_mode'
            )
            modes.add(setting.value if setting is not None else node_table.DEFAULT_MODE)
    mode = modes.pop()
    return run if modes or mode == node_table.DEFAULT_MODE else replace(run, mode=mode)


def parameters_in_memory(name: str, settings: Mapping[str, Setting]) -> Path:
    """Return a file with a node's parameters that lives as long as this process."""
    descriptor = os.memfd_create('parameters', 0)
    os.write(descriptor, resolved_text(name, settings).encode())
    return Path(f'/proc/self/fd/{descriptor}')
