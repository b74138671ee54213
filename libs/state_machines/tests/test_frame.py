"""Machines nested deeper than Python calls go: memory is the bound, not the interpreter's stack."""

from __future__ import annotations

import json
import sys

import pytest

import state_machines as fsm
from state_machines import checkpoint
from state_machines.export import to_ascii, to_graphviz, to_mermaid
from state_machines.testing import FakeClock
from state_machines.verify import verify

from .states import Answer, Background, Waiter, began

LEVELS = 1000
assert sys.getrecursionlimit() - 100 <= LEVELS


def nested(state, levels=LEVELS, **limits):
    """Machines in one another; a counter goes in and out through all of them."""
    keys = ['count']
    machine = state
    for _ in range(levels):
        outer = fsm.StateMachine(['done', 'preempted'], keys, keys)
        outer.add_state('S', machine, **limits)
        machine = outer
    machine.set_name('ROOT')
    return machine


class Count(fsm.State):
    def __init__(self):
        super().__init__(['done'], io_keys=['count'])

    def execute(self, ud):
        ud.count += 1
        return 'done'


def test_a_deep_machine_runs_and_hands_userdata_through():
    root = nested(Count())
    root.userdata.count = 1
    assert root.execute() == 'done'
    assert root.userdata.count == 2
    assert root.execute() == 'done'
    assert root.userdata.count == 3


def test_levels_with_limits_are_no_calls_either():
    state = Answer('preempted', 'done', outcomes=['done', 'preempted'])
    root = nested(state, timeout=60.0, retry=1, retry_on=['preempted'])
    assert root.execute() == 'done'
    assert state.runs == 2


def test_a_preempt_reaches_the_deepest_state():
    waiter = Waiter(1000.0)
    root = nested(waiter)
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert not root.preempt_requested()


def test_an_interrupt_puts_a_deep_machine_aside_and_it_goes_on():
    clock, waiter, alarm = FakeClock(), Waiter(10.0, progress='waited'), Waiter(1.0)
    root = nested(waiter)
    root.set_clock(clock)
    root.add_interrupt('ALARM', alarm)
    run = Background(root)
    began(waiter)
    clock.until_sleeping()
    clock.advance(7.0)
    root.raise_interrupt('ALARM')
    began(alarm)
    clock.until_sleeping()
    clock.advance(1.0)
    began(waiter)
    clock.until_sleeping()
    clock.advance(3.0)
    assert run.result() == 'done'


def test_a_checkpoint_of_a_deep_machine_is_gone_on_from():
    clock, waiter = FakeClock(), Waiter(10.0, progress='waited')
    root = nested(waiter)
    root.set_clock(clock)
    run = Background(root)
    began(waiter)
    clock.until_sleeping()
    clock.advance(7.0)
    saved = json.loads(json.dumps(checkpoint.capture(root)))
    root.request_preempt()
    assert run.result() == 'preempted'
    again, other = FakeClock(), Waiter(10.0, progress='waited')
    machine = nested(other)
    machine.set_clock(again)
    checkpoint.restore(machine, saved)
    run = Background(machine)
    began(other)
    again.until_sleeping()
    again.advance(3.0)
    assert run.result() == 'done'


@pytest.mark.parametrize('draw', [to_ascii, to_mermaid, to_graphviz])
def test_a_deep_machine_can_be_drawn(draw):
    assert draw(nested(Answer('done'))).count('\n') > LEVELS


def test_a_deep_machine_is_checked():
    root = nested(Count())
    (finding,) = [each for each in verify(root) if each.check == 'unset-key']
    assert finding.path == 'ROOT' + '/S' * LEVELS
    assert not [each for each in verify(root, ['count']) if each.severity == 'error']


def test_an_error_deep_inside_names_the_state_and_frees_all_levels():
    root = nested(Answer('nix', 'done', outcomes=['done']))
    with pytest.raises(fsm.InvalidTransitionError, match="returned outcome 'nix'"):
        root.execute()
    assert not root.is_running()
    assert root.execute() == 'done'
