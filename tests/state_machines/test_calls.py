"""Calls and goals that always end, against scripted servers."""

from __future__ import annotations

import gc
import itertools
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger

from state_machines import Interrupt
from state_machines.ros import (
    CallInterruptedError,
    CallTimeoutError,
    ClockWait,
    GoalAbortedError,
    GoalCaller,
    GoalServer,
    ServiceCaller,
    UnavailableError,
    calls,
)
from state_machines.ros.calls import RoundTrips
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.node import PatrolNode

from .ros_servers import Asleep, ScriptedActionServer, Stubborn, feed


def in_thread(work):
    """Run work on a thread; returns a function that waits for it and gives or raises its end."""
    outcome: list[tuple[Any, Exception | None]] = []

    def body():
        try:
            outcome.append((work(), None))
        except Exception as error:
            outcome.append((None, error))

    thread = threading.Thread(target=body, daemon=True)
    thread.start()

    def end():
        thread.join(60.0)
        assert not thread.is_alive(), 'hangs'
        value, error = outcome[0]
        if error is not None:
            raise error
        return value

    return end


@pytest.fixture
def server(graph):
    return graph.add(PatrolNode, name='server')


def follow(*points):
    return FollowPath.Goal(path=[Point(x=float(x)) for x in points])


def test_service_call_brings_the_answer(graph, server):
    server.create_service(Trigger, 'ask', lambda _q, a: Trigger.Response(success=True, message='y'))
    answer = ServiceCaller(graph.node, Trigger, 'ask').call(Trigger.Request(), timeout=60.0)
    assert answer.message == 'y'


def test_service_call_ends_without_a_server(graph):
    with pytest.raises(UnavailableError, match='service nowhere: no server'):
        ServiceCaller(graph.node, Trigger, 'nowhere').call(Trigger.Request(), timeout=0.05)


def never_answers(server):
    """Have the server take a question and keep the answer; raised when it was asked."""
    asked = threading.Event()

    async def never(_request, _response):
        from rclpy.task import Future

        asked.set()
        await Future()

    server.create_service(Trigger, 'ask', never)
    return asked


def await_servers(graph, count):
    name = f'{graph.node.get_namespace().rstrip("/")}/ask'
    assert graph.until(lambda: graph.node.count_services(name) == count)


def test_service_call_ends_by_interrupt_and_by_deadline(graph, server):
    asked = never_answers(server)
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    interrupt = Interrupt()
    end = in_thread(lambda: caller.call(Trigger.Request(), 20.0, interrupt))
    assert asked.wait(60.0)
    interrupt.set()
    with pytest.raises(CallInterruptedError):
        end()
    with pytest.raises(CallTimeoutError):
        caller.call(Trigger.Request(), timeout=0.2)


def test_a_deadline_grows_with_the_round_trips_and_is_bounded():
    trips = RoundTrips()
    assert trips.deadline(5.0) == 5.0
    trips.note(2.0)  # RFC 6298, 2.2: smoothed 2, variation 1
    assert trips.deadline(5.0) == 6.0
    trips.note(4.0)  # 2.3: variation 0.75 * 1 + 0.25 * 2, smoothed 0.875 * 2 + 0.125 * 4
    assert trips.smoothed == pytest.approx(2.25)
    assert trips.deadline(5.0) == pytest.approx(2.25 + 4.0 * 1.25)
    assert trips.deadline(0.5) == 2.0, 'at most four times as long'
    for _ in range(100):
        trips.note(0.01)
    assert trips.deadline(5.0) == 5.0


def test_a_deadline_doubles_with_each_answer_missed_until_one_comes():
    trips = RoundTrips()
    for expected in (2.0, 4.0, 4.0):
        trips.note_missed()
        assert trips.deadline(1.0) == expected
    trips.note(0.1)
    assert trips.deadline(1.0) == 1.0


def test_calls_take_the_time_that_the_link_needs(graph, server, monkeypatch):
    allowed = []
    monkeypatch.setattr(
        calls, 'block_on', lambda _f, deadline, *_a: allowed.append(deadline - time.monotonic())
    )
    never_answers(server)
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    caller.round_trips.note(20.0)
    caller.call(Trigger.Request(), timeout=10.0)
    assert 30.0 < allowed[0] <= 40.0
    caller.call(Trigger.Request(), timeout=10.0, discovery=5.0)
    assert allowed[1] <= 10.0, 'it waits for work, not for the link'


