"""A sleep on ROS time that wakes at once when an `Interrupt` is raised.

`ClockWait` sleeps on a node's clock, so that under `use_sim_time` a
mission runs as fast as `/clock` does; it needs the node to be spun by an executor then.
"""

from __future__ import annotations

import threading
from typing import Any

from rclpy.clock import ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node

from surveillance_runtime.interrupt import Interrupt as Interrupt


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
