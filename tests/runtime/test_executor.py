"""What a node may count on from the executor that spins it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import rclpy
from builtin_interfaces.msg import Time
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from surveillance_runtime import executor
from surveillance_runtime.executor import PatrolExecutor

PATIENCE = 60.0


class Spun:
    """Two nodes and the executor that spins them in this thread."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = PatrolExecutor(context=self.context)
        self.nodes = [self.node(name) for name in ('first', 'second')]

    def node(self, name: str) -> Node:
        node = Node(name, context=self.context, use_global_arguments=False)
        self.executor.add_node(node)
        return node

    def until(self, condition: object) -> None:
        end = time.monotonic() + PATIENCE
        assert callable(condition)
        while not condition():
            assert time.monotonic() < end, 'too late'
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def spun(ros_domain: int) -> Iterator[Spun]:
    it = Spun(ros_domain)
    yield it
    it.close()


def test_what_comes_and_goes_while_it_spins_is_heard(spun: Spun) -> None:
    first, second = spun.nodes
    heard: list[int] = []
    publisher = first.create_publisher(Int32, 'numbers', 10)
    for number in range(3):
        listener = second.create_subscription(
            Int32, 'numbers', lambda message: heard.append(message.data), 10
        )
        spun.until(lambda: publisher.get_subscription_count() == 1)
        publisher.publish(Int32(data=number))
        spun.until(lambda number=number: heard[-1:] == [number])
        second.destroy_subscription(listener)
        spun.until(lambda: publisher.get_subscription_count() == 0)
    assert heard == [0, 1, 2]
    third = spun.node('third')
    told = third.create_publisher(Int32, 'others', 10)
    others: list[int] = []
    first.create_subscription(Int32, 'others', lambda message: others.append(message.data), 10)
    spun.until(lambda: told.get_subscription_count() == 1)
    told.publish(Int32(data=7))
    spun.until(lambda: others == [7])
    spun.nodes.append(third)


def test_a_node_that_is_removed_while_it_spins_is_heard_no_more(
    spun: Spun, monkeypatch: pytest.MonkeyPatch
) -> None:
    teller, listener = spun.nodes
    ticks: list[str] = []
    listener.create_timer(0.001, lambda: ticks.append('removed'))
    spun.until(lambda: ticks)
    remove = SingleThreadedExecutor.remove_node

    def late(self: PatrolExecutor, node: Node) -> None:
        # As when the spinning thread comes first.
        self.spin_once(timeout_sec=0.1)
        remove(self, node)

    monkeypatch.setattr(SingleThreadedExecutor, 'remove_node', late)
    teller.create_timer(0.001, lambda: ticks.append('kept'))
    spun.executor.remove_node(listener)
    ticks.clear()
    # What was ready, and what a wait under way brings, is called still: one of each timer.
    spun.until(lambda: ticks.count('kept') >= 3)
    ticks.clear()
    spun.until(lambda: ticks.count('kept') >= 10)
    assert 'removed' not in ticks


def test_a_coroutine_waits_while_others_are_served_and_keeps_its_group(spun: Spun) -> None:
    server, client = spun.nodes
    gate, begun, ticks = Future(), [], []

    async def slow(_request: object, response: Trigger.Response) -> Trigger.Response:
        begun.append(time.monotonic())
        response.message = await gate
        return response

    server.create_service(Trigger, 'slow', slow)
    server.create_timer(0.01, lambda: ticks.append('its group'))
    client.create_timer(0.01, lambda: ticks.append('another'))
    caller = client.create_client(Trigger, 'slow', callback_group=ReentrantCallbackGroup())
    spun.until(caller.service_is_ready)
    answers = [caller.call_async(Trigger.Request()) for _ in range(2)]
    spun.until(lambda: begun)
    ticks.clear()
    spun.until(lambda: len(ticks) >= 10)
    assert set(ticks) == {'another'}
    assert len(begun) == 1
    threading.Timer(0.05, lambda: (gate.set_result('done'), spun.executor.wake())).start()
    spun.until(lambda: all(answer.done() for answer in answers))
    assert [answer.result().message for answer in answers] == ['done', 'done']
    ticks.clear()
    spun.until(lambda: set(ticks) == {'its group', 'another'})


