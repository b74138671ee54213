"""Waiting that a preempt ends: what a clock must offer, and the wall clock that does.

A machine takes its time from one object with ``now()`` and ``sleep(seconds, interrupt)``. The
default is the wall clock; a ROS node passes one that waits on ROS time, a test one that it turns
by hand.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol


class Interruptible(Protocol):
    """The part of an interrupt that a clock needs to end a sleep early."""

    def is_set(self) -> bool:
        """Whether the interrupt is raised."""

    def wait(self, timeout: float | None = None) -> bool:
        """Block until raised or `timeout` seconds have passed; tell whether it is raised."""

    def subscribe(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` when raised (at once if it is); the function returned ends that."""


class Clock(Protocol):
    """Where a machine's seconds come from."""

    def now(self) -> float:
        """The time in seconds; only differences have a meaning."""

    def sleep(self, seconds: float, interrupt: Interruptible) -> bool:
        """Wait; True when the full time passed, False when `interrupt` ended it."""


class Interrupt:
    """An event that also calls its subscribers, so that a wait of any kind can be ended."""

    __slots__ = ('_event', '_lock', '_subscribers')

    def __init__(self) -> None:
        self._event = threading.Event()
        self._lock = threading.Lock()
        self._subscribers: list[Callable[[], object]] = []

    def set(self) -> None:
        """Raise it: waiters wake and subscribers are called."""
        with self._lock:
            self._event.set()
            subscribers = tuple(self._subscribers)
        for callback in subscribers:
            callback()

    def clear(self) -> None:
        """Take it back."""
        self._event.clear()

    def is_set(self) -> bool:
        """Whether it is raised."""
        return self._event.is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Block until raised or `timeout` seconds have passed; tell whether it is raised."""
        return self._event.wait(timeout)

    def subscribe(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` when raised (at once if it is); the function returned ends that."""
        with self._lock:
            self._subscribers.append(callback)
            raised = self._event.is_set()
        if raised:
            callback()

        def remove() -> None:
            with self._lock:
                if callback in self._subscribers:
                    self._subscribers.remove(callback)

        return remove


class WallClock:
    """The monotonic clock of the machine the program runs on."""

    def now(self) -> float:
        """Seconds of the monotonic clock."""
        return time.monotonic()

    def sleep(self, seconds: float, interrupt: Interruptible) -> bool:
        """Wait on the interrupt for at most `seconds`."""
        return not interrupt.wait(max(0.0, seconds))


WALL_CLOCK = WallClock()
