"""Pausing, stepping and asking, at any depth; what is asked twice is told once."""

from __future__ import annotations

import threading
from typing import Any

import pytest

import state_machines as fsm
from state_machines import checkpoint
from state_machines.testing import FakeClock, watching

from .states import Answer, Background, Deaf, Waiter, began, chain


def paused_before(machine, label, timeout=60.0):
    """Wait until a machine stands before a state."""
    stands, pauses = threading.Event(), 0.0
    while machine.get_active_states() != [label]:
        stands.wait(0.001)
        pauses += 0.001
        assert pauses < timeout


class Counted(Answer):
    """Tells when it was executed."""

    def __init__(self):
        super().__init__('done')
        self.ran = threading.Semaphore(0)

    def execute(self, ud):
        self.ran.release()
        return super().execute(ud)


def test_a_paused_machine_enters_machines_inside_and_no_state_in_them():
    states = [Counted() for _ in range(3)]
    root, machines = chain(*states)
    root.control.pause()
    run = Background(root)
    for number, state in enumerate(states):
        paused_before(machines[-1], f'S{number}')
        assert not state.runs
        root.control.step()
        assert state.ran.acquire(timeout=60.0)
    assert run.result() == 'done'
    assert [state.runs for state in states] == [1, 1, 1]


def test_several_steps_at_once_are_as_many_states():
    states = [Counted() for _ in range(4)]
    root, machines = chain(*states)
    root.control.pause()
    run = Background(root)
    paused_before(machines[-1], 'S0')
    with root.control.condition:
        root.control.step()
        root.control.step()
    paused_before(machines[-1], 'S2')
    assert [state.runs for state in states] == [1, 1, 0, 0]
    # a pause anew forgets the steps that were not taken
    with root.control.condition:
        root.control.step()
        root.control.pause()
    root.control.step()
    paused_before(machines[-1], 'S3')
    assert states[3].runs == 0
    root.control.resume()
    assert run.result() == 'done'


def test_a_preempt_goes_through_a_pause():
    waiter = Waiter(60.0)
    root, machines = chain(Answer('done'), waiter)
    root.control.pause()
    run = Background(root)
    paused_before(machines[-1], 'S0')
    root.request_preempt()
    assert run.result() == 'preempted'
    assert waiter.runs == 1