def test_a_missed_answer_is_noted_and_shown(graph, server):
    never_answers(server)
    caller = ServiceCaller(server, Trigger, 'ask')
    graph.until(caller.is_ready)
    with pytest.raises(CallTimeoutError):
        caller.call(Trigger.Request(), timeout=0.05)
    assert caller.round_trips.deadline(1.0) == 2.0
    graph.add(PatrolNode, name='quick').create_service(Trigger, 'other', lambda _q, a: a)
    ServiceCaller(server, Trigger, 'other').call(Trigger.Request(), timeout=60.0)
    assert float(server.health.figures()['other_ms']) > 0.0


def test_who_can_do_without_an_answer_looks_for_one_without_waiting(graph, server):
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    answers = caller.look_for_answer(Trigger.Request())
    began = time.monotonic()
    assert not answers(60.0), 'of no server no answer comes'
    assert time.monotonic() - began < 20.0
    gate, asked = Interrupt(), []

    def slow(_request, answer):
        asked.append(True)
        gate.wait(60.0)
        return answer

    server.create_service(Trigger, 'ask', slow)
    await_servers(graph, 1)
    assert graph.until(lambda: not answers(0.0) and bool(asked))
    assert not answers(0.05)
    gate.set()
    assert answers(60.0)
    assert len(asked) == 1


def test_service_call_notices_that_its_server_went_away(graph, server):
    asked = never_answers(server)
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    end = in_thread(lambda: caller.call(Trigger.Request(), 60.0))
    assert asked.wait(60.0)
    graph.drop(server)
    with pytest.raises(
        UnavailableError, match='service ask: the server went away before it answered'
    ):
        end()


def test_who_is_interrupted_in_the_moment_the_server_is_lost_was_interrupted():
    interrupt = Interrupt()

    def look():
        interrupt.set()
        raise UnavailableError('service ask: another server took the place')

    with pytest.raises(CallInterruptedError, match='service ask: interrupted'):
        calls.block_on(Future(), time.monotonic() + 60.0, interrupt, 'service ask', look)


def test_service_call_notices_that_another_server_took_the_place_of_one_that_was_killed(
    graph, server, monkeypatch
):
    monkeypatch.setattr(calls, 'DOUBTFUL_SECONDS', 60.0)
    asked = never_answers(server)  # as one that was killed: the middleware still knows it
    older = graph.add(PatrolNode, name='older')  # was killed before, and is forgotten meanwhile
    never_answers(older)
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    await_servers(graph, 2)
    end = in_thread(lambda: caller.call(Trigger.Request(), 60.0))
    assert asked.wait(60.0)
    never_answers(graph.add(PatrolNode, name='restarted'))
    graph.drop(older)
    with pytest.raises(UnavailableError, match='service ask: another server took the place'):
        end()


def test_awaited_call_notices_that_another_server_took_the_place(graph, server):
    asked = never_answers(server)
    inner = ServiceCaller(graph.node, Trigger, 'ask')
    graph.until(inner.is_ready)

    async def relay(_request, response):
        try:
            await inner.call_async(Trigger.Request(), timeout=60.0)
        except UnavailableError as error:
            response.message = str(error)
        return response

    graph.node.create_service(Trigger, 'relay', relay)
    outer = ServiceCaller(graph.node, Trigger, 'relay')
    end = in_thread(lambda: outer.call(Trigger.Request(), timeout=60.0))
    assert asked.wait(60.0)
    never_answers(graph.add(PatrolNode, name='restarted'))
    assert 'service ask: another server took the place' in end().message


def test_service_call_does_not_wait_long_where_one_of_several_servers_may_be_gone(
    graph, server, monkeypatch
):
    monkeypatch.setattr(calls, 'DOUBTFUL_SECONDS', 0.1)
    never_answers(server)
    never_answers(graph.add(PatrolNode, name='restarted'))
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    await_servers(graph, 2)
    with pytest.raises(UnavailableError, match='service ask: no answer, and one of 2 servers'):
        caller.call(Trigger.Request(), 60.0)


def test_service_call_has_a_patience_of_its_own_for_finding_the_server(graph):
    caller = ServiceCaller(graph.node, Trigger, 'nowhere')
    with pytest.raises(UnavailableError, match='service nowhere: no server'):
        caller.call(Trigger.Request(), timeout=60.0, discovery=0.05)


def test_service_call_in_a_callback_is_awaited(graph, server):
    server.create_service(Trigger, 'ask', lambda _q, a: Trigger.Response(success=True, message='y'))
    inner = ServiceCaller(graph.node, Trigger, 'ask')
    outer = ServiceCaller(graph.node, Trigger, 'relay')

    async def relay(request, _response):
        return await inner.call_async(request, timeout=60.0)

    graph.node.create_service(Trigger, 'relay', relay)
    graph.until(inner.is_ready)
    assert outer.call(Trigger.Request(), timeout=60.0).message == 'y'


