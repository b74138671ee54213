"""A machine that serves an action."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import Point

import state_machines as fsm
from libs.state_machines.tests.states import Answer, Background, Waiter, began
from state_machines.ros import (
    ActionServerWrapper,
)
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.node import PatrolNode

from .ros_servers import (
    LONG,
    action,
    machine_of,
)


def wrapped(graph, container, **arguments):
    server = graph.add(PatrolNode, name='server')
    return ActionServerWrapper(
        server,
        'follow_path',
        FollowPath,
        container,
        succeeded_outcomes=['done'],
        aborted_outcomes=['aborted'],
        preempted_outcomes=['preempted'],
        **arguments,
    )


def container_of(state):
    container = fsm.StateMachine(
        ['done', 'aborted', 'preempted'], input_keys=['path'], output_keys=['position']
    )
    with container:
        fsm.StateMachine.add('STATE', state)
    return container


def test_the_states_inside_find_the_actions_own_messages(graph):
    """As a machine written for SMACH of ROS 2 does, which never calls `run_server`."""
    seen = []

    def look(ud):
        seen.append(ud.action_goal.path[0].x)
        return 'done'

    state = fsm.CBState(look, outcomes=['done'], input_keys=['action_goal'])
    wrapped(graph, container_of(state)).run_server()
    goal = {'path': [Point(x=4.0)]}
    assert machine_of(action(graph.node, goal_slots=['path']), goal).execute() == 'succeeded'
    assert seen == [4.0]


def test_a_machine_serves_an_action(graph):
    def drive(ud):
        ud.position = ud.path[-1]
        return 'done'

    state = fsm.CBState(drive, outcomes=['done'], input_keys=['path'], output_keys=['position'])
    wrapped(graph, container_of(state), expand_goal_slots=True, pack_result_slots=True)
    client = machine_of(
        action(graph.node, goal_slots=['path'], result_slots=['position']),
        {'path': [Point(x=4.0)]},
    )
    for _ in range(2):
        assert client.execute() == 'succeeded'
        assert client.userdata.position.x == 4.0


@pytest.mark.parametrize(
    'state', [Answer('aborted'), Answer(RuntimeError('broken'), outcomes=['done'])]
)
def test_a_machine_that_fails_aborts_the_goal(graph, state):
    wrapped(graph, container_of(state), expand_goal_slots=True)
    assert machine_of(action(graph.node)).execute() == 'aborted'


def test_a_cancel_preempts_the_machine_and_the_next_goal_starts_afresh(graph):
    waiter = Waiter(LONG)
    wrapped(graph, container_of(waiter), expand_goal_slots=True)
    for _ in range(2):
        client = machine_of(action(graph.node))
        run = Background(client)
        began(waiter)
        client.request_preempt()
        assert run.result() == 'preempted'


def test_outcomes_of_a_wrapper_are_named_once_and_exist(graph):
    for outcomes in (['done', 'nix'], ['preempted']):
        with pytest.raises(fsm.InvalidStateError):
            ActionServerWrapper(
                graph.node,
                'follow_path',
                FollowPath,
                container_of(Answer('done')),
                succeeded_outcomes=outcomes,
                preempted_outcomes=['preempted'],
            )
