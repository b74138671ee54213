"""The battery as the behaviour sees it: what was heard last, and who wants to know of changes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from surveillance_fsm import Interrupt


class BatteryGauge:
    """What came in last of the battery. Safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._level: float | None = None
        self._low = False
        self._charging: bool | None = None
        self._watchers: list[Callable[[], object]] = []

    @property
    def level(self) -> float | None:
        """Charge in percent; None: not heard yet."""
        return self._level

    @property
    def low(self) -> bool:
        """Whether the battery's own warning is up."""
        return self._low

    @property
    def charging(self) -> bool | None:
        """Whether the battery is being charged; None: nobody said."""
        return self._charging

    def set_level(self, percent: float) -> None:
        """A level came in."""
        with self._lock:
            self._level = percent
        self._tell()

    def set_low(self, low: bool) -> None:
        """The battery's own warning came or went."""
        with self._lock:
            self._low = low
        self._tell()

    def set_charging(self, charging: bool | None) -> None:
        """It was said whether the battery is being charged; None: that is not known."""
        with self._lock:
            changed, self._charging = charging != self._charging, charging
        if changed:
            self._tell()

    def watch(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Calls back on each message; the function returned ends that."""
        with self._lock:
            self._watchers.append(callback)

        def remove() -> None:
            with self._lock:
                self._watchers.remove(callback)

        return remove

    def _tell(self) -> None:
        with self._lock:
            watchers = tuple(self._watchers)
        for callback in watchers:
            callback()

    @contextmanager
    def interrupting(
        self, preempt: Interrupt, condition: Callable[[], bool]
    ) -> Iterator[Interrupt]:
        """An interrupt that is raised by ``preempt``, and as soon as ``condition`` holds.

        The condition is looked at now and whenever something is heard of the battery.
        """
        either = Interrupt()

        def look() -> None:
            if condition():
                either.set()

        forget_preempt = preempt.subscribe(either.set)
        forget_battery = self.watch(look)
        try:
            look()
            yield either
        finally:
            forget_battery()
            forget_preempt()
