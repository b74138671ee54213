"""The parts of a fleet's run: what is there once, what each robot has."""

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path

import pytest

from floor_plans import read_place
from launcher.fleet_launch import parts
from launcher.run import Run, make_parser, wanted_run
from launcher.run_configuration import configuration, profile_of
from launcher.run_mission import checked
from strict_files.files import FileError
from surveillance_runtime.node_table import BY_NAME

CONFIG = Path(__file__).resolve().parents[2] / 'config'
PLACE = CONFIG / 'seven_rooms.yaml'


def team(run: Run):
    return parts(run, CONFIG, profile_of(CONFIG, run))


def place_with(tmp_path: Path, robots: str) -> Path:
    path = tmp_path / 'place.yaml'
    path.write_text(PLACE.read_text() + f'    robots:\n{robots}')
    return path


def names(part) -> set[str]:
    return {node.name for node in part.everyone}


def test_one_robot_has_one_part_without_a_namespace():
    (part,) = team(Run())
    assert (part.robot, part.run.namespace, part.renamed) == ('', None, ())


def test_a_fleet_shares_ontology_map_and_simulator():
    shared, first, second = team(Run(robots=2, namespace='house', record='runs', web=True))
    nodes = {'armor_server', 'ontology_map_builder', 'simulator', 'alarm'}
    assert nodes | {'mission_page'} == names(shared)
    assert shared.run.namespace == 'house'
    assert (first.run.namespace, second.run.namespace) == ('house/robot1', 'house/robot2')
    assert names(first) == names(second)
    assert {'robot_behavior', 'motion_controller', 'collision_monitor'} <= names(first)
    assert {'mission_recorder', 'battery_controller'} <= names(first)
    assert ('map', '/house/map') in first.renamed
    assert ('armor_interface_srv', '/house/armor_interface_srv') in first.renamed


def test_each_robot_is_told_its_name_and_where_it_starts():
    run = Run(robots=3)
    shared, *robots = team(run)
    moved = shared.moved_points
    assert sorted(moved) == ['C2', 'R3', 'R4']
    starts = {}
    for part in robots:
        merged = configuration(CONFIG, part.run, fleet=part.entries)
        name = f'/{part.robot}/motion_controller'
        settings = merged.resolve('motion_controller', name)
        assert settings['robot_name'].value == part.robot
        starts[part.robot] = settings['start_pose'].value
        behaviour = merged.resolve('robot_behavior', f'/{part.robot}/robot_behavior')
        assert behaviour['fleet'].value is True
        # In the place's file three points are in front of a door.
        assert set(behaviour['traffic.wide_places'].value) == set(moved) | {'C1', 'E', 'R1', 'R2'}
    assert starts['robot1'] == [5.0, 10.0, 0.0]
    for one, other in itertools.combinations(starts.values(), 2):
        assert abs(one[0] - other[0]) + abs(one[1] - other[1]) > 0.9
    told = configuration(CONFIG, shared.run, fleet=shared.entries).resolve('simulator')
    x, y = told['room_positions.R3'].value
    assert y > 15.4, 'inside'
    assert math.dist((x, y), (10.0, 15.0)) < 1.0, 'no farther than needed'
    assert told['robots.robot2.start'].value == starts['robot2']


def test_a_place_names_its_robots(tmp_path):
    path = place_with(
        tmp_path,
        '      anna: {start: [10.0, 8.0, 0.0], dock: E}\n'
        '      bert: {start: [4.0, 9.0, 1.5], profile: nav2}\n'.replace(', profile: nav2', ''),
    )
    _shared, anna, bert = team(Run(place=path))
    assert (anna.robot, bert.robot) == ('anna', 'bert')
    merged = configuration(CONFIG, anna.run, fleet=anna.entries)
    resolved = merged.resolve('robot_behavior', '/anna/robot_behavior')
    assert resolved['recharge_rooms'].value == ['E']
    for name, robot in (('anna', anna), ('bert', bert)):
        merged = configuration(CONFIG, robot.run, fleet=robot.entries)
        resolved = merged.resolve('robot_behavior', f'/{name}/robot_behavior')
        assert resolved['fleet_docks'].value == ['E'], 'all plan with all docks'
    with pytest.raises(ValueError, match=r'--robots 3: place.yaml has 2: anna, bert'):
        team(Run(place=path, robots=3))


