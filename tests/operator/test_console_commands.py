"""What can be typed at the console, and what becomes of it."""

from __future__ import annotations

from typing import Any

import pytest

from surveillance_operator.console_commands import Reply, answer, completions, help_text
from tests.operator.prompt import Prompt

ANSWERS: dict[str, Any] = {
    'why_not': ('R3 can wait', ['URGENT(R3)']),
    'facts': [('ROOM(R3)', False), ('hasDoor(R3, D3)', True)],
    'explain': [(0, 'R3 is ROOM'), (1, 'R3 hasDoor D3')],
}


class Scripted:
    """Notes each action and answers with its name."""

    def __init__(self) -> None:
        self.done: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        def act(*given: Any) -> Any:
            self.done.append((name, *given))
            if given and given[0] == 'nowhere':
                raise ValueError('no place is called nowhere')
            return ANSWERS.get(name, 'done')

        return act


def said(line: str, actions: Any = None) -> list[Reply]:
    taken: Any = actions or Scripted()
    return answer(line, taken, Prompt())


@pytest.mark.parametrize(
    ('line', 'action'),
    [
        ('door open D1', ('set_door', 'D1', True)),
        ('DOOR close D1', ('set_door', 'D1', False)),
        ('obstacle place box 1 -2.5 0.3', ('place_obstacle', 'box', 1.0, -2.5, 0.3)),
        ('obstacle remove box', ('remove_obstacle', 'box')),
        ('room add R9 1 2 D1 D2', ('add_room', 'R9', 1.0, 2.0, ['D1', 'D2'])),
        ('stage door D1 ajar 30', ('stage', 'door D1 ajar 30')),
        ('false 3', ('event', 'false 3')),
        ('room remove R9', ('remove_room', 'R9')),
        ('battery drain 30', ('drain_battery', 30.0)),
        ('battery set 15', ('command', 'battery_controller', 'battery set 15')),
        ('plan set [[1, 2, 3]]', ('command', 'planner_controller', 'plan set [[1, 2, 3]]')),
        ('  move 3 0.5', ('command', 'motion_controller', '  move 3 0.5')),
        ('exit motion_controller', ('command', 'motion_controller', 'exit')),
        ('arm left', ('move_arm', 'left')),
        ('policy tour', ('set_policy', 'tour')),
        ('threshold 90', ('set_threshold', '90')),
        ('go R3', ('go_to', 'R3')),
        ('home', ('go_to', '')),
        ('pause', ('machine', 'pause')),
        ('approve', ('approve',)),
        ('choose failed', ('approve', 'failed')),
        ('autonomy low', ('set_autonomy', 'low')),
        ('why not R3', ('why_not', 'R3')),
    ],
)
def test_a_line_is_one_action(line: str, action: tuple[Any, ...]) -> None:
    actions = Scripted()
    (told,) = said(line, actions)
    assert actions.done == [action]
    assert told.text
    assert not told.ends


def test_why_tells_the_decision_and_known_the_proofs() -> None:
    assert said('why')[0].text == 'because'
    assert said('why not R3')[0].text == 'R3 can wait\n  URGENT(R3)'
    assert said('known R3')[0].text.splitlines() == [
        'R3 is ROOM',
        '  R3 hasDoor D3',
        'hasDoor(R3, D3)  [asserted]',
    ]


def test_status_shows_the_figures_and_asks_every_controller() -> None:
    figures, *controllers = said('status')
    assert figures.text == 'battery 80 %'
    assert [each.who for each in controllers] == [
        'battery_controller',
        'planner_controller',
        'motion_controller',
    ]


@pytest.mark.parametrize(
    ('line', 'words'),
    [
        ('fly home', "'fly' is no command: expected one of battery, plan, "),
        ('dor close D1', "'dor' is no command: expected 'door'"),
        ('door D1', "'D1' after 'door' is no command: expected one of open, close"),
        ('go', 'go: ROOM is missing: expected the name of a place'),
        ('threshold', 'threshold: SECONDS is missing: expected seconds'),
        ('go nowhere', 'go: no place is called nowhere'),
        ('exit armor_server', 'expected one of battery_controller, planner_controller'),
    ],
)
def test_what_is_wrong_is_said_in_one_line(line: str, words: str) -> None:
    (told,) = said(line)
    assert words in told.text
    assert '\n' not in told.text


@pytest.mark.parametrize('line', ['', '   ', '# a remark'])
def test_a_blank_line_does_nothing(line: str) -> None:
    assert said(line) == []


def test_exit_ends() -> None:
    assert said('exit')[0].ends


def test_help_shows_every_command_once() -> None:
    text = help_text()
    for command in ('battery set', 'plan set', 'move', 'door open', 'why not', 'go', 'exit NODE'):
        assert text.count(f'  {command} ') == 1, command


def test_completion_knows_commands_and_controllers() -> None:
    assert completions('ba') == ['battery']
    assert completions('battery ') == ['drain', 'offset', 'set']
    assert completions('exit p') == ['planner_controller']
    assert len(completions('exit ')) == 3


def test_completion_knows_nodes_parameters_and_their_values() -> None:
    assert completions('param set robot_b') == ['robot_behavior']
    assert completions('PARAM set robot_behavior p') == ['policy']
    assert 'random_seed' in completions('param get robot_behavior ')
    assert 'random_seed' not in completions('param set robot_behavior ')
    assert completions('param set robot_behavior policy o') == ['oldest']
    assert completions('param set nowhere ') == []
    assert 'oldest' in completions('policy ')
    assert completions('arm l') == ['left']
