"""The engine's ROS part works with any rclpy node, and with SMACH's introspection."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest
from rclpy.action import ActionClient, ActionServer
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

import state_machines as fsm
from libs.state_machines.tests.states import Answer, Background, Waiter, began
from state_machines.ros import (
    ActionServerWrapper,
    ClockWait,
    ConditionState,
    GoalCaller,
    GoalServer,
    MonitorState,
    RosState,
    ServiceState,
    SimpleActionState,
    set_preempt_handler,
)
from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import FsmStatus, SmachContainerStatus, SmachContainerStructure
from surveillance_runtime.introspection import IntrospectionClient, IntrospectionServer

from .ros_servers import Asleep, introspected

LATCHED = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Plain(Node):
    """Nothing but rclpy's node; `stop` is what the test's graph calls before it destroys it."""

    def stop(self):
        # rclpy keeps a node in the ROS graph while its actions' servers and clients live.
        for each in [*self.waitables]:
            if isinstance(each, (ActionClient, ActionServer)):
                each.destroy()


@pytest.fixture
def node(graph):
    return graph.add(Plain, node_name='plain')


def machine_of(**states):
    machine = fsm.StateMachine(['succeeded', 'preempted', 'aborted', 'valid', 'true'])
    labels = list(states)
    with machine:
        for label, following in zip(labels, [*labels[1:], None], strict=True):
            outcome = next(
                o
                for o in ('succeeded', 'valid', 'true')
                if o in states[label].get_registered_outcomes()
            )
            rest = dict.fromkeys(states[label].get_registered_outcomes(), 'aborted')
            bound = {**rest, outcome: following or 'succeeded', 'preempted': 'preempted'}
            fsm.StateMachine.add(label, states[label], bound)
    return machine


def test_every_state_and_server_works_on_a_plain_node(graph, node):
    def serve(request, response):
        response.success = True
        return response

    node.create_service(Trigger, 'trigger', serve)
    node.create_publisher(Int32, 'level', LATCHED).publish(Int32(data=5))
    inner = fsm.StateMachine(['succeeded', 'preempted'])
    with inner:
        fsm.StateMachine.add('WORK', Answer('succeeded'))
    wrapper = ActionServerWrapper(
        node, 'follow_path', FollowPath, inner, ['succeeded'], [], ['preempted']
    )
    wrapper.run_server()

    class Named(RosState):
        def __init__(self, node):
            super().__init__(node, outcomes=['succeeded', 'preempted'])

        def execute(self, ud):
            return 'succeeded' if self.node.get_name() == 'plain' else 'preempted'

    machine = machine_of(
        NAMED=Named(node),
        CALL=ServiceState(node, 'trigger', Trigger, timeout=60.0),
        LISTEN=MonitorState(node, 'level', Int32, lambda ud, m: m.data == 5, 1, qos=LATCHED),
        ASK=ConditionState(node, lambda ud: True, poll_rate=50),
        ACT=SimpleActionState(node, 'follow_path', FollowPath, server_wait_timeout=60.0),
    )
    machine.set_clock(ClockWait(node))
    set_preempt_handler(node, machine)
    assert machine.execute() == 'succeeded'


def test_a_cancelled_goal_of_a_plain_node_preempts_its_machine(graph, node):
    waiter = Waiter(100.0)
    inner = fsm.StateMachine(['done', 'preempted'])
    with inner:
        fsm.StateMachine.add('WAIT', waiter)
    wrapper = ActionServerWrapper(
        node, 'follow_path', FollowPath, inner, ['done'], [], ['preempted']
    )
    wrapper.run_server()
    client = machine_of(
        ACT=SimpleActionState(graph.node, 'follow_path', FollowPath, server_wait_timeout=60.0)
    )
    run = Background(client)
    began(waiter, timeout=60.0)
    client.request_preempt()
    assert run.result() == 'preempted'


class Slow:
    """An action client's handle that dawdles after it has sent, until the answer has come."""

    def __init__(self, handle):
        self._handle = handle

    def __getattr__(self, name):
        found = getattr(self._handle, name)
        if not name.startswith('send_'):
            return found

        def send(*arguments):
            number = found(*arguments)
            threading.Event().wait(0.2)
            return number

        return send

    def __enter__(self):
        return self._handle.__enter__()

    def __exit__(self, *error):
        return self._handle.__exit__(*error)


def test_an_answer_that_comes_before_the_question_was_noted_is_not_lost(graph, node):
    GoalServer(node, FollowPath, 'follow_path', lambda goal, run: FollowPath.Result())
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    graph.until(caller.is_ready)
    caller._client._client_handle = Slow(caller._client._client_handle)
    end = caller.run(FollowPath.Goal(), accept_timeout=60.0, result_timeout=60.0)
    assert end.status == 'succeeded'


