"""A flag that several threads can wait for, and that wakes them at once.

It stands apart from the waits on ROS time, so that programs without ROS can use it.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable


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
