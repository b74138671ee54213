"""Starts Nav2 for the robot of a profile, a TurtleBot3 in Gazebo if wanted, and the patrol.

    ros2 launch surveillance_behaviour nav2.launch.py robot:=turtlebot3_waffle map:=place.yaml \
        map_server:=place_map.yaml gazebo:=true

It needs nav2_bringup, with `slam:=true` slam_toolbox, with `gazebo:=true` nav2_minimal_tb3_sim and
ros_gz_sim. Nav2's parameters are its own, with those of the profile in their place
(`surveillance_runtime/profile/nav2_parameters.py`). The patrol drives by Nav2, as `robot:=nav2`
does, with the frames and topics of this robot.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchContext, LaunchDescription
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.profile import find_profile, out_of_nav2s_way, read_profile
from surveillance_runtime.profile.nav2_parameters import laid_over

_SWITCH = ['false', 'true']
ARGUMENTS = [
    DeclareLaunchArgument(
        'robot', default_value='turtlebot3_waffle', description="the robot's profile"
    ),
    DeclareLaunchArgument(
        'map',
        default_value='',
        description='the place: rooms, doors, station; empty: the seven rooms',
    ),
    DeclareLaunchArgument(
        'map_server',
        default_value='',
        description="the place's map in map_server's format; empty with slam:=true",
    ),
    DeclareLaunchArgument(
        'slam', default_value='false', choices=_SWITCH, description='map with slam_toolbox'
    ),
    DeclareLaunchArgument(
        'gazebo',
        default_value='false',
        choices=_SWITCH,
        description='a TurtleBot3 Waffle in Gazebo instead of a real robot',
    ),
    DeclareLaunchArgument(
        'headless', default_value='true', choices=_SWITCH, description='Gazebo without a window'
    ),
    DeclareLaunchArgument(
        'patrol', default_value='true', choices=_SWITCH, description='start the patrol, too'
    ),
]


def include(context: LaunchContext) -> list[IncludeLaunchDescription]:
    """Return the launch files that the arguments ask for, with their arguments.

    Raises:
        ParameterError: Neither a map nor SLAM is asked for.
    """
    given = {each.name: LaunchConfiguration(each.name).perform(context) for each in ARGUMENTS}
    simulated, slam = given['gazebo'] == 'true', given['slam'] == 'true'
    if not (slam or given['map_server']):
        raise ParameterError(
            "map_server: empty: expected the place's map as map_server:=FILE.yaml, or slam:=true"
        )
    own = Path(get_package_share_directory('surveillance_behaviour'))
    nav2 = Path(get_package_share_directory('nav2_bringup'))
    profile = read_profile(find_profile(own / 'config', given['robot'])).profile
    folder = Path(tempfile.mkdtemp(prefix='surveillance-nav2-'))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    base = yaml.safe_load((nav2 / 'params' / 'nav2_params.yaml').read_text('utf-8'))
    parameters = folder / 'nav2_params.yaml'
    merged = laid_over(base, profile, use_sim_time=simulated)
    parameters.write_text(yaml.safe_dump(merged), 'utf-8')
    common = {
        'params_file': str(parameters),
        'map': given['map_server'],
        'slam': str(slam),
        'use_sim_time': str(simulated).lower(),
        'autostart': 'true',
    }
    name = 'tb3_simulation_launch.py' if simulated else 'bringup_launch.py'
    more = {'headless': given['headless'].capitalize(), 'use_rviz': 'False'} if simulated else {}
    included = [_included(nav2 / 'launch' / name, {**common, **more})]
    if given['patrol'] == 'true':
        clock = folder / 'patrol.yaml'
        values = {
            '/**': {'ros__parameters': {'use_sim_time': simulated}},
            '/**/motion_controller': {'ros__parameters': {'navigator': 'nav2'}},
            '/**/collision_monitor': {
                'ros__parameters': {'robot.wanted_type': profile.types.command}
            },
        }
        clock.write_text(yaml.safe_dump(values), 'utf-8')
        patrol = {
            'mode': 'ROBOT',
            'robot': given['robot'],
            'map': given['map'],
            'params': str(clock),
            # Nav2 has these names, too.
            'remap': ','.join(f'{old}:={new}' for old, new in out_of_nav2s_way().items()),
            'without': '' if profile.dock.monitor == 'own' else 'collision_monitor',
        }
        included.append(_included(own / 'launch' / 'surveillance.launch.py', patrol))
    return included


def _included(file: Path, arguments: dict[str, str]) -> IncludeLaunchDescription:
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(file)), launch_arguments=arguments.items()
    )


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` calls."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=include)])
