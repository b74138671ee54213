"""Transitions that wait for a person."""

from __future__ import annotations

import threading

import pytest

import state_machines as fsm
from state_machines import Approval, Autonomy
from state_machines.program import unfold
from state_machines.testing import FakeClock, watching

from .states import Answer, Background, Waiter, began


class Asked:
    """A machine whose first transition needs a level, and what waits when it asks."""

    def __init__(self, need=Autonomy.HIGH, state=None, outcomes=('done', 'preempted')):
        self.first = state or Answer('go', outcomes=['go', 'back'])
        self.last = Answer('done')
        self.machine = fsm.StateMachine(outcomes)
        self.machine.set_name('ROOT')
        self.machine.add_state(
            'FIRST', self.first, {'go': 'LAST', 'back': 'done'}, autonomy={'go': need}
        )
        self.machine.add_state('LAST', self.last)
        self.control = self.machine.control
        self._asked = threading.Semaphore(0)
        self.control.add_trace(self._saw)
        self.control.set_autonomy(Autonomy.LOW)

    def _saw(self, raw):
        if unfold(raw).kind == 'question' and self.control.questions():
            self._asked.release()

    def run_to_question(self):
        run = Background(self.machine)
        assert self._asked.acquire(timeout=60.0)
        return run


def test_a_machine_of_full_autonomy_asks_nobody():
    asked = Asked()
    asked.control.set_autonomy(Autonomy.FULL)
    assert asked.machine.execute() == 'done'
    asked.control.set_autonomy(Autonomy.HIGH)
    assert asked.machine.execute() == 'done'
    assert asked.last.runs == 2


def test_a_transition_above_the_level_waits_for_a_person():
    asked = Asked()
    run = asked.run_to_question()
    (question,) = asked.control.questions()
    assert (question.path, question.outcome, question.target) == ('ROOT/FIRST', 'go', 'LAST')
    assert asked.control.active_paths() == ['ROOT/FIRST']
    with watching(asked.machine) as watched:
        asked.control.approve('ROOT/FIRST')
        assert run.result() == 'done'
    assert watched.transitions[0] == ('ROOT', 'FIRST', 'go', 'LAST')
    assert asked.control.questions() == []


def test_a_person_may_choose_another_outcome():
    asked = Asked()
    run = asked.run_to_question()
    with pytest.raises(fsm.InvalidTransitionError, match="no outcome 'nix' to go on with"):
        asked.control.approve('ROOT/FIRST', 'nix')
    with pytest.raises(fsm.InvalidStateError, match=r"'ROOT/LAST' waits.*\['ROOT/FIRST'\]"):
        asked.control.approve('ROOT/LAST')
    asked.control.approve(outcome='back')
    assert run.result() == 'done'
    assert asked.last.runs == 0


def test_a_higher_level_answers():
    asked = Asked()
    run = asked.run_to_question()
    asked.control.set_autonomy(Autonomy.FULL)
    assert run.result() == 'done'
    assert asked.last.runs == 1


@pytest.mark.parametrize('otherwise', ['go', 'back'])
def test_when_nobody_answers_the_given_outcome_counts(otherwise, caplog):
    clock = FakeClock()
    asked = Asked(Approval(Autonomy.HIGH, timeout=30.0, otherwise=otherwise))
    asked.machine.set_clock(clock)
    run = asked.run_to_question()
    clock.until_sleeping()
    clock.advance(30.0)
    assert run.result() == 'done'
    assert asked.last.runs == (otherwise == 'go')
    assert 'nobody answered for 30 s' in caplog.text


def test_a_preempt_ends_the_wait_and_the_transition_is_not_made():
    asked = Asked()
    run = asked.run_to_question()
    asked.machine.request_preempt()
    assert run.result() == 'preempted'
    assert asked.last.runs == 0
    assert not asked.machine.preempt_requested()


def test_without_an_outcome_for_it_a_preempt_goes_to_the_next_state():
    asked = Asked(outcomes=['done'])
    run = asked.run_to_question()
    asked.machine.request_preempt()
    assert run.result() == 'done'
    assert asked.last.runs == 1


def test_an_interrupt_puts_the_question_off_and_the_state_is_not_run_again():
    asked, alarm = Asked(), Answer('over')
    asked.machine.add_interrupt('ALARM', alarm)
    run = asked.run_to_question()
    asked.machine.raise_interrupt('ALARM')
    assert asked._asked.acquire(timeout=60.0)
    assert alarm.runs == 1
    asked.control.approve()
    assert run.result() == 'done'
    assert (asked.first.runs, asked.last.runs) == (1, 1)


def test_a_forced_outcome_answers():
    asked = Asked()
    run = asked.run_to_question()
    asked.control.force_outcome('ROOT/FIRST', 'back')
    assert run.result() == 'done'
    assert asked.last.runs == 0


def test_a_whole_machine_inside_may_need_approval():
    inner = fsm.StateMachine(['go', 'back'])
    inner.add_state('WORK', work := Answer('go', outcomes=['go', 'back']))
    asked = Asked(state=inner)
    asked.machine.add_interrupt('ALARM', Answer('over'))
    run = asked.run_to_question()
    asked.machine.raise_interrupt('ALARM')
    assert asked._asked.acquire(timeout=60.0)
    asked.machine.request_preempt()
    assert run.result() == 'preempted'
    assert work.runs == 1
    run = asked.run_to_question()
    asked.control.approve()
    assert run.result() == 'done'


def test_what_waits_in_a_machine_inside_is_put_aside_with_it():
    asked, alarm = Asked(), Waiter(1000.0)
    root = fsm.StateMachine(['done', 'preempted'])
    root.add_state('INNER', asked.machine)
    root.add_interrupt('ALARM', alarm)
    root.control.add_trace(asked._saw)
    asked.control = root.control
    root.control.set_autonomy(Autonomy.OFF)
    asked.machine, inner = root, asked.machine
    run = asked.run_to_question()
    root.raise_interrupt('ALARM')
    began(alarm)
    assert root.control.questions() == []
    assert not inner.is_running()
    root.request_preempt()
    assert run.result() == 'preempted'


@pytest.mark.parametrize(
    ('need', 'words'),
    [
        ({'nix': 1}, "'nix' is given, but its outcomes are"),
        ({'go': 7}, r'expected one of 0 \(OFF\), 1 \(LOW\)'),
        ({'go': Approval(2, timeout=-1.0, otherwise='back')}, 'expected seconds above 0'),
        ({'go': Approval(2, timeout=1.0)}, "after which '' counts: expected one of"),
    ],
)
def test_a_wrong_need_is_refused(need, words):
    machine = fsm.StateMachine(['done'])
    with pytest.raises(fsm.InvalidTransitionError, match=words):
        machine.add_state('S', Answer('go', outcomes=['go', 'back']), autonomy=need)
    with pytest.raises(fsm.InvalidTransitionError, match="The autonomy of 'StateMachine' is 9"):
        machine.control.set_autonomy(9)
