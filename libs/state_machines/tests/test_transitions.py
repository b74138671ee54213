"""Transitions as they are told, and the test kit's view of them."""

from __future__ import annotations

import sys
import threading

import state_machines as fsm
from state_machines import transitions as feeds
from state_machines.program import unfold
from state_machines.testing import FakeClock, script, watching
from state_machines.transitions import TransitionFeed

from .replaying import recording, replay
from .states import Answer, Background, Waiter, began, chain


def patrol():
    inner = fsm.StateMachine(['done', 'preempted'])
    root = fsm.StateMachine(['done', 'preempted'])
    root.set_name('PATROL')
    with root:
        fsm.StateMachine.add('CHOOSE', Answer('go', 'go', 'done'), {'go': 'MOVE'})
        fsm.StateMachine.add('MOVE', inner, {'done': 'CHOOSE'})
        with inner:
            fsm.StateMachine.add('PLAN', Answer('done'), {'done': 'FOLLOW'})
            fsm.StateMachine.add('FOLLOW', Answer('done'))
    return root


def test_transitions_are_numbered_and_fit_the_machine():
    machine = patrol()
    machine.userdata.battery = 80
    machine.userdata.handle = object()
    with recording(machine) as transitions:
        assert machine.execute() == 'done'
    assert [t.sequence for t in transitions] == list(range(1, 10))
    assert transitions[0].userdata == {'battery': 80}
    assert [(t.path, t.from_state, t.outcome, t.to_state, t.kind) for t in transitions[:4]] == [
        ('PATROL', 'CHOOSE', 'go', 'MOVE', 'transition'),
        ('PATROL/MOVE', 'PLAN', 'done', 'FOLLOW', 'transition'),
        ('PATROL/MOVE', 'FOLLOW', 'done', 'done', 'exit'),
        ('PATROL', 'MOVE', 'done', 'CHOOSE', 'transition'),
    ]
    assert [t.visits for t in transitions if t.to_state == 'MOVE'] == [1, 2]
    steps = list(replay(patrol(), transitions))
    assert steps[0].active == ('PATROL/MOVE', 'PATROL/MOVE/PLAN')
    assert steps[1].active == ('PATROL/MOVE', 'PATROL/MOVE/FOLLOW')
    assert steps[-1].active == ()


def test_transitions_of_interrupts_and_concurrences_fit_the_machine():
    def build():
        waiter, quick = Waiter(100.0), Answer('done')
        both = fsm.Concurrence(['done', 'preempted'], 'preempted')
        root = fsm.StateMachine(['done', 'preempted'])
        with root:
            fsm.StateMachine.add('BOTH', both)
            with both:
                fsm.Concurrence.add('WAITER', waiter)
                fsm.Concurrence.add('QUICK', quick)
        root.add_interrupt('STOP', Answer('done'), transitions={'done': fsm.RESUME})
        return root, waiter

    root, waiter = build()
    with recording(root) as transitions:
        run = Background(root)
        began(waiter)
        root.raise_interrupt('STOP')
        began(waiter)
        root.request_preempt()
        run.result()
    steps = list(replay(build()[0], transitions))
    assert [step.transition.kind for step in steps if step.transition.path == 'StateMachine'] == [
        'interrupt',
        'resume',
        'exit',
    ]


def test_interrupts_of_a_concurrence_are_told_in_order():
    def build():
        root, slow = fsm.Concurrence(['done', 'preempted'], 'done'), Waiter(100.0)
        with root:
            fsm.Concurrence.add('QUICK', Answer('done'))
            fsm.Concurrence.add('SLOW', slow)
        root.set_name('BOTH')
        root.add_interrupt('STOP', Answer('done'))
        return root, slow

    root, slow = build()
    quick_ended = threading.Event()
    root.register_transition_cb(
        lambda ud, active: quick_ended.set() if active == ['SLOW'] else None
    )
    with recording(root) as transitions:
        root.raise_interrupt('STOP')
        run = Background(root)
        began(slow)
        assert quick_ended.wait(60.0)
        root.raise_interrupt('STOP')
        began(slow)
        root.request_preempt()
        run.result()
    steps = list(replay(build()[0], transitions))
    assert [
        (each.transition.from_state, each.transition.to_state, each.transition.kind, each.active)
        for each in steps
    ] == [
        ('', 'STOP', 'interrupt', ('BOTH/STOP',)),
        ('STOP', '', 'resume', ('BOTH/QUICK', 'BOTH/SLOW')),
        ('QUICK', '', 'ended', ('BOTH/SLOW',)),
        ('', 'STOP', 'interrupt', ('BOTH/STOP',)),
        ('STOP', '', 'resume', ('BOTH/SLOW',)),
        ('SLOW', '', 'ended', ()),
    ]


def test_a_replay_goes_back_to_where_a_nested_machine_was_before_an_interrupt():
    def build():
        root, _ = chain(Answer('done'), waiter := Waiter(100.0))
        root.add_interrupt('STOP', Answer('done'))
        return root, waiter

    root, waiter = build()
    with recording(root) as transitions:
        run = Background(root)
        began(waiter)
        root.raise_interrupt('STOP')
        began(waiter)
        root.request_preempt()
        run.result()
    steps = list(replay(build()[0], transitions))
    resumed = next(step for step in steps if step.transition.kind == 'resume')
    assert resumed.active[-1] == 'StateMachine/INNER/INNER/S1'