def test_a_waiting_coroutine_takes_no_processor_time(spun: Spun) -> None:
    gate = Future()
    task = spun.executor.create_task(lambda: None)
    spun.until(task.done)

    async def waits() -> str:
        return str(await gate)

    task = spun.executor.create_task(waits)
    spun.executor.spin_once(timeout_sec=0.05)
    used = time.thread_time()
    spun.executor.spin_once(timeout_sec=0.5)
    spun.executor.spin_once(timeout_sec=0.5)
    assert time.thread_time() - used < 0.3
    gate.set_result('now')
    spun.until(task.done)
    assert task.result() == 'now'


def test_tasks_that_complete_one_another_all_end(spun: Spun) -> None:
    futures = [Future() for _ in range(5)]

    async def link(number: int) -> None:
        if number:
            await futures[number - 1]
        futures[number].set_result(number)

    tasks = [spun.executor.create_task(link, number) for number in reversed(range(5))]
    spun.until(lambda: all(task.done() for task in tasks))


def test_what_a_callback_raises_comes_out_and_the_others_are_called(spun: Spun) -> None:
    first, second = spun.nodes
    called: list[int] = []

    def fails() -> None:
        raise ValueError('no good')

    timer = first.create_timer(0.01, fails)
    second.create_timer(0.01, lambda: called.append(1))
    with pytest.raises(ValueError, match='no good'):
        spun.until(lambda: False)
    timer.cancel()
    spun.until(lambda: len(called) > 3)
    spun.executor.create_task(lambda: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        spun.until(lambda: False)


def test_a_guard_condition_calls_once_for_each_trigger_seen(spun: Spun) -> None:
    called: list[int] = []
    guard = spun.nodes[0].create_guard_condition(lambda: called.append(1))
    guard.trigger()
    spun.until(lambda: called)
    for _ in range(5):
        spun.executor.spin_once(timeout_sec=0.01)
    assert len(called) == 1


def test_the_end_of_the_context_ends_the_spinning(spun: Spun) -> None:
    rclpy.try_shutdown(context=spun.context)
    with pytest.raises(ExternalShutdownException):
        spun.until(lambda: False)


def test_each_node_hears_the_clock_also_one_that_joins_while_time_stands(spun: Spun) -> None:
    simulated = Parameter('use_sim_time', value=True)
    first, second = spun.nodes
    third = Node(
        'third',
        context=spun.context,
        use_global_arguments=False,
        parameter_overrides=[simulated],
    )
    first.set_parameters([simulated])
    second.set_parameters([simulated])
    teller = first.create_publisher(Clock, '/clock', 1)

    def clocks() -> list[int]:
        return [node.get_clock().now().nanoseconds // 10**9 for node in (first, second, third)]

    spun.until(lambda: teller.get_subscription_count() == 3)
    teller.publish(Clock(clock=Time(sec=5)))
    spun.until(lambda: clocks() == [5, 5, 0])
    spun.executor.add_node(third)
    spun.nodes.append(third)
    spun.until(lambda: clocks() == [5, 5, 5])
    first.set_parameters([Parameter('use_sim_time', value=False)])
    spun.until(lambda: teller.get_subscription_count() == 2)
    teller.publish(Clock(clock=Time(sec=6)))
    spun.until(lambda: clocks()[1:] == [6, 6])
    assert clocks()[0] > 6


def test_a_jump_callback_that_fails_costs_no_other_node_its_time(spun: Spun) -> None:
    for node in spun.nodes:
        node.set_parameters([Parameter('use_sim_time', value=True)])
    clocks = [node.get_clock() for node in spun.nodes]
    handles = [
        clock.create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None),
            post_callback=lambda _jump: 1 / 0,
        )
        for clock in clocks
    ]
    teller = spun.nodes[0].create_publisher(Clock, '/clock', 1)
    spun.until(lambda: teller.get_subscription_count() == 2)
    teller.publish(Clock(clock=Time(sec=5)))
    for _ in spun.nodes:
        with pytest.raises(Exception, match='division by zero'):
            spun.until(lambda: False)
    assert [clock.now().nanoseconds for clock in clocks] == [5 * 10**9] * 2
    for handle in handles:
        handle.unregister()


