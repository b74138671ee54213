"""What the states and servers stand on: sleep on ROS time, work aside, deep queues, a node's end.

Everything works with a plain ``rclpy`` node. A node that has more is used: ``stopping`` (an
`Interrupt` that is raised when the node stops), ``own`` (takes what is to be destroyed with the
node) and ``spawn`` (starts a thread that the node joins).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import JumpThreshold, ROSClock
from rclpy.duration import Duration
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.task import Future

from state_machines.clock import Interrupt
from state_machines.container import Container


def _service_qos(depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


SERVICE_QOS = _service_qos(5000)
"""For servers. The default of rclpy keeps 10 requests and drops further ones without a word, those
of other clients too."""

CLIENT_QOS = _service_qos(2000)
"""For clients of services: answers that arrive while the executor is busy are kept."""

ALIVE_WITHIN = Duration(seconds=1.5)
"""The middleware of an action server tells at least so often that its process lives (DDS 1.4,
2.2.3.11, by itself: no thread of Python is needed). Clients learn by that that one was killed, and
not by the 20 s after which a silent process is forgotten."""

STATUS_QOS = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=ALIVE_WITHIN,
)
"""For an action's status: rcl's own, and that the server lives."""

ACTION_SERVER_QOS = {
    f'{service}_service_qos_profile': SERVICE_QOS for service in ('goal', 'result', 'cancel')
} | {'status_pub_qos_profile': STATUS_QOS}
ACTION_CLIENT_QOS = {
    f'{service}_service_qos_profile': CLIENT_QOS for service in ('goal', 'result', 'cancel')
}
"""The same for the three services of an action, and its status, as arguments of rclpy's classes."""


def own(node: Node, entity: Any) -> None:
    """Have an entity destroyed with its node, if the node takes such: rclpy forgets some."""
    take = getattr(node, 'own', None)
    if take is not None:
        take(entity)


def stopping_of(node: Node) -> Interrupt | None:
    """Return what a node raises when it stops; None for a plain one."""
    stopping = getattr(node, 'stopping', None)
    return stopping if isinstance(stopping, Interrupt) else None


def set_preempt_handler(node: Node, container: Container, timeout: float = 5.0) -> None:
    """Preempt a container when the node stops or its ROS context shuts down.

    Args:
        node: The node whose end counts.
        container: A root.
        timeout: How long a shutdown of the context is held up for the container to end, seconds of
            steady time.
    """

    def ended() -> None:
        container.request_preempt()
        with container.control.condition:
            container.control.condition.wait_for(lambda: not container.is_running(), timeout)

    stopping = stopping_of(node)
    if stopping is not None:
        # The executor still spins then, and brings what the states wait for: no need to block.
        stopping.subscribe(container.request_preempt)
    node.context.on_shutdown(ended)


def seconds(duration: Any) -> float | None:
    """Return a duration in seconds: a number, an rclpy ``Duration``, or None."""
    if duration is None or isinstance(duration, int | float):
        return duration
    return float(duration.nanoseconds) / 1e9


class ClockWait:
    """Sleeps on a node's clock that an `Interrupt` ends early.

    How long a sleep lasts does not depend on the date: without `use_sim_time` it is counted by the
    steady clock, so that setting the machine's clock neither ends a sleep nor prolongs it.

    Args:
        node: The node whose clock counts; wall time, or `/clock` under `use_sim_time`.
    """

    def __init__(self, node: Node) -> None:
        self._clock = node.get_clock()
        self._changed = threading.Condition()
        # rclpy hands the handle's address to C, so it must live as long as the clock.
        self._jumps = self._clock.create_jump_callback(
            JumpThreshold(
                min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1)
            ),
            post_callback=self._on_jump,
        )
        # How far the clock has jumped back altogether, nanoseconds.
        self._back = 0

    def now(self) -> float:
        """Return the clock's time in seconds."""
        return float(self._clock.now().nanoseconds) / 1e9

    def elapsed(self) -> float:
        """Return the seconds that have passed since some moment; a jump back takes none off.

        Without `use_sim_time` no setting of the machine's clock counts.
        """
        return float(self._passed()) / 1e9

    def sleep(self, seconds: float, interrupt: Interrupt | None = None) -> bool:
        """Block for a time on the node's clock; never call it from a callback.

        When the clock jumps back, as when a simulation begins anew, the sleep lasts no longer.

        Args:
            seconds: How long to sleep; zero or less only looks at the interrupt.
            interrupt: Ends the sleep early when it is raised.

        Returns:
            True when the whole time passed, False when the interrupt came first.
        """
        remaining = round(seconds * 1e9)
        follows_topic = self._follows_topic()
        deadline = self._passed() + remaining
        remove = interrupt.subscribe(self._wake) if interrupt is not None else None
        try:
            with self._changed:
                while True:
                    if interrupt is not None and interrupt.is_set():
                        return False
                    if follows_topic != self._follows_topic():
                        follows_topic = not follows_topic
                        deadline = self._passed() + remaining
                    remaining = deadline - self._passed()
                    if remaining <= 0:
                        return True
                    self._changed.wait(None if follows_topic else remaining / 1e9)
        finally:
            if remove is not None:
                remove()

    def wait_for_time(self, interrupt: Interrupt) -> bool:
        """Block until the clock has a time: under `use_sim_time` it is 0 before the first message.

        Returns:
            True when it has one, False when the interrupt came first.
        """
        remove = interrupt.subscribe(self._wake)
        try:
            with self._changed:
                self._changed.wait_for(lambda: self.now() or interrupt.is_set())
        finally:
            remove()
        return not interrupt.is_set()

    def _follows_topic(self) -> bool:
        return isinstance(self._clock, ROSClock) and self._clock.ros_time_is_active

    def _passed(self) -> int:
        if not self._follows_topic():
            return time.monotonic_ns()
        return int(self._clock.now().nanoseconds) + self._back

    def _on_jump(self, jump: Any) -> None:
        self._back += max(0, -jump.delta.nanoseconds)
        self._wake()

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()


def work_aside(node: Node, work: Callable[[], Any], name: str) -> Future:
    """Do work on a thread of its own.

    Args:
        node: The node whose callback awaits. One that can ``spawn`` joins the thread when it stops.
        work: What to do; it may block.
        name: The thread's name.

    Returns:
        What the work returns or raises, to be awaited in a callback.
    """
    future, report = reported(node, work)
    spawn = getattr(node, 'spawn', None)
    if spawn is not None:
        spawn(report, name)
    else:
        threading.Thread(target=report, name=name, daemon=True).start()
    return future


def reported(node: Node, work: Callable[[], Any]) -> tuple[Future, Callable[[], None]]:
    """Return a future, and the work that completes it."""
    future = Future()

    def report() -> None:
        try:
            result = work()
        except Exception as error:
            future.set_exception(error)
        else:
            future.set_result(result)
        wake_executor(node)

    return future, report


def executor_of(node: Node) -> Executor:
    """Return the executor that spins a node.

    Raises:
        RuntimeError: None does.
    """
    if node.executor is None:
        raise RuntimeError(f'node {node.get_name()} is not spun by an executor')
    return node.executor


def wake_executor(node: Node) -> None:
    """Have the executor look at what another thread has completed."""
    if node.executor is not None:
        node.executor.wake()
