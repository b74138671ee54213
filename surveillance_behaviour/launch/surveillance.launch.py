"""Starts the robot where ROS 2 is installed.

`ros2 launch surveillance_behaviour surveillance.launch.py`; arguments follow it as `name:=value`.

Arguments: `mode`, `behaviour`, `map`, `params`, `record`, `namespace`, `log_level`; see
`ros2 launch surveillance_behaviour surveillance.launch.py --show-args`. Without an installed ROS,
`python3 launch.py` does the same.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from surveillance_runtime.configuration import Configuration
from surveillance_runtime.launch_protocol import EXIT_CANNOT_START, EXIT_NOT_NOW
from surveillance_runtime.node_table import (
    BEHAVIOURS,
    DEFAULT_MODE,
    LOG_LEVELS,
    MODES,
    find,
    select,
)
from surveillance_runtime.run_parameters import (
    full_name,
    mode_entries,
    record_entries,
    run_layers,
    write_parameters,
)

MARKERS = 'mission_markers'

ARGUMENTS = [
    DeclareLaunchArgument(
        'mode',
        default_value=DEFAULT_MODE,
        choices=list(MODES),
        description='How the controllers work. For MANUAL start the prompt in a terminal of its '
        'own: ros2 run surveillance_operator console',
    ),
    DeclareLaunchArgument(
        'behaviour',
        default_value=BEHAVIOURS[0],
        choices=list(BEHAVIOURS),
        description='The state machine that patrols.',
    ),
    DeclareLaunchArgument(
        'map', default_value='', description='File of the place; empty: the one of the behaviour.'
    ),
    DeclareLaunchArgument('params', default_value='', description='Further parameter file.'),
    DeclareLaunchArgument('record', default_value='', description='File for the mission record.'),
    DeclareLaunchArgument('namespace', default_value='', description='Namespace of all nodes.'),
    DeclareLaunchArgument(
        'log_level',
        default_value='info',
        choices=list(LOG_LEVELS),
        description='Least severity logged.',
    ),
]


def start_nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes that the arguments ask for, each with one file of parameters.

    Raises:
        ParameterError, FileError: One line about the first thing that is wrong with the
            parameters or the place; then no node is started.
    """
    given = {each.name: LaunchConfiguration(each.name).perform(context) for each in ARGUMENTS}
    mode, behaviour, namespace = given['mode'], given['behaviour'], given['namespace']
    record = record_entries(Path(given['record'])) if given['record'] else ()
    merged = Configuration(
        run_layers(
            Path(get_package_share_directory('surveillance_behaviour'), 'config'),
            behaviour,
            place=Path(given['map']) if given['map'] else None,
            files=[Path(given['params'])] if given['params'] else [],
            options=[*mode_entries(mode, prompts=False), *record],
        )
    )
    merged.check()
    merged.place('simulator', full_name(namespace, 'simulator'))
    folder = Path(tempfile.mkdtemp(prefix='surveillance-'))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    nodes = (*select(mode, behaviour), find(MARKERS))
    files = write_parameters(folder, namespace, merged, nodes)
    return [
        Node(
            package=node.package,
            executable=node.name,
            name=node.name,
            namespace=namespace,
            parameters=[str(files[node.name])],
            ros_arguments=['--log-level', given['log_level']],
            output='screen',
            emulate_tty=True,
            respawn=True,
            respawn_delay=1.0,
            on_exit=stop_if_unusable,
        )
        for node in nodes
    ]


def stop_if_unusable(event: ProcessExited, _context: LaunchContext) -> list[Shutdown] | None:
    """End the launch when a node says that its configuration does not let it start."""
    if event.returncode not in (EXIT_CANNOT_START, EXIT_NOT_NOW):
        return None
    return [Shutdown(reason=f'{event.process_name} cannot start with this configuration')]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` calls."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=start_nodes)])