def test_awaited_calls_go_out_in_the_order_in_which_they_are_made(graph, server, monkeypatch):
    asked, held = [], []

    def on_ask(request, response):
        asked.append(request.data)
        return response

    server.create_service(SetBool, 'ask', on_ask)
    caller = ServiceCaller(graph.node, SetBool, 'ask')
    graph.until(caller.is_ready)
    monkeypatch.setattr(graph.node, 'spawn', lambda work, _name: held.append(work))
    wanted = [True, True, False, False, True]
    awaited = [caller.call_async(SetBool.Request(data=data), timeout=60.0) for data in wanted]
    for each in awaited:
        each.send(None)
    for work in reversed(held):
        threading.Thread(target=work, daemon=True).start()
    graph.until(lambda: len(asked) == len(wanted))
    assert asked == wanted
    for each in awaited:
        each.close()


def test_awaited_call_times_out(graph, server):
    async def never(_request, _response):
        from rclpy.task import Future

        await Future()

    server.create_service(Trigger, 'ask', never)
    inner = ServiceCaller(graph.node, Trigger, 'ask')
    graph.until(inner.is_ready)
    seen = []

    async def relay(_request, response):
        try:
            await inner.call_async(Trigger.Request(), timeout=0.1)
        except CallTimeoutError as error:
            seen.append(str(error))
        return response

    graph.node.create_service(Trigger, 'relay', relay)
    ServiceCaller(graph.node, Trigger, 'relay').call(Trigger.Request(), timeout=60.0)
    assert seen == ['service ask: no answer within 0.1 s']


def test_the_failure_of_an_awaited_call_that_nobody_awaits_any_more_is_no_complaint(
    graph, server, capfd
):
    asked = never_answers(server)
    caller = ServiceCaller(graph.node, Trigger, 'ask')
    graph.until(caller.is_ready)
    awaited = caller.call_async(Trigger.Request(), timeout=0.1)
    awaited.send(None)
    assert asked.wait(60.0)
    awaited.close()
    graph.until(lambda: all(t.name != 'call of ask' for t in threading.enumerate()))
    gc.collect()
    assert 'never' not in capfd.readouterr().err  # awaited, retrieved


def test_goal_succeeds_with_feedback(graph, server):
    passed = []

    def execute(goal, run):
        for point in goal.path:
            feed(run, FollowPath.Feedback(position=point), lambda x=point.x: x in passed)
        return FollowPath.Result(position=goal.path[-1])

    GoalServer(server, FollowPath, 'follow_path', execute)
    end = GoalCaller(graph.node, FollowPath, 'follow_path').run(
        follow(1, 2), accept_timeout=60.0, on_feedback=lambda f: passed.append(f.position.x)
    )
    assert (end.status, end.result.position.x) == ('succeeded', 2.0)
    assert list(dict.fromkeys(passed)) == [1.0, 2.0]


def test_goal_aborts_with_its_result(graph, server):
    def execute(goal, run):
        raise GoalAbortedError('blocked by D1', FollowPath.Result(position=Point(x=0.5)))

    GoalServer(server, FollowPath, 'follow_path', execute)
    end = GoalCaller(graph.node, FollowPath, 'follow_path').run(follow(1), accept_timeout=60.0)
    assert (end.status, end.result.position.x) == ('aborted', 0.5)


def test_a_goal_that_is_taken_back_is_no_error_and_the_next_one_may_be(graph, server, capfd):
    begun = threading.Event()

    def execute(goal, run):
        if goal.path:
            begun.set()
            run.sleep(1e6)
        raise GoalAbortedError('withdrawn')

    GoalServer(server, FollowPath, 'follow_path', execute)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    interrupt = Interrupt()
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0, interrupt=interrupt))
    assert begun.wait(60.0)
    interrupt.set()
    with pytest.raises(CallInterruptedError):
        end()
    assert caller.run(follow(), accept_timeout=60.0).status == 'aborted'
    said = capfd.readouterr().err
    assert '[INFO]' in said
    assert said.count('[ERROR]') == 1
    assert 'Traceback' not in said


