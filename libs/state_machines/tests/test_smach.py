"""SMACH's names, signatures and ways, as machines written for noetic rely on them."""

# The tests of SMACH name one container after another alike.
# mypy: disable-error-code="assignment, attr-defined"

from __future__ import annotations

import inspect

import pytest

import state_machines as smach


def names_of(function):
    return [name for name in inspect.signature(function).parameters if name != 'self']


@pytest.mark.parametrize(
    ('function', 'expected'),
    [
        (smach.State.__init__, 'outcomes input_keys output_keys io_keys'),
        (
            smach.CBState.__init__,
            'cb cb_args cb_kwargs outcomes input_keys output_keys io_keys',
        ),
        (smach.StateMachine.__init__, 'outcomes input_keys output_keys'),
        (smach.StateMachine.add, 'label state transitions remapping constants'),
        (
            smach.StateMachine.add_auto,
            'label state connector_outcomes transitions remapping',
        ),
        (smach.Sequence.__init__, 'outcomes connector_outcome'),
        (smach.Sequence.add, 'label state transitions remapping'),
        (
            smach.Concurrence.__init__,
            'outcomes default_outcome input_keys output_keys outcome_map outcome_cb '
            'child_termination_cb',
        ),
        (smach.Concurrence.add, 'label state remapping'),
        (
            smach.Iterator.__init__,
            'outcomes input_keys output_keys it it_label exhausted_outcome',
        ),
        (
            smach.Iterator.set_contained_state,
            'label state loop_outcomes break_outcomes final_outcome_map',
        ),
        (smach.Iterator.set_iteritems, 'it it_label'),
        (smach.Remapper.__new__, 'cls ud input_keys output_keys remapping'),
        (smach.UserData.extract, 'keys remapping'),
        (smach.UserData.merge, 'ud keys remapping'),
        (smach.set_loggers, 'info warn debug error'),
        (smach.Container.register_start_cb, 'start_cb cb_args'),
        (smach.Container.register_transition_cb, 'transition_cb cb_args'),
        (smach.Container.register_termination_cb, 'termination_cb cb_args'),
    ],
)
def test_arguments_have_the_names_and_order_of_smach(function, expected):
    assert names_of(function)[: len(expected.split())] == expected.split()


def test_the_foo_bar_machine_of_the_tutorial_runs_unchanged():
    class Foo(smach.State):
        def __init__(self):
            smach.State.__init__(
                self,
                outcomes=['outcome1', 'outcome2'],
                input_keys=['foo_counter_in'],
                output_keys=['foo_counter_out'],
            )

        def execute(self, userdata):
            if userdata.foo_counter_in < 3:
                userdata.foo_counter_out = userdata.foo_counter_in + 1
                return 'outcome1'
            return 'outcome2'

    class Bar(smach.State):
        def __init__(self):
            smach.State.__init__(self, outcomes=['outcome1'], input_keys=['bar_counter_in'])
            self.seen = []

        def execute(self, userdata):
            self.seen.append(userdata.bar_counter_in)
            return 'outcome1'

    bar = Bar()
    sm = smach.StateMachine(outcomes=['outcome4'])
    sm.userdata.sm_counter = 0
    with sm:
        smach.StateMachine.add(
            'FOO',
            Foo(),
            transitions={'outcome1': 'BAR', 'outcome2': 'outcome4'},
            remapping={'foo_counter_in': 'sm_counter', 'foo_counter_out': 'sm_counter'},
        )
        smach.StateMachine.add(
            'BAR',
            bar,
            transitions={'outcome1': 'FOO'},
            remapping={'bar_counter_in': 'sm_counter'},
        )
    assert sm.execute() == 'outcome4'
    assert bar.seen == [1, 2, 3]


