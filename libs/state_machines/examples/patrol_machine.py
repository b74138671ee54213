"""Build a hierarchical state machine, check it, draw it, run it, stop it and copy it. No ROS."""

from __future__ import annotations

import threading

import state_machines as fsm
from state_machines.export import to_ascii
from state_machines.testing import watching
from state_machines.verify import verify


class Choose(fsm.State):
    """Takes the next room from the list."""

    def __init__(self) -> None:
        super().__init__(['chosen', 'finished'], io_keys=['rooms'], output_keys=['room'])

    def execute(self, ud: fsm.UserData) -> str:
        if not ud.rooms:
            return 'finished'
        ud.room, *ud.rooms = ud.rooms
        return 'chosen'


class Explore(fsm.State):
    """Looks around for a while, unless it is preempted."""

    def __init__(self, seconds: float) -> None:
        super().__init__(['explored', 'preempted'], input_keys=['place'])
        self.seconds = seconds

    def execute(self, ud: fsm.UserData) -> str:
        print('exploring', ud.place)
        if not self.wait(self.seconds):
            self.service_preempt()
            return 'preempted'
        return 'explored'


def patrol(seconds: float) -> fsm.StateMachine:
    """Return a robot explores every room while another state watches the battery."""
    machine = fsm.StateMachine(['finished', 'preempted'])
    machine.set_name('PATROL')
    machine.userdata.rooms = ['R1', 'R2']
    look = fsm.Concurrence(
        ['explored', 'preempted'],
        'explored',
        input_keys=['room'],
        child_termination_cb=lambda ends: ends['EXPLORE'] is not None,
    )
    with machine:
        fsm.StateMachine.add('CHOOSE', Choose(), {'chosen': 'LOOK'})
        fsm.StateMachine.add('LOOK', look, {'explored': 'CHOOSE'})
        with look:
            fsm.Concurrence.add('EXPLORE', Explore(seconds), {'place': 'room'})
            fsm.Concurrence.add('BATTERY', fsm.CBState(lambda ud: 'full', outcomes=['full']))
    return machine


def main() -> None:
    """Show what one machine can do."""
    machine = patrol(0.01)
    print(to_ascii(machine))
    print('findings:', [str(finding) for finding in verify(machine)])
    with watching(machine) as watched:
        print('ended with', machine.execute())
    print('went', ' -> '.join(watched.path()))

    machine = patrol(1000.0)
    ends: list[str] = []
    thread = threading.Thread(target=lambda: ends.append(machine.execute()))
    thread.start()
    machine.request_preempt()
    thread.join()
    print('preempted, it ended with', ends[0])


if __name__ == '__main__':
    main()
