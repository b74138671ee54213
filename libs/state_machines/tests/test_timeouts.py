"""Timeouts, deadlines and retries of states, on the machine's clock."""

# A test names one machine after another alike.
# mypy: disable-error-code="arg-type, assignment, attr-defined, return-value"

from __future__ import annotations

import threading

import pytest

import state_machines as fsm
from state_machines.testing import FakeClock

from .states import Answer, Background, Deaf, Waiter, began


def machine_of(state, transitions=None, clock=None, outcomes=('done', 'late'), **limits):
    machine = fsm.StateMachine(outcomes)
    machine.set_name('ROOT')
    machine.set_clock(clock or FakeClock())
    with machine:
        fsm.StateMachine.add('STATE', state, transitions, **limits)
    return machine


def test_a_state_is_stopped_after_its_timeout_on_the_machines_clock(caplog):
    clock, waiter = FakeClock(), Waiter(seconds=100.0)
    machine = machine_of(waiter, {'timeout': 'late', 'preempted': 'late'}, clock, timeout=5.0)
    run = Background(machine)
    # The state sleeps, and the watcher for it.
    clock.until_sleeping(2)
    clock.advance(4.9)
    assert machine.is_running()
    clock.advance(0.2)
    assert run.result() == 'late'
    assert "'ROOT/STATE' was stopped after its timeout of 5 s" in caplog.text
    assert not waiter.preempt_requested()


@pytest.mark.parametrize(
    ('outcomes', 'expected'),
    [(('done', 'aborted', 'preempted'), 'aborted'), (('done', 'preempted'), 'preempted')],
)
def test_without_a_timeout_transition_it_counts_as_aborted_or_preempted(outcomes, expected):
    clock, waiter = FakeClock(), Waiter(seconds=100.0)
    waiter.register_outcomes(outcomes)
    machine = machine_of(waiter, None, clock, ('done', 'aborted', 'preempted'), timeout=1.0)
    run = Background(machine)
    clock.until_sleeping(2)
    clock.advance(1.0)
    assert run.result() == expected


def test_a_state_that_ends_in_time_keeps_its_outcome():
    machine = machine_of(Answer('done'), {'timeout': 'late'}, timeout=1.0, deadline=2.0)
    assert machine.execute() == 'done'


def test_the_machine_goes_on_without_a_state_that_is_over_its_deadline(caplog):
    clock, deaf = FakeClock(), Deaf()
    machine = machine_of(deaf, {'timeout': 'late', 'preempted': 'late'}, clock, deadline=3.0)
    run = Background(machine)
    began(deaf)
    clock.until_sleeping(1)
    clock.advance(3.0)
    assert run.result() == 'late'
    assert "'ROOT/STATE' did not return within its deadline of 3 s" in caplog.text
    assert machine.control.left_behind() == ['ROOT/STATE']
    deaf.release.set()


def test_a_nested_machine_has_a_deadline_as_a_whole():
    clock, deaf, after = FakeClock(), Deaf(), Answer('done')
    inner = fsm.StateMachine(['done', 'preempted'])
    with inner:
        fsm.StateMachine.add('DEAF', deaf)
    machine = machine_of(
        inner, {'timeout': 'AFTER', 'preempted': 'late', 'done': 'late'}, clock, deadline=3.0
    )
    with machine:
        fsm.StateMachine.add('AFTER', after)
    run = Background(machine)
    began(deaf)
    clock.until_sleeping(1)
    clock.advance(3.0)
    assert run.result() == 'done'
    assert after.runs == 1
    assert not inner.is_running()
    assert not inner.preempt_requested()
    deaf.release.set()
    assert deaf.ended.wait(60.0)
    # The inner machine is good for another run.
    assert inner.execute() == 'done'


def test_deadlines_hold_for_children_of_a_concurrence_and_of_an_iterator():
    for kind in ('concurrence', 'iterator'):
        clock, deaf = FakeClock(), Deaf()
        if kind == 'concurrence':
            machine = fsm.Concurrence(
                ['late', 'other'], 'other', outcome_map={'late': {'DEAF': 'preempted'}}
            )
            with machine:
                fsm.Concurrence.add('DEAF', deaf, deadline=2.0)
        else:
            machine = fsm.Iterator(['late'], [], [], it=[1, 2])
            with machine:
                fsm.Iterator.set_contained_state(
                    'DEAF', deaf, ['done'], [], {'preempted': 'late'}, deadline=2.0
                )
        machine.set_clock(clock)
        run = Background(machine)
        began(deaf)
        clock.until_sleeping(1)
        clock.advance(2.0)
        assert run.result() == 'late'
        deaf.release.set()


def test_failures_are_retried_so_often_and_no_more():
    state = Answer('aborted', 'aborted', 'done')
    machine = machine_of(state, {'aborted': 'late'}, retry=2)
    assert machine.execute() == 'done'
    assert state.runs == 3
    state = Answer('aborted', outcomes=['aborted', 'done'])
    machine = machine_of(state, {'aborted': 'late'}, retry=2)
    assert machine.execute() == 'late'
    assert state.runs == 3


def test_other_outcomes_can_count_as_failures():
    state = Answer('blocked', 'blocked', 'done')
    machine = machine_of(state, {'blocked': 'late'}, retry=5, retry_on=['blocked'])
    assert machine.execute() == 'done'


