"""The executor runs what rclpy's would, whatever comes, goes or waits."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from surveillance_runtime import lean_executor
from surveillance_runtime.lean_executor import LeanExecutor, make_executor


def test_the_nodes_run_on_it(graph: Any) -> None:
    assert isinstance(graph.node.executor, LeanExecutor)


def test_entities_made_while_it_spins_are_served(graph: Any) -> None:
    for number in range(3):
        heard = graph.listen(Int32, f'topic{number}')
        publisher = graph.node.create_publisher(Int32, f'topic{number}', 1)
        graph.until(publisher.get_subscription_count)
        publisher.publish(Int32(data=number))
        graph.until(lambda heard=heard: heard)
        assert heard[0].data == number


def test_a_destroyed_entity_is_left_alone(graph: Any) -> None:
    fired: list[int] = []
    timers = [graph.node.create_timer(0.001, lambda: fired.append(0)) for _ in range(20)]
    graph.until(lambda: fired)
    for timer in timers:
        graph.node.destroy_timer(timer)
    graph.node.create_timer(0.001, lambda: fired.append(1))
    graph.until(lambda: 1 in fired)


def test_a_cancelled_timer_fires_no_more_and_a_reset_one_again(graph: Any) -> None:
    fired: list[int] = []

    def fire() -> None:
        fired.append(1)
        timer.cancel()
        graph.touch()

    timer = graph.node.create_timer(0.001, fire)
    graph.until(lambda: fired)
    other: list[int] = []
    graph.node.create_timer(0.002, lambda: other.append(1))
    graph.until(lambda: len(other) > 3)
    assert len(fired) == 1
    timer.reset()
    graph.until(lambda: len(fired) == 2)


def test_a_callback_that_awaits_holds_its_group_and_no_other(graph: Any) -> None:
    group = MutuallyExclusiveCallbackGroup()
    gate = Future()
    events: list[str] = []

    async def wait(_request: Any, response: Any) -> Any:
        events.append('begins')
        await gate
        events.append('goes on')
        return response

    graph.node.create_service(Trigger, 'waits', wait, callback_group=group)
    graph.node.create_timer(0.001, lambda: events.append('same'), callback_group=group)
    client = graph.node.create_client(Trigger, 'waits')
    client.wait_for_service(10)
    answer = client.call_async(Trigger.Request())
    graph.until(lambda: 'begins' in events)
    heard = graph.listen(Int32, 'other')
    publisher = graph.node.create_publisher(Int32, 'other', 1)
    graph.until(publisher.get_subscription_count)
    publisher.publish(Int32(data=1))
    graph.until(lambda: heard)
    assert events[events.index('begins') + 1 :] == []
    graph.node.executor.create_task(lambda: gate.set_result(None))
    graph.until(answer.done)
    graph.until(lambda: events[-1] == 'same')
    assert events[events.index('begins') + 1] == 'goes on'


def test_a_guard_condition_wakes_it_from_another_thread(graph: Any) -> None:
    woken = threading.Event()
    guard = graph.node.create_guard_condition(woken.set)
    threading.Thread(target=guard.trigger).start()
    assert woken.wait(10)


def test_quality_of_service_events_arrive(graph: Any) -> None:
    matched: list[Any] = []
    from rclpy.event_handler import PublisherEventCallbacks

    graph.node.create_publisher(
        Int32, 'watched', 1, event_callbacks=PublisherEventCallbacks(matched=matched.append)
    )
    reliable = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    graph.node.create_subscription(Int32, 'watched', lambda _: None, reliable)
    graph.until(lambda: matched)
    assert matched[0].current_count == 1


def test_without_what_it_leans_on_rclpy_s_own_is_used(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lean_executor, '_NEEDED', ('_not_there',))
    executor = make_executor(graph.context)
    assert type(executor) is SingleThreadedExecutor
    executor.shutdown()


def test_spinning_with_a_timeout_ends_in_time(graph: Any) -> None:
    executor = LeanExecutor(context=graph.context)
    executor.spin_once(timeout_sec=0.01)
    executor.shutdown()
