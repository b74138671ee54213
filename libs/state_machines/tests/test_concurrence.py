"""Concurrences: how they end, and that they hear a preempt at any moment."""

from __future__ import annotations

import gc
import random
import threading
import weakref

import pytest

import state_machines as fsm
from state_machines import checkpoint
from state_machines.testing import FakeClock

from .states import Answer, Background, Deaf, Waiter, began, chain, through_json


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


def test_a_child_that_ignores_a_preempt_ends_with_no_outcome_of_the_concurrence():
    deaf = Deaf(['done'])
    root = fsm.Concurrence(['done', 'preempted'], 'done')
    root.add_state('S0', deaf)
    root.preempt_timeout = 0.05
    run = Background(root)
    began(deaf)
    root.request_preempt()
    with pytest.raises(fsm.InvalidTransitionError, match="'Concurrence/S0' ignored a preempt"):
        run.result()
    # It keeps the request, so that it ends some time.
    assert deaf.preempt_requested()
    deaf.release.set()


def test_an_execution_that_is_over_holds_on_to_nothing():
    root = together(Answer('done'), Answer('done'), **ALL_DONE)
    root.preempt_timeout = None
    ud = type('Watched', (fsm.UserData,), {})()
    held = weakref.ref(ud)
    gc.disable()
    try:
        assert root.execute(ud) == 'done'
        del ud
        assert held() is None
    finally:
        gc.enable()


def test_a_checkpoint_in_a_shutdown_says_where_a_nested_machine_stopped():
    down, turns, saved = threading.Event(), [], []

    def first(ud):
        turns.append(1)
        down.set()
        return 'done'

    def later(ud):
        down.wait(60.0)
        while inner.fsm_program.frame is not None:
            pass
        return 'done'

    inner = fsm.StateMachine(['done'])
    inner.add_state('S0', fsm.CBState(first, outcomes=['done']), {'done': 'S1'})
    inner.add_state('S1', Answer('done'))
    root = fsm.Concurrence(['done'], 'done')
    root.add_state('INNER', inner)
    root.add_state('LATER', fsm.CBState(later, outcomes=['done']))
    root.register_transition_cb(lambda *_: saved.append(through_json(root)))
    fsm.set_shutdown_check(down.is_set)
    try:
        assert root.execute() is None
    finally:
        fsm.set_shutdown_check(None)
    assert saved[-1]['states'][0]['at']['outcomes'] == {'LATER': 'done'}
    (place,) = (each['at'] for each in saved[-1]['states'] if each.get('label') == 'INNER')
    assert place['current'] == 'S1'
    # Another execution begins anew.
    assert root.execute() == 'done'
    assert len(turns) == 2


def test_a_checkpoint_after_a_concurrence_was_left_behind_has_no_place_in_it():
    hold, calls = threading.Event(), []
    machines = [chain(Answer('done'))[0] for _ in range(2)]
    concurrence = together(*machines)
    # The first state's end is told, and the second one's is not noted meanwhile.
    concurrence.register_transition_cb(
        lambda *_: calls.append(1) or (len(calls) == 2 and hold.wait(60.0))
    )
    root = fsm.StateMachine(['late', 'done', 'preempted'])
    root.add_state('TOGETHER', concurrence, {'timeout': 'late'}, deadline=0.5)
    assert root.execute() == 'late'
    assert not any('at' in each for each in through_json(root)['states'])
    hold.set()


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
    assert deaf.ended.wait(60.0)
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


# A preempt has its own outcome, whatever the default.


def guarded(*states, default='succeeded', outcomes=('succeeded', 'preempted'), **arguments):
    """Build a mission whose next state runs unless the concurrence before it ends preempted."""
    concurrence = fsm.Concurrence(outcomes, default, **arguments)
    following = Answer('done')
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('TOGETHER', concurrence, {default: 'NEXT'})
        fsm.StateMachine.add('NEXT', following)
    with concurrence:
        for number, state in enumerate(states):
            fsm.Concurrence.add(f'S{number}', state)
    return root, following


