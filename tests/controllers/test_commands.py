"""The consoles' language: every good line is understood, every bad one is answered with what was
wrong."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers.manual.commands import (
    BATTERY,
    LONGEST_LINE,
    MOTION,
    PLANNER,
    Command,
    CommandArgument,
    CommandError,
    Grammar,
    ParsedCommand,
    move_request,
    path_request,
    point,
)

ALL = Grammar([*BATTERY, *PLANNER, *MOTION])
COORDINATE = st.floats(-1e6, 1e6)


@pytest.mark.parametrize(
    ('line', 'parsed'),
    [
        ('battery set 15', ParsedCommand('battery set', (15,))),
        ('  BATTERY  Offset\t-20 ', ParsedCommand('battery offset', (-20,))),
        ('move 5 0.1', ParsedCommand('move', (5.0, 0.1))),
        (
            'plan set [[0, 0, 0], [0,.1,1e1]]',
            ParsedCommand('plan set', (((0, 0, 0), (0, 0.1, 10)),)),
        ),
        ('plan set []', ParsedCommand('plan set', ((),))),
        ('help', ParsedCommand('help')),
        ('exit', ParsedCommand('exit')),
        ('status', ParsedCommand('status')),
        ('', None),
        ('   ', None),
        ('# a remark', None),
    ],
)
def test_good_lines(line: str, parsed: ParsedCommand | None) -> None:
    assert ALL.parse(line) == parsed


@pytest.mark.parametrize(
    ('line', 'text'),
    [
        ('batery set 1', "'batery' is no command: expected 'battery'"),
        (
            'fly 1',
            "'fly' is no command: expected one of battery, plan, move, help, status, exit",
        ),
        ('battery', "the line ends after 'battery': expected 'set' or 'offset'"),
        ('battery put 3', "'put' after 'battery' is no command: expected one of set, offset"),
        ('battery set', 'battery set: VALUE is missing: expected a whole number from 0 to 100'),
        ('battery set 101', "battery set: VALUE is '101': expected a whole number from 0 to 100"),
        ('battery set 5.5', "battery set: VALUE is '5.5': expected a whole number from 0 to 100"),
        ('battery set 5 6', "battery set: '6' is too much: expected 'battery set VALUE'"),
        ('move', 'move: TIME is missing: expected a number from 0 to 86400 (seconds)'),
        ('move 5', 'move: DELTA is missing: expected a number from -1000 to 1000 (metres)'),
        ('move -1 0', "move: TIME is '-1': expected a number from 0 to 86400 (seconds)"),
        ('move 1 nan', "move: DELTA is 'nan': expected a number from -1000 to 1000 (metres)"),
        (
            'plan set [[1, 2]]',
            "plan set: [[X,Y,Z],...] is '[[1, 2]]' (']' in point 1, where ',' belongs): "
            'expected a list of points as [[x, y, z], ...]',
        ),
        (
            'plan set [[1, a, 2]]',
            "plan set: [[X,Y,Z],...] is '[[1, a, 2]]' ('a' in point 1, where a number belongs): "
            'expected a list of points as [[x, y, z], ...]',
        ),
        (
            'plan set [[1,2,3],[4,5,6]',
            "plan set: [[X,Y,Z],...] is '[[1,2,3],[4,5,6]' (the end of the line after point 2, "
            "where ']' belongs): expected a list of points as [[x, y, z], ...]",
        ),
        ('help me', "help: 'me' is too much: expected 'help'"),
        (
            'x' * (LONGEST_LINE + 1),
            f'a line of {LONGEST_LINE + 1} characters: expected at most {LONGEST_LINE}',
        ),
    ],
)
def test_bad_lines_name_the_word_and_what_was_expected(line: str, text: str) -> None:
    with pytest.raises(CommandError) as caught:
        ALL.parse(line)
    assert str(caught.value) == text


@given(st.text(max_size=60) | st.text('[]0123456789.,- eE+planset', max_size=60))
@settings(max_examples=300)
def test_any_text_is_a_command_or_one_line_of_complaint(text: str) -> None:
    for line in (text, 'plan set ' + text, 'battery set ' + text, 'move ' + text):
        complaint = ''
        try:
            ALL.parse(line)
        except CommandError as error:
            complaint = str(error) or 'no words'
        assert '\n' not in complaint
        assert complaint != 'no words'


@given(st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), max_size=8))
@settings(max_examples=80)
def test_a_plan_survives_being_printed_and_read(points: list[tuple[float, float, float]]) -> None:
    parsed = ALL.parse(f'plan set {[list(p) for p in points]}')
    assert parsed == ParsedCommand('plan set', (tuple(points),))


@given(st.integers(-100, 100))
@settings(max_examples=40)
def test_whole_numbers_survive_being_printed_and_read(value: int) -> None:
    assert ALL.parse(f'battery offset {value:+d}') == ParsedCommand('battery offset', (value,))


@pytest.mark.parametrize(
    ('typed', 'proposed'),
    [
        ('', ['battery', 'exit', 'help', 'move', 'plan', 'status']),
        ('b', ['battery']),
        ('battery ', ['offset', 'set']),
        ('battery s', ['set']),
        ('plan set ', []),
        ('nonsense ', []),
    ],
)
def test_completion_proposes_the_words_that_fit(typed: str, proposed: list[str]) -> None:
    assert ALL.completions(typed) == proposed


def test_help_lists_every_command_with_its_arguments() -> None:
    text = Grammar(BATTERY).help()
    for usage in ('battery set VALUE', 'battery offset OFFSET', 'help', 'status', 'exit'):
        assert usage in text


def test_a_request_for_a_path_says_how_far_apart_its_ends_are() -> None:
    start, goal = np.array([0.0, 0.0, 0.0]), np.array([3.0, 4.0, 0.0])
    assert path_request('plan to R1', start, goal) == (
        'New request: plan to R1\n'
        '  start (0, 0, 0), goal (3, 4, 0), 5.00 m apart\n'
        '  Answer with: plan set [[x,y,z],...]   (the points between start and goal)'
    )


@pytest.mark.parametrize(
    ('count', 'along', 'shown'),
    [
        (1, '0.00 m along 1 point', '(0, 0, 0)'),
        (2, '1.00 m along 2 points', '(0, 0, 0) (1, 0, 0)'),
        (12, '11.00 m along 12 points', ' '.join(f'({n}, 0, 0)' for n in range(12))),
        (
            13,
            '12.00 m along 13 points',
            '(0, 0, 0) (1, 0, 0) (2, 0, 0) (3, 0, 0) (4, 0, 0) (5, 0, 0) ... 1 more ... '
            '(7, 0, 0) (8, 0, 0) (9, 0, 0) (10, 0, 0) (11, 0, 0) (12, 0, 0)',
        ),
    ],
)
def test_a_request_for_a_motion_shows_its_path(count: int, along: str, shown: str) -> None:
    path = np.array([[float(n), 0.0, 0.0] for n in range(count)])
    assert move_request('move', path).splitlines() == [
        'New request: move',
        f'  start (0, 0, 0), goal ({count - 1}, 0, 0), {along}',
        f'  path {shown}',
        '  Answer with: move TIME DELTA   (seconds, metres)',
    ]


def test_points_are_shown_with_four_digits() -> None:
    assert point([10.0, -0.12346, 1234.56]) == '(10, -0.1235, 1235)'


@pytest.mark.parametrize(
    ('line', 'values'),
    [
        ('battery set 0', (0,)),
        ('battery set 100', (100,)),
        ('battery offset -100', (-100,)),
        ('battery offset +100', (100,)),
        ('move 0 -1000', (0.0, -1000.0)),
        ('move 86400 1000', (86_400.0, 1000.0)),
        ('move\t5   -.5e1', (5.0, -5.0)),
        ('plan set  [ [1,2,3] , [4,5,6] ] ', (((1, 2, 3), (4, 5, 6)),)),
        (' ' * (LONGEST_LINE - 4) + 'help', ()),
    ],
)
def test_values_on_their_bounds_are_taken(line: str, values: tuple[object, ...]) -> None:
    parsed = ALL.parse(line)
    assert parsed is not None
    assert parsed.values == values


@pytest.mark.parametrize(
    'line',
    [
        'battery set -1',
        'battery set 1234567890',
        'battery offset 101',
        'battery offset -101',
        'move 86400.1 0',
        'move 1 1000.1',
        'move 1 1e999',
        'plan set [[1,2,3],]',
        'plan set [,[1,2,3]]',
        'plan set [[1,2,3]] 4',
        'plan set [1,2,3]',
        'plan set [[1,2,3] [4,5,6]]',
    ],
)
def test_values_beyond_their_bounds_are_not(line: str) -> None:
    with pytest.raises(CommandError, match='expected'):
        ALL.parse(line)


def test_what_is_shown_of_a_long_word_has_an_end() -> None:
    for length, shown in ((60, 'x' * 60), (61, 'x' * 57 + '...')):
        with pytest.raises(CommandError, match=f"^'{re.escape(shown)}' is no command"):
            ALL.parse('x' * length)


def test_arguments_propose_what_is_known_after_those_before() -> None:
    command = Command(
        ('door', 'open'),
        (
            CommandArgument('ROOM', 'a room', str, known=lambda: ('Hall', 'R1', 'R2')),
            CommandArgument('DOOR', 'a door', str, known=lambda room: (f'{room}-D1',)),
        ),
        'Open a door.',
    )
    grammar = Grammar([command])
    assert grammar.completions('door open ') == ['Hall', 'R1', 'R2']
    assert grammar.completions('DOOR open r') == ['R1', 'R2']
    assert grammar.completions('door open R1 ') == ['R1-D1']
    assert grammar.completions('door open R1 R1-D1 ') == []
    assert grammar.completions('door shut ') == []
    assert (command.name, command.usage) == ('door open', 'door open ROOM DOOR')
    assert grammar.help().splitlines() == [
        '  door open ROOM DOOR  Open a door.',
        '  help                 List the commands.',
        '  status               Show the request that waits for a command, if there is one.',
        "  exit                 Stop this console's node.",
    ]
