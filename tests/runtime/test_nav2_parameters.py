"""Nav2's parameters with those of a robot in their place."""

from __future__ import annotations

import dataclasses
import json
import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import yaml

from surveillance_runtime.configuration import Configuration
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.profile import profile_layer, read_profile
from surveillance_runtime.profile.nav2_parameters import laid_over
from tests.launch_stand_ins import Argument, Configured

ROOT = Path(__file__).parents[2]
NAV2: dict[str, Any] = {
    'amcl': {'ros__parameters': {'base_frame_id': 'base_link', 'max_beams': 60}},
    'controller_server': {
        'ros__parameters': {'FollowPath': {'plugin': 'nav2_mppi_controller', 'vx_max': 0.5}}
    },
    'local_costmap': {
        'local_costmap': {
            'ros__parameters': {
                'robot_radius': 0.22,
                'plugins': ['voxel_layer', 'inflation_layer'],
                'voxel_layer': {
                    'observation_sources': 'scan',
                    'scan': {'topic': '/scan', 'data_type': 'LaserScan'},
                },
            }
        }
    },
}
"""A part of nav2_bringup/params/nav2_params.yaml, in its form."""


def of(name: str) -> dict[str, Any]:
    profile = read_profile(ROOT / 'config' / 'robots' / f'{name}.yaml').profile
    return laid_over(NAV2, profile, use_sim_time=True)


def test_a_waffle_gets_its_footprint_frames_and_speeds_and_keeps_the_tuning() -> None:
    made = of('turtlebot3_waffle')
    assert made['amcl']['ros__parameters']['base_frame_id'] == 'base_footprint'
    assert made['amcl']['ros__parameters']['max_beams'] == 60
    costmap = made['local_costmap']['local_costmap']['ros__parameters']
    assert json.loads(costmap['footprint'])[0] == [0.069, 0.153]
    assert 'robot_radius' not in costmap
    assert costmap['plugins'] == ['voxel_layer', 'inflation_layer']
    assert costmap['voxel_layer']['scan'] == {'topic': 'scan', 'data_type': 'LaserScan'}
    assert 'obstacle_layer' not in costmap
    follow = made['controller_server']['ros__parameters']['FollowPath']
    assert follow == {'plugin': 'nav2_mppi_controller', 'vx_max': 0.24}
    assert made['controller_server']['ros__parameters']['enable_stamped_cmd_vel'] is True
    assert NAV2['local_costmap']['local_costmap']['ros__parameters']['robot_radius'] == 0.22


def test_a_round_robot_with_two_lidars_marks_with_both(tmp_path: Path) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text('topics: {scans: [front, rear]}\nbody: {radius: 0.3}\n')
    costmap = laid_over(NAV2, read_profile(path).profile)['local_costmap']['local_costmap']
    given = costmap['ros__parameters']
    assert given['robot_radius'] == 0.3
    layer = given['voxel_layer']
    assert layer['observation_sources'] == 'scan scan2'
    assert [layer[each]['topic'] for each in ('scan', 'scan2')] == ['front', 'rear']
    assert layer['scan2']['data_type'] == 'LaserScan'


def test_nav2_speaks_to_the_monitor_that_the_profile_names(tmp_path: Path) -> None:
    path = tmp_path / 'robot.yaml'
    topics = 'topics: {command: cmd_vel, wanted: wanted}\ntypes: {command: TwistStamped}\n'
    for monitor, out, is_monitored in (('nav2', 'cmd_vel', False), ('own', 'wanted', True)):
        path.write_text(f'{topics}dock: {{navigator: nav2, monitor: {monitor}}}\n')
        file = read_profile(path)
        given = laid_over(NAV2, file.profile)['collision_monitor']['ros__parameters']
        assert given['cmd_vel_out_topic'] == out
        assert file.profile.is_monitored is is_monitored
        own = Configuration((profile_layer(file),)).resolve('collision_monitor')
        assert own['robot.wanted_type'].value == 'TwistStamped'


@dataclasses.dataclass
class Included:
    source: str
    launch_arguments: Any


@pytest.fixture
def include(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Run the launch file with stand-ins for `launch`, which is in no package index."""
    nav2 = tmp_path / 'nav2_bringup' / 'params'
    nav2.mkdir(parents=True)
    (nav2 / 'nav2_params.yaml').write_text(yaml.safe_dump(NAV2))
    shares = {'nav2_bringup': str(nav2.parent), 'surveillance_behaviour': str(ROOT)}
    stand_ins: dict[str, dict[str, Any]] = {
        'launch': {'LaunchContext': dict, 'LaunchDescription': list},
        'launch.actions': {
            'DeclareLaunchArgument': Argument,
            'OpaqueFunction': lambda function: function,
            'IncludeLaunchDescription': Included,
        },
        'launch.launch_description_sources': {'PythonLaunchDescriptionSource': str},
        'launch.substitutions': {'LaunchConfiguration': Configured},
        'ament_index_python': {},
        'ament_index_python.packages': {'get_package_share_directory': shares.__getitem__},
    }
    for name, content in stand_ins.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    source = ROOT / 'surveillance_behaviour' / 'launch' / 'nav2.launch.py'

    def run(**given: str) -> list[tuple[str, dict[str, str]]]:
        *arguments, opaque = runpy.run_path(str(source))['generate_launch_description']()
        values = {each.name: each.default_value for each in arguments}
        made = opaque({**values, **given})
        return [(Path(each.source).name, dict(each.launch_arguments)) for each in made]

    return run


def test_the_launch_file_starts_nav2_and_the_patrol_with_one_robot(include: Any) -> None:
    (nav2, given), (patrol, own) = include(gazebo='true', slam='true', map='place.yaml')
    assert nav2 == 'tb3_simulation_launch.py'
    assert given['slam'] == 'True'
    parameters = yaml.safe_load(Path(given['params_file']).read_text())
    assert parameters['slam_toolbox']['ros__parameters']['base_frame'] == 'base_footprint'
    assert patrol == 'surveillance.launch.py'
    assert own['without'] == 'collision_monitor'
    assert (own['mode'], own['robot'], own['map']) == ('ROBOT', 'turtlebot3_waffle', 'place.yaml')
    values = yaml.safe_load(Path(own['params']).read_text())
    assert values['/**']['ros__parameters']['use_sim_time'] is True
    ((alone, _),) = include(map_server='map.yaml', patrol='false')
    assert alone == 'bringup_launch.py'
    with pytest.raises(ParameterError, match='expected the place'):
        include()
