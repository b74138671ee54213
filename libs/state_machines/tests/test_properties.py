"""Properties that hold for any machine, any script of outcomes and any moment of a request."""

from __future__ import annotations

import json
import random

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import state_machines as fsm
from state_machines import checkpoint
from state_machines.testing import watching
from state_machines.transitions import Transition
from state_machines.verify import verify

from .replaying import replay

OUTCOMES = ('a', 'b', 'c')
SETTINGS = settings(
    max_examples=60,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)


class Scripted(fsm.State):
    """Returns outcomes that a generator shared by the whole machine chooses."""

    def __init__(self, choose, log, path):
        super().__init__(OUTCOMES, ['steps'], ['steps'])
        self._choose, self._log, self._path = choose, log, path

    def execute(self, ud):
        self._log.append(self._path)
        return self._choose()


# A machine is a list of states; a state is None for a leaf, or a machine. Its transitions are
# one target per outcome: an index of a state, or an outcome of the machine.
@st.composite
def machines(draw, depth=2):
    count = draw(st.integers(1, 4))
    states = [
        draw(machines(depth=depth - 1)) if depth and draw(st.integers(0, 3)) == 0 else None
        for _ in range(count)
    ]
    target = st.one_of(st.integers(0, count - 1), st.sampled_from(OUTCOMES))
    return [(state, [draw(target) for _ in OUTCOMES]) for state in states]


def build(description, choose, log, path='ROOT'):
    machine = fsm.StateMachine(OUTCOMES, ['steps'], ['steps'])
    machine.set_name(path)
    with machine:
        for number, (inner, targets) in enumerate(description):
            label = f'S{number}'
            inside = f'{path}/{label}'
            state = build(inner, choose, log, inside) if inner else Scripted(choose, log, inside)
            fsm.StateMachine.add(
                label,
                state,
                {
                    outcome: target if isinstance(target, str) else f'S{target}'
                    for outcome, target in zip(OUTCOMES, targets, strict=True)
                },
            )
    return machine


def walk(description, choose, log, path='ROOT'):
    """Say what the machine does, as plainly as possible."""
    number: int | str = 0
    while not isinstance(number, str):
        inner, targets = description[number]
        inside = f'{path}/S{number}'
        if inner:
            outcome = walk(inner, choose, log, inside)
        else:
            log.append(inside)
            outcome = choose()
        number = targets[OUTCOMES.index(outcome)]
    return number


class EnoughError(Exception):
    """The script is over."""


def chooser(seed, steps):
    generator, left = random.Random(seed), [steps]

    def choose():
        left[0] -= 1
        if left[0] < 0:
            raise EnoughError
        return generator.choice(OUTCOMES)

    return choose


@SETTINGS
@given(machines(), st.integers(0, 2**32))
def test_a_machine_does_what_its_description_says(description, seed):
    expected, taken = [], []
    try:
        end = walk(description, chooser(seed, 60), expected)
    except EnoughError:
        end = None
    machine = build(description, chooser(seed, 60), taken)
    machine.userdata.steps = 0
    machine.preempt_timeout = None
    try:
        assert machine.execute() == end
    except fsm.InvalidUserCodeError as error:
        assert isinstance(error.__cause__, EnoughError)  # noqa: PT017 - may end otherwise, too
        assert end is None
    assert taken == expected
    assert not machine.is_running()


@SETTINGS
@given(machines(), st.integers(0, 2**32), st.integers(0, 30))
def test_a_checkpoint_at_any_step_goes_on_with_the_same_steps(description, seed, at):
    whole, first, rest = [], [], []
    machine = build(description, chooser(seed, 60), whole)
    machine.userdata.steps = 0
    run_through(machine)
    choose, saved = chooser(seed, 60), []

    def interrupted():
        if len(first) == at + 1:
            saved.append(json.loads(json.dumps(checkpoint.capture(again))))
            raise EnoughError
        return choose()

    again = build(description, interrupted, first)
    again.userdata.steps = 0
    run_through(again)
    if not saved:
        return  # The machine ended before.
    resumed = build(description, choose, rest)
    checkpoint.restore(resumed, saved[0])
    run_through(resumed)
    assert first[:-1] + rest == whole


