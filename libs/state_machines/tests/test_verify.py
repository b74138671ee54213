"""What can be known of a machine before it runs, and drawn."""

from __future__ import annotations

import sys
import time

import state_machines as fsm
from state_machines.export import to_ascii, to_graphviz, to_mermaid
from state_machines.verify import verify

from .states import Answer, Waiter


def keyed(reads=(), writes=(), outcomes=('done',)):
    return fsm.CBState(
        lambda ud: outcomes[0], outcomes=outcomes, input_keys=reads, output_keys=writes
    )


def machine_of(states, outcomes=('done',), **arguments):
    """Build a machine of {label: (state, transitions, remapping)}."""
    machine = fsm.StateMachine(outcomes, **arguments)
    machine.set_name('ROOT')
    with machine:
        for label, (state, *rest) in states.items():
            fsm.StateMachine.add(label, state, *rest)
    return machine


def found(machine, keys=()):
    return {(f.severity, f.check, f.path) for f in verify(machine, keys)}


def test_a_sound_machine_has_no_findings():
    inner = machine_of({'WAIT': (Waiter(),)}, ['done', 'preempted'])
    assert not found(
        machine_of(
            {'A': (Answer('done'), {'done': 'INNER'}), 'INNER': (inner,)}, ['done', 'preempted']
        )
    )


def test_states_that_nothing_leads_to():
    machine = machine_of({'A': (Answer('done'),), 'B': (Answer('done'), {'done': 'A'})})
    assert found(machine) == {('error', 'unreachable', 'ROOT/B')}


def test_outcomes_that_lead_nowhere_also_deep_inside():
    inner = machine_of({'A': (Answer('done', outcomes=['done', 'lost']),)})
    machine = machine_of({'INNER': (inner,)})
    (finding,) = verify(machine)
    assert (finding.severity, finding.check, finding.path) == ('error', 'unbound', 'ROOT/INNER')
    assert "'lost'" in finding.message


def test_containers_and_states_without_a_way_out():
    endless = machine_of(
        {'A': (Answer('done'), {'done': 'B'}), 'B': (Answer('done'), {'done': 'A'})}
    )
    assert found(endless) == {('error', 'no-exit', 'ROOT')}
    trap = machine_of(
        {
            'A': (Answer('done', outcomes=['done', 'bad']), {'bad': 'TRAP'}),
            'TRAP': (Answer('done'), {'done': 'TRAP'}),
        }
    )
    assert found(trap) == {('error', 'no-exit', 'ROOT/TRAP')}


def test_a_key_that_nobody_writes_is_an_error_and_one_that_some_write_a_warning():
    machine = machine_of(
        {
            'A': (keyed((), ['x'], ['left', 'right']), {'left': 'B', 'right': 'C'}),
            'B': (keyed((), ['y']), {'done': 'C'}),
            'C': (keyed(['x', 'y', 'z']),),
        }
    )
    assert found(machine) == {
        ('error', 'unset-key', 'ROOT/C'),
        ('warning', 'unset-key', 'ROOT/C'),
    }
    assert [f.message.split("'")[1] for f in verify(machine)] == ['z', 'y']
    assert not verify(machine, ['y', 'z'])
    machine.userdata.y = machine.userdata.z = None
    assert not verify(machine)


def test_keys_are_followed_through_remappings_and_nested_containers():
    inner = machine_of(
        {'READ': (keyed(['goal'], ['path']),)}, input_keys=['goal'], output_keys=['path']
    )
    machine = machine_of(
        {
            'CHOOSE': (keyed((), ['next_room']), {'done': 'PLAN'}),
            'PLAN': (inner, {'done': 'DRIVE'}, {'goal': 'next_room', 'path': 'via'}),
            'DRIVE': (keyed(['way']), None, {'way': 'via'}),
        }
    )
    assert not found(machine)
    broken = machine_of(
        {
            'CHOOSE': (keyed((), ['next_room']), {'done': 'PLAN'}),
            'PLAN': (inner, {'done': 'DRIVE'}, {'goal': 'room', 'path': 'via'}),
            'DRIVE': (keyed(['way']), None, {'way': 'vai'}),
        }
    )
    assert found(broken) == {
        ('error', 'unset-key', 'ROOT/PLAN/READ'),
        ('error', 'unset-key', 'ROOT/DRIVE'),
    }


# What nothing produces, mistyped remappings, two writers, loops.


def test_an_outcome_that_nothing_inside_produces():
    machine = machine_of({'A': (Answer('done'),)}, ['done', 'aborted'])
    (finding,) = verify(machine)
    assert (finding.severity, finding.check, finding.path) == ('warning', 'unproduced', 'ROOT')
    assert "'aborted'" in finding.message
    both = fsm.Concurrence(['all', 'some', 'never', 'preempted'], 'some', outcome_map={'all': {}})
    with both:
        fsm.Concurrence.add('A', Answer('done'))
    assert [f.message for f in verify(both)] == ["nothing inside produces its outcome 'never'"]


