"""What lists and texts have to hold: both sides of each bound, word by word."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from strict_files.suggestions import like, nearest
from surveillance_runtime import parameter_checks
from surveillance_runtime.command_line import page_address

POSE = 'three numbers: x, y, yaw'
MOUNTS = 'x, y, yaw and roll of each lidar; roll 0, or 3.1416 for one that hangs upside down'
TIMES = 'two numbers above 0, the shortest and the longest time'
RECTANGLE = 'four numbers [x_min, x_max, y_min, y_max], each pair rising'
ORIGIN = 'an origin like https://robot.example.org'


@pytest.mark.parametrize(
    ('check', 'value', 'expected'),
    [
        (parameter_checks.pose, [1.0, 2.0, 3.0], None),
        (parameter_checks.pose, [1.0, 2.0], POSE),
        (parameter_checks.pose, [1.0, 2.0, 3.0, 4.0], POSE),
        (parameter_checks.pose, [], POSE),
        (parameter_checks.pose_or_none, [], None),
        (parameter_checks.pose_or_none, [1.0, 2.0, 3.0], None),
        (parameter_checks.pose_or_none, [1.0], f'{POSE}; or none'),
        (parameter_checks.pose_or_none, [1.0, 2.0], f'{POSE}; or none'),
        (parameter_checks.lidar_mounts, [], None),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, 0.0], None),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, 0.09, 0.2, 0.0, 0.0, 3.1416], None),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, -3.1416], None),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, 0.11], MOUNTS),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, 6.2832], MOUNTS),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 1.5], MOUNTS),
        (parameter_checks.lidar_mounts, [0.1, 0.0, 0.0], MOUNTS),
        (parameter_checks.times, [0.1, 0.1], None),
        (parameter_checks.times, [0.0, 1.0], TIMES),
        (parameter_checks.times, [2.0, 1.0], TIMES),
        (parameter_checks.times, [1.0, 2.0, 3.0], TIMES),
        (parameter_checks.rectangle, [0.0, 1.0, -1.0, 0.0], None),
        (parameter_checks.rectangle, [0.0, 0.0, -1.0, 0.0], RECTANGLE),
        (parameter_checks.rectangle, [0.0, 1.0, 0.0, 0.0], RECTANGLE),
        (parameter_checks.rectangle, [0.0, 1.0, 0.0], RECTANGLE),
        (parameter_checks.web_origin, '', None),
        (parameter_checks.web_origin, 'https://robot.example.org', None),
        (parameter_checks.web_origin, 'https://robot.example.org/', None),
        (parameter_checks.web_origin, 'http://[::1]:8080', None),
        (parameter_checks.web_origin, 'https://robot.example.org:443', None),
        (parameter_checks.web_origin, 'https://robot.example.org:0', ORIGIN),
        (parameter_checks.web_origin, 'https://robot.example.org:99999', ORIGIN),
        (parameter_checks.web_origin, 'https://robot.example.org/page', ORIGIN),
        (parameter_checks.web_origin, 'https://me@robot.example.org', ORIGIN),
        (parameter_checks.web_origin, 'ftp://robot.example.org', ORIGIN),
        (parameter_checks.web_origin, 'robot.example.org', ORIGIN),
        (parameter_checks.web_origin, 'https://[::1', ORIGIN),
        (parameter_checks.web_origin, 'https://', ORIGIN),
    ],
)
def test_a_value_is_good_or_it_is_said_what_is_expected(
    check: Callable[[Any], str | None], value: Any, expected: str | None
) -> None:
    assert check(value) == expected


@pytest.mark.parametrize(
    ('text', 'address'),
    [
        ('0.0.0.0:8080', ('0.0.0.0', 8080)),
        (':8080', ('127.0.0.1', 8080)),
        ('[::1]:80', ('::1', 80)),
        ('robot:0', ('robot', 0)),
    ],
)
def test_the_address_of_the_page_is_host_and_port(text: str, address: tuple[str, int]) -> None:
    assert page_address(text) == address


@pytest.mark.parametrize('text', ['', 'robot', 'robot:x', 'robot:99999', 'a:1/b', 'me@a:1', '[::1'])
def test_what_is_no_address_is_told_with_an_example(text: str) -> None:
    with pytest.raises(ValueError, match='expected HOST:PORT like') as found:
        page_address(text)
    assert str(found.value) == f'--web-address {text!r}: expected HOST:PORT like 0.0.0.0:8080'


def test_a_name_is_like_another_by_its_letters_its_words_and_its_beginning() -> None:
    known = ['robot_speed', 'KITCHEN', 'max-range']
    assert like('--Kitchn', known) == 'KITCHEN'
    assert like('speed', known) == 'robot_speed'
    assert like('range', known) == 'max-range'
    assert like('rob', known) == 'robot_speed'
    assert like('ro', known) == ''
    assert like('zzz', known) == ''
    assert like('x', []) == ''
    assert nearest('zzz', ['only']) == "'only'"
    assert nearest('zzz', ['a', 'b', 'a']) == 'one of a, b'
    sixteen = [f'n{i}' for i in range(16)]
    assert nearest('zzz', sixteen).endswith(', n15')
    assert nearest('zzz', [*sixteen, 'n16']).endswith(', n15 and 1 more')