def test_the_concurrence_of_the_tutorial_runs_unchanged():
    class Foo(smach.State):
        def __init__(self):
            smach.State.__init__(self, outcomes=['outcome1', 'outcome2'])
            self.counter = 0

        def execute(self, userdata):
            self.counter += 1
            return 'outcome1' if self.counter <= 2 else 'outcome2'

    class Bar(smach.State):
        def __init__(self):
            smach.State.__init__(self, outcomes=['outcome1'])

        def execute(self, userdata):
            return 'outcome1'

    sm_top = smach.StateMachine(outcomes=['outcome6'])
    with sm_top:
        sm_con = smach.Concurrence(
            outcomes=['outcome4', 'outcome5'],
            default_outcome='outcome4',
            outcome_map={'outcome5': {'FOO': 'outcome2', 'BAR': 'outcome1'}},
        )
        with sm_con:
            smach.Concurrence.add('FOO', Foo())
            smach.Concurrence.add('BAR', Bar())
        smach.StateMachine.add(
            'CON', sm_con, transitions={'outcome4': 'CON', 'outcome5': 'outcome6'}
        )
    assert sm_top.execute() == 'outcome6'
    assert sm_con['FOO'].counter == 3


def test_the_iterator_of_the_tutorial_runs_unchanged():
    sm = smach.StateMachine(outcomes=['succeeded', 'aborted', 'preempted'])
    with sm:
        sm.userdata.nums = range(25, 36, 2)
        sm.userdata.even_nums = []
        sm.userdata.odd_nums = []
        tutorial_it = smach.Iterator(
            outcomes=['succeeded', 'preempted', 'aborted'],
            input_keys=['nums', 'even_nums', 'odd_nums'],
            it=lambda: range(0, len(sm.userdata.nums)),
            output_keys=['even_nums', 'odd_nums'],
            it_label='index',
            exhausted_outcome='succeeded',
        )
        with tutorial_it:
            container_sm = smach.StateMachine(
                outcomes=['succeeded', 'preempted', 'aborted', 'continue'],
                input_keys=['nums', 'index', 'even_nums', 'odd_nums'],
                output_keys=['even_nums', 'odd_nums'],
            )
            with container_sm:

                @smach.cb_interface(input_keys=['nums', 'index'], outcomes=['true', 'false'])
                def odd_cond(ud):
                    return 'true' if ud.nums[ud.index] % 2 else 'false'

                smach.StateMachine.add(
                    'EVEN_OR_ODD', smach.CBState(odd_cond), {'true': 'ODD', 'false': 'EVEN'}
                )

                @smach.cb_interface(
                    input_keys=['nums', 'index', 'even_nums'],
                    output_keys=['even_nums'],
                    outcomes=['succeeded'],
                )
                def even_cb(ud):
                    ud.even_nums.append(ud.nums[ud.index])
                    return 'succeeded'

                smach.StateMachine.add('EVEN', smach.CBState(even_cb), {'succeeded': 'continue'})

                @smach.cb_interface(
                    input_keys=['nums', 'index', 'odd_nums'],
                    output_keys=['odd_nums'],
                    outcomes=['succeeded'],
                )
                def odd_cb(ud):
                    ud.odd_nums.append(ud.nums[ud.index])
                    return 'succeeded'

                smach.StateMachine.add('ODD', smach.CBState(odd_cb), {'succeeded': 'continue'})
            smach.Iterator.set_contained_state(
                'CONTAINER_STATE', container_sm, loop_outcomes=['continue']
            )
        smach.StateMachine.add(
            'TUTORIAL_IT', tutorial_it, {'succeeded': 'succeeded', 'aborted': 'aborted'}
        )
    assert sm.execute() == 'succeeded'
    assert sm.userdata.odd_nums == [25, 27, 29, 31, 33, 35]
    assert sm.userdata.even_nums == []


def test_a_sequence_connects_its_states_but_for_what_they_bind_themselves():
    seen = []

    def state(name, outcome='succeeded'):
        def cb(ud):
            seen.append(name)
            return outcome

        return smach.CBState(cb, outcomes=['succeeded', 'aborted'])

    seq = smach.Sequence(outcomes=['succeeded', 'aborted'], connector_outcome='succeeded')
    with seq:
        smach.Sequence.add('A', state('A'))
        smach.Sequence.add('B', state('B'), {'succeeded': 'D'})
        smach.Sequence.add('C', state('C'))
        smach.Sequence.add('D', state('D'))
    assert seq.execute() == 'succeeded'
    assert seen == ['A', 'B', 'D']