@pytest.mark.parametrize(
    ('rule', 'problem'),
    [
        ('object: none, places: [R11]', "rules.odd: there is no place 'R11', expected 'R1'"),
        ('door: D17, is: closed', "rules.odd: there is no door 'D17', expected 'D1'"),
        ('door: D1, is: close', "rules.odd: door D1: got 'close', expected 'closed'"),
    ],
)
def test_a_rule_about_a_place_that_is_not_there_is_refused_before_a_start(tmp_path, rule, problem):
    watch = tmp_path / 'watch.yaml'
    watch.write_text(f'rules:\n  odd: {{{rule}}}\n')
    with pytest.raises(ValueError, match=f'--watch .*watch.yaml:2: {problem}'):
        checked(Run(watch=watch), CONFIG)


@pytest.mark.parametrize(
    ('robots', 'problem'),
    [
        ('      anna: {start: [10.0, 8.0]}\n', r'robots.anna.start: expected \[x, y, yaw\]'),
        ('      anna: {dock: E}\n', 'robots.anna: has no start'),
        ('      anna: {start: [0.0, 0.0, 0.0]}\n', r'\(0, 0\) lies in no room'),
        ('      anna: {start: [10.0, 8.0, 0.0], dok: E}\n', "dok: unknown, expected 'dock'|dock"),
        ('      anna: {start: [10.0, 8.0, 0.0], dock: R1}\n', 'no room with a station'),
        ('      R1: {start: [10.0, 8.0, 0.0]}\n', 'is the name of a room'),
        ('      anna: {start: [10.0, 8.0, 0.0], dock: 0}\n', 'no room with a station'),
        (f'      {"a" * 61}: {{start: [10.0, 8.0, 0.0]}}\n', 'has 61 letters: expected at most 60'),
        ('      simulator: {start: [10.0, 8.0, 0.0]}\n', 'expected another name than simulator'),
        ('      an na: {start: [10.0, 8.0, 0.0]}\n', 'expected a name of letters, digits'),
    ],
)
def test_a_wrong_robot_costs_one_line(tmp_path, robots, problem):
    with pytest.raises(FileError, match=problem) as told:
        read_place(place_with(tmp_path, robots), reserved=BY_NAME)
    assert '\n' not in str(told.value)


def test_only_and_without_name_robots_and_their_nodes():
    assert [part.robot for part in team(Run(robots=2, only=('robot2',)))] == ['robot2']
    (shared,) = team(Run(robots=2, only=('shared',)))
    assert names(shared) == {'armor_server', 'ontology_map_builder', 'simulator', 'alarm'}
    (one,) = team(Run(robots=2, only=('robot1/planner_controller',)))
    assert names(one) == {'planner_controller'}
    left = team(Run(robots=2, without=('robot1', 'armor_server')))
    assert [part.robot for part in left] == ['', 'robot2']
    assert 'armor_server' not in names(left[0])
    with pytest.raises(ValueError, match=r"'robot9'.*expected"):
        team(Run(robots=2, only=('robot9',)))


def test_the_machines_of_the_document_start_each_node_once():
    page = (CONFIG.parent / 'docs' / 'how-to' / 'fleet.md').read_text()
    commands = re.findall(r'machine \d: +python3 launch.py (.*)', page)
    started = []
    for words in commands:
        _, found = checked(wanted_run(make_parser().parse_args(words.split())), CONFIG)
        started += [(part.robot, node.name) for part in found for node in part.nodes]
    whole = [(part.robot, node.name) for part in team(Run(robots=2)) for node in part.nodes]
    assert sorted(started) == sorted(whole)


def test_a_part_is_told_what_of_it_runs_elsewhere():
    _, (part,) = checked(Run(robots=2, only=('robot1',), without=('collision_monitor',)), CONFIG)
    merged = configuration(CONFIG, part.run, fleet=part.entries)
    motion = merged.resolve('motion_controller', '/robot1/motion_controller')
    assert motion['robot.command_type'].origin == 'no collision_monitor'


def test_a_stage_needs_a_simulator_on_this_machine(tmp_path):
    stage = tmp_path / 'stage.yaml'
    stage.write_text('stage: {dark: {at: daily 21:30, do: lamp R2 off}}\n')
    with pytest.raises(ValueError, match='expected a run whose simulator is started'):
        checked(Run(robots=2, only=('robot1',), stage=stage), CONFIG)