@pytest.mark.parametrize('rate', [0, -1, float('inf'), float('nan'), '20'])
def test_a_poll_rate_is_in_hertz(node, rate):
    with pytest.raises(fsm.InvalidStateError, match='hertz'):
        ConditionState(node, lambda ud: True, poll_rate=rate)


def test_ros_time_that_jumps_back_does_not_delay_a_sleep(graph):
    from rosgraph_msgs.msg import Clock as ClockMessage

    node = graph.add(Plain, node_name='timed', parameters={'use_sim_time': True})
    assert node.get_parameter('use_sim_time').value is True
    wait, publisher = ClockWait(node), graph.node.create_publisher(ClockMessage, '/clock', 10)

    def at(seconds):
        message = ClockMessage()
        message.clock.sec = seconds
        graph.until(lambda: publisher.get_subscription_count() > 0)
        publisher.publish(message)
        graph.until(lambda: int(wait.now()) == seconds)

    at(1000)
    before = wait.elapsed()
    ended, interrupt = threading.Event(), Asleep()
    sleeper = threading.Thread(target=lambda: wait.sleep(5.0, interrupt) and ended.set())
    sleeper.start()
    try:
        assert interrupt.begun.wait(60.0)
        at(1002)
        at(900)
        assert not ended.is_set()
        at(904)
        assert ended.wait(60.0)
    finally:
        interrupt.set()
        sleeper.join(60.0)
    assert wait.elapsed() - before == pytest.approx(6.0, abs=0.01)


def test_the_first_moment_of_ros_time_is_waited_for_and_not_the_second(graph):
    from rosgraph_msgs.msg import Clock as ClockMessage

    node = graph.add(Plain, node_name='timed', parameters={'use_sim_time': True})
    wait, publisher = ClockWait(node), graph.node.create_publisher(ClockMessage, '/clock', 10)
    begun: list[bool] = []
    waiter = threading.Thread(target=lambda: begun.append(wait.wait_for_time(fsm.Interrupt())))
    waiter.start()
    graph.until(lambda: publisher.get_subscription_count() > 0)
    assert not begun
    message = ClockMessage()
    message.clock.sec = 1
    publisher.publish(message)
    waiter.join(60.0)
    assert begun == [True]
    assert wait.wait_for_time(fsm.Interrupt()), 'time stands, and has begun'
    stopped = fsm.Interrupt()
    stopped.set()
    assert not wait.wait_for_time(stopped)


# SMACH's introspection.


@pytest.fixture
def watched(graph, node):
    with introspected(node) as seen:
        yield seen


def test_smachs_topics_tell_structure_and_status_of_each_container(graph, watched):
    root, waiter = watched
    structures = graph.listen(SmachContainerStructure, 'robot/smach/container_structure', LATCHED)
    states = graph.listen(SmachContainerStatus, 'robot/smach/container_status', LATCHED)
    graph.until(lambda: len(structures) == 2)
    by_path = {each.path: each for each in structures}
    assert list(by_path['/PATROL'].children) == ['FIRST', 'INNER']
    edges = zip(
        by_path['/PATROL/INNER'].outcomes_from,
        by_path['/PATROL/INNER'].internal_outcomes,
        by_path['/PATROL/INNER'].outcomes_to,
        strict=True,
    )
    assert ('WAIT', 'done', 'LAST') in set(edges)
    assert sorted(by_path['/PATROL/INNER'].container_outcomes) == ['done', 'preempted']
    run = Background(root)
    began(waiter)
    graph.until(
        lambda: (
            {(each.path, *each.active_states) for each in states}
            >= {('/PATROL', 'INNER'), ('/PATROL/INNER', 'WAIT')}
        )
    )
    told = next(each for each in states if each.path == '/PATROL')
    assert told.local_data == '{"level": 7}'
    assert list(told.initial_states) == ['FIRST']
    root.request_preempt()
    assert run.result() == 'preempted'


def test_a_container_that_begins_after_the_transition_to_it_was_told_is_told_of(graph, watched):
    root, waiter = watched
    states = graph.listen(SmachContainerStatus, 'robot/smach/container_status', LATCHED)
    gate = threading.Event()
    # Called before the container begins: the transition is told with a container that is idle.
    root.register_transition_cb(lambda *_: gate.wait(60.0))
    run = Background(root)
    try:
        graph.until(lambda: any('->' in each.info for each in states))
    finally:
        gate.set()
    began(waiter)
    graph.until(
        lambda: states[-1].path == '/PATROL/INNER' and list(states[-1].active_states) == ['WAIT']
    )
    root.request_preempt()
    assert run.result() == 'preempted'