def test_a_loop_whose_only_way_out_nothing_produces():
    inner = machine_of({'A': (Answer('done'),)}, ['done', 'stop'])
    machine = machine_of({'INNER': (inner, {'done': 'INNER', 'stop': 'done'})})
    assert ('error', 'no-exit', 'ROOT') in found(machine)
    behind = machine_of(
        {'INNER': (inner, {'done': 'done', 'stop': 'AFTER'}), 'AFTER': (Answer('done'),)}
    )
    assert ('error', 'unreachable', 'ROOT/AFTER') in found(behind)


def test_a_remapping_of_a_key_that_the_state_does_not_declare():
    machine = machine_of({'A': (keyed(['goal']), None, {'gaol': 'room'})})
    machine.userdata.goal = 1
    (finding,) = verify(machine)
    assert (finding.severity, finding.check, finding.path) == ('error', 'remapping', 'ROOT/A')
    assert "'gaol'" in finding.message
    wrong = machine_of({'A': (keyed(), None, None, {'speed': 1.0})})
    assert found(wrong) == {('error', 'remapping', 'ROOT/A')}


def test_two_states_of_a_concurrence_that_write_one_key():
    both = fsm.Concurrence(['done'], 'done')
    with both:
        fsm.Concurrence.add('A', keyed((), ['x']))
        fsm.Concurrence.add('B', keyed((), ['y']), {'y': 'x'})
        fsm.Concurrence.add('C', keyed((), ['z']))
    (finding,) = verify(both)
    assert (finding.severity, finding.check) == ('warning', 'two-writers')
    assert "'x' is written by ['A', 'B']" in finding.message


class Writes(fsm.State):
    def __init__(self, reads=(), writes=()):
        super().__init__(['done', 'more'], reads, writes)


def chained(width):
    machine = fsm.StateMachine(['done'])
    with machine:
        for number in range(width):
            following = {'more': f'S{number + 1}'} if number + 1 < width else {'more': 'S0'}
            reads = [f'k{number - 1}'] if number else []
            fsm.StateMachine.add(f'S{number}', Writes(reads, [f'k{number}']), following)
    return machine


def nested(depth):
    machine = fsm.StateMachine(['done'], ['k'], ['k'])
    with machine:
        if depth:
            fsm.StateMachine.add('IN', nested(depth - 1), {'done': 'A'})
        fsm.StateMachine.add('A', Writes(['k'], ['k']), {'more': 'B'})
        fsm.StateMachine.add('B', Writes(['k'], ['k']), {'more': 'A'})
    return machine


def test_the_work_grows_with_the_size_alone():
    def work(machine):
        """Return how many functions are called: seconds depend on the machine."""
        calls = []
        sys.setprofile(lambda _frame, event, _of: calls.append(event))
        try:
            findings = verify(machine, ['k'])
        finally:
            sys.setprofile(None)
        assert findings == []
        return len(calls)

    assert work(chained(2000)) < 12 * work(chained(200))
    assert work(nested(60)) < 4 * work(nested(30))


def test_constants_count_as_written():
    machine = machine_of({'A': (keyed(['speed']), None, None, {'speed': 1.0})})
    assert not found(machine)


def test_a_loop_that_writes_on_the_way_round_is_only_a_warning():
    machine = machine_of(
        {
            'A': (keyed(['last'], (), ['go', 'done']), {'go': 'B'}),
            'B': (keyed((), ['last']), {'done': 'A'}),
        }
    )
    assert found(machine) == {('warning', 'unset-key', 'ROOT/A')}


def test_iterators_and_concurrences_are_followed():
    iterator = fsm.Iterator(['done'], [], ['sum'], it=[1], it_label='x', exhausted_outcome='done')
    with iterator:
        fsm.Iterator.set_contained_state('S', keyed(['x'], ['sum']), ['done'])
    concurrence = fsm.Concurrence(['done'], 'done', ['sum'], ['a'])
    with concurrence:
        fsm.Concurrence.add('A', keyed(['sum'], ['a']))
        fsm.Concurrence.add('B', keyed(['a']))
    machine = machine_of(
        {
            'LOOP': (iterator, {'done': 'BOTH'}),
            'BOTH': (concurrence, {'done': 'END'}),
            'END': (keyed(['sum', 'a']),),
        }
    )
    # B may look before A has written.
    assert ('warning', 'unset-key', 'ROOT/BOTH/B') in found(machine)
    assert ('error', 'unset-key', 'ROOT/BOTH/B') not in found(machine)
    assert not {f for f in found(machine) if f[2] == 'ROOT/END' and f[0] == 'error'}


