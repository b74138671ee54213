"""Files and arguments merged: what wins, what is refused, and that nothing is taken in silence."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time

import pytest
import yaml
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from strict_files.files import FileError
from surveillance_runtime.configuration import (
    Configuration,
    Entry,
    Layer,
    Setting,
    argument_layer,
    file_layer,
    read_schema,
    resolved_text,
    split_arguments,
)
from surveillance_runtime.parameters import ParameterError
from tests.launcher.conftest import ROOT

CONFIG = ROOT / 'config'
BATTERY = 'battery_controller'


def written(folder, text, name='own.yaml'):
    path = folder / name
    path.write_text(text)
    return path


def merged(*layers):
    configuration = Configuration(tuple(layers))
    configuration.check()
    return configuration


def value(configuration, node, name):
    return configuration.resolve(node)[name].value


def test_a_plain_argument_wins_over_every_section_of_every_file(tmp_path):
    first = file_layer(CONFIG / 'parameters.yaml')
    own = file_layer(
        written(tmp_path, '/**/battery_controller: {ros__parameters: {battery_initial_value: 70}}')
    )
    arguments = argument_layer(['battery_initial_value:=50'])
    assert value(merged(first), BATTERY, 'battery_initial_value') == 100
    assert value(merged(first, own), BATTERY, 'battery_initial_value') == 70
    assert value(merged(first, own, arguments), BATTERY, 'battery_initial_value') == 50


def test_a_later_file_for_all_nodes_wins_over_an_earlier_one_for_the_node(tmp_path):
    first = file_layer(CONFIG / 'parameters.yaml')
    own = file_layer(written(tmp_path, '/**: {ros__parameters: {battery_initial_value: 30}}'))
    assert value(merged(first, own), BATTERY, 'battery_initial_value') == 30


def test_in_one_file_the_nearer_section_wins_wherever_it_stands(tmp_path):
    text = (
        '/robot1/battery_controller: {ros__parameters: {battery_initial_value: 1}}\n'
        '/**/battery_controller: {ros__parameters: {battery_initial_value: 2}}\n'
        '/**: {ros__parameters: {battery_initial_value: 3}}\n'
    )
    configuration = merged(file_layer(written(tmp_path, text)))
    given_values = [
        configuration.resolve(BATTERY, name)['battery_initial_value'].value
        for name in ('/robot1/battery_controller', '/robot2/battery_controller')
    ]
    assert given_values == [1, 2]


def test_a_second_place_replaces_the_first_as_a_whole():
    first, second = (
        file_layer(CONFIG / name) for name in ('seven_rooms.yaml', 'patrol_world.yaml')
    )
    alone = merged(second).resolve('simulator')
    assert merged(first, second).resolve('simulator') == alone
    place = merged(first, second).place('simulator')
    assert place is not None
    assert place.rooms == merged(second).place('simulator').rooms


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('urgency_threshold: 30.5', 'got 30.5, expected an integer from 0 to 1000000000'),
        ('urgency_threshold: .nan', 'got nan, expected an integer'),
        ('urgency_threshold: .inf', 'got inf, expected an integer'),
        ('urgency_threshold: 1.0e308', 'got 1e+308, expected an integer'),
        ('urgency_threshold: [1]', 'got [1], expected an integer'),
        ('urgency_threshold: soon', "got 'soon', expected an integer"),
        ('use_sim_time: maybe', "parameter use_sim_time: got 'maybe', expected true or false"),
        ('exploration_seconds: .nan', 'parameter exploration_seconds: got nan'),
        ('polcy: tour', "unknown parameter 'polcy', expected 'policy'"),
        ('policy: turo', "parameter policy: got 'turo', expected one of"),
        ('policy: 2020-01-01', 'expected true, false, a number, a text, or a list'),
        ('policy:', 'expected a value'),
        ('known_ids: [1, [2]]', 'expected true, false, a number, a text, or a list'),
    ],
)
def test_what_no_node_takes_is_refused_with_file_and_line(tmp_path, text, problem):
    path = written(tmp_path, f'/**:\n  ros__parameters:\n    {text}\n')
    with pytest.raises(ParameterError) as caught:
        merged(file_layer(path))
    assert str(caught.value).startswith(f'{path}:3: ')
    assert problem in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_parameter_of_another_node_names_its_owner(tmp_path):
    path = written(tmp_path, 'reasoner: {ros__parameters: {battery_initial_value: 3}}')
    with pytest.raises(ParameterError, match=r'of reasoner \(one of battery_controller\)'):
        merged(file_layer(path))


@pytest.mark.parametrize(
    ('words', 'problem'),
    [
        (['--bogus'], 'unknown argument --bogus: expected --ros-args first'),
        (['--ros-args', '--bogus'], 'unknown argument --bogus after --ros-args'),
        (['--ros-args', '--parms-file', 'x'], "expected '--params-file'"),
        (['--ros-args', '-p'], '-p: expected a value after it'),
        (['--ros-args', '-r', 'x'], '-r x: expected FROM:=TO'),
        (['--ros-args', '--remap', 'x:=y:=z'], '--remap x:=y:=z: expected FROM:=TO'),
        (['--ros-args', '--log-level', 'loud'], '--log-level loud: expected one of debug'),
        (['--ros-args', '-p', 'x'], '-p x: expected NAME:=VALUE or NODE:NAME:=VALUE'),
        (['--ros-args', '-p', 'x:={'], 'the value is not valid YAML'),
        (['--ros-args', '-p', 'x:=' + '[' * 5000], 'the value is not valid YAML'),
    ],
)
def test_a_wrong_argument_costs_one_line(words, problem):
    with pytest.raises(ParameterError) as caught:
        split_arguments(words).configuration()
    assert problem in str(caught.value)
    assert '\n' not in str(caught.value)
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize(
    ('word', 'expected'),
    [
        ('recharge_rooms:=[]', 'at least one name'),
        ('rooms_priority:=[URGENT, URGENT]', 'names of classes of places, each once'),
        ('random_battery_time:=[5.0, 2.0]', 'two numbers above 0, the shortest and the longest'),
        ('station:=[1.0]', 'three numbers: x, y, yaw'),
        ('environment_size:=[1.0]', 'four numbers [x_min, x_max, y_min, y_max]'),
        ('windows:=[4]', 'odd numbers from 3'),
        ('markers_file:=/nowhere.yaml', 'a file of markers (/nowhere.yaml: No such file'),
    ],
)
def test_what_only_a_node_can_tell_is_refused_before_the_node_starts(word, expected):
    with pytest.raises(ParameterError, match=re.escape(expected)):
        Configuration((argument_layer([word]),)).check()


def test_remappings_are_left_to_ros_and_name_the_node():
    given_words = '--ros-args -r __ns:=/a -r battery_controller:__node:=b -p x:=1 --log-level info'
    arguments = split_arguments(given_words.split())
    assert arguments.full_name('battery_controller') == '/a/b'
    assert arguments.full_name('other') == '/a/other'
    assert '-p' not in arguments.rest


def test_a_resolved_file_reads_back_as_what_it_holds_with_its_sources(tmp_path):
    layers = [file_layer(CONFIG / name) for name in ('parameters.yaml', 'office.yaml')]
    layers.append(argument_layer(['known_ids:=[]', 'lidar.noise:=1e-05']))
    for node in read_schema():
        found = merged(*layers).resolve(node)
        again = merged(file_layer(written(tmp_path, resolved_text(f'/{node}', found))))
        assert again.resolve(node) == found


def test_a_table_of_the_place_that_is_a_value_is_named_where_it_was_given(tmp_path):
    place = file_layer(CONFIG / 'seven_rooms.yaml')
    own = written(tmp_path, '/**: {ros__parameters: {doors: 3}}')
    later = argument_layer(['doors.D1:=[10.0, 6.5, 0.0, 1.2]'])
    for layers in ((place, file_layer(own)), (place, file_layer(own), later)):
        with pytest.raises(ParameterError) as refusal:
            merged(*layers).place('simulator')
        expected = f'{own}:1: doors: got 3, expected NAME: [...] for each'
        assert str(refusal.value) == expected


def test_places_that_a_robot_cannot_use_are_refused_with_file_and_line(tmp_path):
    text = (CONFIG / 'seven_rooms.yaml').read_text()
    narrow = text.replace('D1: [10.0, 6.5, 0.0, 1.2]', 'D1: [10.0, 6.5, 0.0, 0.4]')
    blocked = text.replace('    walls:\n', '    walls:\n      post: [10.0, 6.2, 10.0, 6.8]\n')
    cases = {
        narrow: 'width 0.4 m: expected more than 0.44 m',
        blocked: 'a wall stands in it',
    }
    for content, problem in cases.items():
        path = written(tmp_path, content)
        with pytest.raises(ParameterError) as caught:
            merged(file_layer(path)).place('simulator')
        assert problem in str(caught.value)
        assert str(caught.value).startswith(f'{path}:')
    wide = merged(file_layer(CONFIG / 'seven_rooms.yaml'), argument_layer(['robot_radius:=0.6']))
    with pytest.raises(ParameterError, match=r'seven_rooms.yaml:\d+: doors.D1: width 1.2 m'):
        wide.place('simulator')


@pytest.mark.parametrize(
    ('written', 'value'),
    [
        ('010', 8),  # C's strtol and strtod, which ROS asks
        ('-0x1F', -31),
        ('1e3', 1000.0),
        ('-.5e-3', -0.0005),
        ('.inf', float('inf')),
        ('1:30', '1:30'),  # a number of YAML 1.1
        ('1:30.5', '1:30.5'),
        ('1_000', '1_000'),
        ('08', 8.0),  # no octal number: strtod reads it
        ('0190', 190.0),
    ],
)
def test_a_number_is_what_ros_takes_for_one(tmp_path, written, value):
    for filler in ('', '# ' + 'x' * 40_000):  # two readers
        path = tmp_path / 'file.yaml'
        path.write_text(f'{filler}\n/**:\n  ros__parameters:\n    a: {written}\n    b: [{written}]')
        assert [entry.value for entry in file_layer(path).entries] == [value, [value]]
    assert [e.value for e in argument_layer([f'a:={written}', f'a:=[{written}]']).entries] == [
        value,
        [value],
    ]


@pytest.mark.parametrize('path', ['/dev/zero', '/dev/null', '/', '/proc/self/mem'])
def test_devices_and_folders_are_no_parameter_files(path):
    with pytest.raises(FileError) as caught:
        file_layer(path)
    assert '\n' not in str(caught.value)


def test_a_pipe_is_no_parameter_file(tmp_path):
    os.mkfifo(tmp_path / 'pipe')
    with pytest.raises(FileError, match='expected a file, got a pipe'):
        file_layer(tmp_path / 'pipe')


@pytest.mark.parametrize('value', ['!!int', '!!float', '!!bool', '!!timestamp x', '!own 5'])
def test_a_tag_before_what_is_not_of_its_type_costs_one_line(tmp_path, value):
    file = tmp_path / 'own.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    urgency_threshold: {value}\n')
    with pytest.raises(FileError, match=r'own.yaml:3: .*cannot be read as a value'):
        file_layer(file)
    with pytest.raises(ParameterError, match=r'-p urgency_threshold.*not valid YAML'):
        argument_layer([f'urgency_threshold:={value}'])


@pytest.mark.parametrize(
    'text',
    ['a: ' + '[' * 5000 + ']' * 5000, 'a: ' + '{a: ' * 5000, 'a: [' + '1,' * 1_500_000 + ']'],
)
def test_yaml_without_bound_is_refused_soon(tmp_path, text):
    path = written(tmp_path, text)
    start = time.thread_time()
    with pytest.raises(FileError) as caught:
        file_layer(path)
    assert time.thread_time() - start < 5.0
    assert '\n' not in str(caught.value)


SCALARS = st.one_of(
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.booleans(),
    st.text(max_size=8),
    st.sampled_from(['tour', 'SIMULATED', 'manual', '', '~', '2020-01-01', '0x1F', '1e3', 'nan']),
)
VALUES = st.one_of(SCALARS, st.lists(SCALARS, max_size=4), st.none())
NAMES = st.one_of(
    st.sampled_from(sorted({name for node in read_schema().values() for name in node.parameters})),
    st.text(alphabet='abcdefghij_.', min_size=1, max_size=12),
)
PATTERNS = st.sampled_from(
    [
        '/**',
        '/**/battery_controller',
        'robot_behavior',
        '/robot1/reasoner',
        '/*/simulator',
        'nobody',
    ]
)


def as_float(value):
    """Return integers as a parameter that is a float has them, rounded from 2**53 on."""
    if isinstance(value, list):
        return [as_float(each) for each in value]
    return float(value) if type(value) is int else value


@given(PATTERNS, NAMES, VALUES, st.booleans())
@example('/**', 'battery.capacity', 9_007_199_254_740_993, False)
@settings(max_examples=300, suppress_health_check=list(HealthCheck))
def test_every_value_takes_effect_or_costs_one_line(tmp_path, pattern, name, chosen, as_argument):
    path = tmp_path / 'own.yaml'
    shown = yaml.safe_dump(chosen, default_flow_style=True, allow_unicode=True)
    shown = shown.removesuffix('...\n').strip()
    try:
        if as_argument:
            layer = argument_layer([f'{pattern}:{name}:={shown}'])
        else:
            content = {pattern: {'ros__parameters': {name: chosen}}}
            path.write_text(yaml.safe_dump(content, allow_unicode=True))
            layer = file_layer(path)
        configuration = merged(layer)
    except (ParameterError, FileError) as error:
        refusal = str(error)
    else:
        refusal = ''
    if refusal:
        assert '\n' not in refusal
        assert len(refusal) < 1500
        return
    last = pattern.rsplit('/', 1)[-1]
    effects = [
        configuration.resolve(node, f'/robot1/{node}')[name].value
        for node in read_schema()
        if name in configuration.resolve(node, f'/robot1/{node}')
    ]
    assert effects, f'{last} {name} {chosen!r}: neither taken nor refused'
    for effect in effects:
        same = [str(chosen).casefold(), str(layer.entries[0].value).casefold()]
        taken = layer.entries[0].value
        assert effect in (chosen, taken, as_float(taken)) or str(effect).casefold() in same


READER = """
import sys
import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

