"""Interrupts cut in by priority, and the machine goes on where it was."""

from __future__ import annotations

import pytest

import state_machines as fsm
from state_machines.testing import FakeClock, watching

from .states import Answer, Background, Waiter, began


@pytest.fixture
def clock():
    return FakeClock()


class Patrol:
    """A machine in a machine: explore for ten seconds, then done."""

    def __init__(self, clock):
        self.explore = Waiter(10.0, progress='explored')
        self.before = Answer('done')
        self.tasks = fsm.StateMachine(['done', 'preempted'])
        self.root = fsm.StateMachine(['done', 'preempted', 'stopped'])
        self.root.set_name('ROOT')
        self.root.set_clock(clock)
        with self.root:
            fsm.StateMachine.add('TASKS', self.tasks)
            with self.tasks:
                fsm.StateMachine.add('BEFORE', self.before, {'done': 'EXPLORE'})
                fsm.StateMachine.add('EXPLORE', self.explore)


def test_after_an_interrupt_a_half_finished_state_waits_only_for_the_rest(clock):
    patrol, charge = Patrol(clock), Waiter(3.0)
    patrol.root.add_interrupt('CHARGE', charge, priority=5)
    run = Background(patrol.root)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(6.0)
    patrol.root.raise_interrupt('CHARGE')
    began(charge)
    clock.until_sleeping(1)
    clock.advance(3.0)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(3.9)
    assert patrol.root.is_running()
    clock.advance(0.2)
    assert run.result() == 'done'
    assert (patrol.before.runs, patrol.explore.runs, charge.runs) == (1, 2, 1)


def test_progress_is_forgotten_when_a_state_ends_in_another_way(clock):
    patrol = Patrol(clock)
    run = Background(patrol.root)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(6.0)
    patrol.root.request_preempt()
    assert run.result() == 'preempted'
    run = Background(patrol.root)
    clock.until_sleeping(1)
    clock.advance(9.9)
    assert patrol.root.is_running()
    clock.advance(0.2)
    assert run.result() == 'done'


def test_a_more_urgent_interrupt_cuts_another_short_and_that_is_resumed(clock):
    patrol, charge, stop = Patrol(clock), Waiter(5.0, progress='charged'), Waiter(1.0)
    patrol.root.add_interrupt('CHARGE', charge, priority=5)
    patrol.root.add_interrupt('STOP', stop, priority=9)
    with watching(patrol.root) as watched:
        run = Background(patrol.root)
        began(patrol.explore)
        patrol.root.raise_interrupt('CHARGE')
        began(charge)
        clock.until_sleeping(1)
        clock.advance(4.0)
        patrol.root.raise_interrupt('STOP')
        began(stop)
        clock.until_sleeping(1)
        clock.advance(1.0)
        began(charge)
        clock.until_sleeping(1)
        clock.advance(1.0)
        began(patrol.explore)
        clock.until_sleeping(1)
        clock.advance(10.0)
        assert run.result() == 'done'
    watched.assert_path('TASKS', 'CHARGE', 'STOP', 'CHARGE', 'TASKS')


def test_a_less_urgent_interrupt_waits_for_its_turn(clock):
    patrol, charge, stop = Patrol(clock), Waiter(5.0), Waiter(1.0)
    patrol.root.add_interrupt('CHARGE', charge, priority=5)
    patrol.root.add_interrupt('STOP', stop, priority=9)
    run = Background(patrol.root)
    began(patrol.explore)
    patrol.root.raise_interrupt('STOP')
    began(stop)
    patrol.root.raise_interrupt('CHARGE')
    clock.until_sleeping(1)
    assert charge.runs == 0
    clock.advance(1.0)
    began(charge)
    clock.until_sleeping(1)
    clock.advance(5.0)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(10.0)
    assert run.result() == 'done'


