"""Starts the robot where ROS 2 is installed.

`ros2 launch surveillance_behaviour surveillance.launch.py`; arguments follow it as `name:=value`.

The arguments are options of `launch.py` (`surveillance_runtime/run_options.py`); see
`ros2 launch surveillance_behaviour surveillance.launch.py --show-args`. Without an installed ROS,
`python3 launch.py` does the same.
"""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from floor_plans.fleet import MOST_ROBOTS
from floor_plans.writing import copy_place
from launch import LaunchContext, LaunchDescription
from surveillance_runtime.configuration import Configuration, Entry, Layer
from surveillance_runtime.discovery import launched_nodes, problem_of
from surveillance_runtime.event_log import record_in
from surveillance_runtime.fleet_parts import Choice, TeamPart, team_parts
from surveillance_runtime.launch_protocol import EXIT_CANNOT_START, EXIT_NOT_NOW
from surveillance_runtime.node_table import ALARM, MARKERS, RECORDER, by_process, find, select
from surveillance_runtime.node_table import Node as NodeOfTable
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.profile import (
    check_base,
    check_behaviour,
    find_profile,
    read_profile,
    remappings,
    unmonitored_entries,
)
from surveillance_runtime.run_files import PLACE, RECORDING
from surveillance_runtime.run_options import OPTIONS, left_out
from surveillance_runtime.run_parameters import (
    OBSERVER,
    PAGE,
    alarm_entries,
    for_node,
    full_name,
    mode_entries,
    page_entries,
    place_file,
    place_name,
    record_entries,
    run_layers,
    simulator_entries,
    stage_entry,
    watch_entries,
    write_parameters,
)

ARGUMENTS = [
    DeclareLaunchArgument(
        option.name,
        default_value=option.default,
        description=option.help,
        **({'choices': list(option.choices)} if option.choices else {}),
    )
    for option in OPTIONS.values()
]


def start_nodes(context: LaunchContext) -> list[Node]:
    """Return the processes of the nodes that the arguments ask for, one file of parameters each.

    Raises:
        ParameterError, FileError: One line about the first thing that is wrong with the
            parameters or the place; then no node is started.
    """
    given = {each.name: LaunchConfiguration(each.name).perform(context) for each in ARGUMENTS}
    if problem := problem_of(given['network'], os.environ):
        raise ParameterError(f'network: {problem}')
    mode, behaviour = given['mode'], given['behaviour']
    config = Path(get_package_share_directory('surveillance_behaviour'), 'config')
    robot = read_profile(find_profile(config, given['robot']))
    check_behaviour(robot, behaviour)
    check_base(robot, mode)
    at = Path(given['map']) if given['map'] else None
    choice = Choice(
        _names(given['only']),
        _names(given['without']),
        lambda only, without: select(
            mode,
            behaviour,
            only,
            left_out(given['simulator'], without),
            monitored=robot.profile.is_monitored,
        ),
        lambda _only: tuple(_observers(given)),
    )
    parts = team_parts(
        place_file(config, behaviour, at),
        _count(given['robots']),
        robot.profile.body.reach,
        given['namespace'] or robot.profile.namespace,
        choice,
    )
    folder = Path(tempfile.mkdtemp(prefix='surveillance-'))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return [node for part in parts for node in _nodes_of(part, given, config, part.folder(folder))]


def _nodes_of(part: TeamPart, given: Mapping[str, str], config: Path, folder: Path) -> list[Node]:
    """Return the processes of one part: of the only robot, of a robot of a fleet, or shared."""
    mode, behaviour = given['mode'], given['behaviour']
    robot = read_profile(find_profile(config, part.profile or given['robot']))
    names = [node.name for node in part.nodes]
    at = Path(given['map']) if given['map'] else None
    folder.mkdir(exist_ok=True)
    merged = Configuration(
        run_layers(
            config,
            behaviour,
            place=at,
            robot=robot,
            watched=bool(given['watch']),
            chosen=part.entries,
            files=[Path(given['params'])] if given['params'] else [],
            options=[
                *mode_entries(mode, prompts=False),
                *simulator_entries(given['simulator']),
                *unmonitored_entries(robot, names),
                *_traces(given, folder, part, place_file(config, behaviour, at)),
            ],
        )
    )
    merged.check()
    place = merged.place('simulator', full_name(part.namespace, 'simulator'))
    # The store of the ontology outlives the launch, and the next one may be in another building.
    named = place_name(place_file(config, behaviour, at), place)
    entry = for_node('armor_server', 'place', named, 'the place')
    merged = Configuration((Layer(entry.origin, (entry,)), *merged.layers))
    renamed = [
        *_remaps(given['remap']),
        *part.renamed,
        *remappings(robot.profile, names, mode),
    ]
    files = write_parameters(folder, part.namespace, merged, part.everyone)
    environ = launched_nodes(os.environ, given['network'])
    return [
        Node(
            **_program(process, nodes),
            namespace=part.namespace,
            parameters=[str(files[node.name]) for node in nodes],
            remappings=renamed,
            ros_arguments=['--log-level', given['log_level']],
            additional_env=environ,
            output='screen',
            emulate_tty=True,
            respawn=True,
            respawn_delay=1.0,
            on_exit=stop_if_unusable,
        )
        for process, nodes in by_process(part.everyone, given['processes'], mode).items()
    ]


