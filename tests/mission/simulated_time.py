"""Time that stands still while anybody works, and jumps when all there is to do is wait.

A mission under ``use_sim_time`` usually runs against a clock that ticks on its own: what happens
first then depends on how busy the machine is. Here the clock moves only while one of the threads
that carry the mission on (the state machine, a goal, a charge) sleeps on it and nobody else whom
time woke is still at work, and then to the moment at which the next of all sleepers is due. Hours
take seconds, and a run with the same seeds takes the same course.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from rosgraph_msgs.msg import Clock

from surveillance_fsm.ros import ClockWait

CARRIES_ON = ('surveillance', 'patrol', 'machine', ' goal', '_recharge')
"""Ends of the names of threads whose sleep means that nothing else is under way."""

STEP = 0.5
"""Time passes in steps of at least this many seconds; sleeps may last that much longer."""
MOMENT = 1e-6
"""Sleeps shorter than this wait for nothing that time would bring, seconds."""
START = 1.0
"""The first moment, seconds; at 0 nothing has a time yet."""


class SimulatedTime:
    """Drives ``/clock`` for the nodes of a graph.

    Attributes:
        now: The present moment, seconds.
        error: What an action raised; time has ended then.
        unattended: Nobody carries a mission on at present; time passes all the same.
    """

    def __init__(self, graph: Any) -> None:
        self._nodes: Callable[[], list[Any]] = list
        self._topic = graph.node.create_publisher(Clock, '/clock', 10)
        self._condition = threading.Condition()
        self._sleepers: dict[int, tuple[float, str]] = {}
        self._at_work: set[threading.Thread] = set()
        self._all_heard: Callable[[], bool] = lambda: True
        self._ended = False
        self.unattended = False
        self.error: BaseException | None = None
        self.now = START
        self.alarms: list[tuple[float, Any]] = []
        self._thread = threading.Thread(target=self._run, name='simulated time')

    def follow(self, nodes: Callable[[], list[Any]], all_heard: Callable[[], bool]) -> None:
        """Name the nodes that must have seen each moment before the next one comes.

        ``all_heard``: whether no message is under way that the next moment must not overtake.
        """
        self._nodes, self._all_heard = nodes, all_heard

    def start(self) -> None:
        """Let time run."""
        self._publish()
        self._thread.start()

    def tell(self) -> None:
        """Tell a node that has just come what time it is."""
        self._publish()

    def stop(self) -> None:
        """End time; sleepers stay asleep."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()
        self._thread.join(60.0)

    def at(self, seconds: float, action: Any) -> None:
        """Do something ``seconds`` after the start, while everybody sleeps."""
        with self._condition:
            self.alarms.append((START + seconds, action))
            self.alarms.sort(key=lambda alarm: alarm[0])

    def fell_asleep(self, deadline: float) -> None:
        """Have the calling thread sleep until ``deadline``."""
        thread = threading.current_thread()
        with self._condition:
            self._sleepers[threading.get_ident()] = (deadline, thread.name)
            self._at_work.discard(thread)
            self._condition.notify_all()

    def woke_up(self, *, in_time: bool) -> None:
        """Have the calling thread go on; ``in_time``: nobody has interrupted its sleep."""
        thread = threading.current_thread()
        with self._condition:
            self._sleepers.pop(threading.get_ident(), None)
            if in_time and not thread.name.endswith(CARRIES_ON):
                # It does what time has brought, and sleeps again: a battery that changes at random.
                self._at_work.add(thread)
            self._condition.notify_all()

    def _run(self) -> None:
        while True:
            with self._condition:
                while not (self._ended or self._all_wait()):
                    self._condition.wait(0.01)  # no word of a thread's end, or of a message
                if self._ended:
                    return
                due = min(deadline for deadline, _ in self._sleepers.values())
                due = max(due, self.now + STEP)
                action = None
                if self.alarms and self.alarms[0][0] <= due:
                    due, action = self.alarms.pop(0)
            self.now = max(self.now, due)
            self._publish()
            if action is not None:
                try:
                    action()
                except BaseException as error:
                    self.error = error
                    raise
            with self._condition:
                self._condition.wait_for(lambda: self._ended or not self._overdue(), timeout=60.0)

    def _all_wait(self) -> bool:
        if any(thread.is_alive() for thread in self._at_work):
            return False
        if not self._all_heard():
            return False
        if self.unattended:
            return bool(self._sleepers)
        return any(name.endswith(CARRIES_ON) for _, name in self._sleepers.values())

    def _overdue(self) -> bool:
        return any(deadline <= self.now + 1e-9 for deadline, _ in self._sleepers.values())

    def _publish(self) -> None:
        message = Clock()
        message.clock.sec = int(self.now)
        message.clock.nanosec = round((self.now - int(self.now)) * 1e9) % 10**9
        nanoseconds = message.clock.sec * 10**9 + message.clock.nanosec
        late = time.monotonic() + 60.0
        self._topic.publish(message)
        told = time.monotonic()
        while any(node.get_clock().now().nanoseconds < nanoseconds for node in self._nodes()):
            assert time.monotonic() < late, 'a node does not follow the clock'
            if time.monotonic() > told + 0.02:
                # A node that has just come had not met this topic yet.
                self._topic.publish(message)
                told = time.monotonic()
            threading.Event().wait(0.001)


@contextmanager
def simulated_time(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatedTime]:
    """Put the graph's nodes on simulated time; call ``start`` once they are there."""
    driver = SimulatedTime(graph)
    sleep = ClockWait.sleep

    def watched(self: ClockWait, seconds: float, interrupt: Any = None) -> bool:
        if seconds < MOMENT:
            # It only waits for time to begin.
            return sleep(self, seconds, interrupt)
        driver.fell_asleep(self.now() + seconds)
        in_time = False
        try:
            in_time = sleep(self, seconds, interrupt)
            return in_time
        finally:
            driver.woke_up(in_time=in_time)

    monkeypatch.setattr(ClockWait, 'sleep', watched)
    try:
        yield driver
    finally:
        driver.stop()
