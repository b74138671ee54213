"""What a person is told: the lines of the log in full, and the words of errors."""

from __future__ import annotations

import re
import threading

import pytest

import state_machines as fsm
from state_machines import exceptions
from state_machines.testing import FakeClock, watching

from .states import Answer, Background, Deaf, Waiter, began


@pytest.fixture
def lines():
    found = []

    def at(level):
        return lambda message: found.append(f'{level} {message}')

    fsm.set_loggers(at('info'), at('warn'), at('debug'), at('error'))
    yield found
    fsm.reset_loggers()


def nested(inner_state, alarm):
    """ROOT has INNER, which has FIRST and SECOND; ALARM interrupts."""
    root, inner = (fsm.StateMachine(['done', 'preempted'], ['k'], ['k']) for _ in range(2))
    root.set_name('ROOT')
    with root:
        fsm.StateMachine.add('INNER', inner)
        with inner:
            fsm.StateMachine.add('FIRST', Answer('done'), {'done': 'SECOND'})
            fsm.StateMachine.add('SECOND', inner_state)
    root.add_interrupt('ALARM', alarm)
    return root


def test_the_log_says_each_step_of_a_machine_and_of_those_inside(lines):
    waiter = Waiter(60.0)
    root = nested(waiter, Answer('done'))
    root.userdata.k = 1
    run = Background(root)
    began(waiter)
    root.raise_interrupt('ALARM')
    began(waiter)
    root.control.force_outcome('ROOT/INNER/SECOND', 'done')
    assert run.result() == 'done'
    assert lines == [
        "info 'ROOT' starts in 'INNER' with userdata ['k']",
        "info 'ROOT/INNER' starts in 'FIRST' with userdata ['k']",
        "info 'ROOT/INNER' goes on: 'FIRST' : 'done' --> 'SECOND'",
        "info 'ROOT' goes on: 'INNER' : 'SUSPENDED' --> 'ALARM'",
        "info 'ROOT' goes on: 'ALARM' : 'done' --> 'INNER'",
        "info 'ROOT/INNER' goes on in 'SECOND' with userdata ['k']",
        "info 'ROOT/INNER' ends: 'SECOND' : 'done' --> 'done'",
        "info 'ROOT' ends: 'INNER' : 'done' --> 'done'",
    ]


def test_the_log_names_keys_that_nobody_set(lines):
    root = nested(Answer('done'), Answer('done'))
    assert root.execute() == 'done'
    assert [line for line in lines if line.startswith('warn')] == [
        "warn 'ROOT/INNER' starts without its input key 'k': nobody set it",
        "warn 'ROOT/INNER' ends without its output key 'k': nobody set it",
    ]
    lines.clear()
    assert root.execute(fsm.UserData()) == 'done'
    assert [line for line in lines if line.startswith('warn')] == [
        "warn 'ROOT' starts without its input key 'k': nobody set it",
        "warn 'ROOT/INNER' starts without its input key 'k': nobody set it",
        "warn 'ROOT/INNER' ends without its output key 'k': nobody set it",
        "warn 'ROOT' ends without its output key 'k': nobody set it",
    ]


def test_the_log_says_the_ends_of_states_that_run_together(lines):
    both = fsm.Concurrence(['done', 'preempted'], 'done')
    both.set_name('BOTH')
    both.add_state('A', Answer('x'))
    assert both.execute() == 'done'
    assert lines == [
        "info 'BOTH' starts in 'A' with userdata []",
        "info 'BOTH': 'A' ended with 'x'",
    ]


def test_the_log_says_attempts_and_what_ran_out_of_time(lines):
    clock, waiter = FakeClock(), Waiter(100.0)
    machine = fsm.StateMachine(['late'])
    machine.set_name('ROOT')
    machine.set_clock(clock)
    bound = dict.fromkeys(['done', 'preempted', 'timeout'], 'late')
    machine.add_state('WAIT', waiter, bound, timeout=1.5, retry=1)
    run = Background(machine)
    for _ in range(2):
        clock.until_sleeping(2)
        began(waiter)
        clock.advance(1.5)
    assert run.result() == 'late'
    assert [line for line in lines if line.startswith('warn')] == [
        "warn State 'ROOT/WAIT' was stopped after its timeout of 1.5 s",
        "warn State 'ROOT/WAIT' ended with 'timeout': attempt 2 of 2",
        "warn State 'ROOT/WAIT' was stopped after its timeout of 1.5 s",
    ]


def test_the_four_levels_go_to_their_loggers(lines):
    fsm.loginfo(1)
    fsm.logwarn('w')
    fsm.logdebug('d')
    fsm.logerr('e')
    assert lines == ['info 1', 'warn w', 'debug d', 'error e']