def test_exception_in_execute_aborts_the_goal_and_the_server_goes_on(graph, server):
    def execute(goal, run):
        return FollowPath.Result(position=goal.path[0])

    GoalServer(server, FollowPath, 'follow_path', execute)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    assert caller.run(follow(), accept_timeout=60.0).status == 'aborted'
    assert caller.run(follow(3), accept_timeout=60.0).status == 'succeeded'


def waiting_server(server, name='follow_path'):
    """Offer a server whose goals run until they are interrupted; return its list of started
    runs.
    """
    runs = []

    def execute(goal, run):
        runs.append(run)
        run.sleep(1e6)
        return FollowPath.Result(position=goal.path[0])

    GoalServer(server, FollowPath, name, execute)
    return runs


def test_interrupt_cancels_the_goal_on_the_server(graph, server):
    runs = waiting_server(server)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    interrupt = Interrupt()
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0, interrupt=interrupt))
    graph.until(lambda: runs)
    interrupt.set()
    with pytest.raises(CallInterruptedError):
        end()
    # An interrupt before the server's yes has arrived cancels the goal once it has.
    graph.until(lambda: runs[0].cancelled)


def test_result_deadline_cancels_the_goal(graph, server):
    runs = waiting_server(server)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    with pytest.raises(CallTimeoutError):
        caller.run(follow(1), accept_timeout=60.0, result_timeout=0.1)
    # On a busy machine the goal begins after its deadline.
    graph.until(lambda: runs and runs[0].cancelled)


def test_newer_goal_takes_the_place_of_the_running_one(graph, server):
    runs = waiting_server(server)
    first = GoalCaller(graph.node, FollowPath, 'follow_path')
    second = GoalCaller(graph.node, FollowPath, 'follow_path')
    interrupt = Interrupt()
    end_of_first = in_thread(lambda: first.run(follow(1), accept_timeout=60.0))
    graph.until(lambda: len(runs) == 1)
    end_of_second = in_thread(
        lambda: second.run(follow(2), accept_timeout=60.0, interrupt=interrupt)
    )
    assert end_of_first().status == 'aborted'
    graph.until(lambda: len(runs) == 2)
    interrupt.set()
    with pytest.raises(CallInterruptedError):
        end_of_second()


def test_server_that_goes_away_in_the_middle_is_noticed(graph, server):
    runs = waiting_server(server)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0))
    graph.until(lambda: runs)
    graph.drop(server)
    with pytest.raises(UnavailableError, match='went away'):
        end()
    runs[0].interrupt.set()


def test_server_that_takes_the_place_of_one_that_was_killed_is_noticed(graph):
    server = graph.add(ScriptedActionServer)  # as one that was killed: it is still known
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0))
    graph.until(lambda: 'result' in server.server.asked)
    waiting_server(graph.add(PatrolNode, name='restarted'))
    # Either the new server is asked first, or it is recognised by its identifiers.
    with pytest.raises(UnavailableError, match=r'another server took|does not know the goal'):
        end()
    assert server.cancelled.wait(60.0), 'if it lives after all, the goal must not run on unseen'


SERVER = """
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from surveillance_interfaces.action import FollowPath
from state_machines.ros import GoalServer

rclpy.init()
node = Node('server')
GoalServer(node, FollowPath, 'follow_path', lambda _goal, run: run.interrupt.wait())
executor = SingleThreadedExecutor()
executor.add_node(node)
executor.spin()
"""


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_a_server_whose_process_dies_or_freezes_ends_the_goal_though_it_is_known(graph, number):
    process = subprocess.Popen([sys.executable, '-c', SERVER])
    try:
        caller = GoalCaller(graph.node, FollowPath, 'follow_path')
        end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0))
        graph.until(lambda: caller._liveliness._living)
        process.send_signal(number)
        # Though the middleware knows it for 20 s.
        with pytest.raises(UnavailableError, match='lives no more'):
            end()
    finally:
        process.kill()
        process.wait()


def test_a_result_that_is_lost_is_asked_for_again(graph, monkeypatch):
    monkeypatch.setattr(calls, 'RESULT_PERIOD', 0.1)
    server = graph.add(ScriptedActionServer)
    server.server.loses = {'result'}
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0))
    graph.until(lambda: 'result' in server.server.asked)
    server.let_go()
    assert end().status == 'succeeded'


