"""The name that an error message proposes."""

from __future__ import annotations

import pytest

from strict_files.suggestions import nearest

NAMES = ['folder', 'execution_mode', 'policy', 'KITCHEN', 'robot_speed']


@pytest.mark.parametrize(
    ('given', 'expected'),
    [
        ('polcy', "'policy'"),
        ('kitchen', "'KITCHEN'"),
        ('mode', "'execution_mode'"),
        ('exec', "'execution_mode'"),
        ('xxxx', 'one of folder, execution_mode, policy, KITCHEN, robot_speed'),
    ],
)
def test_the_likest_name_is_proposed_and_all_of_them_where_none_is_like(given, expected) -> None:
    assert nearest(given, NAMES) == expected


def test_of_many_names_the_first_sixteen_are_listed() -> None:
    assert nearest('x', [f'name{i}' for i in range(18)]).endswith(', name15 and 2 more')


def test_where_there_is_no_name_that_is_said() -> None:
    assert nearest('x', []) == 'none, for there is none'
    assert nearest('x', ['y']) == "'y'"
