"""What callbacks await: work on threads, and events."""

from __future__ import annotations

import threading

from state_machines.ros import work_aside
from surveillance_runtime.waiting import AwaitedEvent, AwaitedWork


def awaited(graph, coroutine):
    """Run a coroutine in the executor; what it returned or raised."""
    task = graph.node.executor.create_task(coroutine)
    graph.until(task.done)
    return task.exception() or task.result()


def test_work_aside_gives_its_result_or_what_it_raised(graph):
    async def both():
        name = await work_aside(graph.node, lambda: threading.current_thread().name, 'aside')
        try:
            await work_aside(graph.node, lambda: [].pop(), 'failing')
        except IndexError as error:
            return name, str(error)

    assert awaited(graph, both) == ('aside', 'pop from empty list')


def test_one_thread_takes_work_in_order_while_two_take_it_at_a_time(graph):
    both_there = threading.Barrier(2)
    pair = AwaitedWork(graph.node, 2)
    single = AwaitedWork(graph.node, 1)
    done = []

    async def work():
        met = pair.run(lambda: both_there.wait(60.0))
        await pair.run(lambda: both_there.wait(60.0))
        await met
        for number in range(3):
            single.put(lambda number=number: done.append(number))
        return await single.run(lambda: tuple(done))

    try:
        assert awaited(graph, work) == (0, 1, 2)
    finally:
        pair.stop()
        single.stop()


def test_an_event_lets_go_all_who_wait_for_it(graph):
    event = AwaitedEvent(graph.node)
    waiting = [graph.node.executor.create_task(wait(event.next_time())) for _ in range(3)]
    graph.until(lambda: len(event._futures) == 3)
    event.happen()
    graph.until(lambda: all(task.done() for task in waiting))


async def wait(future):
    await future


def test_a_condition_is_looked_at_each_time_and_nothing_is_kept_of_who_does_not_wait(graph):
    event, state = AwaitedEvent(graph.node), {'open': False, 'looks': 0}

    def is_open():
        state['looks'] += 1
        return state['open']

    task = graph.node.executor.create_task(event.wait_for, is_open)
    graph.until(lambda: state['looks'] == 2)
    event.happen()
    graph.until(lambda: state['looks'] == 4)
    assert not task.done()
    state['open'] = True
    event.happen()
    graph.until(task.done)
    assert awaited(graph, event.wait_for(is_open)) is None
    assert not event._futures


def test_a_condition_that_comes_to_hold_while_it_is_looked_at_is_not_missed(graph):
    event = AwaitedEvent(graph.node)
    looks = iter([False, True])
    assert awaited(graph, event.wait_for(lambda: next(looks))) is None
    assert not event._futures