def _program(process: str, nodes: Sequence[NodeOfTable]) -> dict[str, Any]:
    """Return what runs the nodes of a process; of several, each keeps its own name."""
    if len(nodes) == 1:
        return {'package': nodes[0].package, 'executable': nodes[0].name, 'name': nodes[0].name}
    names = [node.name for node in nodes]
    return {
        **{'package': 'surveillance_runtime', 'executable': 'nodes', 'exec_name': process},
        'arguments': names,
    }


def _count(text: str) -> int | None:
    """Return how many robots are asked for; None: as the place says.

    Raises:
        ParameterError: The text is no number from 1 to `MOST_ROBOTS`.
    """
    if not text:
        return None
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= MOST_ROBOTS:
        raise ParameterError(f'robots {text!r}: expected a number from 1 to {MOST_ROBOTS}')
    return int(text)


def _names(text: str) -> list[str]:
    return [name for name in text.replace(' ', '').split(',') if name]


def _remaps(text: str) -> list[tuple[str, str]]:
    """Return what `remap:=FROM:=TO,FROM:=TO` renames."""
    pairs = []
    for rule in _names(text):
        old, sign, new = rule.partition(':=')
        if not (old and sign and new):
            raise ParameterError(f'remap {rule!r}: expected FROM:=TO like scan:=front/scan')
        pairs.append((old, new))
    return pairs


def _has_page(given: Mapping[str, str]) -> bool:
    return 'true' in (given['web'], given['web_control']) or bool(
        given['web_address'] or given['web_origin']
    )


def _observers(given: Mapping[str, str]) -> list[NodeOfTable]:
    """Return the nodes that only look on."""
    names = [ALARM, MARKERS]
    if given['record']:
        names.append(RECORDER)
    if given['watch']:
        names.append(OBSERVER)
    if _has_page(given):
        names.append(PAGE)
    return [find(name) for name in names]


def _traces(given: Mapping[str, str], folder: Path, part: TeamPart, place: Path) -> Iterator[Entry]:
    """Yield where a part of the run leaves its files, and what the page is told."""
    kept = part.folder(Path(given['record'])) if given['record'] else folder
    if given['record']:
        kept.mkdir(parents=True, exist_ok=True)
        copy_place(place, kept / PLACE)
        yield from record_entries(record_in(kept))
        yield for_node(RECORDER, 'folder', str(kept / RECORDING), 'record')
    notify = Path(given['notify']) if given['notify'] else None
    yield from alarm_entries(kept, command=given['alarm'], notify=notify)
    if given['watch']:
        yield from watch_entries(kept, Path(given['watch']))
    if given['stage']:
        yield stage_entry(Path(given['stage']))
    if _has_page(given):
        yield from page_entries(
            folder,
            control=given['web_control'] == 'true',
            address=given['web_address'] or None,
            origin=given['web_origin'] or None,
        )


def stop_if_unusable(event: ProcessExited, _context: LaunchContext) -> list[Shutdown] | None:
    """End the launch when a node says that its configuration does not let it start."""
    if event.returncode not in (EXIT_CANNOT_START, EXIT_NOT_NOW):
        return None
    # A page whose port is taken is missed, and the mission goes on.
    if event.returncode == EXIT_NOT_NOW and PAGE in event.process_name:
        return None
    return [Shutdown(reason=f'{event.process_name} cannot start with this configuration')]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` calls."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=start_nodes)])