def test_what_another_thread_destroys_in_the_middle_of_a_wait_raises_nothing(spun: Spun) -> None:
    node = spun.nodes[0]
    listener = node.create_subscription(Int32, 'numbers', lambda _message: None, 1)
    spun.executor.spin_once(timeout_sec=0.0)
    spun.until(lambda: not spun.executor._changed)
    listener.event_handlers[0].destroy()  # as `destroy_subscription` begins, before it wakes
    spun.executor.spin_once(timeout_sec=0.0)
    node.destroy_subscription(listener)
    task = spun.executor.create_task(lambda: None)
    spun.until(task.done)


def test_coroutines_of_many_groups_leave_few_wait_lists(spun: Spun) -> None:
    """Each set of groups that are held at once has a list; there may be very many such sets."""
    node, gates = spun.nodes[0], [Future() for _ in range(40)]
    timers: list[Timer] = []
    begun: list[int] = []
    for number, gate in enumerate(gates):

        async def waits(number: int = number, gate: Future = gate) -> None:
            timers[number].cancel()
            begun.append(number)
            await gate

        timers.append(node.create_timer(0.001, waits, MutuallyExclusiveCallbackGroup()))
    spun.until(lambda: len(begun) >= len(gates))
    for gate in gates:
        gate.set_result(None)
        spun.executor.spin_once(timeout_sec=0.01)
    assert len(spun.executor._wait_lists) <= executor._MOST_LISTS


def test_a_service_answers_while_messages_keep_the_executor_busy(spun: Spun) -> None:
    server, client = spun.nodes
    echo = server.create_publisher(Int32, 'numbers', 10)
    server.create_subscription(Int32, 'numbers', echo.publish, 10)
    spun.until(lambda: echo.get_subscription_count() == 1)
    server.create_service(Trigger, 'ask', lambda _request, response: response)
    caller = client.create_client(Trigger, 'ask')
    spun.until(caller.service_is_ready)
    echo.publish(Int32())
    answer = caller.call_async(Trigger.Request())
    spun.until(answer.done)


def test_slow_callbacks_delay_what_is_rarely_called_by_one_of_them(
    spun: Spun, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = 0
    asked, late = 0, list[int]()
    now = [0.0]
    monkeypatch.setattr(executor, 'time', SimpleNamespace(monotonic=lambda: now[0]))
    guard = spun.nodes[1].create_guard_condition(lambda: late.append(calls - asked))

    def slow() -> None:
        nonlocal calls, asked
        calls += 1
        now[0] += 0.02
        if calls % 33 == 0:
            asked = calls
            guard.trigger()

    spun.nodes[0].create_timer(0.0, slow)
    spun.until(lambda: len(late) == 20)
    assert max(late) <= 1


def test_events_are_told_while_messages_keep_the_executor_busy(spun: Spun) -> None:
    server, client = spun.nodes
    echo = server.create_publisher(Int32, 'numbers', 10)
    server.create_subscription(Int32, 'numbers', echo.publish, 10)
    spun.until(lambda: echo.get_subscription_count() == 1)
    echo.publish(Int32())
    told: list[object] = []
    events = PublisherEventCallbacks(matched=told.append)
    client.create_publisher(Int32, 'other', 10, event_callbacks=events)
    server.create_subscription(Int32, 'other', lambda _message: None, 10)
    spun.until(lambda: told)