def test_interrupts_are_entered_from_anywhere():
    machine = machine_of({'A': (keyed((), ['x']), {'done': 'B'}), 'B': (Answer('done'),)})
    machine.add_interrupt('STOP', keyed(['x', 'y']))
    assert found(machine) == {
        ('warning', 'unset-key', 'ROOT/STOP'),
        ('error', 'unset-key', 'ROOT/STOP'),
    }
    assert 'unreachable' not in {check for _, check, _ in found(machine)}


def test_what_an_interrupt_of_a_container_writes_may_be_there_after_it():
    inner = machine_of({'A': (Answer('done'),)}, output_keys=['x', 'y'])
    inner.add_interrupt('STOP', keyed((), ['x']))
    machine = machine_of({'INNER': (inner, {'done': 'B'}), 'B': (keyed(['x', 'y']),)})
    unset = {f.message.split("'")[1]: f.severity for f in verify(machine) if f.path == 'ROOT/B'}
    assert unset == {'x': 'warning', 'y': 'error'}


class Sleeps(fsm.State):
    def __init__(self):
        super().__init__(['done'])

    def execute(self, ud):
        time.sleep(5.0)
        return 'done'


def sleeps(ud):
    time.sleep(1)
    return 'done'


class Loops(fsm.State):
    def __init__(self):
        super().__init__(['done'])

    def execute(self, ud):
        while ud:
            pass
        return 'done'


class LoopsAndLooks(Loops):
    def execute(self, ud):
        while not self.preempt_requested():
            pass
        return 'done'


def test_states_that_would_not_hear_a_preempt():
    machine = machine_of(
        {
            'A': (Sleeps(), {'done': 'B'}),
            'B': (Loops(), {'done': 'C'}),
            'C': (LoopsAndLooks(), {'done': 'D'}),
            'D': (Waiter(), {'done': 'E', 'preempted': 'E'}),
            'E': (fsm.CBState(sleeps, outcomes=['done']),),
        }
    )
    assert found(machine) == {('warning', 'deaf', f'ROOT/{label}') for label in 'ABE'}


def test_drawings_show_every_state_and_transition():
    inner = machine_of({'WAIT': (Waiter(), {'done': 'arrived'})}, ['arrived', 'preempted'])
    machine = machine_of(
        {'A': (Answer('done', 'again'), {'done': 'INNER', 'again': 'A'}), 'INNER': (inner,)},
        ['arrived', 'preempted'],
    )
    machine.add_interrupt('CHARGE', Answer('full'))
    mermaid, dot, text = to_mermaid(machine), to_graphviz(machine), to_ascii(machine)
    assert mermaid.startswith('stateDiagram-v2\n')
    for line in (
        'state "INNER" as ROOT_2f_INNER {',
        '[*] --> ROOT_2f_A',
        'ROOT_2f_A --> ROOT_2f_INNER : done',
        'ROOT_2f_A --> ROOT_2f_A : again',
        'ROOT_2f_INNER_2f_WAIT --> [*] : done → arrived',
        'ROOT_2f_CHARGE --> ROOT_2f_CHARGE : full (resume)',
    ):
        assert line in mermaid
    assert mermaid.count('{') == mermaid.count('}') == 1
    assert '"ROOT/A" -> "ROOT/INNER/WAIT" [label="done", lhead="cluster_ROOT/INNER"];' in dot
    assert '"ROOT/INNER/WAIT" -> "ROOT/INNER:arrived" [label="done"];' in dot
    assert dot.count('{') == dot.count('}')
    assert text.splitlines() == [
        'ROOT (StateMachine) ends with arrived, preempted',
        '|-* A  done -> INNER; again -> A',
        '|-  INNER (StateMachine)  arrived -> [arrived]; preempted -> [preempted]',
        '|    `-* WAIT  done -> [arrived]; preempted -> [preempted]',
        '`-  CHARGE !  full -> RESUME',
    ]


def test_drawings_of_concurrences_show_states_side_by_side():
    concurrence = fsm.Concurrence(['done'], 'done', outcome_map={'done': {'A': 'done'}})
    with concurrence:
        fsm.Concurrence.add('A', Answer('done'))
        fsm.Concurrence.add('B', Answer('done'))
    assert '--\n' in to_mermaid(concurrence)
    assert '"Concurrence/A"' in to_graphviz(concurrence)
    assert 'B' in to_ascii(concurrence)


def test_names_with_quotes_are_drawn():
    machine = fsm.StateMachine(['done'])
    with machine:
        fsm.StateMachine.add('SAY "HELLO"', Answer('done'))
    assert '[label="SAY \\"HELLO\\""' in to_graphviz(machine)
    assert 'state "SAY #quot;HELLO#quot;" as' in to_mermaid(machine)
