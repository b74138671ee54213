"""A patrol of three rooms: drawn, checked, run, stopped in its deepest state, and gone on with.

python -m state_machines.demo

It prints each transition as it happens. Nothing of it needs ROS.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import state_machines as fsm
from state_machines.checkpoint import load, save
from state_machines.export import to_ascii, to_mermaid
from state_machines.transitions import Transition, TransitionFeed
from state_machines.verify import verify

ROOMS = ['kitchen', 'office', 'hall']
LOOK_SECONDS = 0.3


class Choose(fsm.State):
    """Takes the next room from the list."""

    def __init__(self) -> None:
        super().__init__(['chosen', 'finished'], io_keys=['rooms'], output_keys=['room'])

    def execute(self, ud: fsm.UserData) -> str:
        if not ud.rooms:
            return 'finished'
        ud.room, *ud.rooms = ud.rooms
        return 'chosen'


class LookAround(fsm.State):
    """Takes a while; a preempt ends it at once."""

    def __init__(self) -> None:
        super().__init__(['seen', 'preempted'], input_keys=['room'])

    def execute(self, ud: fsm.UserData) -> str:
        if not self.wait(LOOK_SECONDS):
            self.service_preempt()
            return 'preempted'
        return 'seen'


class WatchBattery(fsm.State):
    """Runs beside the look until that has ended."""

    def __init__(self) -> None:
        super().__init__(['preempted'])

    def execute(self, ud: fsm.UserData) -> str:
        self.wait(60.0)
        self.service_preempt()
        return 'preempted'


def patrol(after_choice: str = 'INSPECT') -> fsm.StateMachine:
    """Return the machine: rooms one after the other, in each a look with an eye on the battery."""
    machine = fsm.StateMachine(['finished', 'preempted'])
    machine.set_name('PATROL')
    machine.userdata.rooms = list(ROOMS)
    inspect = fsm.Concurrence(
        ['seen', 'preempted'],
        'preempted',
        input_keys=['room'],
        outcome_map={'seen': {'LOOK_AROUND': 'seen'}},
        child_termination_cb=lambda ends: ends['LOOK_AROUND'] is not None,
    )
    with machine:
        fsm.StateMachine.add('CHOOSE', Choose(), {'chosen': after_choice})
        fsm.StateMachine.add('INSPECT', inspect, {'seen': 'CHOOSE'})
        with inspect:
            fsm.Concurrence.add('LOOK_AROUND', LookAround())
            fsm.Concurrence.add('WATCH_BATTERY', WatchBattery())
    return machine


def tell(step: Transition) -> None:
    """Print one transition."""
    room = f'   room: {step.userdata["room"]}' if step.to_state == 'INSPECT' else ''
    goes = f'-> {step.to_state}' if step.to_state else 'and ends'  # within a concurrence
    print(f'  {step.sequence:2}  {step.path:15} {step.from_state}: {step.outcome} {goes}{room}')


def told(machine: fsm.StateMachine) -> str:
    """Run a machine, print its transitions, return its outcome."""
    feed = TransitionFeed(machine, tell)
    try:
        return str(machine.execute())
    finally:
        feed.close()


def main() -> None:
    """Draw, check, run, preempt, and go on from a checkpoint."""
    machine = patrol()
    print(to_ascii(machine))
    print('The same for a README or a wiki, in Mermaid:\n')
    print(to_mermaid(machine))

    print('Checked before it runs, with a name mistyped:')
    for finding in verify(patrol(after_choice='INSPCET')):
        print(f'  {finding}')

    print('\nIt runs:')
    print(f'ended with {told(machine)}')

    print('\nIt is preempted while it looks around, and keeps where it is:')
    machine = patrol()
    looking, ends = threading.Event(), list[tuple[str, float]]()
    machine.register_transition_cb(lambda *_: looking.set())

    def run() -> None:
        outcome = told(machine)
        ends.append((outcome, time.perf_counter()))

    thread = threading.Thread(target=run)
    thread.start()
    looking.wait()
    with TemporaryDirectory() as folder:
        kept = Path(folder) / 'patrol.json'
        save(machine, kept)
        asked = time.perf_counter()
        machine.request_preempt()
        thread.join()
        ((outcome, at),) = ends
        print(f'ended with {outcome}, {1000.0 * (at - asked):.1f} ms after it was asked to')

        print('\nAnother machine, as in another process, goes on from there:')
        again = patrol()
        load(again, kept)
        print(f'ended with {told(again)}')


if __name__ == '__main__':
    main()