@pytest.mark.parametrize('others', [[], [Waiter], [lambda: Answer('done')]])
@pytest.mark.parametrize('before', [False, True])
def test_a_preempted_concurrence_ends_preempted_whatever_its_default(others, before):
    waiter = Waiter()
    root, following = guarded(waiter, *(make() for make in others))
    if before:
        root.request_preempt()
        assert root.execute() == 'preempted'
    else:
        run = Background(root)
        began(waiter)
        root.request_preempt()
        assert run.result() == 'preempted'
    assert following.runs == 0
    assert not root.preempt_requested()


def test_a_preempt_counts_more_than_an_outcome_map_that_holds():
    quick, waiter = Answer('done'), Waiter()
    root, following = guarded(waiter, quick, outcome_map={'succeeded': {'S1': 'done'}})
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert following.runs == 0


def test_without_an_outcome_for_it_a_preempt_goes_to_what_runs_next():
    waiter, after = Waiter(), Waiter()
    concurrence = fsm.Concurrence(['succeeded'], 'succeeded')
    with concurrence:
        fsm.Concurrence.add('S0', waiter)
    root = fsm.StateMachine(['done', 'preempted'])
    with root:
        fsm.StateMachine.add('TOGETHER', concurrence, {'succeeded': 'AFTER'})
        fsm.StateMachine.add('AFTER', after)
    run = Background(root)
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'
    assert after.runs == 1


def test_preempts_at_random_moments_in_nested_containers_are_not_lost():
    generator = random.Random(5)
    for _ in range(150):
        waiters = [Waiter(generator.choice([0.0, 0.0002, 20.0])) for _ in range(3)]
        each = fsm.Iterator(['preempted'], [], [], it=[1, 2], exhausted_outcome='done')
        with each:
            fsm.Iterator.set_contained_state('EACH', waiters[0], loop_outcomes=['done'])
        inner = fsm.Sequence(['done', 'preempted'], 'done')
        with inner:
            fsm.Sequence.add('ONE', waiters[1])
            fsm.Sequence.add('TWO', each)
        both = fsm.Concurrence(['done', 'preempted'], 'done')
        with both:
            fsm.Concurrence.add('INNER', inner)
            fsm.Concurrence.add('OTHER', waiters[2])
        root = fsm.StateMachine(['preempted'])
        with root:
            fsm.StateMachine.add('BOTH', both, {'done': 'BOTH'})
        timer = threading.Timer(generator.uniform(0.0, 0.003), root.request_preempt)
        timer.start()
        assert Background(root).result() == 'preempted'
        timer.join()
        assert not root.preempt_requested()


@pytest.mark.parametrize('depth', [0, 1])
def test_an_interrupts_state_that_ignores_a_preempt_is_left_behind(depth, caplog):
    waiter, deaf = Waiter(100.0), Deaf()
    concurrence = fsm.Concurrence(['done', 'preempted'], 'done')
    with concurrence:
        fsm.Concurrence.add('WAIT', waiter)
    branch = chain(deaf)[0] if depth else deaf
    concurrence.add_interrupt('CHARGE', branch, priority=1)
    concurrence.preempt_timeout = 0.05
    run = Background(concurrence)
    began(waiter)
    concurrence.raise_interrupt('CHARGE')
    began(deaf)
    concurrence.request_preempt()
    assert run.result() == 'preempted'
    assert 'ignored a preempt' in caplog.text
    assert not concurrence.is_running()
    deaf.release.set()
    assert deaf.ended.wait(60.0)


class Ending(fsm.State):
    """Ends when it is told, whatever is asked of it, and says that it has."""

    def __init__(self):
        super().__init__(['done'])
        self.begun = threading.Semaphore(0)
        self.release = threading.Event()
        self.runs = 0

    def execute(self, ud):
        self.runs += 1
        self.begun.release()
        self.release.wait(60.0)
        return 'done'