def test_an_interrupt_may_lead_elsewhere_and_history_is_dropped(clock):
    patrol, stop = Patrol(clock), Answer('done')
    patrol.root.add_interrupt('STOP', stop, transitions={'done': 'stopped'})
    run = Background(patrol.root)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(6.0)
    patrol.root.raise_interrupt('STOP')
    assert run.result() == 'stopped'
    run = Background(patrol.root)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(9.9)
    assert patrol.root.is_running()
    assert patrol.before.runs == 2
    clock.advance(0.2)
    assert run.result() == 'done'


def test_an_interrupt_of_an_inner_container_is_put_aside_with_it(clock):
    patrol, look, stop = Patrol(clock), Waiter(4.0, progress='looked'), Answer('done')
    patrol.tasks.add_interrupt('LOOK', look)
    patrol.root.add_interrupt('STOP', stop, priority=1)
    run = Background(patrol.root)
    began(patrol.explore)
    patrol.tasks.raise_interrupt('LOOK')
    began(look)
    clock.until_sleeping(1)
    clock.advance(3.0)
    patrol.root.raise_interrupt('STOP')
    began(look)
    clock.until_sleeping(1)
    clock.advance(1.0)
    began(patrol.explore)
    clock.until_sleeping(1)
    clock.advance(10.0)
    assert run.result() == 'done'
    assert (look.runs, stop.runs, patrol.explore.runs) == (2, 1, 2)


def test_an_interrupt_before_the_start_is_the_first_thing_that_runs(clock):
    patrol, stop = Patrol(clock), Answer('done')
    patrol.root.add_interrupt('STOP', stop, transitions={'done': 'stopped'})
    patrol.root.raise_interrupt('STOP')
    assert patrol.root.execute() == 'stopped'
    assert patrol.before.runs == 0


def test_an_interrupt_that_came_in_a_states_last_moment_runs_before_the_exit(clock):
    stop = Answer('done')
    root = fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add(
            'LAST',
            fsm.CBState(lambda ud: root.raise_interrupt('STOP') or 'done', outcomes=['done']),
        )
    root.add_interrupt('STOP', stop)
    assert root.execute() == 'done'
    assert stop.runs == 1


