"""Starts the robot where ROS 2 is installed.

`ros2 launch surveillance_behaviour surveillance.launch.py`; arguments follow it as `name:=value`.

Arguments: `mode`, `behaviour`, `map`, `params`, `record`, `namespace`, `log_level`; see
`ros2 launch surveillance_behaviour surveillance.launch.py --show-args`. Without an installed ROS,
`python3 launch.py` does the same.
"""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from surveillance_runtime.configuration import Configuration, file_layer
from surveillance_runtime.place import read_place_file

# Executables of each package, by what brings them in.
ALWAYS = {
    'surveillance_behaviour': ['robot_behavior'],
    'surveillance_ontology': ['armor_server', 'ontology_map_builder'],
    'surveillance_controllers': ['battery_controller', 'planner_controller', 'motion_controller'],
}
PATROL = {
    'surveillance_behaviour': ['reasoner', 'initial_state'],
    'surveillance_perception': ['aruco_detector', 'marker_server', 'arm_controller'],
}
SIMULATION = {'surveillance_simulation': ['simulator']}
EXIT_CANNOT_START = 2
PLACES = {'surveillance': 'seven_rooms.yaml', 'patrol': 'patrol_world.yaml'}

ARGUMENTS = [
    DeclareLaunchArgument(
        'mode',
        default_value='SIMULATED',
        choices=['SIMULATED', 'RANDOM', 'MANUAL'],
        description='How the controllers work. For MANUAL start the prompt in a terminal of its '
        'own: ros2 run surveillance_controllers console',
    ),
    DeclareLaunchArgument(
        'behaviour',
        default_value='surveillance',
        choices=['surveillance', 'patrol'],
        description='The state machine that patrols.',
    ),
    DeclareLaunchArgument(
        'map', default_value='', description='File of the place; empty: the one of the behaviour.'
    ),
    DeclareLaunchArgument('params', default_value='', description='Further parameter file.'),
    DeclareLaunchArgument('record', default_value='', description='File for the mission record.'),
    DeclareLaunchArgument('namespace', default_value='', description='Namespace of all nodes.'),
    DeclareLaunchArgument('log_level', default_value='info', description='Least severity logged.'),
]


def start_nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes that the arguments ask for, each with the parameter files and started
    again.
    """

    def argument(name: str) -> str:
        return str(LaunchConfiguration(name).perform(context))

    mode, behaviour = argument('mode'), argument('behaviour')
    config = Path(get_package_share_directory('surveillance_behaviour'), 'config')
    files = [str(config / 'parameters.yaml'), argument('map') or str(config / PLACES[behaviour])]
    files += [argument('params')] if argument('params') else []
    check(files)
    parts = [ALWAYS]
    if behaviour == 'patrol':
        parts.append(PATROL)
    if behaviour == 'patrol' or mode == 'SIMULATED':
        parts.append(SIMULATION)
    own: dict[str, dict[str, object]] = {
        'robot_behavior': {'behaviour': behaviour, 'record': argument('record')},
        'reasoner': {'record': argument('record')},
        'initial_state': {'record': argument('record')},
    }
    for controller in ALWAYS['surveillance_controllers']:
        own[controller] = {'execution_mode': mode, 'console': False}
    return [
        Node(
            package=package,
            executable=name,
            name=name,
            namespace=argument('namespace'),
            parameters=[*files, own.get(name, {})],
            ros_arguments=['--log-level', argument('log_level')],
            output='screen',
            emulate_tty=True,
            respawn=True,
            respawn_delay=1.0,
            on_exit=stop_if_unusable,
        )
        for part in parts
        for package, names in part.items()
        for name in names
    ]


def check(files: list[str]) -> None:
    """Look at all parameters and the place before a node starts, as `launch.py` does.

    Raises:
        ParameterError, YamlFileError: One line about the first thing that is wrong.
    """
    read_place_file(files[1])
    merged = Configuration(tuple(file_layer(path) for path in files))
    merged.check()
    merged.place()


def stop_if_unusable(event: ProcessExited, _context: LaunchContext) -> list[Shutdown] | None:
    """End the launch when a node says that its configuration does not let it start."""
    if event.returncode != EXIT_CANNOT_START:
        return None
    return [Shutdown(reason=f'{event.process_name} cannot start as it is configured')]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` calls."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=start_nodes)])
