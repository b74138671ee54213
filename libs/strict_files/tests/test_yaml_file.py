"""A file that holds one table of named entries: each mistake is one line that says where."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from strict_files.files import FileError
from strict_files.yaml_file import EntryError, read_table, read_yaml_file


def lamp(name: str, entry: Mapping[str, Any]) -> tuple[str, float]:
    if 'watt' not in entry:
        raise ValueError("expected 'watt'")
    if not isinstance(entry['watt'], int | float):
        raise EntryError('watt', 'expected a number')
    return name, float(entry['watt'])


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('lamps: {}', ":1: expected 'lamps:' with names, each with 'watt: 5'"),
        ('lamps: [1]', ":1: expected 'lamps:' with names"),
        ('lamp:\n  a: {watt: 5}', ":1: lamp: unknown key, expected 'lamps' alone"),
        ('lamps:\n  a: {watt: 5}\n  b: 7', ":3: lamps.b: expected a mapping such as 'watt: 5'"),
        ('lamps:\n  a: {watt: 5}\n  b: {}', ":3: lamps.b: expected 'watt'"),
        ('lamps:\n  a:\n    name: x\n    watt: y', ':4: lamps.a.watt: expected a number'),
    ],
)
def test_a_mistake_is_one_line_with_file_line_and_key(tmp_path: Path, text: str, line: str) -> None:
    path = tmp_path / 'lamps.yaml'
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_table(path, 'lamps', "'watt: 5'", lamp)
    assert str(caught.value).startswith(f'{path}{line}')


def test_entries_are_read_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'lamps.yaml'
    path.write_text('lamps:\n  b: {watt: 5}\n  a: {watt: 7}\n')
    assert read_table(path, 'lamps', "'watt: 5'", lamp) == [('b', 5.0), ('a', 7.0)]


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('a: 1\na: 2\n', ":2: duplicate key 'a', first given in line 1"),
        ('a: &x 1\nb: *x\n', ':2: not valid YAML: an alias (*name) cannot be used here'),
        ('- a\n', ':1: expected a mapping, got a list'),
        ('', ':1: expected a mapping, got nothing'),
        ('a: [{b: 1}]\n', ':1: a list cannot hold a mapping'),
        ('a: !!int x\n', ":1: 'x' cannot be read as a value; quote it"),
        ('a: 99999999999999999999\n', ':1: 99999999999999999999: expected a 64-bit number'),
        ('[' * 40, 'expected at most 30 levels'),
    ],
)
def test_what_yaml_takes_in_silence_is_refused_with_its_line(
    tmp_path: Path, text: str, problem: str
) -> None:
    path = tmp_path / 'file.yaml'
    path.write_text(text)
    with pytest.raises(FileError) as refused:
        read_yaml_file(path)
    assert str(refused.value).startswith(str(path))
    assert problem in str(refused.value)
    assert '\n' not in str(refused.value)


def test_numbers_are_those_of_ros_and_each_value_has_its_line(tmp_path: Path) -> None:
    path = tmp_path / 'file.yaml'
    path.write_text('robot:\n  fast: 1e3\n  old: 010\n  time: 1:30\n  on: yes\n')
    file = read_yaml_file(path)
    assert file.values == {'robot': {'fast': 1000.0, 'old': 8, 'time': '1:30', 'on': True}}
    assert file.lines['robot', 'time'] == 4
    assert str(file.error(('robot', 'time', 'zone'), 'unknown')) == (
        f'{path}:4: robot.time.zone: unknown'
    )
