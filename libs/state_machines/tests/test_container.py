"""What states and containers promise is enforced, with errors that name label, key and path."""

from __future__ import annotations

import pytest

import state_machines as fsm

from .states import Answer


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


@pytest.mark.parametrize('wrong', ['undeclared', None, 7, ['done'], True])
def test_an_outcome_that_is_not_declared_names_state_and_path(wrong):
    with pytest.raises(fsm.InvalidTransitionError) as caught:
        nested(Answer(wrong, outcomes=['done'])).execute()
    assert "'OUTER/INNER/STATE'" in str(caught.value)
    assert ('None' if wrong is None else repr(wrong)) in str(caught.value)
    assert "['done']" in str(caught.value)


def test_an_exception_in_a_state_keeps_its_cause():
    cause = RuntimeError('motor on fire')
    with pytest.raises(
        fsm.InvalidUserCodeError, match=r'OUTER/INNER/STATE.*motor on fire'
    ) as caught:
        nested(Answer(cause, outcomes=['done'])).execute()
    assert caught.value.__cause__ is cause


def test_a_key_nobody_wrote_names_both_its_names_and_what_there_is():
    machine = machine_of(
        function_state(lambda ud: ud.goal, ['goal']), remapping={'goal': 'next_room'}
    )
    machine.userdata.battery = 7
    with pytest.raises(fsm.MissingKeyError) as caught:
        machine.execute()
    assert 'goal' in str(caught.value)
    assert "'next_room'" in str(caught.value)
    assert "['battery']" in str(caught.value)
    assert isinstance(caught.value, KeyError)


def test_views_know_what_they_contain():
    seen = {}

    def look(ud):
        seen.update(keys=ud.keys(), a='a' in ud, b='b' in ud, other='other' in ud)
        return 'done'

    machine = machine_of(function_state(look, ['a', 'b'], ['c']), remapping={'a': 'outer'})
    machine.userdata.outer = 1
    machine.userdata.other = 2
    machine.execute()
    assert seen == {'keys': ['a'], 'a': True, 'b': False, 'other': False}


def test_an_input_is_the_object_itself_with_its_methods():
    class Pose:
        def length(self):
            return 5.0

    pose, seen = Pose(), []
    machine = machine_of(function_state(lambda ud: seen.append(ud.pose) or 'done', ['pose']))
    machine.userdata.pose = pose
    machine.execute()
    assert seen[0] is pose


def test_constants_cannot_be_written():
    machine = machine_of(
        function_state(lambda ud: setattr(ud, 'speed', 2), ['speed'], ['speed']),
        constants={'speed': 1},
    )
    with pytest.raises(fsm.InvalidUserCodeError, match='constant'):
        machine.execute()


def test_what_the_caller_passed_in_is_not_changed():
    transitions, remapping, constants = {'done': 'done'}, {'a': 'b'}, {'c': 1}
    outcomes, keys, connectors = ['done'], ['a'], ['done']
    state = Answer('done', outcomes=['done', 'late'])
    machine = fsm.StateMachine(outcomes, keys, keys)
    with machine:
        fsm.StateMachine.add('A', state, transitions, remapping, constants)
        fsm.StateMachine.add_auto('B', state, connectors, transitions)
    iterator = fsm.Iterator(outcomes, keys, keys, it=[1])
    loop, final = ['done'], {'done': 'done'}
    with iterator:
        fsm.Iterator.set_contained_state('S', Answer('done'), loop, [], final)
    outcome_map = {'done': {'S': 'done'}}
    concurrence = fsm.Concurrence(outcomes, 'done', keys, keys, outcome_map)
    with concurrence:
        fsm.Concurrence.add('S', Answer('done'), remapping)
    iterator.execute()
    concurrence.execute()
    assert (transitions, remapping, constants) == ({'done': 'done'}, {'a': 'b'}, {'c': 1})
    assert (outcomes, keys, connectors) == (['done'], ['a'], ['done'])
    assert (loop, final, outcome_map) == (['done'], {'done': 'done'}, {'done': {'S': 'done'}})


def test_a_label_names_one_state():
    machine = machine_of(Answer('done'))
    with machine, pytest.raises(fsm.InvalidStateError, match='ROOT/STATE'):
        fsm.StateMachine.add('STATE', Answer('done'))
    concurrence = fsm.Concurrence(['done'], 'done')
    with concurrence:
        fsm.Concurrence.add('S', Answer('done'))
        with pytest.raises(fsm.InvalidStateError, match='Concurrence/S'):
            fsm.Concurrence.add('S', Answer('done'))


def test_transitions_bind_only_outcomes_that_there_are():
    with pytest.raises(fsm.InvalidTransitionError, match=r"ROOT/STATE.*'dome'.*'done'"):
        machine_of(Answer('done'), transitions={'dome': 'done'})


@pytest.mark.parametrize('wrong', ['A', Answer, None, object()])
def test_only_states_can_be_added(wrong):
    with pytest.raises((fsm.InvalidStateError, TypeError)):
        machine_of(wrong)