@pytest.mark.parametrize('kind', ['sequential', 'concurrent'])
def test_a_container_that_ends_by_itself_while_an_interrupt_comes_is_not_repeated(kind):
    ending, charge = Ending(), Answer('done')
    inner = fsm.StateMachine(['done'])
    with inner:
        fsm.StateMachine.add('END', ending)
    if kind == 'sequential':
        root: fsm.StateMachine | fsm.Concurrence = fsm.StateMachine(['done'])
        root.add_state('INNER', inner)
    else:
        root = fsm.Concurrence(['done'], 'done')
        root.add_state('INNER', inner)
    root.add_interrupt('CHARGE', charge, priority=1)
    run = Background(root)
    began(ending)
    root.raise_interrupt('CHARGE')
    ending.release.set()
    assert run.result() == 'done'
    assert ending.runs == 1


# What callbacks return.


@pytest.mark.parametrize('nonsense', [['NIX'], [3], [['S0']], 'NIX'])
def test_a_termination_callback_that_returns_nonsense_is_named(nonsense):
    root = together(Answer('done'), Waiter(), child_termination_cb=lambda ends: nonsense)
    with pytest.raises(fsm.InvalidUserCodeError, match="child_termination_cb of 'Concurrence'"):
        root.execute()


def test_what_is_no_list_is_taken_for_its_truth_as_in_smach():
    root = together(Answer('done'), Waiter(), child_termination_cb=lambda ends: 7)
    assert root.execute() == 'preempted'


def test_an_outcome_callback_that_returns_what_cannot_be_hashed_is_named():
    root = together(Answer('done'), outcome_cb=lambda ends: ['done'])
    with pytest.raises(fsm.InvalidTransitionError, match='outcome_cb'):
        root.execute()


def test_an_empty_concurrence_is_an_invalid_state():
    with pytest.raises(fsm.InvalidStateError, match='no states'):
        fsm.Concurrence(['done'], 'done').execute()


def waiting_with_an_interrupt(**arguments):
    """Two that wait, and one that cuts in and waits, too; all on a clock turned by hand."""
    first, second, stop = Waiter(), Waiter(), Waiter()
    concurrence = together(first, second, **arguments)
    concurrence.set_clock(clock := FakeClock())
    concurrence.add_interrupt('STOP', stop, priority=1)
    return concurrence, (first, second), stop, clock


def test_a_checkpoint_taken_in_an_interrupt_goes_on_in_it():
    concurrence, states, stop, clock = waiting_with_an_interrupt(**ALL_DONE)
    saved = []
    concurrence.register_transition_cb(lambda ud, active: saved.append(through_json(concurrence)))
    run = Background(concurrence)
    for state in states:
        began(state)
    concurrence.raise_interrupt('STOP')
    began(stop)
    in_interrupt = saved[-1]
    assert concurrence.get_active_states() == ['STOP']
    concurrence.request_preempt()
    assert run.result() == 'preempted'
    concurrence, states, stop, clock = waiting_with_an_interrupt(**ALL_DONE)
    checkpoint.restore(concurrence, in_interrupt)
    run = Background(concurrence)
    began(stop)
    assert [state.runs for state in states] == [0, 0]
    clock.until_sleeping(1)
    clock.advance(10.0)
    clock.until_sleeping(2)
    clock.advance(10.0)
    assert run.result() == 'done'
    assert stop.runs == 1


def test_a_checkpoint_that_is_in_one_of_the_states_is_damaged():
    concurrence, _, _, _ = waiting_with_an_interrupt()
    saved = through_json(concurrence)
    saved['states'][0]['at'] = {'current': 'S0'}
    with pytest.raises(fsm.CheckpointError, match="no state 'S0' to resume in"):
        checkpoint.restore(concurrence, saved)


def test_a_paused_machine_starts_no_state_of_a_concurrence():
    concurrence, states, _, clock = waiting_with_an_interrupt(**ALL_DONE)
    concurrence.control.pause()
    stands = threading.Event()
    concurrence.control.add_trace(lambda _: stands.set())
    run = Background(concurrence)
    assert stands.wait(60.0)
    with concurrence.control.condition:
        assert [state.runs for state in states] == [0, 0]
    concurrence.control.step()
    clock.until_sleeping(2)
    clock.advance(10.0)
    assert run.result() == 'done'