@pytest.mark.parametrize(
    ('expected', 'end'),
    [
        (('B', 'C'), 'took A -> B -> C; expected B -> C; they agree in the first 0'),
        (('A',), 'took A -> B -> C; expected A; they agree in the first 1'),
        (('A', 'C', 'C'), 'took A -> B -> C; expected A -> C -> C; they agree in the first 1'),
        ((), 'took A -> B -> C; expected no state; they agree in the first 0'),
        (('A', 'B', 'C', 'D'), 'expected A -> B -> C -> D; they agree in the first 3'),
    ],
)
def test_a_path_that_was_not_taken_is_shown_beside_the_expected_one(expected, end):
    machine = fsm.StateMachine(['done'])
    machine.set_name('ROOT')
    for label, target in ('AB', 'BC', 'C '):
        machine.add_state(label, Answer('done'), {'done': target} if target > ' ' else {})
    with watching(machine) as watched:
        assert machine.execute() == 'done'
    watched.assert_path('A', 'B', 'C')
    with pytest.raises(AssertionError) as caught:
        watched.assert_path(*expected)
    assert str(caught.value).startswith("'ROOT' took A -> B -> C; expected ")
    assert str(caught.value).endswith(end)
    with pytest.raises(AssertionError, match=r"^'ROOT/X' took no state; expected A; they agree in"):
        watched.assert_path('A', container='ROOT/X')


def test_what_was_never_taken_is_told_in_order():
    machine = fsm.StateMachine(['a', 'b'])
    machine.set_name('ROOT')
    machine.add_state('S', Answer('a', outcomes=['a', 'b', 'c']), {'c': 'S'})
    with watching(machine) as watched:
        assert watched.coverage() == 0.0
        machine.execute()
    assert sorted(watched.untaken()) == [('ROOT', 'S', 'b'), ('ROOT', 'S', 'c')]
    assert watched.coverage() == pytest.approx(1 / 3)
    with pytest.raises(AssertionError, match=r"^never taken: ROOT/S : 'b', ROOT/S : 'c'$"):
        watched.assert_covered()
    with pytest.raises(AssertionError, match=r"^never taken: ROOT/S : 'b'$"):
        watched.assert_covered(except_for=[('ROOT', 'S', 'c')])
    watched.assert_covered(except_for=watched.untaken())


def test_a_fake_clock_says_how_many_threads_sleep_on_it():
    clock, flag = FakeClock(), fsm.Interrupt()
    with pytest.raises(AssertionError, match=r'^0 threads sleep after 0.01 s, not 1$'):
        clock.until_sleeping(timeout=0.01)
    slept = []
    thread = threading.Thread(target=lambda: slept.append(clock.sleep(2.0, flag)))
    thread.start()
    clock.until_sleeping()
    clock.advance(1.5)
    clock.until_sleeping()
    clock.advance(0.5)
    # It may not have woken yet; asleep it is no more.
    with pytest.raises(AssertionError, match=r'^0 threads'):
        clock.until_sleeping(timeout=0.01)
    thread.join(60.0)
    flag.set()
    assert slept == [True]
    assert clock.sleep(2.0, flag) is False
    assert clock.now() == 2.0
    leaping = FakeClock(leaps=True)
    assert leaping.sleep(2.5, fsm.Interrupt())
    assert not leaping.sleep(2.5, flag)
    assert leaping.now() == 2.5


def test_an_error_whose_message_cannot_be_shown_has_a_line():
    class UnspeakableError(Exception):
        def __str__(self):
            raise OSError

    assert exceptions.describe(UnspeakableError()) == (
        'UnspeakableError: its message cannot be shown (OSError)'
    )
    assert exceptions.describe(ValueError('v')) == 'ValueError: v'
    assert exceptions.describe(ValueError()) == 'ValueError'
    assert exceptions.describe(fsm.InvalidStateError('s')) == 's'


def test_a_name_that_is_not_known_comes_with_the_nearest():
    assert (
        exceptions.unknown('tome', ['time', '_tome']) == "'tome' is not known; did you mean 'time'?"
    )
    known = [f'k{number:02}' for number in range(21)]
    told = exceptions.unknown('x', known)
    assert told == f"'x' is not known; known are {known[:20]}"


@pytest.mark.parametrize('name', ['', None, 7])
def test_a_root_has_a_name(name):
    machine = fsm.StateMachine(['done'])
    with pytest.raises(fsm.InvalidStateError) as caught:
        machine.set_name(name)
    assert str(caught.value) == f'Name {name!r} must be a string that is not empty'


