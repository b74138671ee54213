from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from launcher.cli import CONFIG
from launcher.fleet_launch import RobotProcesses
from launcher.run import (
    ALARM,
    MARKERS,
    PAGE,
    RECORDER,
    Run,
    make_parser,
    wanted_run,
)
from launcher.run_configuration import check_assignments, check_clocks, configuration, with_mode_of
from launcher.run_folder import RunState, make_folder, options_of, resumed, run_from
from launcher.run_mission import (
    chosen_folder,
    summary,
    watch_command,
    what_to_look_at,
)
from launcher.run_processes import command, node_environ, programs_of, ros_arguments
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_runtime import discovery
from surveillance_runtime.command_line import page_address
from surveillance_runtime.event_log import record_in
from surveillance_runtime.node_table import DEFAULT_MODE
from surveillance_runtime.profile import read_profile
from surveillance_runtime.run_files import TIMELINE
from surveillance_runtime.run_parameters import place_file, run_layers, write_parameters


def look_over(run: Run) -> None:
    """Look at a run as a launch does before it starts anything."""
    configuration(CONFIG, run)


def error_of(run: Run) -> str:
    with pytest.raises(ValueError, match=r'.') as caught:
        look_over(run)
    message = str(caught.value)
    assert '\n' not in message
    return message


@pytest.mark.parametrize('namespace', ['', '1robot', 'a b', 'a//b', '/a/', '../x', 'ä'])
def test_a_namespace_that_ros_refuses_is_named(namespace):
    assert f'--namespace {namespace!r}' in error_of(Run(namespace=namespace))


@pytest.mark.parametrize('domain', [-1, 102, 10**6])
def test_a_domain_out_of_range_is_named(domain):
    assert error_of(Run(domain=domain)) == f'--domain {domain}: expected a number from 0 to 101'


@pytest.mark.parametrize(
    'address', ['', ':', '80', '[::1', '[::1:80', '::1:80', 'a:b', 'a@b:80', 'a/b:1', 'a:99999']
)
def test_an_address_of_the_page_that_is_none_is_named(address):
    expected = f'--web-address {address!r}: expected HOST:PORT like 0.0.0.0:8080'
    assert error_of(Run(web_address=address)) == expected


def test_addresses_of_the_page():
    assert page_address('0.0.0.0:8080') == ('0.0.0.0', 8080)
    assert page_address('[::1]:80') == ('::1', 80)
    assert page_address(':80') == ('127.0.0.1', 80)


@pytest.mark.parametrize('alarm', ["call '", 'no-such-program', '/etc/passwd now'])
def test_an_alarm_that_cannot_be_raised_is_named(alarm):
    assert error_of(Run(alarm=alarm)).startswith(f'--alarm {alarm!r}: ')


def test_a_place_that_is_none_is_named_with_file_and_line(tmp_path):
    assert 'no.yaml: No such file' in error_of(Run(place=tmp_path / 'no.yaml'))
    bad = tmp_path / 'bad.yaml'
    text = (CONFIG / 'seven_rooms.yaml').read_text()
    bad.write_text(text.replace('R4: [D4]', 'R4: [D9]'))
    assert 'bad.yaml:' in error_of(Run(place=bad))
    assert 'D9' in error_of(Run(place=bad))


