"""A preempt is never lost, and it is bounded whatever the states do."""

from __future__ import annotations

import itertools
import threading

import pytest

import surveillance_fsm as fsm

from .states import Answer, Background, Deaf, Waiter, began


def chain(*states, outcomes=('done', 'preempted')):
    """Machines in one another, the states in the innermost."""
    machines = [fsm.StateMachine(outcomes) for _ in range(3)]
    for outer, inner in itertools.pairwise(machines):
        with outer:
            fsm.StateMachine.add('INNER', inner)
    with machines[-1]:
        for number, state in enumerate(states):
            target = {'done': f'S{number + 1}'} if number + 1 < len(states) else {}
            fsm.StateMachine.add(f'S{number}', state, target)
    return machines[0], machines


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
    assert deaf.ended.wait(5.0)
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
    assert deaf.ended.wait(5.0)
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
    with pytest.raises(fsm.PreemptIgnoredError, match='ROOT/DEAF'):
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
    from surveillance_fsm import container

    waiter = Waiter()
    root, _ = chain(waiter)
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


# Concurrences.


def together(*states, **arguments):
    concurrence = fsm.Concurrence(['done', 'preempted'], 'preempted', **arguments)
    with concurrence:
        for number, state in enumerate(states):
            fsm.Concurrence.add(f'S{number}', state)
    return concurrence


ALL_DONE = {'outcome_map': {'done': {'S0': 'done', 'S1': 'done'}}}


@pytest.mark.parametrize('nested', [False, True])
def test_a_preempt_reaches_all_children_of_a_concurrence(nested):
    states = [Waiter(), Waiter()]
    root = concurrence = together(*states, **ALL_DONE)
    if nested:
        root = fsm.StateMachine(['done', 'preempted'])
        with root:
            fsm.StateMachine.add('TOGETHER', concurrence)
    run = Background(root)
    for state in states:
        began(state)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert not any(state.preempt_requested() for state in (root, concurrence, *states))


def test_a_preempt_of_a_concurrence_before_its_start_is_not_lost():
    states = [Waiter(), Waiter()]
    root = together(*states, **ALL_DONE)
    root.request_preempt()
    assert root.execute() == 'preempted'
    assert not root.preempt_requested()


def test_a_preempt_while_the_children_finish_is_not_lost():
    # One child has ended, and the others were told to stop; one of them takes its time.
    quick, deaf = Answer('done'), Deaf()
    concurrence = together(quick, deaf, child_termination_cb=lambda ends: True)
    after = Waiter()
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('TOGETHER', concurrence, {'preempted': 'AFTER', 'done': 'AFTER'})
        fsm.StateMachine.add('AFTER', after)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    deaf.release.set()
    assert run.result() == 'preempted'
    assert not root.preempt_requested()


def test_a_child_of_a_concurrence_that_ignores_a_preempt_is_left_behind(caplog):
    deaf, waiter = Deaf(), Waiter()
    concurrence = together(deaf, waiter)
    root = fsm.StateMachine(['done', 'preempted'])
    root.set_name('ROOT')
    root.preempt_timeout = 0.05
    with root:
        fsm.StateMachine.add('TOGETHER', concurrence)
    run = Background(root)
    began(deaf)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert "'ROOT/TOGETHER/S0' ignored a preempt" in caplog.text
    assert not root.preempt_requested()
    assert not concurrence.preempt_requested()
    deaf.release.set()


def test_a_request_to_a_state_that_an_earlier_run_left_behind_is_kept():
    deaf = Deaf()
    root = fsm.StateMachine(['done', 'preempted'])
    root.preempt_timeout = 0.05
    with root:
        fsm.StateMachine.add('DEAF', deaf)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    assert run.result() == 'preempted'
    # It is still running: nobody may enter it, and the machine is told so in time.
    assert root.execute() == 'preempted'
    assert not root.preempt_requested()
    deaf.release.set()
    assert deaf.ended.wait(5.0)
    assert root.execute() == 'done'


def test_an_interrupt_that_meets_a_state_as_it_begins_leaves_no_request_on_it():
    first, stop = Answer('done'), Answer('done')
    second = Waiter(0.0)
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('FIRST', first, {'done': 'SECOND'})
        fsm.StateMachine.add('SECOND', second)
    root.add_interrupt('STOP', stop)
    # Raised when SECOND is current but has not begun.
    root.register_transition_cb(
        lambda ud, active: active == ['SECOND'] and not stop.runs and root.raise_interrupt('STOP')
    )
    assert root.execute() == 'done'
    assert stop.runs == 1
    assert not second.preempt_requested()


