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
from tests.launcher.runs import settings_of


@pytest.mark.parametrize('composed', [False, True])
def test_a_console_node_reads_for_all_controllers(composed, tmp_path):
    run = Run(mode='MANUAL', composed=composed)
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


@pytest.mark.parametrize('composed', [False, True])
def test_everything_that_only_looks_on_gets_a_process(tmp_path, composed):
    watch = tmp_path / 'watch.yaml'
    run = Run(web=True, watch=watch, record=str(tmp_path), composed=composed)
    nodes, observers = run.nodes(), run.observers()
    part = RobotProcesses(run=run, nodes=nodes, observers=observers)
    files = {node.name: tmp_path / node.name for node in part.everyone}
    started = ' '.join(word for each in programs_of(part, files, {}) for word in each.command)
    assert {'observer', 'mission_page', 'mission_recorder'} <= {node.name for node in observers}
    for node in observers:
        assert started.count(f'{node.name}={node.module}:{node.class_name}') == 1, node.name
