"""Service calls and action goals that always end: with an answer, or with an error in time.

A service is called blocking from a worker thread (`ServiceCaller.call`), or with `await` in a
callback (`call_async`); a goal is sent from a worker thread (`GoalCaller.run`). Blocking in a
callback would stop the executor that brings the answer.

Deadlines here are steady time: how long a peer may take to answer has nothing to do with
simulated time. They grow with what the link to the peer gives (`RoundTrips`).
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from rclpy.action import ActionClient
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import QoSLivelinessChangedInfo, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile
from rclpy.task import Future

from state_machines.clock import Interrupt
from state_machines.exceptions import (
    CallError,
    CallInterruptedError,
    CallTimeoutError,
    UnavailableError,
)
from state_machines.ros.waiting import (
    ACTION_CLIENT_QOS,
    ALIVE_WITHIN,
    CLIENT_QOS,
    own,
    stopping_of,
    work_aside,
)

DISCOVERY_PERIOD = 0.02
"""Seconds between two looks for a server; rclpy offers no event for its appearance."""


DOUBTFUL_SECONDS = 2.0
"""How long an answer is waited for where several servers are known.

One that was killed stays known for 20 s. Its successor may not know this client yet: it then drops
the request, or its answer, and nothing tells."""

MOST_GROWTH = 4.0
"""By how much a deadline may grow at most on a slow link."""

SERVER_PERIOD = 0.1
"""Seconds between two looks whether a server that has not answered yet is still there."""

RESULT_PERIOD = 5.0
"""Seconds after which the result of a goal that has ended is asked for again: it may be lost.

Servers may forget a result 10 s after the end."""

LONGEST_RESULT_PERIOD = 300.0
"""Seconds to which that grows while the server says that the goal runs.

