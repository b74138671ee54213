"""The profile of a robot: what a file may say, what it means to nodes, the ready ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from strict_files.files import FileError
from surveillance_runtime.configuration import Configuration
from surveillance_runtime.node_table import select
from surveillance_runtime.parameters import specs_of
from surveillance_runtime.profile import (
    RobotProfile,
    check_base,
    find_profile,
    profile_layer,
    profile_names,
    read_profile,
    remappings,
)

CONFIG = Path(__file__).parents[2] / 'config'
DRIVING = [node.name for node in select('ROBOT')]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / 'robot.yaml'
    path.write_text(text)
    return path


def test_the_file_of_the_built_in_robot_says_what_a_profile_s_defaults_are():
    profile = read_profile(find_profile(CONFIG, 'built_in')).profile
    assert profile == RobotProfile()
    named = {*profile.origins}
    left_out = {spec.name for spec in specs_of(profile) if spec.default in ([], '')}
    assert named | left_out >= {spec.name for spec in specs_of(profile)} - {
        'battery.full',
        'battery.timeout',
    }


@pytest.mark.parametrize('name', profile_names(CONFIG))
def test_a_ready_profile_gives_parameters_that_the_nodes_take(name):
    file = read_profile(find_profile(CONFIG, name))
    assert file.profile.name == name
    merged = Configuration((profile_layer(file),))
    merged.check()
    told = {key: each.value for key, each in merged.resolve('motion_controller').items()}
    assert told['drive.speed'] <= file.profile.wheels.speed
    assert told['robot_radius'] == pytest.approx(file.profile.body.reach)


def test_another_robot_s_topics_types_frames_and_lidars_reach_the_nodes(tmp_path):
    file = read_profile(
        written(
            tmp_path,
            """
            topics: {command: base/cmd, wanted: wanted, scans: [front, rear], odom: base/odom}
            types: {command: TwistStamped}
            frames: {odom: odom_combined, base: base_footprint, scans: [front_laser, rear_laser]}
            body: {footprint: [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]}
            lidars: {mounts: [[0.25, 0, 0], [-0.25, 0, 3.14, 3.1416]]}
            drive: {speed: 0.2, turn: 1.0, acceleration: 0.4, turn_acceleration: 2.0}
            """,
        )
    )
    merged = Configuration((profile_layer(file),))
    merged.check()
    told = {key: each.value for key, each in merged.resolve('collision_monitor').items()}
    assert told['robot.command_type'] == 'TwistStamped'
    assert told['robot.wanted_type'] == 'Twist'
    assert told['robot.scans'] == ['front', 'rear']
    assert told['lidar_mounts'] == pytest.approx([0.25, 0, 0, 0, -0.25, 0, 3.14, 3.1416])
    assert told['robot_radius'] == pytest.approx(0.3606, abs=1e-4)
    for node in ('motion_controller', 'explorer'):
        given = merged.resolve(node)
        assert [given[f'drive.{each}'].value for each in ('speed', 'turn')] == [0.2, 1.0]
        assert given['drive.acceleration'].value == 0.4
        assert given['drive.turn_acceleration'].value == 2.0
    origin = merged.resolve('motion_controller')['robot.frames.odom'].origin
    assert origin == f'{file.path}:4'
    renamed = dict(remappings(file.profile, DRIVING, 'ROBOT'))
    assert renamed['cmd_vel'] == 'wanted'
    assert renamed['cmd_vel_monitored'] == 'base/cmd'
    assert 'plan' not in renamed
    # With nobody between, the controller speaks to the base itself.
    alone = [name for name in DRIVING if name != 'collision_monitor']
    assert dict(remappings(file.profile, alone, 'ROBOT'))['cmd_vel'] == 'base/cmd'


def test_a_footprint_may_be_the_text_that_nav2_has(tmp_path: Path) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text('body: {footprint: "[ [0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2] ]"}')
    profile = read_profile(path).profile
    assert profile.body.footprint == (0.3, 0.2, -0.3, 0.2, -0.3, -0.2, 0.3, -0.2)


def test_beside_nav2_its_names_are_left_to_it(tmp_path: Path) -> None:
    path = tmp_path / 'robot.yaml'
    path.write_text('dock: {navigator: nav2}')
    file = read_profile(path)
    renamed = dict(remappings(file.profile, DRIVING, 'ROBOT'))
    assert renamed['plan'] == 'patrol/plan'
    # rcl knows no name of an action, but those of its services and topics.
    parts = {'send_goal', 'cancel_goal', 'get_result', 'feedback', 'status'}
    for part in parts:
        name = f'follow_path/_action/{part}'
        assert renamed[name] == f'patrol/{name}'


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('topcs: {odom: odom}', ":1: unknown key 'topcs.odom': expected 'topics.odom'"),
        ('topics: {odm: odom}', ":1: unknown key 'topics.odm': expected 'topics.odom'"),
        ('topics:\n  odom: 3', ':2: topics.odom: .*got 3, expected a text'),
        ('topics: {odom: "a b"}', 'the name of a topic like scan'),
        ('topics: {scans: [a, a]}', 'that differ'),
        ('topics: {command: cmd_vel, wanted: cmd_vel}', 'expected two topics'),
        ('types: {command: twist_stamped}', "expected one of 'Twist', 'TwistStamped'"),
        ('body: {footprint: [[1, 0], [0, 1]]}', 'corners x, y of a polygon'),
        ('body: {footprint: [[1, 1], [2, 1], [2, 2], [1, 2]]}', 'around the centre'),
        ('body: {footprint: [[1, 1], [-1, -1], [1, -1], [-1, 1]]}', 'sides do not cross'),
        ('body: {radius: -1}', 'a number from 0.01'),
        ('lidars: {mounts: [[0, 0, 0], [0, 0, 1]]}', '2 mounts for 1 topics.scans'),
        ('lidars: {mounts: [[0, 0, 0, 1.57]]}', 'hangs upside down'),
        ('battery: {voltages: [[12, 50], [11, 100]]}', 'both rising'),
        ('drive: {speed: .nan}', 'a number from'),
        ('[]', 'expected a mapping'),
    ],
)
def test_what_is_wrong_in_a_profile_is_one_line_that_names_it(tmp_path, text, said):
    with pytest.raises(FileError, match=said) as raised:
        read_profile(written(tmp_path, text))
    assert '\n' not in str(raised.value)
    assert str(raised.value).startswith(str(tmp_path))


def test_an_unknown_robot_is_named_with_the_nearest_one():
    with pytest.raises(FileError, match=r"--robot 'turtlebot_4': .*'turtlebot4'"):
        find_profile(CONFIG, 'turtlebot_4')


def test_where_a_foreign_robot_s_lidar_is_nobody_guesses(tmp_path):
    assert read_profile(written(tmp_path, 'name: mine')).profile.lidars.mounts == ()
    built_in = RobotProfile()
    assert replace(built_in, name='mine').lidars.mounts


@pytest.mark.parametrize(
    ('drive', 'problem'),
    [
        ('command_timeout: 0.5', ''),
        ('command_timeout: 0.2', ''),
        ('command_timeout: 0.6', '0.6 s: expected at most 0.5 s'),
        ('speed: 0.3', 'drive.command_timeout is missing'),
        ('{command_timeout: 2.0, long_timeout: true}', ''),
        ('long_timeout: true', ''),
    ],
)
def test_a_base_that_obeys_on_is_refused_unless_told_otherwise(
    tmp_path: Path, drive: str, problem: str
) -> None:
    path = tmp_path / 'robot.yaml'
    words = drive if drive.startswith('{') else f'{{{drive}}}'
    path.write_text(f'name: mine\ndrive: {words}\n')
    file = read_profile(path)
    check_base(file, 'SIMULATED')
    if not problem:
        check_base(file, 'ROBOT')
        return
    with pytest.raises(FileError, match=problem) as refused:
        check_base(file, 'ROBOT')
    assert '\n' not in str(refused.value)
    assert 'drive.long_timeout: true' in str(refused.value)