def test_a_state_that_made_way_runs_again_after_the_interrupt():
    class MakesWay(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'])
            self.runs = 0

        def execute(self, ud):
            self.runs += 1
            if self.runs == 1:
                root.raise_interrupt('STOP')
            return 'preempted' if self.preempt_requested() else 'done'

    state, stop, root = MakesWay(), Answer('done'), fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('WORK', state)
    root.add_interrupt('STOP', stop)
    assert root.execute() == 'done'
    assert (state.runs, stop.runs) == (2, 1)


def test_an_interrupt_that_waits_for_the_end_of_a_container_does_not_hold_up_an_outer_one():
    ran = []

    def note(label):
        return fsm.CBState(lambda ud: ran.append(label) or 'done', outcomes=['done'])

    def both(ud):
        inner.raise_interrupt('INNER')
        root.raise_interrupt('OUTER')
        return 'done'

    root, inner = fsm.StateMachine(['done']), fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add('TASKS', inner)
        with inner:
            fsm.StateMachine.add('LAST', fsm.CBState(both, outcomes=['done']))
    inner.add_interrupt('INNER', note('INNER'))
    root.add_interrupt('OUTER', note('OUTER'))
    assert root.execute() == 'done'
    assert ran == ['OUTER', 'INNER']


def test_an_interrupt_can_be_withdrawn_until_it_begins(clock):
    patrol, stop = Patrol(clock), Answer('done')
    patrol.root.add_interrupt('STOP', stop, transitions={'done': 'stopped'})
    patrol.root.raise_interrupt('STOP')
    assert patrol.root.withdraw_interrupt('STOP')
    assert not patrol.root.withdraw_interrupt('STOP')


def test_a_preempt_goes_through_an_interrupt(clock):
    patrol, charge = Patrol(clock), Waiter(5.0)
    patrol.root.add_interrupt('CHARGE', charge, transitions={'preempted': 'preempted'})
    run = Background(patrol.root)
    began(patrol.explore)
    patrol.root.raise_interrupt('CHARGE')
    began(charge)
    patrol.root.request_preempt()
    assert run.result() == 'preempted'


def test_an_iterator_goes_on_with_the_same_item(clock):
    seen, stop, waiter = [], Answer('done'), Waiter(1.0)

    class Visit(fsm.State):
        def __init__(self):
            super().__init__(['done', 'preempted'], ['place'])

        def execute(self, ud):
            seen.append(ud.place)
            self._fsm_clock = waiter._fsm_clock = clock  # type: ignore[attr-defined]
            waiter.begun.release()
            if self.wait(1.0):
                return 'done'
            self.service_preempt()
            return 'preempted'

    iterator = fsm.Iterator(
        ['done', 'preempted'], [], [], it=iter('ABC'), it_label='place', exhausted_outcome='done'
    )
    with iterator:
        fsm.Iterator.set_contained_state('VISIT', Visit(), loop_outcomes=['done'])
    iterator.add_interrupt('STOP', stop)
    root = fsm.StateMachine(['done', 'preempted'])
    root.set_clock(clock)
    root.add_interrupt('PAUSE', Answer('done'), priority=1)
    with root:
        fsm.StateMachine.add('VISITS', iterator)
    run = Background(root)
    began(waiter)
    clock.until_sleeping(1)
    clock.advance(1.0)
    began(waiter)
    iterator.raise_interrupt('STOP')
    began(waiter)
    clock.until_sleeping(1)
    root.raise_interrupt('PAUSE')
    began(waiter)
    for _ in range(2):
        clock.until_sleeping(1)
        clock.advance(1.0)
    assert run.result() == 'done'
    assert seen == ['A', 'B', 'B', 'B', 'C']
    assert stop.runs == 1


@pytest.mark.parametrize('at', ['concurrence', 'root'])
def test_a_concurrence_goes_on_with_the_children_that_had_not_ended(clock, at):
    quick, slow, stop = Answer('done'), Waiter(5.0, progress='p'), Answer('done')
    concurrence = fsm.Concurrence(
        ['both', 'other'], 'other', outcome_map={'both': {'QUICK': 'done', 'SLOW': 'done'}}
    )
    root = fsm.StateMachine(['both', 'other'])
    root.set_clock(clock)
    with root:
        fsm.StateMachine.add('TOGETHER', concurrence)
        with concurrence:
            fsm.Concurrence.add('QUICK', quick)
            fsm.Concurrence.add('SLOW', slow)
    (concurrence if at == 'concurrence' else root).add_interrupt('STOP', stop)
    run = Background(root)
    began(slow)
    clock.until_sleeping(1)
    clock.advance(3.0)
    (concurrence if at == 'concurrence' else root).raise_interrupt('STOP')
    began(slow)
    clock.until_sleeping(1)
    clock.advance(2.0)
    assert run.result() == 'both'
    assert (quick.runs, slow.runs, stop.runs) == (1, 2, 1)


def test_interrupts_are_checked_when_they_are_declared_and_raised(clock):
    patrol = Patrol(clock)
    patrol.root.add_interrupt('STOP', Answer('done'))
    with pytest.raises(fsm.InvalidStateError, match='ROOT/STOP'):
        patrol.root.add_interrupt('STOP', Answer('done'))
    with pytest.raises(fsm.InvalidStateError, match='ROOT/TASKS'):
        patrol.root.add_interrupt('TASKS', Answer('done'))
    with pytest.raises(fsm.InvalidTransitionError, match="'dome'"):
        patrol.root.add_interrupt('OTHER', Answer('done'), transitions={'dome': fsm.RESUME})
    with pytest.raises(fsm.InvalidStateError, match="no interrupt 'NIX'"):
        patrol.root.raise_interrupt('NIX')
    patrol.root.add_interrupt('ASTRAY', Answer('done'), transitions={'done': 'NOWHERE'})
    with pytest.raises(fsm.InvalidTransitionError, match='NOWHERE'):
        patrol.root.execute()
