"""Service calls that always end: with an answer, or with an error in time.

Two ways to use them: blocking from a worker thread (`call`), or with `await` in a callback
(`call_async`). Blocking in a callback would stop the executor that brings the answer. Goals of
actions are the matter of `goal_calls`.

Deadlines here are steady time: how long a peer may take to answer has nothing to do with
simulated time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from surveillance_runtime.qos import CLIENT_QOS
from surveillance_runtime.waiting import Interrupt

DISCOVERY_PERIOD = 0.02
"""Seconds between two looks for a server; rclpy offers no event for its appearance."""


SERVER_PERIOD = 0.1
"""Seconds between two looks whether the server that owes an answer is still there."""


class CallFailed(Exception):
    """A call did not bring an answer; the message is one line that names the peer."""


class Unavailable(CallFailed):
    """The server is not there, or went away before it answered."""


class TimedOut(CallFailed):
    """The server is there but did not answer in time."""


class Interrupted(CallFailed):
    """The caller's interrupt ended the wait."""


class ServiceCaller:
    """Calls one service.

    Args:
        node: The node that calls; an executor must spin it.
        srv_type: The service's type.
        name: The service's name, relative to the node's namespace.
    """

    def __init__(self, node: Node, srv_type: Any, name: str) -> None:
        self._node = node
        self._client = node.create_client(
            srv_type, name, callback_group=ReentrantCallbackGroup(), qos_profile=CLIENT_QOS
        )
        self.name = name

    def is_ready(self) -> bool:
        """Tell whether the server is there now."""
        return bool(self._client.service_is_ready())

    def call(
        self,
        request: Any,
        timeout: float,
        interrupt: Interrupt | None = None,
        *,
        discovery: float | None = None,
    ) -> Any:
        """Call and block until the answer; from a worker thread only.

        A server that was stopped is noticed at once. One that was killed is known to be gone only
        when another takes its place, or after the middleware's own deadline (20 s by default).

        Args:
            request: The request message.
            timeout: Seconds for finding the server and for its answer together.
            interrupt: Ends the wait early.
            discovery: Seconds for finding the server, where an answer may take much longer;
                default: `timeout`.

        Returns:
            The response message.

        Raises:
            Unavailable: No server within the time, or it went away before it answered.
            TimedOut: No answer within the time.
            Interrupted: The interrupt was raised.
        """
        deadline = time.monotonic() + timeout
        found_by = deadline if discovery is None else time.monotonic() + min(discovery, timeout)
        what = f'service {self.name}'
        await_ready(self.is_ready, found_by, interrupt, what)
        future = self._client.call_async(request)
        try:
            return block_on(future, deadline, interrupt, what, self._look_for_loss())
        except CallFailed:
            self._client.remove_pending_request(future)
            raise

    def _look_for_loss(self) -> Callable[[], None]:
        """Return a look at the server that raises `Unavailable` once it owes an answer for ever."""
        servers, lost = self._count_servers(), ''

        def look() -> None:
            nonlocal servers, lost
            if lost:
                raise Unavailable(f'service {self.name}: {lost}')
            before, servers = servers, self._count_servers()
            # Not before the next look: an answer may be under way.
            if not self.is_ready():
                lost = 'the server went away before it answered'
            elif servers > before:
                lost = 'another server took the place of the one that was asked'

        return look

    def _count_servers(self) -> int:
        # One that answers to `is_ready` may not be counted yet.
        return max(1, int(self._node.count_services(self._client.service_name)))

    async def call_async(self, request: Any, timeout: float) -> Any:
        """Call from a callback with `await`; otherwise as `call`.

        Raises:
            Unavailable: The server is not there when the call is made.
            TimedOut: No answer within the time.
        """
        if not self.is_ready():
            raise Unavailable(f'service {self.name}: no server')
        future = self._client.call_async(request)
        executor = self._node.executor
        late = threading.Event()

        def expire() -> None:
            late.set()
            future.cancel()
            executor.wake()

        timer = threading.Timer(timeout, expire)
        timer.daemon = True
        timer.start()
        try:
            response = await future
        finally:
            timer.cancel()
        if late.is_set() and not future.done():
            self._client.remove_pending_request(future)
            raise TimedOut(f'service {self.name}: no answer within {timeout:g} s')
        return response


def await_ready(
    is_ready: Callable[[], bool], deadline: float, interrupt: Interrupt | None, what: str
) -> None:
    """Wait for a server, on a worker thread.

    Args:
        is_ready: Whether it is there.
        deadline: Steady time in seconds at which the wait ends.
        interrupt: Ends the wait early.
        what: Names the server in errors.

    Raises:
        Unavailable: No server by the deadline.
        Interrupted: The interrupt was raised.
    """
    pause = interrupt if interrupt is not None else Interrupt()
    while not is_ready():
        if time.monotonic() >= deadline:
            raise Unavailable(f'{what}: no server')
        if pause.wait(DISCOVERY_PERIOD):
            raise Interrupted(f'{what}: interrupted')


def block_on(
    future: Future,
    deadline: float,
    interrupt: Interrupt | None,
    what: str,
    look: Callable[[], None] = lambda: None,
) -> Any:
    """Wait for a future that the executor completes, on a worker thread; its result.

    Args:
        future: What is waited for.
        deadline: Steady time in seconds at which the wait ends.
        interrupt: Ends the wait early.
        what: Names the peer in errors.
        look: Called every `SERVER_PERIOD` meanwhile; what it raises ends the wait.

    Raises:
        TimedOut: Nothing came by the deadline.
        Interrupted: The interrupt was raised.
    """
    woken = threading.Event()
    future.add_done_callback(lambda _future: woken.set())
    remove = interrupt.subscribe(woken.set) if interrupt is not None else None
    try:
        while not woken.wait(max(0.0, min(SERVER_PERIOD, deadline - time.monotonic()))):
            if time.monotonic() >= deadline:
                break
            look()
    finally:
        if remove is not None:
            remove()
    if future.done():
        return future.result()
    if interrupt is not None and interrupt.is_set():
        raise Interrupted(f'{what}: interrupted')
    raise TimedOut(f'{what}: no answer in time')