def test_add_auto_connects_to_the_next_state_but_for_what_is_bound():
    ok = smach.CBState(lambda ud: 'ok', outcomes=['ok', 'ko'])
    sm = smach.StateMachine(['ok', 'ko'])
    with sm:
        smach.StateMachine.add_auto('A', ok, ['ok', 'ko'], {'ko': 'ko'})
        smach.StateMachine.add('B', smach.CBState(lambda ud: 'ok', outcomes=['ok']))
    assert sorted(sm.get_internal_edges()) == [
        ('ko', 'A', 'ko'),
        ('ok', 'A', 'B'),
        ('ok', 'B', None),
    ]


def test_callbacks_get_userdata_states_and_their_own_arguments():
    calls: list[tuple[object, ...]] = []
    sm = smach.StateMachine(['ok'])
    with sm:
        smach.StateMachine.add('A', smach.CBState(lambda ud: 'ok', outcomes=['ok']), {'ok': 'B'})
        smach.StateMachine.add('B', smach.CBState(lambda ud: 'ok', outcomes=['ok']))
    sm.register_start_cb(lambda ud, states, *args: calls.append(('start', states, args)), [1])
    sm.register_transition_cb(lambda ud, states, *args: calls.append(('go', states, args)), [2])
    sm.register_termination_cb(
        lambda ud, states, outcome, *args: calls.append(('end', states, outcome, args)), [3]
    )
    sm.execute()
    assert calls == [
        ('start', ['A'], (1,)),
        ('go', ['B'], (2,)),
        ('end', ['B'], 'ok', (3,)),
    ]


def test_a_callback_that_raises_is_logged_and_disturbs_nothing():
    errors = []
    smach.set_loggers(lambda m: None, lambda m: None, lambda m: None, errors.append)
    try:
        sm = smach.StateMachine(['ok'])
        with sm:
            smach.StateMachine.add('A', smach.CBState(lambda ud: 'ok', outcomes=['ok']))
        sm.register_start_cb(lambda *args: 1 / 0)
        assert sm.execute() == 'ok'
    finally:
        smach.reset_loggers()
    assert 'ZeroDivisionError' in errors[0]


def test_registered_keys_and_outcomes_can_grow_after_construction():
    state = smach.CBState(lambda ud: setattr(ud, 'x', ud.x + 1) or 'late', outcomes=['ok'])
    sm = smach.StateMachine(['late', 'ok'])
    state.register_outcomes(['late'])
    with sm:
        smach.StateMachine.add('A', state)
    state.register_io_keys(['x'])
    sm.userdata.x = 1
    assert sm.execute() == 'late'
    assert sm.userdata.x == 2
    assert state.get_registered_input_keys() == ('x',)
    assert state.get_registered_output_keys() == ('x',)


def test_cb_interface_keeps_what_it_is_given():
    @smach.cb_interface(outcomes=['ok'], input_keys=['a'], output_keys=['b'])
    def cb(ud):
        return 'ok'

    assert isinstance(cb, smach.CBInterface)
    assert smach.has_smach_interface(cb)
    assert not smach.has_smach_interface(lambda ud: 'ok')
    assert cb.get_registered_outcomes() == ('ok',)
    both = smach.CBInterface(cb, io_keys=['c'])
    assert both.get_registered_input_keys() == both.get_registered_output_keys() == ('c',)


def test_loggers_receive_the_transitions():
    lines = []
    smach.set_loggers(lines.append, lines.append, lines.append, lines.append)
    try:
        sm = smach.StateMachine(['ok'])
        with sm:
            smach.StateMachine.add('A', smach.CBState(lambda ud: 'ok', outcomes=['ok']))
        sm.execute()
    finally:
        smach.reset_loggers()
    assert any("'A' : 'ok' --> 'ok'" in line for line in lines)


