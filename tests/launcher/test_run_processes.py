"""The processes of a run: their commands and their environment."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from launcher.cli import CONFIG
from launcher.fleet_launch import RobotProcesses
from launcher.run import (
    Run,
)
from launcher.run_configuration import configuration
from launcher.run_processes import command, node_environ, programs_of, ros_arguments
from surveillance_runtime import discovery
from surveillance_runtime.node_table import COMPOSITIONS
from tests.launcher.runs import settings_of


@pytest.mark.parametrize('processes', COMPOSITIONS)
def test_a_console_node_reads_for_all_controllers(processes, tmp_path):
    run = Run(mode='MANUAL', processes=processes)
    assert run.nodes()[0].name == 'console'
    merged = configuration(CONFIG, run, tmp_path)
    resolved = merged.resolve('planner_controller', '/planner_controller')
    assert resolved['console'].value is False
    # A controller that is started by itself has its own prompt.
    assert settings_of('planner_controller', run)['console'] is True
    assert 'console' not in [node.name for node in Run(mode='RANDOM').nodes()]


def test_ros_arguments_of_all_nodes():
    run = Run(namespace='/robot1', log_level='debug')
    arguments = ros_arguments([Path('/a.yaml'), Path('/b.yaml')], run)
    expected = '--ros-args --params-file /a.yaml --params-file /b.yaml -r __ns:=/robot1'
    assert ' '.join(arguments) == expected + ' --log-level debug'


def test_the_behaviour_is_last_in_one_process_so_that_it_stops_first():
    targets = command(Run().nodes(), [], 1)[4].split(',')
    assert len(targets) == len(Run().nodes())
    assert targets[-1].startswith('robot_behavior=')


def test_discovery_is_the_machines_own_unless_asked_for(monkeypatch):
    for name in ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'FASTRTPS_DEFAULT_PROFILES_FILE'):
        monkeypatch.delenv(name, raising=False)
    environ = node_environ(Run())
    assert environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SYSTEM_DEFAULT'
    profile = Path(environ['FASTRTPS_DEFAULT_PROFILES_FILE']).read_text()
    assert '<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>' in profile
    assert node_environ(Run(network='open'))['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'
    with monkeypatch.context() as other:
        other.setenv('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')
        assert node_environ(Run())['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    assert node_environ(Run())['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'OFF'
    asked_for = node_environ(Run(network='localhost'))
    assert asked_for['FASTRTPS_DEFAULT_PROFILES_FILE'].endswith('local_discovery.xml')
    assert asked_for['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SYSTEM_DEFAULT'
    own = node_environ(Run(network='mine.xml'))
    assert own['FASTRTPS_DEFAULT_PROFILES_FILE'] == str(Path('mine.xml').absolute())


@pytest.mark.parametrize('network', ['', 'localhost', 'open'])
def test_no_node_uses_shared_memory(monkeypatch, network):
    """What a killed process leaves there hides its successor: it answers nobody."""
    for name in discovery.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    threads = (
        'import glob, rclpy; rclpy.init(); node = rclpy.create_node("looked_at");'
        "print(*(open(each).read() for each in glob.glob('/proc/self/task/*/comm')))"
    )
    shown = subprocess.run(
        [sys.executable, '-c', threads],
        env=node_environ(Run(network=network)),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert 'dds.udp' in shown
    assert 'dds.shm' not in shown


def test_a_domain_reaches_the_nodes(tmp_path):
    environ = node_environ(Run(domain=7), tmp_path)
    assert environ['ROS_DOMAIN_ID'] == '7'
    assert node_environ(Run()).get('ROS_DOMAIN_ID') == os.environ.get('ROS_DOMAIN_ID')


def processes_of(run):
    """Return the nodes of each process of a run, and the processes."""
    part = RobotProcesses(run=run, nodes=run.nodes(), observers=run.observers())
    files = {node.name: Path(node.name) for node in part.everyone}
    programs = programs_of(part, files, {})
    started = ' '.join(word for each in programs for word in each.command)
    for node in part.everyone:
        assert started.count(f'{node.name}={node.module}:{node.class_name}') == 1, node.name
    return [set(each.names) for each in programs], programs


def test_what_must_go_on_without_the_others_is_apart(tmp_path):
    found, programs = processes_of(Run(web=True, watch=tmp_path / 'w', record=str(tmp_path)))
    assert {'collision_monitor'} in found
    assert {'armor_server', 'ontology_map_builder'} in found
    assert {'mission_page'} in found
    assert {'observer'} in found
    assert {'simulator'} in found
    assert {'alarm', 'mission_recorder', 'mission_markers'} in found
    assert len(found) == 7
    (leader,) = (each for each in programs if each.leads)
    assert 'robot_behavior' in leader.names
    (listens,) = (each for each in programs if each.takes_input)
    assert 'alarm' in listens.names


def test_each_node_gets_its_own_process_where_that_is_asked_for(tmp_path):
    found, _ = processes_of(Run(record=str(tmp_path), processes='one-each'))
    assert {'mission_recorder', 'mission_markers'} in found
    assert sum(len(each) > 1 for each in found) == 1


def test_everything_that_works_gets_one_process_where_that_is_asked_for(tmp_path):
    found, _ = processes_of(Run(web=True, record=str(tmp_path), processes='one'))
    assert {node.name for node in Run().nodes()} in found
    assert {'mission_page'} in found
    assert len(found) == 3


def test_what_the_console_may_end_by_itself_is_apart():
    found, _ = processes_of(Run(mode='MANUAL'))
    for name in ('battery_controller', 'planner_controller', 'motion_controller', 'console'):
        assert {name} in found
