"""How threads and callbacks wait: sleeps on ROS time, work on threads, events.

`ClockWait` sleeps on a node's clock, so that under `use_sim_time` a mission runs as fast as
`/clock` does; it needs the node to be spun by an executor then. `work_aside`, `AwaitedWork` and
`AwaitedEvent` are for callbacks, which `await` while the executor goes on. A future that another
thread completes does not wake the executor, so whoever completes one here wakes it.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy.clock import ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future

from surveillance_runtime.interrupt import Interrupt as Interrupt

if TYPE_CHECKING:
    from surveillance_runtime.node import PatrolNode


class ClockWait:
    """Sleeps on a node's clock that an `Interrupt` ends early.

    Args:
        node: The node whose clock counts; wall time, or `/clock` under `use_sim_time`.
    """

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self._changed = threading.Condition()
        # rclpy hands the handle's address to C, so it must live as long as the clock.
        self._jumps = self._clock.create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None),
            post_callback=self._on_jump,
        )

    def now(self) -> float:
        """Return the clock's time in seconds."""
        return float(self._clock.now().nanoseconds) / 1e9

    def sleep(self, seconds: float, interrupt: Interrupt | None = None) -> bool:
        """Block for a time on the node's clock; never call it from a callback.

        Args:
            seconds: How long to sleep; zero or less only looks at the interrupt.
            interrupt: Ends the sleep early when it is raised.

        Returns:
            True when the whole time passed, False when the interrupt came first.
        """
        deadline = self._clock.now().nanoseconds + round(seconds * 1e9)
        remove = interrupt.subscribe(self._wake) if interrupt is not None else None
        try:
            with self._changed:
                while True:
                    if interrupt is not None and interrupt.is_set():
                        return False
                    remaining = deadline - self._clock.now().nanoseconds
                    if remaining <= 0:
                        return True
                    self._changed.wait(None if self._follows_topic() else remaining / 1e9)
        finally:
            if remove is not None:
                remove()

    def _follows_topic(self) -> bool:
        return bool(self._clock.clock_type == ClockType.ROS_TIME and self._clock.ros_time_is_active)

    def _on_jump(self, _jump: Any) -> None:
        self._wake()

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()


def work_aside(node: PatrolNode, work: Callable[[], Any], name: str) -> Future:
    """Do work on a thread of its own.

    Args:
        node: The node whose callback awaits; it joins the thread when it stops.
        work: What to do; it may block, and must heed the node's `stopping`.
        name: The thread's name.

    Returns:
        What the work returns or raises, to be awaited in a callback.
    """
    future, report = _reported(node, work)
    node.spawn(report, name)
    return future


class AwaitedWork:
    """Threads of a node that take work in order.

    Args:
        node: The node; its executor must spin.
        threads: How many pieces of work run at a time.
    """

    def __init__(self, node: PatrolNode, threads: int) -> None:
        self._node = node
        self._threads = threads
        self._queue: queue.SimpleQueue[Callable[[], Any] | None] = queue.SimpleQueue()
        for number in range(threads):
            node.spawn(self._take, f'{node.get_name()} worker {number}')

    def put(self, work: Callable[[], Any]) -> None:
        """Have work done; nobody waits for it."""
        self._queue.put(work)

    def run(self, work: Callable[[], Any]) -> Future:
        """Have work done; its result, or what it raised, is to be awaited in a callback."""
        future, report = _reported(self._node, work)
        self._queue.put(report)
        return future

    def stop(self) -> None:
        """Let the threads end once they are done with what they do; what waits is dropped."""
        for _ in range(self._threads):
            self._queue.put(None)

    def _take(self) -> None:
        while (work := self._queue.get()) is not None:
            if not self._node.stopping.is_set():
                work()


class AwaitedEvent:
    """Something that happens now and then, and the callbacks that wait for it.

    Args:
        node: The node whose callbacks await; its executor must spin.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        self._lock = threading.Lock()
        self._futures: set[Future] = set()

    def next_time(self) -> Future:
        """The next time it happens, to be awaited in a callback."""
        future = Future()
        with self._lock:
            self._futures.add(future)
        return future

    async def wait_for(self, holds: Callable[[], bool]) -> None:
        """Wait in a callback until a condition holds; it is looked at each time this happens."""
        while not holds():
            future = self.next_time()
            # It may have come to hold in between, and then nothing would happen any more.
            if holds():
                with self._lock:
                    self._futures.discard(future)
                return
            await future

    def happen(self) -> None:
        """Let go whoever waits; from any thread."""
        with self._lock:
            futures, self._futures = self._futures, set()
        for future in futures:
            future.set_result(None)
        _wake(self._node)


def _reported(node: PatrolNode, work: Callable[[], Any]) -> tuple[Future, Callable[[], None]]:
    """A future, and the work that completes it."""
    future = Future()

    def report() -> None:
        try:
            result = work()
        except Exception as error:
            future.set_exception(error)
        else:
            future.set_result(result)
        _wake(node)

    return future, report


def _wake(node: PatrolNode) -> None:
    if node.executor is not None:
        node.executor.wake()