def test_an_interrupt_cannot_lead_to_one_of_the_states_that_run_together():
    concurrence, _, _, _ = waiting_with_an_interrupt()
    concurrence.add_interrupt('ASTRAY', Answer('done'), transitions={'done': 'S0'})
    with pytest.raises(fsm.InvalidTransitionError, match="leads to 'S0'"):
        concurrence.execute()


def test_a_state_that_the_first_end_stopped_is_not_resumed_after_an_interrupt():
    gate, waiter, stop = Waiter(1.0), Waiter(1000.0), Answer('done')
    concurrence = together(gate, waiter, child_termination_cb=lambda ends: True)
    concurrence.set_clock(clock := FakeClock())
    concurrence.add_interrupt('STOP', stop)
    ended = threading.Event()
    waiter.service_preempt = lambda: (ended.wait(60.0), fsm.State.service_preempt(waiter))  # type: ignore[assignment]
    run = Background(concurrence)
    began(waiter)
    clock.until_sleeping(2)
    clock.advance(1.0)
    # The first has ended, and the second was asked to stop; before it says so, the interrupt comes.
    while not waiter.preempt_requested():
        ended.wait(0.0)
    concurrence.raise_interrupt('STOP')
    ended.set()
    assert run.result(60.0) == 'preempted'
    assert waiter.runs == 1


def test_a_state_that_served_the_stop_is_not_stopped_again_when_another_one_ends():
    first, work, clean, last, slow = Waiter(1.0), Waiter(), Waiter(5.0), Waiter(), Waiter()
    cleaning, alone = threading.Event(), threading.Event()
    slow.service_preempt = lambda: (cleaning.wait(60.0), fsm.State.service_preempt(slow))  # type: ignore[assignment]
    machine = fsm.StateMachine(['done', 'preempted'])
    with machine:
        fsm.StateMachine.add('WORK', work, {'preempted': 'CLEAN'})
        fsm.StateMachine.add('CLEAN', clean)
    root = together(
        machine,
        first,
        slow,
        last,
        outcome_map={'done': {'S0': 'done'}},
        child_termination_cb=lambda ends: ['S0', 'S3'] if ends['S2'] else ['S0', 'S2'],
    )
    root.set_clock(clock := FakeClock())
    root.register_transition_cb(lambda ud, active: alone.set() if active == ['S0'] else None)
    run = Background(root)
    clock.until_sleeping(4)
    clock.advance(1.0)
    began(clean)
    cleaning.set()
    assert alone.wait(60.0)
    clock.until_sleeping(1)
    clock.advance(5.0)
    assert run.result(60.0) == 'done'


def test_what_an_end_was_to_stop_is_stopped_after_a_checkpoint_too():
    def build():
        slow = Waiter(1000.0)
        return together(Answer('done'), slow, child_termination_cb=lambda ends: True), slow

    checkpoints = []
    concurrence, _ = build()

    def ended(ud, active):
        if active == ['S1']:
            checkpoints.append(through_json(concurrence))

    concurrence.register_transition_cb(ended)
    concurrence.execute()
    again, slow = build()
    checkpoint.restore(again, checkpoints[0])
    assert Background(again).result(60.0) == 'preempted'
    assert slow.runs == 1


@pytest.mark.parametrize('callback', ['outcome_cb', 'child_termination_cb'])
def test_a_callback_that_does_not_return_does_not_keep_a_preempt_away(callback):
    begun, release = threading.Event(), threading.Event()

    def hang(ends):
        begun.set()
        release.wait(60.0)

    concurrence = together(Answer('done'), **{callback: hang})
    concurrence.preempt_timeout = 0.2
    run = Background(concurrence)
    assert begun.wait(60.0)
    assert concurrence.control.active_paths() == []
    concurrence.request_preempt()
    assert run.result(60.0) == 'preempted'
    release.set()