def run_through(machine):
    machine.preempt_timeout = None
    try:
        machine.execute()
    except fsm.InvalidUserCodeError as error:
        assert isinstance(error.__cause__, EnoughError)  # noqa: PT017 - may end otherwise, too


@SETTINGS
@given(machines(), st.integers(0, 2**32))
def test_what_is_traced_can_be_replayed(description, seed):
    machine = build(description, chooser(seed, 40), [])
    machine.userdata.steps = 0
    with watching(machine) as watched:
        run_through(machine)
    containers = {t[0] for t in watched.transitions}
    transitions = []
    for number, (path, left, outcome, target) in enumerate(watched.transitions, 1):
        kind = 'transition' if target.startswith('S') else 'exit'
        transitions.append(Transition(number, 0.0, path, left, outcome, target, kind, 0.0, 1))
    steps = list(replay(build(description, lambda: 'a', []), transitions))
    assert len(steps) == len(transitions)
    assert containers <= {'ROOT', *(p for s in steps for p in s.active)} | containers


@SETTINGS
@given(machines(), st.integers(0, 2**32))
def test_states_that_are_reported_unreachable_are_never_reached(description, seed):
    log = []
    machine = build(description, chooser(seed, 80), log)
    machine.userdata.steps = 0
    unreachable = {f.path for f in verify(machine) if f.check == 'unreachable'}
    run_through(machine)
    assert not {path for path in log for bad in unreachable if path.startswith(bad)}


@SETTINGS
@given(machines(), st.integers(0, 2**32), st.integers(0, 20), st.data())
def test_a_preempt_at_any_step_is_served_and_leaves_no_flag(description, seed, at, data):
    log, generator = [], random.Random(seed)
    asked = []

    class Heeds(fsm.State):
        def __init__(self, path):
            super().__init__(OUTCOMES)
            self.path = path

        def execute(self, ud):
            log.append(self.path)
            if len(log) == at + 1:
                whom = data.draw(st.sampled_from([root, self]))
                whom.request_preempt()
                asked.append(whom)
            if self.preempt_requested():
                self.service_preempt()
                raise EnoughError
            if len(log) > 60:
                raise EnoughError
            return generator.choice(OUTCOMES)

    def grow(description, path='ROOT'):
        machine = fsm.StateMachine(OUTCOMES)
        machine.set_name(path)
        with machine:
            for number, (inner, targets) in enumerate(description):
                inside = f'{path}/S{number}'
                fsm.StateMachine.add(
                    f'S{number}',
                    grow(inner, inside) if inner else Heeds(inside),
                    {
                        outcome: target if isinstance(target, str) else f'S{target}'
                        for outcome, target in zip(OUTCOMES, targets, strict=True)
                    },
                )
        return machine

    root = grow(description)
    run_through(root)
    if asked:
        # The state in which it was asked heard of it at once.
        assert len(log) == at + 1


@SETTINGS
@given(
    st.dictionaries(st.sampled_from('abcd'), st.integers(), max_size=4),
    st.sets(st.sampled_from('xyz')),
    st.sets(st.sampled_from('xyz')),
    st.dictionaries(st.sampled_from('xyz'), st.sampled_from('abcd')),
)
def test_a_view_reads_and_writes_what_was_declared_where_it_was_mapped(
    values, inputs, outputs, mapping
):
    userdata = fsm.UserData()
    for key, value in values.items():
        userdata[key] = value
    view = fsm.Remapper(userdata, inputs, outputs, mapping)
    for key in 'xyz':
        outer = mapping.get(key, key)
        for read in (lambda key=key: getattr(view, key), lambda key=key: view[key]):
            try:
                value = read()
            except fsm.MissingKeyError:
                assert key in inputs
                assert outer not in userdata
            except fsm.InvalidUserCodeError:
                assert key not in inputs
            else:
                assert key in inputs
                assert value == userdata[outer]
        assert (key in view) == (key in inputs and outer in userdata)
    for key in 'xyz':
        before = dict(userdata._data)
        try:
            view[key] = 99
        except fsm.InvalidUserCodeError:
            assert key not in outputs
            assert userdata._data == before
        else:
            assert key in outputs
            assert userdata[mapping.get(key, key)] == 99
