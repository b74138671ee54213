from __future__ import annotations

import pytest

from surveillance_runtime.node_table import DEFAULT_MODE, MODES, NODES, find, select
from tests.launcher.conftest import ROOT

SEED = {
    'armor_server',
    'ontology_map_builder',
    'robot_behavior',
    'battery_controller',
    'planner_controller',
    'motion_controller',
}


def names(*arguments, **options):
    return [node.name for node in select(*arguments, **options)]


def test_every_node_is_where_the_table_says():
    for node in NODES:
        package = ROOT / node.package
        source = package / node.package / f'{node.name}_node.py'
        assert f'class {node.class_name}(' in source.read_text(), node.name
        executable = f'{node.name} = {node.module}:main'
        assert executable in (package / 'setup.py').read_text(), node.name


def test_every_executable_of_the_packages_is_in_the_table():
    for package in {node.package for node in NODES}:
        setup = (ROOT / package / 'setup.py').read_text()
        listed = setup.count('_node:main')
        assert listed == sum(node.package == package for node in NODES), package


def test_the_first_behaviour_needs_six_nodes_and_the_simulation_two_more():
    assert set(names('RANDOM')) == SEED
    assert set(names('MANUAL')) == SEED
    assert set(names('SIMULATED')) == SEED | {'simulator', 'collision_monitor'}


def test_the_patrol_adds_what_learns_the_place_from_markers():
    more = {'reasoner', 'initial_state', 'aruco_detector', 'marker_server', 'arm_controller'}
    assert set(names('RANDOM', 'patrol')) == SEED | more | {'simulator'}


def test_what_the_first_decision_waits_for_is_started_first():
    assert names('SIMULATED')[:5] == [
        'armor_server',
        'ontology_map_builder',
        'simulator',
        'motion_controller',
        'robot_behavior',
    ]


def test_only_and_without():
    assert names('RANDOM', only=['video_source', 'armor_server']) == [
        'armor_server',
        'video_source',
    ]
    assert set(names('RANDOM', without=['motion_controller'])) == SEED - {'motion_controller'}
    with pytest.raises(ValueError, match='no node is left'):
        select('RANDOM', only=['armor_server'], without=['armor_server'])


@pytest.mark.parametrize('options', [{'only': ['armour']}, {'without': ['armour']}])
def test_an_unknown_name_is_told_with_the_known_ones(options):
    with pytest.raises(ValueError, match=r"unknown node 'armour'.*armor_server"):
        select('RANDOM', **options)
    with pytest.raises(ValueError, match="'x'"):
        find('x')


def test_the_default_mode_is_a_mode():
    assert DEFAULT_MODE in MODES