def test_a_deaf_state_deep_inside_a_child_of_a_concurrence_is_left_behind():
    deaf, waiter = Deaf(), Waiter()
    machine, _ = chain(deaf)
    root = together(machine, waiter)
    root.preempt_timeout = 0.05
    run = Background(root)
    began(deaf)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    deaf.release.set()


def test_an_error_in_one_child_stops_the_others_and_keeps_its_cause():
    waiter = Waiter()
    cause = RuntimeError('arm stuck')
    root = together(waiter, Answer(cause, outcomes=['done']))
    with pytest.raises(fsm.InvalidUserCodeError, match=r'Concurrence/S1.*arm stuck') as caught:
        root.execute()
    assert caught.value.__cause__ is cause
    assert not root.is_running()


def test_the_first_end_may_stop_all_others_or_some():
    states = [Answer('done'), Waiter(), Waiter(seconds=0.0)]
    root = together(*states, child_termination_cb=lambda ends: ends['S0'] == 'done')
    assert root.execute() == 'preempted'
    waiter = Waiter()
    ends = []
    root = together(
        Answer('done'),
        waiter,
        child_termination_cb=lambda now: ends.append(dict(now)) or (['S1'] if now['S0'] else False),
    )
    assert root.execute() == 'preempted'
    assert ends[-1] == {'S0': 'done', 'S1': 'preempted'}


def test_the_outcome_callback_decides_and_is_held_to_the_outcomes():
    root = together(Answer('done'), Answer('done'), outcome_cb=lambda ends: 'done')
    assert root.execute() == 'done'
    root = together(Answer('done'), outcome_cb=lambda ends: None)
    assert root.execute() == 'preempted'
    root = together(Answer('done'), outcome_cb=lambda ends: 'nix')
    with pytest.raises(fsm.InvalidTransitionError, match="'nix'"):
        root.execute()


def test_of_several_outcomes_that_hold_the_most_specific_wins():
    concurrence = fsm.Concurrence(
        ['both', 'first', 'none'],
        'none',
        outcome_map={'both': {'S0': 'done', 'S1': 'done'}, 'first': {'S0': 'done'}},
    )
    with concurrence:
        fsm.Concurrence.add('S0', Answer('done'))
        fsm.Concurrence.add('S1', Answer('done'))
    assert concurrence.execute() == 'both'


# Iterators.


def test_a_preempt_ends_an_iteration_and_is_served():
    waiter = Waiter()
    iterator = fsm.Iterator(['preempted'], [], [], it=range(5), exhausted_outcome='exhausted')
    with iterator:
        fsm.Iterator.set_contained_state('WAIT', waiter, loop_outcomes=['done'])
    run = Background(iterator)
    began(waiter)
    iterator.request_preempt()
    assert run.result() == 'preempted'
    assert not iterator.preempt_requested()
    assert not waiter.preempt_requested()


def test_a_preempt_ends_an_iteration_that_would_loop_on_any_outcome():
    waiter = Waiter()
    iterator = fsm.Iterator(['preempted', 'aborted'], [], [], it=range(5))
    with iterator:
        fsm.Iterator.set_contained_state('WAIT', waiter, loop_outcomes=['done', 'preempted'])
    run = Background(iterator)
    began(waiter)
    iterator.request_preempt()
    assert run.result() == 'preempted'
    assert waiter.runs == 1


def test_an_iterator_takes_items_from_lists_functions_and_generators():
    for items, expected in (
        ([1, 2], [1, 2]),
        (lambda: [3], [3]),
        ((x for x in (4, 5)), [4, 5]),
        ([], []),
    ):
        seen = []
        iterator = fsm.Iterator(['done'], [], [], it=items, it_label='x', exhausted_outcome='done')
        with iterator:
            fsm.Iterator.set_contained_state(
                'S',
                fsm.CBState(
                    lambda ud, seen=seen: seen.append(ud.x) or 'more',
                    outcomes=['more'],
                    input_keys=['x'],
                ),
                loop_outcomes=['more'],
            )
        assert iterator.execute() == 'done'
        assert seen == expected
