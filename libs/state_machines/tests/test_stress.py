"""Requests of all kinds at random instants, in many threads: no preempt is lost, nothing hangs."""

from __future__ import annotations

import os
import random
import sys
import threading
import time

import pytest

import state_machines as fsm
from state_machines import checkpoint

SECONDS = float(os.environ.get('FSM_STRESS_SECONDS', '1.5'))


class Quick(fsm.State):
    def __init__(self):
        super().__init__(['ok', 'preempted'])

    def execute(self, ud):
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        return 'ok'


class Nap(fsm.State):
    """Heeds preempts, but for one time in fifty."""

    def __init__(self, generator):
        super().__init__(['ok', 'preempted'])
        self._generator = generator

    def execute(self, ud):
        if self._generator.random() < 0.02:
            return 'ok'
        if self.wait(self._generator.random() * 2e-4):
            return 'ok'
        self.service_preempt()
        return 'preempted'


def build(generator):
    together = fsm.Concurrence(
        ['ok', 'preempted'], 'preempted', outcome_map={'ok': {'X': 'ok', 'Y': 'ok'}}
    )
    with together:
        fsm.Concurrence.add('X', Quick())
        fsm.Concurrence.add('Y', Nap(generator))
    inner = fsm.StateMachine(['ok', 'preempted'])
    with inner:
        fsm.StateMachine.add('A', Quick(), {'ok': 'C'})
        fsm.StateMachine.add('C', together, {'ok': 'B'})
        fsm.StateMachine.add('B', Nap(generator))
    root = fsm.StateMachine(['preempted'])
    with root:
        fsm.StateMachine.add('S0', Quick(), {'ok': 'S1'})
        fsm.StateMachine.add('S1', Nap(generator), {'ok': 'S2'})
        fsm.StateMachine.add('S2', inner, {'ok': 'S0'})
    root.add_interrupt('I', Quick(), priority=1)
    root.add_interrupt('J', Nap(generator), priority=2)
    inner.add_interrupt('K', Quick(), priority=1)
    together.add_interrupt('L', Quick(), priority=1)
    return root, inner, together


def force_the_deepest(root):
    for path in reversed(root.control.active_paths()):
        try:
            root.control.force_outcome(path, 'ok')
        except fsm.SmachError:
            continue  # It has just ended.
        return


def pause(root):
    root.control.pause()
    root.control.resume()


@pytest.mark.parametrize('seed', [1, 2])
def test_no_request_is_lost_whenever_it_comes(seed):
    generator = random.Random(seed)
    root, inner, together = build(random.Random(seed))
    deeds = [
        lambda: root.raise_interrupt('I'),
        lambda: root.raise_interrupt('J'),
        lambda: inner.raise_interrupt('K'),
        lambda: together.raise_interrupt('L'),
        lambda: pause(root),
        lambda: force_the_deepest(root),
        lambda: checkpoint.capture(root),
    ]
    switching, end = sys.getswitchinterval(), time.monotonic() + SECONDS / 2
    # Threads change places as often as they can.
    sys.setswitchinterval(1e-5)
    try:
        while time.monotonic() < end:
            outcomes = []
            thread = threading.Thread(target=lambda o=outcomes: o.append(root.execute()))
            thread.start()
            for _ in range(generator.randrange(6)):
                # Not a wait for anything: it only scatters the instants.
                time.sleep(generator.random() * 5e-4)
                generator.choice(deeds)()
            time.sleep(generator.random() * 1e-3)
            root.request_preempt()
            thread.join(60.0)
            assert not thread.is_alive(), f'lost; active: {root.control.active_paths()}'
            assert outcomes == ['preempted']
            root.recall_preempt()
    finally:
        sys.setswitchinterval(switching)
