"""States: what they declare, what may be copied, and errors that user code makes."""

from __future__ import annotations

import copy
import pickle

import pytest

import state_machines as fsm
from state_machines.testing import FakeClock

from .states import Answer


class Pausing(fsm.State):
    """Waits a moment; it can be pickled, as its class stands in a module."""

    def __init__(self):
        super().__init__(['done', 'preempted'], io_keys=['count'])

    def execute(self, ud):
        self.wait(0.0, progress='waited')
        ud.count += 1
        return 'done'


def machine():
    root = fsm.StateMachine(['done', 'preempted'])
    root.userdata.count = 0
    each = fsm.Iterator(['preempted'], ['count'], ['count'], it=[1, 2], exhausted_outcome='done')
    both = fsm.Concurrence(['done', 'preempted'], 'done', ['count'], ['count'])
    with root:
        fsm.StateMachine.add('ALONE', Pausing(), {'done': 'EACH'}, timeout=100.0)
        fsm.StateMachine.add('EACH', each, {'done': 'BOTH'})
        with each:
            fsm.Iterator.set_contained_state('ONE', Pausing(), loop_outcomes=['done'])
        fsm.StateMachine.add('BOTH', both)
        with both:
            fsm.Concurrence.add('A', Pausing())
    root.add_interrupt('STOP', Pausing(), priority=1)
    return root


@pytest.mark.parametrize('copied', [copy.deepcopy, lambda m: pickle.loads(pickle.dumps(m))])
@pytest.mark.parametrize('executed', [False, True])
def test_machines_can_be_copied_and_pickled_before_and_after_a_run(copied, executed):
    original = machine()
    original.control.add_trace(lambda raw: None)
    original.set_clock(FakeClock(leaps=True))
    if executed:
        assert original.execute() == 'done'
    count = original.userdata.count
    twin = copied(original)
    assert twin.execute() == 'done'
    assert twin.userdata.count == count + 4
    assert original.userdata.count == count
    assert twin.get_name() == original.get_name()


def test_a_copy_of_a_state_is_not_asked_to_stop():
    state = Pausing()
    state.wait(0.0)
    state.request_preempt()
    twin = copy.deepcopy(state)
    assert not twin.preempt_requested()
    assert twin.wait(0.0)
    assert state.preempt_requested()


@pytest.mark.parametrize('wrong', ['done', ['done', 3], [None], 7])
def test_outcomes_and_keys_that_are_no_list_of_strings_are_refused(wrong):
    with pytest.raises(fsm.InvalidStateError, match='outcomes'):
        fsm.State(wrong)
    with pytest.raises(fsm.InvalidStateError, match='input_keys'):
        fsm.State(['done'], wrong)
    with pytest.raises(fsm.InvalidStateError, match='outcomes'):
        fsm.StateMachine(wrong)
    with pytest.raises(fsm.InvalidStateError, match='outcomes'):
        fsm.cb_interface(outcomes=wrong)(print)


class UnspeakableError(Exception):
    def __str__(self):
        raise RuntimeError('not today')


class Unshowable:
    def __repr__(self):
        raise RuntimeError('not today')

    __hash__ = None  # type: ignore[assignment]


def test_an_error_that_cannot_be_shown_is_still_told_where_it_came_from():
    root = fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add('BAD', Answer(UnspeakableError(), outcomes=['done']))
    with pytest.raises(fsm.InvalidUserCodeError, match=r'StateMachine/BAD.*UnspeakableError'):
        root.execute()


def test_an_outcome_that_cannot_be_shown_is_still_told_where_it_came_from():
    root = fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add('BAD', Answer(Unshowable(), outcomes=['done']))
    with pytest.raises(fsm.InvalidTransitionError, match=r'StateMachine/BAD.*Unshowable'):
        root.execute()


class JumpingClock(FakeClock):
    """A clock that somebody sets back while a sleep goes on."""

    def now(self):
        return super().now() - self.back

    def elapsed(self):
        return super().now()

    back = 0.0


def test_a_clock_that_jumps_back_delays_neither_waits_nor_time_limits():
    clock = JumpingClock(leaps=True)

    class Waits(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'])

        def execute(self, ud):
            clock.back += 100.0
            return 'done' if self.wait(5.0) else 'preempted'

    root = fsm.StateMachine(['done', 'preempted'])
    root.set_clock(clock)
    with root:
        fsm.StateMachine.add('WAIT', Waits())
    assert root.execute() == 'done'
    assert clock.elapsed() == 5.0