def test_running_out_of_time_is_retried_too():
    clock, waiter = FakeClock(), Waiter(seconds=100.0)
    machine = machine_of(
        waiter, {'timeout': 'late', 'preempted': 'late'}, clock, timeout=1.0, retry=1
    )
    run = Background(machine)
    for _ in range(2):
        clock.until_sleeping(2)
        began(waiter)
        clock.advance(1.0)
    assert run.result() == 'late'
    assert waiter.runs == 2


def test_a_preempt_is_no_failure_to_retry():
    waiter = Waiter()
    machine = machine_of(waiter, {'preempted': 'late'}, retry=3, retry_on=['preempted'])
    run = Background(machine)
    began(waiter)
    machine.request_preempt()
    assert run.result() == 'late'
    assert waiter.runs == 1
    assert not machine.preempt_requested()


@pytest.mark.parametrize(
    ('limits', 'words'),
    [
        ({'timeout': 0}, 'timeout 0'),
        ({'deadline': -1.0}, 'deadline -1.0'),
        ({'retry': -1}, 'retry -1'),
        ({'timeout': 1.0}, "no outcome for it: bind 'timeout'"),
        ({'retry': 1}, 'none of the outcomes'),
    ],
)
def test_limits_that_cannot_work_are_refused(limits, words):
    with pytest.raises(fsm.InvalidTransitionError, match=words) as caught:
        machine_of(Answer('done'), **limits)
    assert 'ROOT/STATE' in str(caught.value)


def test_an_item_that_hangs_is_followed_by_the_next_item():
    began_with, release = [], threading.Event()

    class Hangs(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'], ['item'])

        def execute(self, ud):
            began_with.append(ud.item)
            if ud.item == 1:
                release.wait(60.0)
            return 'done'

    each = fsm.Iterator(['late'], [], [], it=[0, 1, 2], it_label='item', exhausted_outcome='all')
    each.preempt_timeout = 5.0
    with each:
        fsm.Iterator.set_contained_state(
            'DO', Hangs(), loop_outcomes=['done', 'timeout'], deadline=0.2
        )
    # What hangs ends once the machine has gone on: nobody is let in before.
    each.register_transition_cb(lambda *_: began_with[-1] == 1 and release.set())
    assert Background(each).result() == 'all'
    assert began_with == [0, 1, 2]


def test_a_preempt_is_bounded_although_a_time_limit_on_a_clock_that_stands_is_watched():
    deaf = Deaf()
    machine = fsm.StateMachine(['done', 'preempted'])
    clock = FakeClock()
    machine.set_clock(clock)
    machine.preempt_timeout = 0.05
    with machine:
        fsm.StateMachine.add('DEAF', deaf, timeout=1000.0)
    run = Background(machine)
    began(deaf)
    clock.until_sleeping()  # Nothing but the request wakes who watches.
    machine.request_preempt()
    assert run.result() == 'preempted'
    deaf.release.set()


@pytest.mark.parametrize('nested', [False, True])
def test_the_states_of_a_concurrence_that_was_left_behind_are_left_behind_too(nested):
    """They are named, and entered again only when they have ended, with no request left on them."""
    deaf, requests, ended = Deaf(), [], threading.Event()
    deaf.ending = lambda ud: requests.append(deaf.preempt_requested())
    child = deaf
    if nested:
        child = fsm.StateMachine(['done', 'preempted'], ['key'], ['key'])
        child.add_state('DEAF', deaf)
    concurrence = fsm.Concurrence(['done'], 'done', ['key'], ['key'])
    concurrence.userdata.key = 1
    concurrence.add_state('CHILD', child)
    root = fsm.StateMachine(['done', 'late'])
    root.userdata.key = 1
    root.set_name('ROOT')
    root.add_state('FIRST', concurrence, {'timeout': 'AGAIN'}, deadline=0.05)
    root.add_state('AGAIN', fsm.CBState(lambda ud: ended.wait(60.0) and 'done', outcomes=['done']))
    run = Background(root)
    path = 'ROOT/FIRST/CHILD/DEAF' if nested else 'ROOT/FIRST/CHILD'
    while root.get_active_states() != ['AGAIN']:
        ended.wait(0.001)
    assert path in root.control.left_behind()
    began(deaf)
    ended.set()
    assert run.result() == 'done'
    # The same state once more, while the thread that was left behind in it has not ended.
    second = fsm.Concurrence(['done'], 'done')
    second.userdata.key = 1
    second.add_state('CHILD', child)
    run = Background(second)
    deaf.release.set()
    assert run.result() == 'done'
    assert requests == [True, False]


def test_a_timeouts_request_does_not_outlive_a_nested_machine_that_an_interrupt_wanted_aside():
    deaf = Deaf(['done'])
    inner = fsm.StateMachine(['done', 'preempted'])
    inner.add_state('DEAF', deaf)
    root = fsm.StateMachine(['done', 'preempted'])
    root.add_state('INNER', inner, timeout=0.01)
    root.add_interrupt('INTERRUPT', Answer('done'))
    run = Background(root)
    began(deaf)
    while not deaf.preempt_requested():
        pass
    root.raise_interrupt('INTERRUPT')
    deaf.release.set()
    assert run.result() == 'done'
    assert not inner.preempt_requested()
    assert root.execute() == 'done'
