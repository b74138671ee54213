"""The test kit: scripted outcomes, coverage, and a clock that is advanced by hand."""

from __future__ import annotations

import threading

import pytest

import state_machines as fsm
from state_machines.testing import FakeClock, script, watching

from .states import Answer


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


def test_scripted_outcomes_take_the_place_of_the_work():
    machine = patrol()
    script(machine, {'PATROL/CHOOSE': ['go', 'done'], 'PATROL/MOVE/PLAN': ['done']})
    with watching(machine) as watched:
        machine.execute()
    watched.assert_path('CHOOSE', 'MOVE', 'CHOOSE')
    watched.assert_path('PLAN', 'FOLLOW', container='PATROL/MOVE')
    with pytest.raises(AssertionError, match='they agree in the first 1'):
        watched.assert_path('CHOOSE', 'CHOOSE')
    assert watched.untaken() == [('PATROL', 'MOVE', 'preempted')]
    watched.assert_covered(except_for=watched.untaken())


def test_coverage_names_the_transitions_that_were_not_taken():
    machine = patrol()
    script(machine, {'PATROL/CHOOSE': ['done']})
    with watching(machine) as watched:
        machine.execute()
    assert ('PATROL', 'MOVE', 'preempted') in watched.untaken()
    with pytest.raises(AssertionError, match="PATROL/MOVE/PLAN : 'done'"):
        watched.assert_covered(except_for=[('PATROL', 'MOVE', 'preempted')])
    assert 0.0 < watched.coverage() < 0.5


@pytest.mark.parametrize(
    ('outcomes', 'error'),
    [
        ({'PATROL/NIX': ['done']}, KeyError),
        ({'OTHER/CHOOSE': ['done']}, KeyError),
        ({'PATROL/MOVE': ['done']}, fsm.InvalidStateError),
        ({'PATROL/CHOOSE': ['nix']}, fsm.InvalidTransitionError),
    ],
)
def test_a_script_is_held_to_the_machine(outcomes, error):
    with pytest.raises(error):
        script(patrol(), outcomes)


def test_a_script_that_runs_out_says_so():
    machine = patrol()
    script(machine, {'PATROL/CHOOSE': ['go']})
    with pytest.raises(fsm.InvalidUserCodeError, match='more often than it has scripted outcomes'):
        machine.execute()


def test_a_fake_clock_wakes_whom_it_should():
    clock, ends = FakeClock(), []
    stop = fsm.Interrupt()
    threads = [
        threading.Thread(target=lambda s=s: ends.append((s, clock.sleep(s, stop))))
        for s in (1.0, 2.0)
    ]
    for thread in threads:
        thread.start()
    clock.until_sleeping(2)
    clock.advance(1.5)
    threads[0].join(60.0)
    assert ends == [(1.0, True)]
    stop.set()
    threads[1].join(60.0)
    assert ends == [(1.0, True), (2.0, False)]
    with pytest.raises(AssertionError, match='0 threads sleep'):
        clock.until_sleeping(1, timeout=0.01)
