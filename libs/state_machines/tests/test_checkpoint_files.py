"""The file of a checkpoint: what it keeps, when it is whole, and what is refused of it."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading

import pytest

import state_machines as fsm
from state_machines import checkpoint

from .states import Answer, CheckpointedWorld, through_json

CHILD = """
import os, sys
import state_machines as fsm
from state_machines import checkpoint
path, mode = sys.argv[1:]
def step(name, die=False):
    def work(ud):
        print(name, flush=True)
        ud.trail = ud.trail + [name]
        if die and mode == 'die':
            os.kill(os.getpid(), 9)
        return 'done'
    return fsm.CBState(work, outcomes=['done'], input_keys=['trail'], output_keys=['trail'])
machine = fsm.StateMachine(['done'])
inner = fsm.StateMachine(['done'], ['trail'], ['trail'])
machine.userdata.trail = []
with machine:
    fsm.StateMachine.add('A', step('A'), {'done': 'INNER'})
    fsm.StateMachine.add('INNER', inner)
    with inner:
        fsm.StateMachine.add('B', step('B'), {'done': 'C'})
        fsm.StateMachine.add('C', step('C', die=True), {'done': 'D'})
        fsm.StateMachine.add('D', step('D'))
keeper = checkpoint.Checkpointer(machine, path)
if os.path.exists(path):
    checkpoint.load(machine, path)