@pytest.mark.parametrize('seconds', [0, -1.0, float('nan')])
def test_a_bound_of_preempts_is_above_zero(seconds):
    machine = fsm.StateMachine(['done'])
    machine.preempt_timeout = 1e-9
    with pytest.raises(fsm.InvalidStateError, match=r'expected seconds above 0 or None$'):
        machine.preempt_timeout = seconds
    assert machine.preempt_timeout == 1e-9


def test_a_state_that_is_not_there_is_named_with_those_that_are():
    both = fsm.Concurrence(['done'], 'done')
    both.set_name('BOTH')
    for label in ('B', 'A'):
        both.add_state(label, Answer('done'))
    with pytest.raises(
        KeyError, match=re.escape("'BOTH' has no state 'C': its states are ['A', 'B']")
    ):
        both.set_initial_state(['A', 'C'])
    given = fsm.UserData()
    given.x = 1
    both.set_initial_state([], given)
    assert both.userdata.x == 1
    with pytest.raises(
        fsm.InvalidConstructionError, match=r"^'BOTH' is not open for construction$"
    ):
        both.assert_opened()
    with both:
        both.assert_opened('words')
    with pytest.raises(fsm.InvalidConstructionError, match=r'^words$'):
        both.assert_opened('words')


def test_a_step_and_a_force_say_why_they_cannot_be():
    waiter = Waiter(60.0)
    root = nested(waiter, Answer('done'))
    control = root.control
    with pytest.raises(fsm.InvalidStateError, match=r"^'ROOT' cannot step: it is not running$"):
        control.step()
    run = Background(root)
    began(waiter)
    with pytest.raises(fsm.InvalidStateError, match=r"^'ROOT' cannot step: it is not paused$"):
        control.step()
    active = ['ROOT/INNER', 'ROOT/INNER/SECOND']
    assert control.active_paths() == active
    with pytest.raises(fsm.InvalidStateError) as caught:
        control.force_outcome('ROOT/FIRST', 'done')
    assert str(caught.value) == f"State 'ROOT/FIRST' is not active; the active ones are {active}"
    with pytest.raises(fsm.InvalidTransitionError) as wrong:
        control.force_outcome('ROOT/INNER/SECOND', 'nix')
    assert str(wrong.value) == (
        "State 'ROOT/INNER/SECOND' cannot be forced to 'nix': its outcomes are "
        "['done', 'preempted']"
    )
    root.request_preempt()
    assert run.result() == 'preempted'
    assert control.active_paths() == []
    with pytest.raises(
        fsm.InvalidStateError, match=re.escape("has no interrupt 'X': its interrupts are ['ALARM']")
    ):
        root.raise_interrupt('X')


def test_who_did_not_acknowledge_a_preempt_is_told(lines):
    def both_of(**children):
        both = fsm.Concurrence(['done', 'preempted'], 'done')
        both.set_name('BOTH')
        for label, state in children.items():
            both.add_state(label, state)
        return both

    waiter, deaf = Waiter(60.0), Deaf()
    both = both_of(HEEDS=waiter, IGNORES=deaf)
    both.userdata.key = 1
    run = Background(both)
    began(waiter)
    began(deaf)
    both.request_preempt()
    deaf.release.set()
    assert run.result() == 'preempted'
    told = [line for line in lines if 'acknowledge' in line]
    assert told == ["warn 'BOTH': ['IGNORES'] did not acknowledge the preempt"]
    lines.clear()
    assert both_of(A=Answer('done')).execute() == 'done'
    assert not [line for line in lines if 'acknowledge' in line]


@pytest.mark.parametrize(
    ('loop', 'breaking', 'told'),
    [(['done'], ['again'], True), (['done'], [], False), ([], ['again'], False)],
)
def test_an_iterator_says_which_of_its_outcomes_count(lines, loop, breaking, told):
    each = fsm.Iterator(['all', 'again'], [], [], it=[1], it_label='k', exhausted_outcome='all')
    each.set_name('EACH')
    each.set_state('DO', Answer('done', 'again'), loop, breaking)
    expected = "warn Iterator 'EACH' has loop and break outcomes: the latter count"
    assert lines == [expected] * told


def test_a_machine_inside_is_tried_again(lines):
    """It begins anew, and what comes after it is reached."""
    first = Answer('aborted', 'done')
    inner = fsm.StateMachine(['done', 'aborted'])
    inner.add_state('FIRST', first)
    last = Answer('done')
    root = fsm.StateMachine(['done', 'aborted'])
    root.set_name('ROOT')
    root.add_state('INNER', inner, {'done': 'LAST'}, retry=1)
    root.add_state('LAST', last)
    assert root.execute() == 'done'
    assert (first.runs, last.runs) == (2, 1)
    assert "warn State 'ROOT/INNER' ended with 'aborted': attempt 2 of 2" in lines
