"""State machines and iterators: where outcomes lead, which labels there may be."""

from __future__ import annotations

import pytest

import state_machines as fsm
from state_machines.export import to_ascii
from state_machines.structure import Structure
from state_machines.testing import watching

from .replaying import replay
from .states import Answer, Background, Deaf, Waiter, began

# Labels and outcomes.


def test_an_outcome_that_is_not_bound_leads_out_although_a_state_has_its_name():
    machine = fsm.StateMachine(['done', 'other'])
    with machine:
        fsm.StateMachine.add('done', Answer('done'))
    with watching(machine) as watched:
        assert machine.execute() == 'done'
    watched.assert_path('done')
    (edge,) = Structure(machine).edges
    assert edge.leaving
    assert 'done -> [done]' in to_ascii(machine)
    assert list(replay(machine, [])) == []


def test_a_bound_outcome_leads_to_the_state_of_that_name():
    machine = fsm.StateMachine(['done'])
    second = Answer('done')
    with machine:
        fsm.StateMachine.add('FIRST', Answer('go'), {'go': 'done'})
        fsm.StateMachine.add('done', second)
    assert machine.execute() == 'done'
    assert second.runs == 1


@pytest.mark.parametrize('label', ['', 'A/B', '/', 3, None])
def test_a_label_that_would_break_paths_is_refused(label):
    machine = fsm.StateMachine(['done'])
    with pytest.raises(fsm.InvalidStateError, match='Label'), machine:
        fsm.StateMachine.add(label, Answer('done'))
    each = fsm.Iterator(['done'], [], [], it=[1])
    with pytest.raises(fsm.InvalidStateError, match='Label'), each:
        fsm.Iterator.set_contained_state(label, Answer('done'))
    both = fsm.Concurrence(['done'], 'done')
    with pytest.raises(fsm.InvalidStateError, match='Label'), both:
        fsm.Concurrence.add(label, Answer('done'))
    with pytest.raises(fsm.InvalidStateError, match='Label'):
        machine.add_interrupt(label, Answer('done'))


def test_the_initial_state_may_be_set_before_the_states_are_added():
    machine = fsm.StateMachine(['done'])
    machine.set_initial_state(['SECOND'])
    first = Answer('done')
    with machine:
        fsm.StateMachine.add('FIRST', first)
        fsm.StateMachine.add('SECOND', Answer('done'))
    assert machine.execute() == 'done'
    assert first.runs == 0
    with pytest.raises(fsm.InvalidStateError, match='THIRD'):
        machine.set_initial_state(['THIRD'])
    wrong = fsm.StateMachine(['done'])
    wrong.set_initial_state(['THIRD'])
    with wrong:
        fsm.StateMachine.add('FIRST', Answer('done'))
    with pytest.raises(fsm.InvalidTransitionError, match='THIRD'):
        wrong.execute()


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


def test_a_preempted_iterator_ends_preempted_although_its_state_has_no_such_outcome():
    deaf = Deaf(outcomes=['done'])
    each = fsm.Iterator(['preempted'], [], [], it=range(5), exhausted_outcome='all')
    with each:
        fsm.Iterator.set_contained_state('DO', deaf, loop_outcomes=['done'])
    following = Answer('done')
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('EACH', each, {'all': 'NEXT'})
        fsm.StateMachine.add('NEXT', following)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    deaf.release.set()
    assert run.result() == 'preempted'
    assert following.runs == 0


def test_an_iterator_without_an_outcome_for_a_preempt_passes_it_on():
    deaf, waiter = Deaf(outcomes=['done']), Waiter()
    each = fsm.Iterator([], [], [], it=range(5), exhausted_outcome='all')
    with each:
        fsm.Iterator.set_contained_state('DO', deaf, loop_outcomes=['done'])
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('EACH', each, {'all': 'NEXT'})
        fsm.StateMachine.add('NEXT', waiter)
    run = Background(root)
    began(deaf)
    root.request_preempt()
    deaf.release.set()
    assert run.result() == 'preempted'
    assert waiter.runs == 1


@pytest.mark.parametrize(
    ('container', 'given', 'words'),
    [
        (fsm.StateMachine(['done']), 'transition', r"StateMachine/S.*did you mean 'transitions'\?"),
        (fsm.Concurrence(['done'], 'done'), 'transitions', r"known are .*'remapping'"),
    ],
)
def test_an_argument_that_is_not_known_is_named_with_the_state(container, given, words):
    with container, pytest.raises(TypeError, match=words):
        container.add('S', Answer('done'), **{given: {}})