print(machine.execute(), machine.userdata.trail)
"""


def test_a_process_that_was_killed_is_gone_on_from_by_the_next(tmp_path):
    path = tmp_path / 'checkpoint.json'
    command = [sys.executable, '-c', CHILD, str(path)]
    dead = subprocess.run([*command, 'die'], capture_output=True, text=True, timeout=60)
    assert dead.returncode == -signal.SIGKILL
    assert dead.stdout.split() == ['A', 'B', 'C']
    alive = subprocess.run([*command, 'live'], capture_output=True, text=True, timeout=60)
    assert alive.stdout.splitlines() == ['C', 'D', "done ['A', 'B', 'C', 'D']"], alive.stderr
    assert os.listdir(tmp_path) == []


def test_a_checkpoint_of_another_machine_is_refused_and_changes_nothing():
    first = CheckpointedWorld()
    saved = through_json(first.root)
    gone = {'current': 'GONE', 'leaving': False, 'saved': [], 'index': 0, 'outcomes': {}}
    saved['states'] = [{'userdata': {'a': 1}}, {'label': 'INNER', 'in': 0, 'at': gone}]
    with pytest.raises(checkpoint.CheckpointError, match=r"'StateMachine/INNER'.*'GONE'"):
        checkpoint.restore(first.root, saved)
    assert 'a' not in first.root.userdata
    saved['states'] = [{}, {'label': 'OTHER', 'in': 0}]
    with pytest.raises(checkpoint.CheckpointError, match="no state 'OTHER'"):
        checkpoint.restore(first.root, saved)
    for within in (1, -1, None, 'INNER'):
        saved['states'] = [{}, {'label': 'INNER', 'in': within}]
        with pytest.raises(checkpoint.CheckpointError, match='expected the number of a container'):
            checkpoint.restore(first.root, saved)
    for states in ([], {'0': {}}, 'INNER', None):
        saved['states'] = states
        with pytest.raises(checkpoint.CheckpointError, match='a list of states'):
            checkpoint.restore(first.root, saved)
    saved['states'] = [{'raised': ['NIX']}]
    with pytest.raises(checkpoint.CheckpointError, match="no interrupt 'NIX'"):
        checkpoint.restore(first.root, saved)


@pytest.mark.parametrize('text', ['', '{', '[]', '{}', '{"format": "surveillance-fsm-checkpoint"}'])
def test_a_file_that_is_no_checkpoint_is_named(tmp_path, text):
    path = tmp_path / 'broken.json'
    path.write_text(text)
    with pytest.raises(checkpoint.CheckpointError, match=r'broken\.json'):
        checkpoint.load(CheckpointedWorld().root, path)
    with pytest.raises(checkpoint.CheckpointError, match=r'absent\.json'):
        checkpoint.load(CheckpointedWorld().root, tmp_path / 'absent.json')


def test_a_reader_never_finds_half_a_checkpoint_whoever_saves(tmp_path):
    world, path = CheckpointedWorld(), tmp_path / 'checkpoint'
    world.root.userdata.much = 'x' * 100_000
    checkpoint.save(world.root, path)
    stop, faults = threading.Event(), []

    def save_again_and_again():
        try:
            while not stop.is_set():
                checkpoint.save(world.root, path)
        except OSError as error:
            faults.append(error)

    savers = [threading.Thread(target=save_again_and_again) for _ in range(3)]
    for saver in savers:
        saver.start()
    try:
        for _ in range(100):
            checkpoint.load(CheckpointedWorld().root, path)
    finally:
        stop.set()
        for saver in savers:
            saver.join(60.0)
    assert not faults
    assert [each.name for each in tmp_path.iterdir()] == ['checkpoint']


def machine_with(**values):
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('A', Answer('done'))
    for key, value in values.items():
        machine.userdata[key] = value
    return machine


@pytest.mark.parametrize(
    'value',
    [
        {1, 2},
        frozenset({'a'}),
        b'\x00\xff',
        bytearray(b'ab'),
        (1, ('two', [3])),
        {1: 'one', (2, 3): 'pair', None: 0},
        {'!': 'tuple', 'is': []},
        {'a': {'b': {1.5}}},
        float('inf'),
        -0.0,
        1 + 2j,
        10**40,
        '\ud800',
        True,
        None,
    ],
)
def test_plain_values_come_back_exactly(value, tmp_path):
    checkpoint.save(machine_with(key=value), tmp_path / 'at')
    again = machine_with()
    checkpoint.load(again, tmp_path / 'at')
    assert again.userdata.key == value
    assert type(again.userdata.key) is type(value)
    assert repr(again.userdata.key) == repr(value)


def test_what_is_no_number_comes_back_as_such(tmp_path):
    checkpoint.save(machine_with(key=[float('nan')]), tmp_path / 'at')
    again = machine_with()
    checkpoint.load(again, tmp_path / 'at')
    assert math.isnan(again.userdata.key[0])


def circle():
    value = []
    value.append(value)
    return value


class Number(int):
    """Not exactly an integer."""


@pytest.mark.parametrize('value', [object(), [object()], Number(3), circle(), {'a': print}])
def test_what_cannot_be_kept_is_refused_with_its_key_when_it_is_written(value, tmp_path, caplog):
    machine = machine_with(fine=1, robot=value)
    with pytest.raises(checkpoint.CheckpointError, match="userdata key 'robot' of 'StateMachine'"):
        checkpoint.save(machine, tmp_path / 'at')
    assert list(tmp_path.iterdir()) == []
    checkpoint.save(machine, tmp_path / 'at', leave_out=['robot'])
    again = machine_with()
    checkpoint.load(again, tmp_path / 'at')
    assert again.userdata.keys() == ['fine']
    checkpoint.Checkpointer(machine, tmp_path / 'at')
    assert machine.execute() == 'done'
    assert "'robot'" in caplog.text


def test_a_checkpoint_is_on_the_disk_before_it_is_there(tmp_path, monkeypatch):
    deeds = []
    monkeypatch.setattr(os, 'fsync', lambda handle: deeds.append('sync'))
    replace = os.replace
    monkeypatch.setattr(os, 'replace', lambda *a: (deeds.append('replace'), replace(*a)))
    checkpoint.save(machine_with(), tmp_path / 'at')
    assert deeds == ['sync', 'replace', 'sync']


DEEP = '[' * 5000 + ']' * 5000


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('"userdata": {"key": 1}', '"userdata": 7'),
        ('"userdata": {"key": 1}', '"userdata": {"key": {"!": "nix", "is": 1}}'),
        ('"userdata": {"key": 1}', '"userdata": {"key": {"!": "bytes", "is": 1}}'),
        ('"userdata": {"key": 1}', '"userdata": {"key": {"!": []}}'),
        ('"userdata": {"key": 1}', f'"userdata": {{"key": {DEEP}}}'),
        ('"userdata": {"key": 1}', '"userdata": {}}, 7, {"label": "A"'),
        ('"userdata": {"key": 1}', '"at": []'),
        ('"userdata": {"key": 1}', '"at": {"current": 3}'),
        ('"userdata": {"key": 1}', '"at": {"current": "A", "saved": [1]}'),
        ('"userdata": {"key": 1}', '"at": {"current": "A", "index": -1}'),
        ('"userdata": {"key": 1}', '"raised": [[]]'),
        ('"userdata": {"key": 1}', '"progress": [1]'),
        ('"userdata": {"key": 1}', '"at": null}, {"label": "A", "in": 0, "userdata": {}'),
    ],
)
def test_a_damaged_checkpoint_is_an_error_of_one_line_that_changes_nothing(old, new, tmp_path):
    path = tmp_path / 'at'
    checkpoint.save(machine_with(key=1), path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    machine = machine_with()
    with pytest.raises(checkpoint.CheckpointError) as caught:
        checkpoint.load(machine, path)
    assert '\n' not in str(caught.value)
    assert str(path) in str(caught.value)
    assert machine.userdata.keys() == []


def test_a_link_to_the_checkpoint_stays(tmp_path):
    path, link = tmp_path / 'checkpoint.json', tmp_path / 'link.json'
    link.symlink_to(path)
    machine = CheckpointedWorld().root
    checkpoint.save(machine, link)
    assert link.is_symlink()
    checkpoint.load(machine, path)


@pytest.mark.parametrize('kind', ['a pipe', 'a device'])
def test_what_is_no_file_is_neither_read_nor_replaced(tmp_path, kind):
    """The link keeps a real device out of reach of a failing test."""
    path = tmp_path / 'path'
    if kind == 'a pipe':
        os.mkfifo(path)
    else:
        path.symlink_to('/dev/zero')
    machine = CheckpointedWorld().root
    with pytest.raises(fsm.CheckpointError, match=f'^{path}: expected a file, got {kind}$'):
        checkpoint.load(machine, path)
    with pytest.raises(OSError, match=f'expected a file, got {kind}'):
        checkpoint.save(machine, path)
    assert not path.is_file()
