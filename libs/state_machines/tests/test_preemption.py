"""A preempt is never lost, and it is bounded whatever the states do."""

from __future__ import annotations

import threading

import pytest

import state_machines as fsm

from .states import Answer, Background, Deaf, Waiter, began, chain


def test_a_preempt_reaches_the_deepest_state_and_is_served_all_the_way_up():
    waiter = Waiter()
    root, machines = chain(waiter)
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert not any(state.preempt_requested() for state in (*machines, waiter))
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'


@pytest.mark.parametrize('level', [0, 1, 2])
def test_a_preempt_before_the_start_is_the_first_thing_that_is_seen(level):
    waiter = Waiter()
    root, machines = chain(waiter)
    machines[level].request_preempt()
    assert root.execute() == 'preempted'
    assert waiter.runs == 1
    assert not any(state.preempt_requested() for state in (*machines, waiter))


def test_a_preempt_of_a_leaf_before_the_start_is_not_lost():
    waiter = Waiter()
    root, _ = chain(waiter)
    waiter.request_preempt()
    assert root.execute() == 'preempted'


def test_a_preempt_between_two_states_reaches_the_next():
    waiter = Waiter()
    root, machines = chain(Answer('done'), waiter)
    machines[2].register_transition_cb(lambda ud, states: root.request_preempt())
    assert root.execute() == 'preempted'
    assert waiter.runs == 1


def test_a_state_that_does_not_acknowledge_passes_the_preempt_on():
    seen = []
    waiter = Waiter()
    root, _machines = chain(
        fsm.CBState(lambda ud: root.request_preempt() or 'done', outcomes=['done']),
        fsm.CBState(lambda ud: seen.append('next') or 'done', outcomes=['done']),
        waiter,
    )
    assert root.execute() == 'preempted'
    assert seen == ['next']
    assert not root.preempt_requested()


def test_a_preempt_in_the_last_state_stays_for_the_next_run():
    root, _ = chain(fsm.CBState(lambda ud: root.request_preempt() or 'done', outcomes=['done']))
    assert root.execute() == 'done'
    assert root.preempt_requested()


def test_a_served_preempt_lets_the_machine_go_on():
    waiter, cleaned = Waiter(), Answer('done')
    root = fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add('WAIT', waiter, {'preempted': 'CLEAN_UP', 'done': 'done'})
        fsm.StateMachine.add('CLEAN_UP', cleaned)
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'done'
    assert cleaned.runs == 1
    assert not cleaned.preempt_requested()


def test_a_preempt_request_is_recalled_from_a_state_that_ended_by_itself():
    deaf, waiter = Deaf(), Waiter()
    root, _ = chain(deaf, waiter)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    deaf.release.set()
    assert run.result() == 'preempted'
    assert not deaf.preempt_requested()


def test_a_wait_ends_at_once_when_the_preempt_came_before_it():
    state = Waiter(seconds=1000.0)
    state.request_preempt()
    assert state.execute(None) == 'preempted'
    assert not state.preempt_requested()


def test_a_flag_that_was_cleared_by_assignment_does_not_end_a_wait():
    state = Waiter(seconds=0.0)
    state.request_preempt()
    assert not state.wait(1000.0)
    state._preempt_requested = False
    assert state.wait(0.0)


@pytest.mark.parametrize('depth', [1, 3])
def test_a_state_that_ignores_a_preempt_is_left_behind_and_named(depth, caplog):
    deaf = Deaf()
    if depth == 1:
        root = fsm.StateMachine(['done', 'preempted'])
        with root:
            fsm.StateMachine.add('S0', deaf)
    else:
        root, _ = chain(deaf)
    root.set_name('ROOT')
    root.preempt_timeout = 0.05
    run = Background(root)
    began(deaf)
    root.request_preempt()
    assert run.result() == 'preempted'
    culprit = 'ROOT/' + 'INNER/' * (depth - 1) + 'S0'
    assert f"State '{culprit}' ignored a preempt for 0.05 s" in caplog.text
    assert root.control.left_behind() == [culprit]
    assert not root.preempt_requested()
    deaf.release.set()
    assert deaf.ended.wait(60.0)
    # It can be executed again, and the next run knows nothing of the old preempt.
    deaf.release.set()
    assert root.execute() == 'done'


