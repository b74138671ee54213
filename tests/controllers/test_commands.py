"""The consoles' language: every good line is understood, every bad one is answered with what was
wrong."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers.manual.commands import (
    BATTERY,
    LONGEST_LINE,
    MOTION,
    PLANNER,
    CommandError,
    Grammar,
    ParsedCommand,
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
