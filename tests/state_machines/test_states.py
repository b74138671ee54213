"""No state that talks to ROS can hang: each fault ends in a declared outcome, within its time."""

from __future__ import annotations

import threading

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int32
from std_srvs.srv import SetBool

import state_machines as fsm
from libs.state_machines.tests.states import Background, Waiter, began
from state_machines.ros import (
    ConditionState,
    GoalAbortedError,
    GoalServer,
    MonitorState,
    ServiceState,
    set_preempt_handler,
)
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.node import PatrolNode

from .ros_servers import (
    LONG,
    SHORT,
    Refusing,
    ScriptedActionServer,
    SilentServer,
    Stubborn,
    action,
    feed,
    machine_of,
    service,
)


def test_a_service_that_is_absent_aborts_in_time(graph, caplog):
    assert machine_of(service(graph.node, timeout=SHORT)).execute() == 'aborted'
    assert "Service 'trigger'" in caplog.text


def test_a_service_that_never_answers_aborts_in_time(graph):
    graph.add(SilentServer)
    state = service(graph.node, timeout=Duration(seconds=SHORT))
    assert machine_of(state).execute() == 'aborted'


def test_a_preempt_ends_waiting_for_a_service_and_for_its_answer(graph):
    for present in (False, True):
        server = graph.add(SilentServer) if present else None
        machine = machine_of(service(graph.node))
        run = Background(machine)
        if server is not None:
            assert server.asked.wait(60.0)
        machine.request_preempt()
        assert run.result() == 'preempted'
        assert not machine.preempt_requested()


def test_a_service_server_that_dies_before_it_answers(graph):
    server = graph.add(SilentServer)
    machine = machine_of(service(graph.node))
    run = Background(machine)
    assert server.asked.wait(60.0)
    graph.remove(server)
    assert run.result() == 'aborted'


def unspun_node():
    context = rclpy.Context()
    rclpy.init(context=context)
    return context, PatrolNode('unspun', context=context, use_global_arguments=False)


@pytest.mark.parametrize('kind', [service, action])
def test_an_executor_that_does_not_spin_aborts_in_time(graph, kind):
    context, node = unspun_node()
    try:
        graph.add(SilentServer)
        graph.add(ScriptedActionServer)
        if kind is service:
            state = service(node, timeout=SHORT)
        else:
            state = action(node, server_wait_timeout=SHORT)
        assert machine_of(state).execute() == 'aborted'
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def test_a_service_gets_its_request_from_userdata_and_gives_its_response_back(graph):
    def serve(request, response):
        response.success = request.data
        response.message = 'served'
        return response

    graph.node.create_service(SetBool, 'switch', serve)
    request = SetBool.Request()

    @fsm.cb_interface(input_keys=['wanted'], outcomes=['refused'])
    def judge(ud, response):
        return None if response.success == ud.wanted else 'refused'

    state = ServiceState(
        graph.node,
        'switch',
        SetBool,
        request,
        request_slots=['data'],
        response_cb=judge,
        response_key='answer',
        response_slots=['message'],
        timeout=LONG,
    )
    machine = machine_of(state, {'data': True, 'wanted': True})
    assert machine.execute() == 'succeeded'
    assert machine.userdata.message == 'served'
    assert machine.userdata.answer.success
    assert not request.data
    machine.userdata.wanted = False
    assert machine.execute() == 'refused'


@pytest.mark.parametrize(
    ('arguments', 'userdata', 'words'),
    [
        ({'request_slots': ['data']}, {}, "'data'"),
        ({'request_slots': ['data']}, {'data': 'no bool'}, 'data'),
        ({'request_key': 'request'}, {'request': 5}, 'int'),
        ({'request_cb': lambda ud, request: 1 / 0}, {}, 'ZeroDivisionError'),
        ({'request_cb': lambda ud, request: 'text'}, {}, 'str'),
        ({'response_cb': lambda ud, response: 'nix'}, {}, "'nix'"),
        ({'response_cb': lambda ud, response: ud.nix}, {}, "'nix'"),
    ],
)
def test_a_wrong_request_or_callback_aborts_with_a_word(graph, caplog, arguments, userdata, words):
    graph.node.create_service(SetBool, 'switch', lambda request, response: response)
    state = ServiceState(graph.node, 'switch', SetBool, timeout=LONG, **arguments)
    assert machine_of(state, userdata).execute() == 'aborted'
    assert words in caplog.text