def test_userdata_is_closed_to_a_state_that_was_left_behind():
    deaf = Deaf()
    deaf.ending = lambda ud: setattr(ud, 'key', 'late')
    root, machines = chain(deaf)
    root.preempt_timeout = 0.05
    machines[2].userdata.key = 'before'
    run = Background(root)
    began(deaf)
    root.request_preempt()
    assert run.result() == 'preempted'
    deaf.release.set()
    assert deaf.ended.wait(60.0)
    assert machines[2].userdata.key == 'before'
    assert isinstance(deaf.late_error, fsm.InvalidUserCodeError)


def test_the_machine_goes_on_inside_after_a_state_was_left_behind():
    deaf, after = Deaf(), Waiter(seconds=0.0)
    inner = fsm.StateMachine(['done', 'preempted'])
    root = fsm.StateMachine(['done', 'preempted'])
    root.preempt_timeout = 0.05
    with root:
        fsm.StateMachine.add('INNER', inner)
        with inner:
            fsm.StateMachine.add('DEAF', deaf, {'preempted': 'AFTER', 'done': 'done'})
            fsm.StateMachine.add('AFTER', after)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    assert run.result() == 'done'
    assert after.runs == 1
    deaf.release.set()


def test_a_culprit_without_an_outcome_for_it_ends_the_container_around_it():
    deaf = Deaf(outcomes=['done'])
    inner = fsm.StateMachine(['done', 'aborted'])
    root = fsm.StateMachine(['done', 'stopped'])
    root.preempt_timeout = 0.05
    with root:
        fsm.StateMachine.add('INNER', inner, {'aborted': 'stopped'})
        with inner:
            fsm.StateMachine.add('DEAF', deaf)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    assert run.result() == 'stopped'
    deaf.release.set()


def test_a_culprit_that_nothing_can_end_for_is_an_error():
    deaf = Deaf(outcomes=['done'])
    root = fsm.StateMachine(['done'])
    root.set_name('ROOT')
    root.preempt_timeout = 0.05
    with root:
        fsm.StateMachine.add('DEAF', deaf)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    with pytest.raises(fsm.InvalidTransitionError, match='ROOT/DEAF'):
        run.result()
    assert not root.is_running()
    deaf.release.set()


def test_without_a_bound_a_state_is_waited_for_in_the_callers_thread():
    threads = []
    root = fsm.StateMachine(['done'])
    root.preempt_timeout = None
    with root:
        fsm.StateMachine.add(
            'A',
            fsm.CBState(
                lambda ud: threads.append(threading.get_ident()) or 'done', outcomes=['done']
            ),
        )
    assert root.execute() == 'done'
    assert threads == [threading.get_ident()]
    with pytest.raises(fsm.InvalidStateError, match='preempt_timeout'):
        root.preempt_timeout = -1.0


def test_an_interrupt_of_the_calling_thread_preempts_before_it_is_passed_on(monkeypatch):
    from state_machines import container

    waiter = Waiter()
    root, _ = chain(waiter)
    root.preempt_timeout = 60.0
    supervise, calls = container.supervise, []

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 1:
            began(waiter)
            raise KeyboardInterrupt
        supervise(*arguments)

    monkeypatch.setattr(container, 'supervise', interrupted)
    with pytest.raises(KeyboardInterrupt):
        root.execute()
    assert not root.is_running()


def test_a_machine_that_user_code_executes_inside_a_state_is_a_root_of_its_own():
    waiter = Waiter()
    inner, _ = chain(waiter)

    class Runs(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'])

        def execute(self, ud):
            return inner.execute()

        def request_preempt(self):
            super().request_preempt()
            inner.request_preempt()

    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('RUNS', Runs())
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
