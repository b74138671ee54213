"""What callbacks of a `PatrolNode` await while the executor goes on: work in order, and events.

What any node can wait for is in `state_machines.ros`.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any

from rclpy.task import Future

from state_machines.ros.waiting import reported, wake_executor
from surveillance_runtime.node import PatrolNode


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
        future, report = reported(self._node, work)
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
        """Return the next time it happens, to be awaited in a callback."""
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
        wake_executor(self._node)
