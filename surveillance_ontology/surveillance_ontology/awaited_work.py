"""Work on threads whose result a callback awaits, so that the executor goes on meanwhile."""

from __future__ import annotations

import queue
from collections.abc import Callable
from typing import Any

from rclpy.task import Future

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
        future = Future(executor=self._node.executor)

        def report() -> None:
            try:
                result = work()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(result)
            # A future that another thread completes does not wake the executor.
            if self._node.executor is not None:
                self._node.executor.wake()

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