A server keeps each request until the goal ends; but what it says may be lost, too."""

ASK_AGAIN = 2.0
"""Seconds after which a server that gives no answer is asked whether it does again."""

ASKED_AT_MOST = 5
"""How many of such questions are open at most."""

CANCEL_PERIOD = 0.5
"""Seconds after which a cancel that was not answered is sent again."""


REVIVED_WITHIN = 0.8
"""Seconds that a server which tells no more that it lives has to do so again: what it told may have
come late, on a busy machine."""


_PREFIX = 12
"""So many bytes of a DDS identifier are that of its participant (DDSI-RTPS 2.5, 8.2.4.1)."""


class RoundTrips:
    """Lengthens a peer's deadline by what its answers have taken, as TCP's timer does (RFC 6298).

    An answer that comes too late is not seen, so the deadline doubles with each one that is missed,
    until one comes and tells how long they take.

    Attributes:
        smoothed: The smoothed round-trip time, seconds; None before the first answer.
    """

    def __init__(self) -> None:
        self.smoothed: float | None = None
        self._variation = 0.0
        self._doubled = 1.0

    @contextmanager
    def measured(self) -> Iterator[None]:
        """Take into account how long the block waits for an answer, or that none came in time."""
        asked = time.monotonic()
        try:
            yield
        except CallTimeoutError:
            self.note_missed()
            raise
        self.note(time.monotonic() - asked)

    def note(self, seconds: float) -> None:
        """Take the time that an answer took into account (RFC 6298, 2.2 and 2.3)."""
        if self.smoothed is None:
            self.smoothed, self._variation = seconds, seconds / 2.0
        else:
            self._variation = 0.75 * self._variation + 0.25 * abs(self.smoothed - seconds)
            self.smoothed = 0.875 * self.smoothed + 0.125 * seconds
        self._doubled = 1.0

    def note_missed(self) -> None:
        """Note that no answer came in time (RFC 6298, 5.5)."""
        self._doubled = min(2.0 * self._doubled, MOST_GROWTH)

    def deadline(self, timeout: float) -> float:
        """Return how long to wait, seconds: from `timeout` to `MOST_GROWTH` times as long."""
        usual = 0.0 if self.smoothed is None else self.smoothed + 4.0 * self._variation
        return min(self._doubled * max(timeout, usual), MOST_GROWTH * timeout)


class _Servers:
    """The servers behind the name of a service, as the middleware knows them.

    Args:
        node: A node.
        service: The service's name, fully resolved.
        is_ready: Tells whether a server is there.
        what: Names the server in errors.
    """

    def __init__(self, node: Node, service: str, is_ready: Callable[[], bool], what: str) -> None:
        self._node = node
        self._topic = f'rq{service}Request'  # as every ROS on DDS calls it
        self._is_ready = is_ready
        self._what = what

    def in_processes(self) -> frozenset[tuple[int, ...]]:
        """Return which participants of DDS they are in: the beginning of their identifiers."""
        return frozenset(each[:_PREFIX] for each in self._known())

    def look_for_loss(self, doubtful_seconds: float = math.inf) -> Callable[[], None]:
        """Return a look that raises `UnavailableError` once the server will never answer.

        Args:
            doubtful_seconds: How long an answer is waited for where several servers are known.
        """
        asked, lost = self._known(), ''
        doubtful = time.monotonic() + doubtful_seconds if len(asked) > 1 else math.inf

        def look() -> None:
            nonlocal lost
            if lost:
                raise UnavailableError(f'{self._what}: {lost}', self._is_ready)
            # Not before the next look: an answer may be under way.
            if not self._is_ready():
                lost = 'the server went away before it answered'
            elif self._known() - asked:
                lost = 'another server took the place of the one that was asked'
            elif time.monotonic() > doubtful:
                lost = f'no answer, and one of {len(asked)} servers may be gone'

        return look

    def _known(self) -> frozenset[tuple[int, ...]]:
        """Return the known servers, by the identifiers that DDS gives their readers.

        Their number does not tell that another came: one that was killed may go meanwhile.
        """
        readers = self._node.get_subscriptions_info_by_topic(self._topic, no_mangle=True)
        return frozenset(tuple(reader.endpoint_gid) for reader in readers)


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
        self._what = f'service {name}'
        self._servers = _Servers(node, self._client.service_name, self.is_ready, self._what)
        self.name = name
        self.round_trips = RoundTrips()

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
            timeout: Seconds for finding the server and for its answer together; on a slow link
                the answer may take longer, see `RoundTrips`.
            interrupt: Ends the wait early.
            discovery: Seconds for finding the server, where the answer takes long because there is
                much to do. The timeout is then kept to; default: `timeout`.

        Returns:
            The response message.

        Raises:
            UnavailableError: No server within the time, or it went away before it answered.
            CallTimeoutError: No answer within the time.
            CallInterruptedError: The interrupt was raised.
        """
        deadline = time.monotonic() + timeout
        found_by = deadline if discovery is None else time.monotonic() + min(discovery, timeout)
        await_ready(self.is_ready, found_by, interrupt, self._what)
        if discovery is None:
            deadline += self.round_trips.deadline(timeout) - timeout
        return self._send(request, measured=discovery is None)(deadline, interrupt)

    def _send(
        self, request: Any, *, measured: bool = True
    ) -> Callable[[float, Interrupt | None], Any]:
        """Send a request; return what waits for its answer, on a worker thread.

        Args:
            request: The request message.
            measured: How long the answer takes counts for later deadlines.
        """
        look = self._servers.look_for_loss(DOUBTFUL_SECONDS)
        future = self._client.call_async(request)

        def await_answer(deadline: float, interrupt: Interrupt | None) -> Any:
            try:
                with self.round_trips.measured() if measured else nullcontext():
                    answer = block_on(future, deadline, interrupt, self._what, look)
            except CallError:
                self._client.remove_pending_request(future)
                raise
            _show(self._node, self.name, self.round_trips)
            return answer

        return await_answer

    def look_for_answer(self, request: Any) -> Callable[[float], bool]:
        """Return a look whether a server that did not answer does again; from a worker thread only.

        Who may do without the answer need not wait for a deadline with each call.

        Args:
            request: Is sent for that now, and with the looks every `ASK_AGAIN` seconds, as long as
                the server is known; it may be answered several times.

        Returns:
            The look. It takes how long to wait for an answer at most, seconds, and is True once
            there was one.
        """
        asked, pending = -math.inf, list[Future]()
        answered = threading.Event()

        def ask() -> None:
            nonlocal asked
            if self.is_ready() and time.monotonic() - asked >= ASK_AGAIN:
                asked = time.monotonic()
                future = self._client.call_async(request)
                future.add_done_callback(lambda _future: answered.set())
                pending.append(future)
                for old in pending[:-ASKED_AT_MOST]:
                    self._client.remove_pending_request(old)
                del pending[:-ASKED_AT_MOST]

        def look(patience: float) -> bool:
            ask()
            # Of a server that is not known no answer will come.
            if not answered.wait(patience if self.is_ready() else 0.0):
                return False
            for future in pending:
                self._client.remove_pending_request(future)
            pending.clear()
            return True

        ask()
        return look

    async def call_async(self, request: Any, timeout: float) -> Any:
        """Call from a callback with `await`, which a thread waits for; otherwise as `call`.

        Raises:
            UnavailableError: The server is not there when the call is made, or went away before it
                answered.
            CallTimeoutError: No answer within the time.
            CallInterruptedError: The node stops.
        """
        if not self.is_ready():
            raise UnavailableError(f'{self._what}: no server', self.is_ready)
        timeout = self.round_trips.deadline(timeout)
        # Here, so that requests go out in the order in which they are made.
        await_answer = self._send(request)

        def work() -> tuple[Any, CallError | None]:
            try:
                return await_answer(time.monotonic() + timeout, stopping_of(self._node)), None
            except CallError as error:
                return None, error

        # Not as the future's exception: one that is not awaited any more would complain of that.
        answer, error = await work_aside(self._node, work, f'call of {self.name}')
        if error is not None:
            raise error
        return answer


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
        UnavailableError: No server by the deadline.
        CallInterruptedError: The interrupt was raised.
    """
    pause = interrupt if interrupt is not None else Interrupt()
    while not is_ready():
        if time.monotonic() >= deadline:
            raise UnavailableError(f'{what}: no server', is_ready)
        if pause.wait(DISCOVERY_PERIOD):
            raise CallInterruptedError(f'{what}: interrupted')


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
        CallTimeoutError: Nothing came by the deadline.
        CallInterruptedError: The interrupt was raised.
    """
    begun, woken = time.monotonic(), threading.Event()
    future.add_done_callback(lambda _future: woken.set())
    remove = interrupt.subscribe(woken.set) if interrupt is not None else None
    try:
        while not woken.wait(max(0.0, min(SERVER_PERIOD, deadline - time.monotonic()))):
            if time.monotonic() >= deadline:
                break
            try:
                look()
            except UnavailableError:
                # Who was asked to stop in this moment was interrupted; the loss is no reason.
                if interrupt is not None and interrupt.is_set():
                    break
                raise
    finally:
        if remove is not None:
            remove()
    if future.done():
        return future.result()
    if interrupt is not None and interrupt.is_set():
        raise CallInterruptedError(f'{what}: interrupted')
    raise CallTimeoutError(f'{what}: no answer within {deadline - begun:.1f} s')


