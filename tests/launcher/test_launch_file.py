"""The launch file for an installed ROS starts what `launch.py` starts, with the same values.

`launch` and `launch_ros` are in no Python package index: stand-ins take the calls, with the names
that the originals give to their arguments.
"""

from __future__ import annotations

import dataclasses
import os
import runpy
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from launcher.fleet_launch import parts
from launcher.run import Run
from launcher.run_configuration import configuration, profile_of
from launcher.run_processes import programs_of
from strict_files.files import FileError
from surveillance_runtime import discovery
from surveillance_runtime.configuration import Configuration, file_layer
from surveillance_runtime.node_table import BEHAVIOURS, COMPOSITIONS, CONSOLE, MODES, find, select
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.run_parameters import WATCHED_STAY
from tests.launch_stand_ins import Argument, Configured
from tests.launcher.conftest import ROOT

SOURCE = ROOT / 'surveillance_behaviour' / 'launch' / 'surveillance.launch.py'
PER_RUN = {'record', 'folder', 'console', 'ontologies_folder', 'store', 'place', 'state_file'}


@dataclasses.dataclass
class StartedNode:
    package: str
    executable: str
    namespace: str
    parameters: list[str]
    remappings: list[tuple[str, str]]
    ros_arguments: list[str]
    output: str
    additional_env: dict[str, str]
    emulate_tty: bool
    respawn: bool
    respawn_delay: float
    on_exit: Any
    name: str = ''
    exec_name: str = ''
    arguments: list[str] = dataclasses.field(default_factory=list)

    def nodes(self) -> list[StartedNode]:
        """Return each of the nodes that the process holds, as if it were alone."""
        if not self.arguments:
            return [self]
        return [
            dataclasses.replace(
                self,
                package=find(name).package,
                executable=name,
                name=name,
                parameters=[path],
                arguments=[],
            )
            for name, path in zip(self.arguments, self.parameters, strict=True)
        ]


@pytest.fixture
def start(processes):
    """Return what runs the launch file with some arguments and gives the nodes it starts."""
    return lambda **given: [node for each in processes(**given) for node in each.nodes()]


@pytest.fixture
def processes(monkeypatch, tmp_path):
    """Return what runs the launch file with some arguments and gives the processes it starts."""
    stand_ins: dict[str, dict[str, Any]] = {
        'launch': {'LaunchContext': dict, 'LaunchDescription': list},
        'launch.actions': {
            'DeclareLaunchArgument': Argument,
            'OpaqueFunction': lambda function: function,
            'Shutdown': lambda reason: reason,
        },
        'launch.events': {},
        'launch.events.process': {'ProcessExited': types.SimpleNamespace},
        'launch.substitutions': {'LaunchConfiguration': Configured},
        'launch_ros': {},
        'launch_ros.actions': {'Node': StartedNode},
        'ament_index_python': {},
        'ament_index_python.packages': {'get_package_share_directory': lambda _: str(ROOT)},
    }
    for name, content in stand_ins.items():
        module = types.ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr('tempfile.mkdtemp', lambda **_: str(tmp_path))

    def run(**given: str) -> list[StartedNode]:
        description = runpy.run_path(str(SOURCE))['generate_launch_description']()
        *arguments, opaque = description
        values = {each.name: each.default_value for each in arguments}
        for each in arguments:
            assert each.choices is None or given.get(each.name, each.default_value) in each.choices
        return opaque({**values, **given})

    return run


def settings(node: StartedNode) -> dict[str, object]:
    """Return what a node reads from its file."""
    full_name = '/'.join(('', *filter(None, (node.namespace.strip('/'), node.name))))
    merged = Configuration((file_layer(node.parameters[0]),))
    return {name: each.value for name, each in merged.resolve(node.name, full_name).items()}


@pytest.mark.parametrize('behaviour', BEHAVIOURS)
@pytest.mark.parametrize('mode', MODES)
def test_it_starts_the_same_nodes_with_the_same_values(start, mode, behaviour):
    started = start(mode=mode, behaviour=behaviour)
    wanted = (*select(mode, behaviour), find('alarm'), find('mission_markers'))
    assert {(n.package, n.executable) for n in started} == {(n.package, n.name) for n in wanted}
    assert len(started) == len(wanted)
    merged = configuration(ROOT / 'config', Run(mode=mode, behaviour=behaviour))
    for node in started:
        same = {
            name: each.value
            for name, each in merged.resolve(node.name, f'/{node.name}').items()
            if name not in PER_RUN
        }
        assert {k: v for k, v in settings(node).items() if k not in PER_RUN} == same


