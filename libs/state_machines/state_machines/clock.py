"""Waiting that a preempt ends: the flag that ends it, and the clock that a machine goes by.

A machine takes its time from one object with ``now()`` and ``sleep(seconds, interrupt)``. The
default is the wall clock; a ROS node passes one that waits on ROS time, a test one that it turns
by hand.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol


class Interrupt:
    """A flag that wakes whoever waits for it, in any thread."""

    __slots__ = ('_callbacks', '_lock', '_set', '_waiters')

    def __init__(self) -> None:
        # Reentrant: a signal handler may raise the flag in the middle of these methods.
        self._lock = threading.RLock()
        self._set = False
        self._waiters: list[threading.Lock] = []
        self._callbacks: dict[object, Callable[[], None]] = {}

    def set(self) -> None:
        """Raise the flag, wake all waiters and run the subscribed callbacks."""
        with self._lock:
            if self._set:
                return
            self._set = True
            # A new list also for an empty one: who waits after `clear()`, while this goes on
            # below without the lock, is not to be found here.
            waiters, self._waiters = self._waiters, []
            callbacks = list(self._callbacks.values()) if self._callbacks else ()
        for waiter in waiters:
            waiter.release()
        for callback in callbacks:
            callback()

    def clear(self) -> None:
        """Lower the flag; callbacks stay subscribed."""
        with self._lock:
            self._set = False

    def is_set(self) -> bool:
        """Tell whether the flag is up."""
        return self._set

    def wait(self, timeout: float | None = None) -> bool:
        """Block until the flag is up.

        Args:
            timeout: Longest wait in seconds of steady time; None waits without limit.

        Returns:
            Whether the flag is up, or was raised meanwhile.
        """
        with self._lock:
            if self._set:
                return True
            if timeout is not None and timeout <= 0.0:
                return False
            waiter = threading.Lock()
            waiter.acquire()
            self._waiters.append(waiter)
            # A signal handler may have raised the flag since it was looked at.
            if self._set:
                if waiter in self._waiters:
                    self._waiters.remove(waiter)
                return True
        # The setter releases this lock outside of its own: who wakes has nothing to wait for.
        raised = False
        try:
            limit = -1.0 if timeout is None else min(timeout, threading.TIMEOUT_MAX)
            raised = waiter.acquire(timeout=limit)
        finally:
            if not raised:
                with self._lock:
                    if waiter in self._waiters:
                        self._waiters.remove(waiter)
        return raised or self._set

    def subscribe(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Run a callback each time the flag is raised, at once when it is up already.

        Returns:
            A function that ends the subscription.
        """
        key = object()
        with self._lock:
            self._callbacks[key] = callback
            already = self._set
        if already:
            callback()

        def remove() -> None:
            with self._lock:
                self._callbacks.pop(key, None)

        return remove


class Clock(Protocol):
    """Where a machine's seconds come from.

    One whose time may jump back has a method ``elapsed()``, too, which goes on as ``now()`` does,
    but never back; its sleeps last as long as that says.
    """

    def now(self) -> float:
        """Return the time in seconds; only differences have a meaning."""

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        """Wait; True when the full time passed, False when `interrupt` ended it."""


class WallClock:
    """The monotonic clock of the machine the program runs on."""

    def now(self) -> float:
        """Return the seconds of the monotonic clock."""
        return time.monotonic()

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        """Wait on the interrupt for at most `seconds`."""
        return not interrupt.wait(max(0.0, seconds))

    def __reduce__(self) -> str:
        # There is one: a copied or unpickled machine goes by it, too.
        return 'WALL_CLOCK'


WALL_CLOCK = WallClock()


def elapsed_of(clock: Clock) -> Callable[[], float]:
    """Return what tells how much time passes on a clock, whether it may jump back or not."""
    elapsed: Callable[[], float] = getattr(clock, 'elapsed', clock.now)
    return elapsed