def _show(node: Node, name: str, round_trips: RoundTrips) -> None:
    """Have a node that reports its health tell how long a peer's answers take."""
    health = getattr(node, 'health', None)
    if health is not None and round_trips.smoothed is not None:
        health.figure(f'{name}_ms', f'{1e3 * round_trips.smoothed:.1f}')


@dataclass(frozen=True)
class GoalEnd:
    """How a goal ended.

    Attributes:
        status: `succeeded`, `aborted`, `canceled` or `rejected`.
        result: The action's result message; None when rejected.
    """

    status: str
    result: Any


_STATUS = {
    GoalStatus.STATUS_SUCCEEDED: 'succeeded',
    GoalStatus.STATUS_ABORTED: 'aborted',
    GoalStatus.STATUS_CANCELED: 'canceled',
}


class _Liveliness:
    """Whether the servers of an action live, as far as they tell by their status (`ALIVE_WITHIN`).

    Foreign servers tell nothing of it by default, and neither does Fast DDS inside a participant:
    such a server lives and dies with its client. That one of several died is not seen: whose status
    it was the middleware does not tell.

    Args:
        node: The node that calls.
        action: The action's name, relative to the node's namespace.
        servers: Those of the action.
        what: Names the server in errors.
    """

    def __init__(self, node: Node, action: str, servers: _Servers, what: str) -> None:
        self._node = node
        self._servers = servers
        self._what = what
        self._living = self._dead = 0
        self._died = -math.inf
        self._subscription = node.create_subscription(
            GoalStatusArray,
            f'{action}/_action/status',
            lambda _status: None,
            QoSProfile(
                depth=1,
                liveliness=LivelinessPolicy.AUTOMATIC,
                liveliness_lease_duration=ALIVE_WITHIN,
            ),
            callback_group=ReentrantCallbackGroup(),
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=self._on_change, use_default_callbacks=False
            ),
        )

    def _on_change(self, told: QoSLivelinessChangedInfo) -> None:
        if self._living and not told.alive_count:
            self._died = time.monotonic()
        self._living, self._dead = told.alive_count, told.not_alive_count

    def _is_back(self) -> bool:
        # A dead one is known until it is forgotten; one that tells nothing may have come then.
        return self._living > 0 or not self._dead

    def look_for_death(self) -> Callable[[], None]:
        """Return a look that raises `UnavailableError` once the server that lives lives no more."""
        lived = False

        def look() -> None:
            nonlocal lived
            lived = lived or self._living > 0
            if not lived or self._living or time.monotonic() <= self._died + REVIVED_WITHIN:
                return
            if self._is_own():
                lived = False
                return
            raise UnavailableError(f'{self._what}: the server lives no more', self._is_back)

        look()
        return look

    def _is_own(self) -> bool:
        """Tell whether a server is in the client's participant."""
        readers = self._node.get_subscriptions_info_by_topic(self._subscription.topic_name)
        own = self._node.get_name(), self._node.get_namespace()
        return any(
            tuple(reader.endpoint_gid)[:_PREFIX] in self._servers.in_processes()
            for reader in readers
            if (reader.node_name, reader.node_namespace) == own
        )