def test_a_machine_that_leads_nowhere_is_not_run(caplog):
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('A', Answer('done'), {'done': 'NOWHERE'})
        fsm.StateMachine.add('B', Answer('late'))
    assert 'NOWHERE' in caplog.text
    with pytest.raises(fsm.InvalidTransitionError) as caught:
        machine.execute()
    assert "'NOWHERE'" in str(caught.value)
    assert "outcome 'late' of state 'B'" in str(caught.value)


def test_an_empty_machine_is_not_run():
    with pytest.raises(fsm.InvalidTransitionError, match='no states'):
        fsm.StateMachine(['done']).execute()


def test_an_error_inside_with_leaves_construction_usable():
    outer, inner = fsm.StateMachine(['done']), fsm.StateMachine(['done'])
    with pytest.raises(RuntimeError), outer, inner.opened():
        raise RuntimeError
    assert not outer.is_opened()
    assert not inner.is_opened()
    with pytest.raises(fsm.InvalidConstructionError, match='no container is open'):
        fsm.StateMachine.add('A', Answer('done'))
    with outer:
        fsm.StateMachine.add('A', Answer('done'))
    assert outer.execute() == 'done'


def test_construction_methods_want_their_own_kind_of_container():
    with (
        fsm.Concurrence(['done'], 'done'),
        pytest.raises(fsm.InvalidConstructionError, match='Concurrence'),
    ):
        fsm.StateMachine.add('A', Answer('done'))
    machine = fsm.StateMachine(['done'])
    with pytest.raises(fsm.InvalidConstructionError, match='closed by accident'):
        machine.assert_opened('closed by accident')
    with pytest.raises(fsm.InvalidStateError, match='not the open container'):
        machine.close()


def test_group_transitions_bind_what_states_leave_open():
    machine = fsm.StateMachine(['done', 'failed'])
    with machine.opened(transitions={'aborted': 'failed'}):
        fsm.StateMachine.add('A', Answer('aborted', outcomes=['aborted', 'done']))
    assert machine.execute() == 'failed'


def test_a_machine_runs_once_at_a_time():
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('A', function_state(lambda ud: machine.execute()))
    with pytest.raises(fsm.InvalidStateError, match='running already'):
        machine.execute()
    assert not machine.is_running()


def test_a_generator_that_breaks_says_so():
    def items():
        yield 1
        raise OSError('disk gone')

    iterator = fsm.Iterator(['done'], [], [], it=items, exhausted_outcome='done')
    iterator.set_name('LOOP')
    state = Answer('more')
    with iterator:
        fsm.Iterator.set_contained_state('S', state, loop_outcomes=['more'])
    with pytest.raises(
        fsm.InvalidUserCodeError, match=r"'LOOP'.*disk gone.*after 1 items"
    ) as caught:
        iterator.execute()
    assert isinstance(caught.value.__cause__, OSError)
    assert state.runs == 1


def test_an_iterator_checks_its_outcomes():
    iterator = fsm.Iterator(['done'], [], [], it=[1])
    with iterator, pytest.raises(fsm.InvalidTransitionError, match="'mroe'"):
        fsm.Iterator.set_contained_state('S', Answer('more'), loop_outcomes=['mroe'])
    with pytest.raises(fsm.InvalidTransitionError, match='no state'):
        iterator.execute()


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        ({'default_outcome': 'nix'}, "'nix' is not one of its outcomes"),
        ({'outcome_map': {'nix': {}}}, "'nix' is not one of its outcomes"),
        ({'outcome_cb': 5}, 'outcome_cb 5 cannot be called'),
        ({'child_termination_cb': 5}, 'child_termination_cb 5 cannot be called'),
    ],
)
def test_a_concurrence_checks_its_policy(arguments, words):
    with pytest.raises(fsm.InvalidStateError, match=words):
        fsm.Concurrence(['done'], **{'default_outcome': 'done', **arguments})


@pytest.mark.parametrize(
    ('wanted', 'words'),
    [({'NIX': 'done'}, "asks for state 'NIX'"), ({'S': 'nix'}, "asks for 'nix' of state 'S'")],
)
def test_a_concurrence_checks_its_outcome_map_against_its_states(wanted, words):
    concurrence = fsm.Concurrence(['done'], 'done', outcome_map={'done': wanted})
    with concurrence:
        fsm.Concurrence.add('S', Answer('done'))
    with pytest.raises(fsm.InvalidTransitionError, match=words):
        concurrence.execute()


def test_errors_have_smachs_message_and_one_base():
    error = fsm.InvalidStateError('words')
    assert error.message == 'words' == str(error)
    for kind in (
        fsm.InvalidStateError,
        fsm.InvalidTransitionError,
        fsm.InvalidConstructionError,
        fsm.InvalidUserCodeError,
    ):
        assert issubclass(kind, fsm.SmachError)
