"""Userdata: declared keys, names that are methods, views of it merged and renamed."""

from __future__ import annotations

import pytest

import state_machines as fsm


def machine_of(state, outcomes=('done',), name='ROOT', **add):
    machine = fsm.StateMachine(outcomes)
    machine.set_name(name)
    with machine:
        fsm.StateMachine.add('STATE', state, **add)
    return machine


def nested(state):
    inner, outer = fsm.StateMachine(['done']), fsm.StateMachine(['done'])
    outer.set_name('OUTER')
    with outer:
        fsm.StateMachine.add('INNER', inner)
        with inner:
            fsm.StateMachine.add('STATE', state)
    return outer


def function_state(function, inputs=(), outputs=()):
    return fsm.CBState(function, outcomes=['done'], input_keys=inputs, output_keys=outputs)


@pytest.mark.parametrize(
    ('function', 'words'),
    [
        (lambda ud: ud.other, "cannot read userdata key 'other'"),
        (lambda ud: ud['other'], "cannot read userdata key 'other'"),
        (lambda ud: ud.written, "cannot read userdata key 'written'"),
        (lambda ud: setattr(ud, 'other', 1), "cannot write userdata key 'other'"),
        (lambda ud: ud.__setitem__('other', 1), "cannot write userdata key 'other'"),
        (lambda ud: setattr(ud, 'read', 1), "cannot write userdata key 'read'"),
        (lambda ud: ud.__setitem__('read', 1), "cannot write userdata key 'read'"),
    ],
)
def test_userdata_keys_that_are_not_declared_are_refused(function, words):
    machine = nested(function_state(function, ['read'], ['written']))
    with pytest.raises(fsm.InvalidUserCodeError) as caught:
        machine.execute()
    assert words in str(caught.value)
    assert "'OUTER/INNER/STATE'" in str(caught.value)
    assert not isinstance(caught.value, fsm.MissingKeyError)


def test_userdata_merges_extracts_and_renames():
    outer, inner = fsm.UserData(), fsm.UserData()
    outer.a, outer['b'] = [1], 2
    extracted = outer.extract(['a', 'b'], {'inner_a': 'a'})
    assert sorted(extracted.keys()) == ['b', 'inner_a']
    assert extracted.inner_a == [1]
    assert extracted.inner_a is not outer.a
    inner.x = 3
    outer.merge(inner, ['x'], {'x': 'outer_x'})
    outer.update(inner)
    assert (outer.outer_x, outer.x, 'x' in outer) == (3, 3, True)
    with pytest.raises(KeyError, match='nope'):
        outer.nope  # noqa: B018


def test_userdata_keys_with_names_of_methods_are_reached_as_items():
    machine = machine_of(
        function_state(
            lambda ud: ud.__setitem__('keys', ud['keys'] + 1) or 'done', ['keys'], ['keys']
        )
    )
    machine.userdata['keys'] = 1
    machine.execute()
    assert machine.userdata['keys'] == 2
