"""A state that watches a topic."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

import surveillance_fsm as fsm
from surveillance_fsm.container import describe
from surveillance_fsm.ros.exchange import seconds


class MonitorState(fsm.State):
    """Looks at each message of a topic until one is not as it should be.

    It ends with ``invalid`` when `cond_cb` says no, with ``valid`` after `max_checks` messages for
    which it said yes, and with ``preempted``. Watching has no end of its own; give `timeout` where
    silence is a fault.

    Args:
        node: The node that subscribes; an executor must spin it in another thread.
        topic: The topic's name.
        msg_type: The topic's type.
        cond_cb: ``(userdata, message)``; whether the message is as it should be.
        max_checks: Messages to look at; -1 for no limit.
        input_keys: Userdata that `cond_cb` reads.
        output_keys: Userdata that `cond_cb` writes.
        io_keys: Both.
        timeout: Longest silence, seconds of steady time (or an rclpy ``Duration``), after which the
            state ends with ``invalid``.
        qos: The subscription's profile. With transient local durability the last message counts
            also when it came before the state.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        msg_type: Any,
        cond_cb: Callable[[Any, Any], Any],
        max_checks: int = -1,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
        *,
        timeout: Any = None,
        qos: QoSProfile | int = 10,
    ) -> None:
        super().__init__(['valid', 'invalid', 'preempted'], input_keys, output_keys, io_keys)
        if not callable(cond_cb):
            raise fsm.InvalidStateError(f'cond_cb {cond_cb!r} cannot be called')
        declared: Any = cond_cb
        if fsm.has_smach_interface(declared):
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())
        self._topic = topic
        self._cond_cb = cond_cb
        self._max_checks = max_checks
        self._timeout = seconds(timeout)
        self._changed = threading.Condition()
        self._ud: Any = None
        self._checks = 0
        self._verdict: str | None = None
        self._heard = 0.0
        self._latched = (
            isinstance(qos, QoSProfile) and qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        )
        self._last: Any = None
        # Made once: an entity must not be destroyed while an executor spins.
        self._subscription = node.create_subscription(msg_type, topic, self._arrived, qos)

    def execute(self, ud: Any) -> str:
        """Watch."""
        remove = self.interrupt.subscribe(self._wake)
        with self._changed:
            self._ud, self._checks, self._verdict = ud, 0, None
            self._heard = time.monotonic()
            if self._last is not None:
                self._look_at(self._last)
        try:
            with self._changed:
                while self._verdict is None and not self.preempt_requested():
                    left = None
                    if self._timeout is not None:
                        left = self._heard + self._timeout - time.monotonic()
                        if left <= 0.0:
                            fsm.logwarn(f"Topic '{self._topic}': silent for {self._timeout:g} s")
                            self._verdict = 'invalid'
                            break
                    self._changed.wait(left)
                self._ud = None
                verdict = self._verdict
        finally:
            remove()
        if verdict is None or self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        return verdict

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _arrived(self, message: Any) -> None:
        with self._changed:
            if self._latched:
                self._last = message
            if self._ud is not None and self._verdict is None:
                self._look_at(message)
                self._changed.notify_all()

    def _look_at(self, message: Any) -> None:
        self._heard = time.monotonic()
        try:
            good = bool(self._cond_cb(self._ud, message))
        except Exception as error:
            fsm.logerr(f"Topic '{self._topic}': cond_cb raised {describe(error)}")
            good = False
        if not good:
            self._verdict = 'invalid'
            return
        self._checks += 1
        if 0 < self._max_checks <= self._checks:
            self._verdict = 'valid'
