"""Watching and steering a machine over ROS."""

from __future__ import annotations

import json

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

from libs.state_machines.tests.states import Answer, Background, began
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import (
    FsmStatus,
    FsmStructure,
    FsmTransition,
    SmachContainerStatus,
)
from surveillance_interfaces.srv import ForceOutcome, SetAutonomy, SetInitialState

from .ros_servers import introspected

LATCHED = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def watched(graph):
    with introspected(graph.node) as seen:
        yield seen


def call(graph, kind, name, **fields):
    caller = ServiceCaller(graph.node, kind, f'robot/fsm/{name}')
    return caller.call(kind.Request(**fields), timeout=60.0)


def test_every_transition_is_published_and_numbered_also_to_those_who_come_late(graph, watched):
    root, waiter = watched
    run = Background(root)
    began(waiter)
    assert call(graph, ForceOutcome, 'force_outcome', path='PATROL/INNER/WAIT', outcome='done')
    assert run.result() == 'done'
    transitions = graph.listen(FsmTransition, 'robot/fsm/transition', LATCHED)
    graph.until(lambda: len(transitions) == 4)
    assert [
        (t.sequence, t.path, t.from_state, t.outcome, t.to_state, t.kind, t.visits)
        for t in transitions
    ] == [
        (1, 'PATROL', 'FIRST', 'done', 'INNER', 'transition', 1),
        (2, 'PATROL/INNER', 'WAIT', 'done', 'LAST', 'forced', 1),
        (3, 'PATROL/INNER', 'LAST', 'done', 'done', 'exit', 1),
        (4, 'PATROL', 'INNER', 'done', 'done', 'exit', 1),
    ]
    assert transitions[0].userdata_keys == ['level']
    assert json.loads(transitions[0].userdata_values[0]) == 7
    assert all(t.duration >= 0.0 for t in transitions)


def test_the_structure_is_published(graph, watched):
    structures = graph.listen(FsmStructure, 'robot/fsm/structure', LATCHED)
    structure = graph.until(lambda: structures and structures[0])
    assert [container.path for container in structure.containers] == ['PATROL', 'PATROL/INNER']
    root = structure.containers[0]
    assert (root.kind, list(root.states), list(root.initial_states)) == (
        'StateMachine',
        ['FIRST', 'INNER'],
        ['FIRST'],
    )
    assert ('FIRST', 'done', 'INNER') in [
        (edge.from_state, edge.outcome, edge.to_state) for edge in root.edges
    ]
    assert structure.mermaid.startswith('stateDiagram-v2')


def test_a_machine_is_paused_stepped_and_resumed(graph, watched):
    root, waiter = watched
    statuses = graph.listen(FsmStatus, 'robot/fsm/status', LATCHED)
    assert not call(graph, Trigger, 'step').success
    assert call(graph, Trigger, 'pause').success
    run = Background(root)
    graph.until(lambda: statuses and statuses[-1].paused and statuses[-1].running)
    assert list(statuses[-1].active) == ['PATROL/FIRST']
    assert root['FIRST'].runs == 0
    assert call(graph, Trigger, 'step').success
    graph.until(
        lambda: (
            statuses[-1].active == ['PATROL/INNER', 'PATROL/INNER/WAIT']
            or None
            or statuses[-1].sequence == 1
        )
    )
    assert waiter.runs == 0
    assert call(graph, Trigger, 'resume').success
    began(waiter)
    root.request_preempt()
    assert run.result() == 'preempted'


def test_a_transition_above_the_level_waits_until_a_person_approves(graph, watched):
    root, waiter = watched
    root.add_state(
        'ASKS',
        Answer('go', outcomes=['go', 'no']),
        {'go': 'INNER', 'no': 'done'},
        autonomy={'go': 2},
    )
    root.set_initial_state(['ASKS'])
    statuses = graph.listen(FsmStatus, 'robot/fsm/status', LATCHED)
    answer = call(graph, SetAutonomy, 'set_autonomy', level=9)
    assert not answer.success
    assert 'expected one of 0 (OFF)' in answer.message
    assert call(graph, SetAutonomy, 'set_autonomy', level=1).success
    run = Background(root)
    (question,) = graph.until(lambda: statuses and statuses[-1].questions)
    assert (question.path, question.outcome, question.to_state) == ('PATROL/ASKS', 'go', 'INNER')
    assert statuses[-1].autonomy == 1
    assert not call(graph, ForceOutcome, 'approve', outcome='nix').success
    assert call(graph, ForceOutcome, 'approve').success
    began(waiter)
    graph.until(lambda: not statuses[-1].questions)
    root.request_preempt()
    assert run.result() == 'preempted'


def test_a_preempt_goes_through_a_pause(graph, watched):
    root, _ = watched
    root.control.pause()
    run = Background(root)
    root.request_preempt()
    root.control.resume()
    assert run.result() == 'preempted'


def test_the_initial_state_is_set_with_userdata(graph, watched):
    root, waiter = watched
    smach = graph.listen(SmachContainerStatus, 'robot/smach/container_status', LATCHED)
    answer = call(
        graph,
        SetInitialState,
        'set_initial_state',
        path='PATROL',
        initial_states=['INNER'],
        userdata='{"level": 50}',
    )
    assert answer.success, answer.message
    # Viewers of SMACH's topics see it, too.
    told = ('/PATROL', ['INNER'])
    graph.until(lambda: told in [(each.path, each.initial_states) for each in smach])
    run = Background(root)
    began(waiter)
    assert root['FIRST'].runs == 0
    assert root.userdata.level == 50
    root.request_preempt()
    run.result()


@pytest.mark.parametrize(
    ('fields', 'words'),
    [
        ({'path': 'PATROL/NIX'}, "no state 'NIX'"),
        ({'path': 'OTHER'}, 'PATROL'),
        ({'path': 'PATROL/FIRST'}, 'not a container'),
        ({'path': 'PATROL', 'initial_states': ['NIX']}, "'NIX'"),
        ({'path': 'PATROL', 'userdata': '[1]'}, 'JSON object'),
        ({'path': 'PATROL', 'userdata': '{'}, ''),
    ],
)
def test_a_wrong_initial_state_is_answered_with_a_reason(graph, watched, fields, words):
    answer = call(graph, SetInitialState, 'set_initial_state', **fields)
    assert not answer.success
    assert words in answer.message
    assert answer.message


def test_a_wrong_outcome_is_not_forced(graph, watched):
    root, waiter = watched
    run = Background(root)
    began(waiter)
    for path, outcome, words in (
        ('PATROL/FIRST', 'done', 'not active'),
        ('PATROL/INNER/WAIT', 'nix', "'nix'"),
    ):
        answer = call(graph, ForceOutcome, 'force_outcome', path=path, outcome=outcome)
        assert not answer.success
        assert words in answer.message
    root.request_preempt()
    assert run.result() == 'preempted'
