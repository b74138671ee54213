"""A flag wakes who waits for it, and nobody else, whatever other threads do meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import state_machines as fsm


class HookedLock:
    """A flag's lock that runs something when it is left for the first time."""

    def __init__(self, lock: Any, after: Callable[[], None]) -> None:
        self._lock = lock
        self._after: list[Callable[[], None]] = [after]

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()
        if self._after:
            self._after.pop()()


def test_who_waits_after_a_clear_is_not_woken_by_the_flag_before() -> None:
    flag = fsm.Interrupt()
    plain: Any = flag._lock
    waits, woken = threading.Event(), threading.Event()

    def wait() -> None:
        flag.wait()
        woken.set()

    def meanwhile() -> None:
        flag._lock = plain
        flag.clear()
        flag._lock = HookedLock(plain, waits.set)  # type: ignore[assignment]
        threading.Thread(target=wait, daemon=True).start()
        assert waits.wait(30.0)

    flag._lock = HookedLock(plain, meanwhile)  # type: ignore[assignment]
    flag.set()
    flag.set()
    assert woken.wait(30.0)


def test_a_flag_that_a_signal_raises_before_the_wait_begins_ends_it() -> None:
    flag = fsm.Interrupt()

    class Interrupted(list[Any]):
        """What a handler does that runs just before a waiter is noted, in the same thread."""

        def append(self, waiter: Any) -> None:
            flag._waiters = []
            flag.set()
            flag._waiters.append(waiter)

    flag._waiters = Interrupted()
    waiter = threading.Thread(target=flag.wait, daemon=True)
    waiter.start()
    waiter.join(10.0)
    assert not waiter.is_alive()
    assert flag._waiters == []
