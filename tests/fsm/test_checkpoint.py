"""A checkpoint lets a machine in another process go on where the first was."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading

import pytest

import surveillance_fsm as fsm
from surveillance_fsm import history as checkpoint
from surveillance_fsm.testing import FakeClock

from .states import Answer, Background, Waiter, began


class World:
    """The same machine, built anew for each process."""

    def __init__(self):
        self.clock = FakeClock()
        self.before, self.charge = Answer('done'), Waiter(5.0, progress='charged')
        self.explore = Waiter(10.0, progress='explored')
        inner = fsm.StateMachine(['done', 'preempted'])
        self.root = fsm.StateMachine(['done', 'preempted'])
        self.root.set_clock(self.clock)
        with self.root:
            fsm.StateMachine.add('INNER', inner)
            with inner:
                fsm.StateMachine.add('BEFORE', self.before, {'done': 'EXPLORE'})
                fsm.StateMachine.add('EXPLORE', self.explore)
        self.inner = inner
        self.root.add_interrupt('CHARGE', self.charge, priority=5)


def through_json(machine):
    return json.loads(json.dumps(checkpoint.capture(machine)))


def test_a_machine_goes_on_in_its_state_with_userdata_and_progress():
    first, second = World(), World()
    first.inner.userdata.visited = ['R1', 'R2']
    run = Background(first.root)
    began(first.explore)
    first.clock.until_sleeping(1)
    first.clock.advance(6.0)
    saved = through_json(first.root)
    first.root.request_preempt()
    run.result()

    checkpoint.restore(second.root, saved)
    assert second.inner.userdata.visited == ['R1', 'R2']
    run = Background(second.root)
    began(second.explore)
    second.clock.until_sleeping(1)
    second.clock.advance(4.0)
    assert run.result() == 'done'
    assert second.before.runs == 0


def test_a_machine_goes_on_in_an_interrupt_and_then_where_that_came():
    first, second = World(), World()
    run = Background(first.root)
    began(first.explore)
    first.clock.until_sleeping(1)
    first.clock.advance(6.0)
    first.root.raise_interrupt('CHARGE')
    began(first.charge)
    first.clock.until_sleeping(1)
    first.clock.advance(3.0)
    saved = through_json(first.root)
    first.root.request_preempt()
    first.root.request_preempt()

    checkpoint.restore(second.root, saved)
    second_run = Background(second.root)
    began(second.charge)
    second.clock.until_sleeping(1)
    second.clock.advance(2.0)
    began(second.explore)
    second.clock.until_sleeping(1)
    second.clock.advance(4.0)
    assert second_run.result() == 'done'
    assert second.before.runs == 0
    del run


def test_an_interrupt_that_had_not_begun_is_not_lost():
    first, second = World(), World()
    first.root.raise_interrupt('CHARGE')
    checkpoint.restore(second.root, through_json(first.root))
    run = Background(second.root)
    began(second.charge)
    second.root.request_preempt()
    run.result()


def test_an_iterator_goes_on_with_its_item():
    def build(seen):
        iterator = fsm.Iterator(['done'], [], [], it='ABCD', it_label='x', exhausted_outcome='done')
        saved = []

        def visit(ud):
            seen.append(ud.x)
            saved.append(through_json(iterator))
            return 'more'

        with iterator:
            fsm.Iterator.set_contained_state(
                'S', fsm.CBState(visit, outcomes=['more'], input_keys=['x']), ['more']
            )
        return iterator, saved

    first, second = [], []
    iterator, saved = build(first)
    iterator.execute()
    again, _ = build(second)
    checkpoint.restore(again, saved[2])
    assert again.execute() == 'done'
    assert second == ['C', 'D']


def test_a_concurrence_goes_on_with_the_children_that_had_not_ended():
    def build():
        quick, slow = Answer('done'), Waiter(5.0)
        concurrence = fsm.Concurrence(
            ['both', 'other'], 'other', outcome_map={'both': {'QUICK': 'done', 'SLOW': 'done'}}
        )
        with concurrence:
            fsm.Concurrence.add('QUICK', quick)
            fsm.Concurrence.add('SLOW', slow)
        concurrence.set_clock(clock := FakeClock())
        return concurrence, quick, slow, clock

    first, quick, slow, clock = build()
    ended, quick_ended = [], threading.Event()

    def saw(ud, active):
        ended.append(through_json(first))
        if active == ['SLOW']:
            quick_ended.set()

    first.register_transition_cb(saw)
    run = Background(first)
    began(slow)
    assert quick_ended.wait(5.0)
    first.request_preempt()
    run.result()
    second, quick, slow, clock = build()
    checkpoint.restore(second, ended[1])
    run = Background(second)
    clock.until_sleeping(1)
    clock.advance(5.0)
    assert run.result() == 'both'
    assert quick.runs == 0


CHILD = """
import os, sys
import surveillance_fsm as fsm
from surveillance_fsm import history as checkpoint
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
    first = World()
    saved = through_json(first.root)
    saved['machine']['states'] = {
        'INNER': {
            'at': {'current': 'GONE', 'leaving': False, 'saved': [], 'index': 0, 'outcomes': {}}
        }
    }
    saved['machine']['userdata'] = {'a': 1}
    with pytest.raises(checkpoint.HistoryError, match=r"'StateMachine/INNER'.*'GONE'"):
        checkpoint.restore(first.root, saved)
    assert 'a' not in first.root.userdata
    saved['machine']['states'] = {'OTHER': {}}
    with pytest.raises(checkpoint.HistoryError, match="no state 'OTHER'"):
        checkpoint.restore(first.root, saved)
    saved['machine'] = {'raised': ['NIX']}
    with pytest.raises(checkpoint.HistoryError, match="no interrupt 'NIX'"):
        checkpoint.restore(first.root, saved)


