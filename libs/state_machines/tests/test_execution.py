"""A forced outcome is taken, whatever else is asked in the same instant, and every step is told."""

from __future__ import annotations

import threading

import pytest

import state_machines as fsm
from state_machines.execution import Control
from state_machines.testing import FakeClock, watching
from state_machines.transitions import TransitionFeed

from .states import Answer, Background, Waiter, began


class Gate(fsm.State):
    """Ends when it is let through, whatever is asked of it."""

    def __init__(self, outcome: str = 'done') -> None:
        super().__init__(['done', 'preempted'])
        self.outcome = outcome
        self.begun = threading.Semaphore(0)
        self.open = threading.Event()

    def execute(self, ud):
        self.begun.release()
        self.open.wait(60.0)
        return self.outcome


class Line:
    """GATE leads to WAIT, that to LAST; ALARM interrupts. Transitions wait for the condition."""

    def __init__(self, gate_outcome: str = 'done') -> None:
        self.gate, self.wait, self.last = Gate(gate_outcome), Waiter(60.0), Answer('done')
        self.alarm = Answer('done')
        self.root = fsm.StateMachine(['done', 'preempted'])
        self.root.set_name('ROOT')
        with self.root:
            fsm.StateMachine.add('GATE', self.gate, {'done': 'WAIT', 'preempted': 'WAIT'})
            fsm.StateMachine.add('WAIT', self.wait, {'done': 'LAST', 'preempted': 'preempted'})
            fsm.StateMachine.add('LAST', self.last)
        self.root.add_interrupt('ALARM', self.alarm, priority=1)
        self.condition = self.root.control.condition

    def pass_the_gate(self) -> None:
        """Let the machine out of GATE; under the condition it stops right before WAIT."""
        self.gate.open.set()
        for _ in range(10_000_000):
            if self.root.get_active_states() == ['WAIT']:
                return
        raise AssertionError('it did not leave GATE')


@pytest.fixture
def line():
    return Line()


def test_a_state_forced_before_it_begins_and_an_interrupt_in_the_same_instant(line):
    with watching(line.root) as watched:
        run = Background(line.root)
        began(line.gate)
        with line.condition:
            line.root.control.pause()
            line.root.control.resume()
            line.pass_the_gate()
            line.root.raise_interrupt('ALARM')
            line.root.control.force_outcome('ROOT/WAIT', 'done')
        assert run.result() == 'done'
    watched.assert_path('GATE', 'WAIT', 'ALARM', 'LAST')
    assert (line.wait.runs, line.alarm.runs, line.last.runs) == (0, 1, 1)


def test_a_state_that_made_way_for_an_interrupt_is_left_when_the_next_one_is_forced():
    line = Line('preempted')
    with watching(line.root) as watched:
        run = Background(line.root)
        began(line.gate)
        with line.condition:
            line.root.raise_interrupt('ALARM')
            line.pass_the_gate()
            line.root.control.force_outcome('ROOT/WAIT', 'done')
        assert run.result() == 'done'
    watched.assert_path('GATE', 'WAIT', 'ALARM', 'LAST')


def test_a_running_state_that_is_forced_and_interrupted_is_not_resumed(line):
    line.gate.open.set()
    with watching(line.root) as watched:
        run = Background(line.root)
        began(line.wait)
        with line.condition:
            line.root.control.force_outcome('ROOT/WAIT', 'done')
            line.root.raise_interrupt('ALARM')
        assert run.result() == 'done'
    watched.assert_path('GATE', 'WAIT', 'ALARM', 'LAST')
    assert line.wait.runs == 1


def test_a_preempt_in_the_same_instant_is_not_lost(line):
    line.last = Waiter(60.0)
    root = fsm.StateMachine(['done', 'preempted'])
    root.set_name('ROOT')
    with root:
        fsm.StateMachine.add('WAIT', line.wait, {'done': 'LAST', 'preempted': 'preempted'})
        fsm.StateMachine.add('LAST', line.last)
    run = Background(root)
    began(line.wait)
    with root.control.condition:
        root.control.force_outcome('ROOT/WAIT', 'done')
        root.request_preempt()
    assert run.result() == 'preempted'
    assert line.last.runs == 1


def test_a_state_forced_in_a_pause_is_told_to_have_been_entered(line):
    with watching(line.root) as watched:
        run = Background(line.root)
        began(line.gate)
        line.root.control.pause()
        line.pass_the_gate()
        line.root.control.force_outcome('ROOT/WAIT', 'done')
        line.root.control.resume()
        assert run.result() == 'done'
    watched.assert_path('GATE', 'WAIT', 'LAST')


def test_another_state_is_not_forced_before_the_first_has_ended(line):
    line.gate.outcome = 'preempted'
    run = Background(line.root)
    began(line.gate)
    with line.condition:
        line.root.control.force_outcome('ROOT/GATE', 'done')
        line.pass_the_gate()
        with pytest.raises(fsm.InvalidStateError, match="'GATE' has not ended with 'done'"):
            line.root.control.force_outcome('ROOT/WAIT', 'done')
    began(line.wait)
    line.root.request_preempt()
    assert run.result() == 'preempted'


@pytest.fixture
def together():
    both = fsm.Concurrence(['both', 'preempted'], 'preempted', outcome_map={'both': {'A': 'done'}})
    children = {'A': Waiter(60.0), 'B': Waiter(60.0)}
    with both:
        for label, state in children.items():
            fsm.Concurrence.add(label, state, retry=1, retry_on=['preempted'])
    both.set_name('BOTH')
    return both, children


