"""Waits that wake at once: a flag several threads can wait for, and a sleep on ROS time.

`Interrupt` knows no ROS. `ClockWait` sleeps on a node's clock, so that under `use_sim_time` a
mission runs as fast as `/clock` does; it needs the node to be spun by an executor then.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from typing import Any

from rclpy.clock import ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node


class Interrupt:
    """A flag that wakes whoever waits for it, in any thread."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._set = False
        self._callbacks: dict[int, Callable[[], None]] = {}
        self._keys = itertools.count()

    def set(self) -> None:
        """Raise the flag, wake all waiters and run the subscribed callbacks."""
        with self._condition:
            if self._set:
                return
            self._set = True
            callbacks = list(self._callbacks.values())
            self._condition.notify_all()
        for callback in callbacks:
            callback()

    def clear(self) -> None:
        """Lower the flag; callbacks stay subscribed."""
        with self._condition:
            self._set = False

    def is_set(self) -> bool:
        """Tell whether the flag is up."""
        return self._set

    def wait(self, timeout: float | None = None) -> bool:
        """Block until the flag is up.

        Args:
            timeout: Longest wait in seconds of steady time; None waits without limit.

        Returns:
            Whether the flag is up.
        """
        with self._condition:
            return self._condition.wait_for(lambda: self._set, timeout)

    def subscribe(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Run a callback each time the flag is raised, at once when it is up already.

        Returns:
            A function that ends the subscription.
        """
        with self._condition:
            key = next(self._keys)
            self._callbacks[key] = callback
            already = self._set
        if already:
            callback()

        def remove() -> None:
            with self._condition:
                self._callbacks.pop(key, None)

        return remove


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