@pytest.mark.parametrize('text', ['', '{', '[]', '{}', '{"format": "surveillance-fsm-checkpoint"}'])
def test_a_file_that_is_no_checkpoint_is_named(tmp_path, text):
    path = tmp_path / 'broken.json'
    path.write_text(text)
    with pytest.raises(checkpoint.HistoryError, match=r'broken\.json'):
        checkpoint.load(World().root, path)
    with pytest.raises(checkpoint.HistoryError, match=r'absent\.json'):
        checkpoint.load(World().root, tmp_path / 'absent.json')


def test_a_reader_never_finds_half_a_checkpoint_whoever_saves(tmp_path):
    world, path = World(), tmp_path / 'checkpoint'
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
            checkpoint.load(World().root, path)
    finally:
        stop.set()
        for saver in savers:
            saver.join(10.0)
    assert not faults
    assert [each.name for each in tmp_path.iterdir()] == ['checkpoint']


# What is kept, and how.


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
    with pytest.raises(checkpoint.HistoryError, match="userdata key 'robot' of 'StateMachine'"):
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
        ('"userdata": {"key": 1}', '"states": []'),
        ('"userdata": {"key": 1}', '"at": []'),
        ('"userdata": {"key": 1}', '"at": {"current": 3}'),
        ('"userdata": {"key": 1}', '"at": {"current": "A", "saved": [1]}'),
        ('"userdata": {"key": 1}', '"at": {"current": "A", "index": -1}'),
        ('"userdata": {"key": 1}', '"raised": [[]]'),
        ('"userdata": {"key": 1}', '"progress": [1]'),
        ('"userdata": {"key": 1}', '"states": {"A": {"userdata": {}}}'),
    ],
)
def test_a_damaged_checkpoint_is_an_error_of_one_line_that_changes_nothing(old, new, tmp_path):
    path = tmp_path / 'at'
    checkpoint.save(machine_with(key=1), path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    machine = machine_with()
    with pytest.raises(checkpoint.HistoryError) as caught:
        checkpoint.load(machine, path)
    assert '\n' not in str(caught.value)
    assert str(path) in str(caught.value)
    assert machine.userdata.keys() == []


def test_an_item_that_was_done_is_not_repeated_by_a_checkpoint_taken_after_it():
    def build(seen):
        each = fsm.Iterator(['done'], [], [], it='ABCD', it_label='x', exhausted_outcome='done')
        with each:
            fsm.Iterator.set_contained_state(
                'S',
                fsm.CBState(
                    lambda ud: seen.append(ud.x) or 'more', outcomes=['more'], input_keys=['x']
                ),
                ['more'],
            )
        return each

    first, saved = [], []
    each = build(first)
    each.register_transition_cb(lambda ud, active: saved.append(through_json(each)))
    assert each.execute() == 'done'
    assert len(saved) == 4
    for done, at in enumerate(saved, start=1):
        second = []
        again = build(second)
        checkpoint.restore(again, at)
        assert again.execute() == 'done'
        assert second == list('ABCD'[done:])


def test_items_that_cannot_be_kept_are_drawn_again():
    def build(seen, die):
        items = [object(), object(), object()]
        each = fsm.Iterator(['done'], [], [], it=items, it_label='x', exhausted_outcome='done')

        def visit(ud):
            seen.append(items.index(ud.x))
            if die is not None and len(seen) == 2:
                die.append(json.loads(json.dumps(checkpoint.capture(each, leave_out=['x']))))
            return 'more'

        with each:
            state = fsm.CBState(visit, outcomes=['more'], input_keys=['x'])
            fsm.Iterator.set_contained_state('S', state, ['more'])
        return each

    saved, second = [], []
    build([], saved).execute()
    again = build(second, None)
    checkpoint.restore(again, saved[0])
    assert again.execute() == 'done'
    assert second == [1, 2]


def test_a_container_that_has_ended_is_not_begun_again_by_an_early_checkpoint():
    """A child's callback saves while its brother, which has ended, is not yet noted as such."""

    def build():
        work = Answer('done')
        inner = fsm.StateMachine(['done'])
        with inner:
            fsm.StateMachine.add('WORK', work)
        both = fsm.Concurrence(['done'], 'done')
        with both:
            fsm.Concurrence.add('INNER', inner)
        return both, inner, work

    first, inner, _ = build()
    saved = []
    # After its last transition, before the concurrence's own thread takes note.
    inner.register_termination_cb(lambda *_: saved.append(through_json(first)))
    assert first.execute() == 'done'
    second, _, work = build()
    checkpoint.restore(second, saved[0])
    assert second.execute() == 'done'
    assert work.runs == 0