def test_a_state_that_heeds_a_preempt_is_not_asked_again():
    """It cleans up: that is not to be cut short by whoever asks once more."""
    clock, cleaned = FakeClock(), []

    class Cleaning(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'])
            self.begun = threading.Semaphore(0)

        def execute(self, ud):
            self.begun.release()
            self.wait(60.0)
            self.service_preempt()
            self.begun.release()
            cleaned.append(self.wait(5.0))
            return 'preempted'

    state = Cleaning()
    root, machines = chain(state)
    root.set_clock(clock)
    run = Background(root)
    began(state)
    clock.until_sleeping()
    root.request_preempt()
    began(state)  # to clean up
    clock.until_sleeping()
    for machine in machines:
        machine.request_preempt()
        assert not state.preempt_requested()
    clock.advance(5.0)
    assert run.result() == 'preempted'
    assert cleaned == [True]
    assert not any(machine.preempt_requested() for machine in machines)


@pytest.mark.parametrize('by_deadline', [False, True])
def test_nothing_is_asked_of_a_container_after_it_was_left_behind(by_deadline):
    """Its next execution is not preempted by the request that the first one ignored."""
    clock, deaf = FakeClock(), Deaf(['done'])
    inner = fsm.StateMachine(['done', 'preempted'])
    inner.userdata.key = 0
    inner.add_state('DEAF', deaf)
    root = fsm.StateMachine(['done', 'preempted', 'late'])
    root.set_clock(clock)
    if by_deadline:
        root.add_state('INNER', inner, {'timeout': 'late'}, deadline=0.05)
    else:
        root.preempt_timeout = 0.05
        root.add_state('INNER', inner)
    run = Background(root)
    began(deaf)
    inner.request_preempt()
    if by_deadline:
        clock.until_sleeping()
        clock.advance(0.05)
    else:
        root.request_preempt()
    assert run.result() == ('late' if by_deadline else 'preempted')
    assert not inner.preempt_requested()
    assert deaf.preempt_requested()  # so that it ends some time
    deaf.release.set()
    assert deaf.ended.wait(60.0)


def test_an_interrupt_as_urgent_as_what_runs_waits_for_its_end():
    waiter, order = Waiter(60.0), []

    class Noting(Answer):
        def __init__(self, name):
            super().__init__('done')
            self.name = name

        def execute(self, ud):
            order.append(self.name)
            return super().execute(ud)

    root = fsm.StateMachine(['done', 'preempted'])
    root.add_state('WAIT', waiter)
    long = Waiter(60.0)
    root.add_interrupt('LONG', long, priority=2.0)
    for name, priority in (('SAME', 2.0), ('LESS', 1.5), ('MORE', 2.5)):
        root.add_interrupt(name, Noting(name), priority=priority)
    root.set_name('ROOT')
    with watching(root) as watched:
        run = Background(root)
        began(waiter)
        root.raise_interrupt('LONG')
        began(long)
        root.raise_interrupt('SAME')
        root.raise_interrupt('LESS')
        assert not long.preempt_requested()
        root.raise_interrupt('MORE')
        began(long)
        assert order == ['MORE']
        root.control.force_outcome('ROOT/LONG', 'done')
        began(waiter)
        assert order == ['MORE', 'SAME', 'LESS']
        root.request_preempt()
        assert run.result() == 'preempted'
    watched.assert_path(*('WAIT', 'LONG', 'MORE', 'LONG', 'SAME', 'LESS', 'WAIT'))


def test_a_trace_can_be_taken_away_twice_and_others_go_on():
    machine = fsm.StateMachine(['done'])
    machine.add_state('ONLY', Answer('done'))
    first, second = [], []
    remove = machine.control.add_trace(first.append)
    machine.control.add_trace(second.append)
    remove()
    remove()
    assert machine.execute() == 'done'
    assert first == []
    assert len(second) == 3


def test_a_checkpoint_is_not_taken_over_by_what_runs():
    machine = fsm.StateMachine(['done', 'preempted'])
    machine.set_name('ROOT')
    waiter = Waiter(60.0)
    machine.add_state('WAIT', waiter)
    saved = checkpoint.capture(machine)
    run = Background(machine)
    began(waiter)
    with pytest.raises(
        fsm.CheckpointError, match=r"^'ROOT' is running: it cannot take a checkpoint over$"
    ):
        checkpoint.restore(machine, saved)
    machine.request_preempt()
    assert run.result() == 'preempted'
    checkpoint.restore(machine, saved)


def test_an_answer_names_what_waits():
    machine = fsm.StateMachine(['done'])
    machine.set_name('ROOT')
    machine.add_state('ONLY', Answer('done'))
    assert machine.control.questions() == []
    with pytest.raises(
        fsm.InvalidStateError,
        match=r"^No transition of 'ROOT/ONLY' waits for a person; those that do are of \[\]$",
    ):
        machine.control.approve('ROOT/ONLY')


# Code of the user that fails.


def broken(*_):
    raise OSError('disk full')


@pytest.mark.parametrize('callback', ['child_termination_cb', 'outcome_cb'])
def test_a_callback_of_a_concurrence_that_raises_is_named(callback):
    policy: dict[str, Any] = {callback: broken}
    both = fsm.Concurrence(['done'], 'done', **policy)
    both.set_name('BOTH')
    both.add_state('A', Answer('x'))
    with pytest.raises(
        fsm.InvalidUserCodeError, match=rf"^The {callback} of 'BOTH' raised OSError: disk full$"
    ) as caught:
        both.execute()
    assert isinstance(caught.value.__cause__, OSError)


def test_labels_that_are_to_stop_are_those_of_states():
    ends: dict[str, str | None] = {'A': 'x', 'B': None}
    answer: list[Any] = []
    both = fsm.Concurrence(['done'], 'done', child_termination_cb=lambda ends: answer[0])
    both.set_name('BOTH')
    for given, expected in (
        ([True], {'A', 'B'}),
        ([False], set()),
        ([None], set()),
        (['B'], {'B'}),
        ([['A', 'B']], {'A', 'B'}),
        ([[]], set()),
    ):
        answer[:] = given
        assert both.fsm_states_to_stop(ends) == expected
    answer[:] = [['B', 'C', 7]]
    with pytest.raises(fsm.InvalidUserCodeError) as caught:
        both.fsm_states_to_stop(ends)
    assert str(caught.value) == (
        "The child_termination_cb of 'BOTH' returned ['C', 7]: expected True, False or labels "
        "among ['A', 'B']"
    )
    assert fsm.Concurrence(['done'], 'done').fsm_states_to_stop(ends) == frozenset()


# Userdata.


def test_userdata_is_copied_under_other_names():
    outer = fsm.UserData()
    outer.a, outer.b = [1], 2
    copied = outer.extract(['a', 'b'], {'x': 'a'})
    assert sorted(copied.keys()) == ['b', 'x']
    assert copied.x == [1]
    assert copied.x is not outer.a
    more = fsm.UserData()
    more.b, more.c = 3, 4
    outer.update(more)
    known = outer.keys()
    assert {key: outer[key] for key in known} == {'a': [1], 'b': 3, 'c': 4}


def test_a_view_takes_and_hands_over_what_it_declares():
    outer = fsm.UserData()
    outer.a = 1
    view = fsm.Remapper(outer, ['x', 'y'], ['x', 'z'], {'x': 'a'})
    assert view.keys() == ['x']
    inside: dict[str, object] = {}
    assert view.fsm_copy_to(inside, ['x', 'y']) == ['y']
    assert inside == {'x': 1}
    assert view.fsm_take_from({'x': 5}, ['x', 'z']) == ['z']
    assert outer.a == 5
    with pytest.raises(fsm.InvalidUserCodeError):
        view.fsm_take_from({'y': 5}, ['y'])
    given = fsm.UserData()
    given.z = 6
    view.update(given)
    assert outer.z == 6
    with pytest.raises(fsm.InvalidUserCodeError):
        _ = view.z
    with pytest.raises(AttributeError, match='_hidden'):
        _ = view._hidden
