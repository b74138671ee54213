"""The parameters of a run: from where each comes, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from launcher.cli import CONFIG
from launcher.run import (
    Run,
)
from launcher.run_configuration import check_assignments, check_clocks, configuration, with_mode_of
from surveillance_runtime.node_table import DEFAULT_MODE
from surveillance_runtime.profile import read_profile
from surveillance_runtime.run_parameters import place_file, run_layers
from tests.launcher.runs import error_of, settings_of


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


def test_the_pages_token_is_no_parameter_that_a_peer_could_ask_for(tmp_path):
    merged = configuration(CONFIG, Run(web_control=True), tmp_path)
    settings = merged.resolve('mission_page', '/mission_page')
    assert 'token' not in settings
    assert settings['token_file'].value == str(tmp_path / 'page_token')