@pytest.mark.parametrize(
    'arguments',
    [
        {'request_slots': ['nix']},
        {'response_slots': ['nix']},
        {'request_cb': 5},
        {'response_cb': 5},
        {'request': 5},
    ],
)
def test_wrong_arguments_are_refused_at_construction(graph, arguments):
    with pytest.raises(fsm.InvalidStateError):
        ServiceState(graph.node, 'switch', SetBool, **arguments)


def test_an_action_server_that_is_absent_aborts_in_time(graph):
    assert machine_of(action(graph.node, server_wait_timeout=SHORT)).execute() == 'aborted'


def test_a_goal_that_is_rejected_aborts(graph, caplog):
    graph.add(Refusing)
    assert machine_of(action(graph.node)).execute() == 'aborted'
    assert 'rejected the goal' in caplog.text


def test_an_action_server_that_dies_in_the_middle_aborts(graph):
    server = graph.add(ScriptedActionServer)
    run = Background(machine_of(action(graph.node)))
    assert server.began.wait(60.0)
    graph.remove(server)
    assert run.result() == 'aborted'


def test_a_result_that_comes_too_late_is_not_waited_for(graph):
    server = graph.add(ScriptedActionServer)
    state = action(graph.node, exec_timeout=SHORT, preempt_timeout=SHORT)
    assert machine_of(state).execute() == 'aborted'
    assert server.cancelled.wait(60.0)


def test_a_preempt_cancels_the_goal(graph):
    ends = []

    def execute(goal, run):
        began_event.set()
        ends.append(run.sleep(LONG))
        return FollowPath.Result()

    began_event = threading.Event()
    server = graph.add(PatrolNode, name='server')
    GoalServer(server, FollowPath, 'follow_path', execute)
    machine = machine_of(action(graph.node))
    run = Background(machine)
    assert began_event.wait(60.0)
    machine.request_preempt()
    assert run.result() == 'preempted'
    # Before the server's yes has come, the cancel follows it.
    graph.until(lambda: ends == [False])
    assert not machine.preempt_requested()


def test_a_server_that_refuses_to_cancel_is_given_up_in_time(graph):
    server = graph.add(Stubborn)
    machine = machine_of(action(graph.node, preempt_timeout=SHORT))
    run = Background(machine)
    assert server.began.wait(60.0)
    machine.request_preempt()
    assert run.result() == 'preempted'
    assert server.cancelled.wait(60.0)


def test_a_preempt_ends_waiting_for_an_action_server(graph):
    machine = machine_of(action(graph.node))
    run = Background(machine)
    machine.request_preempt()
    assert run.result() == 'preempted'


def test_an_executor_that_stops_in_the_middle_aborts(graph):
    graph.add(ScriptedActionServer)
    from surveillance_runtime.process import ExecutorThread

    context = rclpy.Context()
    rclpy.init(context=context)
    node = PatrolNode('client', context=context, use_global_arguments=False)
    spinner = ExecutorThread(context)
    spinner.executor.add_node(node)
    spinner.start()
    state = action(node, server_wait_timeout=4.0, preempt_timeout=SHORT)
    server = next(n for n in graph._nodes if isinstance(n, ScriptedActionServer))
    # The state's own wait is short, since it is as well how long it trusts its executor.
    graph.until(state._caller.is_ready)
    run = Background(machine_of(state))
    try:
        assert server.began.wait(60.0)
        spinner.stop()
        assert run.result() == 'aborted'
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def test_an_action_gets_its_goal_from_userdata_and_gives_its_result_back(graph):
    seen = []

    def execute(goal, run):
        for point in goal.path:
            feed(run, FollowPath.Feedback(position=point), lambda x=point.x: x in seen)
        return FollowPath.Result(position=goal.path[-1])

    server = graph.add(PatrolNode, name='server')
    GoalServer(server, FollowPath, 'follow_path', execute)

    @fsm.cb_interface(input_keys=['path'], output_keys=['status'], outcomes=['arrived'])
    def result_cb(ud, status, result, tolerance):
        ud.status = status
        return 'arrived' if abs(result.position.x - ud.path[-1].x) < tolerance else None

    state = action(
        graph.node,
        goal_slots=['path'],
        result_slots=['position'],
        result_cb=result_cb,
        result_cb_args=[0.1],
        feedback_cb=lambda ud, feedback: seen.append(feedback.position.x),
    )
    path = [Point(x=1.0), Point(x=2.0)]
    machine = machine_of(state, {'path': path})
    assert machine.execute() == 'arrived'
    assert machine.userdata.status == GoalStatus.STATUS_SUCCEEDED
    assert machine.userdata.position.x == 2.0
    assert list(dict.fromkeys(seen)) == [1.0, 2.0]


