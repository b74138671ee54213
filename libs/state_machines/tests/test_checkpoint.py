"""A checkpoint lets a machine in another process go on where the first was."""

from __future__ import annotations

import json
import threading

import state_machines as fsm
from state_machines import checkpoint
from state_machines.testing import FakeClock

from .states import Answer, Background, CheckpointedWorld, Waiter, began, through_json


def test_a_machine_goes_on_in_its_state_with_userdata_and_progress():
    first, second = CheckpointedWorld(), CheckpointedWorld()
    first.inner.userdata.visited = ['R1', 'R2']
    run = Background(first.root)
    began(first.explore)
    first.clock.until_sleeping(1)
    first.clock.advance(6.0)
    saved = through_json(first.root)
    first.root.request_preempt()
    run.result()

    checkpoint.restore(second.root, saved)
    assert second.inner.userdata.visited == ['R1', 'R2']
    run = Background(second.root)
    began(second.explore)
    second.clock.until_sleeping(1)
    second.clock.advance(4.0)
    assert run.result() == 'done'
    assert second.before.runs == 0


def test_a_machine_goes_on_in_an_interrupt_and_then_where_that_came():
    first, second = CheckpointedWorld(), CheckpointedWorld()
    run = Background(first.root)
    began(first.explore)
    first.clock.until_sleeping(1)
    first.clock.advance(6.0)
    first.root.raise_interrupt('CHARGE')
    began(first.charge)
    first.clock.until_sleeping(1)
    first.clock.advance(3.0)
    saved = through_json(first.root)
    first.root.request_preempt()
    first.root.request_preempt()

    checkpoint.restore(second.root, saved)
    second_run = Background(second.root)
    began(second.charge)
    second.clock.until_sleeping(1)
    second.clock.advance(2.0)
    began(second.explore)
    second.clock.until_sleeping(1)
    second.clock.advance(4.0)
    assert second_run.result() == 'done'
    assert second.before.runs == 0
    del run


def test_an_interrupt_that_had_not_begun_is_not_lost():
    first, second = CheckpointedWorld(), CheckpointedWorld()
    first.root.raise_interrupt('CHARGE')
    checkpoint.restore(second.root, through_json(first.root))
    run = Background(second.root)
    began(second.charge)
    second.root.request_preempt()
    run.result()


def test_an_iterator_goes_on_with_its_item():
    def build(seen):
        iterator = fsm.Iterator(['done'], [], [], it='ABCD', it_label='x', exhausted_outcome='done')
        saved = []

        def visit(ud):
            seen.append(ud.x)
            saved.append(through_json(iterator))
            return 'more'

        with iterator:
            fsm.Iterator.set_contained_state(
                'S', fsm.CBState(visit, outcomes=['more'], input_keys=['x']), ['more']
            )
        return iterator, saved

    first, second = [], []
    iterator, saved = build(first)
    iterator.execute()
    again, _ = build(second)
    checkpoint.restore(again, saved[2])
    assert again.execute() == 'done'
    assert second == ['C', 'D']


def test_a_concurrence_goes_on_with_the_children_that_had_not_ended():
    def build():
        quick, slow = Answer('done'), Waiter(5.0)
        concurrence = fsm.Concurrence(
            ['both', 'other'], 'other', outcome_map={'both': {'QUICK': 'done', 'SLOW': 'done'}}
        )
        with concurrence:
            fsm.Concurrence.add('QUICK', quick)
            fsm.Concurrence.add('SLOW', slow)
        concurrence.set_clock(clock := FakeClock())
        return concurrence, quick, slow, clock

    first, quick, slow, clock = build()
    ended, quick_ended = [], threading.Event()

    def saw(ud, active):
        ended.append(through_json(first))
        if active == ['SLOW']:
            quick_ended.set()

    first.register_transition_cb(saw)
    run = Background(first)
    began(slow)
    assert quick_ended.wait(60.0)
    first.request_preempt()
    run.result()
    second, quick, slow, clock = build()
    checkpoint.restore(second, ended[1])
    run = Background(second)
    clock.until_sleeping(1)
    clock.advance(5.0)
    assert run.result() == 'both'
    assert quick.runs == 0


def test_an_item_that_was_done_is_not_repeated_by_a_checkpoint_taken_after_it():
    def build(seen):
        each = fsm.Iterator(['done'], [], [], it='ABCD', it_label='x', exhausted_outcome='done')
        with each:
            fsm.Iterator.set_contained_state(
                'S',
                fsm.CBState(
                    lambda ud: seen.append(ud.x) or 'more', outcomes=['more'], input_keys=['x']
                ),
                ['more'],
            )
        return each

    first, saved = [], []
    each = build(first)
    each.register_transition_cb(lambda ud, active: saved.append(through_json(each)))
    assert each.execute() == 'done'
    assert len(saved) == 4
    for done, at in enumerate(saved, start=1):
        second = []
        again = build(second)
        checkpoint.restore(again, at)
        assert again.execute() == 'done'
        assert second == list('ABCD'[done:])


def test_items_that_cannot_be_kept_are_drawn_again():
    def build(seen, die):
        items = [object(), object(), object()]
        each = fsm.Iterator(['done'], [], [], it=items, it_label='x', exhausted_outcome='done')

        def visit(ud):
            seen.append(items.index(ud.x))
            if die is not None and len(seen) == 2:
                die.append(json.loads(json.dumps(checkpoint.capture(each, leave_out=['x']))))
            return 'more'

        with each:
            state = fsm.CBState(visit, outcomes=['more'], input_keys=['x'])
            fsm.Iterator.set_contained_state('S', state, ['more'])
        return each

    saved, second = [], []
    build([], saved).execute()
    again = build(second, None)
    checkpoint.restore(again, saved[0])
    assert again.execute() == 'done'
    assert second == [1, 2]


def test_a_container_that_has_ended_is_not_begun_again_by_an_early_checkpoint():
    """A child's callback saves while its brother, which has ended, is not yet noted as such."""

    def build():
        work = Answer('done')
        inner = fsm.StateMachine(['done'])
        with inner:
            fsm.StateMachine.add('WORK', work)
        both = fsm.Concurrence(['done'], 'done')
        with both:
            fsm.Concurrence.add('INNER', inner)
        return both, inner, work

    first, inner, _ = build()
    saved = []
    # After its last transition, before the concurrence's own thread takes note.
    inner.register_termination_cb(lambda *_: saved.append(through_json(first)))
    assert first.execute() == 'done'
    second, _, work = build()
    checkpoint.restore(second, saved[0])
    assert second.execute() == 'done'
    assert work.runs == 0