class _ActionClient(ActionClient):
    """An action client that takes no answer before it has noted what it asked.

    rclpy 7.1 sends a request and notes it afterwards. An answer that the executor takes in between
    is dropped as unexpected, and its future is never done.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._asking = threading.RLock()
        super().__init__(*args, **kwargs)

    def send_goal_async(self, *args: Any, **kwargs: Any) -> Future:
        """Send a goal, see rclpy."""
        with self._asking:
            answer: Future = super().send_goal_async(*args, **kwargs)
            return answer

    def _get_result_async(self, goal_handle: Any) -> Future:
        with self._asking:
            answer: Future = super()._get_result_async(goal_handle)
            return answer

    def _cancel_goal_async(self, goal_handle: Any) -> Future:
        with self._asking:
            answer: Future = super()._cancel_goal_async(goal_handle)
            return answer

    async def execute(self, taken_data: Any) -> None:
        """Take answers in, see rclpy."""
        with self._asking:
            pass
        await super().execute(taken_data)


class GoalCaller:
    """Sends goals to one action server, one at a time.

    A server that dies or restarts in the middle is noticed, as `ServiceCaller.call` does; an answer
    that is lost is asked for again.

    Args:
        node: The node that calls; an executor must spin it.
        action_type: The action's type.
        name: The action's name, relative to the node's namespace.
        cancel_timeout: Seconds that a server may take to end a cancelled goal.
        executor_patience: Seconds without a sign of the node's executor after which it is looked
            for, and again after which a goal that runs is given up; by default that is left alone.
    """

    def __init__(
        self,
        node: Node,
        action_type: Any,
        name: str,
        cancel_timeout: float = 2.0,
        executor_patience: float = math.inf,
    ) -> None:
        self._node = node
        self._client = _ActionClient(
            node, action_type, name, callback_group=ReentrantCallbackGroup(), **ACTION_CLIENT_QOS
        )
        own(node, self._client)
        self._cancel_timeout = cancel_timeout
        self._what = f'action {name}'
        results = node.resolve_service_name(f'{name}/_action/get_result')
        self._servers = _Servers(node, results, self.is_ready, self._what)
        self._liveliness = _Liveliness(node, name, self._servers, self._what)
        self._executor_patience = executor_patience
        self._spun = threading.Event()
        self._spin = node.create_guard_condition(self._spun.set)
        self.name = name
        self.round_trips = RoundTrips()

    def is_ready(self) -> bool:
        """Tell whether the server is there now."""
        return bool(self._client.server_is_ready())

    def _look_at_executor(self) -> Callable[[], None]:
        """Return a look that raises `UnavailableError` once the executor does not spin."""
        due = time.monotonic() + self._executor_patience
        self._spun.set()

        def look() -> None:
            nonlocal due
            if time.monotonic() < due:
                return
            if not self._spun.is_set():
                raise UnavailableError(f"{self._what}: the node's executor does not spin")
            self._spun.clear()
            self._spin.trigger()
            due = time.monotonic() + self._executor_patience

        return look

    def run(
        self,
        goal: Any,
        *,
        accept_timeout: float,
        result_timeout: float | None = None,
        interrupt: Interrupt | None = None,
        on_feedback: Callable[[Any], None] | None = None,
    ) -> GoalEnd:
        """Send a goal and block until it ends; from a worker thread only.

        Args:
            goal: The goal message.
            accept_timeout: Seconds for finding the server and for its yes or no; on a slow link
                that may take longer, see `RoundTrips`.
            result_timeout: Seconds for the result after that; None waits as long as the server
                lives. When it passes, the goal is cancelled.
            interrupt: Ends the wait early; the goal is cancelled on the server.
            on_feedback: Called with each feedback message, in the executor's thread.

        Raises:
            UnavailableError: No server within the time, or it went away in the middle, or the
                executor did.
            CallTimeoutError: No yes or no, or no result, within the time.
            CallInterruptedError: The interrupt was raised; the server was told to cancel and has
                ended the goal, or had `cancel_timeout` to do so.
        """
        deadline = time.monotonic() + accept_timeout
        await_ready(self.is_ready, deadline, interrupt, self._what)
        # From before the goal is sent: a server that goes right after its yes is seen going.
        look, look_for_death = self._servers.look_for_loss(), self._liveliness.look_for_death()
        deadline += self.round_trips.deadline(accept_timeout) - accept_timeout
        handle = self._send(goal, deadline, interrupt, on_feedback)
        if not handle.accepted:
            return GoalEnd('rejected', None)
        look_at_executor = self._look_at_executor()

        def look_at_all() -> None:
            look()
            look_for_death()
            look_at_executor()

        running = _RunningGoal(handle, look_at_all, self._what)
        try:
            return running.await_end(result_timeout, interrupt)
        except UnavailableError:
            running.abandon()
            raise
        except CallTimeoutError:
            running.cancel(self._cancel_timeout)
            raise CallTimeoutError(f'{self._what}: no result within {result_timeout:g} s') from None
        except CallInterruptedError:
            running.cancel(self._cancel_timeout)
            raise

    def _send(
        self,
        goal: Any,
        deadline: float,
        interrupt: Interrupt | None,
        on_feedback: Callable[[Any], None] | None,
    ) -> Any:
        """Send a goal and wait for its yes or no; return the handle."""
        feedback = None
        if on_feedback is not None:
            told = on_feedback

            def feedback(message: Any) -> None:
                told(message.feedback)

        look_for_loss = self._servers.look_for_loss(DOUBTFUL_SECONDS)
        look_for_death = self._liveliness.look_for_death()

        def look() -> None:
            look_for_loss()
            look_for_death()

        sent = self._client.send_goal_async(goal, feedback_callback=feedback)
        try:
            with self.round_trips.measured():
                handle = block_on(sent, deadline, interrupt, self._what, look)
        except CallError:
            # The goal may be accepted yet; it must not run on unseen.
            sent.add_done_callback(_cancel_when_accepted)
            raise
        _show(self._node, self.name, self.round_trips)
        return handle


def _cancel_when_accepted(sent: Future) -> None:
    handle = sent.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()


class _RunningGoal:
    """A goal that its server has accepted, until its end is known.

    Args:
        handle: rclpy's handle of the goal.
        look_for_loss: Raises `UnavailableError` once the server is lost.
        what: Names the server in errors.
    """

    def __init__(self, handle: Any, look_for_loss: Callable[[], None], what: str) -> None:
        self._handle = handle
        self._look_for_loss = look_for_loss
        self._what = what
        self._ended = Future()
        self._requests: list[Future] = []
        self._cancelling = False
        self._period = RESULT_PERIOD
        self._said_to_end = False
        self._ask()

    def await_end(self, timeout: float | None, interrupt: Interrupt | None) -> GoalEnd:
        """Wait for the end.

        Raises:
            UnavailableError: The server went away, or does not know the goal any more.
            CallTimeoutError: The goal did not end in time.
            CallInterruptedError: The interrupt was raised.
        """
        deadline = math.inf if timeout is None else time.monotonic() + timeout
        response = block_on(self._ended, deadline, interrupt, self._what, self._look)
        if response.status not in _STATUS:
            raise UnavailableError(f'{self._what}: the server does not know the goal any more')
        return GoalEnd(_STATUS[response.status], response.result)

    def cancel(self, timeout: float) -> None:
        """Have the server end the goal, and give it some time for that."""
        self._cancelling = True
        self._ask()
        with suppress(CallError):
            self.await_end(timeout, None)

    def abandon(self) -> None:
        """Expect nothing more from the server; if it is there after all, it ends the goal."""
        for request in self._requests:
            request.cancel()
        self._handle.cancel_goal_async()

    def _look(self) -> None:
        self._look_for_loss()
        if not self._said_to_end and self._handle.status in _STATUS:
            # The result is under way.
            self._said_to_end, self._period = True, RESULT_PERIOD
            self._asked = time.monotonic()
        if time.monotonic() > self._asked + (CANCEL_PERIOD if self._cancelling else self._period):
            # Of a goal whose status never came, no end will be told, either.
            if not self._said_to_end and self._handle.status != GoalStatus.STATUS_UNKNOWN:
                self._period = min(2.0 * self._period, LONGEST_RESULT_PERIOD)
            self._ask()

    def _ask(self) -> None:
        self._asked = time.monotonic()
        if self._cancelling:
            self._handle.cancel_goal_async().add_done_callback(self._on_cancel_answered)
        request = self._handle.get_result_async()
        request.add_done_callback(self._on_result)
        self._requests.append(request)

    def _on_cancel_answered(self, _answer: Future) -> None:
        # Whatever the answer is, the server has heard of it.
        self._cancelling = False

    def _on_result(self, answer: Future) -> None:
        if answer.done() and not self._ended.done():
            self._ended.set_result(answer.result())