def test_an_aborted_goal_aborts(graph):
    def execute(goal, run):
        raise GoalAbortedError('no path')

    server = graph.add(PatrolNode, name='server')
    GoalServer(server, FollowPath, 'follow_path', execute)
    assert machine_of(action(graph.node)).execute() == 'aborted'


@pytest.mark.parametrize(
    ('values', 'max_checks', 'expected'), [((50, 3), -1, 'invalid'), ((50,), 3, 'valid')]
)
def test_a_topic_is_watched_until_a_message_is_wrong_or_enough_were_right(
    graph, values, max_checks, expected
):
    publisher = graph.node.create_publisher(Int32, 'level', 10)
    seen = []

    def condition(ud, message):
        seen.append(message.data)
        return message.data > ud.low

    state = MonitorState(graph.node, 'level', Int32, condition, max_checks, ['low'])
    machine = machine_of(state, {'low': 10})
    run = Background(machine)
    for value in values:
        graph.until(lambda value=value: publisher.publish(Int32(data=value)) or value in seen)
    graph.until(lambda: publisher.publish(Int32(data=values[-1])) or not machine.is_running())
    assert run.result() == expected


def test_a_topic_that_falls_silent_is_invalid_in_time(graph):
    state = MonitorState(graph.node, 'level', Int32, lambda ud, message: True, timeout=SHORT)
    assert machine_of(state).execute() == 'invalid'


def test_a_preempt_ends_watching(graph):
    machine = machine_of(MonitorState(graph.node, 'level', Int32, lambda ud, message: True))
    run = Background(machine)
    machine.request_preempt()
    assert run.result() == 'preempted'


def test_a_condition_callback_that_raises_makes_a_topic_invalid(graph, caplog):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.node.create_publisher(Int32, 'level', latched).publish(Int32(data=5))
    state = MonitorState(graph.node, 'level', Int32, lambda ud, message: 1 / 0, qos=latched)
    assert machine_of(state).execute() == 'invalid'
    assert 'ZeroDivisionError' in caplog.text


def test_a_condition_is_checked_so_often_and_no_longer(graph):
    checks = []
    state = ConditionState(
        graph.node, lambda ud: checks.append(1) and False, poll_rate=100.0, max_checks=3
    )
    assert machine_of(state).execute() == 'false'
    assert len(checks) == 3
    checks.clear()
    state = ConditionState(
        graph.node,
        lambda ud: checks.append(1) or len(checks) == 2,
        poll_rate=100,
        max_checks=-1,
    )
    assert machine_of(state).execute() == 'true'
    state = ConditionState(graph.node, lambda ud: False, timeout=0.05, max_checks=-1)
    assert machine_of(state).execute() == 'false'


def test_a_preempt_ends_checking_a_condition(graph):
    checked = threading.Event()
    state = ConditionState(graph.node, lambda ud: checked.set(), poll_rate=0.001, max_checks=-1)
    machine = machine_of(state)
    run = Background(machine)
    assert checked.wait(60.0)
    machine.request_preempt()
    assert run.result() == 'preempted'


def test_a_machine_is_preempted_when_its_node_stops_or_ros_goes_down():
    for stop in (lambda context, node: node.stop(), lambda context, node: context.shutdown()):
        context, node = unspun_node()
        waiter = Waiter(LONG)
        machine = machine_of(waiter)
        set_preempt_handler(node, machine)
        run = Background(machine)
        began(waiter)
        stop(context, node)
        assert run.result() == 'preempted'
        node.destroy_node()
        rclpy.try_shutdown(context=context)
