"""The command that checks machines."""

from __future__ import annotations

import time

import pytest

import state_machines as fsm
from libs.state_machines.tests.states import Answer
from surveillance_behaviour import check_command


class Sleeps(fsm.State):
    def __init__(self):
        super().__init__(['done'])

    def execute(self, ud):
        time.sleep(5.0)
        return 'done'


def test_the_robots_machines_pass_the_command(capsys):
    assert check_command.main([]) == 0
    assert capsys.readouterr().out.splitlines() == ['surveillance: ok', 'patrol: ok']


def machine_of(states):
    machine = fsm.StateMachine(['done'])
    with machine:
        for label, state in states.items():
            fsm.StateMachine.add(label, state, {'done': 'done'})
    return machine


def broken():
    return machine_of({'A': Answer('done'), 'B': Answer('done')})


def doubtful():
    return machine_of({'A': Sleeps()})


def test_the_command_fails_on_errors_and_on_demand_on_warnings(capsys):
    assert check_command.main([f'{__name__}:broken']) == 1
    assert 'error: BROKEN/B: no transition leads here' in capsys.readouterr().out
    assert check_command.main([f'{__name__}:doubtful']) == 0
    assert check_command.main([f'{__name__}:doubtful', '--strict']) == 1


@pytest.mark.parametrize(
    'name', ['nix', 'nix:nix', f'{__name__}:nix', f'{__name__}:Sleeps', 'os:getcwd']
)
def test_the_command_names_what_it_cannot_build(capsys, name):
    assert check_command.main([name]) == 2
    assert capsys.readouterr().err.startswith(f'{name}: cannot be built: ')


def test_the_command_draws_a_machine(capsys):
    assert check_command.main([f'{__name__}:doubtful', '--draw', 'ascii']) == 0
    assert capsys.readouterr().out.startswith('DOUBTFUL (StateMachine)')