def test_the_users_place_parameters_record_and_namespace_reach_the_nodes(start, tmp_path):
    own = tmp_path / 'own.yaml'
    own.write_text('/**: {ros__parameters: {urgency_threshold: 33}}')
    office = str(ROOT / 'config' / 'office.yaml')
    nodes = start(map=office, params=str(own), record=str(tmp_path / 'it'), namespace='/robot1')
    by_name = {node.name: settings(node) for node in nodes}
    assert by_name['robot_behavior']['record'] == str(tmp_path / 'it' / 'events.jsonl')
    assert by_name['mission_recorder']['folder'] == str(tmp_path / 'it' / 'recording')
    assert 33 in [values.get('urgency_threshold') for values in by_name.values()]
    (builder,) = (node for node in nodes if node.name == 'ontology_map_builder')
    assert 'office.yaml' in Path(builder.parameters[0]).read_text()


def test_a_person_is_called_as_with_launch_py(start, tmp_path):
    given = {'alarm': 'blink', 'notify': str(tmp_path / 'notify.yaml')}
    nodes = {node.name: settings(node) for node in start(record=str(tmp_path / 'it'), **given)}
    alarm = nodes['alarm']
    assert (alarm['command'], alarm['notify_file']) == ('blink', given['notify'])
    assert alarm['folder'] == str(tmp_path / 'it')


def test_its_nodes_are_open_to_what_launch_py_s_are(start, monkeypatch):
    for name in discovery.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    for network in ('', 'localhost', 'open'):
        for node in start(network=network):
            assert node.additional_env == discovery.launched_nodes({}, network)
    with pytest.raises(ValueError, match='network: lokal: expected localhost, open, or a file'):
        start(network='lokal')


def test_a_robot_that_watches_stays_as_long_as_with_launch_py(start, tmp_path):
    rules = tmp_path / 'watch.yaml'
    nodes = {node.name: settings(node) for node in start(watch=str(rules))}
    merged = configuration(ROOT / 'config', Run(watch=rules))
    stay = merged.resolve('robot_behavior')['exploration_seconds'].value
    assert nodes['robot_behavior']['exploration_seconds'] == stay == WATCHED_STAY


@pytest.mark.parametrize(
    ('given', 'error', 'said'),
    [
        ({'map': '/no.yaml'}, FileError, r'/no.yaml: .*No such file'),
        ({'params': 'TYPO'}, ParameterError, r'own.yaml:1: .*urgency_treshold.*urgency_threshold'),
    ],
)
def test_what_is_wrong_is_said_before_a_node_starts(start, tmp_path, given, error, said):
    own = tmp_path / 'own.yaml'
    own.write_text('/**: {ros__parameters: {urgency_treshold: 33}}')
    with pytest.raises(error, match=said):
        start(**{key: str(own) if value == 'TYPO' else value for key, value in given.items()})


def test_its_arguments_are_options_of_launch_py(start, tmp_path):
    nodes = start(
        mode='ROBOT',
        robot='turtlebot3_burger',
        web='true',
        without='robot_behavior,reasoner',
        remap='map:=/building/map',
    )
    names = [node.name for node in nodes]
    assert {'simulator', 'robot_behavior'}.isdisjoint(names)
    assert {'mission_page', 'collision_monitor'} <= set(names)
    renamed = dict(reversed(nodes[0].remappings))
    assert renamed['cmd_vel_monitored'] == 'cmd_vel'
    assert renamed['cmd_vel'] == 'cmd_vel_nav'
    assert renamed['map'] == '/building/map'
    by_name = {node.name: settings(node) for node in nodes}
    assert by_name['collision_monitor']['robot.command_type'] == 'TwistStamped'
    assert 'simulator' not in [node.name for node in start(simulator='none')]
    in_physics = {node.name: settings(node) for node in start(simulator='mujoco')}
    assert in_physics['simulator']['engine'] == 'mujoco'
    with pytest.raises(FileError, match=r'turtlebot3_burger.yaml:\d+: arm: none, but'):
        start(mode='ROBOT', robot='turtlebot3_burger', behaviour='patrol')
    with pytest.raises(FileError, match=r"--robot 'turtlebot3_burgr'.*'turtlebot3_burger'"):
        start(robot='turtlebot3_burgr')


