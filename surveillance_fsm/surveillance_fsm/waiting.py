"""Waiting that a preempt ends: what a clock must offer, and the wall clock that does.

A machine takes its time from one object with ``now()`` and ``sleep(seconds, interrupt)``. The
default is the wall clock; a ROS node passes one that waits on ROS time, a test one that it turns
by hand.
"""

from __future__ import annotations

import time
from typing import Protocol

from surveillance_runtime.interrupt import Interrupt as Interrupt


class Clock(Protocol):
    """Where a machine's seconds come from."""

    def now(self) -> float:
        """The time in seconds; only differences have a meaning."""

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        """Wait; True when the full time passed, False when `interrupt` ended it."""


class WallClock:
    """The monotonic clock of the machine the program runs on."""

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        """Wait on the interrupt for at most `seconds`."""
        return not interrupt.wait(max(0.0, seconds))


WALL_CLOCK = WallClock()