rclpy.init()
for line in sys.stdin:
    node = Node(
        'reader',
        cli_args=['--ros-args', '--params-file', line.strip()],
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
    node.declare_parameter('given', descriptor=ParameterDescriptor(dynamic_typing=True))
    value = node.get_parameter('given').value
    node.destroy_node()
    plain = isinstance(value, str | bool | int | float)
    print(ascii(value if plain else list(value)), flush=True)
"""


@pytest.fixture(scope='module')
def read_by_ros(tmp_path_factory, ros_domain):
    """Return what a node gets for a value of a resolved file, as `repr` shows it.

    In a process of its own: Fast DDS may wait for itself for ever where one process has two
    participants, and endpoints of both come and go.
    """
    path = tmp_path_factory.mktemp('resolved') / 'node.yaml'
    with subprocess.Popen(
        [sys.executable, '-c', READER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as reader:

        def read(value):
            path.write_text(resolved_text('/reader', {'given': Setting(value, 'a test')}))
            reader.stdin.write(f'{path}\n')
            reader.stdin.flush()
            return reader.stdout.readline().rstrip('\n')

        yield read
        reader.stdin.close()


@given(VALUES)
@example('\U0001f600')  # rcl refused the file: it stood there as two surrogates
@example('\0')
@example(5e-324)
@example('\x85\u2028 "it\\is"\n')
@settings(max_examples=100, suppress_health_check=list(HealthCheck))
def test_a_node_reads_what_was_resolved(read_by_ros, chosen):
    entry = Entry('/**', 'map.R1', chosen, 'a test')
    try:
        merged(Layer('a test', (entry,)))
    except ParameterError as error:
        refusal = str(error)
    else:
        refusal = ''
    if refusal:
        assert '\n' not in refusal
    elif chosen != []:  # which rcl gives no type
        numbers = isinstance(chosen, list) and float in map(type, chosen)
        expected = [float(each) for each in chosen] if numbers else chosen
        assert read_by_ros(chosen) == ascii(expected)