@pytest.fixture
def interrupted(node):
    """Serve a machine two levels deep with an interrupt at its root; gives that and its state."""
    waiter, urgent = Waiter(100.0), Waiter(100.0)
    root, middle, inner = (fsm.StateMachine(['done', 'preempted']) for _ in range(3))
    for container, label, state in (
        (root, 'MIDDLE', middle),
        (middle, 'INNER', inner),
        (inner, 'WAIT', waiter),
    ):
        with container:
            fsm.StateMachine.add(label, state)
    root.add_interrupt('URGENT', urgent, priority=1)
    server = IntrospectionServer(node, 'robot', root, '/ROOT')
    server.start()
    yield root, urgent
    root.request_preempt()
    server.stop()


def test_smachs_status_follows_what_an_interrupt_puts_aside_and_goes_on_with(graph, interrupted):
    root, urgent = interrupted
    states = graph.listen(SmachContainerStatus, 'robot/smach/container_status', LATCHED)

    def latest() -> dict[str, list[str]]:
        return {each.path: list(each.active_states) for each in tuple(states)}

    working = {'/ROOT': ['MIDDLE'], '/ROOT/MIDDLE': ['INNER'], '/ROOT/MIDDLE/INNER': ['WAIT']}
    run = Background(root)
    graph.until(lambda: latest() == working)
    root.raise_interrupt('URGENT')
    began(urgent)
    aside = {'/ROOT': ['URGENT'], '/ROOT/MIDDLE': [], '/ROOT/MIDDLE/INNER': []}
    graph.until(lambda: latest() == aside)
    gate = threading.Event()
    root.register_transition_cb(lambda *_: gate.wait(60.0))
    told = len(states)
    root.control.force_outcome('ROOT/URGENT', 'done')
    try:
        # That it goes on is told while what is inside has not begun to.
        graph.until(lambda: any(each.path == '/ROOT' for each in states[told:]))
    finally:
        gate.set()
    graph.until(lambda: latest() == working)
    root.request_preempt()
    assert run.result() == 'preempted'
    graph.until(lambda: latest() == {path: [] for path in working})


def test_a_container_that_was_added_later_is_no_error(node, monkeypatch):
    errors = []
    monkeypatch.setattr('state_machines.transitions.logerr', errors.append)
    root, late = (fsm.StateMachine(['done']) for _ in range(2))
    with root:
        fsm.StateMachine.add('FIRST', Answer('done'), {'done': 'LATE'})
    server = IntrospectionServer(node, 'robot', root, '/ROOT')
    server.start()

    def wait_until_told(_ud):
        server._feed.flush(60.0)
        return 'done'

    with late:
        fsm.StateMachine.add('ONLY', fsm.CBState(wait_until_told, outcomes=['done']))
    with root:
        fsm.StateMachine.add('LATE', late)
    assert root.execute() == 'done'
    server.stop()
    assert not errors


def test_a_machine_that_broke_is_told_not_to_run(graph, node):
    gate = threading.Event()

    def broken(_ud):
        gate.wait(60.0)
        raise ValueError

    root = fsm.StateMachine(['done'])
    with root:
        fsm.StateMachine.add('BROKEN', fsm.CBState(broken, outcomes=['done']))
    server = IntrospectionServer(node, 'robot', root, '/ROOT')
    server.start()
    statuses = graph.listen(FsmStatus, 'robot/fsm/status', LATCHED)
    states = graph.listen(SmachContainerStatus, 'robot/smach/container_status', LATCHED)
    run = Background(root)
    graph.until(lambda: statuses and statuses[-1].running and states and states[-1].active_states)
    gate.set()
    with pytest.raises(fsm.InvalidUserCodeError):
        run.result()
    graph.until(lambda: not statuses[-1].running and not states[-1].active_states)
    server.stop()


def test_a_client_finds_servers_and_sets_where_a_container_begins(graph, watched):
    root, waiter = watched
    client = IntrospectionClient(graph.node)
    (server,) = graph.until(client.get_servers)
    assert server == '/robot'
    userdata = fsm.UserData()
    userdata.level = 8
    assert client.set_initial_state(server, '/PATROL/INNER', ['LAST'], userdata)
    assert root.execute() == 'done'
    assert waiter.runs == 0
    assert root['INNER'].userdata.level == 8
    assert not client.set_initial_state(server, '/PATROL/INNER', ['NIX'], timeout=0.3)
    assert not client.set_initial_state(server, '/NIX', ['LAST'], timeout=0.3)


def test_the_states_need_nothing_of_this_project_but_the_engine():
    code = (
        'import sys\n'
        'class Refuse:\n'
        '    def find_spec(self, name, path=None, target=None):\n'
        "        if name.split('.')[0].startswith('surveillance_') and 'fsm' not in name:\n"
        '            raise ImportError(name)\n'
        'sys.meta_path.insert(0, Refuse())\n'
        'import state_machines.ros as ros\n'
        'print(ros.ServiceState, ros.ActionServerWrapper)\n'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
