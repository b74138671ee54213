"""A machine as data: read with the same checks as code, and written back."""

from __future__ import annotations

import pytest

import state_machines as fsm
from state_machines.export import to_ascii, to_yaml
from state_machines.machine_file import (
    MachineFileError,
    load_machine,
    machine_from,
    parse,
    to_data,
)
from state_machines.verify import verify


class Choose(fsm.State):
    def __init__(self):
        super().__init__(['chosen', 'finished'], io_keys=['rooms'], output_keys=['room'])

    def execute(self, ud):
        if not ud.rooms:
            return 'finished'
        ud.room, *ud.rooms = ud.rooms
        return 'chosen'


class Explore(fsm.State):
    def __init__(self, seconds, seen):
        super().__init__(['explored', 'preempted'], input_keys=['place'])
        self.seconds, self.seen = seconds, seen

    def execute(self, ud):
        self.wait(self.seconds)
        self.seen.append(ud.place)
        return 'explored'


def charge(ud):
    return 'charged'


OFFERED = {'Choose': Choose, 'Explore': Explore, 'charge': charge}

PATROL = """
name: PATROL
outcomes: [finished, preempted]
userdata: {rooms: [R1, R2]}
initial: CHOOSE
states:
  CHOOSE:
    state: Choose
    transitions: {chosen: EXPLORE}
  EXPLORE:
    state: Explore
    arguments: {seconds: 0.0, seen: $seen}
    transitions: {explored: BOTH}
    remapping: {place: room}
    timeout: 30.0
    retry: 1
    retry_on: [preempted]
  BOTH:
    machine: Concurrence
    outcomes: [all, some]
    default_outcome: some
    outcome_map: {all: {A: done, B: charged}}
    states:
      A:
        machine: Iterator
        outcomes: [done]
        items: [1, 2]
        item_key: number
        exhausted_outcome: done
        states:
          EACH: {function: charge, outcomes: [charged], loop_outcomes: [charged]}
      B:
        machine: Sequence
        outcomes: [charged]
        connector_outcome: charged
        states:
          ONE: {function: charge, outcomes: [charged]}
          TWO: {function: charge, outcomes: [charged]}
    transitions: {all: CHOOSE, some: preempted}
interrupts:
  CHARGE: {function: charge, outcomes: [charged], priority: 5}
"""


def patrol(text=PATROL, seen=None):
    return machine_from(parse(text), {**OFFERED, 'seen': [] if seen is None else seen})


def test_a_machine_that_was_loaded_runs_and_is_sound():
    seen = []
    machine = patrol(seen=seen)
    assert [str(f) for f in verify(machine) if f.severity == 'error'] == []
    machine.raise_interrupt('CHARGE')
    assert machine.execute() == 'finished'
    assert seen == ['R1', 'R2']
    assert machine['EXPLORE'].seconds == 0.0


def test_what_is_written_back_builds_the_same_machine(tmp_path):
    first = patrol()
    path = tmp_path / 'patrol.yaml'
    data = to_data(first)
    states = data['states']['BOTH']['states']
    assert states['A']['states']['EACH']['function'].endswith(':charge')
    # The test's module is imported under a name of pytest's own: by name, then.
    path.write_text(to_yaml(first).replace(f'{charge.__module__}:charge', 'charge'))
    second = load_machine(path, {**OFFERED, 'seen': []})
    assert to_ascii(second) == to_ascii(first)
    assert to_data(second) == data
    assert second.execute() == 'finished'


def test_an_iterator_is_written_whole_although_its_items_and_their_key_are_empty():
    each = fsm.Iterator(['done'], [], [], it=[], it_label='', exhausted_outcome='all')
    each.set_state('DO', fsm.CBState(charge, outcomes=['done']))
    data = to_data(each)
    assert (data['items'], data['item_key'], data['exhausted_outcome']) == ([], '', 'all')
    each.items = [object()]
    with pytest.raises(MachineFileError, match="in items of 'Iterator' is a object"):
        to_data(each)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('chosen: EXPLORE', 'chsen: EXPLORE', ['machine.states.CHOOSE', "'chsen'", "'chosen'"]),
        ('chosen: EXPLORE', 'chosen: EXPLOR', ["'EXPLOR'", 'neither a state nor an outcome']),
        ('state: Choose', 'state: Chose', ['machine.states.CHOOSE.state', "did you mean 'Choose'"]),
        ('state: Choose', 'state: no.such:Thing', ['machine.states.CHOOSE.state', 'no']),
        ('state: Choose', 'state: collections:Choose', ['collections', "'Choose'"]),
        ('state: Choose', 'state: 3', ['expected package.module:Name']),
        ('transitions: {chosen', 'transtions: {chosen', ["did you mean 'transitions'"]),
        ('outcomes: [finished, preempted]', 'outcomes: finished', ['machine.outcomes', 'list']),
        ('seconds: 0.0,', 'secs: 0.0,', ['machine.states.EXPLORE', 'secs']),
        ('$seen', '$sen', ['machine.states.EXPLORE.arguments.seen', "did you mean 'seen'"]),
        ('timeout: 30.0', 'timeout: soon', ['machine.states.EXPLORE.timeout', 'a number']),
        ('timeout: 30.0', 'timeout: -1', ['machine.states.EXPLORE', 'above 0']),
        ('machine: Sequence', 'machine: Sequense', ["did you mean 'Sequence'"]),
        ('default_outcome: some\n', '\n', ["'default_outcome' is missing"]),
        ('initial: CHOOSE', 'initial: CHOSE', ['machine.initial', "'CHOSE'"]),
        ('  EXPLORE:\n', '  CHOOSE:\n', ['line', "'CHOOSE' comes twice"]),
        ('name: PATROL', 'name: [', ['line']),
        ('rooms: [R1, R2]', '1: x', ['line', 'is no string']),
        ('  BOTH:', '  "BO/TH":', ['has no slash']),
        ('place: room', 'place: 3', ['remapping.place', 'expected a name']),
    ],
)
def test_what_is_wrong_is_told_in_one_line_with_its_place(old, new, words, tmp_path):
    assert old in PATROL
    path = tmp_path / 'patrol.yaml'
    path.write_text(PATROL.replace(old, new, 1))
    with pytest.raises(MachineFileError) as caught:
        load_machine(path, {**OFFERED, 'seen': []})
    message = str(caught.value)
    assert '\n' not in message
    assert message.startswith(f'{path}: ')
    for word in words:
        assert word in message


def test_values_of_the_wrong_kind_are_told_too():
    for data in (None, [], 'x', {'states': []}, {'states': {'A': None}}, {'userdata': 3}):
        with pytest.raises(MachineFileError):
            machine_from(data)


def test_what_has_no_form_as_data_is_named():
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('A', fsm.CBState(lambda ud: 'done', outcomes=['done']))
    with pytest.raises(MachineFileError, match='StateMachine/A'):
        to_yaml(machine)
    machine = fsm.StateMachine(['done'])
    machine.userdata.robot = object()
    with pytest.raises(MachineFileError, match='robot'):
        to_yaml(machine)
