from __future__ import annotations

import pytest

from launcher.console import completions, route
from launcher.node_table import NODES

CONTROLLERS = [node for node in NODES if node.console]


@pytest.mark.parametrize(
    ('line', 'node'),
    [
        ('battery set 15', 'battery_controller'),
        ('BATTERY offset -20', 'battery_controller'),
        ('plan set [[1, 2, 3]]', 'planner_controller'),
        ('  move 3 0.5', 'motion_controller'),
        ('battery nonsense', 'battery_controller'),  # its own console explains what is wrong
    ],
)
def test_a_line_goes_to_the_controller_of_its_first_word(line, node):
    routed = route(line, CONTROLLERS)
    assert routed.nodes == (node,)
    assert routed.line == line


def test_status_goes_to_all():
    assert len(route('status', CONTROLLERS).nodes) == 3


def test_exit_ends_one_controller_or_the_run():
    assert route('exit motion_controller', CONTROLLERS).nodes == ('motion_controller',)
    assert route('exit motion_controller', CONTROLLERS).line == 'exit'
    assert route('exit move', CONTROLLERS).nodes == ('motion_controller',)
    assert route('exit', CONTROLLERS).ends


@pytest.mark.parametrize('line', ['exit armor_server', 'exit a b'])
def test_exit_of_something_else_is_explained(line):
    routed = route(line, CONTROLLERS)
    assert 'expected one of battery_controller, planner_controller' in routed.message
    assert not routed.nodes
    assert not routed.ends


def test_an_unknown_word_costs_its_message_only():
    routed = route('fly home', CONTROLLERS)
    assert routed.message.startswith("'fly' is no command: expected one of battery, plan, move")
    assert routed.nodes == ()


@pytest.mark.parametrize('line', ['', '   ', '# a remark'])
def test_a_blank_line_does_nothing(line):
    routed = route(line, CONTROLLERS)
    assert (routed.nodes, routed.message, routed.ends) == ((), '', False)


def test_a_controller_that_runs_elsewhere_is_no_target():
    assert 'is no command' in route('move 1 2', CONTROLLERS[:2]).message


def test_help_shows_every_command_once():
    text = route('help', CONTROLLERS).message
    for command in ('battery set', 'battery offset', 'plan set', 'move', 'status', 'exit NODE'):
        assert text.count(f'  {command}') == 1, command


def test_completion_knows_commands_and_controllers():
    assert completions('ba', CONTROLLERS) == ['battery']
    assert completions('battery ', CONTROLLERS) == ['offset', 'set']
    assert completions('exit p', CONTROLLERS) == ['planner_controller']
    assert len(completions('exit ', CONTROLLERS)) == 3