@pytest.mark.parametrize(
    ('content', 'wrong'),
    [
        ('battery_controler: {ros__parameters: {a: 1}}', "no node is called 'battery_controler'"),
        ('battery_controller: {a: 1}', "expected 'ros__parameters:'"),
        ('/**:\n  ros__parameters: {a: 1}\n/**:\n  b: 1', ":3: duplicate key '/**'"),
        ('- 1', ':1: expected a mapping, got a list'),
        ('a: [', ':1: not valid YAML'),
        ('', 'expected a mapping, got nothing'),
    ],
)
def test_a_wrong_parameter_file_is_named(content, wrong, tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text(content)
    assert str(file) in error_of(Run(parameters=file))
    assert wrong in error_of(Run(parameters=file))


def test_a_missing_or_binary_parameter_file_is_named(tmp_path):
    assert 'No such file' in error_of(Run(parameters=tmp_path / 'none'))
    (tmp_path / 'binary').write_bytes(b'\xff\xfe\x00')
    assert 'not UTF-8' in error_of(Run(parameters=tmp_path / 'binary'))


def test_every_place_and_parameter_file_of_the_project_can_be_run():
    for behaviour in ('surveillance', 'patrol'):
        run = Run(behaviour=behaviour)
        configuration(CONFIG, run)
        Run(place=place_file(CONFIG, behaviour)).check()
    configuration(CONFIG, Run(parameters=CONFIG / 'parameters.yaml'))


def test_the_users_file_comes_after_the_projects_and_the_launchers_own_last(tmp_path):
    own = tmp_path / 'own.yaml'
    own.write_text('/**: {ros__parameters: {}}')
    place = CONFIG / 'office.yaml'
    layers = run_layers(CONFIG, 'surveillance', watched=False, place=place, files=[own])
    sources = [Path(layer.source).name for layer in layers]
    assert sources == ['parameters.yaml', 'office.yaml', 'this run', 'own.yaml', 'options']
    robot = read_profile(CONFIG / 'robots' / 'turtlebot4.yaml')
    layers = run_layers(CONFIG, 'surveillance', watched=False, place=place, robot=robot)
    assert [Path(layer.source).name for layer in layers][1:3] == ['turtlebot4.yaml', 'office.yaml']


def test_a_robot_that_watches_stays_long_enough_to_look_unless_somebody_says_otherwise(tmp_path):
    watch, own = tmp_path / 'watch.yaml', tmp_path / 'own.yaml'
    own.write_text('robot_behavior: {ros__parameters: {exploration_seconds: 5.0}}')

    def stay(**run: Any) -> object:
        return settings_of('robot_behavior', Run(**run))['exploration_seconds']

    assert stay() == 2.0
    assert stay(watch=watch) == 30.0
    assert stay(watch=watch, parameters=own) == 5.0


def settings_of(node: str, run: Run) -> dict[str, object]:
    settings = configuration(CONFIG, run).resolve(node, f'/{node}')
    return {name: setting.value for name, setting in settings.items()}


def test_a_mode_on_the_command_line_counts_more_than_one_in_the_users_file(tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text('battery_controller: {ros__parameters: {execution_mode: MANUAL}}')
    asked = settings_of('battery_controller', Run(mode='RANDOM', parameters=file))
    assert asked['execution_mode'] == 'RANDOM'
    unasked = settings_of('battery_controller', Run(parameters=file))
    assert unasked['execution_mode'] == 'MANUAL'


def test_a_mode_that_the_file_gives_to_all_controllers_is_the_modes_of_the_run(tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text('/**: {ros__parameters: {execution_mode: random}}')
    run = Run(parameters=file)
    assert with_mode_of(run, configuration(CONFIG, run)).mode == 'RANDOM'
    assert with_mode_of(Run(), configuration(CONFIG, Run())) == Run()


def test_another_behaviour_in_a_file_is_refused_as_its_nodes_would_be_missing(tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text('robot_behavior: {ros__parameters: {behaviour: patrol}}')
    with pytest.raises(ValueError, match=r'own.yaml:1: behaviour patrol.*--behaviour patrol'):
        configuration(CONFIG, Run(parameters=file))


def test_an_assignment_that_no_started_node_takes_is_refused():
    run = Run(mode='RANDOM', assignments=('lidar.rays:=90',))
    with pytest.raises(ValueError, match=r'-p lidar.rays:=90: no node that is started takes it'):
        check_assignments(configuration(CONFIG, run), run.nodes())


def test_a_fast_simulation_beside_nodes_on_the_machines_clock_is_refused():
    for words, name in (
        (('simulator:speed:=0',), 'armor_server'),
        (('speed:=2', 'use_sim_time:=true', 'mission_page:use_sim_time:=false'), 'mission_page'),
    ):
        run = Run(assignments=words, web=True)
        with pytest.raises(ValueError, match=rf'speed [02] {name} needs use_sim_time:=true'):
            check_clocks(configuration(CONFIG, run), run, (*run.nodes(), *run.observers()))
    run = Run(assignments=('speed:=0', 'use_sim_time:=true'))
    check_clocks(configuration(CONFIG, run), run, (*run.nodes(), *run.observers()))
    check_clocks(configuration(CONFIG, Run()), Run(), Run().nodes())


def test_the_default_mode_stands_in_the_first_file_and_for_all_nodes():
    first = CONFIG / 'parameters.yaml'
    every = yaml.safe_load(first.read_text())['/**']['ros__parameters']
    assert every['execution_mode'] == DEFAULT_MODE


def test_a_run_folder_on_a_full_disk_is_named(tmp_path):
    (tmp_path / 'armor_server.yaml').symlink_to('/dev/full')
    run = Run()
    with pytest.raises(OSError, match=r'cannot be written: No space left.*armor_server.yaml'):
        write_parameters(tmp_path, None, configuration(CONFIG, run), run.nodes())


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
    assert node_environ(Run(network=True))['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'
    with monkeypatch.context() as other:
        other.setenv('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')
        assert node_environ(Run())['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'OFF')
    assert node_environ(Run())['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'OFF'


def test_options_of_a_run_survive_its_launcher(tmp_path):
    files = {name: tmp_path / name for name in ('place', 'parameters', 'notify', 'watch', 'stage')}
    run = replace(Run(mode='RANDOM', assignments=['a:=1'], only=['reasoner']), **files)
    stored = json.loads(json.dumps(options_of(run)))
    assert run_from(stored) == replace(run, without=[], remaps=[])
    with pytest.raises(ValueError, match='--resume'):
        run_from({'mode': 'RANDOM', 'place': None, 'seconds': None} | {'place': 7})


def test_a_resumed_run_keeps_what_is_not_given_anew(tmp_path):
    folder = make_folder(tmp_path)
    RunState(folder, options_of(Run(mode='RANDOM', namespace='robot1'))).end()
    run, found = resumed(Run(namespace='robot2'), Run(), tmp_path, '')
    assert (run.mode, run.namespace, found) == ('RANDOM', 'robot2', folder)


def test_the_last_lines_of_a_run_can_be_typed_and_tell_what_could_not_be_written(tmp_path):
    folder = tmp_path / 'ein Lauf é'
    (folder / 'report.html').mkdir(parents=True)
    (folder / TIMELINE).touch()
    with MissionRecord(record_in(folder)) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E'])
        record.write('visit', 9.0, place='E', distance=1.0)
    report, replay = what_to_look_at(folder)
    assert report == f'report: {folder}/report.html: expected a file, got a folder'
    assert shlex.split(replay)[1:] == ['python3', 'launch.py', 'replay', str(folder)]
    assert what_to_look_at(tmp_path) == []


@pytest.mark.parametrize('network', [False, True])
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


def test_a_summary_is_given_also_without_a_record(tmp_path):
    assert summary(tmp_path / 'none') == 'Mission: nothing was recorded.'
    with MissionRecord(tmp_path / 'record') as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        record.write('visit', 5.0, place='C1', distance=3.0)
    assert '2 places visited' in summary(tmp_path / 'record')
    (tmp_path / 'record').write_text('nonsense\n')
    assert 'Mission: ' in summary(tmp_path / 'record')


def test_the_options_of_the_command_line_become_a_run():
    options = make_parser().parse_args(
        ['--mode', 'random', '--map', 'm.yaml', '--params', 'p.yaml', '--only', 'a,b', '--for', '3']
    )
    assert wanted_run(options) == Run(
        mode='RANDOM',
        place=Path('m.yaml'),
        parameters=Path('p.yaml'),
        remaps=[],
        only=['a', 'b'],
        without=[],
        assignments=[],
        seconds=3.0,
        record=None,
    )


def test_only_starts_what_is_named_and_may_be_repeated():
    options = make_parser().parse_args(['--only', 'planner_controller', '--only', 'armor_server'])
    run = wanted_run(options)
    assert {node.name for node in run.nodes()} == {'planner_controller', 'armor_server'}
    assert run.observers() == ()
    assert [node.name for node in Run(record=None).observers()] == [ALARM, RECORDER, MARKERS]
    assert [node.name for node in replace(run, web=True).observers()] == [PAGE]
    assert [node.name for node in replace(run, web_address=':80').observers()] == [PAGE]


def test_the_hint_to_watch_leads_to_this_run(monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    assert watch_command(Run()) == 'python3 launch.py watch'
    named = Run(domain=7, namespace='robot2')
    assert watch_command(named) == 'python3 launch.py watch --domain 7 --namespace robot2'
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    assert watch_command(Run()) == 'python3 launch.py watch --domain 3'


def test_an_unfinished_run_of_other_options_is_told_at_the_start(tmp_path):
    old = make_folder(tmp_path)
    state = RunState(old, options_of(Run(seconds=3.0)))
    state.end(ended=False)
    assert chosen_folder(Run(), tmp_path, None)[0] == old
    folder, how = chosen_folder(Run(mode='MANUAL'), tmp_path, None)
    assert folder != old
    assert how.endswith(
        f'{old.name} was started with other options (mode was None, is MANUAL) and is not '
        'finished; --resume continues it'
    )
    assert chosen_folder(Run(mode='MANUAL', fresh=True), tmp_path, None)[1] == ''


def test_an_address_behind_a_switch_names_the_option_that_takes_it(capsys):
    with pytest.raises(SystemExit):
        make_parser().parse_args(['--web', '0.0.0.0:8080'])
    assert '--web takes no value, expected --web-address 0.0.0.0:8080' in capsys.readouterr().err


def test_the_pages_token_is_no_parameter_that_a_peer_could_ask_for(tmp_path):
    merged = configuration(CONFIG, Run(web_control=True), tmp_path)
    settings = merged.resolve('mission_page', '/mission_page')
    assert 'token' not in settings
    assert settings['token_file'].value == str(tmp_path / 'page_token')


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
