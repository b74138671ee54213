"""Charging: what was last heard of the battery, and the one procedure by which robots charge.

`charge` waits for the charging contact, watches the level, and gives up when it stalls. A machine
whose battery charges on request (`recharge`, patrol) hands in that request; without one the battery
charges by itself at the station (surveillance).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from patrol_policy.battery import Battery
from state_machines import Clock, Interrupt
from state_machines.exceptions import CallError, CallInterruptedError

LONG = 1e6
"""One wait without a limit, seconds; it is repeated as long as need be."""


class BatteryMonitor:
    """What came in last of the battery. Safe to use from several threads.

    Attributes:
        level: Charge in percent; None: not heard yet.
        low: Whether the battery's own warning is up.
        charging: Whether the battery is being charged; None: nobody said.
    """

    def __init__(self) -> None:
        self.level: float | None = None
        self.low = False
        self.charging: bool | None = None
        self._lock = threading.Lock()
        self._watchers: list[Callable[[], object]] = []

    def level_text(self) -> str:
        """Return the charge in words."""
        return Battery(self.level).level_text()

    def set_level(self, percent: float) -> None:
        """Take a level that came in."""
        self.level = percent
        self._tell()

    def set_low(self, low: bool) -> None:
        """Take the battery's own warning, or its end."""
        self.low = low
        self._tell()

    def set_charging(self, charging: bool | None) -> None:
        """Take whether the battery is being charged; None: that is not known."""
        if charging != self.charging:
            self.charging = charging
            self._tell()

    def watch(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call back on each message; the function returned ends that."""
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
        """Give an interrupt that is raised by ``preempt``, and as soon as ``condition`` holds.

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


def charge(
    battery: BatteryMonitor,
    enough: Callable[[], bool],
    clock: Clock,
    interrupt: Interrupt,
    *,
    stall_seconds: float = 300.0,
    settle_seconds: float = 2.0,
    recharge: Callable[[Interrupt], None] | None = None,
) -> None:
    """Charge at the station until it is enough.

    Args:
        battery: The battery.
        enough: Whether the robot may leave.
        clock: The mission's clock.
        interrupt: Ends it.
        stall_seconds: How long the level may stay the same; 0: for ever.
        settle_seconds: How long the battery's topics may lag behind, seconds of real time.
        recharge: Asks for a charge and returns when done; None: the battery charges by itself.

    Raises:
        CallError: The battery is not charged, or its level stalls.
        CallInterruptedError: The interrupt was raised.
    """
    while not enough():
        _await_contact(battery, enough, interrupt, settle_seconds)
        if enough():
            return
        if recharge is None:
            _watch_level(battery, enough, clock, interrupt, stall_seconds)
            continue
        with battery.interrupting(interrupt, lambda: battery.charging is False) as off:
            try:
                recharge(off)
            except CallInterruptedError:
                if interrupt.is_set():
                    raise
                continue
        with battery.interrupting(interrupt, enough) as told:
            told.wait(settle_seconds)
        if interrupt.is_set():
            raise CallInterruptedError
        if not enough():
            raise CallError(f'recharge: it ended at {battery.level_text()}')


def _await_contact(
    battery: BatteryMonitor, enough: Callable[[], bool], interrupt: Interrupt, seconds: float
) -> None:
    """Wait until a battery that says it is not being charged says otherwise.

    Raises:
        CallError: It does not in time: the robot is not where it can charge.
        CallInterruptedError: The interrupt was raised.
    """

    def contact() -> bool:
        return battery.charging is not False or enough()

    with battery.interrupting(interrupt, contact) as told:
        told.wait(seconds)
    if interrupt.is_set():
        raise CallInterruptedError
    if not contact():
        raise CallError(
            f'battery: it is not charged ({battery.level_text()}): the robot is not at a station'
        )


def _watch_level(
    battery: BatteryMonitor,
    enough: Callable[[], bool],
    clock: Clock,
    interrupt: Interrupt,
    seconds: float,
) -> None:
    """Wait until the level has risen, is enough, or the contact is lost.

    Raises:
        CallError: Nothing of that happened in time.
        CallInterruptedError: The interrupt was raised.
    """
    before = battery.level

    def news() -> bool:
        level = battery.level
        risen = level is not None and (before is None or level > before)
        return risen or battery.charging is False or enough()

    with battery.interrupting(interrupt, news) as wake:
        late = clock.sleep(seconds if seconds > 0.0 else LONG, wake)
    if interrupt.is_set():
        raise CallInterruptedError
    if late and seconds > 0.0:
        raise CallError(f'battery: still at {battery.level_text()} after {seconds:g} s')