def test_a_goal_that_runs_for_hours_is_asked_for_its_result_a_few_times(monkeypatch):
    now, asked = [0.0], []
    monkeypatch.setattr(calls, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    handle = SimpleNamespace(
        status=GoalStatus.STATUS_EXECUTING,
        get_result_async=lambda: asked.append(now[0]) or Future(),
    )
    goal = calls._RunningGoal(handle, lambda: None, 'action')

    def pass_time(seconds):
        for _ in range(int(seconds)):
            now[0] += 1.0
            goal._look()

    pass_time(7200.0)
    assert len(asked) < 40
    handle.status = GoalStatus.STATUS_SUCCEEDED
    before = len(asked)
    pass_time(20.0)
    assert len(asked) - before >= 3, 'the server forgets its result soon'


def test_a_result_is_asked_for_steadily_where_no_status_comes(monkeypatch):
    now, asked = [0.0], []
    monkeypatch.setattr(calls, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    handle = SimpleNamespace(
        status=GoalStatus.STATUS_UNKNOWN,
        get_result_async=lambda: asked.append(now[0]) or Future(),
    )
    goal = calls._RunningGoal(handle, lambda: None, 'action')
    for _ in range(600):
        now[0] += 1.0
        goal._look()
    gaps = [later - earlier for earlier, later in itertools.pairwise(asked)]
    assert max(gaps) <= calls.RESULT_PERIOD + 1.0


def test_a_cancel_that_is_lost_is_sent_again(graph, monkeypatch):
    monkeypatch.setattr(calls, 'CANCEL_PERIOD', 0.1)
    server = graph.add(ScriptedActionServer)
    server.server.loses = {'cancel'}
    caller = GoalCaller(graph.node, FollowPath, 'follow_path', cancel_timeout=60.0)
    interrupt = Interrupt()
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0, interrupt=interrupt))
    graph.until(lambda: 'result' in server.server.asked)
    interrupt.set()
    assert server.cancelled.wait(60.0)
    server.let_go()
    with pytest.raises(CallInterruptedError):
        end()


def test_server_that_goes_away_before_its_yes_is_noticed(graph):
    server = graph.add(ScriptedActionServer)
    server.server.loses = {'goal'}
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0))
    graph.until(lambda: 'goal' in server.server.asked)
    graph.drop(server)
    with pytest.raises(UnavailableError, match='went away'):
        end()


def test_server_that_goes_away_while_it_cancels_is_not_waited_for(graph):
    server = graph.add(Stubborn)
    caller = GoalCaller(graph.node, FollowPath, 'follow_path', cancel_timeout=1000.0)
    interrupt = Interrupt()
    end = in_thread(lambda: caller.run(follow(1), accept_timeout=60.0, interrupt=interrupt))
    graph.until(lambda: 'result' in server.server.asked)
    interrupt.set()
    assert server.cancelled.wait(60.0)
    graph.drop(server)
    with pytest.raises(CallInterruptedError):
        end()


def test_no_action_server(graph):
    with pytest.raises(UnavailableError, match='action nowhere: no server'):
        GoalCaller(graph.node, FollowPath, 'nowhere').run(follow(1), accept_timeout=0.05)


def test_clock_wait_follows_simulated_time(graph):
    node = graph.add(PatrolNode, name='sleeper', parameters={'use_sim_time': True})
    clock = graph.node.create_publisher(Clock, '/clock', 1)
    wait = ClockWait(node)

    def tick(second):
        message = Clock()
        message.clock.sec = second
        clock.publish(message)

    graph.until(lambda: (tick(100), wait.now() == 100.0)[1])
    interrupt = Asleep()
    end = in_thread(lambda: wait.sleep(50.0, interrupt))
    assert interrupt.begun.wait(60.0)
    tick(149)
    graph.until(lambda: wait.now() == 149.0)
    tick(151)
    assert end() is True


def test_clock_wait_ends_by_interrupt(graph):
    wait = ClockWait(graph.node)
    interrupt = Interrupt()
    end = in_thread(lambda: wait.sleep(1000.0, interrupt))
    interrupt.set()
    assert end() is False


def test_requests_that_wait_for_a_busy_server_are_not_lost(graph, server):
    """rclpy's default keeps ten requests and ten answers and drops the rest without a word."""
    began, go_on = threading.Event(), threading.Event()

    def serve(_request, answer):
        began.set()
        assert go_on.wait(60.0)
        return answer

    server.create_service(Trigger, 'busy', serve)
    client = graph.node.create_client(Trigger, 'busy')
    assert client.wait_for_service(60.0)
    futures = [client.call_async(Trigger.Request()) for _ in range(300)]
    assert began.wait(60.0)
    go_on.set()
    answered = threading.Event()

    def count(_future):
        if all(future.done() for future in futures):
            answered.set()

    for future in futures:
        future.add_done_callback(count)
    assert answered.wait(60.0), sum(not future.done() for future in futures)