def test_it_starts_the_fleet_that_launch_py_starts(start, tmp_path):
    nodes = start(robots='3', record=str(tmp_path / 'it'), web='true')
    run = Run(robots=3, record='runs', web=True)
    wanted = parts(run, ROOT / 'config', profile_of(ROOT / 'config', run))
    same = {
        (f'/{part.robot}' if part.robot else None, node.name)
        for part in wanted
        for node in part.everyone
    }
    assert {(f'/{n.namespace}' if n.namespace else None, n.name) for n in nodes} == same
    for part in wanted:
        merged = configuration(ROOT / 'config', part.run, fleet=part.entries)
        for node in part.nodes:
            (own,) = [
                n for n in nodes if n.name == node.name and n.namespace == (part.namespace or '')
            ]
            full = f'/{part.robot}/{node.name}' if part.robot else f'/{node.name}'
            known = merged.resolve(node.name, full).items()
            values = {name: each.value for name, each in known if name not in PER_RUN}
            assert {k: v for k, v in settings(own).items() if k not in PER_RUN} == values
            assert set(part.renamed) <= set(own.remappings)
    by_robot = {n.namespace: settings(n) for n in nodes if n.name == 'mission_recorder'}
    assert by_robot['robot2']['folder'] == str(tmp_path / 'it' / 'robot2' / 'recording')
    assert by_robot['robot2']['other_robots'] == ['/robot1', '/robot3']
    assert (tmp_path / 'it' / 'robot2' / 'place.yaml').is_file()
    named = tmp_path / 'named.yaml'
    place = (ROOT / 'config' / 'seven_rooms.yaml').read_text()
    named.write_text(f'{place}    robots:\n      anna: {{start: [10.0, 8.0, 0.0]}}\n')
    assert {n.namespace for n in start(map=str(named))} == {'', 'anna'}
    for wrong in ('0', 'two', '101'):
        with pytest.raises(ParameterError, match=f"robots '{wrong}': expected a number from 1"):
            start(robots=wrong)


def test_each_place_has_a_store_of_its_own(start, tmp_path):
    """The ontology outlives a launch, and the next one may be in another building."""
    moved, further = tmp_path / 'it' / 'seven_rooms.yaml', tmp_path / 'office' / 'seven_rooms.yaml'
    for copy, name in ((moved, 'seven_rooms'), (further, 'office')):
        copy.parent.mkdir()
        copy.write_text((ROOT / 'config' / f'{name}.yaml').read_text())
    office = str(ROOT / 'config' / 'office.yaml')
    by_place = [
        str({node.name: settings(node) for node in start(**given)}['armor_server']['place'])
        for given in ({}, {'map': str(moved)}, {'map': office}, {'map': str(further)})
    ]
    assert by_place[0] == by_place[1]
    assert len(set(by_place)) == 3
    assert [name.rpartition('_')[0] for name in by_place] == [
        *('seven_rooms', 'seven_rooms', 'office', 'seven_rooms')
    ]


def test_a_node_that_cannot_start_ends_the_launch_and_another_one_does_not(start):
    on_exit = start()[0].on_exit
    refused = types.SimpleNamespace(returncode=2, process_name='armor_server-1')
    assert on_exit(refused, {}) == ['armor_server-1 cannot start with this configuration']
    assert on_exit(types.SimpleNamespace(returncode=-9, process_name='armor_server-1'), {}) is None
    taken = types.SimpleNamespace(returncode=os.EX_TEMPFAIL, process_name='mission_page-9')
    assert on_exit(taken, {}) is None, 'the mission goes on without a page'


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('composition', COMPOSITIONS)
def test_its_nodes_share_processes_as_with_launch_py(processes, mode, composition, tmp_path):
    given = {'mode': mode, 'processes': composition}
    run = Run(**given, record=str(tmp_path))
    (part,) = parts(run, ROOT / 'config', profile_of(ROOT / 'config', run))
    files = dict.fromkeys([node.name for node in part.everyone], tmp_path)
    # It has no terminal for the console.
    held = [set(each.names) - {CONSOLE} for each in programs_of(part, files, {})]
    wanted = {frozenset(names) for names in held if names}
    started = processes(**given, record=str(tmp_path))
    assert {frozenset(n.name for n in each.nodes()) for each in started} == wanted
    together = [each for each in started if each.arguments]
    assert {(each.package, each.executable, each.name) for each in together} <= {
        ('surveillance_runtime', 'nodes', '')
    }


def test_it_is_installed_with_the_parameter_files():
    setup = (ROOT / 'surveillance_behaviour' / 'setup.py').read_text()
    assert "glob('launch/*.launch.py')" in setup
    assert "glob('../config/*.yaml')" in setup
    assert "glob('../config/robots/*.yaml')" in setup