def test_a_feed_survives_its_consumer_and_reports_all_that_ran(caplog):
    machine, seen = patrol(), []

    def consume(transition):
        seen.append(transition.sequence)
        if len(seen) == 2:
            raise OSError('disk full')

    feed = TransitionFeed(machine, consume)
    machine.execute()
    assert feed.flush(5.0)
    feed.close()
    assert seen == list(range(1, 10))
    assert 'disk full' in caplog.text
    machine.set_initial_state(['CHOOSE'])
    machine.execute()
    assert len(seen) == 9


def test_tracing_can_begin_while_a_machine_runs():
    waiter, seen = Waiter(100.0), []
    machine = fsm.StateMachine(['done', 'preempted'])
    with machine:
        fsm.StateMachine.add('WAIT', waiter)
    run = Background(machine)
    began(waiter)
    machine.control.add_trace(lambda raw: seen.append(unfold(raw)))
    machine.request_preempt()
    run.result()
    assert [(noted.source, noted.outcome, noted.kind) for noted in seen if noted.is_transition] == [
        ('WAIT', 'preempted', 'exit')
    ]


class Changing(dict):
    """A value that somebody changes while it is looked at."""

    def items(self):
        raise RuntimeError('dictionary changed size during iteration')


def test_userdata_that_changes_while_it_is_read_does_not_end_the_reports():
    machine, seen = patrol(), []
    machine.userdata.calm, machine.userdata.changing = 1, Changing(x=1)
    feed = TransitionFeed(machine, seen.append)
    machine.execute()
    assert feed.flush(5.0)
    feed.close()
    assert len(seen) == 9
    assert seen[0].userdata == {'calm': 1}


class CountDown(fsm.State):
    def __init__(self, count):
        super().__init__(['next', 'done'])
        self.left = count

    def execute(self, ud):
        self.left -= 1
        return 'next' if self.left else 'done'


def test_transitions_of_several_threads_are_numbered_in_the_order_they_come_in():
    together = fsm.Concurrence(['done'], 'done')
    with together:
        for label in 'ABC':
            inner = fsm.StateMachine(['done'])
            with inner:
                fsm.StateMachine.add('COUNT', CountDown(3000), {'next': 'COUNT'})
            fsm.Concurrence.add(label, inner)
    seen, switching = [], sys.getswitchinterval()
    feed = TransitionFeed(together, lambda transition: seen.append(transition.sequence))
    sys.setswitchinterval(1e-6)
    try:
        together.execute()
    finally:
        sys.setswitchinterval(switching)
    assert feed.flush(20.0)
    feed.close()
    assert seen == list(range(1, 3 * 3000 + 3 + 1))


def test_transitions_that_nobody_could_take_in_leave_a_gap_in_the_numbers(monkeypatch):
    monkeypatch.setattr(feeds, 'QUEUE_LENGTH', 10)
    seen, busy, go_on = [], threading.Event(), threading.Event()
    wait = fsm.CBState(lambda ud: 'done' if busy.wait(5.0) else None, outcomes=['done'])
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('HELLO', Answer('done'), {'done': 'WAIT'})
        fsm.StateMachine.add('WAIT', wait, {'done': 'COUNT'})
        fsm.StateMachine.add('COUNT', CountDown(100), {'next': 'COUNT'})

    def consume(transition):
        busy.set()
        go_on.wait(60.0)
        seen.append(transition.sequence)

    feed = TransitionFeed(machine, consume)
    machine.execute()
    go_on.set()
    assert feed.flush(5.0)
    feed.close()
    # The last of the ten is that the machine has ended, which has no number.
    assert seen == [1, *range(94, 103)]


def test_several_may_watch_a_machine_at_once():
    machine, seen = patrol(), []
    script(machine, {'PATROL/CHOOSE': ['done', 'done']})
    feed = TransitionFeed(machine, lambda transition: seen.append(transition.from_state))
    with recording(machine) as transitions, watching(machine) as watched:
        machine.execute()
    feed.flush(5.0)
    assert seen == watched.path() == ['CHOOSE']
    assert [t.from_state for t in transitions] == ['CHOOSE']
    machine.set_initial_state(['CHOOSE'])
    machine.execute()
    feed.close()
    assert seen == ['CHOOSE', 'CHOOSE']


def test_the_end_of_an_iterators_items_is_told_by_its_outcome():
    each = fsm.Iterator([], [], [], it=[1, 2], it_label='number', exhausted_outcome='all')
    with each:
        fsm.Iterator.set_contained_state('DO', Answer('next'), loop_outcomes=['next'])
    with watching(each) as watched:
        assert each.execute() == 'all'
    assert watched.transitions[-1] == ('Iterator', 'DO', 'all', 'all')
    watched.assert_covered()


def test_a_transition_says_how_long_each_state_took_by_the_machines_clock():
    clock, machine = FakeClock(leaps=True), patrol()
    machine.set_clock(clock)
    plan = [lambda ud: clock.sleep(4.0, fsm.Interrupt()) and 'done']
    outcomes = {'CHOOSE': ['go', 'done'], 'MOVE/PLAN': plan, 'MOVE/FOLLOW': ['done']}
    script(machine, {f'PATROL/{path}': turns for path, turns in outcomes.items()})
    with recording(machine) as transitions:
        machine.execute()
    assert [t.duration for t in transitions] == [0.0, 4.0, 0.0, 4.0, 0.0]