def test_the_shutdown_check_ends_a_machine_between_two_states():
    turns = []
    sm = smach.StateMachine(['ok'])
    with sm:
        smach.StateMachine.add(
            'A',
            smach.CBState(lambda ud: turns.append(1) or 'again', outcomes=['again']),
            {'again': 'A'},
        )
    smach.set_shutdown_check(lambda: len(turns) >= 3)
    try:
        assert not smach.is_shutdown()
        assert sm.execute() is None
        assert smach.is_shutdown()
    finally:
        smach.set_shutdown_check(None)
    assert len(turns) == 3


@pytest.mark.parametrize('kind', ['machine', 'iterator', 'concurrence'])
def test_the_shutdown_check_ends_what_is_inside_and_the_root(kind):
    turns = []
    state = smach.CBState(lambda ud: turns.append(1) or 'again', outcomes=['again'])
    inner, outer = smach.StateMachine(['never']), smach.StateMachine(['never', 'exhausted'])
    if kind == 'machine':
        inner.add_state('A', state, {'again': 'A'})
    elif kind == 'iterator':
        inner = smach.Iterator([], [], [], it=range(1000))
        inner.set_state('A', state, loop_outcomes=['again'])
    else:
        loop = smach.StateMachine(['never'])
        loop.add_state('A', state, {'again': 'A'})
        inner = smach.Concurrence(['never'], 'never')
        inner.add_state('LOOP', loop)
    outer.add_state('INNER', inner)
    smach.set_shutdown_check(lambda: len(turns) >= 3)
    try:
        assert outer.execute() is None
    finally:
        smach.set_shutdown_check(None)
    assert len(turns) == 3
    assert outer.get_active_states() == []


def test_get_and_set_initial_state():
    sm = smach.StateMachine(['ok'])
    seen = []
    with sm:
        for name in 'AB':
            smach.StateMachine.add(
                name,
                smach.CBState(lambda ud, name=name: seen.append(name) or 'ok', outcomes=['ok']),
            )
    userdata = smach.UserData()
    userdata.x = 5
    sm.set_initial_state(['B'], userdata)
    assert sm.get_initial_states() == ['B']
    sm.execute()
    assert seen == ['B']
    assert sm.userdata.x == 5
    with pytest.raises(smach.InvalidStateError, match="cannot begin with 'C'"):
        sm.set_initial_state(['C'])


def test_children_by_item_and_what_is_active():
    active = []
    sm = smach.StateMachine(['ok'])
    with sm:
        state = smach.StateMachine.add(
            'A',
            smach.CBState(
                lambda ud: active.append(sm.get_active_states()) or 'ok', outcomes=['ok']
            ),
        )
    assert sm['A'] is state
    assert sm.get_children() == {'A': state}
    assert sm.get_active_states() == []
    assert not sm.is_running()
    sm.execute()
    assert active == [['A']]
    with pytest.raises(KeyError, match='B'):
        sm['B']


def test_keys_and_constants_reach_a_nested_machine_and_come_back():
    def add(ud):
        ud.sum = ud.a + ud.b
        return 'ok'

    inner = smach.StateMachine(['ok'], input_keys=['a', 'b'], output_keys=['sum'])
    with inner:
        smach.StateMachine.add(
            'ADD', smach.CBState(add, outcomes=['ok'], input_keys=['a', 'b'], output_keys=['sum'])
        )
    outer = smach.StateMachine(['ok'], input_keys=['start'], output_keys=['end'])
    with outer:
        smach.StateMachine.add(
            'INNER', inner, remapping={'a': 'start', 'sum': 'end'}, constants={'b': 5}
        )
    userdata = smach.UserData()
    userdata.start = 1
    assert outer.execute(userdata) == 'ok'
    assert userdata.end == 6
    assert 'b' not in outer.userdata