def test_a_child_of_a_concurrence_is_active_and_can_be_forced(together):
    both, children = together
    run = Background(both)
    for state in children.values():
        began(state)
    assert both.control.active_paths() == ['BOTH/A', 'BOTH/B']
    both.control.force_outcome('BOTH/A', 'done')
    both.control.force_outcome('BOTH/B', 'preempted')
    assert run.result() == 'both'
    assert [state.runs for state in children.values()] == [1, 1]


def test_an_interrupt_of_a_concurrence_can_be_forced(together):
    both, children = together
    alarm = fsm.StateMachine(['over', 'on', 'preempted'])
    inside = Waiter(60.0)
    with alarm:
        fsm.StateMachine.add('INSIDE', inside, {'done': 'on'})
    both.register_outcomes(['over'])
    both.add_interrupt('ALARM', alarm, priority=1, transitions={'over': 'over'})
    run = Background(both)
    for state in children.values():
        began(state)
    both.raise_interrupt('ALARM')
    began(inside)
    both.control.force_outcome('BOTH/ALARM', 'over')
    assert run.result() == 'over'


def test_a_transition_is_told_although_the_machine_is_put_aside_in_that_instant():
    gate, last, alarm = Gate(), Waiter(60.0), Answer('done')
    inner, root = (fsm.StateMachine(['done', 'preempted']) for _ in range(2))
    root.set_name('ROOT')
    with root:
        fsm.StateMachine.add('INNER', inner)
        with inner:
            fsm.StateMachine.add('GATE', gate, {'done': 'LAST', 'preempted': 'preempted'})
            fsm.StateMachine.add('LAST', last)
    root.add_interrupt('ALARM', alarm, priority=1)
    with watching(root) as watched:
        run = Background(root)
        began(gate)
        root.raise_interrupt('ALARM')
        gate.open.set()  # it ignores that it shall make way
        began(last)
        root.control.force_outcome('ROOT/INNER/LAST', 'done')
        assert run.result() == 'done'
    watched.assert_path('GATE', 'LAST', container='ROOT/INNER')
    assert watched.path() == ['INNER', 'ALARM', 'INNER']


# Pausing.


def test_a_paused_machine_tells_its_transition_at_once_and_counts_no_pause():
    clock = FakeClock()
    first, second = Waiter(3.0), Waiter(5.0)
    machine = fsm.StateMachine(['done', 'preempted'])
    machine.set_clock(clock)
    with machine:
        fsm.StateMachine.add('FIRST', first, {'done': 'SECOND'})
        fsm.StateMachine.add('SECOND', second)
    seen, told = [], threading.Semaphore(0)
    feed = TransitionFeed(machine, lambda t: (seen.append(t), told.release()))
    run = Background(machine)
    began(first)
    machine.control.pause()
    clock.until_sleeping()
    clock.advance(3.0)
    assert told.acquire(timeout=60.0)
    clock.advance(1000.0)
    machine.control.resume()
    began(second)
    clock.until_sleeping()
    clock.advance(5.0)
    assert run.result() == 'done'
    assert told.acquire(timeout=60.0)
    feed.close()
    assert [(t.from_state, t.to_state, t.duration) for t in seen] == [
        ('FIRST', 'SECOND', 3.0),
        ('SECOND', 'done', 5.0),
    ]
    assert seen[0].visits == seen[1].visits == 1


def test_an_interrupt_cuts_into_a_pause_and_leads_back():
    charge, waiter = Answer('done'), Waiter(0.0)
    machine = fsm.StateMachine(['done', 'preempted'])
    with machine:
        fsm.StateMachine.add('FIRST', Answer('done'), {'done': 'SECOND'})
        fsm.StateMachine.add('SECOND', waiter)
    machine.add_interrupt('CHARGE', charge, priority=1)
    told = threading.Semaphore(0)
    machine.register_transition_cb(lambda ud, active: told.release())
    machine.control.pause()
    run = Background(machine)
    machine.control.step()
    with watching(machine) as watched:
        assert told.acquire(timeout=60.0)
        machine.raise_interrupt('CHARGE')
        machine.control.resume()
        assert run.result() == 'done'
    assert charge.runs == 1
    assert watched.transitions[-1] == ('StateMachine', 'SECOND', 'done', 'done')


# Traces.


@pytest.mark.parametrize('others', [0, 1])
def test_a_trace_that_raises_does_not_end_the_machine(others, caplog):
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('FIRST', Answer('done'), {'done': 'SECOND'})
        fsm.StateMachine.add('SECOND', Answer('done'))

    def broken(raw):
        raise OSError('disk full')

    machine.control.add_trace(broken)
    seen = []
    for _ in range(others):
        machine.control.add_trace(seen.append)
    assert machine.execute() == 'done'
    assert 'disk full' in caplog.text
    assert len(seen) == 4 * others


def test_reports_may_end_in_the_moment_in_which_the_machine_ends(monkeypatch):
    control = fsm.StateMachine(['done']).control
    traces = [lambda raw: None]
    ends_when_it_was_read = property(lambda _: traces.pop() if traces else None)
    monkeypatch.setattr(Control, 'trace', ends_when_it_was_read, raising=False)
    control.fsm_end()


# Beginning and ending.


def test_a_machine_whose_execution_could_not_begin_runs_when_the_fault_is_gone(monkeypatch):
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('ONLY', Answer('done'))
    machine.set_clock(None)  # type: ignore[arg-type]
    with pytest.raises(AttributeError, match='now'):
        machine.execute()
    machine.set_clock(fsm.WallClock())

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr('state_machines.container.ExecutionThread', interrupted)
        with pytest.raises(KeyboardInterrupt):
            machine.execute()
    assert machine.execute() == 'done'
